//! Gauss-Legendre quadrature and the a-priori choice of its order.

use std::f64::consts::PI;
use std::sync::OnceLock;

/// Largest order that [`rule`] makes.
pub const MAX_ORDER: usize = 64;

/// Nodes and weights on [-1, 1], nodes ascending.
#[derive(Debug, Clone)]
pub struct Rule {
    /// Nodes.
    pub nodes: Vec<f64>,
    /// Weights; their sum is 2.
    pub weights: Vec<f64>,
}

/// The rule with `order` nodes, 1 to [`MAX_ORDER`]; made once and kept.
///
/// # Panics
/// When `order` is outside 1..=[`MAX_ORDER`].
#[must_use]
pub fn rule(order: usize) -> &'static Rule {
    static RULES: [OnceLock<Rule>; MAX_ORDER] = [const { OnceLock::new() }; MAX_ORDER];
    RULES[order - 1].get_or_init(|| make(order))
}

/// Newton's method on the Legendre recurrence, from Tricomi's starting values.
fn make(order: usize) -> Rule {
    let n = order as f64;
    let mut nodes = vec![0.0; order];
    let mut weights = vec![0.0; order];
    for i in 0..order.div_ceil(2) {
        let mut x = if 2 * i + 1 == order {
            0.0
        } else {
            (PI * (i as f64 + 0.75) / (n + 0.5)).cos() * (1.0 - (1.0 - 1.0 / n) / (8.0 * n * n))
        };
        let mut slope = legendre(order, x).1;
        for _ in 0..8 {
            let (value, derivative) = legendre(order, x);
            slope = derivative;
            let step = value / derivative;
            x -= step;
            if step.abs() <= f64::EPSILON {
                break;
            }
        }
        let weight = 2.0 / ((1.0 - x * x) * slope * slope);
        (nodes[i], nodes[order - 1 - i]) = (-x, x);
        (weights[i], weights[order - 1 - i]) = (weight, weight);
    }
    Rule { nodes, weights }
}

/// P_n(x) and its derivative.
fn legendre(order: usize, x: f64) -> (f64, f64) {
    let (mut before, mut value) = (1.0, x);
    for k in 2..=order {
        let k = k as f64;
        (before, value) = (
            value,
            ((2.0 * k - 1.0) * x * value - (k - 1.0) * before) / k,
        );
    }
    if order == 1 {
        return (x, 1.0);
    }
    (value, order as f64 * (x * value - before) / (x * x - 1.0))
}

/// Sum of the semi-axes of the ellipse with foci `lo` and `hi` (as -1 and 1) through `re + i im`:
/// the Bernstein radius that governs the rule's convergence for a function singular there.
#[must_use]
pub fn bernstein_radius(lo: f64, hi: f64, re: f64, im: f64) -> f64 {
    let half = 0.5 * (hi - lo);
    let sum = ((re - lo).hypot(im) + (re - hi).hypot(im)) / (2.0 * half);
    let sum = sum.max(1.0);
    sum + ((sum - 1.0) * (sum + 1.0)).sqrt()
}

/// The number of nodes whose error bound `scale * radius^(-2 n)` is at most `tolerance`;
/// `None` when that needs more than [`MAX_ORDER`].
///
/// For an integrand whose nearest singularities lie on the ellipse of Bernstein radius `radius`
/// the error of the n-point rule is at most a constant times `radius^(-2 n)` (Trefethen,
/// Approximation Theory and Approximation Practice, theorem 19.3); `scale` is that constant.
#[must_use]
pub fn order_for(radius: f64, scale: f64, tolerance: f64) -> Option<usize> {
    if radius <= 1.0 {
        return None;
    }
    let order = ((scale / tolerance).ln() / (2.0 * radius.ln()))
        .ceil()
        .max(1.0);
    (order <= MAX_ORDER as f64).then_some(order as usize)
}

/// Panels are halved until the singularities lie outside this Bernstein radius.
const PANEL_RADIUS: f64 = 2.8;
/// Closest singularity that panels are graded to, relative to the interval's farther end.
const NEAREST: f64 = 1e-18;
/// Constant of the bound `scale * radius^(-2 n)` for poles and logarithms.
const PANEL_SCALE: f64 = 4.0 * PI;

/// Visits nodes and weights on `lo..hi` for an integrand singular at `+- i distance` and
/// elsewhere no closer: the interval is cut at zero and halved until the singularities lie
/// outside each panel's ellipse of Bernstein radius 2.8; each panel's order then follows
/// from its own radius by [`order_for`].
pub fn graded(lo: f64, hi: f64, distance: f64, tolerance: f64, mut visit: impl FnMut(f64, f64)) {
    // An abscissa closer than that to a singularity at zero adds nothing to the sum in doubles.
    let distance = distance.abs().max(NEAREST * lo.abs().max(hi.abs()));
    if lo < 0.0 && hi > 0.0 {
        panels(lo, 0.0, distance, tolerance, &mut visit);
        panels(0.0, hi, distance, tolerance, &mut visit);
    } else {
        panels(lo, hi, distance, tolerance, &mut visit);
    }
}

fn panels(lo: f64, hi: f64, distance: f64, tolerance: f64, visit: &mut impl FnMut(f64, f64)) {
    let radius = bernstein_radius(lo, hi, 0.0, distance);
    let middle = 0.5 * (lo + hi);
    if radius < PANEL_RADIUS && lo < middle && middle < hi {
        panels(lo, middle, distance, tolerance, visit);
        panels(middle, hi, distance, tolerance, visit);
        return;
    }
    panel(lo, hi, radius, tolerance, visit);
}

/// Visits nodes and weights of one panel `lo..hi` for an integrand whose singularities lie
/// outside the ellipse of Bernstein radius `radius`, with an error below `tolerance`.
pub fn panel(lo: f64, hi: f64, radius: f64, tolerance: f64, visit: &mut impl FnMut(f64, f64)) {
    // One node more: on a wide ellipse the integrand may grow like the square of its size.
    let order = order_for(radius, PANEL_SCALE, tolerance).unwrap_or(MAX_ORDER);
    let rule = rule((order + 1).min(MAX_ORDER));
    let half = 0.5 * (hi - lo);
    for (x, weight) in rule.nodes.iter().zip(&rule.weights) {
        // From the nearer end, so that nodes close to zero keep their digits.
        let node = if *x < 0.0 {
            lo + half * (1.0 + x)
        } else {
            hi - half * (1.0 - x)
        };
        visit(node, half * weight);
    }
}
