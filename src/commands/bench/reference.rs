//! The run that all others are held against: finer in every knob.

use super::clock::Watch;
use super::ladder::{Ladders, Points};
use super::places::{Chosen, choose};
use super::stages::Bench;
use crate::RunError;
use crate::bundle::bench::Reference;
use crate::commands::lambda::{ForcePoints, ForcesAt};
use crate::design::message_text::number;
use crate::field::winding::KERNEL_ERROR;
use crate::lambda::{self, ForceProblem, Settings, Solution, Wiring};
use crate::map::interpolation::SAFETY;
use crate::progress::Silent;
use crate::scene::cached_field::ShapeField;
use crate::scene::maps::SceneMap;
use crate::scene::passive;
use crate::scene::sources::ShapeSource;
use crate::scene::steel::{self, Solved};
use crate::scene::{Scene, coupled};
use fluxform_base::least_request::lowest_requested_m;

/// The refined field's tolerance against the tightest of the ladder.
const FINER: f64 = 0.1;
/// The finest of the windings' field alone.
const FINEST_AIR: f64 = 1e-15;
/// The tightest tolerance requested of steel.
const TIGHTEST_STEEL: f64 = 1e-9;
/// Where the stated error of the refined steel is at most this share of the present one's, the change between them
/// shows what is left. That of evaluating it follows the tolerance, and shows nothing.
const CLEARLY_LESS: f64 = 1.0 / 3.0;
/// What is left of that change at most: of errors that fall to a third, a half. The stated ones often fall by more
/// than the true ones, so their ratio itself is not relied on.
const LEFT_OF_CHANGE: f64 = 0.5;

/// Of what points graded half as finely change: an error that falls with the deviation is as large as that.
const MARGIN_OF_GRADED: f64 = 1.6;

/// The refined field beside the present one, which shows what it may still be off by.
struct Fields {
    refined: Solved,
    /// The present field; `None` where the stated error of the refined one is not clearly less.
    present: Option<Solved>,
}

/// Forces in the refined field.
struct Forces {
    /// N/A, [place, coil].
    n_per_a: Vec<f64>,
    off: ForceError,
}

/// What forces in the refined field may still be off by.
enum ForceError {
    /// A part of the change from these in the present field, N/A, [place, coil].
    FromPresent(Vec<f64>),
    /// At every place so much for each coil, N/A: the stated error, relative to its largest force.
    Stated(Vec<f64>),
}

impl Fields {
    fn new(bench: &Bench, tolerance: f64) -> Result<Self, RunError> {
        let scene = bench.scene;
        let lowest_m = scene.design.workspace.z_m.from;
        let solve = |tolerance| {
            let solved = steel::solve(scene, tolerance, lowest_m)?;
            bench.check()?;
            Ok::<Solved, RunError>(solved)
        };
        let present = solve(scene.tolerances.map)?;
        let clearly = |refined: &Solved| refined.steel_error <= CLEARLY_LESS * present.steel_error;
        let mut refined = solve(tolerance)?;
        // Two loose tolerances may share a resolution; a core alone is soon solved again.
        let alone = !coupled(scene.design) && !scene.design.has_iron();
        let finer = FINER * tolerance;
        if alone && finer >= TIGHTEST_STEEL && !clearly(&refined) {
            refined = solve(finer)?;
        }
        let clearer = refined.has_steel() && clearly(&refined);
        Ok(Self {
            refined,
            present: clearer.then_some(present),
        })
    }

    fn forces(&self, bench: &Bench, places_m: &[[f64; 3]]) -> Result<Forces, RunError> {
        let scene = bench.scene;
        let of = |solved| scene.forces_n_per_a(solved, places_m, &bench.within());
        let n_per_a = of(&self.refined)?;
        let off = match &self.present {
            Some(present) => ForceError::FromPresent(of(present)?),
            None => {
                let mut largest = vec![0.0_f64; scene.coils.len()];
                for row in n_per_a.chunks_exact(largest.len()) {
                    for (most, force) in largest.iter_mut().zip(row) {
                        *most = most.max(force.abs());
                    }
                }
                let error = self.refined.point_error();
                ForceError::Stated(largest.into_iter().map(|most| error * most).collect())
            }
        };
        Ok(Forces { n_per_a, off })
    }
}

impl ForceError {
    /// Of the force of `currents_a` at the place `row`, whose forces per ampere are `refined`, N.
    fn at(&self, row: usize, refined: &[f64], currents_a: &[f64]) -> f64 {
        match self {
            Self::FromPresent(present_n_per_a) => {
                let coils = currents_a.len();
                let present = &present_n_per_a[row * coils..(row + 1) * coils];
                let change = present.iter().zip(refined).zip(currents_a);
                let change: f64 = change.map(|((a, b), i)| (a - b) * i).sum();
                LEFT_OF_CHANGE * change.abs()
            }
            Self::Stated(off) => off.iter().zip(currents_a).map(|(f, i)| f * i.abs()).sum(),
        }
    }

    /// Of the constant `lambda_n_per_m` of `problem` in the refined field, relative.
    fn of_constant(
        &self,
        problem: &ForceProblem,
        settings: &Settings,
        (lambda_n_per_m, currents_a): (f64, &[f64]),
    ) -> Result<f64, RunError> {
        Ok(match self {
            Self::FromPresent(present_n_per_a) => {
                let present = ForceProblem {
                    forces_n_per_a: present_n_per_a,
                    ..*problem
                };
                let constant = lambda::constant(&present, settings)?;
                let change = |constant: f64| (constant / lambda_n_per_m - 1.0).abs();
                LEFT_OF_CHANGE * constant.map_or(1.0, change)
            }
            Self::Stated(_) => {
                let off_n = self.at(0, &[], currents_a);
                let lowest_m = lowest_requested_m(problem.height_m.iter().copied());
                lowest_m.map_or(0.0, |lowest_m| off_n / (lambda_n_per_m * lowest_m))
            }
        })
    }
}

/// Where the felt force is compared, and the refined field there.
pub struct Places {
    position_m: Vec<[f64; 3]>,
    forces: Forces,
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
    pub own_error: f64,
    tolerance: f64,
    chosen: Points,
    points: usize,
    cpu_s: f64,
    in_air: bool,
}

/// The rows of a force problem.
struct Rows {
    forces: Forces,
    height_m: Vec<f64>,
    offset_n: Option<Vec<f64>>,
    weights: Option<Vec<f64>>,
}

impl Rows {
    fn new(fields: &Fields, bench: &Bench, points: &ForcePoints) -> Result<Self, RunError> {
        let pull = passive::counted(bench.scene, &points.positions_m)?;
        Ok(Self {
            forces: fields.forces(bench, &points.positions_m)?,
            height_m: points.height_m.clone(),
            offset_n: pull.map(|pull| pull.forces_z_n(&points.positions_m)),
            weights: Some(points.areas.clone()),
        })
    }

    fn problem<'a>(&'a self, scene: &'a Scene, resistance_ohm: &'a [f64]) -> ForceProblem<'a> {
        ForceProblem {
            forces_n_per_a: &self.forces.n_per_a,
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

fn chosen(solution: &Solution) -> Option<(f64, &[f64])> {
    let point = solution.chosen.as_ref()?;
    let chosen = (point.lambda_n_per_m, point.currents_a.as_slice());
    Some(chosen).filter(|(lambda, _)| *lambda > 0.0)
}

/// The tolerance of the refined field beside the tightest of the sweep.
pub(super) fn refined_tolerance(in_air: bool, tightest: f64) -> f64 {
    if in_air {
        KERNEL_ERROR.min((FINER * tightest).max(FINEST_AIR))
    } else {
        (FINER * tightest).max(TIGHTEST_STEEL.min(tightest))
    }
}

/// Computes it.
///
/// # Errors
/// A scene that cannot be computed; no force constant; interruption.
pub fn refine(bench: &Bench, shape: &ShapeSource, ladders: &Ladders) -> Result<Refined, RunError> {
    let watch = Watch::start();
    let scene = bench.scene;
    let tightest = scene.tolerances.map;
    let in_air = !scene.design.has_steel();
    let fields = Fields::new(bench, refined_tolerance(in_air, tightest))?;
    let finest = ladders.refined_points();
    let points = bench.points(&shape.document, finest, &Silent)?;
    let all = Rows::new(&fields, bench, &points)?;
    let resistance_ohm = scene.resistances_ohm();
    let problem = all.problem(scene, &resistance_ohm);
    let options = bench.request.lambda.with_jnd_of(&problem)?;
    let settings = &options.settings;
    let solution = lambda::solve(&problem, settings)?;
    let chosen = chosen(&solution).ok_or_else(|| {
        RunError::NoForceConstant(format!(
            "{:?} has no force constant in the refined run, so there is nothing to hold errors \
             against; see `fluxform lambda` on it",
            shape.document.name
        ))
    })?;
    let (lambda_n_per_m, _) = chosen;
    let against_limit = points.error_against_limit(
        lambda_n_per_m,
        (&problem, &problem),
        (&Wiring::default(), settings),
        ForcesAt {
            scene,
            solved: &fields.refined,
            field: ShapeField::default(),
            progress: &bench.within(),
        },
    )?;
    let of_points = match against_limit {
        Some(error) => error,
        None => {
            let coarser = finest.coarser();
            let mut most = 0.0_f64;
            // Of two gradings one may agree by luck.
            for graded in [coarser, coarser.and_then(Points::coarser)]
                .into_iter()
                .flatten()
            {
                let points = bench.points(&shape.document, graded, &Silent)?;
                let rows = Rows::new(&fields, bench, &points)?;
                let constant = lambda::constant(&rows.problem(scene, &resistance_ohm), settings)?;
                let change = |constant: f64| (constant / lambda_n_per_m - 1.0).abs();
                most = most.max(constant.map_or(1.0, change));
            }
            MARGIN_OF_GRADED * most
        }
    };
    let of_field = all.forces.off.of_constant(&problem, settings, chosen)?;
    let Chosen {
        position_m,
        out_of_reach,
    } = choose(shape, ladders, bench)?;
    let places = Places {
        forces: fields.forces(bench, &position_m)?,
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
        own_error: of_points + of_field,
        solution,
        tolerance: fields.refined.tolerance,
        chosen: finest,
        points: points.height_m.len(),
        cpu_s: watch.processor_s(),
        in_air,
    })
}

impl Refined {
    /// As the result states it.
    pub fn summary(&self) -> Reference {
        let field = if self.in_air {
            format!("the windings' field to {:e}", self.tolerance)
        } else {
            "the field to a tenth of the present tolerance or less".to_owned()
        };
        let points = match self.chosen {
            Points::Grid([x, y]) => format!("a grid of {x} x {y} points"),
            Points::Graded {
                max_deviation_m, ..
            } => format!("points graded to {} mm", number(1e3 * max_deviation_m)),
        };
        let left_out = match self.places.out_of_reach {
            0 => String::new(),
            more => format!("; {more} places that no map reaches are left out"),
        };
        Reference {
            how: format!(
                "{field}; {points}, weighted by the area they stand for; the felt force without a map, computed at \
                 the places directly{left_out}"
            ),
            tolerance: self.tolerance,
            points: self.points as u64,
            places: self.places.position_m.len() as u64,
            lambda_n_per_m: self.lambda_n_per_m,
            lambda_error: Some(self.own_error),
            cpu_s: self.cpu_s,
        }
    }
}

impl Places {
    /// Largest |force by the map - force directly| of the same currents at the places, and what the latter may be
    /// off by, relative to the force that is to be felt, lambda h, times the factor that stands for what lies
    /// between them.
    ///
    /// # Errors
    /// A place outside the map.
    pub fn felt_error(
        &self,
        map: &SceneMap,
        lambda_n_per_m: f64,
        currents_a: &[f64],
    ) -> Result<f64, RunError> {
        let mut largest = 0.0_f64;
        let rows = self.forces.n_per_a.chunks(self.coils);
        for (row, (place, direct)) in self.position_m.iter().zip(rows).enumerate() {
            let own_n = self.forces.off.at(row, direct, currents_a);
            let by_map = map.force_n(self.moment_a_m2, currents_a, *place);
            let [.., by_map] = by_map.ok_or_else(|| {
                RunError::Input(format!(
                    "shape {:?}: a place of its surface lies outside the map",
                    self.shape
                ))
            })?;
            // A coil that the map leaves out gives no force by it.
            let direct: f64 = direct.iter().zip(currents_a).map(|(f, i)| f * i).sum();
            let off_n = (by_map - direct).abs() + own_n;
            let target_n = lambda_n_per_m * place[2];
            largest = largest.max((off_n / target_n).abs());
        }
        Ok(SAFETY * largest)
    }
}
