//! The winding of rectangular section: field and gradient to full double precision anywhere.
//!
//! Uniform current density J = N / ((a2 - a1) L) per ampere over a1 <= r <= a2, -L <= z <= 0.
//! A cylindrical current sheet is a stack of loops, so its axial derivatives telescope to the
//! difference of two loops' fields at the end faces, and the winding is one radial integral of
//! that difference:
//!
//! ```text
//! dB_z/dz = -mu_0 J int [b_z(a; r, z) - b_z(a; r, z + L)] da,   likewise dB_r/dz with b_r,
//! B_r     =  mu_0 J int [A(a; r, z) - A(a; r, z + L)] da,
//! B_z     =  mu_0 J / pi int [f(a; r, z + L) - f(a; r, z)] da,
//! ```
//!
//! with f(u) = a u / ((a + r) s) cel(d/s, g^2, 1, g), g = (a - r)/(a + r) (Derby and Olbert,
//! Am. J. Phys. 78, 229, 2010). div B = 0 and curl B = mu_0 J give the other components.
//! Where the winding is short against the distance the differences would lose digits: there the
//! loops' own derivatives are integrated along z.

use serde::{Deserialize, Serialize};

use std::f64::consts::PI;

use ellip::cel;

use super::ring::{RingField, RingPoint, ring_field};
use fluxform_base::units::MU_0_T_M_PER_A;
use fluxform_numerics::dual::Dual;
use fluxform_numerics::gauss;

/// Relative error of the exact kernel of an air coil, held by tests against 40-digit values.
pub const KERNEL_ERROR: f64 = 1e-12;

/// A winding of rectangular section, top face at z = 0.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Winding {
    /// Inner radius a1, m; 0 <= a1 < a2.
    pub inner_radius_m: f64,
    /// Outer radius a2, m.
    pub outer_radius_m: f64,
    /// Length L, m; > 0.
    pub length_m: f64,
    /// Number of turns N.
    pub turns: f64,
}

/// Field and gradient in cylindrical coordinates, per ampere.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct AxialField {
    /// B_r, T/A.
    pub b_r: f64,
    /// B_z, T/A.
    pub b_z: f64,
    /// dB_r/dr, T/m/A.
    pub dbr_dr: f64,
    /// dB_r/dz, T/m/A.
    pub dbr_dz: f64,
    /// (dB_r/dz) / r, T/m^2/A; finite on the axis.
    pub dbr_dz_over_r: f64,
    /// dB_z/dr, T/m/A; differs from dB_r/dz by mu_0 J inside the conductor.
    pub dbz_dr: f64,
    /// dB_z/dz, T/m/A.
    pub dbz_dz: f64,
    /// B_r / r, T/m/A: the azimuthal component of the gradient.
    pub br_over_r: f64,
}

impl AxialField {
    /// Frobenius norm of the gradient tensor, T/m/A.
    #[must_use]
    pub fn gradient_norm(&self) -> f64 {
        [
            self.dbr_dr,
            self.dbr_dz,
            self.dbz_dr,
            self.dbz_dz,
            self.br_over_r,
        ]
        .iter()
        .map(|g| g * g)
        .sum::<f64>()
        .sqrt()
    }
}

impl std::ops::Add for AxialField {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            b_r: self.b_r + other.b_r,
            b_z: self.b_z + other.b_z,
            dbr_dr: self.dbr_dr + other.dbr_dr,
            dbr_dz: self.dbr_dz + other.dbr_dz,
            dbr_dz_over_r: self.dbr_dz_over_r + other.dbr_dz_over_r,
            dbz_dr: self.dbz_dr + other.dbz_dr,
            dbz_dz: self.dbz_dz + other.dbz_dz,
            br_over_r: self.br_over_r + other.br_over_r,
        }
    }
}

/// A point at which the gradient does not exist: on one of the winding's four edges, where it
/// grows like the logarithm of the distance.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error(
    "the point at r = {r_m} m, z = {z_m} m lies on an edge of a winding, where the gradient is \
     unbounded; move it by a nanometre"
)]
pub struct OnEdge {
    /// Distance from the coil's axis, m.
    pub r_m: f64,
    /// Height above the winding's top face, m.
    pub z_m: f64,
}

/// Target of the quadratures' a-priori bound, relative; below it double rounding dominates.
const TOLERANCE: f64 = 1e-15;
/// Shorter than this multiple of the distance, a winding is integrated along z.
const SHORT: f64 = 0.5;
/// A winding shorter than this multiple of its depth is a thin disc.
const THIN: f64 = 0.01;
/// Farther than this multiple of the outer radius, the field is integrated along z.
const FAR: f64 = 0.1;
/// Farther than this multiple of its size a winding is a dipole to a double's digits, while its
/// length is lost in the rounding of the distance.
const DIPOLE: f64 = 1e9;
/// In the plane of a face the integrals are principal values: their limit from outside is taken
/// at this multiple of the outer radius.
const FACE_LIMIT: f64 = 1e-18;

impl Winding {
    /// Current density per ampere, 1/m^2.
    #[must_use]
    pub fn current_density_per_m2(&self) -> f64 {
        self.turns / ((self.outer_radius_m - self.inner_radius_m) * self.length_m)
    }

    /// Radii of the winding's section below and above `r_m`: offsets a - r of its two edges, m.
    pub(crate) fn offsets_m(&self, r_m: f64) -> (f64, f64) {
        (self.inner_radius_m - r_m, self.outer_radius_m - r_m)
    }

    /// Distance from the section's rectangle, m; 0 inside.
    #[must_use]
    pub fn distance_m(&self, r_m: f64, z_m: f64) -> f64 {
        let (lo, hi) = self.offsets_m(r_m);
        let radial = lo.max(-hi).max(0.0);
        radial.hypot(z_m.max(-self.length_m - z_m).max(0.0))
    }

    /// No derivative of third order along straight lines, of a component of B per ampere, is larger at
    /// heights `z_m` > 0 above the top face and radii between `r_m`, T/m^3/A.
    ///
    /// B is mu_0/(4 pi) int dl x R/R^3, a sum of first derivatives of 1/R, and the fourth derivatives of a
    /// harmonic 1/R along any four unit vectors are at most 4!/R^5: Legendre polynomials are at most 1, and
    /// the largest value of a symmetric form is one with equal vectors. The wire is taken at the least distance
    /// of the section, slice by slice, so the bound is a few times the largest derivative.
    #[must_use]
    pub fn third_derivative_bound(&self, [r_low_m, r_high_m]: [f64; 2], z_m: f64) -> f64 {
        const SLICE: f64 = 1.1;
        if z_m <= 0.0 {
            return f64::INFINITY;
        }
        let apart_m = (self.inner_radius_m - r_high_m)
            .max(r_low_m - self.outer_radius_m)
            .max(0.0);
        let bottom_m = z_m + self.length_m;
        let (mut top_m, mut sum) = (z_m, 0.0);
        while top_m < bottom_m {
            let next_m = (SLICE * top_m).min(bottom_m);
            let square = top_m * top_m + apart_m * apart_m;
            sum += (next_m - top_m) / (square * square * square.sqrt());
            top_m = next_m;
        }
        let wire_per_m =
            PI * (self.inner_radius_m + self.outer_radius_m) * self.turns / self.length_m;
        MU_0_T_M_PER_A / (4.0 * PI) * 24.0 * wire_per_m * sum
    }

    /// Field and all gradient components per ampere at radius `r_m` >= 0 and height `z_m` above
    /// the top face, anywhere: outside, in the bore, inside the conductor.
    ///
    /// Error: below 1e-12 of |grad B| (of |B| for the field), sampled in the tests against
    /// 40-digit values; inside a disc thinner than a hundredth of its depth, or on its faces,
    /// that ratio's digits are lost. On a boundary of the conductor the outer values are given.
    ///
    /// # Errors
    /// [`OnEdge`] on the winding's edges.
    pub fn field(&self, r_m: f64, z_m: f64) -> Result<AxialField, OnEdge> {
        self.field_to(r_m, z_m, TOLERANCE)
    }

    /// As [`Winding::field`], with quadratures to `tolerance` of what they sum: in a fraction of the time.
    ///
    /// # Errors
    /// [`OnEdge`] on the winding's edges.
    pub(crate) fn field_to(
        &self,
        r_m: f64,
        z_m: f64,
        tolerance: f64,
    ) -> Result<AxialField, OnEdge> {
        fluxform_base::progress::poll();
        let (lo, hi) = self.offsets_m(r_m);
        let bottom_m = z_m + self.length_m;
        if (lo == 0.0 || hi == 0.0) && (z_m == 0.0 || bottom_m == 0.0) {
            return Err(OnEdge { r_m, z_m });
        }
        let distance_m = self.distance_m(r_m, z_m);
        if distance_m > DIPOLE * (self.outer_radius_m + self.length_m) {
            return Ok(self.dipole(r_m, z_m));
        }
        let outside = distance_m > 0.0;
        let short = self.length_m < SHORT * distance_m;
        let thin = outside && self.length_m < THIN * (hi - lo);
        let sums = if short || thin {
            self.along_z([r_m, z_m], tolerance, Want::FieldAndGradient)
        } else {
            let limit = FACE_LIMIT * self.outer_radius_m;
            // Far above, the faces' solid angles cancel; beside the winding they do not.
            let by_faces = distance_m <= FAR * self.outer_radius_m || hi < 0.0;
            // Outside: above the top face, below the bottom face.
            let face = |u_m: f64, outside: f64| {
                self.face(
                    [r_m, away_from_zero(u_m, limit, outside)],
                    tolerance,
                    by_faces,
                )
            };
            let (top, bottom) = (face(z_m, 1.0), face(bottom_m, -1.0));
            Sums {
                b_z: if by_faces {
                    bottom.sheet - top.sheet
                } else {
                    self.along_z([r_m, z_m], tolerance, Want::FieldOnly).b_z
                },
                b_r_over_r: top.a_phi_over_r - bottom.a_phi_over_r,
                dbz_dz: bottom.b_z - top.b_z,
                dbr_dz_over_r: bottom.b_r_over_r - top.b_r_over_r,
            }
        };
        let scale = MU_0_T_M_PER_A * self.current_density_per_m2();
        let inside = lo < 0.0 && hi > 0.0 && z_m < 0.0 && bottom_m > 0.0;
        let dbz_dz = scale * sums.dbz_dz;
        let br_over_r = scale * sums.b_r_over_r;
        let dbr_dz_over_r = scale * sums.dbr_dz_over_r;
        let dbr_dz = dbr_dz_over_r * r_m;
        Ok(AxialField {
            b_r: br_over_r * r_m,
            b_z: scale * sums.b_z,
            dbr_dr: -br_over_r - dbz_dz,
            dbr_dz,
            dbr_dz_over_r,
            dbz_dr: if inside { dbr_dz - scale } else { dbr_dz },
            dbz_dz,
            br_over_r,
        })
    }

    /// The field per ampere of the winding's moment, N pi (a1^2 + a1 a2 + a2^2) / 3, in its
    /// middle. Error: relative, a few times the square of its size over the distance.
    fn dipole(&self, r_m: f64, z_m: f64) -> AxialField {
        let z_m = z_m + 0.5 * self.length_m;
        let d = r_m.hypot(z_m);
        if d.is_infinite() {
            return AxialField::default();
        }
        let (a1, a2) = (self.inner_radius_m, self.outer_radius_m);
        let moment_m2 = self.turns * PI * (a1 * a1 + a1 * a2 + a2 * a2) / 3.0;
        let (sin, cos) = (r_m / d, z_m / d);
        // One division after the other: d^3 may be beyond a double where its quotient is not.
        let field = MU_0_T_M_PER_A * moment_m2 / (4.0 * PI) / d / d / d;
        let gradient = 3.0 * field / d;
        let dbz_dz = gradient * cos * (3.0 - 5.0 * cos * cos);
        let dbr_dz_over_r = gradient * (1.0 - 5.0 * cos * cos) / d;
        let br_over_r = gradient * cos;
        let dbr_dz = gradient * sin * (1.0 - 5.0 * cos * cos);
        AxialField {
            b_r: 3.0 * field * sin * cos,
            b_z: field * (3.0 * cos * cos - 1.0),
            dbr_dr: -br_over_r - dbz_dz,
            dbr_dz,
            dbr_dz_over_r,
            dbz_dr: dbr_dz,
            dbz_dz,
            br_over_r,
        }
    }

    /// dB_z/dz and (dB_r/dz)/r per ampere by another route than [`Winding::field`]: the loops'
    /// own derivatives integrated over the whole section. Slower; made to check the first.
    /// Domain: outside the conductor.
    #[must_use]
    pub fn gradient_by_section(&self, r_m: f64, z_m: f64) -> (f64, f64) {
        let sums = self.along_z([r_m, z_m], TOLERANCE, Want::FieldAndGradient);
        let scale = MU_0_T_M_PER_A * self.current_density_per_m2();
        (scale * sums.dbz_dz, scale * sums.dbr_dz_over_r)
    }

    /// Nodes over the section's radii for loops `u_m` below a point: offset a - r, radius a and
    /// weight. Near the section the offset keeps its digits, farther off the radius does.
    fn for_each_radius(
        &self,
        [r_m, u_m]: [f64; 2],
        tolerance: f64,
        mut visit: impl FnMut(f64, f64, f64),
    ) {
        let (lo, hi) = self.offsets_m(r_m);
        let width = self.outer_radius_m - self.inner_radius_m;
        if lo.max(-hi) > width {
            let (a1, a2) = (self.inner_radius_m, self.outer_radius_m);
            let radius = gauss::bernstein_radius(a1, a2, r_m, u_m);
            gauss::panel(a1, a2, radius, tolerance, &mut |a, weight| {
                visit(a - r_m, a, weight);
            });
        } else {
            // The width as rounded against r.
            let stretch = width / (hi - lo);
            gauss::graded(lo, hi, u_m, tolerance, |offset, weight| {
                visit(offset, r_m + offset, stretch * weight);
            });
        }
    }

    /// Radial integrals over the loops of one end face, `u_m` below the point.
    fn face(&self, [r_m, u_m]: [f64; 2], tolerance: f64, with_sheet: bool) -> Face {
        let mut face = Face::default();
        self.for_each_radius([r_m, u_m], tolerance, |offset_m, radius_m, weight| {
            let ring = ring_field(RingPoint {
                radius_m,
                r_m,
                offset_m,
                u_m,
            });
            face.b_z += weight * ring.b_z;
            face.b_r_over_r += weight * ring.b_r_over_r;
            face.a_phi_over_r += weight * ring.a_phi_over_r;
            if with_sheet {
                face.sheet += weight * sheet_end(radius_m, r_m, offset_m, u_m);
            }
        });
        face
    }

    /// Double integral over the section of the loops' own fields and axial derivatives.
    fn along_z(&self, [r_m, z_m]: [f64; 2], tolerance: f64, want: Want) -> Sums {
        let (lo, hi) = self.offsets_m(r_m);
        let radial_gap = lo.max(-hi).max(0.0);
        let mut sums = Sums::default();
        // The length as rounded against a large height.
        let stretch = self.length_m / ((z_m + self.length_m) - z_m);
        // u = z - z' runs over [z, z + L]; the loops are singular at u = +- i |a - r|.
        gauss::graded(
            z_m,
            z_m + self.length_m,
            radial_gap,
            tolerance,
            |u_m, weight_z| {
                // and at one height at a - r = +- i u.
                self.for_each_radius([r_m, u_m], tolerance, |offset_m, radius_m, weight_r| {
                    let weight = stretch * weight_z * weight_r;
                    match want {
                        Want::FieldOnly => {
                            let ring = ring_field(RingPoint {
                                radius_m,
                                r_m,
                                offset_m,
                                u_m,
                            });
                            sums.b_z += weight * ring.b_z;
                        }
                        Want::FieldAndGradient => {
                            let u_m = Dual::variable(u_m);
                            let RingField {
                                b_z, b_r_over_r, ..
                            } = ring_field(RingPoint {
                                radius_m,
                                r_m,
                                offset_m,
                                u_m,
                            });
                            sums.b_z += weight * b_z.re;
                            sums.b_r_over_r += weight * b_r_over_r.re;
                            sums.dbz_dz += weight * b_z.du;
                            sums.dbr_dz_over_r += weight * b_r_over_r.du;
                        }
                    }
                });
            },
        );
        sums
    }
}

/// Quantities that the axial quadrature must give.
#[derive(Clone, Copy)]
enum Want {
    FieldOnly,
    FieldAndGradient,
}

/// The section's integrals, over mu_0 J.
#[derive(Default)]
struct Sums {
    b_z: f64,
    b_r_over_r: f64,
    dbz_dz: f64,
    dbr_dz_over_r: f64,
}

/// One face's radial integrals.
#[derive(Default)]
struct Face {
    b_z: f64,
    b_r_over_r: f64,
    a_phi_over_r: f64,
    sheet: f64,
}

/// `value`, but no closer to zero than `limit`, on the side `sign` when it is zero.
fn away_from_zero(value: f64, limit: f64, sign: f64) -> f64 {
    if value == 0.0 {
        sign * limit
    } else if value.abs() < limit {
        value.signum() * limit
    } else {
        value
    }
}

/// Half-infinite sheet's B_z over mu_0 K: a u / (pi (a + r) s) cel(d/s, g^2, 1, g); in the sheet, where it
/// jumps, the mean of both sides.
pub(super) fn sheet_end(a: f64, r: f64, offset: f64, u: f64) -> f64 {
    let sum = a + r;
    if sum == 0.0 {
        return 0.5 * u.signum();
    }
    if u == 0.0 {
        return 0.0;
    }
    let s = sum.hypot(u);
    let kc = offset.hypot(u) / s;
    let g = offset / sum;
    let value = if g < 0.0 {
        cel_outside(kc, 4.0 * a * r / (s * s), -g)
    } else {
        // The part of g alone jumps; a square of it below the least number is that of zero.
        let square = g * g;
        let (p, b) = if square == 0.0 {
            (1.0, 1.0)
        } else {
            (square, g)
        };
        cel(kc, p, 1.0, b).unwrap_or(f64::NAN)
    };
    a * u / (PI * sum * s) * value
}

/// cel(kc, g^2, 1, -g) for 0 < g < 1, where the integrand changes sign and its integral is
/// small: Bulirsch's iteration with h = b + a em, which the result is proportional to, carried
/// along in place of b, and eta = em - kc in place of kc. `k2` = 1 - kc^2.
fn cel_outside(kc: f64, k2: f64, g: f64) -> f64 {
    let (mut kc, mut eta) = (kc, k2 / (1.0 + kc));
    let (mut em, mut p, mut a, mut h) = (1.0, g, 1.0, 0.0);
    loop {
        let b = h - a * em;
        let next_h = (1.0 + em / p) * (2.0 * h - eta * a) - eta * h / p;
        a += b / p;
        h = next_h;
        let e = kc * em;
        p += e / p;
        let converged = eta <= 1e-9 * em;
        eta = (eta / (em.sqrt() + kc.sqrt())).powi(2);
        em += kc;
        if converged {
            return 0.5 * PI * h / (em * (em + p));
        }
        kc = 2.0 * e.sqrt();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fluxform_testing::Random;

    #[test]
    fn a_coarser_rule_is_off_by_its_tolerance() {
        let mut random = Random::new(23_u64);
        let mut worst = 0.0_f64;
        for trial in 0..3000 {
            let inner_radius_m = 0.02 * random.unit();
            let winding = Winding {
                inner_radius_m,
                outer_radius_m: inner_radius_m + 0.001 + 0.02 * random.unit(),
                length_m: 0.002 + 0.1 * random.unit(),
                turns: 700.0,
            };
            let reach = [0.03, 0.1, 1.0][trial % 3];
            let (r_m, z_m) = (reach * random.unit(), reach * (2.0 * random.unit() - 1.2));
            let Ok(exact) = winding.field(r_m, z_m) else {
                continue;
            };
            let tolerance = [1e-3, 1e-5, 1e-7][trial / 3 % 3];
            let coarse = winding.field_to(r_m, z_m, tolerance).unwrap();
            let field_off =
                (coarse.b_r - exact.b_r).hypot(coarse.b_z - exact.b_z) / exact.b_r.hypot(exact.b_z);
            let gradient_off = [
                coarse.dbz_dz - exact.dbz_dz,
                coarse.dbr_dz - exact.dbr_dz,
                coarse.br_over_r - exact.br_over_r,
            ];
            let gradient_off = gradient_off
                .iter()
                .fold(0.0, |most: f64, v| most.max(v.abs()))
                / exact.gradient_norm();
            worst = worst.max(field_off.max(gradient_off) / tolerance);
        }
        assert!(worst <= 1.0, "{worst}");
    }
}
