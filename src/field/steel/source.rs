//! A winding with its core as one axisymmetric source, for maps.

use super::sources::{ArraySources, Parts};
use crate::field::batch::{Gradients, Wanted};
use crate::field::source::AxialSource;
use crate::field::winding::{OnEdge, Winding};

/// Distance from the axis at which what vanishes on it is divided by the distance, in outer
/// radii: rounding and curvature are both below 1e-8 there.
const AXIS: f64 = 1e-4;

/// A winding and the dipoles that stand for its core, per ampere.
#[derive(Debug, Clone)]
pub struct CoredSource {
    /// The winding.
    pub winding: Winding,
    /// The core, standing at the origin.
    pub steel: ArraySources,
}

impl CoredSource {
    fn sample(&self, r_m: &[f64], z_m: &[f64], parts: Parts) -> (Vec<f64>, Vec<f64>) {
        let floor_m = AXIS * self.winding.outer_radius_m;
        let radii: Vec<f64> = r_m.iter().map(|r| r.max(floor_m)).collect();
        let points: Vec<[f64; 3]> = radii.iter().zip(z_m).map(|(r, z)| [*r, 0.0, *z]).collect();
        let mut values = vec![0.0; parts.count() * points.len()];
        self.steel.sample(&points, parts, &mut values);
        (radii, values)
    }
}

impl AxialSource for CoredSource {
    fn gradients(
        &self,
        r_m: &[f64],
        z_m: &[f64],
        tolerance: f64,
        wanted: Wanted,
    ) -> Result<Gradients, OnEdge> {
        let mut out = self.winding.gradients(r_m, z_m, tolerance, wanted)?;
        let count = r_m.len();
        if wanted == Wanted::Gz {
            let (_, values) = self.sample(r_m, z_m, Parts::Gz);
            for (sum, value) in out.dbz_dz.iter_mut().zip(&values) {
                *sum += value;
            }
            return Ok(out);
        }
        let (radii, values) = self.sample(r_m, z_m, Parts::Gradient);
        for i in 0..count {
            let part = |component: usize| values[component * count + i];
            out.dbz_dz[i] += part(4);
            out.dbr_dz_over_r[i] += part(2) / radii[i];
            // On the x axis dB_y/dy = B_r/r, and the trace vanishes.
            out.br_over_r[i] -= part(0) + part(4);
        }
        Ok(out)
    }

    fn axial_fields(&self, r_m: &[f64], z_m: &[f64], tolerance: f64) -> Result<Vec<f64>, OnEdge> {
        let mut out = self.winding.axial_fields(r_m, z_m, tolerance)?;
        let (_, values) = self.sample(r_m, z_m, Parts::All);
        for (sum, value) in out.iter_mut().zip(&values[7 * r_m.len()..]) {
            *sum += value;
        }
        Ok(out)
    }

    fn top_m(&self) -> f64 {
        self.steel.top_m().max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::field::steel::CoreShape;
    use crate::field::steel::cored_coil::CoredCoil;

    #[test]
    fn it_is_the_winding_and_its_core_on_the_axis_and_off() {
        let winding = Winding {
            inner_radius_m: 0.012,
            outer_radius_m: 0.019,
            length_m: 0.05,
            turns: 700.0,
        };
        let shape = CoreShape {
            radius_m: 0.011,
            bottom_m: -0.053,
            top_m: 0.001,
        };
        let coil = CoredCoil::new(&winding, shape, 300.0, 1e-3, 0.03).expect("off the edges");
        let source = CoredSource {
            winding,
            steel: ArraySources::of_core(&coil.core, 0.03, 0.029, 1e-7),
        };
        let (r_m, z_m) = (
            [0.0, 1e-9, 0.002, 0.0113, 0.031],
            [0.03, 0.034, 0.03, 0.05, 0.037],
        );
        let all = source.gradients(&r_m, &z_m, 1e-9, Wanted::Gradient);
        let all = all.expect("off the edges");
        let one = source
            .gradients(&r_m, &z_m, 1e-9, Wanted::Gz)
            .expect("off the edges");
        let along = source
            .axial_fields(&r_m, &z_m, 1e-9)
            .expect("off the edges");
        let top = coil.field(0.0, 0.03).expect("off the edges");
        for i in 0..r_m.len() {
            let exact = coil.field(r_m[i], z_m[i]).expect("off the edges");
            let gradient = top.dbz_dz.abs();
            for (found, wanted, size) in [
                (all.dbz_dz[i], exact.dbz_dz, gradient),
                (one.dbz_dz[i], exact.dbz_dz, gradient),
                (all.br_over_r[i], exact.br_over_r, gradient),
                (all.dbr_dz_over_r[i], exact.dbr_dz_over_r, gradient / 0.03),
                (along[i], exact.b_z, top.b_z.abs()),
            ] {
                let error = (found - wanted).abs() / size;
                assert!(error < 1e-6, "{i}: {found} {wanted} {error:e}");
            }
        }
        assert_eq!(source.top_m(), 0.001);
    }
}
