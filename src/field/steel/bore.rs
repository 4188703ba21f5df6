//! The winding's own field in its bore, to a tolerance: quicker than to full double precision.

use crate::ring::{RingPoint, ring_field};
use crate::winding::{OnEdge, Winding, sheet_end};
use fluxform_base::units::MU_0_T_M_PER_A;
use fluxform_numerics::gauss;

/// Windings shorter than this share of their outer radius, whose two faces cancel, are left to
/// [`Winding::field`].
const SHORT: f64 = 0.2;

/// (B_r, B_z) per ampere at radius `r_m` and height `z_m` above the top face, T/A.
///
/// A winding is half-infinite current sheets that end at its two faces. In the bore, and within
/// an outer radius of its ends, they are integrated over the radii to `tolerance` relative to
/// one sheet's field; elsewhere [`Winding::field`] is evaluated.
///
/// # Errors
/// A point on the winding's edge.
pub fn bore_field(
    winding: &Winding,
    r_m: f64,
    z_m: f64,
    tolerance: f64,
) -> Result<(f64, f64), OnEdge> {
    let (lo, hi) = (winding.inner_radius_m - r_m, winding.outer_radius_m - r_m);
    let bottom_m = z_m + winding.length_m;
    let reach = winding.outer_radius_m;
    let near = lo >= 0.0 && z_m < reach && bottom_m > -reach;
    if !near || winding.length_m < SHORT * reach {
        return winding.field(r_m, z_m).map(|field| (field.b_r, field.b_z));
    }
    let (mut radial, mut axial) = (0.0, 0.0);
    for (u_m, sign) in [(bottom_m, 1.0), (z_m, -1.0)] {
        gauss::graded(lo, hi, u_m, tolerance, |offset_m, weight| {
            let radius_m = r_m + offset_m;
            let ring = ring_field(RingPoint {
                radius_m,
                r_m,
                offset_m,
                u_m,
            });
            radial -= sign * weight * ring.a_phi_over_r;
            axial += sign * weight * sheet_end(radius_m, r_m, offset_m, u_m);
        });
    }
    let scale = MU_0_T_M_PER_A * winding.current_density_per_m2();
    Ok((scale * r_m * radial, scale * axial))
}

/// Windings as short as this share of their outer radius are still summed sheet by sheet by
/// [`nested_bore_fields`]: what cancels there is taken off the tolerance.
const SHORTEST: f64 = 1e-4;

/// [`bore_field`] of several windings that share inner radius and length, outer radii ascending:
/// what lies between two outer radii is integrated once for all that hold it.
///
/// # Errors
/// A point on a winding's edge.
pub(crate) fn nested_bore_fields(
    windings: &[Winding],
    r_m: f64,
    z_m: f64,
    tolerance: f64,
) -> Result<Vec<(f64, f64)>, OnEdge> {
    let mut fields = Vec::with_capacity(windings.len());
    let (mut radial, mut axial) = (0.0, 0.0);
    let mut summed_m = windings.first().map_or(0.0, |w| w.inner_radius_m) - r_m;
    for winding in windings {
        let reach = winding.outer_radius_m;
        let bottom_m = z_m + winding.length_m;
        let near = winding.inner_radius_m >= r_m && z_m < reach && bottom_m > -reach;
        if !near || winding.length_m < SHORTEST * reach {
            fields.push(bore_field(winding, r_m, z_m, tolerance)?);
            continue;
        }
        let cancelled = (winding.length_m / (SHORT * reach)).min(1.0);
        let hi = reach - r_m;
        for (u_m, sign) in [(bottom_m, 1.0), (z_m, -1.0)] {
            gauss::graded(
                summed_m,
                hi,
                u_m,
                tolerance * cancelled,
                |offset_m, weight| {
                    let radius_m = r_m + offset_m;
                    let ring = ring_field(RingPoint {
                        radius_m,
                        r_m,
                        offset_m,
                        u_m,
                    });
                    radial -= sign * weight * ring.a_phi_over_r;
                    axial += sign * weight * sheet_end(radius_m, r_m, offset_m, u_m);
                },
            );
        }
        summed_m = hi;
        let scale = MU_0_T_M_PER_A * winding.current_density_per_m2();
        fields.push((scale * r_m * radial, scale * axial));
    }
    Ok(fields)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nested_windings_have_the_fields_of_each() {
        for (length_m, inner_radius_m) in [(0.1, 0.012), (0.0007, 0.012), (0.03, 1e-4)] {
            let windings = [0.013, 0.0161, 0.021].map(|outer_radius_m| Winding {
                inner_radius_m,
                outer_radius_m,
                length_m,
                turns: 0.7,
            });
            for across in [1e-3, 0.4, 0.91, 0.9999] {
                for along in [-31.0, -1.6, -1.1, -1.0, -0.93, -0.5, 0.0, 0.001, 1.7, 31.0] {
                    let (r_m, z_m) = (across * inner_radius_m, along * length_m);
                    let all = nested_bore_fields(&windings, r_m, z_m, 1e-7).expect("no edge");
                    for (winding, (b_r, b_z)) in windings.iter().zip(all) {
                        let sure = winding.field(r_m, z_m).expect("no edge");
                        let error = (b_r - sure.b_r).hypot(b_z - sure.b_z);
                        assert!(
                            error < 1e-6 * sure.b_r.hypot(sure.b_z),
                            "{winding:?} ({r_m}, {z_m}): {b_r} {b_z} against {sure:?}"
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn agrees_with_the_sure_way() {
        for (length_m, inner_radius_m) in [(0.1, 0.012), (0.005, 0.012), (0.03, 1e-4), (1.3, 0.019)]
        {
            let winding = Winding {
                inner_radius_m,
                outer_radius_m: 0.021,
                length_m,
                turns: 700.0,
            };
            for across in [1e-3, 0.4, 0.91, 0.9999] {
                for along in [-1.6, -1.1, -1.0, -0.93, -0.5, 0.0, 0.001, 0.2, 1.7] {
                    let (r_m, z_m) = (across * inner_radius_m, along * length_m);
                    let sure = winding.field(r_m, z_m).expect("no edge");
                    let (b_r, b_z) = bore_field(&winding, r_m, z_m, 1e-7).expect("no edge");
                    let error = (b_r - sure.b_r).hypot(b_z - sure.b_z);
                    assert!(
                        error < 1e-6 * sure.b_r.hypot(sure.b_z),
                        "{winding:?} ({r_m}, {z_m}): {b_r} {b_z} against {sure:?}"
                    );
                }
            }
        }
    }
}
