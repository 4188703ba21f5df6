//! The stated error of lambda against the limit of ever more points, on random objects.

// The median of claimed over true errors is printed with --nocapture.
#![allow(clippy::print_stdout)]

use std::f64::consts::TAU;

use fluxform_lambda::limit::{GridPlaces, limit_error};
use fluxform_lambda::{Criterion, ForceProblem, Settings, solve};
use fluxform_numerics::random::Random;

/// Finer along each axis for the limit.
const FINER: usize = 8;
/// Objects of each kind.
const OBJECTS: usize = 25;
/// Half the side of the plan, m.
const HALF_M: f64 = 0.05;

#[derive(Debug, Clone, Copy, PartialEq)]
enum Kind {
    Smooth,
    Kinked,
    Jumping,
}

/// A random object over a square plan.
struct Object {
    kind: Kind,
    level_m: f64,
    slope: [f64; 2],
    wave_m: f64,
    wave: [f64; 3],
    /// Normal and distance of a line, m, where the surface breaks.
    line: [f64; 3],
    step: f64,
}

impl Object {
    fn random(kind: Kind, n: &mut Random) -> Self {
        let angle = n.between(0.0, TAU);
        Self {
            kind,
            level_m: n.between(0.03, 0.06),
            slope: [n.between(-0.15, 0.15), n.between(-0.15, 0.15)],
            wave_m: n.between(0.0005, 0.004),
            wave: [
                n.between(30.0, 140.0),
                n.between(30.0, 140.0),
                n.between(0.0, TAU),
            ],
            line: [angle.cos(), angle.sin(), n.between(-0.03, 0.03)],
            step: n.between(0.05, 0.3),
        }
    }

    fn height_m(&self, [x, y]: [f64; 2]) -> f64 {
        let wave = (self.wave[0] * x + self.wave[2]).sin() * (self.wave[1] * y).cos();
        let smooth = self.level_m + self.slope[0] * x + self.slope[1] * y + self.wave_m * wave;
        let beyond = self.line[0] * x + self.line[1] * y - self.line[2];
        smooth
            + match self.kind {
                Kind::Smooth => 0.0,
                Kind::Kinked => 2.0 * self.step * beyond.max(0.0),
                Kind::Jumping if beyond > 0.0 => self.step * 0.04,
                Kind::Jumping => 0.0,
            }
    }
}

/// Upright dipoles below the plan: force per ampere on a magnet.
struct Array {
    axes_m: Vec<[f64; 2]>,
    depth_m: f64,
}

impl Array {
    fn random(n: &mut Random) -> Self {
        let count = 2 + (n.unit() * 2.0) as usize;
        let pitch = n.between(0.03, 0.06);
        let at = |k: usize| (k as f64 - 0.5 * (count - 1) as f64) * pitch;
        let axes_m = (0..count * count).map(|k| [at(k % count), at(k / count)]);
        Self {
            axes_m: axes_m.collect(),
            depth_m: n.between(0.01, 0.03),
        }
    }

    fn force(&self, coil: usize, [x, y]: [f64; 2], height_m: f64) -> f64 {
        let [a, b] = self.axes_m[coil];
        let z = height_m + self.depth_m;
        let rho2 = (x - a) * (x - a) + (y - b) * (y - b);
        let r2 = rho2 + z * z;
        3e-8 * z * (6.0 * z * z - 9.0 * rho2) / r2.powf(3.5)
    }
}

/// An object's points on a grid of so many along each axis.
struct Sampled {
    forces: Vec<f64>,
    heights: Vec<f64>,
    areas: Vec<f64>,
    index: Vec<usize>,
    samples: usize,
}

fn sampled(object: &Object, array: &Array, samples: usize) -> Sampled {
    let node = |k: usize| HALF_M * (2.0 * k as f64 / (samples - 1) as f64 - 1.0);
    let part = |k: usize| if k == 0 || k + 1 == samples { 0.5 } else { 1.0 };
    let mut all = Sampled {
        forces: Vec::new(),
        heights: Vec::new(),
        areas: Vec::new(),
        index: (0..samples * samples).collect(),
        samples,
    };
    for k in 0..samples * samples {
        let at = [node(k % samples), node(k / samples)];
        let height_m = object.height_m(at);
        all.heights.push(height_m);
        all.areas.push(part(k % samples) * part(k / samples));
        let forces = (0..array.axes_m.len()).map(|coil| array.force(coil, at, height_m));
        all.forces.extend(forces);
    }
    all
}

impl Sampled {
    fn problem<'a>(&'a self, limits: &'a Limits, by_area: bool) -> ForceProblem<'a> {
        ForceProblem {
            forces_n_per_a: &self.forces,
            height_m: &self.heights,
            offset_n: None,
            weights: by_area.then_some(&self.areas[..]),
            lower_a: &limits.lower_a,
            upper_a: &limits.upper_a,
            total_max_a: limits.total_max_a,
            resistance_ohm: &limits.ohm,
        }
    }
}

struct Limits {
    lower_a: Vec<f64>,
    upper_a: Vec<f64>,
    total_max_a: Option<f64>,
    ohm: Vec<f64>,
}

fn chosen(problem: &ForceProblem, settings: &Settings) -> f64 {
    let solution = solve(problem, settings).unwrap();
    solution.chosen.expect("a force constant").lambda_n_per_m
}

/// Claimed and true error of one random scene.
fn claimed_and_true(kind: Kind, by_area: bool, n: &mut Random) -> [f64; 2] {
    let (object, array) = (Object::random(kind, n), Array::random(n));
    let coils = array.axes_m.len();
    let limits = Limits {
        lower_a: vec![if n.unit() < 0.3 { -2.0 } else { 0.0 }; coils],
        upper_a: vec![2.0; coils],
        total_max_a: (n.unit() < 0.5).then(|| 2.0 * coils as f64 * n.between(0.4, 1.0)),
        ohm: vec![6.0; coils],
    };
    let criterion = [Criterion::Jnd, Criterion::Linear][usize::from(n.unit() < 0.3)];
    let settings = Settings {
        criterion,
        ..Settings::default()
    };
    let samples = 13 + (n.unit() * 25.0) as usize;
    let points = sampled(&object, &array, samples);
    let problem = points.problem(&limits, by_area);
    let lambda = chosen(&problem, &settings);
    let places = GridPlaces {
        columns: points.samples,
        rows: points.samples,
        index: &points.index,
    };
    let stated = limit_error(&problem, lambda, &points.areas, Some(places), &settings);
    let stated = stated.unwrap().expect("an estimate");
    let fine = sampled(&object, &array, FINER * (samples - 1) + 1);
    let limit = chosen(&fine.problem(&limits, true), &settings);
    [stated.estimate, (lambda / limit - 1.0).abs()]
}

/// Claims of the points' effect were once 60 times too wide where heights are steep, and nothing at
/// all where the surface is plane.
#[test]
fn the_limit_of_ever_more_points_lies_within_the_stated_error() {
    let mut n = Random::new(20_261_122);
    let mut ratios = Vec::new();
    for kind in [Kind::Smooth, Kind::Kinked, Kind::Jumping] {
        for by_area in [true, false] {
            for object in 0..OBJECTS {
                let [claimed, off] = claimed_and_true(kind, by_area, &mut n);
                assert!(
                    claimed >= off,
                    "{kind:?} {object}, by area {by_area}: {claimed:e} of {off:e}"
                );
                ratios.push(claimed / off);
            }
        }
    }
    ratios.sort_by(f64::total_cmp);
    let median = ratios[ratios.len() / 2];
    assert!(median <= 10.0, "{median}");
}

/// The seed's kind of wedge: with equal weights lambda converges with the first power of the
/// spacing, by area with the second.
#[test]
fn area_weights_converge_with_the_second_power_and_equal_ones_with_the_first() {
    let object = Object {
        kind: Kind::Smooth,
        level_m: 0.055,
        slope: [0.5, 0.0],
        wave_m: 0.0,
        wave: [0.0; 3],
        line: [1.0, 0.0, 0.0],
        step: 0.0,
    };
    let at = |k: usize| (k as f64 - 1.0) * 0.05;
    let array = Array {
        axes_m: (0..9).map(|k| [at(k % 3), at(k / 3)]).collect(),
        depth_m: 0.013,
    };
    let limits = Limits {
        lower_a: vec![0.0; 9],
        upper_a: vec![2.0; 9],
        total_max_a: Some(18.0),
        ohm: vec![6.0; 9],
    };
    let lambda = |samples: usize, by_area: bool| {
        let points = sampled(&object, &array, samples);
        chosen(&points.problem(&limits, by_area), &Settings::default())
    };
    let limit = lambda(321, true);
    let order = |by_area: bool| {
        let error = |samples| (lambda(samples, by_area) / limit - 1.0).abs();
        (error(21) / error(41)).log2()
    };
    let (by_area, equal) = (order(true), order(false));
    assert!((1.8..2.3).contains(&by_area), "{by_area}");
    assert!((0.8..1.3).contains(&equal), "{equal}");
}
