//! What sources send to the exchange grid of a core some way off.

use nalgebra::DMatrix;
use std::f64::consts::{PI, TAU};

use super::response::{Response, Ring};
use crate::field::winding::Winding;
use crate::numerics::gauss;
use crate::numerics::ring_functions::azimuthal_integrals;
use crate::units::MU_0_T_M_PER_A;

/// Points and outer normals of an exchange grid, index = angle * rings + ring.
#[must_use]
pub fn grid_points(response: &Response) -> Vec<([f64; 3], [f64; 3])> {
    (0..response.angles)
        .flat_map(|k| {
            let (s, c) = (TAU * k as f64 / response.angles as f64).sin_cos();
            response.exchange.rings.iter().map(move |ring: &Ring| {
                let [n_r, n_z] = ring.normal;
                (
                    [ring.r_m * c, ring.r_m * s, ring.z_m],
                    [n_r * c, n_r * s, n_z],
                )
            })
        })
        .collect()
}

/// Potential at the grid of a core at `offset_m` from the sender, for unit moments on the
/// sender's grid: -(1/4 pi) n'.(x - y)/|x - y|^3 dtheta, [receiver, sender].
#[must_use]
pub fn between_cores(
    points: &[([f64; 3], [f64; 3])],
    angles: usize,
    offset_m: [f64; 2],
) -> DMatrix<f64> {
    let scale = -TAU / angles as f64 / (4.0 * PI);
    let mut matrix = DMatrix::zeros(points.len(), points.len());
    for (mut column, (y, n)) in matrix.column_iter_mut().zip(points) {
        for (value, (x, _)) in column.iter_mut().zip(points) {
            let d = [
                x[0] + offset_m[0] - y[0],
                x[1] + offset_m[1] - y[1],
                x[2] - y[2],
            ];
            let square = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
            let along = n[0] * d[0] + n[1] * d[1] + n[2] * d[2];
            *value = scale * along / (square * square.sqrt());
        }
    }
    matrix
}

/// The winding's potential (A/A) and normal flux density n.B (T/A) per ampere at the grid of a
/// core at `offset_m` from the winding's axis.
///
/// Outside its bore the winding is two charged discs: it has the field of the magnetisation
/// M_z(r) = J (a2 - max(r, a1)) between its faces.
#[must_use]
pub fn from_winding(
    winding: &Winding,
    points: &[([f64; 3], [f64; 3])],
    offset_m: [f64; 2],
    tolerance: f64,
) -> (Vec<f64>, Vec<f64>) {
    let (a1, a2) = (winding.inner_radius_m, winding.outer_radius_m);
    let density = winding.current_density_per_m2();
    let nearest = points
        .iter()
        .map(|(x, _)| (x[0] + offset_m[0]).hypot(x[1] + offset_m[1]))
        .fold(f64::INFINITY, f64::min);
    let mut discs = Vec::new();
    for (lo, hi) in [(0.0, a1), (a1, a2)] {
        if hi <= lo {
            continue;
        }
        let radius = gauss::bernstein_radius(lo, hi, nearest.max(hi), 0.0);
        gauss::panel(lo, hi, radius, tolerance, &mut |r, weight| {
            discs.push((r, weight * density * (a2 - r.max(a1))));
        });
    }
    points
        .iter()
        .map(|(x, n)| {
            let (dx, dy) = (x[0] + offset_m[0], x[1] + offset_m[1]);
            let r = dx.hypot(dy);
            let (mut potential, mut slope_r, mut slope_z) = (0.0, 0.0, 0.0);
            for (height, sign) in [(0.0, 1.0), (-winding.length_m, -1.0)] {
                let u = x[2] - height;
                for (source_r, charge) in &discs {
                    let product = 2.0 * r * source_r;
                    let difference = r - source_r;
                    let excess = (difference * difference + u * u) / product;
                    let (mut inverse, mut cubed) = ([0.0], [0.0]);
                    azimuthal_integrals(excess, &mut inverse, &mut cubed);
                    let scale = sign * charge * source_r / (4.0 * PI * product.sqrt());
                    potential += scale * inverse[0];
                    // r - r' cos psi = r - r' chi + r' (chi - cos psi).
                    let radial = (r * r - source_r * source_r - u * u) / (2.0 * r);
                    let scale = scale / product;
                    slope_r -= scale * (radial * cubed[0] + source_r * inverse[0]);
                    slope_z -= scale * u * cubed[0];
                }
            }
            let (c, s) = (dx / r, dy / r);
            let normal = slope_r * (n[0] * c + n[1] * s) + slope_z * n[2];
            (potential, -MU_0_T_M_PER_A * normal)
        })
        .unzip()
}
