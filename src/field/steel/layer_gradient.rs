//! The gradient of a double layer's potential off the outline, as matrices on the layer's nodes.
//!
//! (D v)(x) = int (1/4 pi) n'.(x - y)/|x - y|^3 v(y) dS for v cos(m theta), whose ring kernel is
//! s (A C - n_r r I) with I and C the azimuthal integrals of (chi - cos psi)^(-1/2) and ^(-3/2).
//! I' = -C/2 and Legendre's equation, C' = -2 ((m^2 - 1/4) I + chi C)/(chi^2 - 1), differentiate
//! it without a further integral.

use nalgebra::DMatrix;
use rayon::prelude::*;
use std::f64::consts::PI;

use super::double_layer::MAX_MODES;
use super::generatrix::{Face, Generatrix};
use fluxform_numerics::gauss;
use fluxform_numerics::lagrange_basis::Basis;
use fluxform_numerics::ring_functions::azimuthal_integrals;

/// Components of the gradient: d/dr, d/dz and m/r.
pub(crate) const COMPONENTS: usize = 3;
/// Targets that are one piece of work.
const CHUNK: usize = 16;

/// grad D for modes 0 to `modes` - 1 at `targets` = (r, z) m off the outline, r > 0.
///
/// For every mode [node, 3 target + component], 1/m: the transpose times the layer's values at
/// the nodes gives d/dr and d/dz of the factor of cos(m theta) (or sin), and m/r times it.
///
/// Error: each panel's quadrature below `tolerance` of the kernel's own size there; rounding
/// grows like 1/r towards the axis.
#[must_use]
pub(crate) fn gradient_operators(
    outline: &Generatrix,
    targets: &[(f64, f64)],
    modes: usize,
    tolerance: f64,
) -> Vec<DMatrix<f64>> {
    let modes = modes.min(MAX_MODES);
    let nodes = outline.nodes.len();
    let basis = Basis::new(gauss::rule(outline.order));
    // A chunk's values: [mode][target][component][node].
    let chunks: Vec<Vec<Vec<f64>>> = targets
        .par_chunks(CHUNK)
        .map(|chunk| {
            let mut columns = vec![vec![0.0; chunk.len() * COMPONENTS * nodes]; modes];
            for (place, target) in chunk.iter().enumerate() {
                fluxform_base::progress::poll();
                let start = place * COMPONENTS * nodes;
                let mut at: Vec<&mut [f64]> = columns
                    .iter_mut()
                    .map(|c| &mut c[start..start + COMPONENTS * nodes])
                    .collect();
                one_target(outline, &basis, *target, tolerance, &mut at);
            }
            columns
        })
        .collect();
    (0..modes)
        .map(|mode| {
            let mut values = Vec::with_capacity(targets.len() * COMPONENTS * nodes);
            for chunk in &chunks {
                values.extend_from_slice(&chunk[mode]);
            }
            DMatrix::from_vec(nodes, COMPONENTS * targets.len(), values)
        })
        .collect()
}

/// grad D for mode 0 alone, as [`gradient_operators`] has it, on the calling thread: for callers
/// that hold what another piece of parallel work may wait for.
#[must_use]
pub(crate) fn axial_gradient_operator(
    outline: &Generatrix,
    targets: &[(f64, f64)],
    tolerance: f64,
) -> DMatrix<f64> {
    let nodes = outline.nodes.len();
    let basis = Basis::new(gauss::rule(outline.order));
    let mut operator = DMatrix::zeros(nodes, COMPONENTS * targets.len());
    let columns = operator.as_mut_slice().chunks_mut(COMPONENTS * nodes);
    for (target, columns) in targets.iter().zip(columns) {
        one_target(outline, &basis, *target, tolerance, &mut [columns]);
    }
    operator
}

/// Adds one target's rows to `out`, [mode][component * nodes + node].
fn one_target(
    outline: &Generatrix,
    basis: &Basis,
    (r_m, z_m): (f64, f64),
    tolerance: f64,
    out: &mut [&mut [f64]],
) {
    let order = outline.order;
    let count = outline.nodes.len();
    let shape = outline.shape;
    let far = tolerance.powf(-0.5 / order as f64);
    let mut kernels = [[0.0; COMPONENTS]; MAX_MODES];
    let kernels = &mut kernels[..out.len()];
    let mut shares = vec![0.0; order];
    for (index, panel) in outline.panels.iter().enumerate() {
        let (foot, gap) = match panel.face {
            Face::Side => (z_m, r_m - shape.radius_m),
            Face::Bottom => (r_m, z_m - shape.bottom_m),
            Face::Top => (r_m, z_m - shape.top_m),
        };
        let (lo, hi) = panel.range_m();
        let (lo, hi) = (lo - foot, hi - foot);
        let first = index * order;
        if gauss::bernstein_radius(lo, hi, 0.0, gap) >= far {
            for (place, node) in outline.nodes[first..first + order].iter().enumerate() {
                let distance = [r_m - node.r_m, z_m - node.z_m];
                kernel_gradient(r_m, node.r_m, distance, node.normal, kernels);
                for (mode, kernel) in out.iter_mut().zip(kernels.iter()) {
                    for (component, value) in kernel.iter().enumerate() {
                        mode[component * count + first + place] += node.weight_m * value;
                    }
                }
            }
            continue;
        }
        let from = panel.from_m - foot;
        let length = panel.to_m - panel.from_m;
        let normal = shape.on(panel.face, 0.0).2;
        gauss::graded(lo, hi, gap, tolerance, |offset, weight| {
            let (source_r, distance) = match panel.face {
                Face::Side => (shape.radius_m, [gap, -offset]),
                Face::Bottom | Face::Top => (r_m + offset, [-offset, gap]),
            };
            kernel_gradient(r_m, source_r, distance, normal, kernels);
            basis.weights(2.0 * (offset - from) / length - 1.0, &mut shares);
            for (mode, kernel) in out.iter_mut().zip(kernels.iter()) {
                for (component, value) in kernel.iter().enumerate() {
                    let start = component * count + first;
                    for (slot, share) in mode[start..start + order].iter_mut().zip(&shares) {
                        *slot += weight * value * share;
                    }
                }
            }
        });
    }
}

/// d/dr, d/dz and m/r of the ring kernel of every mode, the source ring's radius included, 1/m^2.
///
/// `distance_m` is (r - r', z - z'), passed beside the radii so that it keeps its digits.
fn kernel_gradient(
    r_m: f64,
    source_r_m: f64,
    [dr_m, dz_m]: [f64; 2],
    normal: [f64; 2],
    out: &mut [[f64; COMPONENTS]],
) {
    let modes = out.len();
    let product = 2.0 * r_m * source_r_m;
    let excess = (dr_m * dr_m + dz_m * dz_m) / product;
    let (mut inverse, mut cubed) = ([0.0; MAX_MODES], [0.0; MAX_MODES]);
    azimuthal_integrals(excess, &mut inverse[..modes], &mut cubed[..modes]);
    let scale = source_r_m / (4.0 * PI * product * product.sqrt());
    let chi = 1.0 + excess;
    let below = 1.0 / (excess * (excess + 2.0));
    let chi_r = 2.0 * (dr_m - excess * source_r_m) / product;
    let chi_z = 2.0 * dz_m / product;
    let [n_r, n_z] = normal;
    let along = n_r * (dr_m * (r_m + source_r_m) + dz_m * dz_m) / (2.0 * source_r_m) + n_z * dz_m;
    let along_r = n_r * r_m / source_r_m;
    let along_z = n_r * dz_m / source_r_m + n_z;
    for (mode, slot) in out.iter_mut().enumerate() {
        let m = mode as f64;
        let (i, c) = (inverse[mode], cubed[mode]);
        let steeper = -2.0 * ((m * m - 0.25) * i + chi * c) * below;
        let value = along * c - n_r * r_m * i;
        // The derivative with respect to chi.
        let slope = along * steeper + 0.5 * n_r * r_m * c;
        *slot = [
            scale * (along_r * c - n_r * i + slope * chi_r - 1.5 * value / r_m),
            scale * (along_z * c + slope * chi_z),
            scale * m * value / r_m,
        ];
    }
}

#[cfg(test)]
mod tests {
    use super::super::CoreShape;
    use super::super::double_layer::kernel;
    use super::super::generatrix::Resolution;
    use super::super::magnetized::MagnetizedCore;
    use super::*;
    use fluxform_base::units::MU_0_T_M_PER_A;

    #[test]
    fn the_kernel_is_differentiated() {
        let normal = [0.6, -0.8];
        for (r, z, source_r, source_z) in [(0.7, 0.3, 1.3, -0.4), (0.9, 0.1, 0.4, 0.15)] {
            let value = |r: f64, z: f64| {
                let mut out = [0.0; 6];
                kernel(r, source_r, r - source_r, z - source_z, normal, &mut out);
                out
            };
            let mut gradient = [[0.0; COMPONENTS]; 6];
            let distance = [r - source_r, z - source_z];
            kernel_gradient(r, source_r, distance, normal, &mut gradient);
            let step = 1e-4;
            for (mode, slopes) in gradient.iter().enumerate() {
                // Fourth order.
                let difference = |at: &dyn Fn(f64) -> f64| {
                    (8.0 * (at(step) - at(-step)) - at(2.0 * step) + at(-2.0 * step))
                        / (12.0 * step)
                };
                let by_r = difference(&|h| value(r + h, z)[mode]);
                let by_z = difference(&|h| value(r, z + h)[mode]);
                let by_angle = mode as f64 * value(r, z)[mode] / r;
                for (found, expected) in slopes.iter().zip([by_r, by_z, by_angle]) {
                    assert!(
                        (found - expected).abs() < 1e-9 * (1.0 + expected.abs()),
                        "mode {mode} at {r}: {found} {expected}"
                    );
                }
            }
        }
    }

    /// Mode 0 against the surface currents of the same layer: another kernel altogether.
    #[test]
    fn a_layer_has_the_field_of_its_surface_currents() {
        let shape = CoreShape {
            radius_m: 0.7,
            bottom_m: -1.3,
            top_m: 0.4,
        };
        let outline = Generatrix::new(shape, &[], &Resolution::for_tolerance(1e-4));
        let density: Vec<f64> = outline
            .nodes
            .iter()
            .map(|n| (1.7 * n.z_m).sin() + 0.3 * n.r_m * n.r_m)
            .collect();
        let targets = [(0.01, -0.2), (0.6, 0.1), (0.69, 0.39), (0.3, -1.29)];
        let operator = gradient_operators(&outline, &targets, 1, 1e-9).remove(0);
        let found = operator.tr_mul(&nalgebra::DVector::from_column_slice(&density));
        let core = MagnetizedCore::new(outline, density);
        for (place, (r_m, z_m)) in targets.into_iter().enumerate() {
            let field = core.field(r_m, z_m);
            for (component, expected) in [field.b_r, field.b_z].into_iter().enumerate() {
                let found = MU_0_T_M_PER_A * found[COMPONENTS * place + component];
                let size = field.b_r.hypot(field.b_z);
                assert!(
                    (found - expected).abs() < 1e-7 * size,
                    "({r_m}, {z_m}) {component}: {found} {expected}"
                );
            }
        }
    }

    /// A layer of mode m that is r^m cos(m theta) on the outline, by a sum over the azimuth.
    #[test]
    fn transverse_modes_have_the_field_of_the_sum_over_the_azimuth() {
        let shape = CoreShape {
            radius_m: 0.7,
            bottom_m: -1.3,
            top_m: 0.4,
        };
        let outline = Generatrix::new(shape, &[], &Resolution::for_tolerance(1e-12));
        let (r, z, angle) = (0.35, -0.3, 0.9_f64);
        let operators = gradient_operators(&outline, &[(r, z)], 4, 1e-9);
        for (mode, operator) in operators.iter().enumerate() {
            let m = mode as f64;
            let layer =
                |node: &crate::steel::generatrix::Node| node.r_m.powf(m) * (1.0 + 0.5 * node.z_m);
            let density = nalgebra::DVector::from_iterator(
                outline.nodes.len(),
                outline.nodes.iter().map(layer),
            );
            let found = operator.tr_mul(&density);
            let (sin, cos) = (m * angle).sin_cos();
            let found = [found[0] * cos, -found[2] * sin, found[1] * cos];
            let mut expected = [0.0; 3];
            let count = 200;
            let radial = [angle.cos(), angle.sin(), 0.0];
            let around = [-angle.sin(), angle.cos(), 0.0];
            for node in &outline.nodes {
                for k in 0..count {
                    let psi = std::f64::consts::TAU * k as f64 / count as f64;
                    let area = node.r_m * node.weight_m * std::f64::consts::TAU / count as f64;
                    let n = [
                        node.normal[0] * psi.cos(),
                        node.normal[0] * psi.sin(),
                        node.normal[1],
                    ];
                    let d = [
                        r * angle.cos() - node.r_m * psi.cos(),
                        r * angle.sin() - node.r_m * psi.sin(),
                        z - node.z_m,
                    ];
                    let square: f64 = d.iter().map(|x| x * x).sum();
                    let along: f64 = n.iter().zip(&d).map(|(a, b)| a * b).sum();
                    let strength =
                        layer(node) * (m * psi).cos() * area / (4.0 * PI * square * square.sqrt());
                    let gradient: Vec<f64> = (0..3)
                        .map(|i| strength * (n[i] - 3.0 * along * d[i] / square))
                        .collect();
                    let dot =
                        |a: &[f64; 3]| a.iter().zip(&gradient).map(|(a, b)| a * b).sum::<f64>();
                    expected[0] += dot(&radial);
                    expected[1] += dot(&around);
                    expected[2] += gradient[2];
                }
            }
            for (found, expected) in found.iter().zip(expected) {
                assert!(
                    (found - expected).abs() < 1e-6,
                    "mode {mode}: {found} {expected}"
                );
            }
        }
    }
}
