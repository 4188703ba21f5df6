//! The run that all others are held against: finer in every knob.

use super::clock::Watch;
use super::ladder::Ladders;
use super::places::{Chosen, choose};
use super::stages::Bench;
use crate::RunError;
use crate::bundle::bench::Reference;
use crate::commands::lambda::ForcesAt;
use crate::lambda::{self, ForceProblem, Solution, Wiring};
use crate::map::FieldMap;
use crate::map::interpolation::SAFETY;
use crate::progress::Silent;
use crate::scene::Scene;
use crate::scene::cached_field::ShapeField;
use crate::scene::felt_force::by_map;
use crate::scene::passive;
use crate::scene::sources::ShapeSource;
use crate::scene::steel;

/// Tolerance of the refined field in air: the kernel's own rounding.
const AIR: f64 = 1e-15;
/// The refined field's tolerance over steel against the tightest of the ladder.
const STEEL: f64 = 0.1;
/// The tightest tolerance requested of steel.
const TIGHTEST_STEEL: f64 = 1e-9;

/// Where the felt force is compared, and the refined field there.
pub struct Places {
    position_m: Vec<[f64; 3]>,
    /// N/A, [place, coil].
    forces_n_per_a: Vec<f64>,
    moment_a_m2: [f64; 3],
    coils: usize,
    shape: String,
    out_of_reach: usize,
}

/// The refined run.
pub struct Refined {
    /// Where forces are compared.
    pub places: Places,
    /// The chosen force constant, N/m.
    pub lambda_n_per_m: f64,
    /// All of them.
    pub solution: Solution,
    /// Its own error, about.
    pub own_error: Option<f64>,
    tolerance: f64,
    points: usize,
    cpu_s: f64,
    in_air: bool,
}

/// The rows of a force problem.
struct Rows {
    forces_n_per_a: Vec<f64>,
    height_m: Vec<f64>,
    offset_n: Option<Vec<f64>>,
    weights: Option<Vec<f64>>,
}

impl Rows {
    fn problem<'a>(&'a self, scene: &'a Scene, resistance_ohm: &'a [f64]) -> ForceProblem<'a> {
        ForceProblem {
            forces_n_per_a: &self.forces_n_per_a,
            height_m: &self.height_m,
            offset_n: self.offset_n.as_deref(),
            weights: self.weights.as_deref(),
            lower_a: &scene.lower_a,
            upper_a: &scene.upper_a,
            total_max_a: scene.design.supply.total_current_max_a,
            resistance_ohm,
        }
    }
}

fn chosen(solution: &Solution) -> Option<f64> {
    let point = solution.chosen.as_ref()?;
    Some(point.lambda_n_per_m).filter(|lambda| *lambda > 0.0)
}

/// Computes it.
///
/// # Errors
/// A scene that cannot be computed; no force constant; interruption.
pub fn refine(bench: &Bench, shape: &ShapeSource, ladders: &Ladders) -> Result<Refined, RunError> {
    let watch = Watch::start();
    let scene = bench.scene;
    let tightest = scene.tolerances.map;
    let in_air = scene.core.is_none();
    let tolerance = if in_air {
        AIR
    } else {
        (STEEL * tightest).max(TIGHTEST_STEEL.min(tightest))
    };
    let lowest_m = scene.design.workspace.z_m.from;
    let solved = steel::solve(scene, tolerance, lowest_m)?;
    bench.check()?;
    let points = bench.points(&shape.document, ladders.refined_points(), &Silent)?;
    let forces = scene.forces_n_per_a(&solved, &points.positions_m, &bench.within())?;
    let pull = passive::counted(scene, &points.positions_m)?;
    let offset_n = pull.map(|pull| pull.forces_z_n(&points.positions_m));
    let weights = Some(points.areas.clone());
    let all = Rows {
        forces_n_per_a: forces,
        height_m: points.height_m.clone(),
        offset_n,
        weights,
    };
    let resistance_ohm = scene.resistances_ohm();
    let problem = all.problem(scene, &resistance_ohm);
    let options = bench.request.lambda.with_jnd_of(&problem)?;
    let settings = &options.settings;
    let solution = lambda::solve(&problem, settings)?;
    let lambda_n_per_m = chosen(&solution).ok_or_else(|| {
        RunError::NoForceConstant(format!(
            "{:?} has no force constant in the refined run, so there is nothing to hold errors \
             against; see `fluxform lambda` on it",
            shape.document.name
        ))
    })?;
    let own_error = points.error_against_limit(
        lambda_n_per_m,
        (&problem, &problem),
        (&Wiring::default(), settings),
        ForcesAt {
            scene,
            solved: &solved,
            field: ShapeField::default(),
            progress: &bench.within(),
        },
    )?;
    let Chosen {
        position_m,
        out_of_reach,
    } = choose(shape, ladders, bench)?;
    let places = Places {
        forces_n_per_a: scene.forces_n_per_a(&solved, &position_m, &bench.within())?,
        position_m,
        moment_a_m2: scene.moment_a_m2,
        coils: scene.coils.len(),
        shape: shape.document.name.clone(),
        out_of_reach,
    };
    bench.advance();
    Ok(Refined {
        places,
        lambda_n_per_m,
        solution,
        own_error,
        tolerance,
        points: points.height_m.len(),
        cpu_s: watch.processor_s(),
        in_air,
    })
}

impl Refined {
    /// As the result states it.
    pub fn summary(&self) -> Reference {
        let field = if self.in_air {
            "the windings' field to rounding"
        } else {
            "the field to a tenth of the present tolerance"
        };
        let left_out = match self.places.out_of_reach {
            0 => String::new(),
            more => format!("; {more} places that no map reaches are left out"),
        };
        Reference {
            how: format!(
                "{field}; points twice as fine along each axis as the finest of the sweep, weighted by \
                 the area they stand for; the felt force without a map, computed at the places directly{left_out}"
            ),
            tolerance: self.tolerance,
            points: self.points as u64,
            places: self.places.position_m.len() as u64,
            lambda_n_per_m: self.lambda_n_per_m,
            lambda_error: self.own_error,
            cpu_s: self.cpu_s,
        }
    }
}

impl Places {
    /// Largest |force by the map - force directly| of the same currents at the places, relative to the force that
    /// is to be felt, lambda h, times the factor that stands for what lies between them.
    ///
    /// # Errors
    /// A place outside the map.
    pub fn felt_error(
        &self,
        map: &FieldMap,
        lambda_n_per_m: f64,
        currents_a: &[f64],
    ) -> Result<f64, RunError> {
        let mut largest = 0.0_f64;
        for (place, direct) in self
            .position_m
            .iter()
            .zip(self.forces_n_per_a.chunks(self.coils))
        {
            let by_map = by_map(map, self.moment_a_m2, currents_a, *place).ok_or_else(|| {
                RunError::Input(format!(
                    "shape {:?}: a place of its surface lies outside the map",
                    self.shape
                ))
            })?;
            // A coil that the map leaves out gives no force by it.
            let direct: f64 = direct.iter().zip(currents_a).map(|(f, i)| f * i).sum();
            let difference = by_map - direct;
            let target = lambda_n_per_m * place[2];
            largest = largest.max((difference / target).abs());
        }
        Ok(SAFETY * largest)
    }
}
