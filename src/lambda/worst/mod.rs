//! The worst-point form: the least largest error as a function of the force constant, and the
//! largest force constant with no point too weak.
//!
//! `t*(lambda) = min over I in C of max_j |lambda h_j - offset_j - (G I)_j|` with
//! `C = {lower <= I <= upper, sum I <= total}` is convex and piecewise linear. Let t_0 be the same
//! without the drivers' size: of their limits only a zero that keeps a driver from reversing is left
//! (without offset it is `w_0 lambda max h`). Then
//!
//! - `lambda_linear` is where t* leaves t_0,
//! - `lambda_jnd` is the largest lambda with `t* - t_0 <= w lambda max |h|`: without offset that
//!   with `t* <= (w_0 + w) lambda max h`,
//! - `lambda_maxmin` is the largest lambda with `G I + offset >= lambda h` at every point.
//!
//! Errors are judged by the largest requested force, not by that of their own point, so a surface
//! that comes down to `h = 0` needs no exception.
//!
//! Where several currents are equally good, a vertex is returned: of coils that cannot pull, the one
//! with the least sum of currents.

mod blocks;
mod constraint_generation;
mod criteria;
mod free;
mod maxmin;
mod path;
mod perceptual_tolerance;
mod points;
mod program;
mod proof;
mod scaled;

pub(super) use maxmin::largest;
pub use maxmin::{Maxmin, maxmin};
pub use path::{ActivePoint, Turn, WorstPath};
pub use perceptual_tolerance::{WithinTolerance, felt};
pub use proof::lower_bound_n;

use fluxform_base::accuracy::StageAccuracy;
use fluxform_numerics::real::Real;

use super::problem::{ForceProblem, ProblemError, Settings};
use super::qr_reduction::{largest_entries, times_power};
use constraint_generation::{Followed, Search};
use criteria::Comparison;
use free::FreeProblem;
use program::End;
use scaled::{Form, Limits, Scaled};

/// Shares of lambda max h by which points may be missed where rounding leads a path astray that
/// misses none; the estimated error states it.
const LEEWAYS: [f64; 2] = [1e-12, 1e-10];

/// Currents at one force constant by the worst-point form.
#[derive(Debug, Clone, PartialEq)]
pub struct WorstPoint {
    /// Force constant, N/m.
    pub lambda_n_per_m: f64,
    /// Currents, A.
    pub currents_a: Vec<f64>,
    /// Largest error of these currents at any point, N.
    pub worst_error_n: f64,
    /// The same relative to lambda max h; `None` where that is zero.
    pub relative_worst_error: Option<f64>,
    /// Proof of optimality: no currents within the limits are better by more than this, N.
    pub gap_n: f64,
    /// The points that decide.
    pub active: Vec<ActivePoint>,
}

/// The worst-point path and the force constants on it.
#[derive(Debug, Clone)]
pub struct WorstSolution {
    /// Where t* leaves t_0, N/m; `None`: it never does.
    pub lambda_linear_n_per_m: Option<f64>,
    /// The largest with `t* - t_0 <= w lambda max h`, N/m; `None`: all are.
    pub lambda_jnd_n_per_m: Option<f64>,
    /// t*/(lambda max h) as lambda goes to zero; `None` with an offset or without heights.
    pub floor: Option<f64>,
    /// t* and the currents anywhere.
    pub path: WorstPath,
    /// False where the path could not be followed to its end.
    pub complete: bool,
    /// Estimated error of t*.
    pub accuracy: StageAccuracy,
}

/// Follows t*(lambda) from 0 on, over all points.
///
/// A program over few points is solved exactly, in double-double; the points it misses by more
/// than the rounding of their forces are added until there are none.
/// The result does not depend on the number of threads.
///
/// # Errors
/// Where the problem is malformed.
pub fn worst_point(
    problem: &ForceProblem,
    settings: &Settings,
) -> Result<WorstSolution, ProblemError> {
    problem.validate(settings)?;
    let largest = largest_entries(problem);
    let open = FreeProblem::new(problem, &largest);
    let open_problem = open.as_ref().map(|open| open.problem(problem));
    let mut scaled = Scaled::new(problem, &largest, Form::Worst, Limits::All);
    let mut free = Scaled::new(
        open_problem.as_ref().unwrap_or(problem),
        open.as_ref().map_or(&largest, |open| &open.largest),
        Form::Worst,
        Limits::Lower,
    );
    let whole = |followed: &Followed| followed.end == End::Whole && !followed.pieces.is_empty();
    let mut follow = |leeway: f64| {
        scaled.leeway = leeway;
        free.leeway = leeway;
        let mut search = Search::new(&scaled, Form::Worst);
        let limited = search.follow(&scaled);
        // Other columns are other points to this search.
        let unlimited = match &open_problem {
            Some(_) => Search::new(&free, Form::Worst).follow(&free),
            None => search.follow(&free),
        };
        let complete = whole(&limited) && whole(&unlimited);
        (limited, unlimited, complete)
    };
    let (mut limited, mut unlimited, mut complete) = follow(0.0);
    for leeway in LEEWAYS {
        if !complete {
            (limited, unlimited, complete) = follow(leeway);
        }
    }
    let doubt = limited.doubt.max(unlimited.doubt);
    let comparison = Comparison {
        limited: &limited.pieces,
        unlimited: &unlimited.pieces,
        top: scaled.top(),
        doubt,
    };
    let wanted = scaled.height_m() > 0.0 && complete;
    let linear = if wanted { comparison.linear() } else { None };
    let jnd = match linear {
        None => None,
        Some(lambda) if settings.jnd_weight == 0.0 => Some(lambda),
        Some(_) => comparison.jnd(settings.jnd_weight),
    };
    let si = |lambda: fluxform_numerics::double_double::DoubleDouble| {
        times_power(lambda.to_f64(), scaled.lambda_unit())
    };
    let path = WorstPath::new(problem, &scaled, &limited);
    let first = unlimited.pieces.first();
    let floor = first
        .filter(|_| wanted && scaled.offset_n() == 0.0)
        .map(|piece| {
            (piece.rate[piece.rate.len() - 1] / scaled.top())
                .to_f64()
                .max(0.0)
        });
    Ok(WorstSolution {
        lambda_linear_n_per_m: linear.map(si),
        lambda_jnd_n_per_m: jnd.map(si),
        floor,
        path,
        complete,
        accuracy: StageAccuracy {
            estimate: doubt,
            relative_to: "lambda max h".to_owned(),
            method: "rounding of the forces of the points that are not in the program".to_owned(),
        },
    })
}

impl WorstSolution {
    /// Currents and their proof at a force constant.
    #[must_use]
    pub fn at(&self, problem: &ForceProblem, lambda_n_per_m: f64) -> WorstPoint {
        let currents_a = self.path.currents_a(lambda_n_per_m);
        let active = self.path.active(lambda_n_per_m).to_vec();
        let worst_error_n = proof::worst_error_n(problem, lambda_n_per_m, &currents_a);
        let least_n = lower_bound_n(problem, lambda_n_per_m, &active);
        let heights = problem.height_m.iter();
        let scale = lambda_n_per_m * heights.fold(0.0_f64, |most, h| most.max(h.abs()));
        WorstPoint {
            lambda_n_per_m,
            currents_a,
            worst_error_n,
            relative_worst_error: (scale > 0.0).then(|| worst_error_n / scale),
            gap_n: (worst_error_n - least_n).max(0.0),
            active,
        }
    }
}
