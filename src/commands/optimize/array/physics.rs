//! The forces that a design of the search gives at the shapes' points, through the coupled steel.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use serde::Serialize;
use strum::{EnumMessage, EnumString, IntoStaticStr, VariantArray};

use crate::RunError;
use crate::bundle::artefact::sha256_hex;
use crate::coil::array_search::problem::{Level, Physical, Physics};
use crate::coil::limits::UsedPower;
use crate::coil::mutual::{largest_self_inductance_h, slowest_inductance_h};
use crate::commands::discretize;
use crate::commands::lambda::ForcePoints;
use crate::commands::lambda::placement::Placed;
use crate::design::{Design, Limits};
use crate::force_direction::RequestedForce;
use crate::lambda::feedback::{FeedbackError, NoLambda, Span, reachable, render};
use crate::lambda::vector_feedback::{
    CurrentsOf, VectorProblem, reachable_vectors, render_vectors,
};
use crate::lambda::{Criterion, ForceProblem, Settings, constant, relative_error, solve};
use crate::point_weights::Weights;
use crate::progress::{Interrupted, Progress, Silent, interruptible};
use crate::scene::single::Single;
use crate::scene::sources::ShapeSource;
use crate::scene::{Scene, neighbours, passive, steel};
use crate::units::FORCE_JND;

/// The force constant that is made as large as possible.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(untagged)]
pub enum Constant {
    /// One of static currents.
    Static(Criterion),
    /// Another aim.
    Other(OtherAim),
}

/// What else a search makes large, or small.
#[derive(
    Debug,
    Clone,
    Copy,
    PartialEq,
    Eq,
    EnumMessage,
    EnumString,
    IntoStaticStr,
    VariantArray,
    Serialize,
)]
#[serde(rename_all = "lowercase")]
#[strum(serialize_all = "lowercase")]
pub enum OtherAim {
    /// The largest with currents of their own at every point
    Feedback,
    /// The same for the force vector: along the normals where a shape requests that, else nothing sideways
    Vector,
    /// The least error at the force constant of --lambda, the currents the same everywhere
    Error,
}

impl Constant {
    /// The least error at a given force constant, no force constant itself.
    pub const ERROR: Self = Self::Other(OtherAim::Error);

    /// Its name on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Static(criterion) => criterion.name(),
            Self::Other(aim) => aim.into(),
        }
    }

    /// The static constant, where it is one.
    fn criterion(self) -> Option<Criterion> {
        match self {
            Self::Static(criterion) => Some(criterion),
            Self::Other(_) => None,
        }
    }
}

impl Default for Constant {
    fn default() -> Self {
        Self::Static(Criterion::default())
    }
}

impl From<Criterion> for Constant {
    fn from(criterion: Criterion) -> Self {
        Self::Static(criterion)
    }
}

impl From<OtherAim> for Constant {
    fn from(aim: OtherAim) -> Self {
        Self::Other(aim)
    }
}

/// The aim of the search.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Aim {
    /// Which.
    pub constant: Constant,
    /// Just-noticeable difference.
    pub jnd_weight: f64,
    /// The force constant at which an error is made small, N/m.
    pub at_n_per_m: Option<f64>,
}

impl Default for Aim {
    fn default() -> Self {
        Self {
            constant: Constant::default(),
            jnd_weight: FORCE_JND,
            at_n_per_m: None,
        }
    }
}

/// Errors below this share are taken for it: nobody feels them, and their inverse has no limit.
const LEAST_ERROR: f64 = 1e-6;

/// Digest of the sources of this build.
const BUILD: &str = env!("FLUXFORM_BUILD");

/// Computed properties, by a digest of all that they were computed from.
pub type Journal = BTreeMap<String, Option<Physical>>;

/// Samples of a shape along one axis while searching.
const SEARCH_SAMPLES: usize = 31;
/// Tolerance of the forces while searching.
pub const SEARCH_TOLERANCE: f64 = 1e-2;
/// The same of arrays with a plate or other steel, whose finer panels take ten times as long.
const IRON_SEARCH_TOLERANCE: f64 = 0.1;

/// A shape of which nothing is rendered.
#[derive(Debug, Clone, Copy)]
pub struct Unrendered {
    /// Which.
    pub shape: usize,
    /// Why, where a point decides.
    pub why: Option<NoLambda>,
}

/// The shapes over arrays of any design.
pub struct ArrayPhysics<'a> {
    aim: Aim,
    tolerance: Option<f64>,
    /// Points of every shape, while searching and in the end.
    coarse: Vec<ForcePoints>,
    fine: Vec<ForcePoints>,
    /// The force that every shape requests.
    requested: Vec<RequestedForce>,
    progress: &'a dyn Progress,
    /// Digest of all that decides forces and constants but the design.
    origin: String,
    /// Evaluations reported.
    reported: AtomicUsize,
    /// Properties computed before, in this run or an earlier one.
    known: Mutex<Journal>,
}

impl<'a> ArrayPhysics<'a> {
    /// The points of `shapes`, for what is made large of them.
    ///
    /// # Errors
    /// A shape that gives no points; interruption.
    pub fn new(
        shapes: &[ShapeSource],
        aim: Aim,
        tolerance: Option<f64>,
        progress: &'a dyn Progress,
    ) -> Result<Self, RunError> {
        let points = |most: usize| -> Result<Vec<ForcePoints>, RunError> {
            let of = |shape: &ShapeSource| {
                let document = &shape.document;
                let samples =
                    [document.grid.x, document.grid.y].map(|axis| axis.samples().min(most));
                let report = discretize::run(&document.with_samples(samples), Vec::new(), &Silent)?;
                let weights = report.weights.unwrap_or(Weights::Equal);
                Ok(ForcePoints::of_grid(&report, weights))
            };
            shapes.iter().map(of).collect()
        };
        let (coarse, fine) = (points(SEARCH_SAMPLES)?, points(usize::MAX)?);
        let places = |points: &ForcePoints| {
            (
                points.positions_m.clone(),
                points.rule,
                points.areas.clone(),
            )
        };
        let all: Vec<_> = coarse.iter().chain(&fine).map(places).collect();
        let requested: Vec<_> = shapes.iter().map(|shape| shape.document.force).collect();
        let origin = format!("{BUILD} {aim:?} {tolerance:?} {all:?} {requested:?}");
        Ok(Self {
            origin: sha256_hex(origin.as_bytes()),
            aim,
            tolerance,
            coarse,
            fine,
            requested,
            progress,
            reported: AtomicUsize::new(0),
            known: Mutex::default(),
        })
    }

    /// Why a runtime could render nearly nothing of one of `shapes` with `design`, at the height where it is.
    pub fn misplaced(&self, design: &Design, shapes: &[ShapeSource]) -> Option<String> {
        let mut placed = shapes.iter().zip(&self.fine);
        placed.find_map(|(shape, points)| {
            let document = &shape.document;
            let refused = Placed {
                design,
                document,
                points,
            }
            .refused()?;
            Some(format!("shape {:?}: {refused}", document.name))
        })
    }

    fn points(&self, level: Level) -> &[ForcePoints] {
        match level {
            Level::Search => &self.coarse,
            Level::Full => &self.fine,
        }
    }

    /// Points of all shapes at a level.
    pub fn count(&self, level: Level) -> usize {
        self.points(level)
            .iter()
            .map(|points| points.height_m.len())
            .sum()
    }

    /// Heights of the lowest and the highest point of all shapes, m.
    pub fn heights_m(&self) -> [f64; 2] {
        let heights = self.fine.iter().flat_map(|points| &points.height_m);
        heights.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], z| {
            [low.min(*z), high.max(*z)]
        })
    }

    /// The tolerance of a level's forces; `None` for the default of the design's physics.
    pub fn tolerance(&self, level: Level, design: &Design) -> Option<f64> {
        let coarse = if design.has_iron() {
            IRON_SEARCH_TOLERANCE
        } else {
            SEARCH_TOLERANCE
        };
        // Where coils tie by symmetry, the last breakpoint is wherever the forces' error has them apart: the path rests at
        // ties to 3e-8 only (`lambda`'s `rest.rs`).
        let needs_ties = self.aim.constant == Constant::Static(Criterion::Saturation);
        match level {
            Level::Search if !needs_ties => Some(self.tolerance.unwrap_or(coarse).max(coarse)),
            Level::Search | Level::Full => self.tolerance,
        }
    }

    /// The aim of the search.
    pub fn aim(&self) -> Aim {
        self.aim
    }

    /// The points of all shapes, raised.
    pub fn positions_m(&self, raised_m: f64, level: Level) -> Vec<[f64; 3]> {
        let positions = self
            .points(level)
            .iter()
            .flat_map(|points| &points.positions_m);
        positions.map(|[x, y, z]| [*x, *y, z + raised_m]).collect()
    }

    /// The problem of every shape, from one of all their points.
    pub fn of_shapes<'p>(&'p self, all: ForceProblem<'p>, level: Level) -> Vec<ForceProblem<'p>> {
        let mut left = all;
        let shapes = self.points(level).iter().map(|points| {
            let (own, others) = left.split_at(points.height_m.len());
            left = others;
            ForceProblem {
                weights: points.weights(),
                ..own
            }
        });
        shapes.collect()
    }

    /// The properties of the design; `None` where it renders nothing for some shape.
    ///
    /// # Errors
    /// A design that cannot be computed; interruption.
    pub fn rendered(
        &self,
        design: &Design,
        raised_m: f64,
        level: Level,
    ) -> Result<Option<Physical>, RunError> {
        Ok(self.rendered_or_why(design, raised_m, level)?.ok())
    }

    /// The same, or of which shape nothing is rendered.
    ///
    /// # Errors
    /// See [`Self::rendered`].
    pub fn rendered_or_why(
        &self,
        design: &Design,
        raised_m: f64,
        level: Level,
    ) -> Result<Result<Physical, Unrendered>, RunError> {
        let scene = Scene::with_tolerance(design, self.tolerance(level, design))?;
        let positions = self.positions_m(raised_m, level);
        let lowest_m = positions.iter().fold(f64::INFINITY, |z, p| z.min(p[2]));
        let solved = steel::solve(&scene, scene.tolerances.forces, lowest_m)?;
        let sides = match self.aim.constant {
            Constant::Other(OtherAim::Vector) => {
                Some(scene.force_vectors_n_per_a(&solved, &positions, &Silent)?)
            }
            Constant::Other(OtherAim::Feedback | OtherAim::Error) | Constant::Static(_) => None,
        };
        let forces = match &sides {
            Some(vectors) => vectors.iter().map(|force| force[2]).collect(),
            None => scene.forces_n_per_a(&solved, &positions, &Silent)?,
        };
        let pull = match design.magnet.passive_force {
            true => {
                passive::pull(&scene, &positions, false)?.map(|pull| pull.forces_z_n(&positions))
            }
            false => None,
        };
        let resistance_ohm = scene.resistances_ohm();
        let height_m: Vec<f64> = positions.iter().map(|p| p[2]).collect();
        let all = ForceProblem {
            forces_n_per_a: &forces,
            height_m: &height_m,
            offset_n: pull.as_deref(),
            weights: None,
            lower_a: &scene.lower_a,
            upper_a: &scene.upper_a,
            total_max_a: design.supply.total_current_max_a,
            resistance_ohm: &resistance_ohm,
        };
        let (merits, used) = match self.merits(all, sides.as_deref(), level, &design.limits)? {
            Ok(merits) => merits,
            Err(nothing) => return Ok(Err(nothing)),
        };
        let (inductance_h, core_field_t) = Single::essentials(&scene)?;
        let in_air = neighbours::in_air(&scene, scene.tolerances.inductances);
        let (matrix, _) = neighbours::inductances(&solved, in_air);
        Ok(Ok(Physical {
            merits,
            inductance_h: if design.has_iron() {
                largest_self_inductance_h(&matrix)
            } else {
                inductance_h
            },
            array_inductance_h: slowest_inductance_h(&matrix),
            used,
            core_field_t,
        }))
    }

    /// The merit of every shape and the heat that they take, from the problem of all their points and, for the force
    /// vector, its forces along x, y and z.
    fn merits(
        &self,
        all: ForceProblem<'_>,
        sides: Option<&[[f64; 3]]>,
        level: Level,
        limits: &Limits,
    ) -> Result<Result<(Vec<f64>, UsedPower), Unrendered>, RunError> {
        let coils = all.coils();
        let (mut merits, mut vectors) = (Vec::new(), sides);
        let mut used = UsedPower::default();
        let shapes = self.points(level).iter().zip(self.of_shapes(all, level));
        for (shape, (points, problem)) in shapes.enumerate() {
            let own = vectors.map(|all| all.split_at(problem.points() * coils));
            vectors = own.map(|(_, others)| others);
            let requested = (points, self.requested[shape]);
            let rendering = Rendering::new(problem, own.map(|(own, _)| own), requested);
            let merit = match self.merit(&rendering)? {
                Ok(merit) if merit > 0.0 => merit,
                Ok(_) => return Ok(Err(Unrendered { shape, why: None })),
                Err(why) => return Ok(Err(Unrendered { shape, why })),
            };
            let own = self.used(&rendering, merit, limits)?;
            used = UsedPower {
                static_w: largest(used.static_w, own.static_w),
                feedback_w: largest(used.feedback_w, own.feedback_w),
            };
            merits.push(merit);
        }
        Ok(Ok((merits, used)))
    }

    /// The force constant, or the inverse of the error; where nothing is rendered, why, as far as a point decides.
    fn merit(&self, shape: &Rendering<'_>) -> Result<Result<f64, Option<NoLambda>>, RunError> {
        let problem = &shape.problem;
        if let (Constant::ERROR, Some(lambda_n_per_m)) = (self.aim.constant, self.aim.at_n_per_m) {
            let error = relative_error(problem, lambda_n_per_m)?;
            return Ok(error
                .map(|error| error.max(LEAST_ERROR).recip())
                .ok_or(None));
        }
        if let Some(criterion) = self.aim.constant.criterion() {
            return Ok(constant(problem, &self.settings(criterion, None))?.ok_or(None));
        }
        let mut span = Span::default();
        let reach = match shape.vector() {
            None => reachable(problem)?,
            Some(vector) => reachable_vectors(&vector).map_err(refused)?,
        };
        span.add(problem.height_m, &reach);
        let largest = span.largest().map(|largest| largest.lambda_n_per_m);
        Ok(largest.map_err(Some))
    }

    fn settings(&self, criterion: Criterion, at_n_per_m: Option<f64>) -> Settings {
        Settings {
            criterion,
            jnd_weight: self.aim.jnd_weight,
            at_n_per_m,
        }
    }

    /// The heat of all coils for a shape, as far as `limits` name it, at the force constant that is made large: as
    /// `lambda --feedback` states both of `without` and of feedback.
    fn used(
        &self,
        shape: &Rendering<'_>,
        merit: f64,
        limits: &Limits,
    ) -> Result<UsedPower, RunError> {
        let problem = &shape.problem;
        let lambda_n_per_m = self.aim.at_n_per_m.unwrap_or(merit);
        let fixed = || -> Result<Option<f64>, RunError> {
            let criterion = self.aim.constant.criterion();
            let at = criterion.is_none().then_some(lambda_n_per_m);
            let solved = solve(problem, &self.settings(criterion.unwrap_or_default(), at))?;
            let heat = |(amp, ohm): (&f64, &f64)| amp * amp * ohm;
            Ok(solved.at.or(solved.chosen).map(|point| {
                let currents = point.currents_a.iter();
                currents.zip(problem.resistance_ohm).map(heat).sum()
            }))
        };
        let followed = || match shape.vector() {
            None => render(problem, lambda_n_per_m).map(|rendered| rendered.mean_power_w),
            Some(vector) => render_vectors(&vector, lambda_n_per_m, CurrentsOf::Vector)
                .map(|rendered| rendered.mean_power_w),
        };
        Ok(UsedPower {
            static_w: match limits.static_power_max_w {
                Some(_) => fixed()?,
                None => None,
            },
            feedback_w: match limits.feedback_power_max_w {
                Some(_) => Some(followed().map_err(refused)?),
                None => None,
            },
        })
    }

    /// The computed properties, for a later run.
    pub fn journal(&self) -> Journal {
        self.known
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .clone()
    }

    /// Takes what an earlier run computed.
    pub fn remember(&self, journal: Journal) {
        *self.known.lock().unwrap_or_else(PoisonError::into_inner) = journal;
    }
}

/// A shape's points, for the upward force or for the force vector.
struct Rendering<'a> {
    problem: ForceProblem<'a>,
    /// Forces along x and y, N/A; `None` of the upward force.
    sides_n_per_a: Option<[Vec<f64>; 2]>,
    /// The requested directions; empty of the upward force.
    direction: Vec<[f64; 3]>,
}

impl<'a> Rendering<'a> {
    fn new(
        problem: ForceProblem<'a>,
        vectors: Option<&[[f64; 3]]>,
        (points, requested): (&ForcePoints, RequestedForce),
    ) -> Self {
        let directions = |_| points.directions(requested);
        Self {
            problem,
            sides_n_per_a: vectors
                .map(|vectors| [0, 1].map(|axis| vectors.iter().map(|f| f[axis]).collect())),
            direction: vectors.map(directions).unwrap_or_default(),
        }
    }

    fn vector(&self) -> Option<VectorProblem<'_>> {
        let [x, y] = self.sides_n_per_a.as_ref()?;
        Some(VectorProblem {
            upward: self.problem,
            sides_n_per_a: [x, y],
            direction: &self.direction,
        })
    }
}

/// The larger of two that may be unknown.
fn largest(a: Option<f64>, b: Option<f64>) -> Option<f64> {
    a.into_iter().chain(b).reduce(f64::max)
}

fn refused(error: FeedbackError) -> RunError {
    RunError::Input(error.to_string())
}

impl Physics for ArrayPhysics<'_> {
    fn compute(
        &self,
        design: &Design,
        raised_m: f64,
        level: Level,
    ) -> Result<Option<Physical>, Interrupted> {
        self.progress.check()?;
        // Debug text holds every number to the last bit.
        let key = format!("{} {level:?} {raised_m:?} {design:?}", self.origin);
        let key = sha256_hex(key.as_bytes());
        let known = self
            .known
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .get(&key)
            .cloned();
        if let Some(known) = known {
            return Ok(known);
        }
        let computed = interruptible(|| self.rendered(design, raised_m, level))?;
        let computed = match computed {
            Ok(physical) => physical,
            Err(RunError::Interrupted(interrupted)) => return Err(interrupted),
            // A design of the search that cannot be computed is none.
            Err(_) => None,
        };
        self.known
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .insert(key, computed.clone());
        Ok(computed)
    }

    fn report(&self, evaluations: usize, best: Option<f64>) {
        let before = self.reported.fetch_max(evaluations, Ordering::Relaxed);
        self.progress
            .advance(evaluations.saturating_sub(before) as u64);
        if let Some(best) = best {
            self.progress.improved(best, "x");
        }
    }
}
