//! Defaults of a design.

use std::path::{Path, PathBuf};

use fluxform_design::bh_table::read_bh_table;
use fluxform_design::{Coupling, Design, Limits, MagnetModel, Need, Polarity, Steel};
use fluxform_numerics::axis::Axis;

use crate::support::{CORED, SOUND, but, read, sound, sound_but};

fn committed(file: &str) -> Design {
    let repository = Path::new(env!("CARGO_MANIFEST_DIR")).ancestors().nth(2);
    let path = repository.unwrap().join(file);
    let (design, warnings) = Design::read(&path, Need::CALIBRATE).unwrap();
    assert!(warnings.is_empty(), "{warnings}");
    design
}

fn axes(design: &Design) -> [Axis; 3] {
    let space = &design.workspace;
    [space.x_m, space.y_m, space.z_m]
}

#[test]
fn keys_left_out_take_the_values_that_every_key_shows() {
    let every = committed("tests/fixtures/design/every_key.toml");
    let least = sound(&format!(
        "{SOUND}[core]\n[array]\n[magnet]\n[supply]\n[limits]\n[target]\n[workspace]\n"
    ));
    assert_eq!(least.core, every.core);
    assert_eq!(least.array, every.array);
    assert_eq!(least.magnet, every.magnet);
    assert_eq!(least.target_height_m, every.target_height_m);
    assert_eq!(axes(&least), axes(&every));
    assert_eq!(least.supply.current_max_a, every.supply.current_max_a);
    assert_eq!(least.supply.current_min_a, every.supply.current_min_a);
    assert_eq!(
        least.wire.conductor_diameter_m,
        every.wire.conductor_diameter_m
    );
    assert_eq!(least.wire.resistivity_ohm_m, every.wire.resistivity_ohm_m);
    assert_eq!(least.wire.temperature_c, every.wire.temperature_c);
    // Keys without a default are absent.
    assert_eq!(
        (least.supply.total_current_max_a, least.supply.voltage_v),
        (None, None)
    );
    assert_eq!(least.limits, Limits::default());
    assert_eq!(least.coil.unwrap().turns, None);
    assert!(least.wire.choices_m.is_empty());
}

#[test]
fn every_key_arrives_in_si() {
    let d = committed("tests/fixtures/design/every_key.toml");
    let coil = d.coil.unwrap();
    assert_eq!(
        (coil.inner_diameter_m, coil.outer_diameter_m, coil.length_m),
        (0.024, 0.038, 0.1)
    );
    assert_eq!(coil.turns, Some(1429.0));
    assert_eq!(
        (d.wire.diameter_m, d.wire.choices_m),
        (0.0007, vec![0.0005, 0.0007])
    );
    let core = d.core.unwrap();
    assert_eq!(
        (core.clearance_m, core.above_m, core.below_m),
        (0.0, 0.0, 0.01)
    );
    assert_eq!(
        (core.steel, core.knee_t),
        (Steel::Linear(1000.0), Some(1.5))
    );
    assert_eq!(core.conductivity_s_per_m, 5.8e6);
    assert_eq!(d.magnet.magnetization_a_per_m, 1.1579e6);
    assert_eq!((d.magnet.diameter_m, d.magnet.length_m), (0.01, 0.01));
    assert_eq!(
        (d.magnet.polarity, d.magnet.model),
        (Polarity::Repel, MagnetModel::Dipole)
    );
    assert_eq!(
        (d.magnet.tilt_deg, d.magnet.passive_force),
        ([0.0, 0.0], false)
    );
    assert_eq!(d.supply.current_max_a, vec![2.0; 9]);
    assert_eq!(
        (d.supply.total_current_max_a, d.supply.voltage_v),
        (Some(18.0), Some(36.0))
    );
    let limits = Limits {
        resistance_max_ohm: Some(6.0),
        settling_max_s: Some(0.1),
        outer_diameter_max_m: Some(0.038),
        inner_diameter_min_m: Some(0.002),
        length_max_m: Some(0.1),
        power_max_w: Some(50.0),
        mass_max_kg: Some(1.0),
        wire_length_max_m: Some(200.0),
        core_field_max_t: Some(1.6),
        ..Limits::default()
    };
    assert_eq!(d.limits, limits);
    assert_eq!(d.target_height_m, 0.03);
    let z = d.workspace.z_m;
    assert_eq!((z.from, z.to, z.samples), (0.01, 0.08, 29));
}

#[test]
fn sections_left_out_are_one_air_coil_at_the_origin() {
    let d = sound(SOUND);
    let every = committed("tests/fixtures/design/every_key.toml");
    assert_eq!(axes(&d), axes(&every));
    assert!(!d.workspace.is_given && every.workspace.is_given);
    assert_eq!(d.core, None);
    assert_eq!(
        (d.array.positions_m, d.array.grid, d.array.gain),
        (vec![[0.0; 2]], None, vec![1.0])
    );
    assert_eq!(d.array.coupling, Coupling::None);
    assert_eq!(d.supply.current_max_a, vec![2.0]);
    assert_eq!(d.magnet, every.magnet);
}

#[test]
fn cores_are_coupled_unless_the_file_says_otherwise() {
    assert_eq!(sound(CORED).array.coupling, Coupling::Full);
    let alone = but(CORED, "rows = 2", "rows = 2\ncoupling = \"none\"");
    assert_eq!(sound(&alone).array.coupling, Coupling::None);
}

#[test]
fn the_committed_designs_differ_by_the_core() {
    let (seed, air) = (
        committed("designs/seed.toml"),
        committed("designs/seed_air.toml"),
    );
    assert_eq!(
        (seed.name.as_str(), air.name.as_str()),
        ("seed", "seed_air")
    );
    assert_eq!(
        (seed.array.coupling, air.array.coupling),
        (Coupling::Full, Coupling::None)
    );
    assert!(seed.core.is_some() && air.core.is_none());
    assert_eq!(
        (seed.coil, &seed.supply, seed.limits),
        (air.coil, &air.supply, air.limits)
    );
    assert_eq!(seed.array.positions_m[5], [0.05, 0.0]);
    assert_eq!(seed.array.positions_m[6], [-0.05, 0.05]);
    let grid = seed.array.grid.unwrap();
    assert_eq!((grid.rows, grid.columns, grid.pitch_m), (3, 3, 0.05));
}

#[test]
fn one_number_holds_for_all_coils_and_a_list_for_each() {
    let one = sound(&format!(
        "{CORED}[supply]\ncurrent_max_a = 3\ncurrent_min_a = [0, -1, 0, -1.3, 0, 0]\n"
    ));
    assert_eq!(one.supply.current_max_a, vec![3.0; 6]);
    assert_eq!(one.supply.current_min_a, [0.0, -1.0, 0.0, -1.3, 0.0, 0.0]);
}

#[test]
fn positions_stand_in_the_file_s_order() {
    let d = sound(&format!(
        "{SOUND}[array]\npositions_mm = [[70, -3.3], [0.7, 41.25]]\n"
    ));
    assert_eq!(d.array.positions_m, [[0.07, -0.0033], [0.0007, 0.04125]]);
    assert_eq!((d.array.grid, d.array.gain), (None, vec![1.0, 1.0]));
}

#[test]
fn the_steel_s_table_lies_beside_the_design() {
    let text = format!("{SOUND}[core]\nbh_curve = \"steel/1010.csv\"\n");
    let steel = |path: &str| {
        let (design, _) = Design::from_toml(&text, Path::new(path), Need::EVALUATE).unwrap();
        design.core.unwrap().steel
    };
    assert_eq!(
        steel("a/b/d.toml"),
        Steel::Curve(PathBuf::from("a/b/steel/1010.csv"))
    );
    assert_eq!(steel("-"), Steel::Curve(PathBuf::from("steel/1010.csv")));
    let absolute = sound_but(
        "diameter_mm = 0.7",
        "diameter_mm = 0.7\n[core]\nbh_curve = \"/s.csv\"",
    );
    assert_eq!(
        sound(&absolute).core.unwrap().steel,
        Steel::Curve(PathBuf::from("/s.csv"))
    );
}

#[test]
fn a_curve_has_its_own_knee_unless_the_file_names_one() {
    let knee = |keys: &str| {
        sound(&format!("{SOUND}[core]\n{keys}"))
            .core
            .unwrap()
            .knee_t
    };
    assert_eq!(knee(""), Some(1.5));
    assert_eq!(knee("relative_permeability = 1300\n"), Some(1.5));
    assert_eq!(knee("bh_curve = \"s.csv\"\n"), None);
    assert_eq!(knee("bh_curve = \"s.csv\"\nknee_t = 1.3\n"), Some(1.3));
}

#[test]
fn the_curve_s_design_is_the_seed_but_for_its_steel() {
    let (seed, mut curve) = (
        committed("designs/seed.toml"),
        committed("designs/seed_1010.toml"),
    );
    let core = curve.core.as_mut().unwrap();
    let Steel::Curve(table) = &core.steel else {
        panic!("{:?}", core.steel)
    };
    assert_eq!(read_bh_table(table).unwrap().b_t.len(), 38);
    core.steel = Steel::Linear(1000.0);
    core.knee_t = Some(1.5);
    curve.name = seed.name.clone();
    curve.assumed = seed.assumed.clone();
    assert_eq!(curve, seed);
}

#[test]
fn only_some_commands_need_the_coil() {
    let text = "name = \"a\"\n[wire]\ndiameter_mm = 0.7\n[core]\n[array]\n";
    for need in [Need::OPTIMIZE, Need::SWEEP] {
        let (design, warnings) = read(text, need).unwrap();
        assert!(warnings.is_empty() && design.coil.is_none());
        assert_eq!(design.array.positions_m.len(), 9);
    }
    for need in [
        Need::EVALUATE,
        Need::PROBE,
        Need::MAP,
        Need::LAMBDA,
        Need::CALIBRATE,
    ] {
        let faults = read(text, need).unwrap_err().plain();
        assert!(
            faults.starts_with("d.toml:1:1: error: coil: this key is required and missing"),
            "{faults}"
        );
    }
}

/// A gauge was taken for the diameter over the insulation of a wire with a thinner conductor.
#[test]
fn regression_a_gauge_among_wires_to_choose_from_was_another_gauge() {
    let with = "diameter_mm = 0.7\nconductor_diameter_mm = 0.65\nchoices_mm = [\"AWG 24\", 0.56]";
    let wire = sound(&sound_but("diameter_mm = 0.7", with)).wire;
    let conductors_m = wire.choices_m.iter().map(|over_m| over_m * 0.65 / 0.7);
    let conductors_m: Vec<f64> = conductors_m.collect();
    // 0.127 mm x 92^((36 - 24) / 39), ASTM B 258.
    for (found, known) in conductors_m.iter().zip([5.105_596e-4, 5.2e-4]) {
        assert!((found / known - 1.0).abs() < 1e-6, "{conductors_m:?}");
    }
}
