//! The coil as a body that its current heats, against sums by hand.

use std::f64::consts::PI;

use fluxform_base::heating::Cooling;
use fluxform_coil::circuit::Circuit;
use fluxform_coil::heat::warm_coil;
use fluxform_field::winding::Winding;

const WINDING: Winding = Winding {
    inner_radius_m: 0.012,
    outer_radius_m: 0.019,
    length_m: 0.1,
    turns: 1429.0,
};
const CIRCUIT: Circuit = Circuit {
    turns: 1429.0,
    resistance_ohm: 6.0,
    inductance_h: 0.1,
    wire_length_m: 139.0,
    wire_mass_kg: 0.5,
};
const COOLING: Cooling = Cooling {
    surface_w_per_m2_k: 12.0,
    ambient_c: 45.0,
    winding_max_c: 155.0,
    heating_s: 60.0,
};

fn near(found: f64, by_hand: f64) {
    assert!(
        (found / by_hand - 1.0).abs() < 1e-12,
        "{found}, not {by_hand}"
    );
}

#[test]
fn mantle_and_ends_of_a_coil_with_a_core_lose_heat() {
    let found = warm_coil(&WINDING, &CIRCUIT, 70.0, 0.4, &COOLING);
    // Copper's resistance by 3.93e-3 of that at 20 C a degree, from 70 C to the air's 45 C.
    let [at_air, at_wire] = [1.0 + 3.93e-3 * 25.0, 1.0 + 3.93e-3 * 50.0];
    near(found.resistance_ohm, 6.0 * at_air / at_wire);
    near(found.growth_per_k, 3.93e-3 / at_air);
    near(found.capacity_j_per_k, 385.0 * 0.5 + 460.0 * 0.4);
    let (mantle_m2, end_m2) = (2.0 * PI * 0.019 * 0.1, PI * 0.019 * 0.019);
    near(found.loss_w_per_k, 12.0 * (mantle_m2 + 2.0 * end_m2));
}

#[test]
fn a_hollow_coil_has_ring_shaped_ends() {
    let solid = warm_coil(&WINDING, &CIRCUIT, 20.0, 0.4, &COOLING);
    let hollow = warm_coil(&WINDING, &CIRCUIT, 20.0, 0.0, &COOLING);
    let bores_m2 = 2.0 * PI * 0.012 * 0.012;
    near(solid.loss_w_per_k - hollow.loss_w_per_k, 12.0 * bores_m2);
    near(
        solid.capacity_j_per_k - hollow.capacity_j_per_k,
        460.0 * 0.4,
    );
}
