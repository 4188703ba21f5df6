//! One step of a runtime: from a measured position to the currents (eq. 8).

use crate::bundle::force_map::ForceMap;
use crate::bundle::load::Bundle;
use crate::bundle::rendering::HeightGrid;
use crate::bundle::replay::Answer;
use crate::lambda::two_fingers::{GIVEN, allocate, between_magnets_n};
use crate::lambda::uncertainty::{RobustForm, RobustRuntime};
use crate::lambda::{
    Allocation, Allocator, ForceProblem, Reach, VECTOR_MET, VectorAllocation, VectorAllocator,
};

/// Follows a finger on a bundle's object. Nothing is allocated on the heap after
/// [`Renderer::new`]; currents chosen for the uncertainties take some memory at each step.
#[derive(Debug, Clone)]
pub struct Renderer {
    map: ForceMap,
    heights: HeightGrid,
    allocator: Allocator,
    lambda_n_per_m: f64,
    force_n_per_a: Vec<f64>,
    /// Where all three components of the force are requested.
    vector: Option<VectorPart>,
    /// Where currents are chosen for the uncertainties.
    robust: Option<RobustPart>,
    /// Where there are two fingers.
    pair: Option<PairPart>,
}

/// Limits and resistances of the array's currents.
#[derive(Debug, Clone)]
struct Limits {
    resistance_ohm: Vec<f64>,
    lower_a: Vec<f64>,
    upper_a: Vec<f64>,
    total_max_a: Option<f64>,
}

impl Limits {
    fn of(bundle: &Bundle) -> Self {
        let runtime = &bundle.map.runtime;
        Self {
            resistance_ohm: runtime.resistance_ohm.clone(),
            lower_a: runtime.current_min_a.clone(),
            upper_a: runtime.current_max_a.clone(),
            total_max_a: runtime.total_current_max_a,
        }
    }

    /// A problem without points.
    fn problem(&self) -> ForceProblem<'_> {
        ForceProblem {
            forces_n_per_a: &[],
            height_m: &[],
            offset_n: None,
            weights: None,
            lower_a: &self.lower_a,
            upper_a: &self.upper_a,
            total_max_a: self.total_max_a,
            resistance_ohm: &self.resistance_ohm,
        }
    }
}

/// Data for two fingers.
#[derive(Debug, Clone)]
struct PairPart {
    moment_a_m2: [f64; 3],
    limits: Limits,
    /// Forces per ampere of every coil along each axis, finger by finger, N/A.
    axes_n_per_a: [[Vec<f64>; 3]; 2],
}

/// Data for currents chosen for the uncertainties.
#[derive(Debug, Clone)]
struct RobustPart {
    form: RobustForm,
    limits: Limits,
    /// Forces per ampere at a place beside the measured one, and one component of them.
    vectors_n_per_a: Vec<[f64; 3]>,
    row_n_per_a: Vec<f64>,
    /// Currents of least power.
    plain_a: Vec<f64>,
}

/// Data for the two sideways components.
#[derive(Debug, Clone)]
struct VectorPart {
    allocator: VectorAllocator,
    /// [y, x, 3] on the nodes of the heights: the force over lambda times the height.
    direction: Vec<f64>,
    /// Out of reach a sideways error counts as this share of an upward one.
    sideways_weight: f64,
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
    /// The upward force of the commanded currents and of all that pulls without currents, N.
    pub force_n: f64,
    /// The sideways force; `None` where the upward one alone is requested.
    pub sideways: Option<SidewaysStep>,
    /// The force without currents, N: the pull of the unpowered steel and the push of a second magnet.
    pub without_currents_n: [f64; 3],
    /// How the currents were chosen; `None` outside the map, with two fingers, and where they were chosen for the
    /// uncertainties.
    pub allocation: Option<Chosen>,
}

impl Step {
    /// The requested force, N; none sideways where the upward force alone is requested.
    #[must_use]
    pub fn wanted_force_n(&self) -> [f64; 3] {
        let [x, y] = self.sideways.map_or([0.0; 2], |sideways| sideways.wanted_n);
        [x, y, self.wanted_n]
    }
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
    /// It was made without uncertainties.
    #[error("holds no setting for uncertainties: it was made without any")]
    NoUncertainty,
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
        let rendering = runtime.rendering.as_ref();
        let heights = rendering
            .map(|rendering| rendering.heights.clone())
            .or_else(|| HeightGrid::of_points(&bundle.manifest.points, &bundle.points))
            .ok_or(RendererError::Points)?;
        let allocator = Allocator::new(
            &runtime.resistance_ohm,
            &runtime.current_min_a,
            &runtime.current_max_a,
            runtime.total_current_max_a,
        )?;
        let map = ForceMap::new(bundle);
        let requested = rendering.and_then(|r| r.requested.as_ref());
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
                sideways_weight: requested.sideways_weight,
            })
        });
        Ok(Self {
            vector: vector.transpose()?,
            map,
            heights,
            force_n_per_a: vec![0.0; allocator.coils()],
            allocator,
            lambda_n_per_m,
            robust: None,
            pair: None,
        })
    }

    /// As [`Renderer::new`], for two fingers whose magnets have this moment, A m^2.
    ///
    /// # Errors
    /// See [`RendererError`].
    pub fn two_fingers(bundle: &Bundle, moment_a_m2: [f64; 3]) -> Result<Self, RendererError> {
        let mut renderer = Self::new(bundle)?;
        let coils = renderer.coils();
        let finger = || std::array::from_fn(|_| vec![0.0; coils]);
        renderer.pair = Some(PairPart {
            moment_a_m2,
            limits: Limits::of(bundle),
            axes_n_per_a: [finger(), finger()],
        });
        Ok(renderer)
    }

    /// As [`Renderer::new`], with the currents of the least expected error under the uncertainties that the
    /// bundle was made with.
    ///
    /// # Errors
    /// See [`RendererError`].
    pub fn robust(bundle: &Bundle) -> Result<Self, RendererError> {
        let mut renderer = Self::new(bundle)?;
        let runtime = &bundle.map.runtime;
        let setting = runtime.rendering.as_ref().and_then(|r| r.robust);
        let setting = setting.ok_or(RendererError::NoUncertainty)?;
        let coils = renderer.coils();
        renderer.robust = Some(RobustPart {
            form: RobustForm::new(setting, coils),
            limits: Limits::of(bundle),
            vectors_n_per_a: vec![[0.0; 3]; coils],
            row_n_per_a: vec![0.0; coils],
            plain_a: vec![0.0; coils],
        });
        Ok(renderer)
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
        let mut step = if self.vector.is_some() {
            self.vector_step(position_m, currents_a)
        } else {
            self.upward_step(position_m, currents_a)
        };
        if step.answer != Answer::Outside {
            self.choose_for_uncertainties(position_m, &mut step, currents_a);
        }
        step
    }

    /// A step for the upward force alone.
    fn upward_step(&mut self, position_m: [f64; 3], currents_a: &mut [f64]) -> Step {
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
            without_currents_n: [0.0, 0.0, passive_n],
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
            without_currents_n: [0.0, 0.0, passive_n],
            allocation: Some(Chosen::Vector(found)),
        }
    }

    /// Goes on from the currents of least power to those of the least expected error, where that is requested.
    fn choose_for_uncertainties(
        &mut self,
        position_m: [f64; 3],
        step: &mut Step,
        currents_a: &mut [f64],
    ) {
        let Some(part) = &mut self.robust else { return };
        let currents = &mut currents_a[..part.plain_a.len()];
        part.plain_a.copy_from_slice(currents);
        let target = step.wanted_force_n();
        let axes = if step.sideways.is_some() { 0..3 } else { 2..3 };
        part.form.clear();
        let setting = *part.form.setting();
        for (place, weight) in setting.places_m(position_m, self.map.ends_m()) {
            let pull_n = if step.sideways.is_some() {
                self.map.vectors_at(place, &mut part.vectors_n_per_a)
            } else {
                self.map.at(place, &mut part.row_n_per_a)
            };
            for axis in axes.clone() {
                if step.sideways.is_some() {
                    let vectors = part.row_n_per_a.iter_mut().zip(&part.vectors_n_per_a);
                    vectors.for_each(|(row, vector)| *row = vector[axis]);
                }
                let pull_n = if axis == 2 {
                    pull_n.unwrap_or(0.0)
                } else {
                    0.0
                };
                part.form
                    .add(&part.row_n_per_a, (target[axis], pull_n), weight);
            }
        }
        part.form.minimise(&part.limits.problem(), currents);
        let [force_x, force_y, force_z] = self.given_n(step, currents);
        step.force_n = force_z;
        if let Some(sideways) = &mut step.sideways {
            sideways.force_n = [force_x, force_y];
        }
        step.allocation = None;
    }

    /// The force on the finger with these currents at the last step, N; sideways only that without currents where
    /// the upward force alone is requested. None outside the map.
    #[must_use]
    pub fn given_n(&self, step: &Step, currents_a: &[f64]) -> [f64; 3] {
        if step.answer == Answer::Outside {
            return [0.0; 3];
        }
        let given = |force: &dyn Fn(usize) -> f64| -> f64 {
            let terms = currents_a.iter().enumerate();
            terms.map(|(coil, current)| force(coil) * current).sum()
        };
        let [mut x, mut y, z] = step.without_currents_n;
        if let Some(part) = &self.vector {
            x += given(&|coil| part.force_n_per_a[coil][0]);
            y += given(&|coil| part.force_n_per_a[coil][1]);
        }
        [x, y, given(&|coil| self.force_n_per_a[coil]) + z]
    }

    /// As [`Renderer::given_n`], for either finger after [`Renderer::pair_step`].
    #[must_use]
    pub fn pair_given_n(&self, steps: &[Step; 2], currents_a: &[f64]) -> [[f64; 3]; 2] {
        let Some(part) = &self.pair else {
            return [[0.0; 3]; 2];
        };
        std::array::from_fn(|finger| {
            let step = &steps[finger];
            if step.answer == Answer::Outside {
                return [0.0; 3];
            }
            std::array::from_fn(|axis| {
                let row = part.axes_n_per_a[finger][axis].iter();
                let sum: f64 = row.zip(currents_a).map(|(g, i)| g * i).sum();
                sum + step.without_currents_n[axis]
            })
        })
    }

    /// Writes the currents (A) to command with fingers at both positions, m: those of least power that give both
    /// their force, or the nearest in the sum of squares, sideways errors counting as for one finger. Their magnets push
    /// each other as dipoles do, which the currents make up for; the force on the second one is stated too, N. A finger
    /// outside the map counts for nothing: the other has its own currents.
    ///
    /// # Panics
    /// When `currents_a` is shorter than the array.
    pub fn pair_step(
        &mut self,
        positions_m: [[f64; 3]; 2],
        currents_a: &mut [f64],
    ) -> ([Step; 2], [f64; 3]) {
        // Each alone first: what is requested, and the forces per ampere there.
        let mut steps = positions_m.map(|_| self.outside(currents_a));
        for finger in 0..2 {
            steps[finger] = self.step(positions_m[finger], currents_a);
            self.remember(finger);
        }
        if steps[1].answer == Answer::Outside {
            // The first finger's currents were overwritten; outside the map as well, there are none.
            steps[0] = self.step(positions_m[0], currents_a);
        }
        let inside = steps.map(|step| step.answer != Answer::Outside);
        let part = self.pair.as_mut().filter(|_| inside == [true; 2]);
        let Some(part) = part else {
            return (steps, [0.0; 3]);
        };
        let currents = &mut currents_a[..part.limits.resistance_ohm.len()];
        currents.fill(0.0);
        let [first, second] = positions_m;
        let between = std::array::from_fn(|axis| second[axis] - first[axis]);
        let on_second = between_magnets_n(part.moment_a_m2, between);
        let pushes = [on_second.map(|push| -push), on_second];
        for (step, push) in steps.iter_mut().zip(pushes) {
            for (sum, push) in step.without_currents_n.iter_mut().zip(push) {
                *sum += push;
            }
        }
        let weight = self.vector.as_ref().map(|vector| vector.sideways_weight);
        let first_axis = if weight.is_some() { 0 } else { 2 };
        let sideways = weight.unwrap_or(1.0);
        let shares = [sideways, sideways, 1.0];
        let mut rows = Vec::with_capacity(6);
        for (finger, step) in steps.iter().enumerate() {
            let requested_n = step.wanted_force_n().into_iter();
            let of_currents = requested_n
                .zip(step.without_currents_n)
                .map(|(all, n)| all - n);
            let axes = part.axes_n_per_a[finger].iter().map(Vec::as_slice);
            let all = axes.zip(of_currents).zip(shares);
            let all = all.map(|((axis, requested_n), share)| (axis, requested_n, share));
            rows.extend(all.skip(first_axis));
        }
        allocate(&part.limits.problem(), &rows, currents);
        let given = self.pair_given_n(&steps, currents);
        let length = |force: [f64; 3]| force.iter().map(|part| part * part).sum::<f64>().sqrt();
        let terms = steps
            .iter()
            .flat_map(|step| [step.wanted_force_n(), step.without_currents_n]);
        let tolerated_n = GIVEN * terms.map(length).fold(0.0, f64::max);
        for (step, force) in steps.iter_mut().zip(given) {
            let target = step.wanted_force_n();
            let error_n = length(std::array::from_fn(|axis| {
                if axis < first_axis {
                    0.0
                } else {
                    target[axis] - force[axis]
                }
            }));
            step.answer = if error_n <= tolerated_n {
                Answer::Ok
            } else {
                Answer::Saturated
            };
            step.force_n = force[2];
            if let Some(sideways) = &mut step.sideways {
                sideways.force_n = [force[0], force[1]];
            }
            step.allocation = None;
        }
        (steps, on_second)
    }

    /// Takes the forces per ampere of the last step for those of a finger of two.
    fn remember(&mut self, finger: usize) {
        let Some(part) = &mut self.pair else { return };
        let [x, y, z] = &mut part.axes_n_per_a[finger];
        z.copy_from_slice(&self.force_n_per_a);
        if let Some(vector) = &self.vector {
            for (coil, force) in vector.force_n_per_a.iter().enumerate() {
                (x[coil], y[coil]) = (force[0], force[1]);
            }
        }
    }

    /// The setting of the uncertainties, where currents are chosen for them.
    #[must_use]
    pub fn setting(&self) -> Option<&RobustRuntime> {
        self.robust.as_ref().map(|part| part.form.setting())
    }

    /// The currents of least power of the last step inside the map, A, where others were chosen for the
    /// uncertainties.
    #[must_use]
    pub fn plain_a(&self) -> &[f64] {
        self.robust.as_ref().map_or(&[], |part| &part.plain_a)
    }

    /// The expected square of the force's error with these currents at the last step inside the map, N^2, where
    /// they are chosen for the uncertainties.
    #[must_use]
    pub fn expected_n2(&self, currents_a: &[f64]) -> Option<f64> {
        let part = self.robust.as_ref()?;
        Some(part.form.expected_n2(currents_a))
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
            without_currents_n: [0.0; 3],
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
        let wanted_n = step.wanted_n - step.without_currents_n[2];
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
