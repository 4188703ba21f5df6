//! Many cores close to each other at random places: the stated error against much finer solutions.

use std::f64::consts::TAU;

use cpu_time::ProcessTime;
use fluxform_field::components::Components;
use fluxform_field::steel::CoreShape;
use fluxform_field::steel::array::{ArrayResolution, CoupledArray};
use fluxform_field::steel::clearance::Clearance;
use fluxform_field::steel::equivalent_dipoles::ArraySources;
use fluxform_field::steel::exchange::Grading;
use fluxform_field::steel::generatrix::Generatrix;
use fluxform_field::steel::response::Rings;
use fluxform_field::winding::Winding;
use fluxform_testing::{Random, random_of_study};

use super::claims::covered;

/// Of the committed study.
const SEED: u64 = 20_261_125;
/// Gaps below which cores are on cells, in radii.
const ON_CELLS: f64 = 0.45;
/// The least gap, in radii: of closer cores nothing much finer can be solved.
const LEAST_GAP: f64 = 0.2;
/// Most unknowns of a core in what stands for the truth.
const MOST_UNKNOWNS: usize = 1800;

/// Coils at scattered places.
#[derive(Debug, Clone)]
struct Crowd {
    winding: Winding,
    shape: CoreShape,
    mu_r: f64,
    positions_m: Vec<[f64; 2]>,
    lowest_m: f64,
    /// Between the closest two cores, in radii.
    gap: f64,
}

/// Places of cores of radius one, no gap smaller than `gap`: every core beside an earlier one.
fn scattered(random: &mut Random, cores: usize, gap: f64) -> Vec<[f64; 2]> {
    let mut places = vec![[0.0, 0.0]];
    while places.len() < cores {
        let [x, y] = places[random.between(0.0, places.len() as f64) as usize];
        let away = 2.0 + random.between(gap, (3.0 * gap).min(gap + 1.0));
        let (s, c) = random.between(0.0, TAU).sin_cos();
        let place = [x + away * c, y + away * s];
        let free = |other: &[f64; 2]| (other[0] - place[0]).hypot(other[1] - place[1]) >= 2.0 + gap;
        if places.iter().all(free) {
            places.push(place);
        }
    }
    places
}

/// The same on random cells of a lattice: pairs of cores share their offsets, which makes a much finer
/// solution of cores that nearly touch affordable.
fn on_cells(random: &mut Random, cores: usize, gap: f64) -> Vec<[f64; 2]> {
    let (side, wide) = (6, random.between(1.0, 1.2));
    let mut cells: Vec<usize> = (0..side * side).collect();
    for k in 0..cores {
        let other = random.between(k as f64, cells.len() as f64) as usize;
        cells.swap(k, other);
    }
    let pitch = 2.0 + gap;
    let place = |cell: &usize| {
        [
            pitch * (cell % side) as f64,
            wide * pitch * (cell / side) as f64,
        ]
    };
    cells[..cores].iter().map(place).collect()
}

/// Coils about random cores, 0.2 to 1 radius between the closest two: those that are closer on cells.
fn crowd(random: &mut Random) -> Crowd {
    let radius_m = random.decades(0.002, 0.02);
    let gap = random.between(LEAST_GAP, 1.0);
    let cores = random.between(17.0, 24.0) as usize;
    let places = if gap < ON_CELLS {
        on_cells(random, cores, gap)
    } else {
        scattered(random, cores, gap)
    };
    let length_m = radius_m * random.decades(1.0, 5.0);
    let top_m = length_m * random.between(-0.1, 0.1);
    Crowd {
        winding: Winding {
            inner_radius_m: 1.01 * radius_m,
            outer_radius_m: radius_m * (1.0 + random.between(0.3, 0.49) * gap),
            length_m,
            turns: random.between(100.0, 2000.0).round(),
        },
        shape: CoreShape {
            radius_m,
            bottom_m: -length_m * random.between(0.9, 1.2),
            top_m,
        },
        mu_r: random.decades(20.0, 5000.0),
        positions_m: places
            .iter()
            .map(|place| place.map(|x| radius_m * x))
            .collect(),
        lowest_m: top_m.max(0.0) + radius_m * random.decades(0.15, 3.0),
        gap,
    }
}

impl Crowd {
    fn solve(&self, tolerance: f64) -> CoupledArray {
        let (winding, positions_m) = (&self.winding, &self.positions_m);
        CoupledArray::new(
            winding,
            self.shape,
            self.mu_r,
            positions_m,
            tolerance,
            self.lowest_m,
        )
        .expect("off the windings' edges")
    }

    /// Finer than for `tolerance` by as much as a core's unknowns allow.
    fn truth(&self, tolerance: f64) -> CoupledArray {
        let closest_m = self.shape.radius_m * (2.0 + self.gap);
        let modes = |finer: f64| {
            let decay = 2.0 * (1.0 + self.gap).ln();
            (2.0 - (finer * tolerance).ln() / decay).ceil() as usize
        };
        let of = |finer: f64| ArrayResolution {
            modes: modes(finer),
            ..ArrayResolution::for_tolerance(finer * tolerance, self.shape, closest_m)
        };
        let unknowns = |resolution: &ArrayResolution| {
            let outline = Generatrix::of_coil(&self.winding, self.shape, &resolution.outline);
            let grading = Grading::new(resolution.panel_m, self.shape, self.winding.length_m);
            let rings = Rings::graded(&outline, resolution.order, &grading);
            rings.rings.len() * resolution.angles()
        };
        let finest = [0.05, 0.1, 0.2].map(of);
        let resolution =
            (finest.iter().find(|r| unknowns(r) <= MOST_UNKNOWNS)).unwrap_or(&finest[2]);
        let resolution = ArrayResolution {
            residual: 0.1 * resolution.residual,
            ..*resolution
        };
        let (winding, positions_m) = (&self.winding, &self.positions_m);
        CoupledArray::at_resolution(winding, self.shape, self.mu_r, positions_m, &resolution)
            .expect("off the windings' edges")
    }

    /// The larger difference of gradients, relative to the largest at a height, and of inductances.
    fn difference(&self, a: &CoupledArray, b: &CoupledArray) -> f64 {
        let distance_m = self.lowest_m - self.shape.top_m;
        let sources = [a, b].map(|array| {
            ArraySources::of_array(array, Clearance::above(self.lowest_m, distance_m), 1e-6)
        });
        let parts = Components::Gradient;
        let mut worst = 0.0_f64;
        for height in [0.0, 0.7, 2.3] {
            let z_m = self.lowest_m + height * self.shape.radius_m;
            let around = [[0.0, 0.0], [0.8, 0.1], [-0.6, 0.9], [0.2, -1.1]];
            let points: Vec<[f64; 3]> = (self.positions_m.iter())
                .flat_map(|[x, y]| {
                    around.map(|[dx, dy]| {
                        let r = self.shape.radius_m;
                        [x + r * dx, y + r * dy, z_m]
                    })
                })
                .collect();
            let values = sources.each_ref().map(|sources| {
                let mut out = vec![0.0; self.positions_m.len() * parts.count() * points.len()];
                sources.sample(&points, parts, &mut out);
                out
            });
            let air = self.winding.field(0.0, z_m).expect("above").gradient_norm();
            let size = values[0].iter().fold(0.0_f64, |m, v| m.max(v.abs())) + air;
            let off = values[0].iter().zip(&values[1]);
            let off = off.fold(0.0_f64, |m, (a, b)| m.max((a - b).abs()));
            worst = worst.max(off / size);
        }
        let [a, b] = [a, b].map(|array| &array.added_inductance_h);
        worst.max((a - b).amax() / a.amax())
    }
}

/// Prints stated and true errors of scenes, and holds that the true ones are smaller.
fn study(scenes: impl Iterator<Item = Crowd>, tolerance: f64) {
    let (mut errors, mut reached, mut seconds) = (Vec::new(), 0, 0.0);
    for crowd in scenes {
        let started = ProcessTime::now();
        let array = crowd.solve(tolerance);
        let took = started.elapsed().as_secs_f64();
        let off = crowd.difference(&crowd.truth(tolerance), &array);
        println!(
            "{} cores, gap {:.2}, from {:.2} radii up: stated {:.1e}, true {off:.1e}, {took:.2} CPU s",
            crowd.positions_m.len(),
            crowd.gap,
            (crowd.lowest_m - crowd.shape.top_m) / crowd.shape.radius_m,
            array.relative_error,
        );
        reached += usize::from(array.relative_error <= tolerance);
        seconds += took;
        errors.push((array.relative_error, off));
    }
    println!(
        "{reached} of {} within {tolerance:e}, {seconds:.1} CPU s",
        errors.len()
    );
    assert_eq!(covered("close cores", &errors), 0);
}

/// A scene of the study below of which the difference of two resolutions that left out the same of what
/// passes between the cores, and one mode more or less, did not cover the error.
#[test]
fn close_cores_have_the_error_that_is_stated() {
    let mut random = Random::new(SEED);
    study((0..29).map(|_| crowd(&mut random)).skip(28), 1e-2);
}

/// `cargo test --release --test field steel -- --ignored --nocapture close_cores_in_full` prints the table;
/// with `FLUXFORM_SEED=<number>` of other scenes.
#[test]
#[ignore = "ten minutes of CPU: a hundred arrays of close cores"]
fn close_cores_in_full_have_the_error_that_is_stated() {
    let mut random = random_of_study(SEED);
    study((0..100).map(|_| crowd(&mut random)), 1e-2);
}
