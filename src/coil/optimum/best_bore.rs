//! The best bore of a coil of given layers and turns.
//!
//! Limits on sizes and wire give a range of bores. It is scanned for the strongest bore, which is
//! refined; where that breaks a limit that only the model knows, the edge of what meets it
//! is looked for on both sides. One maximum between two samples is assumed.

use super::candidates::Leaf;
use super::domain::Domain;
use super::model::Window;
use super::problem::{LimitName, Problem, Regime};
use super::scalar;
use super::sqp::FEASIBLE;

/// Bores at which each coil is tried.
const SCAN: usize = 9;

/// One problem's coils as functions of their bores.
pub(super) struct Bores<'a> {
    pub problem: &'a Problem<'a>,
    /// The problem without limits that cost an inductance.
    screen: Option<Problem<'a>>,
}

impl<'a> Bores<'a> {
    pub fn of(problem: &'a Problem<'a>) -> Self {
        Self {
            problem,
            screen: problem.without(&[LimitName::Settling]),
        }
    }

    pub fn window(&self, layers: u64, turns: u64, inner_radius_m: f64) -> Window {
        let wire_m = self.problem.strand.diameter_m;
        Window {
            inner_radius_m,
            depth_m: layers as f64 * wire_m,
            length_m: turns as f64 * wire_m,
        }
    }

    /// Inner radii, m, that limits on sizes and wire allow a coil, not below `narrow` depths.
    pub fn range(&self, domain: &Domain, narrow: f64, layers: u64, turns: u64) -> Option<[f64; 2]> {
        let Window {
            depth_m, length_m, ..
        } = self.window(layers, turns, 0.0);
        // (2 a + w) w L is the amount of wire.
        let inner = |volume_m3: f64| 0.5 * (volume_m3 / (depth_m * length_m) - depth_m);
        let lo = domain.inner_m[0]
            .max(domain.outer_m[0] - depth_m)
            .max(inner(domain.volume_m3[0]))
            .max(narrow * depth_m);
        let hi = (domain.outer_m[1] - depth_m)
            .min(inner(domain.volume_m3[1]))
            .min(domain.inner_m[1]);
        let slack = 1e-12 * (hi.abs() + depth_m);
        (hi.is_finite() && lo <= hi + slack).then_some([lo.min(hi), hi])
    }

    /// ln F at a bore, limits that need an inductance apart; -infinity where the model fails.
    pub(crate) fn ln_force(&self, window: Window) -> f64 {
        let problem = self.screen.as_ref().unwrap_or(self.problem);
        let rated = problem.rate(window);
        rated.map_or(f64::NEG_INFINITY, |rated| rated.force_n.value.ln())
    }

    /// The worst of all limits at a bore.
    pub fn over(&self, window: Window) -> f64 {
        self.worst(window, |_| true)
    }

    /// The worst of the limits in `asked`.
    fn worst(&self, window: Window, asked: impl Fn(LimitName) -> bool) -> f64 {
        let Some(rated) = self.problem.rate(window) else {
            return f64::INFINITY;
        };
        let point = self.problem.scaled(&rated);
        let rows = point.rows.iter().zip(&self.problem.bounds);
        rows.filter(|(_, bound)| asked(bound.name))
            .map(|(&row, bound)| {
                if bound.name.is_equality() {
                    row.abs()
                } else {
                    row
                }
            })
            .fold(f64::NEG_INFINITY, f64::max)
    }

    /// The best bore of one coil within `bores`; `None` where none meets the limits or its force
    /// does not reach `enough_ln`.
    pub fn best(&self, layers: u64, turns: u64, bores: [f64; 2], enough_ln: f64) -> Option<Leaf> {
        let window = |a: f64| self.window(layers, turns, a);
        let ln_force = |a: f64| self.ln_force(window(a));
        let [lo, hi] = bores;
        let (mut at, mut value) = summit(ln_force, lo, hi);
        if value < enough_ln {
            return None;
        }
        // The last rounding is taken off the bore.
        let depth_m = window(0.0).depth_m;
        let mut over = self.over(window(at));
        if over > 0.0 && over <= FEASIBLE && self.problem.regime == Regime::Driver {
            at = (at - 4.0 * over * (at + depth_m)).max(lo);
            over = self.over(window(at));
            value = ln_force(at);
        }
        if over > FEASIBLE {
            (at, value) = self.within(window, [lo, at, hi], enough_ln)?;
        }
        (value.is_finite() && value >= enough_ln).then(|| Leaf {
            layers,
            turns,
            window: window(at),
            ln_force: value,
        })
    }

    /// The best bore that meets every limit, beside a best one, the middle of `bores`, that does
    /// not.
    fn within(
        &self,
        window: impl Fn(f64) -> Window,
        bores: [f64; 3],
        enough_ln: f64,
    ) -> Option<(f64, f64)> {
        let [lo, at, hi] = bores;
        // The others are kept between `lo` and `hi`, and touched there or, with one layer or turn,
        // throughout: a root of theirs is not looked for.
        let of_the_model = |name| match name {
            LimitName::Settling | LimitName::CoreField | LimitName::Mass | LimitName::ArrayMass => {
                true
            }
            // Of drivers alone it follows from the amount of wire.
            LimitName::ArrayPower => {
                self.problem.regime == Regime::Supply || self.problem.task.reverses_farther()
            }
            _ => false,
        };
        let over = |a: f64| self.worst(window(a), of_the_model);
        let ln_force = |a: f64| self.ln_force(window(a));
        let mut best: Option<(f64, f64)> = None;
        for end in [lo, hi] {
            // From the best bore outwards, to the first that meets the limits.
            let mut outside = at;
            for step in 1..=4 {
                let bore = at + (end - at) * f64::from(step * step) / 16.0;
                if bore == outside || ln_force(bore) < enough_ln {
                    break;
                }
                if over(bore) <= 0.0 {
                    let tolerance = 1e-13 * (at + window(at).depth_m);
                    let (low, high) = (bore.min(outside), bore.max(outside));
                    let root = scalar::root(over, low, high, tolerance).unwrap_or(bore);
                    // On the side that meets them.
                    let inwards = (bore - root) * 1e-10;
                    let edge = if over(root) <= 0.0 {
                        root
                    } else {
                        root + inwards
                    };
                    let met = |a: &f64| self.over(window(*a)) <= FEASIBLE;
                    if let Some(bore) = [edge, bore].into_iter().find(met) {
                        let value = ln_force(bore);
                        if best.is_none_or(|(_, old)| value > old) {
                            best = Some((bore, value));
                        }
                    }
                    break;
                }
                outside = bore;
            }
        }
        best
    }
}

/// Sample `index` of [`SCAN`] between `lo` and `hi`.
fn sample(lo: f64, hi: f64, index: usize) -> f64 {
    match index {
        0 => lo,
        k if k == SCAN - 1 => hi,
        k => lo + (hi - lo) * k as f64 / (SCAN - 1) as f64,
    }
}

/// The sample at which `f` is largest.
fn highest(f: impl Fn(f64) -> f64, lo: f64, hi: f64) -> usize {
    let first = if is_one_bore(lo, hi) { SCAN - 1 } else { 0 };
    (first..SCAN)
        .map(|k| (k, f(sample(lo, hi, k))))
        .reduce(|best, next| if next.1 > best.1 { next } else { best })
        .map_or(0, |best| best.0)
}

fn is_one_bore(lo: f64, hi: f64) -> bool {
    hi - lo <= f64::EPSILON * hi
}

/// The maximum of `f`: the highest sample, and what is higher beside it.
pub(super) fn summit(f: impl Fn(f64) -> f64, lo: f64, hi: f64) -> (f64, f64) {
    climb(&f, lo, hi, highest(&f, lo, hi))
}

/// The maximum of `f` next to a sample: between its neighbours, and farther on where it lies at
/// one of them.
fn climb(f: impl Fn(f64) -> f64, lo: f64, hi: f64, index: usize) -> (f64, f64) {
    if is_one_bore(lo, hi) {
        return (hi, f(hi));
    }
    let mut index = index;
    let mut best = (sample(lo, hi, index), f(sample(lo, hi, index)));
    for _ in 0..SCAN {
        let sides = [index.saturating_sub(1), (index + 1).min(SCAN - 1)];
        let [low, high] = sides.map(|k| sample(lo, hi, k));
        let refined = scalar::maximum(&f, low, high);
        if refined.1 > best.1 {
            best = refined;
        }
        let next = sides
            .into_iter()
            .find(|&k| k != 0 && k != SCAN - 1 && k != index && sample(lo, hi, k) == best.0);
        match next {
            Some(k) => index = k,
            None => break,
        }
    }
    best
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::optimum::air::AirCoil;
    use crate::optimum::model::{CoilModel, NoResponse, Response};
    use crate::optimum::tests::{HEIGHT_M, air, task};
    use fluxform_design::Limits;

    const NARROW: f64 = 0.05;

    /// An air coil that hides that it is one, so that nothing bounds its force.
    pub struct Opaque(pub AirCoil);

    impl CoilModel for Opaque {
        fn response(
            &self,
            window: &Window,
            turns_per_m2: f64,
            current_a: f64,
            with_inductance: bool,
        ) -> Result<Response, NoResponse> {
            self.0
                .response(window, turns_per_m2, current_a, with_inductance)
        }

        fn relative_error(&self) -> f64 {
            self.0.relative_error()
        }

        fn length_scale_m(&self) -> f64 {
            self.0.length_scale_m()
        }
    }

    pub fn small(settling_max_s: f64) -> Limits {
        Limits {
            resistance_max_ohm: Some(0.2),
            settling_max_s: Some(settling_max_s),
            outer_diameter_max_m: Some(0.02),
            length_max_m: Some(0.006),
            ..Limits::default()
        }
    }

    #[test]
    fn the_best_bore_is_what_a_fine_scan_finds() {
        let model = Opaque(air(HEIGHT_M));
        let mut limited = 0;
        for settling_max_s in [0.1, 0.0006] {
            let limits = Limits {
                inner_diameter_min_m: Some(0.002),
                ..small(settling_max_s)
            };
            let task = task(limits, None);
            let problem = &Problem::of_wire(&model, &task, task.strands[0])[0];
            let bores = Bores::of(problem);
            let domain = Domain::of(problem);
            for (layers, turns) in [(1, 2), (1, 7), (3, 1), (4, 6), (8, 3), (12, 1), (13, 8)] {
                let window = |a: f64| bores.window(layers, turns, a);
                let met = |a: f64| bores.over(window(a)) <= 0.0;
                let depth_m = window(0.0).depth_m;
                let bore = |k: u32| 0.001 + (0.009 - depth_m) * f64::from(k) / 60.0;
                // Limits on sizes and wire alone say where a bore may be.
                let screen = problem
                    .without(&[LimitName::Settling])
                    .expect("a settling time");
                let fits = |k: &u32| {
                    let rated = screen.rate(window(bore(*k))).expect("in the domain");
                    let point = screen.scaled(&rated);
                    bore(*k) >= NARROW * depth_m && point.rows.iter().all(|&row| row <= 0.0)
                };
                let fitting: Vec<f64> = (0..=60).filter(fits).map(bore).collect();
                let Some([lo, hi]) = bores.range(&domain, NARROW, layers, turns) else {
                    assert!(fitting.is_empty(), "{layers} {turns}");
                    continue;
                };
                for a in &fitting {
                    assert!(
                        (lo..=hi * (1.0 + 1e-12)).contains(a),
                        "{layers} {turns}: {a}"
                    );
                }
                let strongest = fitting.iter().filter(|a| met(**a));
                let strongest = strongest.map(|a| bores.ln_force(window(*a)));
                let strongest = strongest.fold(f64::NEG_INFINITY, f64::max);
                let leaf = bores.best(layers, turns, [lo, hi], f64::NEG_INFINITY);
                let value = leaf.map_or(f64::NEG_INFINITY, |leaf| leaf.ln_force);
                assert!(
                    value >= strongest - 1e-9,
                    "{layers} {turns}: {value} {strongest}"
                );
                let Some(leaf) = leaf else { continue };
                let a = leaf.window.inner_radius_m;
                assert!(bores.over(leaf.window) <= FEASIBLE);
                assert!((lo..=hi).contains(&a) && leaf.window == window(a));
                let limit = scalar::maximum(|a| bores.ln_force(window(a)), lo, hi);
                if value < limit.1 - 1e-6 {
                    // Held back by the settling time: beside it one that is as slow as may be.
                    limited += 1;
                    let over = bores.over(leaf.window);
                    assert!(over.abs() < 1e-7, "{layers} {turns}: {over:e}");
                }
            }
        }
        assert!(limited >= 2, "{limited}");
    }

    /// A rough scan may point to a sample beside the right one.
    #[test]
    fn a_climb_goes_on_where_the_summit_lies_farther() {
        for index in 0..SCAN {
            let (x, _) = climb(|x| -(x - 0.71) * (x - 0.71), 0.3, 1.3, index);
            assert!((x - 0.71).abs() < 1e-7, "{index}: {x}");
        }
    }

    #[test]
    fn a_summit_is_found_between_the_scan_s_places_and_at_the_ends() {
        for peak in [0.3, 0.37, 0.71, 1.04, 1.29] {
            let (x, value) = summit(|x| -(x - peak) * (x - peak), 0.3, 1.3);
            assert!((x - peak).abs() < 1e-7 && value > -1e-14, "{x} {peak}");
        }
        let (x, _) = summit(|x| x, 0.3, 1.3);
        assert_eq!(x, 1.3);
        // Two maxima: the higher one's.
        let bell = |x: f64, peak: f64| (-30.0 * (x - peak) * (x - peak)).exp();
        let (x, _) = summit(|x| bell(x, 0.4) + 2.0 * bell(x, 1.1), 0.3, 1.3);
        assert!((x - 1.1).abs() < 1e-6, "{x}");
    }
}
