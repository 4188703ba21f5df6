//! Values that look like another unit's: warned about, never refused.

use fluxform_design::Need;

use crate::support::{SOUND, read, sound_but, warned};

#[test]
fn metres_in_a_millimetre_key_are_a_warning() {
    let text = sound_but("inner_diameter_mm = 24.0", "inner_diameter_mm = 0.024")
        .replace("outer_diameter_mm = 38.0", "outer_diameter_mm = 0.038")
        .replace("length_mm = 100.0", "length_mm = 0.1")
        .replace("diameter_mm = 0.7", "diameter_mm = 0.0007");
    let said = warned(&text, Need::EVALUATE);
    assert_eq!(
        said,
        [
            "d.toml:3:21: warning: coil.inner_diameter_mm: 0.024 mm looks like metres (write 24 if 0.024 metres is meant)",
            "d.toml:4:21: warning: coil.outer_diameter_mm: 0.038 mm looks like metres (write 38 if 0.038 metres is meant)",
            "d.toml:5:13: warning: coil.length_mm: 0.1 mm looks like metres (write 100 if 0.1 metres is meant)",
            "d.toml:7:15: warning: wire.diameter_mm: 0.0007 mm looks like metres (write 0.7 if 0.0007 metres is meant)",
        ]
    );
    // Read as written all the same.
    assert_eq!(
        read(&text, Need::EVALUATE)
            .unwrap()
            .0
            .coil
            .unwrap()
            .length_m,
        0.0001
    );
}

#[test]
fn each_key_knows_its_own_slips() {
    let cases = [
        (
            "[array]\nrows = 1\ncolumns = 1\npitch_mm = 0.07",
            "array.pitch_mm: 0.07 mm looks like metres (write 70 if",
        ),
        (
            "[array]\npositions_mm = [[-0.05, 0.0]]",
            "array.positions_mm: -0.05 mm looks like metres (write -50 if",
        ),
        (
            "[core]\nbelow_mm = 0.01",
            "core.below_mm: 0.01 mm looks like metres (write 10 if",
        ),
        (
            "[magnet]\nlength_mm = 0.013",
            "magnet.length_mm: 0.013 mm looks like metres (write 13 if",
        ),
        (
            "[magnet]\nmagnetization_a_per_m = 1157.9",
            "magnet.magnetization_a_per_m: 1157.9 A/m looks like kA/m (write 1157900 if",
        ),
        (
            "[magnet]\nmagnetization_a_per_m = 1.3",
            "magnet.magnetization_a_per_m: 1.3 A/m looks like tesla (write 1034507.1",
        ),
        (
            "[limits]\nsettling_max_ms = 0.1",
            "limits.settling_max_ms: 0.1 ms looks like seconds (write 100 if",
        ),
        (
            "[limits]\nouter_diameter_max_mm = 0.038",
            "limits.outer_diameter_max_mm: 0.038 mm looks like metres",
        ),
        (
            "[workspace]\nx_mm = [-0.07, 0.05, 13]",
            "workspace.x_mm: -0.07 mm looks like metres (write -70 if",
        ),
        (
            "[core]\nconductivity_s_per_m = 5.8",
            "core.conductivity_s_per_m: 5.8 S/m looks like MS/m (write 5800000 if",
        ),
    ];
    for (section, expected) in cases {
        let said = warned(&format!("{SOUND}{section}\n"), Need::PROBE);
        assert_eq!(said.len(), 1, "{said:?}");
        assert!(
            said[0].contains(&format!("warning: {expected}")),
            "{said:?}"
        );
    }
    let said = warned(
        &sound_but("0.7", "0.7\nresistivity_ohm_m = 0.0168"),
        Need::PROBE,
    );
    assert!(
        said[0].contains("0.0168 ohm m looks like ohm mm^2/m (write 1.68e-8 if"),
        "{said:?}"
    );
    let said = warned(&format!("{SOUND}[target]\nheight_mm = 0.03\n"), Need::PROBE);
    assert!(
        said[0].contains("target.height_mm: 0.03 mm looks like metres (write 30 if"),
        "{said:?}"
    );
}

#[test]
fn plausible_small_values_pass_in_silence() {
    let text =
        format!("{SOUND}[core]\nclearance_mm = 0.1\nbelow_mm = -0.3\n[target]\nheight_mm = 5.3\n");
    assert_eq!(warned(&text, Need::EVALUATE), [""; 0]);
}

#[test]
fn more_turns_than_fit_is_a_warning_beyond_the_next_whole_number() {
    let with = |turns: &str| {
        sound_but(
            "length_mm = 100.0",
            &format!("length_mm = 100.0\nturns = {turns}"),
        )
    };
    assert_eq!(warned(&with("1429"), Need::EVALUATE), [""; 0]);
    assert_eq!(
        warned(&with("1430"), Need::EVALUATE),
        [
            "d.toml:6:9: warning: coil.turns: 1430 turns are more than the 1428.57 that fit (evaluate reports limits.winding_fill; leave turns out for as many as fit)"
        ]
    );
}
