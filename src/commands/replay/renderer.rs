//! One step of a runtime: from a measured position to the currents (eq. 8).

use crate::bundle::force_map::ForceMap;
use crate::bundle::load::Bundle;
use crate::bundle::rendering::HeightGrid;
use crate::bundle::replay::Answer;
use crate::lambda::{Allocation, Allocator, Reach, VECTOR_MET, VectorAllocation, VectorAllocator};

/// Follows a finger on a bundle's object. Nothing is allocated on the heap after
/// [`Renderer::new`].
#[derive(Debug, Clone)]
pub struct Renderer {
    map: ForceMap,
    heights: HeightGrid,
    allocator: Allocator,
    lambda_n_per_m: f64,
    force_n_per_a: Vec<f64>,
    /// Where all three components of the force are requested.
    vector: Option<VectorPart>,
}

/// What three rows need beside the upward one.
#[derive(Debug, Clone)]
struct VectorPart {
    allocator: VectorAllocator,
    /// [y, x, 3] on the nodes of the heights: the force over lambda times the height.
    direction: Vec<f64>,
    force_n_per_a: Vec<[f64; 3]>,
}

/// The result of a step.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Step {
    /// How the position was answered.
    pub answer: Answer,
    /// Height of the surface there, m; 0 where there is none.
    pub height_m: f64,
    /// Upward force requested, N: lambda h(x, y), or that part of a force along the normal; 0 where there
    /// is no surface and outside the map.
    pub wanted_n: f64,
    /// The upward force of the commanded currents, the unpowered steel's pull included, N.
    pub force_n: f64,
    /// The sideways force; `None` where the upward one alone is requested.
    pub sideways: Option<SidewaysStep>,
    /// That pull, N.
    pub passive_n: f64,
    /// How the currents were chosen; `None` outside the map.
    pub allocation: Option<Chosen>,
}

/// The sideways force of a step, along x and y.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SidewaysStep {
    /// Requested, N.
    pub wanted_n: [f64; 2],
    /// Of the commanded currents, N.
    pub force_n: [f64; 2],
}

/// How the currents of a step were chosen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Chosen {
    /// For the upward force.
    Upward(Allocation),
    /// For the force vector.
    Vector(VectorAllocation),
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
        let map = ForceMap::new(bundle);
        let requested = runtime
            .rendering
            .as_ref()
            .and_then(|r| r.requested.as_ref());
        let requested = requested.filter(|_| map.has_vectors());
        let vector = requested.map(|requested| {
            let allocator = VectorAllocator::new(
                &runtime.resistance_ohm,
                &runtime.current_min_a,
                &runtime.current_max_a,
                runtime.total_current_max_a,
                requested.sideways_weight,
            )?;
            Ok::<_, RendererError>(VectorPart {
                force_n_per_a: vec![[0.0; 3]; allocator.coils()],
                allocator,
                direction: requested.direction.clone(),
            })
        });
        Ok(Self {
            vector: vector.transpose()?,
            map,
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
    /// lambda h(x, y), in the direction requested, or the nearest within the limits; none outside the map.
    ///
    /// # Panics
    /// When `currents_a` is shorter than the array.
    pub fn step(&mut self, position_m: [f64; 3], currents_a: &mut [f64]) -> Step {
        if self.vector.is_some() {
            return self.vector_step(position_m, currents_a);
        }
        let Some(passive_n) = self.map.at(position_m, &mut self.force_n_per_a) else {
            return self.outside(currents_a);
        };
        let [x, y, _] = position_m;
        let height_m = self.heights.height_m(x, y).unwrap_or(0.0);
        let wanted_n = self.lambda_n_per_m * height_m;
        let found = self
            .allocator
            .allocate(&self.force_n_per_a, wanted_n - passive_n, currents_a);
        Step {
            answer: answer(found.reach),
            height_m,
            wanted_n,
            force_n: found.force_n + passive_n,
            sideways: None,
            passive_n,
            allocation: Some(Chosen::Upward(found)),
        }
    }

    /// A step for all three components of the force.
    fn vector_step(&mut self, position_m: [f64; 3], currents_a: &mut [f64]) -> Step {
        let Some(part) = &mut self.vector else {
            return self.outside(currents_a);
        };
        let Some(passive_n) = self.map.vectors_at(position_m, &mut part.force_n_per_a) else {
            return self.outside(currents_a);
        };
        for (upward, force) in self.force_n_per_a.iter_mut().zip(&part.force_n_per_a) {
            *upward = force[2];
        }
        let [x, y, _] = position_m;
        let found = self.heights.height_and_direction(x, y, &part.direction);
        let (height_m, direction) = found.unwrap_or((0.0, [0.0; 3]));
        let [wanted_x, wanted_y, wanted_n] =
            direction.map(|share| self.lambda_n_per_m * height_m * share);
        let requested = [wanted_x, wanted_y, wanted_n - passive_n];
        let found = part
            .allocator
            .allocate(&part.force_n_per_a, requested, currents_a);
        let [force_x, force_y, force_z] = found.force_n;
        Step {
            answer: answer(found.reach),
            height_m,
            wanted_n,
            force_n: force_z + passive_n,
            sideways: Some(SidewaysStep {
                wanted_n: [wanted_x, wanted_y],
                force_n: [force_x, force_y],
            }),
            passive_n,
            allocation: Some(Chosen::Vector(found)),
        }
    }

    fn outside(&self, currents_a: &mut [f64]) -> Step {
        currents_a[..self.coils()].fill(0.0);
        Step {
            answer: Answer::Outside,
            height_m: 0.0,
            wanted_n: 0.0,
            force_n: 0.0,
            sideways: self.vector.as_ref().map(|_| SidewaysStep {
                wanted_n: [0.0; 2],
                force_n: [0.0; 2],
            }),
            passive_n: 0.0,
            allocation: None,
        }
    }

    /// Whether all three components of the force are requested.
    #[must_use]
    pub fn is_vector(&self) -> bool {
        self.vector.is_some()
    }

    /// Force per ampere of every coil along x, y and z at the last step inside the map, N/A; empty
    /// where the upward one alone is requested.
    #[must_use]
    pub fn force_vectors_n_per_a(&self) -> &[[f64; 3]] {
        self.vector.as_ref().map_or(&[], |part| &part.force_n_per_a)
    }

    /// Force per ampere of every coil at the last step inside the map, N/A.
    #[must_use]
    pub fn force_n_per_a(&self) -> &[f64] {
        &self.force_n_per_a
    }

    /// How far the last step's currents are from their optimum, relative; see
    /// [`Allocator::certificate`]. Of a force vector the share below which its conditions of optimality were
    /// checked; 1 where they are not met. 0 outside the map.
    #[must_use]
    pub fn certificate(&self, step: &Step, currents_a: &[f64]) -> f64 {
        let wanted_n = step.wanted_n - step.passive_n;
        match step.allocation {
            None => 0.0,
            Some(Chosen::Upward(found)) => {
                self.allocator
                    .certificate(&self.force_n_per_a, wanted_n, currents_a, &found)
            }
            Some(Chosen::Vector(found)) => {
                if found.proven {
                    VECTOR_MET
                } else {
                    1.0
                }
            }
        }
    }
}

fn answer(reach: Reach) -> Answer {
    match reach {
        Reach::Reached => Answer::Ok,
        Reach::Saturated => Answer::Saturated,
    }
}
