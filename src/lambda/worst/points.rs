//! The points that vertices miss most: one pass over all of them, many vertices at once.

use rayon::prelude::*;

use super::scaled::Form;
use crate::numerics::dispatch::{self, Kernel, LANES, Lanes, mul_add};

/// Points of one parallel task: fixed, so that results do not depend on the number of threads.
const CHUNK_POINTS: usize = 8192;

/// Forces, heights and offsets of some points.
#[derive(Clone, Copy)]
pub(super) struct Points<'a> {
    pub coils: usize,
    pub forces_n_per_a: &'a [f64],
    pub height_m: &'a [f64],
    pub offset_n: Option<&'a [f64]>,
}

/// What is asked of the points: `lambda h - share offset - G I` at most `limit`.
#[derive(Debug, Clone)]
pub(super) struct Probe {
    pub lambda_n_per_m: f64,
    /// 1, or 0 for the direction in which a path without end goes on.
    pub offset_share: f64,
    pub currents_a: Vec<f64>,
    pub limit_n: f64,
}

/// A point above a probe's limit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Miss {
    pub point: usize,
}

/// For every chunk of points and every probe the point that is furthest above the limit; with
/// `Form::Least` only where the force is too weak.
pub(super) fn misses(points: Points, probes: &[Probe], form: Form) -> Vec<Miss> {
    let probes = Packed::new(points.coils, probes);
    let found: Vec<Vec<Miss>> = points
        .height_m
        .par_chunks(CHUNK_POINTS)
        .enumerate()
        .map(|(chunk, height_m)| {
            let first = chunk * CHUNK_POINTS;
            let range = first..first + height_m.len();
            let part = Points {
                coils: points.coils,
                forces_n_per_a: &points.forces_n_per_a
                    [range.start * points.coils..range.end * points.coils],
                height_m,
                offset_n: points.offset_n.map(|offset| &offset[range]),
            };
            let probes = &probes;
            let mut misses = dispatch::run(Scan { part, probes, form });
            for miss in &mut misses {
                miss.point += first;
            }
            misses
        })
        .collect();
    found.concat()
}

/// Probes side by side, in groups of lanes.
struct Packed {
    count: usize,
    groups: usize,
    lambda: Vec<Lanes>,
    share: Vec<Lanes>,
    limit: Vec<Lanes>,
    /// Group by group, one entry a coil.
    currents: Vec<Lanes>,
}

impl Packed {
    fn new(coils: usize, probes: &[Probe]) -> Self {
        let groups = probes.len().div_ceil(LANES);
        let pack = |value: &dyn Fn(&Probe) -> f64, group: usize| {
            let part: Vec<f64> = probes[group * LANES..]
                .iter()
                .take(LANES)
                .map(value)
                .collect();
            Lanes::load(&part)
        };
        let all = |value: &dyn Fn(&Probe) -> f64| (0..groups).map(|g| pack(value, g)).collect();
        Self {
            count: probes.len(),
            groups,
            lambda: all(&|p| p.lambda_n_per_m),
            share: all(&|p| p.offset_share),
            limit: all(&|p| p.limit_n),
            currents: (0..groups * coils)
                .map(|k| pack(&|p| p.currents_a[k % coils], k / coils))
                .collect(),
        }
    }
}

struct Scan<'a> {
    part: Points<'a>,
    probes: &'a Packed,
    form: Form,
}

impl Kernel for Scan<'_> {
    type Output = Vec<Miss>;

    #[inline(always)]
    fn run<const FMA: bool>(self) -> Vec<Miss> {
        let (part, probes) = (self.part, self.probes);
        let both = self.form == Form::Worst;
        // The bar rises with every point found, so that few are looked at closely.
        let mut bar = probes.limit.clone();
        let mut best: Vec<Option<Miss>> = vec![None; probes.count];
        for (j, &height) in part.height_m.iter().enumerate() {
            let row = &part.forces_n_per_a[j * part.coils..(j + 1) * part.coils];
            let offset = part.offset_n.map_or(0.0, |offset| offset[j]);
            for group in 0..probes.groups {
                let currents = &probes.currents[group * part.coils..(group + 1) * part.coils];
                let mut rest = probes.lambda[group] * height - probes.share[group] * offset;
                for (current, &force) in currents.iter().zip(row) {
                    rest = current.mul_add::<FMA>(Lanes::splat(-force), rest);
                }
                let size: [f64; LANES] =
                    std::array::from_fn(|k| if both { rest.0[k].abs() } else { rest.0[k] });
                let mut above = false;
                for (size, bar) in size.iter().zip(&bar[group].0) {
                    above |= size > bar;
                }
                if !above {
                    continue;
                }
                let filled = LANES.min(probes.count - group * LANES);
                for (k, &size) in size.iter().enumerate().take(filled) {
                    if size > bar[group].0[k] {
                        bar[group].0[k] = size;
                        let probe = group * LANES + k;
                        best[probe] = Some(Miss { point: j });
                    }
                }
            }
        }
        best.into_iter().flatten().collect()
    }
}

/// Where a path stands, in SI units, and how it goes on per unit of lambda.
pub(super) struct Course {
    pub at: Probe,
    /// Errors that rounding explains are no misses.
    pub rounding_n: f64,
    pub rates_a: Vec<f64>,
    pub limit_rate_m: f64,
    /// 1 where lambda moves, 0 where it does not.
    pub lambda_rate: f64,
    /// Rates that rounding explains, m.
    pub rounding_m: f64,
    /// Nothing beyond this step matters.
    pub step: f64,
}

/// The point that a path misses first on its course: where it is missed already the one missed
/// most, where several are at once the one that is left fastest.
pub(super) fn first_missed(points: Points, course: &Course, form: Form) -> Option<(usize, bool)> {
    dispatch::run(First {
        points,
        course,
        form,
    })
}

struct First<'a> {
    points: Points<'a>,
    course: &'a Course,
    form: Form,
}

impl Kernel for First<'_> {
    type Output = Option<(usize, bool)>;

    #[inline(always)]
    fn run<const FMA: bool>(self) -> Option<(usize, bool)> {
        let (points, course) = (self.points, self.course);
        let coils = points.coils;
        let signs: &[f64] = if self.form == Form::Worst {
            &[1.0, -1.0]
        } else {
            &[1.0]
        };
        let (mut missed, mut most) = (None, course.rounding_n);
        let (mut first, mut least, mut fastest) = (None, course.step, 0.0);
        for (j, &height) in points.height_m.iter().enumerate() {
            let row = &points.forces_n_per_a[j * coils..(j + 1) * coils];
            let offset = points.offset_n.map_or(0.0, |offset| offset[j]);
            let mut rest = course.at.lambda_n_per_m * height - offset;
            let mut rate = course.lambda_rate * height;
            for ((&force, &current), &speed) in
                row.iter().zip(&course.at.currents_a).zip(&course.rates_a)
            {
                rest = mul_add::<FMA>(-force, current, rest);
                rate = mul_add::<FMA>(-force, speed, rate);
            }
            for &sign in signs {
                let over = sign * rest - course.at.limit_n;
                if over > most {
                    (missed, most) = (Some((j, sign > 0.0)), over);
                }
                let speed = sign * rate - course.limit_rate_m;
                if speed <= course.rounding_m {
                    continue;
                }
                // Within rounding of its limit a point is at it.
                let slack = if over >= -course.rounding_n {
                    0.0
                } else {
                    -over
                };
                let step = slack / speed;
                if step < least || (step == least && speed > fastest) {
                    (first, least, fastest) = (Some((j, sign > 0.0)), step, speed);
                }
            }
        }
        missed.or(first)
    }
}
