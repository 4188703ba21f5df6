//! The stated error of lambda against the limit of ever more points, on random objects.

// The median of claimed over true errors is printed with --nocapture.
#![allow(clippy::print_stdout)]

use std::f64::consts::TAU;

use fluxform::lambda::limit::{FineSamples, GridPlaces, limit_error};
use fluxform::lambda::{Criterion, ForceProblem, Settings, solve};
use fluxform::numerics::axis::Axis;
use fluxform::numerics::random::Random;
use fluxform::progress::Silent;
use fluxform::shape::height::Grid;
use fluxform::shape::point_areas::{FineCells, Over, SMOOTH, areas_m2};

/// Finer along each axis for the limit.
const FINER: usize = 8;
/// Objects of each kind.
const OBJECTS: usize = 12;
/// Half the side of the plan, m.
const HALF_M: f64 = 0.05;

#[derive(Debug, Clone, Copy, PartialEq)]
enum Kind {
    Smooth,
    Kinked,
    Jumping,
    /// It ends at a line.
    Cut,
    /// A cap on nothing, steep at its rim.
    Cap,
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

    fn height_m(&self, [x, y]: [f64; 2]) -> Option<f64> {
        let wave = (self.wave[0] * x + self.wave[2]).sin() * (self.wave[1] * y).cos();
        let smooth = self.level_m + self.slope[0] * x + self.slope[1] * y + self.wave_m * wave;
        let beyond = self.line[0] * x + self.line[1] * y - self.line[2];
        let more = match self.kind {
            Kind::Smooth => 0.0,
            Kind::Kinked => 2.0 * self.step * beyond.max(0.0),
            Kind::Jumping if beyond > 0.0 => self.step * 0.04,
            Kind::Jumping => 0.0,
            Kind::Cut if beyond > 0.0 => return None,
            Kind::Cut => 0.0,
            Kind::Cap => {
                let radius_m = 0.03 + 0.05 * self.step;
                let [x, y] = [x - 0.2 * self.line[2], y + 0.2 * self.line[2]];
                let left = radius_m * radius_m - x * x - y * y;
                return (left >= 0.0).then(|| 0.6 * self.level_m + left.sqrt());
            }
        };
        Some(smooth + more)
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
#[derive(Clone)]
struct Sampled {
    forces: Vec<f64>,
    heights: Vec<f64>,
    areas: Vec<f64>,
    index: Vec<usize>,
    samples: usize,
    fine: FineCells,
    fine_forces: Vec<f64>,
}

fn sampled(object: &Object, array: &Array, samples: usize) -> Sampled {
    let forces = |at, height_m| -> Vec<f64> {
        let coils = 0..array.axes_m.len();
        coils.map(|coil| array.force(coil, at, height_m)).collect()
    };
    sampled_surface(&|at| object.height_m(at), forces, samples)
}

fn sampled_surface<F: IntoIterator<Item = f64>>(
    height_m: &(impl Fn([f64; 2]) -> Option<f64> + Sync),
    forces_at: impl Fn([f64; 2], f64) -> F,
    samples: usize,
) -> Sampled {
    let axis = Axis {
        from: -HALF_M,
        to: HALF_M,
        samples,
    };
    let grid = Grid {
        x_m: axis,
        y_m: axis,
    };
    let place = |k: usize| [axis.node(k % samples), axis.node(k / samples)];
    let heights: Vec<Option<f64>> = (0..samples * samples).map(|k| height_m(place(k))).collect();
    let surface = Over {
        height_m,
        covers: &|p| height_m(p).is_some(),
        near: &|_| 1,
        lattice: None,
    };
    let (areas, mut fine) = areas_m2(&grid, &heights, surface, &Silent).unwrap();
    let index: Vec<usize> = (0..heights.len())
        .filter(|&k| heights[k].is_some())
        .collect();
    let of_points = |all: &[f64]| index.iter().map(|&k| all[k]).collect::<Vec<_>>();
    if !fine.smooth.is_empty() {
        fine.point_area_m2 = of_points(&fine.point_area_m2);
    }
    let points = index.iter().map(|&k| (place(k), heights[k].unwrap()));
    let plan = fine.x_m.iter().zip(&fine.y_m).zip(&fine.height_m);
    Sampled {
        forces: points
            .clone()
            .flat_map(|(at, height)| forces_at(at, height))
            .collect(),
        heights: points.map(|(_, height)| height).collect(),
        areas: of_points(&areas),
        samples,
        fine_forces: plan
            .flat_map(|((x, y), h)| forces_at([*x, *y], *h))
            .collect(),
        fine,
        index,
    }
}

impl Sampled {
    /// The samples of broken cells in the place of their corners: the nearest to the limit.
    fn with_samples(mut self) -> Self {
        if self.fine.smooth.is_empty() {
            return self;
        }
        let coils = self.forces.len() / self.heights.len();
        let of_points = self.fine.point_area_m2.iter().enumerate();
        let rows: Vec<usize> = of_points
            .filter(|(_, area)| **area > 0.0)
            .map(|(row, _)| row)
            .collect();
        let forces = rows
            .iter()
            .flat_map(|row| &self.forces[row * coils..(row + 1) * coils]);
        self.forces = forces.chain(&self.fine_forces).copied().collect();
        let heights = rows.iter().map(|&row| &self.heights[row]);
        self.heights = heights.chain(&self.fine.height_m).copied().collect();
        let areas = rows.iter().map(|&row| &self.fine.point_area_m2[row]);
        // Samples of the coarser rule alone count for next to nothing.
        let least = 1e-6 * self.fine.area_m2.iter().copied().fold(0.0, f64::max);
        let areas = areas.chain(&self.fine.area_m2);
        self.areas = areas.map(|area| area.max(least)).collect();
        self
    }

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

impl Sampled {
    /// The stated error of `lambda`, which `problem` of the points has, or their samples where these are points.
    fn claimed_of(
        &self,
        problem: &ForceProblem,
        lambda: f64,
        are_points: bool,
        settings: &Settings,
    ) -> f64 {
        let places = GridPlaces {
            columns: self.samples,
            rows: self.samples,
            index: &self.index,
            smooth: &self.fine.smooth,
            smooth_within: SMOOTH,
        };
        let fine = (!self.fine.smooth.is_empty()).then_some(FineSamples {
            are_points,
            forces_n_per_a: &self.fine_forces,
            height_m: &self.fine.height_m,
            offset_n: None,
            areas: &self.fine.area_m2,
            coarse_areas: &self.fine.coarse_area_m2,
            stand_in: &self.fine.stand_in,
            point_areas: &self.fine.point_area_m2,
        });
        limit_error(problem, lambda, &self.areas, places, fine, settings).unwrap()
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

/// How points count.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Counts {
    Alike,
    ByArea,
    /// Samples of broken cells in the place of their corners.
    Graded,
}

/// Claimed and true error of one random scene.
fn claimed_and_true(kind: Kind, counts: Counts, n: &mut Random) -> [f64; 2] {
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
    let problem = points.problem(&limits, counts != Counts::Alike);
    let lambda = match counts {
        Counts::Alike | Counts::ByArea => chosen(&problem, &settings),
        Counts::Graded => {
            let graded = points.clone().with_samples();
            chosen(&graded.problem(&limits, true), &settings)
        }
    };
    let stated = points.claimed_of(&problem, lambda, counts == Counts::Graded, &settings);
    let fine = sampled(&object, &array, FINER * (samples - 1) + 1);
    let limit = chosen(&fine.with_samples().problem(&limits, true), &settings);
    [stated, (lambda / limit - 1.0).abs()]
}

/// Claims of the points' effect were once 60 times too wide where heights are steep, and nothing at
/// all where the surface is plane.
#[test]
fn the_limit_of_ever_more_points_lies_within_the_stated_error() {
    let (seed, objects) = match std::env::var("FLUXFORM_OBJECTS") {
        Ok(count) => (7, count.parse().unwrap()),
        Err(_) => (20_261_122, OBJECTS),
    };
    let mut n = Random::new(seed);
    let mut missed = 0;
    for kind in [
        Kind::Smooth,
        Kind::Kinked,
        Kind::Jumping,
        Kind::Cut,
        Kind::Cap,
    ] {
        for counts in [Counts::ByArea, Counts::Alike, Counts::Graded] {
            let mut ratios = Vec::new();
            for object in 0..objects {
                let [claimed, off] = claimed_and_true(kind, counts, &mut n);
                if claimed < off {
                    println!("{kind:?} {object}, {counts:?}: {claimed:e} of {off:e}");
                    missed += 1;
                }
                ratios.push(claimed / off);
            }
            ratios.sort_by(f64::total_cmp);
            let median = ratios[ratios.len() / 2];
            println!(
                "{kind:?}, {counts:?}: least {:.2}, median {median:.2}",
                ratios[0]
            );
            assert!(median <= 10.0, "{kind:?}, {counts:?}: {median}");
        }
    }
    assert_eq!(missed, 0);
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

/// Of many broken cells some stand for all; one half of them, compared with all, was as far off as these by luck alone, and
/// errors nine times as large as the stated ones went unseen.
#[test]
fn regression_cells_that_stand_for_others_were_surer_than_they_are() {
    let limits = Limits {
        lower_a: vec![0.0],
        upper_a: vec![2.0],
        total_max_a: None,
        ohm: vec![6.0],
    };
    let settings = Settings {
        criterion: Criterion::Saturation,
        ..Settings::default()
    };
    let problem = |forces_n_per_a, height_m, weights| ForceProblem {
        forces_n_per_a,
        height_m,
        offset_n: None,
        weights: Some(weights),
        lower_a: &limits.lower_a,
        upper_a: &limits.upper_a,
        total_max_a: None,
        resistance_ohm: &limits.ohm,
    };
    let heights_m = [0.025, 0.035];
    let limit = chosen(&problem(&[1.0; 2], &heights_m, &[1.0; 2]), &settings);
    let mut n = Random::new(11);
    let ribs = 16;
    let unseen = (0..ribs).filter(|_| {
        // A force that is the same everywhere: heights and their areas decide alone.
        let (angle, shift) = (n.between(0.1, 1.4), n.unit());
        let height_m = |[x, y]: [f64; 2]| {
            let phase = (angle.cos() * x + angle.sin() * y) / 0.0023 + shift;
            Some(heights_m[usize::from(phase.rem_euclid(1.0) < 0.5)])
        };
        let found = sampled_surface(&height_m, |_, _| [1.0], 75 + n.below(20));
        let choice = found.fine.stand_in.iter().flatten().count();
        assert!(choice > 0);
        let graded = found.clone().with_samples();
        let lambda = chosen(&graded.problem(&limits, true), &settings);
        let claimed = found.claimed_of(&found.problem(&limits, true), lambda, true, &settings);
        claimed < (lambda / limit - 1.0).abs()
    });
    let unseen = unseen.count();
    assert!(unseen <= 1, "{unseen} of {ribs}");
}
