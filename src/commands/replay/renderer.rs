//! One step of a runtime: from a measured position to the currents (eq. 8).

use crate::bundle::force_map::ForceMap;
use crate::bundle::load::Bundle;
use crate::bundle::rendering::HeightGrid;
use crate::bundle::replay::Answer;
use crate::lambda::{Allocation, Allocator, Reach};

/// Follows a finger on a bundle's object. Nothing is allocated on the heap after
/// [`Renderer::new`].
#[derive(Debug, Clone)]
pub struct Renderer {
    map: ForceMap,
    heights: HeightGrid,
    allocator: Allocator,
    lambda_n_per_m: f64,
    force_n_per_a: Vec<f64>,
}

/// The result of a step.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Step {
    /// How the position was answered.
    pub answer: Answer,
    /// Height of the surface there, m; 0 where there is none.
    pub height_m: f64,
    /// lambda h(x, y), N; 0 where there is no surface and outside the map.
    pub wanted_n: f64,
    /// The force of the commanded currents, the unpowered steel's pull included, N.
    pub force_n: f64,
    /// That pull, N.
    pub passive_n: f64,
    /// How the currents were chosen; `None` outside the map.
    pub allocation: Option<Allocation>,
}

/// Why a bundle cannot be rendered with position feedback.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum RendererError {
    /// Its lambda is null.
    #[error("has no force constant (lambda is null): nothing can be rendered")]
    NoForceConstant,
    /// Limits or resistances that no array has.
    #[error("{0}")]
    Circuit(#[from] crate::lambda::AllocatorError),
    /// Points that do not fit their grid.
    #[error("points.csv does not fit its grid")]
    Points,
}

impl Renderer {
    /// A renderer of `bundle`, of this or an older schema.
    ///
    /// # Errors
    /// See [`RendererError`].
    pub fn new(bundle: &Bundle) -> Result<Self, RendererError> {
        let runtime = &bundle.map.runtime;
        let lambda_n_per_m = runtime
            .lambda_n_per_m
            .ok_or(RendererError::NoForceConstant)?;
        let heights = HeightGrid::of_points(&bundle.manifest.points, &bundle.points)
            .ok_or(RendererError::Points)?;
        let allocator = Allocator::new(
            &runtime.resistance_ohm,
            &runtime.current_min_a,
            &runtime.current_max_a,
            runtime.total_current_max_a,
        )?;
        Ok(Self {
            map: ForceMap::new(bundle),
            heights,
            force_n_per_a: vec![0.0; allocator.coils()],
            allocator,
            lambda_n_per_m,
        })
    }

    /// Number of coils.
    #[must_use]
    pub fn coils(&self) -> usize {
        self.force_n_per_a.len()
    }

    /// The map.
    #[must_use]
    pub fn map(&self) -> &ForceMap {
        &self.map
    }

    /// The object's surface.
    #[must_use]
    pub fn heights(&self) -> &HeightGrid {
        &self.heights
    }

    /// The force constant, N/m.
    #[must_use]
    pub fn lambda_n_per_m(&self) -> f64 {
        self.lambda_n_per_m
    }

    /// Writes the currents (A) to command at (x, y, z) m: those of least power whose force is
    /// lambda h(x, y), or the nearest within the limits; none outside the map.
    ///
    /// # Panics
    /// When `currents_a` is shorter than the array.
    pub fn step(&mut self, position_m: [f64; 3], currents_a: &mut [f64]) -> Step {
        let Some(passive_n) = self.map.at(position_m, &mut self.force_n_per_a) else {
            currents_a[..self.coils()].fill(0.0);
            return Step {
                answer: Answer::Outside,
                height_m: 0.0,
                wanted_n: 0.0,
                force_n: 0.0,
                passive_n: 0.0,
                allocation: None,
            };
        };
        let [x, y, _] = position_m;
        let height_m = self.heights.height_m(x, y).unwrap_or(0.0);
        let wanted_n = self.lambda_n_per_m * height_m;
        let found = self
            .allocator
            .allocate(&self.force_n_per_a, wanted_n - passive_n, currents_a);
        Step {
            answer: match found.reach {
                Reach::Reached => Answer::Ok,
                Reach::Saturated => Answer::Saturated,
            },
            height_m,
            wanted_n,
            force_n: found.force_n + passive_n,
            passive_n,
            allocation: Some(found),
        }
    }

    /// Force per ampere of every coil at the last step inside the map, N/A.
    #[must_use]
    pub fn force_n_per_a(&self) -> &[f64] {
        &self.force_n_per_a
    }

    /// How far the last step's currents are from their optimum, relative; see
    /// [`Allocator::certificate`]. 0 outside the map.
    #[must_use]
    pub fn certificate(&self, step: &Step, currents_a: &[f64]) -> f64 {
        let wanted_n = step.wanted_n - step.passive_n;
        step.allocation.map_or(0.0, |found| {
            self.allocator
                .certificate(&self.force_n_per_a, wanted_n, currents_a, &found)
        })
    }
}
