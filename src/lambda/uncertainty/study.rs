//! The felt error of an object's points under uncertainty: of static currents, of feedback, and of currents
//! chosen for it.

use std::f64::consts::TAU;

use rayon::prelude::*;

use fluxform_base::uncertainty::{Cause, Uncertainty, relative_pull};

use super::felt_error::{
    CauseCost, CurrentsError, FeltError, RobustSetting, Shares, Study, TradeOff,
};
use super::{Draw, ErrorForm, Forms, ON_AXES, ON_DIAGONALS, RULE, Reach, Turned, displacements_m};
use crate::all_points::AllPoints;
use crate::allocation::Allocator;
use crate::feedback::FeedbackError;
use crate::problem::{ForceProblem, Settings};
use crate::sampling::{QUARTERS, Squares, over_all_points, share, share_and_error};
use crate::vector_allocation::{SIDEWAYS_WEIGHT, VectorAllocator};
use crate::vector_feedback::QuarterErrors;

/// Prices of the curve, from the highest down by this factor.
const PRICES: i32 = 21;
const PRICE_FACTOR: f64 = 0.562_341_325_190_349; // 10^(-1/4)
/// Without a cap the least power whose error is at most this many times the least.
const NEAR_LEAST: f64 = 1.05;
/// Halvings of the price between too high and too low.
const HALVINGS: usize = 20;
/// Prices are not raised beyond this many times the highest of the curve.
const DEAREST: f64 = 1e12;
/// Directions in which the finger tilts for the largest error.
const TILTS: usize = 8;
/// Turns by which the drivers' signs follow the error's direction.
const SIGN_TURNS: usize = 3;

/// Some of an object's points with the forces around them.
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

    fn requested_n2(&self, point: usize, lambda: f64) -> f64 {
        let request = self.request_n(point, lambda);
        request.iter().map(|part| part * part).sum()
    }

    fn weight(&self, point: usize) -> f64 {
        self.problem.weight(point) / self.problem.heaviest()
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
struct Currents {
    own: OwnCurrents,
    /// Their errors at all points of the object with nothing uncertain, where those are known.
    of_all: Option<QuarterErrors>,
}

enum OwnCurrents {
    Static(Vec<f64>),
    /// Of every point.
    PerPoint(Vec<Vec<f64>>),
}

impl Currents {
    fn at(&self, point: usize) -> &[f64] {
        match &self.own {
            OwnCurrents::Static(currents) => currents,
            OwnCurrents::PerPoint(all) => &all[point],
        }
    }

    /// With the errors at all points, if they are static.
    fn over(mut self, all: &AllPoints) -> Result<Self, FeedbackError> {
        if let OwnCurrents::Static(own) = &self.own {
            self.of_all = Some(all.of_static(own)?);
        }
        Ok(self)
    }
}

/// A point with the squares of its upward and sideways error, N^2.
type PointError = (usize, [f64; 2]);

/// The points with what all sums over them need.
struct Bench<'a> {
    around: &'a Surroundings<'a>,
    all: &'a AllPoints<'a>,
    lambda: f64,
    weight: f64,
    /// Mean square of the requested force, N^2.
    requested_n2: f64,
    most_requested_n: f64,
    /// With nothing uncertain.
    exact: Vec<Forms>,
}

impl<'a> Bench<'a> {
    fn new(around: &'a Surroundings<'a>, all: &'a AllPoints<'a>) -> Self {
        let (points, lambda) = (0..around.problem.points(), all.lambda_n_per_m);
        let weight: f64 = points.clone().map(|point| around.weight(point)).sum();
        let requested: f64 = points
            .map(|point| around.weight(point) * around.requested_n2(point, lambda))
            .sum();
        Self {
            around,
            all,
            lambda,
            weight,
            requested_n2: requested / weight,
            most_requested_n: all.most_requested_n(),
            exact: around.forms(lambda, &Uncertainty::default(), Reach::Point),
        }
    }

    fn power_w(&self, currents: &[f64]) -> f64 {
        let ohm = self.around.problem.resistance_ohm;
        ohm.iter().zip(currents).map(|(ohm, i)| ohm * i * i).sum()
    }

    /// Mean power of the points looked at, W.
    fn power_of_some_w(&self, currents: &Currents) -> f64 {
        let of_point = |point| self.around.weight(point) * self.power_w(currents.at(point));
        let sum: f64 = (0..self.around.problem.points()).map(of_point).sum();
        sum / self.weight
    }

    /// The objective: the error of the requested force.
    fn aim(&self, error: &FeltError) -> f64 {
        if self.around.vector {
            error.expected
        } else {
            error.vertical
        }
    }

    /// Sums of errors by quarters.
    fn squares(&self, errors: &[PointError]) -> [Squares; QUARTERS] {
        let mut quarters = [Squares::default(); QUARTERS];
        for (point, [upward, sideways]) in errors {
            let weight = self.around.weight(*point);
            let quarter = &mut quarters[self.around.quarters[*point]];
            quarter.upward += weight * upward;
            quarter.sideways += weight * sideways;
            quarter.requested += weight * self.around.requested_n2(*point, self.lambda);
        }
        quarters
    }

    /// The same of all points of the object where the errors of the currents there are known.
    fn over_all(&self, errors: &[PointError], currents: &Currents) -> [Squares; QUARTERS] {
        let some = self.squares(errors);
        let Some(of_all) = currents.of_all else {
            return some;
        };
        let exact = |(point, _): &PointError| {
            let own = currents.at(*point);
            (*point, self.exact[*point].values(own))
        };
        let exact: Vec<PointError> = errors.iter().map(exact).collect();
        over_all_points(&of_all.squares, &some, &self.squares(&exact))
    }

    /// Expected errors by forms.
    fn by_forms(forms: &[Forms], currents: &Currents) -> Vec<PointError> {
        let of_point = |(point, forms): (usize, &Forms)| (point, forms.values(currents.at(point)));
        forms.iter().enumerate().map(of_point).collect()
    }

    /// Shares of the errors, and power; no worst.
    fn felt(&self, errors: &[PointError], currents: &Currents) -> FeltError {
        let squares = self.over_all(errors, currents);
        FeltError {
            expected: share(&squares, |of| of.upward + of.sideways),
            vertical: share(&squares, |of| of.upward),
            sideways: share(&squares, |of| of.sideways),
            worst: 0.0,
            mean_power_w: currents.of_all.map_or_else(
                || self.power_of_some_w(currents),
                |of_all| of_all.mean_power_w,
            ),
        }
    }

    fn expected(&self, forms: &[Forms], currents: &Currents) -> FeltError {
        self.felt(&Self::by_forms(forms, currents), currents)
    }

    /// By how much the expected errors may be off, being those of some points.
    fn sampling(&self, forms: &[Forms], [fixed, feedback, robust]: [&Currents; 3]) -> Shares {
        let of = |currents: &Currents| {
            let errors = Self::by_forms(forms, currents);
            let of_some = share_and_error(&self.squares(&errors));
            (of_some, share_and_error(&self.over_all(&errors, currents)))
        };
        let ((of_some, _), (of_all, feedback_off)) = of(feedback);
        Shares {
            fixed: of(fixed).1.1,
            feedback: feedback_off,
            // Quarters may all miss a strip that decides; by how much the same points miss with feedback is known.
            robust: of(robust).1.1 + (of_some - of_all).abs(),
        }
    }

    /// Of the random displays, whose forces per ampere and pulls are given.
    fn realised(&self, drawn: &Drawn, currents: &Currents) -> FeltError {
        let coils = self.around.problem.coils();
        let mut worst_n2 = 0.0_f64;
        let mut of_draw = |(k, draw): (usize, &Draw)| {
            let field = &drawn.fields[k * coils..(k + 1) * coils];
            let pull_n = drawn.pull_n.map_or(0.0, |all| all[k]);
            let force = draw.force_n(field, pull_n, currents.at(draw.point));
            let request = self.around.request_n(draw.point, self.lambda);
            let [x, y, z]: [f64; 3] = std::array::from_fn(|axis| force[axis] - request[axis]);
            let (upward, sideways) = (z * z, x * x + y * y);
            worst_n2 = worst_n2.max(upward + sideways);
            (draw.point, [upward, sideways])
        };
        let errors: Vec<PointError> = drawn.draws.iter().enumerate().map(&mut of_draw).collect();
        FeltError {
            worst: worst_n2.sqrt() / self.most_requested_n,
            ..self.felt(&errors, currents)
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
                        rest[2] += self.around.pull_n(point, place)
                            * relative_pull(moment.map(|part| strength * part));
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
        let exact_n = currents.of_all.map_or(0.0, |of_all| of_all.worst_n);
        let exact = exact_n / self.most_requested_n;
        let worst = self.worst(given, currents).max(realised.worst);
        CurrentsError {
            promised: FeltError {
                worst: worst.max(exact),
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
fn followed(around: &Surroundings, all: &AllPoints) -> Result<Currents, FeedbackError> {
    let problem = &around.problem;
    let (ohm, lower, upper) = (problem.resistance_ohm, problem.lower_a, problem.upper_a);
    let total = problem.total_max_a;
    let mut of_upward = Allocator::new(ohm, lower, upper, total)?;
    let mut of_vector = VectorAllocator::new(ohm, lower, upper, total, SIDEWAYS_WEIGHT)?;
    let own = |point| {
        let field = around.field(point, 0);
        let mut currents = vec![0.0; problem.coils()];
        let [x, y, z] = around.request_n(point, all.lambda_n_per_m);
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
    Ok(Currents {
        own: OwnCurrents::PerPoint((0..problem.points()).map(own).collect()),
        of_all: Some(all.feedback),
    })
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

    fn currents(&self, price: f64) -> Currents {
        let problem = &self.bench.around.problem;
        let one = |form: &ErrorForm| {
            let mut currents = vec![0.0; problem.coils()];
            form.minimise(problem, price, &mut currents);
            currents
        };
        let mut own: Vec<Vec<f64>> = self.combined.par_iter().map(one).collect();
        let own = if self.fixed {
            OwnCurrents::Static(own.swap_remove(0))
        } else {
            OwnCurrents::PerPoint(own)
        };
        Currents { own, of_all: None }
    }

    /// # Errors
    /// Where the problem is malformed.
    fn at(&self, price: f64) -> Result<(Currents, FeltError), FeedbackError> {
        let currents = self.currents(price).over(self.bench.all)?;
        let error = self.bench.expected(self.forms, &currents);
        Ok((currents, error))
    }

    /// The setting, and the curve; `top` is its highest price.
    fn choose(
        &self,
        top: f64,
        cap_w: Option<f64>,
    ) -> Result<(f64, Currents, Vec<TradeOff>), FeedbackError> {
        let at = |price: f64| Ok::<_, FeedbackError>((price, self.at(price)?.1));
        let curve = (0..PRICES).map(|k| at(top * PRICE_FACTOR.powi(k)));
        let mut tried = curve.collect::<Result<Vec<_>, _>>()?;
        let trade_off = tried.iter().map(TradeOff::at).collect();
        let aim = |(_, error): &(f64, FeltError)| self.bench.aim(error);
        let power_w = |(_, error): &(f64, FeltError)| error.mean_power_w;
        let least = tried.iter().map(aim).fold(f64::INFINITY, f64::min);
        let allowed = |one: &(f64, FeltError)| match cap_w {
            Some(cap) => power_w(one) <= cap,
            None => aim(one) <= NEAR_LEAST * least,
        };
        // Above some price power is too dear: the cap holds, or too little error is bought.
        let dear = |one: &(f64, FeltError)| allowed(one) == cap_w.is_some();
        while cap_w.is_some() && !dear(&tried[0]) && tried[0].0 < DEAREST * top {
            tried.insert(0, at(2.0 * tried[0].0)?);
        }
        let cheap = tried.iter().position(|one| !dear(one)).unwrap_or(0);
        if cheap > 0 {
            let [mut high, mut low] = [tried[cheap - 1].0, tried[cheap].0];
            for _ in 0..HALVINGS {
                let middle = at((high * low).sqrt())?;
                *if dear(&middle) { &mut high } else { &mut low } = middle.0;
                tried.push(middle);
            }
        }
        // Of all that were tried: errors at all points need not fall with the price as those at the points looked at do.
        let order = |one: &(f64, FeltError)| match cap_w {
            Some(_) => [aim(one), power_w(one)],
            None => [power_w(one), aim(one)],
        };
        let by = |a: &[f64; 2], b: &[f64; 2]| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1]));
        let among = tried.iter().filter(|one| allowed(one));
        let best = among
            .min_by(|a, b| by(&order(a), &order(b)))
            .unwrap_or(&tried[0]);
        Ok((best.0, self.at(best.0)?.0, trade_off))
    }
}

/// The felt error of the lambda of `all` under what is `given` to be uncertain, looked at `around` some of its points; at
/// most `power_cap_w` of mean power, if given. `None` where no force is requested.
///
/// # Errors
/// Where the problem is malformed.
///
/// # Panics
/// When there are fewer forces than points, displacements and coils.
pub fn study(
    around: &Surroundings,
    all: &AllPoints,
    (given, power_cap_w): (&Uncertainty, Option<f64>),
    drawn: &Drawn,
) -> Result<Option<Study>, FeedbackError> {
    around.problem.validate(&Settings::default())?;
    let bench = Bench::new(around, all);
    if bench.requested_n2 <= 0.0 || bench.most_requested_n <= 0.0 {
        return Ok(None);
    }
    let forms = around.forms(bench.lambda, given, Reach::Whole);
    let fixed = Currents {
        own: OwnCurrents::Static(all.static_a.to_vec()),
        of_all: Some(all.fixed),
    };
    let feedback = followed(around, all)?;
    // A watt of the currents of least power for a square of the whole force.
    let power_w = bench.power_of_some_w(&feedback);
    let top = bench.requested_n2 / power_w.max(f64::MIN_POSITIVE);
    let choose = |fixed: bool| {
        let chooser = Chooser::new(&bench, &forms, fixed);
        let (price_n2_per_w, currents, trade_off) = chooser.choose(top, power_cap_w)?;
        let setting = RobustSetting {
            price_n2_per_w,
            error: bench.error(&forms, drawn, given, &currents),
            trade_off,
            currents_a: match &currents.own {
                OwnCurrents::Static(own) => Some(own.clone()),
                OwnCurrents::PerPoint(_) => None,
            },
        };
        Ok::<_, FeedbackError>((setting, currents))
    };
    let (robust_static, _) = choose(true)?;
    let (robust, robust_currents) = choose(false)?;
    let (exact, causes) = Costs {
        bench: &bench,
        given,
        fixed: &fixed,
        feedback: &feedback,
        robust: &robust_currents,
        price_n2_per_w: robust.price_n2_per_w,
    }
    .ranked(&forms);
    assert!(around.places() == displacements_m(given).len() && RULE == 14);
    Ok(Some(Study {
        given: *given,
        lambda_n_per_m: bench.lambda,
        points: around.problem.points(),
        draws: drawn.draws.len(),
        power_cap_w,
        sampling: Some(bench.sampling(&forms, [&fixed, &feedback, &robust_currents])),
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
        let [exact, _] = self.shares(&self.bench.exact, self.robust);
        let [_, all] = self.shares(all, self.robust);
        let cost = |cause: Cause| {
            let (only, halved) = (self.given.only(cause), self.given.halved(cause));
            let (reach, half) = match cause {
                Cause::Sensor => (Reach::Whole, Reach::Half),
                Cause::Tilt | Cause::Heat | Cause::Driver => (Reach::Point, Reach::Whole),
            };
            let [with, _] = self.shares(&around.forms(lambda, &only, reach), self.robust);
            let forms = around.forms(lambda, &halved, half);
            let again = Chooser::new(self.bench, &forms, false).currents(self.price_n2_per_w);
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
