//! Designs whose parts do not fit together.

use fluxform_design::Need;

use crate::support::{CORED, SOUND, but, read, refused, sound_but, warned};

/// Each design has one fault, and this is said of it.
fn says(need: Need, cases: &[(String, &str)]) {
    for (text, expected) in cases {
        assert_eq!(refused(text, need), [*expected], "of\n{text}");
    }
}

#[test]
fn the_winding_has_a_thickness() {
    says(
        Need::EVALUATE,
        &[
            (
                sound_but("outer_diameter_mm = 38.0", "outer_diameter_mm = 23.3"),
                "d.toml:4:21: error: coil.outer_diameter_mm: the outer diameter, 23.3 mm, must exceed the inner one, 24 mm (are the two swapped?)",
            ),
            (
                sound_but("outer_diameter_mm = 38.0", "outer_diameter_mm = 24.0"),
                "d.toml:4:21: error: coil.outer_diameter_mm: the outer diameter, 24 mm, must exceed the inner one, 24 mm (are the two swapped?)",
            ),
            (
                sound_but("inner_diameter_mm = 24.0", "inner_diameter_mm = 0"),
                "d.toml:3:21: error: coil.inner_diameter_mm: expected a number greater than 0, found 0 mm",
            ),
            (
                sound_but("length_mm = 100.0", "length_mm = -0.7"),
                "d.toml:5:13: error: coil.length_mm: expected a number greater than 0, found -0.7 mm",
            ),
            (
                sound_but("100.0", "100.0\nturns = -3"),
                "d.toml:6:9: error: coil.turns: expected a number greater than 0, found -3",
            ),
        ],
    );
}

#[test]
fn the_wire_fits_the_winding() {
    says(
        Need::EVALUATE,
        &[
            (
                sound_but("diameter_mm = 0.7", "diameter_mm = 7.3"),
                "d.toml:7:15: error: wire.diameter_mm: the wire, 7.3 mm, is thicker than the winding's radial build, 7 mm ((38 - 24) / 2; take a thinner wire or a larger winding)",
            ),
            (
                sound_but("length_mm = 100.0", "length_mm = 0.6"),
                "d.toml:7:15: error: wire.diameter_mm: the wire, 0.7 mm, is thicker than the winding's length, 0.6 mm (coil.length_mm; take a thinner wire or a larger winding)",
            ),
            (
                sound_but(
                    "diameter_mm = 0.7",
                    "diameter_mm = 0.7\nconductor_diameter_mm = 0.71",
                ),
                "d.toml:8:25: error: wire.conductor_diameter_mm: the conductor, 0.71 mm, is thicker than the insulated wire, 0.7 mm (diameter_mm is measured over the insulation)",
            ),
        ],
    );
    // One layer that just touches both walls: (12.7 - 11.3) / 2 is a rounding below 0.7.
    let one_layer = sound_but("inner_diameter_mm = 24.0", "inner_diameter_mm = 11.3");
    let one_layer = but(
        &one_layer,
        "outer_diameter_mm = 38.0",
        "outer_diameter_mm = 12.7",
    );
    assert!(read(&one_layer, Need::EVALUATE).is_ok());
}

#[test]
fn the_wire_is_of_this_world() {
    says(
        Need::EVALUATE,
        &[
            (
                sound_but("0.7", "0.7\ntemperature_c = -300"),
                "d.toml:8:17: error: wire.temperature_c: expected at least -234.4 C, found -300 C",
            ),
            (
                sound_but("0.7", "0.7\nresistivity_ohm_m = 0"),
                "d.toml:8:21: error: wire.resistivity_ohm_m: expected a number greater than 0, found 0 ohm m",
            ),
            (
                sound_but("0.7", "0.7\nchoices_mm = [0.5, -0.7]"),
                "d.toml:8:20: error: wire.choices_mm[1]: expected a number greater than 0, found -0.7 mm",
            ),
            (
                sound_but("0.7", "0.7\nchoices_mm = []"),
                "d.toml:8:14: error: wire.choices_mm: expected a list of numbers, found an empty list (leave the key out for its default)",
            ),
        ],
    );
}

#[test]
fn limits_and_currents_have_a_sign() {
    says(
        Need::EVALUATE,
        &[
            (
                format!("{SOUND}[limits]\nresistance_max_ohm = -6\n"),
                "d.toml:9:22: error: limits.resistance_max_ohm: expected a number greater than 0, found -6 ohm",
            ),
            (
                format!("{SOUND}[supply]\ncurrent_max_a = -2\n"),
                "d.toml:9:17: error: supply.current_max_a: expected 0 or more, found -2 A",
            ),
            (
                format!("{SOUND}[supply]\ncurrent_min_a = [0.7]\n"),
                "d.toml:9:18: error: supply.current_min_a[0]: expected 0 or less, found 0.7 A",
            ),
            (
                format!("{SOUND}[supply]\ntotal_current_max_a = -18\n"),
                "d.toml:9:23: error: supply.total_current_max_a: expected 0 or more, found -18 A",
            ),
            (
                format!("{SOUND}[supply]\nvoltage_v = 0\n"),
                "d.toml:9:13: error: supply.voltage_v: expected a number greater than 0, found 0 V",
            ),
            (
                format!("{SOUND}[magnet]\nmagnetization_a_per_m = -1.1e6\n"),
                "d.toml:9:25: error: magnet.magnetization_a_per_m: expected a number greater than 0, found -1100000 A/m",
            ),
            (
                format!("{SOUND}[magnet]\ntilt_deg = [0.7, 200]\n"),
                "d.toml:9:18: error: magnet.tilt_deg[1]: expected between -180 and 180 degrees, found 200 degrees",
            ),
        ],
    );
    for key in [
        "resistance_max_ohm",
        "settling_max_ms",
        "outer_diameter_max_mm",
        "inner_diameter_min_mm",
        "length_max_mm",
        "power_max_w",
        "mass_max_kg",
        "wire_length_max_m",
        "core_field_max_t",
    ] {
        let said = refused(&format!("{SOUND}[limits]\n{key} = -1.3\n"), Need::EVALUATE);
        assert!(
            said[0].contains(&format!(
                "limits.{key}: expected a number greater than 0, found -1.3"
            )),
            "{said:?}"
        );
    }
}

#[test]
fn lists_have_one_entry_a_coil() {
    says(
        Need::EVALUATE,
        &[
            (
                format!("{CORED}[supply]\ncurrent_max_a = [2, 2, 2]\n"),
                "d.toml:14:17: error: supply.current_max_a: expected one entry a coil, 6 coils, found 3 (one number stands for all coils)",
            ),
            (
                but(CORED, "pitch_mm = 41.0", "gain = [0.98, 1.01]"),
                "d.toml:12:8: error: array.gain: expected one entry a coil, 6 coils, found 2 (leave it out for a gain of 1 everywhere)",
            ),
            (
                format!("{SOUND}[supply]\ncurrent_min_a = [-2, -2]\n"),
                "d.toml:9:17: error: supply.current_min_a: expected one entry a coil, 1 coil, found 2 (one number stands for all coils)",
            ),
        ],
    );
}

#[test]
fn coils_touch_but_never_overlap_where_they_are_placed() {
    let crowded = but(CORED, "pitch_mm = 41.0", "pitch_mm = 30.7");
    let message = "array.pitch_mm: coils 0 and 1 overlap: their axes are 30.7 mm apart, the outer diameter is 38 mm (move them apart, or make coil.outer_diameter_mm smaller)";
    for need in [
        Need::EVALUATE,
        Need::PROBE,
        Need::MAP,
        Need::LAMBDA,
        Need::CALIBRATE,
    ] {
        assert_eq!(
            refused(&crowded, need),
            [format!("d.toml:12:12: error: {message}")]
        );
    }
    assert_eq!(
        warned(&crowded, Need::OPTIMIZE),
        [format!("d.toml:12:12: warning: {message}")]
    );
    assert!(read(&but(CORED, "41.0", "38.0"), Need::EVALUATE).is_ok());

    let listed = format!("{SOUND}[array]\npositions_mm = [[0, 0], [45, 0], [45, 0], [20, -60]]\n");
    assert_eq!(
        refused(&listed, Need::EVALUATE),
        [
            "d.toml:9:34: error: array.positions_mm[2]: coils 1 and 2 overlap: their axes are 0 mm apart, the outer diameter is 38 mm (move them apart, or make coil.outer_diameter_mm smaller)"
        ]
    );
    let hexagonal =
        format!("{SOUND}[array]\npositions_mm = [[0, 0], [38, 0], [19, 32.90896534380867]]\n");
    assert!(read(&hexagonal, Need::EVALUATE).is_ok());
}

#[test]
fn an_array_is_given_one_way_and_has_bounds() {
    let both = but(
        CORED,
        "rows = 2\ncolumns = 3\n",
        "positions_mm = [[7, 0]]\n",
    );
    says(
        Need::EVALUATE,
        &[
            (
                both,
                "d.toml:11:12: error: array.pitch_mm: pitch_mm and positions_mm exclude each other (give a grid, or give the positions)",
            ),
            (
                but(CORED, "rows = 2", "rows = 4000"),
                "d.toml:10:8: error: array.rows: 4000 x 3 coils are more than 10000 (lower rows or columns)",
            ),
            (
                but(CORED, "rows = 2", "rows = 0"),
                "d.toml:10:8: error: array.rows: expected at least 1, found 0",
            ),
            (
                but(CORED, "pitch_mm = 41.0", "pitch_mm = 0"),
                "d.toml:12:12: error: array.pitch_mm: expected a number greater than 0, found 0 mm",
            ),
        ],
    );
    let many = format!(
        "{SOUND}[array]\npositions_mm = [{}]\n",
        "[0, 0],".repeat(10_001)
    );
    assert_eq!(
        refused(&many, Need::EVALUATE),
        [
            "d.toml:9:16: error: array.positions_mm: 10001 pairs are more than 10000 (shorten the list)"
        ]
    );
}

#[test]
fn the_core_fits_the_bore() {
    let with = |keys: &str| but(CORED, "[core]", &format!("[core]\n{keys}"));
    says(
        Need::EVALUATE,
        &[
            (
                with("clearance_mm = -0.35"),
                "d.toml:9:16: error: core.clearance_mm: the core, 24.7 mm in diameter, is thicker than the bore, 24 mm (the clearance is 0 or more)",
            ),
            (
                with("clearance_mm = 12"),
                "d.toml:9:16: error: core.clearance_mm: a clearance of 12 mm leaves no core in a bore of radius 12 mm (lower it, or leave [core] out for an air coil)",
            ),
            (
                with("above_mm = -80\nbelow_mm = -20"),
                "d.toml:10:12: error: core.below_mm: the core has no length: 100 + -80 + -20 = 0 mm (the core spans the winding's length plus above_mm plus below_mm)",
            ),
            (
                with("relative_permeability = 0.7"),
                "d.toml:9:25: error: core.relative_permeability: expected between 1 and 1e9, found 0.7 (write 700 if 0.7 thousands is meant)",
            ),
            (
                with("relative_permeability = 0.001"),
                "d.toml:9:25: error: core.relative_permeability: expected between 1 and 1e9, found 0.001 (write 795.774715459 if 0.001 H/m is meant)",
            ),
            (
                with("relative_permeability = 0"),
                "d.toml:9:25: error: core.relative_permeability: expected between 1 and 1e9, found 0",
            ),
            (
                with("relative_permeability = -700"),
                "d.toml:9:25: error: core.relative_permeability: expected between 1 and 1e9, found -700",
            ),
            (
                with("relative_permeability = 1.3e9"),
                "d.toml:9:25: error: core.relative_permeability: expected between 1 and 1e9, found 1.3e9",
            ),
            (
                with("relative_permeability = 700\nbh_curve = \"a.csv\""),
                "d.toml:10:12: error: core.bh_curve: relative_permeability and bh_curve exclude each other (keep the one that describes the steel)",
            ),
            (
                with("bh_curve = \"\""),
                "d.toml:9:12: error: core.bh_curve: expected the path of a B-H table, found an empty text (name a CSV file)",
            ),
            (
                with("knee_t = 0"),
                "d.toml:9:10: error: core.knee_t: expected a number greater than 0, found 0 T",
            ),
            (
                with("conductivity_s_per_m = -1"),
                "d.toml:9:24: error: core.conductivity_s_per_m: expected 0 or more, found -1 S/m",
            ),
        ],
    );
    assert!(
        read(
            &with("above_mm = -30\nbelow_mm = -20.5\nclearance_mm = 0.7"),
            Need::EVALUATE
        )
        .is_ok()
    );
}

#[test]
fn every_permeability_from_vacuum_to_a_thousand_million_is_read() {
    for mu in ["1", "1.000000001", "1e9"] {
        let text = but(
            CORED,
            "[core]",
            &format!("[core]\nrelative_permeability = {mu}"),
        );
        assert_eq!(warned(&text, Need::EVALUATE), [""; 0]);
    }
}

#[test]
fn a_core_far_longer_than_its_winding_is_a_warning() {
    let with = |keys: &str| but(CORED, "[core]", &format!("[core]\n{keys}"));
    assert_eq!(
        warned(&with("below_mm = 10000"), Need::EVALUATE),
        [
            "d.toml:9:12: warning: core.below_mm: the core is 10100 mm long, 101 times the winding's length (above_mm and below_mm are the core's overhang, in millimetres)"
        ]
    );
    let said = warned(&with("above_mm = 2000"), Need::LAMBDA);
    assert!(
        said[2].contains("core.above_mm: the core is 2110 mm long"),
        "{said:?}"
    );
    assert_eq!(warned(&with("below_mm = 1900"), Need::EVALUATE), [""; 0]);
}

#[test]
fn the_magnet_clears_core_and_winding_at_the_target() {
    let at = |base: &str, keys: &str| format!("{base}[target]\n{keys}\n");
    let said = "target.height_mm: the magnet spans z = -0.3 mm to 9.7 mm and overlaps the core, whose top is at z = 0 mm (its centre must be at 5 mm or higher)";
    let low = at(CORED, "height_mm = 4.7");
    assert_eq!(
        refused(&low, Need::EVALUATE),
        [format!("d.toml:14:13: error: {said}")]
    );
    assert_eq!(
        warned(&low, Need::MAP),
        [format!("d.toml:14:13: warning: {said}")]
    );
    // Touching.
    assert_eq!(warned(&at(CORED, "height_mm = 5"), Need::EVALUATE), [""; 0]);
    // A core that protrudes.
    let proud = but(CORED, "[core]", "[core]\nabove_mm = 3.3");
    let said = refused(&at(&proud, "height_mm = 8.2"), Need::EVALUATE);
    assert!(
        said[0].contains(
            "overlaps the core, whose top is at z = 3.3 mm (its centre must be at 8.3 mm or higher)"
        ),
        "{said:?}"
    );
    assert!(read(&at(&proud, "height_mm = 8.3"), Need::EVALUATE).is_ok());
}

#[test]
fn a_magnet_may_dip_into_an_air_coil_s_bore() {
    let low = format!("{SOUND}[target]\nheight_mm = 2.7\n");
    let said = warned(&low, Need::EVALUATE);
    assert_eq!(said.len(), 1);
    assert!(said[0].starts_with("d.toml:9:13: warning: target.height_mm: the magnet's lower end, at z = -2.3 mm, lies in the bore"), "{said:?}");
    let wide = format!("{low}[magnet]\ndiameter_mm = 24.1\n");
    assert!(
        refused(&wide, Need::EVALUATE)[0]
            .contains("overlaps the winding, whose top is at z = 0 mm")
    );
    // The bore of a coil yet to be found may be narrower.
    assert!(refused(&low, Need::OPTIMIZE)[0].contains("overlaps the winding"));
}

#[test]
fn the_workspace_lies_above_the_coils() {
    let over = |base: &str, keys: &str| format!("{base}[workspace]\n{keys}\n");
    let low = over(SOUND, "z_mm = [-0.7, 80, 29]");
    let said = "workspace.z_mm: the workspace begins at z = -0.7 mm, below the coils' top face at z = 0 (begin at 0 or higher)";
    for need in [Need::MAP, Need::CALIBRATE] {
        assert_eq!(refused(&low, need), [format!("d.toml:9:8: error: {said}")]);
    }
    for need in [Need::EVALUATE, Need::LAMBDA] {
        assert_eq!(warned(&low, need), [format!("d.toml:9:8: warning: {said}")]);
    }
    assert_eq!(
        warned(&over(SOUND, "z_mm = [0, 80, 29]"), Need::MAP),
        [""; 0]
    );

    let proud = but(CORED, "[core]", "[core]\nabove_mm = 13");
    assert_eq!(
        refused(&proud, Need::MAP),
        [
            "d.toml:1:1: error: workspace.z_mm: the workspace begins at z = 10 mm and reaches into a core, whose top is at z = 13 mm (begin at 13 or higher)"
        ]
    );
    // The magnet is larger than its centre; the map itself is sound.
    let said = "workspace.z_mm: a magnet centred at the workspace's lower end, z = 13.7 mm, spans z = 8.7 mm to 18.7 mm and overlaps the core, whose top is at z = 13 mm (from z = 18 mm on there is room for it)";
    assert_eq!(
        warned(&over(&proud, "z_mm = [13.7, 80, 3]"), Need::MAP),
        [format!("d.toml:15:8: warning: {said}")]
    );
    assert_eq!(
        warned(&over(&proud, "z_mm = [18, 80, 3]"), Need::MAP),
        [""; 0]
    );
    // Its edge reaches as far as its radius: 20.5 - 12 - 5 mm beside the row.
    let beside = |y: &str| {
        let keys = format!("z_mm = [13.7, 80, 3]\ny_mm = [{y}, {y}, 1]");
        warned(&over(&proud, &keys), Need::MAP).len()
    };
    assert_eq!((beside("3.4"), beside("3.6")), (0, 1));
    // Between the cores there is room: the nearest axis is 20.5 mm away, the core 12 mm thick.
    assert!(
        read(
            &over(&proud, "x_mm = [-70, 70, 15]\ny_mm = [-8, 8, 3]"),
            Need::MAP
        )
        .is_ok()
    );
}

#[test]
fn axes_run_upwards_and_include_both_ends() {
    let x = |axis: &str| format!("{SOUND}[workspace]\nx_mm = {axis}\n");
    says(
        Need::EVALUATE,
        &[
            (
                x("[50, -50, 61]"),
                "d.toml:9:8: error: workspace.x_mm: the axis runs backwards, from 50 to -50 mm (write the lower end first)",
            ),
            (
                x("[7, 7, 61]"),
                "d.toml:9:8: error: workspace.x_mm: 61 samples need two different ends, found from 7 to 7 mm (ask for 1 sample)",
            ),
            (
                x("[-7, 7, 1]"),
                "d.toml:9:8: error: workspace.x_mm: 1 sample cannot include both ends, from -7 to 7 mm (make both ends equal, or ask for 2 samples or more)",
            ),
            (
                x("[-7, 7, 0]"),
                "d.toml:9:16: error: workspace.x_mm (samples): expected at least 1, found 0",
            ),
            (
                x("[-7, 7]"),
                "d.toml:9:8: error: workspace.x_mm: expected [from, to, samples], found 2 values (for example [-50.0, 50.0, 61])",
            ),
            (
                x("[-7, 7, 3.5]"),
                "d.toml:9:16: error: workspace.x_mm (samples): expected a whole number up to 1e9, found 3.5",
            ),
        ],
    );
    assert!(read(&x("[7, 7, 1]"), Need::EVALUATE).is_ok());
}

#[test]
fn a_map_has_a_largest_size() {
    let text = format!("{SOUND}[workspace]\nx_mm = [-50, 50, 9007199254740992]\n");
    let said = refused(&text, Need::MAP);
    assert!(
        said[0].starts_with(
            "d.toml:9:18: error: workspace.x_mm (samples): expected a whole number up to 1e9"
        ),
        "{said:?}"
    );
    let text = format!("{SOUND}[workspace]\nx_mm = [-50, 50, 1000000]\n");
    assert_eq!(
        refused(&text, Need::MAP),
        [
            "d.toml:9:8: error: workspace.x_mm: 1 coils x 1000000 x 61 x 29 nodes are 1.769e9 map values, more than 1e9 (ask for fewer samples)"
        ]
    );
    assert_eq!(warned(&text, Need::LAMBDA).len(), 1);
}
