//! The felt error of an object's points under uncertainty: of static currents, of feedback, and of currents
//! chosen for it.

use std::f64::consts::TAU;

use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use fluxform_base::uncertainty::{Cause, Uncertainty};

use super::{Draw, ErrorForm, Forms, ON_AXES, ON_DIAGONALS, RULE, Reach, Turned, displacements_m};
use crate::allocation::{Allocator, AllocatorError};
use crate::problem::{ForceProblem, ProblemError, Settings};
use crate::sampling::{QUARTERS, Squares, share_and_error};
use crate::sideways::SIDEWAYS_WEIGHT;
use crate::vector_allocation::VectorAllocator;

/// Prices of the curve, from the highest down by this factor.
const PRICES: i32 = 21;
const PRICE_FACTOR: f64 = 0.562_341_325_190_349; // 10^(-1/4)
/// Without a cap the least power whose error is at most this many times the least.
const NEAR_LEAST: f64 = 1.05;
/// Halvings of the price between too high and too low.
const HALVINGS: usize = 40;
/// Prices are not raised beyond this many times the highest of the curve.
const DEAREST: f64 = 1e12;
/// Directions in which the finger tilts for the largest error.
const TILTS: usize = 8;
/// Turns by which the drivers' signs follow the error's direction.
const SIGN_TURNS: usize = 3;

/// Why there is no study.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum StudyError {
    /// Not a force problem.
    #[error(transparent)]
    Problem(#[from] ProblemError),
    /// Limits or resistances beyond what can be allocated.
    #[error(transparent)]
    Allocator(#[from] AllocatorError),
}

/// An object's points with the forces around them.
#[derive(Debug, Clone, Copy)]
pub struct Surroundings<'a> {
    /// Heights, weights and limits; its forces and pulls are not looked at.
    pub problem: ForceProblem<'a>,
    /// The requested force over lambda times the height, at every point.
    pub direction: &'a [[f64; 3]],
    /// Whether the sideways force is requested too.
    pub vector: bool,
    /// Force per ampere, [point, displacement, coil], at [`displacements_m`] from every point.
    pub fields: &'a [Turned],
    /// Upward force without currents, N, [point, displacement].
    pub pull_n: Option<&'a [f64]>,
    /// The quarter of every point ([`crate::sampling::quarters`]).
    pub quarters: &'a [usize],
}

/// Errors of the felt force: root mean squares of its difference from the requested one over the points and
/// the uncertainties, relative to that of the requested force.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
pub struct FeltError {
    /// Of the whole vector.
    pub expected: f64,
    /// Of its upward part.
    pub vertical: f64,
    /// Of its sideways part.
    pub sideways: f64,
    /// The longest difference at any point that was found within the bounds, relative to the largest requested force: of
    /// states on them and of the random displays, which are no proof that there is no longer one.
    pub worst: f64,
    /// Mean power in the coils, W.
    pub mean_power_w: f64,
}

/// The error that currents of one kind promise, and that of random displays.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct CurrentsError {
    /// By the quadratic form; `worst` is the longer one of those that a search on the bounds and the random displays find.
    pub promised: FeltError,
    /// Of random displays within the bounds; `worst` is the worst of them.
    pub realised: FeltError,
}

/// A point of the trade-off between error and power.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct TradeOff {
    /// The price of power at which both are least together, N^2/W.
    pub price_n2_per_w: f64,
    /// Mean power over the points, W.
    pub mean_power_w: f64,
    /// See [`FeltError`].
    pub expected: f64,
    /// See [`FeltError`].
    pub vertical: f64,
    /// See [`FeltError`].
    pub sideways: f64,
}

/// Currents chosen for the uncertainties.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct RobustSetting {
    /// The chosen price of power, N^2/W: with it a runtime finds the currents at any place.
    pub price_n2_per_w: f64,
    /// Their errors.
    pub error: CurrentsError,
    /// Error against power, the least power first.
    pub trade_off: Vec<TradeOff>,
    /// Static currents, A; absent where every point has its own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub currents_a: Option<Vec<f64>>,
}

/// A share of the requested force with each kind of currents.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Shares {
    /// With the static currents.
    #[serde(rename = "static")]
    pub fixed: f64,
    /// With feedback, currents of least power.
    pub feedback: f64,
    /// With feedback, currents chosen for the uncertainties.
    pub robust: f64,
}

/// The error that one uncertainty causes.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct CauseCost {
    /// Which.
    pub cause: Cause,
    /// Its bound: m, degrees, C or a share.
    pub bound: f64,
    /// The error that it adds alone: the root of the difference of squares with and without it.
    pub alone: Shares,
    /// By how much the expected error that currents are chosen for falls when its bound is half as large: the
    /// vector's, or the upward one where that alone is requested. Currents for the uncertainties are chosen again.
    pub halving_gains: Shares,
}

/// The felt error under uncertainty.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Study {
    /// The bounds.
    pub given: Uncertainty,
    /// The force constant, N/m.
    pub lambda_n_per_m: f64,
    /// Points looked at, evenly among all.
    pub points: usize,
    /// Random displays.
    pub draws: usize,
    /// The limit of the mean power, W; absent without one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub power_cap_w: Option<f64>,
    /// The static currents.
    #[serde(rename = "static")]
    pub fixed: CurrentsError,
    /// Feedback, currents of least power.
    pub feedback: CurrentsError,
    /// Static currents chosen for the uncertainties.
    pub robust_static: RobustSetting,
    /// Feedback, currents chosen for the uncertainties.
    pub robust: RobustSetting,
    /// The expected errors of the same currents if nothing were uncertain.
    pub exact: Shares,
    /// By how much the expected errors may be off, being those of so many points; absent in files of programs without
    /// it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sampling: Option<Shares>,
    /// The error that each uncertainty causes, the one first whose halving gains most.
    pub causes: Vec<CauseCost>,
}

impl Surroundings<'_> {
    fn places(&self) -> usize {
        let rows = self.problem.points() * self.problem.coils();
        self.fields.len() / rows.max(1)
    }

    fn field(&self, point: usize, place: usize) -> &[Turned] {
        let coils = self.problem.coils();
        let at = (point * self.places() + place) * coils;
        &self.fields[at..at + coils]
    }

    fn pull_n(&self, point: usize, place: usize) -> f64 {
        let at = point * self.places() + place;
        self.pull_n.map_or(0.0, |all| all[at])
    }

    fn request_n(&self, point: usize, lambda: f64) -> [f64; 3] {
        self.direction[point].map(|part| lambda * self.problem.height_m[point] * part)
    }

    fn weight(&self, point: usize) -> f64 {
        let problem = &self.problem;
        problem
            .weights
            .map_or(1.0, |all| all[point] / problem.heaviest())
    }

    /// The places of a reach and their weights.
    fn rule(&self, reach: Reach) -> impl Iterator<Item = (usize, f64)> + use<> {
        let reach = if self.places() == 1 {
            Reach::Point
        } else {
            reach
        };
        let places = reach.places();
        let first = places.start;
        places.map(move |place| {
            let weight = match reach {
                Reach::Point => 1.0,
                Reach::Half | Reach::Whole | Reach::Surface if place - first < 6 => ON_AXES.1,
                Reach::Half | Reach::Whole | Reach::Surface => ON_DIAGONALS.1,
            };
            (place, weight)
        })
    }

    fn forms(&self, lambda: f64, given: &Uncertainty, reach: Reach) -> Vec<Forms> {
        (0..self.problem.points())
            .into_par_iter()
            .map(|point| {
                let places = self.rule(reach).map(|(place, weight)| {
                    (self.field(point, place), self.pull_n(point, place), weight)
                });
                let request = self.request_n(point, lambda);
                Forms::new(self.problem.coils(), given, request, places)
            })
            .collect()
    }
}

/// Currents of a study.
enum Currents {
    Static(Vec<f64>),
    /// Of every point.
    Own(Vec<Vec<f64>>),
}

impl Currents {
    fn at(&self, point: usize) -> &[f64] {
        match self {
            Self::Static(currents) => currents,
            Self::Own(all) => &all[point],
        }
    }
}

/// The points with what all sums over them need.
struct Bench<'a> {
    around: &'a Surroundings<'a>,
    lambda: f64,
    weight: f64,
    /// Mean square of the requested force, N^2.
    requested_n2: f64,
    most_requested_n: f64,
}

impl<'a> Bench<'a> {
    fn new(around: &'a Surroundings<'a>, lambda: f64) -> Self {
        let points = 0..around.problem.points();
        let square = |point| {
            let request = around.request_n(point, lambda);
            request.iter().map(|part| part * part).sum::<f64>()
        };
        let weight: f64 = points.clone().map(|point| around.weight(point)).sum();
        let requested: f64 = points
            .clone()
            .map(|point| around.weight(point) * square(point))
            .sum();
        Self {
            around,
            lambda,
            weight,
            requested_n2: requested / weight,
            most_requested_n: points.map(square).fold(0.0, f64::max).sqrt(),
        }
    }

    fn power_w(&self, currents: &[f64]) -> f64 {
        let ohm = self.around.problem.resistance_ohm;
        ohm.iter().zip(currents).map(|(ohm, i)| ohm * i * i).sum()
    }

    /// Shares and power from sums of upward and sideways squares and of power; no worst.
    fn shares(&self, upward: f64, sideways: f64, power: f64) -> FeltError {
        let share = |sum: f64| (sum / self.weight / self.requested_n2).sqrt();
        FeltError {
            expected: share(upward + sideways),
            vertical: share(upward),
            sideways: share(sideways),
            worst: 0.0,
            mean_power_w: power / self.weight,
        }
    }

    /// The objective: the error of the requested force.
    fn aim(&self, error: &FeltError) -> f64 {
        if self.around.vector {
            error.expected
        } else {
            error.vertical
        }
    }

    /// Expected errors by forms.
    fn expected(&self, forms: &[Forms], currents: &Currents) -> FeltError {
        let [mut upward, mut sideways, mut power] = [0.0; 3];
        for (point, forms) in forms.iter().enumerate() {
            let (weight, own) = (self.around.weight(point), currents.at(point));
            upward += weight * forms.upward.value(own);
            sideways += weight * forms.sideways.value(own);
            power += weight * self.power_w(own);
        }
        self.shares(upward, sideways, power)
    }

    /// By how much the expected error may be off, being that of some points.
    fn sampling(&self, forms: &[Forms], currents: &Currents) -> f64 {
        let mut quarters = [Squares::default(); QUARTERS];
        for (point, forms) in forms.iter().enumerate() {
            let (weight, own) = (self.around.weight(point), currents.at(point));
            let quarter = &mut quarters[self.around.quarters[point]];
            quarter.error += weight * (forms.upward.value(own) + forms.sideways.value(own));
            let request = self.around.request_n(point, self.lambda);
            quarter.requested += weight * request.iter().map(|part| part * part).sum::<f64>();
        }
        share_and_error(&quarters).1
    }

    /// Of the random displays, whose forces per ampere and pulls are given.
    fn realised(&self, drawn: &Drawn, currents: &Currents) -> FeltError {
        let coils = self.around.problem.coils();
        let [mut upward, mut sideways, mut power, mut weights, mut worst] = [0.0_f64; 5];
        for (k, draw) in drawn.draws.iter().enumerate() {
            let weight = self.around.weight(draw.point);
            let own = currents.at(draw.point);
            let field = &drawn.fields[k * coils..(k + 1) * coils];
            let force = draw.force_n(field, drawn.pull_n.map_or(0.0, |all| all[k]), own);
            let request = self.around.request_n(draw.point, self.lambda);
            let [x, y, z]: [f64; 3] = std::array::from_fn(|axis| force[axis] - request[axis]);
            upward += weight * z * z;
            sideways += weight * (x * x + y * y);
            power += weight * self.power_w(own);
            weights += weight;
            worst = worst.max(x.hypot(y).hypot(z));
        }
        let scale = self.weight / weights;
        FeltError {
            worst: worst / self.most_requested_n,
            ..self.shares(scale * upward, scale * sideways, scale * power)
        }
    }

    /// The longest difference from the request at any point: on the surface of the box of displacements, for
    /// tilts around the moment by half and all of the bound, for the magnet cold and hot, the drivers' errors all
    /// against the force. Not all states are tried.
    fn worst(&self, given: &Uncertainty, currents: &Currents) -> f64 {
        let tilt = given.tilt_deg.to_radians();
        let turned = |tilt: f64, k: usize| {
            let way = TAU * k as f64 / TILTS as f64;
            [tilt.cos(), tilt.sin() * way.cos(), tilt.sin() * way.sin()]
        };
        let mut moments = vec![[1.0, 0.0, 0.0]];
        if tilt > 0.0 {
            for tilt in [0.5 * tilt, tilt] {
                moments.extend((0..TILTS).map(|k| turned(tilt, k)));
            }
        }
        let strengths = [1.0, given.strength(1.0)];
        let points: Vec<usize> = (0..self.around.problem.points()).collect();
        let of_point = |&point: &usize| -> f64 {
            let request = self.around.request_n(point, self.lambda);
            let own = currents.at(point);
            let mut worst = 0.0_f64;
            for (place, _) in self.around.rule(Reach::Surface) {
                let field = self.around.field(point, place);
                for moment in &moments {
                    let parts: Vec<[f64; 3]> = field
                        .iter()
                        .zip(own)
                        .map(|(turned, i)| {
                            std::array::from_fn(|axis| {
                                let along = |k: usize| moment[k] * turned[3 * k + axis];
                                i * (along(0) + along(1) + along(2))
                            })
                        })
                        .collect();
                    for strength in strengths {
                        let mut rest = request.map(|part| -part);
                        rest[2] += self.around.pull_n(point, place);
                        worst = worst.max(driven_wrong(&parts, strength, rest, given.driver));
                    }
                }
            }
            worst
        };
        let worst: f64 = points.par_iter().map(of_point).reduce(|| 0.0, f64::max);
        worst / self.most_requested_n
    }

    fn error(
        &self,
        forms: &[Forms],
        drawn: &Drawn,
        given: &Uncertainty,
        currents: &Currents,
    ) -> CurrentsError {
        let realised = self.realised(drawn, currents);
        CurrentsError {
            promised: FeltError {
                worst: self.worst(given, currents).max(realised.worst),
                ..self.expected(forms, currents)
            },
            realised,
        }
    }
}

/// The longest sum of `rest` and the coils' forces times `strength`, each off by the share `driver` either way.
fn driven_wrong(parts: &[[f64; 3]], strength: f64, rest: [f64; 3], driver: f64) -> f64 {
    let sum = |signs: &dyn Fn(&[f64; 3]) -> f64| {
        let mut sum = rest;
        for part in parts {
            let factor = strength * (1.0 + driver * signs(part));
            for (total, value) in sum.iter_mut().zip(part) {
                *total += factor * value;
            }
        }
        sum
    };
    let length = |v: [f64; 3]| v[0].hypot(v[1]).hypot(v[2]);
    let undisturbed = sum(&|_| 0.0);
    if driver <= 0.0 {
        return length(undisturbed);
    }
    // Every start ends in a largest sum of its own.
    let axes = [0, 1, 2].map(|axis| std::array::from_fn(|k| f64::from(u8::from(k == axis))));
    let starts = axes
        .into_iter()
        .flat_map(|way: [f64; 3]| [way, way.map(|v| -v)]);
    let ended = starts.chain([undisturbed]).map(|start| {
        (0..SIGN_TURNS).fold(start, |way, _| {
            sum(&|part| (way[0] * part[0] + way[1] * part[1] + way[2] * part[2]).signum())
        })
    });
    ended.map(length).fold(0.0, f64::max)
}

/// Random displays with the forces per ampere, [draw, coil], and pulls at their places.
#[derive(Debug, Clone, Copy)]
pub struct Drawn<'a> {
    /// The displays.
    pub draws: &'a [Draw],
    /// Force per ampere, [draw, coil].
    pub fields: &'a [Turned],
    /// Upward force without currents at each, N.
    pub pull_n: Option<&'a [f64]>,
}

/// The currents of least power for the request at every point (eq. 8).
fn followed(around: &Surroundings, lambda: f64) -> Result<Currents, StudyError> {
    let problem = &around.problem;
    let (ohm, lower, upper) = (problem.resistance_ohm, problem.lower_a, problem.upper_a);
    let total = problem.total_max_a;
    let mut of_upward = Allocator::new(ohm, lower, upper, total)?;
    let mut of_vector = VectorAllocator::new(ohm, lower, upper, total, SIDEWAYS_WEIGHT)?;
    let own = |point| {
        let field = around.field(point, 0);
        let mut currents = vec![0.0; problem.coils()];
        let [x, y, z] = around.request_n(point, lambda);
        let z = z - around.pull_n(point, 0);
        if around.vector {
            let rows: Vec<[f64; 3]> = field.iter().map(|f| [f[0], f[1], f[2]]).collect();
            of_vector.allocate(&rows, [x, y, z], &mut currents);
        } else {
            let row: Vec<f64> = field.iter().map(|f| f[2]).collect();
            of_upward.allocate(&row, z, &mut currents);
        }
        currents
    };
    Ok(Currents::Own((0..problem.points()).map(own).collect()))
}

/// Chooses currents along the trade-off of error and power.
struct Chooser<'a> {
    bench: &'a Bench<'a>,
    forms: &'a [Forms],
    /// The quantity that is minimised: of every point, or of all together.
    combined: Vec<ErrorForm>,
    fixed: bool,
}

impl<'a> Chooser<'a> {
    fn new(bench: &'a Bench<'a>, forms: &'a [Forms], fixed: bool) -> Self {
        let vector = bench.around.vector;
        let mut combined: Vec<ErrorForm> =
            forms.par_iter().map(|one| one.combined(vector)).collect();
        if fixed {
            let mut all = ErrorForm::new(bench.around.problem.coils());
            for (point, form) in combined.iter().enumerate() {
                all.add(form, bench.around.weight(point) / bench.weight);
            }
            combined = vec![all];
        }
        Self {
            bench,
            forms,
            combined,
            fixed,
        }
    }

    fn at(&self, price: f64) -> (Currents, FeltError) {
        let problem = &self.bench.around.problem;
        let one = |form: &ErrorForm| {
            let mut currents = vec![0.0; problem.coils()];
            form.minimise(problem, price, &mut currents);
            currents
        };
        let mut own: Vec<Vec<f64>> = self.combined.par_iter().map(one).collect();
        let currents = if self.fixed {
            Currents::Static(own.swap_remove(0))
        } else {
            Currents::Own(own)
        };
        let error = self.bench.expected(self.forms, &currents);
        (currents, error)
    }

    /// The setting, and the curve; `top` is the highest price.
    fn choose(&self, top: f64, cap_w: Option<f64>) -> (f64, Currents, Vec<TradeOff>) {
        let prices = (0..PRICES).map(|k| top * PRICE_FACTOR.powi(k));
        let curve: Vec<(f64, FeltError)> = prices.map(|price| (price, self.at(price).1)).collect();
        let least = curve.last().map_or(0.0, |(_, error)| self.bench.aim(error));
        // Above the price at which this ends, power is too dear: too little error is bought, or the cap holds.
        let dear = |error: &FeltError| match cap_w {
            Some(cap) => error.mean_power_w <= cap,
            None => self.bench.aim(error) > NEAR_LEAST * least,
        };
        let mut high = top;
        if cap_w.is_some() {
            while high < DEAREST * top && !dear(&self.at(high).1) {
                high *= 2.0;
            }
        }
        let cheap = curve.iter().find(|(_, error)| !dear(error));
        // Without a crossing the cheapest of the curve does.
        let mut low = cheap.or(curve.last()).map_or(top, |(price, _)| *price);
        for _ in 0..if cheap.is_some() { HALVINGS } else { 0 } {
            let middle = (high * low).sqrt();
            if dear(&self.at(middle).1) {
                high = middle;
            } else {
                low = middle;
            }
        }
        let price = if cap_w.is_some() && cheap.is_some() {
            high
        } else {
            low
        };
        let point = |(price, error): (f64, FeltError)| TradeOff {
            price_n2_per_w: price,
            mean_power_w: error.mean_power_w,
            expected: error.expected,
            vertical: error.vertical,
            sideways: error.sideways,
        };
        let currents = self.at(price).0;
        (price, currents, curve.into_iter().map(point).collect())
    }
}

/// The felt error of `lambda_n_per_m` under what is `given` to be uncertain, static currents being
/// `static_currents_a`; at most `power_cap_w` of mean power, if given. `None` where no force is requested.
///
/// # Errors
/// Where the problem is malformed.
///
/// # Panics
/// When there are fewer forces than points, displacements and coils.
pub fn study(
    around: &Surroundings,
    lambda_n_per_m: f64,
    static_currents_a: &[f64],
    (given, power_cap_w): (&Uncertainty, Option<f64>),
    drawn: &Drawn,
) -> Result<Option<Study>, StudyError> {
    around.problem.validate(&Settings::default())?;
    let bench = Bench::new(around, lambda_n_per_m);
    if bench.requested_n2 <= 0.0 {
        return Ok(None);
    }
    let forms = around.forms(lambda_n_per_m, given, Reach::Whole);
    let fixed = Currents::Static(static_currents_a.to_vec());
    let feedback = followed(around, lambda_n_per_m)?;
    // A watt of the currents of least power for a square of the whole force.
    let power_w = bench.expected(&forms, &feedback).mean_power_w;
    let top = bench.requested_n2 / power_w.max(f64::MIN_POSITIVE);
    let choose = |fixed: bool| {
        let chooser = Chooser::new(&bench, &forms, fixed);
        let (price_n2_per_w, currents, trade_off) = chooser.choose(top, power_cap_w);
        let setting = RobustSetting {
            price_n2_per_w,
            error: bench.error(&forms, drawn, given, &currents),
            trade_off,
            currents_a: match &currents {
                Currents::Static(own) => Some(own.clone()),
                Currents::Own(_) => None,
            },
        };
        (setting, currents)
    };
    let (robust_static, _) = choose(true);
    let (robust, robust_currents) = choose(false);
    let (exact, causes) = Costs {
        bench: &bench,
        given,
        fixed: &fixed,
        feedback: &feedback,
        robust: &robust_currents,
        price_n2_per_w: robust.price_n2_per_w,
    }
    .ranked(&forms);
    debug_assert!(around.places() == displacements_m(given).len() && RULE == 14);
    Ok(Some(Study {
        given: *given,
        lambda_n_per_m,
        points: around.problem.points(),
        draws: drawn.draws.len(),
        power_cap_w,
        sampling: Some(Shares {
            fixed: bench.sampling(&forms, &fixed),
            feedback: bench.sampling(&forms, &feedback),
            robust: bench.sampling(&forms, &robust_currents),
        }),
        fixed: bench.error(&forms, drawn, given, &fixed),
        feedback: bench.error(&forms, drawn, given, &feedback),
        robust_static,
        robust,
        causes,
        exact,
    }))
}

/// The error that each uncertainty causes with three kinds of currents.
struct Costs<'a> {
    bench: &'a Bench<'a>,
    given: &'a Uncertainty,
    fixed: &'a Currents,
    feedback: &'a Currents,
    robust: &'a Currents,
    price_n2_per_w: f64,
}

impl Costs<'_> {
    /// The errors of the vector and those that currents are chosen for.
    fn shares(&self, forms: &[Forms], robust: &Currents) -> [Shares; 2] {
        let [fixed, feedback, robust] =
            [self.fixed, self.feedback, robust].map(|own| self.bench.expected(forms, own));
        let of = |error: &dyn Fn(&FeltError) -> f64| Shares {
            fixed: error(&fixed),
            feedback: error(&feedback),
            robust: error(&robust),
        };
        [
            of(&|error| error.expected),
            of(&|error| self.bench.aim(error)),
        ]
    }

    /// The errors if nothing were uncertain, and the costs; `all` are the forms of everything.
    fn ranked(&self, all: &[Forms]) -> (Shares, Vec<CauseCost>) {
        let (around, lambda) = (self.bench.around, self.bench.lambda);
        let exact = around.forms(lambda, &Uncertainty::default(), Reach::Point);
        let [exact, _] = self.shares(&exact, self.robust);
        let [_, all] = self.shares(all, self.robust);
        let cost = |cause: Cause| {
            let (only, halved) = (self.given.only(cause), self.given.halved(cause));
            let (reach, half) = match cause {
                Cause::Sensor => (Reach::Whole, Reach::Half),
                Cause::Tilt | Cause::Heat | Cause::Driver => (Reach::Point, Reach::Whole),
            };
            let [with, _] = self.shares(&around.forms(lambda, &only, reach), self.robust);
            let forms = around.forms(lambda, &halved, half);
            let again = Chooser::new(self.bench, &forms, false)
                .at(self.price_n2_per_w)
                .0;
            let [_, less] = self.shares(&forms, &again);
            let added = |with: f64, without: f64| (with * with - without * without).max(0.0).sqrt();
            CauseCost {
                cause,
                bound: self.given.of(cause),
                alone: Shares {
                    fixed: added(with.fixed, exact.fixed),
                    feedback: added(with.feedback, exact.feedback),
                    robust: added(with.robust, exact.robust),
                },
                halving_gains: Shares {
                    fixed: all.fixed - less.fixed,
                    feedback: all.feedback - less.feedback,
                    robust: all.robust - less.robust,
                },
            }
        };
        let given = Cause::ALL
            .iter()
            .copied()
            .filter(|cause| self.given.of(*cause) > 0.0);
        let mut causes: Vec<CauseCost> = given.map(cost).collect();
        causes.sort_by(|a, b| {
            b.halving_gains
                .feedback
                .total_cmp(&a.halving_gains.feedback)
        });
        (exact, causes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fluxform_testing::Random;

    /// Regression: the signs followed one start to a sum that others exceed.
    #[test]
    fn drivers_errors_add_up_to_nearly_the_longest_of_all_signs() {
        let mut random = Random::new(7_u64);
        for _ in 0..200 {
            let mut vector = |size: f64| [0; 3].map(|_| size * (random.unit() - 0.5));
            let parts: Vec<[f64; 3]> = (0..6).map(|_| vector(1.0)).collect();
            let rest = vector(0.3);
            let found = driven_wrong(&parts, 1.1, rest, 0.5);
            let longest = (0..64_u32)
                .map(|signs| {
                    let mut sum = rest;
                    for (k, part) in parts.iter().enumerate() {
                        let sign = if signs >> k & 1 == 1 { 1.0 } else { -1.0 };
                        for (total, value) in sum.iter_mut().zip(part) {
                            *total += 1.1 * (1.0 + 0.5 * sign) * value;
                        }
                    }
                    sum[0].hypot(sum[1]).hypot(sum[2])
                })
                .fold(0.0, f64::max);
            assert!(
                found <= longest * (1.0 + 1e-12) && found > 0.97 * longest,
                "{found} {longest}"
            );
        }
    }
}
