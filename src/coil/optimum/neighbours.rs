//! Effect of an array's other, unpowered cores on one coil: factors of its force and inductance.
//!
//! Factors vary slowly with the coil's dimensions. They are computed at one coil, with their slopes,
//! and taken as powers of the dimensions while the coil alone is optimised; again at what comes
//! out, until it no longer moves: then values and slopes are those of the coupled array.

use fluxform_field::components::Components;
use fluxform_field::steel::CoreShape;
use fluxform_field::steel::array::CoupledArray;
use fluxform_field::steel::clearance::Clearance;
use fluxform_field::steel::cored_coil::CoredCoil;
use fluxform_field::steel::equivalent_dipoles::ArraySources;
use fluxform_field::winding::Winding;

/// Relative accuracy of the coupled solution.
const TOLERANCE: f64 = 1e-3;

/// An array, and the one of its coils that is optimised: the nearest to its centre, which the
/// neighbours change most. All coils are alike.
#[derive(Debug, Clone, PartialEq)]
pub struct Neighbours {
    positions_m: Vec<[f64; 2]>,
    drive: usize,
    /// Smallest distance of two axes, m.
    pub spacing_m: f64,
}

impl Neighbours {
    /// `None` for fewer than two coils.
    #[must_use]
    pub fn new(positions_m: &[[f64; 2]]) -> Option<Self> {
        if positions_m.len() < 2 {
            return None;
        }
        let count = positions_m.len() as f64;
        let centre = [0, 1].map(|i| positions_m.iter().map(|p| p[i]).sum::<f64>() / count);
        let distance = |p: &[f64; 2], q: &[f64; 2]| (p[0] - q[0]).hypot(p[1] - q[1]);
        let drive = (0..positions_m.len()).min_by(|&i, &j| {
            distance(&positions_m[i], &centre).total_cmp(&distance(&positions_m[j], &centre))
        })?;
        let mut spacing_m = f64::INFINITY;
        for (index, p) in positions_m.iter().enumerate() {
            for q in &positions_m[index + 1..] {
                spacing_m = spacing_m.min(distance(p, q));
            }
        }
        Some(Self {
            positions_m: positions_m.to_vec(),
            drive,
            spacing_m,
        })
    }

    /// The coil that is optimised.
    #[must_use]
    pub fn drive(&self) -> usize {
        self.drive
    }

    /// Factor of the neighbours in the steel's and winding's force on dipoles (height, moment)
    /// above the coil's own axis by, and its inductance, of which the winding's own is
    /// `air_inductance_h`; `None` where cores touch or the solution fails.
    #[must_use]
    pub fn factors(
        &self,
        alone: &CoredCoil,
        relative_permeability: f64,
        dipoles: &[(f64, f64)],
        air_inductance_h: f64,
    ) -> Option<[f64; 2]> {
        let winding: &Winding = &alone.winding;
        let shape: CoreShape = alone.core.outline().shape;
        if 2.0 * shape.radius_m >= self.spacing_m {
            return None;
        }
        let lowest_m = dipoles.iter().fold(f64::INFINITY, |z, d| z.min(d.0));
        let array = CoupledArray::new(
            winding,
            shape,
            relative_permeability,
            &self.positions_m,
            TOLERANCE,
            lowest_m,
        )
        .ok()?;
        // Above every core: their heights alone say how far the dipoles are.
        let sources =
            ArraySources::of_array(&array, Clearance::above(lowest_m, 0.0), 0.1 * TOLERANCE);
        let [x, y] = self.positions_m[self.drive];
        let points: Vec<[f64; 3]> = dipoles.iter().map(|d| [x, y, d.0]).collect();
        let mut steel = vec![0.0; self.positions_m.len() * points.len()];
        sources.sample(&points, Components::Gz, &mut steel);
        let steel = &steel[self.drive * points.len()..(self.drive + 1) * points.len()];
        let (mut among, mut by_itself) = (0.0, 0.0);
        for (&(z_m, moment), steel) in dipoles.iter().zip(steel) {
            let air = winding.field(0.0, z_m).ok()?.dbz_dz;
            among += moment * (air + steel);
            by_itself += moment * (air + alone.core.field(0.0, z_m).dbz_dz);
        }
        let added_h = array.added_inductance_h[(self.drive, self.drive)];
        let factors = [
            among / by_itself,
            (air_inductance_h + added_h) / (air_inductance_h + alone.added_inductance_h),
        ];
        let good = |f: &f64| f.is_finite() && *f > 0.0;
        factors.iter().all(good).then_some(factors)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_seed_s_array_as_measured_by_other_means() {
        let places = [-0.05, 0.0, 0.05];
        let positions_m: Vec<[f64; 2]> = places
            .iter()
            .flat_map(|&y| places.map(|x| [x, y]))
            .collect();
        let neighbours = Neighbours::new(&positions_m).expect("nine coils");
        assert_eq!(neighbours.drive, 4);
        let winding = Winding {
            inner_radius_m: 0.012,
            outer_radius_m: 0.019,
            length_m: 0.1,
            turns: 1429.0,
        };
        let shape = CoreShape {
            radius_m: 0.012,
            bottom_m: -0.11,
            top_m: 0.0,
        };
        let alone = CoredCoil::new(&winding, shape, 1000.0, 1e-5, 0.03).expect("off the edges");
        let factors = neighbours
            .factors(&alone, 1000.0, &[(0.03, -0.9)], 0.014_501_9)
            .expect("cores apart");
        // Finite elements and a modal prototype: gradient and inductance of the centre coil.
        let requested = [0.4719 / 0.428_229, 0.2129 / 0.184_092];
        for (factor, requested) in factors.iter().zip(requested) {
            assert!((factor / requested - 1.0).abs() < 2e-3, "{factors:?}");
        }
        assert_eq!(Neighbours::new(&positions_m[..1]), None);
    }
}
