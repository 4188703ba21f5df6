//! Common parts of the tests: designs, the oracles, and how a difference is measured.

use fluxform_base::units::MU_0_T_M_PER_A;
use fluxform_field::steel::CoreShape;
use fluxform_field::steel::cored_coil::CoredCoil;
use fluxform_field::winding::Winding;
use fluxform_testing::{Random, committed};
use serde_json::Value;

pub const SEED_COIL: Winding = Winding {
    inner_radius_m: 0.012,
    outer_radius_m: 0.019,
    length_m: 0.1,
    turns: 1429.0,
};
pub const SEED_CORE: CoreShape = CoreShape {
    radius_m: 0.012,
    bottom_m: -0.11,
    top_m: 0.0,
};

/// A coil, its core and the core's permeability.
#[derive(Debug, Clone, Copy)]
pub struct Design {
    pub winding: Winding,
    pub core: CoreShape,
    pub mu_r: f64,
}

impl Design {
    pub fn solve(&self, tolerance: f64) -> CoredCoil {
        CoredCoil::new(
            &self.winding,
            self.core,
            self.mu_r,
            tolerance,
            self.lowest_m(),
        )
        .expect("off the winding's edges")
    }

    /// Height from which fields are compared: half a radius above coil and core.
    pub fn lowest_m(&self) -> f64 {
        self.core.top_m.max(0.0) + 0.5 * self.core.radius_m
    }

    /// Largest difference of the gradients at and above the lowest height, relative to the
    /// largest |grad B| at the same height, and of the added inductances.
    pub fn difference(&self, a: &CoredCoil, b: &CoredCoil) -> f64 {
        let mut worst = inductance_difference(a, b);
        for height in [0.0, 0.6, 1.7, 5.3] {
            let z_m = self.lowest_m() + height * self.core.radius_m;
            let (mut size, mut difference) = (0.0_f64, 0.0_f64);
            for across in [0.0, 0.4, 0.9, 1.3, 2.2] {
                let r_m = across * self.core.radius_m;
                let (f, g) = (a.core.field(r_m, z_m), b.core.field(r_m, z_m));
                size = size.max(a.field(r_m, z_m).expect("above").gradient_norm());
                difference = difference
                    .max((f.dbz_dz - g.dbz_dz).abs())
                    .max((f.dbr_dz - g.dbr_dz).abs())
                    .max((f.br_over_r - g.br_over_r).abs());
            }
            worst = worst.max(difference / size);
        }
        worst
    }
}

/// Difference of the added inductances, relative to theirs and to a winding's own.
pub fn inductance_difference(a: &CoredCoil, b: &CoredCoil) -> f64 {
    let own = 0.1 * MU_0_T_M_PER_A * a.winding.turns.powi(2) * a.winding.inner_radius_m;
    let (a, b) = (a.added_inductance_h, b.added_inductance_h);
    (a - b).abs() / a.abs().max(own)
}

/// Generic designs: coils from thimble to plate, cores longer and shorter than them, recessed
/// and protruding, weakly and strongly magnetic.
pub fn designs(count: usize) -> Vec<Design> {
    let mut random = Random::new(20_260_713);
    (0..count)
        .map(|_| {
            let inner_radius_m = random.decades(0.002, 0.03);
            let length_m = random.decades(0.006, 0.15);
            let top_m = random.between(-0.4, 0.4) * length_m;
            Design {
                winding: Winding {
                    inner_radius_m,
                    outer_radius_m: inner_radius_m + random.decades(0.001, 0.02),
                    length_m,
                    turns: random.between(100.0, 2000.0).round(),
                },
                core: CoreShape {
                    radius_m: inner_radius_m * random.between(0.3, 0.999),
                    bottom_m: top_m - length_m * random.decades(0.2, 2.0),
                    top_m,
                },
                mu_r: random.decades(3.0, 10_000.0),
            }
        })
        .collect()
}

/// A committed oracle, `tests/oracles/steel/<name>.json`.
pub fn oracle(name: &str) -> Value {
    serde_json::from_str(&committed(&format!("tests/oracles/steel/{name}.json"))).expect("JSON")
}

pub fn number(value: &Value) -> f64 {
    value.as_f64().expect("number")
}
