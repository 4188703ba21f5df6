//! A core's surface currents as few loops, for all points of a rectangle some way off.
//!
//! Panels that crowd at an edge are one smooth source from farther away. Where panels together are
//! no longer than their distance from the rectangle, the loops' field is analytic on each other's
//! Bernstein ellipse of radius 2 + sqrt(5) about them: the currents act through their moments with
//! the Lagrange polynomials on `order` Gauss nodes, to about (2 + sqrt(5))^-order. Longer panels are
//! halved until they are as short.

use super::{MagnetizedCore, Panel};
use crate::steel::generatrix::Face;
use fluxform_numerics::dispatch::{self, Kernel, LANES, Lanes};
use fluxform_numerics::gauss;
use fluxform_numerics::lagrange_basis::Basis;

/// A rectangle of the half plane, m.
#[derive(Debug, Clone, Copy)]
pub(in crate::steel) struct Rectangle {
    pub(in crate::steel) r_m: [f64; 2],
    pub(in crate::steel) z_m: [f64; 2],
}

/// A loop with its current, and how many steps its arithmetic-geometric mean takes at the rectangle.
#[derive(Debug, Clone, Copy)]
struct Loop {
    radius_m: f64,
    height_m: f64,
    current_a: f64,
    agm_steps: usize,
}

/// The loops that stand for a core at all points of a rectangle.
#[derive(Debug)]
pub(in crate::steel) struct Loops {
    loops: Vec<Loop>,
}

/// B_z, dB_z/dz, (dB_r/dz)/r and B_r/r over mu_0 at some points.
#[derive(Debug, Default)]
pub(in crate::steel) struct LoopFields {
    pub(in crate::steel) b_z: Vec<f64>,
    pub(in crate::steel) dbz_dz: Vec<f64>,
    pub(in crate::steel) dbr_dz_over_r: Vec<f64>,
    pub(in crate::steel) br_over_r: Vec<f64>,
}

impl Rectangle {
    /// Distance to a straight piece of the outline, m.
    fn distance_m(&self, core: &MagnetizedCore, face: Face, lo: f64, hi: f64) -> f64 {
        let shape = core.outline.shape;
        let (r_m, z_m) = match face {
            Face::Side => ([shape.radius_m; 2], [lo, hi]),
            Face::Bottom => ([lo, hi], [shape.bottom_m; 2]),
            Face::Top => ([lo, hi], [shape.top_m; 2]),
        };
        let apart = |a: [f64; 2], b: [f64; 2]| (a[0] - b[1]).max(b[0] - a[1]).max(0.0);
        apart(self.r_m, r_m).hypot(apart(self.z_m, z_m))
    }

    /// Steps after which the mean of a loop's kernel is right to `tolerance` everywhere here.
    fn agm_steps(&self, radius_m: f64, height_m: f64, tolerance: f64) -> usize {
        let apart = |at: f64, range: [f64; 2]| (range[0] - at).max(at - range[1]).max(0.0);
        let d_m = apart(radius_m, self.r_m).hypot(apart(height_m, self.z_m));
        let d2 = d_m * d_m;
        let ratio = (d2 / (d2 + 4.0 * radius_m * self.r_m[1])).sqrt();
        let (mut mean, mut geometric) = (0.5 * (1.0 + ratio), ratio.sqrt());
        let first = 0.5 * (1.0 - ratio);
        let mut correction = first;
        let (mut steps, mut weight) = (1, 2.0);
        loop {
            let next = 0.5 * (mean + geometric);
            // The first term that tau's sum neglects, over its first one; the mean's error is
            // smaller. Close to a loop parts as large as the ratio's inverse cancel.
            correction = correction * correction / (4.0 * next);
            let neglected = weight * correction * correction;
            if neglected <= first * first * ratio * tolerance || steps >= MOST_STEPS {
                return steps;
            }
            geometric = (mean * geometric).sqrt();
            mean = next;
            weight *= 2.0;
            steps += 1;
        }
    }
}

/// How much larger the sum of the currents' fields' magnitudes may be than the field.
const CANCELLATION: f64 = 100.0;
/// The means have converged to the last digit by then.
const MOST_STEPS: usize = 12;

impl MagnetizedCore {
    /// Loops that have the core's field everywhere in `rectangle`, to `tolerance` where its currents
    /// cancel by a factor of `CANCELLATION` at most; `None` where the rectangle is too close to the
    /// outline for that.
    pub(in crate::steel) fn loops(&self, rectangle: Rectangle, tolerance: f64) -> Option<Loops> {
        let radius = 2.0 + 5.0_f64.sqrt();
        let order = ((CANCELLATION / tolerance).ln() / radius.ln())
            .ceil()
            .max(2.0) as usize;
        if order > gauss::MAX_ORDER {
            return None;
        }
        let mut merging = Merging {
            core: self,
            rectangle,
            order,
            basis: Basis::new(gauss::rule(order)),
            // The rest of a panel is a polynomial times an analytic function.
            rule: gauss::rule(
                (self.outline.order + order)
                    .div_ceil(2)
                    .min(gauss::MAX_ORDER),
            ),
            places: Vec::new(),
        };
        let panels = &self.outline.panels;
        let mut first = 0;
        for face in panels.chunk_by(|a, b| a.face == b.face) {
            merging.group(first, first + face.len())?;
            // Where one face meets the next.
            first += face.len();
            merging.jump_before(first);
        }
        let loops = merging
            .places
            .into_iter()
            .map(|(r_m, z_m, current_a)| Loop {
                radius_m: r_m,
                height_m: z_m,
                current_a,
                agm_steps: rectangle.agm_steps(r_m, z_m, tolerance / CANCELLATION),
            });
        Some(Loops {
            loops: loops.collect(),
        })
    }
}

/// Loops found so far.
struct Merging<'a> {
    core: &'a MagnetizedCore,
    rectangle: Rectangle,
    order: usize,
    basis: Basis,
    rule: &'static gauss::Rule,
    /// Radius, height, current.
    places: Vec<(f64, f64, f64)>,
}

/// Halvings of a panel after which the rectangle counts as touching it.
const MOST_HALVINGS: usize = 40;

impl Merging<'_> {
    /// Loops of the panels `first` to `end` (exclusive) of one face.
    fn group(&mut self, first: usize, end: usize) -> Option<()> {
        let panels = &self.core.outline.panels;
        let face = panels[first].face;
        let (a, b) = (panels[first].from_m, panels[end - 1].to_m);
        let (lo, hi) = (a.min(b), a.max(b));
        let distance_m = self.rectangle.distance_m(self.core, face, lo, hi);
        if end - first == 1 {
            return self.piece(first, (lo, hi), MOST_HALVINGS);
        }
        if hi - lo <= distance_m {
            self.merge(first, end, (lo, hi));
            return Some(());
        }
        // At the border nearest to the middle.
        let middle = 0.5 * (lo + hi);
        let off = |k: &usize| (panels[*k].from_m - middle).abs();
        let split = (first + 1..end).min_by(|a, b| off(a).total_cmp(&off(b)))?;
        self.group(first, split)?;
        self.jump_before(split);
        self.group(split, end)
    }

    /// Loops of a piece of one panel.
    fn piece(&mut self, panel: usize, (lo, hi): (f64, f64), halvings: usize) -> Option<()> {
        let Panel { face, .. } = self.core.outline.panels[panel];
        if hi - lo > self.rectangle.distance_m(self.core, face, lo, hi) {
            let halvings = halvings.checked_sub(1)?;
            let middle = 0.5 * (lo + hi);
            self.piece(panel, (lo, middle), halvings)?;
            return self.piece(panel, (middle, hi), halvings);
        }
        let shape = self.core.outline.shape;
        let mut places = std::mem::take(&mut self.places);
        self.currents(panel, (lo, hi), |at_m, current_a| {
            let (r_m, z_m, _) = shape.on(face, at_m);
            places.push((r_m, z_m, current_a));
        });
        self.places = places;
        Some(())
    }

    /// The panels' moments on Gauss nodes over all of them.
    fn merge(&mut self, first: usize, end: usize, (lo, hi): (f64, f64)) {
        let core = self.core;
        let (half, middle) = (0.5 * (hi - lo), 0.5 * (lo + hi));
        let mut shares = vec![0.0; self.order];
        let mut moments = vec![0.0; self.order];
        let mut add = |at_m: f64, current_a: f64| {
            self.basis.weights((at_m - middle) / half, &mut shares);
            for (moment, share) in moments.iter_mut().zip(&shares) {
                *moment += current_a * share;
            }
        };
        for panel in first..end {
            if panel > first {
                add(core.outline.panels[panel].from_m, -core.jumps[panel - 1].2);
            }
            self.currents(panel, core.outline.panels[panel].range_m(), &mut add);
        }
        let face = core.outline.panels[first].face;
        let nodes = gauss::rule(self.order).nodes.iter();
        self.places.extend(nodes.zip(moments).map(|(x, current_a)| {
            let (r_m, z_m, _) = core.outline.shape.on(face, middle + half * x);
            (r_m, z_m, current_a)
        }));
    }

    /// Coordinates and currents of a rule over a piece of one panel.
    fn currents(&self, panel: usize, (lo, hi): (f64, f64), mut take: impl FnMut(f64, f64)) {
        let order = self.core.outline.order;
        let Panel { from_m, to_m, .. } = self.core.outline.panels[panel];
        let slopes = &self.core.slope_a_per_m[panel * order..(panel + 1) * order];
        let mut weights = vec![0.0; order];
        let (half, middle) = (0.5 * (hi - lo), 0.5 * (lo + hi));
        for (x, weight) in self.rule.nodes.iter().zip(&self.rule.weights) {
            let at_m = middle + half * x;
            self.core
                .basis
                .weights(2.0 * (at_m - from_m) / (to_m - from_m) - 1.0, &mut weights);
            let slope: f64 = weights.iter().zip(slopes).map(|(a, b)| a * b).sum();
            take(at_m, -slope * half * weight);
        }
    }

    /// The loop where a panel meets the one before it.
    fn jump_before(&mut self, panel: usize) {
        if let Some((r_m, z_m, jump)) = self.core.jumps.get(panel - 1) {
            self.places.push((*r_m, *z_m, -jump));
        }
    }
}

impl Loops {
    /// Number of loops.
    #[cfg(test)]
    pub(in crate::steel) fn count(&self) -> usize {
        self.loops.len()
    }

    /// The loops' fields over mu_0 at points of the rectangle.
    pub(in crate::steel) fn fields(&self, r_m: &[f64], z_m: &[f64]) -> LoopFields {
        let zeros = || vec![0.0; r_m.len()];
        let mut fields = LoopFields {
            b_z: zeros(),
            dbz_dz: zeros(),
            dbr_dz_over_r: zeros(),
            br_over_r: zeros(),
        };
        dispatch::run(Sum {
            loops: &self.loops,
            r_m,
            z_m,
            out: &mut fields,
        });
        fields
    }
}

/// The sum over the loops at all points.
struct Sum<'a> {
    loops: &'a [Loop],
    r_m: &'a [f64],
    z_m: &'a [f64],
    out: &'a mut LoopFields,
}

impl Kernel for Sum<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FMA: bool>(self) {
        for start in (0..self.r_m.len()).step_by(LANES) {
            fluxform_base::progress::poll();
            let range = start..(start + LANES).min(self.r_m.len());
            let r = Lanes::load(&self.r_m[range.clone()]);
            let z = Lanes::load(&self.z_m[range.clone()]);
            let mut total = [Lanes::splat(0.0); 4];
            for ring in self.loops {
                let part = one::<FMA>(ring, r, z);
                for (sum, value) in total.iter_mut().zip(part) {
                    *sum = *sum + value;
                }
            }
            let out = &mut *self.out;
            total[0].store(&mut out.b_z[range.clone()]);
            total[1].store(&mut out.dbz_dz[range.clone()]);
            total[2].store(&mut out.dbr_dz_over_r[range.clone()]);
            total[3].store(&mut out.br_over_r[range]);
        }
    }
}

/// One loop's b_z, d b_z/du, (d b_r/du)/r and b_r/r times its current, by the means F = 1/m and
/// G = tau/m of `crate::ring`. With S = F - q G and R = q F - p^2 G (D = s^2 d^2 = q^2 - p^2)
///
/// ```text
/// b_r/r = a^2 u S/D,  4 b_z = (2 a^2 R - p^2 S)/D,  dS/dq = -3 G/2,  dR/dq = F/2,  dq/du = 2 u.
/// ```
#[inline(always)]
fn one<const FMA: bool>(ring: &Loop, r: Lanes, z: Lanes) -> [Lanes; 4] {
    let a = ring.radius_m;
    let offset = Lanes::splat(a) - r;
    let u = z + -ring.height_m;
    let p = r * (2.0 * a);
    let u2 = u * u;
    let d2 = offset.mul_add::<FMA>(offset, u2);
    let q = d2 + p;
    let s2 = q + p;
    let (s, d) = (s2.sqrt(), d2.sqrt());
    let mut mean = (s + d) * 0.5;
    let mut geometric = (s * d).sqrt();
    let mut gamma = Lanes::splat(0.5) / mean;
    let mut tau = gamma * gamma;
    let quarter_p = p * 0.25;
    let mut weight = 1.0;
    for _ in 1..ring.agm_steps {
        let next = (mean + geometric) * 0.5;
        geometric = (mean * geometric).sqrt();
        mean = next;
        gamma = gamma * gamma * quarter_p / mean;
        weight *= 2.0;
        tau = (gamma * weight).mul_add::<FMA>(gamma, tau);
    }
    mean = (mean + geometric) * 0.5;
    let f = Lanes::splat(ring.current_a) / mean;
    let g = tau * f;
    let p2 = p * p;
    let shape = f - q * g;
    let remainder = q * f - p2 * g;
    let inverse = Lanes::splat(1.0) / (s2 * d2);
    let a2 = a * a;
    let b_z = (remainder * (2.0 * a2) - p2 * shape) * inverse;
    let dbz_du = u * inverse * ((f * a2 + p2 * g * 1.5) * 0.5 - q * b_z);
    let along = shape * inverse;
    let dbr_du = inverse * (shape - u2 * (g * 3.0 + q * along * 4.0)) * a2;
    [b_z * 0.25, dbz_du, dbr_du, u * along * a2]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::steel::CoreShape;
    use crate::steel::generatrix::{Generatrix, Resolution};
    use fluxform_base::units::MU_0_T_M_PER_A;

    fn core() -> MagnetizedCore {
        let shape = CoreShape {
            radius_m: 0.013,
            bottom_m: -0.11,
            top_m: 0.0,
        };
        let outline = Generatrix::new(shape, &[(-0.04, 0.003)], &Resolution::near_steel(1e-7));
        let density = outline
            .nodes
            .iter()
            .map(|n| 0.7 + (31.0 * n.z_m).sin() + 900.0 * n.r_m * n.r_m)
            .collect();
        MagnetizedCore::new(outline, density)
    }

    /// Every cell of a table took all nodes of the outline, each at every point.
    #[test]
    fn few_loops_have_the_field_of_all_nodes() {
        let core = core();
        let all = core.outline().nodes.len();
        let (mut most, mut least) = (0, usize::MAX);
        for tolerance in [1e-4, 1e-7, 1e-10] {
            for (r, z, size) in [
                (0.0, 0.001, 0.0004),
                (0.012, 0.002, 0.0006),
                (0.014, -0.05, 0.0005),
                (0.0131, -0.111, 0.0003),
                (0.02, 0.01, 0.005),
                (0.3, -0.2, 0.1),
            ] {
                let rectangle = Rectangle {
                    r_m: [r, r + size],
                    z_m: [z, z + size],
                };
                let loops = core.loops(rectangle, tolerance).unwrap();
                (most, least) = (most.max(loops.count()), least.min(loops.count()));
                let parts = [0.03, 0.41, 0.97];
                let (r_m, z_m): (Vec<f64>, Vec<f64>) = parts
                    .iter()
                    .flat_map(|u| parts.map(|v| (r + u * size, z + v * size)))
                    .unzip();
                let fields = loops.fields(&r_m, &z_m);
                for (k, (r, z)) in r_m.iter().zip(&z_m).enumerate() {
                    let exact = core.field(*r, *z);
                    let mu_0 = MU_0_T_M_PER_A;
                    let (field, gradient) = (exact.b_r.hypot(exact.b_z), exact.gradient_norm());
                    for (error, size) in [
                        (mu_0 * fields.b_z[k] - exact.b_z, field),
                        (mu_0 * fields.dbz_dz[k] - exact.dbz_dz, gradient),
                        (mu_0 * fields.dbr_dz_over_r[k] * r - exact.dbr_dz, gradient),
                        (mu_0 * fields.br_over_r[k] - exact.br_over_r, gradient),
                    ] {
                        assert!(
                            error.abs() < tolerance * size,
                            "{tolerance:e} at {r} {z}: {:e} by {} loops",
                            error.abs() / size,
                            loops.count()
                        );
                    }
                }
            }
        }
        assert!(least < 40 && 2 * most <= all, "{least} {most} of {all}");
    }
}
