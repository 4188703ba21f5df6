//! Proven upper bounds of the force over whole boxes of air coils.
//!
//! A cell is a box in inner radius, depth and length. Force per ampere grows with depth and
//! length and with a larger window; the amount of wire and the inductance grow with all three
//! (a loop's mutual inductance to another grows with the mean radius at a given offset), and so
//! do the inductance's derivatives by depth and length. So a cell's corners enclose everything,
//! and derivatives in interval arithmetic give second-order bounds around its middle:
//!
//! ```text
//! ln F(x) <= ln F(x) - sum lambda_j h_j(x) <= [the same at the middle] + sum_i max D_i (x_i - m_i)
//! ```
//!
//! for any lambda >= 0, because h_j <= 0 for every coil within its limits. The multipliers of
//! the best coil known make the right side flat where it matters. Rounding is outwards; the
//! kernels' stated errors are added.

use super::axis_gradient::{self, axis_gradient};
use super::domain::Domain;
use super::model::Window;
use super::problem::{LimitName, Problem, Regime};
use super::sqp::Local;
use crate::circuit::SETTLING_TIME_CONSTANTS;
use crate::section_integrals::{ROUGH, section_integrals};
use fluxform_base::units::MU_0_T_M_PER_A;
use fluxform_numerics::interval::Interval;

/// A box of windows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cell {
    /// Inner radius, m.
    pub inner: Interval,
    /// Depth, m.
    pub depth: Interval,
    /// Length, m.
    pub length: Interval,
}

/// Multipliers in the limits' logarithms; any numbers that are not negative give a bound.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Multipliers {
    /// Of the largest volume of wire.
    pub most: f64,
    /// Of the least.
    pub least: f64,
    /// Of the outer radius (any sign where it is given).
    pub outer: f64,
    /// Of the settling time.
    pub settling: f64,
}

impl Multipliers {
    /// Those of a local optimum.
    #[must_use]
    pub fn of(problem: &Problem<'_>, local: &Local) -> Self {
        let mut sums = Self::default();
        for (bound, &lambda) in problem.bounds.iter().zip(&local.multipliers) {
            match (bound.name, problem.regime) {
                (LimitName::Current, _) | (LimitName::Power, Regime::Supply) => {
                    sums.least += lambda.max(0.0);
                }
                // Where the heat falls with the resistance it asks for a least one.
                (LimitName::ArrayPower, Regime::Supply) => {
                    let volume_m3 = Problem::window(local.x).volume_over_pi_m3().value;
                    let resistance_ohm = volume_m3 * problem.strand.resistance_per_volume();
                    let [heat_w, by_ohm] = problem.task.array_heat_w(resistance_ohm);
                    let falls = (-by_ohm * resistance_ohm / heat_w).max(0.0);
                    sums.least += lambda.max(0.0) * falls;
                }
                (
                    LimitName::Resistance
                    | LimitName::Power
                    | LimitName::Voltage
                    | LimitName::Mass
                    | LimitName::ArrayMass
                    | LimitName::WireLength,
                    _,
                )
                | (LimitName::ArrayPower, Regime::Driver) => sums.most += lambda.max(0.0),
                (LimitName::OuterDiameter | LimitName::Pitch, _) => sums.outer += lambda.max(0.0),
                (LimitName::FixedOuter, _) => sums.outer += lambda,
                (LimitName::Settling, _) => sums.settling += lambda.max(0.0),
                _ => {}
            }
        }
        sums
    }
}

/// Bounds for the cells of one problem.
#[derive(Clone, Copy)]
pub struct Bounding<'a> {
    problem: &'a Problem<'a>,
    dipoles: &'a [(f64, f64)],
    /// The limits' ranges.
    pub domain: Domain,
    multipliers: Multipliers,
    with_settling: bool,
    /// mu_0 J, T per metre of h.
    strength: f64,
}

/// Slack of comparisons with a limit, relative: more than the corners' rounding.
const SLACK: f64 = 1e-12;

impl<'a> Bounding<'a> {
    /// Bounds for `problem` over `domain`; `None` for a coil with a core. Without
    /// `with_settling` that limit is left out: still an upper bound.
    #[must_use]
    pub fn new(
        problem: &'a Problem<'a>,
        domain: Domain,
        multipliers: Multipliers,
        with_settling: bool,
    ) -> Option<Self> {
        Some(Self {
            dipoles: problem.model.air_dipoles()?,
            problem,
            domain,
            multipliers,
            with_settling: with_settling && domain.settling_max_s.is_finite(),
            strength: MU_0_T_M_PER_A * problem.strand.turns_per_m2(),
        })
    }

    /// The cell without what the limits exclude; `None` where nothing is left.
    #[must_use]
    pub(crate) fn contracted(&self, mut cell: Cell) -> Option<Cell> {
        let domain = &self.domain;
        let meet = |interval: &mut Interval, lo: f64, hi: f64| {
            // Ends are kept where they are within rounding of each other.
            let (lo, hi) = (lo * (1.0 - SLACK), hi * (1.0 + SLACK));
            interval.lo = interval.lo.max(lo);
            interval.hi = interval.hi.min(hi);
            interval.lo <= interval.hi
        };
        for _ in 0..2 {
            let (a, w, l) = (cell.inner, cell.depth, cell.length);
            // a + w within the outer radii.
            let lo = (domain.outer_m[0] - w.hi).min(a.hi);
            if !meet(&mut cell.inner, lo.max(0.0), domain.outer_m[1] - w.lo) {
                return None;
            }
            let lo = (domain.outer_m[0] - a.hi).min(w.hi);
            if !meet(&mut cell.depth, lo.max(0.0), domain.outer_m[1] - a.lo) {
                return None;
            }
            // (2 a + w) w l within the volumes.
            let [least, most] = domain.volume_m3;
            let ring = |a: f64, w: f64| (2.0 * a + w) * w;
            if !meet(
                &mut cell.length,
                least / ring(a.hi, w.hi),
                most / ring(a.lo, w.lo),
            ) {
                return None;
            }
            let inner = |v: f64, w: f64, l: f64| 0.5 * (v / (w * l) - w);
            let lo = inner(least, w.hi, l.hi);
            if !meet(
                &mut cell.inner,
                lo.max(0.0).min(a.hi),
                inner(most, w.lo, l.lo),
            ) {
                return None;
            }
            // w^2 + 2 a w = v / l.
            let depth = |v: f64, a: f64, l: f64| {
                let c = v / l;
                if c.is_finite() {
                    c / (a + (a * a + c).sqrt())
                } else {
                    c
                }
            };
            let lo = depth(least, a.hi, l.hi).min(w.hi);
            if !meet(&mut cell.depth, lo, depth(most, a.lo, l.lo)) {
                return None;
            }
        }
        Some(cell)
    }

    /// ln F of one window, whatever its limits.
    #[must_use]
    pub(crate) fn ln_force_at(&self, window: &Window) -> f64 {
        let (a, w, l) = (window.inner_radius_m, window.depth_m, window.length_m);
        (self.force_per_ampere(window) * self.current_a(self.resistance_ohm(a, w, l))).ln()
    }

    fn current_a(&self, resistance_ohm: f64) -> f64 {
        match self.problem.regime {
            Regime::Driver => self.problem.task.current_max_a,
            Regime::Supply => self.problem.task.voltage_v.unwrap_or(0.0) / resistance_ohm,
        }
    }

    fn corner(inner: f64, depth: f64, length: f64) -> Window {
        Window {
            inner_radius_m: inner,
            depth_m: depth,
            length_m: length,
        }
    }

    /// Upper bound of ln F over a contracted cell; `None` where it holds no coil within the
    /// limits. Bounds in their order of cost: as soon as one is at most `enough` it is returned.
    #[must_use]
    pub(crate) fn ln_force(&self, cell: &Cell, enough: f64) -> Option<f64> {
        let (a, w, l) = (cell.inner, cell.depth, cell.length);
        // The largest window that holds every window of the cell.
        let outer_hi = (a.hi + w.hi).min(self.domain.outer_m[1] * (1.0 + SLACK));
        let most = self.force_per_ampere(&Self::corner(a.lo, outer_hi - a.lo, l.hi));
        // The smallest that all of them hold, if any.
        let common = (a.lo + w.lo) - a.hi;
        let least = if common > 0.0 {
            self.force_per_ampere(&Self::corner(a.hi, common, l.lo))
        } else {
            0.0
        };
        // For thin windings the mean value over the depth is nearer.
        let force = Interval::new(least, most)
            .widened(8.0 * axis_gradient::RELATIVE_ERROR)
            .and(self.force_by_depth(cell, outer_hi));
        // The corner may hold less wire than the limits ask for.
        let least_ohm = self.domain.volume_m3[0] * self.problem.strand.resistance_per_volume();
        let current_hi = self.current_a(self.resistance_ohm(a.lo, w.lo, l.lo).max(least_ohm));
        let mut bound = (force.hi * current_hi).ln() + 8.0 * axis_gradient::RELATIVE_ERROR;
        let mut slopes = None;
        if bound > enough && force.lo > 0.0 {
            let of_force = self.slopes_of_ln_force(cell, force);
            slopes = Some(of_force);
            bound = bound.min(self.mean_value(cell, of_force, Multipliers::default(), None));
            let without = Multipliers {
                settling: 0.0,
                ..self.multipliers
            };
            if bound > enough && without != Multipliers::default() {
                bound = bound.min(self.mean_value(cell, of_force, without, None));
            }
        }
        if bound > enough && self.with_settling {
            let settling = self.settling(cell)?;
            if let Some(of_force) = slopes {
                let lagrangian =
                    self.mean_value(cell, of_force, self.multipliers, settling.as_ref());
                bound = bound.min(lagrangian);
            }
        }
        Some(bound)
    }

    /// Force per ampere as depth times the difference of two loops anywhere in it.
    fn force_by_depth(&self, cell: &Cell, outer_hi: f64) -> Interval {
        let radii = Interval::new(cell.inner.lo, outer_hi);
        let mut sum = Interval::point(0.0);
        for &(z, moment) in self.dipoles {
            let z = Interval::point(z);
            sum = sum + difference(radii, z, cell.length) * (moment * self.strength);
        }
        sum * cell.depth
    }

    fn resistance_ohm(&self, a: f64, w: f64, l: f64) -> f64 {
        (2.0 * a + w) * w * l * self.problem.strand.resistance_per_volume()
    }

    fn force_per_ampere(&self, window: &Window) -> f64 {
        let sum: f64 = self
            .dipoles
            .iter()
            .map(|&(z, moment)| moment * axis_gradient(window, z).value)
            .sum();
        self.strength * sum
    }

    /// Derivatives of ln(force per ampere) by inner radius, depth and length over a cell whose
    /// force per ampere lies in `force`.
    fn slopes_of_ln_force(&self, cell: &Cell, force: Interval) -> [Interval; 3] {
        let mut sums = [Interval::point(0.0); 3];
        for &(z, moment) in self.dipoles {
            let slopes = axis_slopes(cell, z);
            for (sum, slope) in sums.iter_mut().zip(slopes) {
                *sum = *sum + slope * (moment * self.strength);
            }
        }
        sums.map(|slope| slope / force)
    }

    /// The Lagrangian's second-order bound.
    fn mean_value(
        &self,
        cell: &Cell,
        slopes: [Interval; 3],
        lambda: Multipliers,
        settling: Option<&Settling>,
    ) -> f64 {
        let (a, w, l) = (cell.inner, cell.depth, cell.length);
        let [a_m, w_m, l_m] = [a, w, l].map(|i| 0.5 * (i.lo + i.hi));
        let middle = Self::corner(a_m, w_m, l_m);
        let domain = &self.domain;
        // ln F = ln(force per ampere) + ln I, and I = V/R is a constant less ln(volume).
        let by_volume = match self.problem.regime {
            Regime::Driver => lambda.least - lambda.most,
            Regime::Supply => lambda.least - lambda.most - 1.0,
        };
        let volume_m = (2.0 * a_m + w_m) * w_m * l_m;
        let mut value = self.ln_force_at(&middle);
        let term = |weight: f64, ratio: f64| {
            if weight == 0.0 {
                0.0
            } else {
                weight * ratio.ln()
            }
        };
        value -= term(lambda.most, volume_m / domain.volume_m3[1]);
        value += term(lambda.least, volume_m / domain.volume_m3[0]);
        value -= term(lambda.outer, (a_m + w_m) / domain.outer_m[1]);
        let weight_sum = 1.0 + lambda.most + lambda.least + lambda.outer.abs();
        let mut margin = 32.0 * axis_gradient::RELATIVE_ERROR * weight_sum;
        let one = Interval::point(1.0);
        let across = one / (a + a + w);
        // Of ln(volume) and ln(outer radius).
        let volume = [across * 2.0, one / w + across, one / l];
        let outer = one / (a + w);
        let mut derivative = slopes;
        for (i, slope) in derivative.iter_mut().enumerate() {
            *slope = *slope + volume[i] * by_volume;
            if i < 2 {
                *slope = *slope - outer * lambda.outer;
            }
        }
        if let Some(settling) = settling
            && lambda.settling > 0.0
        {
            let sums = section_integrals(a_m, w_m, l_m, &ROUGH);
            let ratio = self.settling_s(sums.value, volume_m) / domain.settling_max_s;
            value -= lambda.settling * ratio.ln();
            margin += 1.5 * lambda.settling * ROUGH.relative_error;
            for (i, slope) in derivative.iter_mut().enumerate() {
                *slope = *slope - (settling.slopes[i] - volume[i]) * lambda.settling;
            }
        }
        let mut rise = Interval::point(0.0);
        for (slope, (interval, at)) in derivative.iter().zip([(a, a_m), (w, w_m), (l, l_m)]) {
            let away = interval - Interval::point(at);
            rise = rise + *slope * away;
        }
        value + rise.hi + margin
    }

    fn settling_s(&self, sums: f64, volume: f64) -> f64 {
        let strand = &self.problem.strand;
        SETTLING_TIME_CONSTANTS * self.strength * strand.turns_per_m2() * sums
            / (volume * strand.resistance_per_volume())
    }

    /// The inductance over the cell; `None` where every coil settles too slowly, `Some(None)`
    /// where none does, so that the limit holds nothing back.
    fn settling(&self, cell: &Cell) -> Option<Option<Settling>> {
        let (a, w, l) = (cell.inner, cell.depth, cell.length);
        let error = 2.0 * ROUGH.relative_error;
        let lo = section_integrals(a.lo, w.lo, l.lo, &ROUGH);
        // L / l grows with l, so that the slowest end of the cell's length is its lower one.
        let volume_hi = (2.0 * a.hi + w.hi) * w.hi * l.lo;
        let fastest = self.settling_s(lo.value * (1.0 - error), volume_hi);
        if fastest > self.domain.settling_max_s * (1.0 + SLACK) {
            return None;
        }
        if self.multipliers.settling <= 0.0 {
            return Some(None);
        }
        let hi = section_integrals(a.hi, w.hi, l.hi, &ROUGH);
        let between = |x: f64, y: f64| Interval::new(x.min(y), y.max(x)).widened(error);
        let value = between(lo.value, hi.value);
        let by_depth = between(lo.by_depth, hi.by_depth);
        let by_length = between(lo.by_length, hi.by_length);
        let inner = between(lo.inner, hi.inner);
        let mut by_inner = by_depth - inner;
        if a.lo > 0.0 {
            // Homogeneous of degree five: a L_a = 5 L - w L_w - l L_l.
            by_inner = by_inner.and((value * 5.0 - w * by_depth - l * by_length) / a);
        }
        Some(Some(Settling {
            slopes: [by_inner / value, by_depth / value, by_length / value],
        }))
    }
}

/// Derivatives of ln L over a cell.
struct Settling {
    slopes: [Interval; 3],
}

/// Derivatives of h over a cell by inner radius (depth held), depth and length.
fn axis_slopes(cell: &Cell, z_m: f64) -> [Interval; 3] {
    let outer = cell.inner + cell.depth;
    let z = Interval::point(z_m);
    let far = z + cell.length;
    let (at_inner, at_outer) = (
        difference(cell.inner, z, cell.length),
        difference(outer, z, cell.length),
    );
    let by_difference = at_outer - at_inner;
    // The same as the integral of D' over the depth, better for thin windings:
    // D' = int 3/2 a u (2 u^2 - 3 a^2) / (a^2 + u^2)^(7/2) du from z to z + L.
    let a = Interval::new(cell.inner.lo, outer.hi);
    let u = Interval::new(z_m, far.hi);
    let s = (a.square() + u.square()).sqrt();
    let curl =
        a * u * (u.square() * 2.0 - a.square() * 3.0) / (s.square().square() * s.square() * s);
    let by_inner = by_difference.and(curl * cell.length * cell.depth * 1.5);
    // E(a2) - E(a1), and as the integral of 3/2 a^2 u / (a^2 + u^2)^(5/2) over the depth.
    let end = |a: Interval| {
        let angle = rising(a, far);
        angle * angle.square() / far * 0.5
    };
    let s = (a.square() + far.square()).sqrt();
    let kernel = a.square() * far / (s.square().square() * s) * 1.5;
    let by_length = (end(outer) - end(cell.inner)).and(kernel * cell.depth);
    [by_inner, at_outer, by_length]
}

/// D(a), one loop's field at the top less that at the bottom, over boxes.
fn difference(a: Interval, z: Interval, length: Interval) -> Interval {
    let far = z + length;
    let distance = |a: f64, u: Interval| (Interval::point(a).square() + u.square()).sqrt();
    let over = |u| Interval::new(distance(a.lo, u).lo, distance(a.hi, u).hi);
    let (s1, s2) = (over(z), over(far));
    // s1 / s2 grows with a.
    let ratio = Interval::new(
        (distance(a.lo, z) / distance(a.lo, far)).lo,
        (distance(a.hi, z) / distance(a.hi, far)).hi,
    );
    let angle = rising(a, z);
    let closer = (length / (s1 + s2)) * ((z + far) / s2);
    angle.square() * closer * (ratio.square() + ratio + Interval::point(1.0)) / s1 * 0.5
}

/// a / sqrt(a^2 + u^2): grows with a, falls with u.
fn rising(a: Interval, u: Interval) -> Interval {
    let at = |a: f64, u: f64| {
        let (a, u) = (Interval::point(a), Interval::point(u));
        a / (a.square() + u.square()).sqrt()
    };
    Interval::new(at(a.lo, u.hi).lo.max(0.0), at(a.hi, u.lo).hi)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::optimum::tests::{air, seed_limits, task};
    use fluxform_design::Limits;

    /// A seed-like problem's Lagrangian by the problem's own numbers, and its bound over cells of
    /// relative half width `wide` about one coil.
    struct Lagrangian<'a> {
        problem: &'a Problem<'a>,
        bounding: Bounding<'a>,
    }

    impl<'a> Lagrangian<'a> {
        fn new(problem: &'a Problem<'a>, multipliers: Multipliers) -> Self {
            let domain = Domain::of(problem);
            let bounding = Bounding::new(problem, domain, multipliers, true);
            Self {
                problem,
                bounding: bounding.expect("an air coil"),
            }
        }

        fn cell(wide: f64) -> Cell {
            let about = |at: f64, wide: f64| Interval::new(at * (1.0 - wide), at * (1.0 + wide));
            Cell {
                inner: about(0.011, wide),
                depth: about(0.007, 0.7 * wide),
                length: about(0.07, 1.3 * wide),
            }
        }

        fn at(&self, window: Window) -> f64 {
            let Bounding {
                domain,
                multipliers: lambda,
                ..
            } = &self.bounding;
            let rated = self.problem.rate(window).expect("in the domain");
            let row = |name| {
                let mut bounds = self.problem.bounds.iter();
                let row = bounds.position(|bound| bound.name == name);
                rated.values[row.expect("limited")].value
            };
            let volume = window.volume_over_pi_m3().value;
            let weighted = |weight: f64, ratio: f64| {
                if weight == 0.0 {
                    0.0
                } else {
                    weight * ratio.ln()
                }
            };
            let outer = row(LimitName::OuterDiameter) / (2.0 * domain.outer_m[1]);
            rated.force_n.value.ln() - weighted(lambda.most, volume / domain.volume_m3[1])
                + weighted(lambda.least, volume / domain.volume_m3[0])
                - weighted(lambda.outer, outer)
                - weighted(
                    lambda.settling,
                    row(LimitName::Settling) / domain.settling_max_s,
                )
        }

        /// Largest value of the Lagrangian at 27 coils of the cell.
        fn largest(&self, cell: &Cell) -> f64 {
            let three = |i: Interval| [i.lo, 0.5 * (i.lo + i.hi), i.hi];
            let mut most = f64::NEG_INFINITY;
            for a in three(cell.inner) {
                for w in three(cell.depth) {
                    for l in three(cell.length) {
                        most = most.max(self.at(Bounding::corner(a, w, l)));
                    }
                }
            }
            most
        }

        fn bound(&self, cell: &Cell) -> f64 {
            let (a, w, l) = (cell.inner, cell.depth, cell.length);
            let of = |a: f64, outer: f64, l: f64| {
                let window = Bounding::corner(a, outer - a, l);
                self.bounding.force_per_ampere(&window)
            };
            let force = Interval::new(of(a.hi, a.lo + w.lo, l.lo), of(a.lo, a.hi + w.hi, l.hi));
            let slopes = self
                .bounding
                .slopes_of_ln_force(cell, force.widened(8.0 * axis_gradient::RELATIVE_ERROR));
            let settling = self.bounding.settling(cell).expect("fast enough");
            let lambda = self.bounding.multipliers;
            self.bounding
                .mean_value(cell, slopes, lambda, settling.as_ref())
        }
    }

    /// Problems of the driver's regime and of the supply's, which asks for a least resistance.
    fn problems(check: impl Fn(&Problem<'_>)) {
        let limits = Limits {
            settling_max_s: Some(0.013),
            ..seed_limits()
        };
        let (model, task) = (air(0.03), task(limits, Some(4.0)));
        for problem in Problem::of_wire(&model, &task, task.strands[0]) {
            check(&problem);
        }
    }

    #[test]
    fn the_lagrangian_is_bounded_to_second_order() {
        problems(|problem| {
            let supply = problem.regime == Regime::Supply;
            let lagrangian = Lagrangian::new(
                problem,
                Multipliers {
                    most: 0.3,
                    least: if supply { 0.2 } else { 0.0 },
                    outer: 0.7,
                    settling: 0.4,
                },
            );
            let excess = |wide: f64| {
                let cell = Lagrangian::cell(wide);
                lagrangian.bound(&cell) - lagrangian.largest(&cell)
            };
            let [point, narrow, wide] = [0.0, 2e-3, 2e-2].map(excess);
            let few = 10.0 * ROUGH.relative_error;
            assert!(point >= 0.0 && point < few, "{point:e}");
            assert!(narrow >= 0.0 && wide > 0.0);
            assert!(narrow < 0.015 * wide + few, "{narrow:e} {wide:e}");
        });
    }

    #[test]
    fn every_multiplier_widens_the_bound_by_its_limit_s_error() {
        problems(|problem| {
            let large = 1e7;
            let none = Multipliers::default();
            let mut each = vec![
                Multipliers {
                    most: large,
                    ..none
                },
                Multipliers {
                    outer: large,
                    ..none
                },
                Multipliers {
                    outer: -large,
                    ..none
                },
            ];
            if problem.regime == Regime::Supply {
                each.push(Multipliers {
                    least: large,
                    ..none
                });
            }
            for multipliers in each {
                let lagrangian = Lagrangian::new(problem, multipliers);
                let cell = Lagrangian::cell(0.0);
                let excess = lagrangian.bound(&cell) - lagrangian.largest(&cell);
                let error = axis_gradient::RELATIVE_ERROR * large;
                assert!(
                    excess > 16.0 * error && excess < 64.0 * error,
                    "{multipliers:?}: {excess:e} {error:e}"
                );
            }
        });
    }

    /// Where the winding is a filament the differences cancel, and the integrals must hold alone.
    #[test]
    fn a_filaments_slopes_are_enclosed_closely() {
        let (a, z, thin): (f64, f64, f64) = (0.007, 0.0031, 1e-12);
        let cell = Cell {
            inner: Interval::point(a),
            depth: Interval::point(thin),
            length: Interval::point(thin),
        };
        let slopes = axis_slopes(&cell, z);
        let s = a.hypot(z);
        let inner = 1.5 * thin * thin * a * z * (2.0 * z * z - 3.0 * a * a) / s.powi(7);
        let length = 1.5 * thin * a * a * z / s.powi(5);
        for (slope, requested) in [(slopes[0], inner), (slopes[2], length)] {
            assert!(
                (slope.lo - requested).abs() < 1e-7 * requested.abs(),
                "{slope:?} {requested}"
            );
            assert!(
                (slope.hi - requested).abs() < 1e-7 * requested.abs(),
                "{slope:?} {requested}"
            );
        }
    }
}
