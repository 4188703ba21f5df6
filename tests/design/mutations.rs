//! No text, however broken, makes the readers panic, and what they accept is finite.

use fluxform_testing::Random;
use std::path::Path;

use fluxform_design::{Design, Need};
use fluxform_shape::document::ShapeDocument;

const PIECES: [&str; 30] = [
    "[",
    "]",
    "[[",
    "=",
    "\"",
    "'",
    "\"\"\"",
    "\n",
    ",",
    ".",
    "#",
    "nan",
    "-inf",
    "1e308",
    "-0.0",
    "9223372036854775807",
    "99999999999999999999999999",
    "0xffffffffffffffffffffffffffffffffff",
    "true",
    "1979-05-27",
    "{ a = 1 }",
    "\u{e9}",
    "\u{1f9f2}",
    "\u{feff}",
    "\r",
    "\u{0}",
    "\\u0000",
    "[coil]",
    "-1",
    "5e-324",
];

fn mutate(text: &str, random: &mut Random) -> String {
    let mut text = text.to_owned();
    for _ in 0..=random.below(3) {
        let from = text.floor_char_boundary(random.below(text.len() + 1));
        let to = text.ceil_char_boundary((from + random.below(12)).min(text.len()));
        match random.below(4) {
            0 => text.replace_range(from..to, ""),
            1 => text.replace_range(from..to, PIECES[random.below(PIECES.len())]),
            2 => text.insert_str(from, PIECES[random.below(PIECES.len())]),
            _ => {
                let copy = text[from..to].to_owned();
                let place = text.floor_char_boundary(random.below(text.len() + 1));
                text.insert_str(place, &copy);
            }
        }
    }
    text
}

const SHAPE: &str = "name = \"half\"\nsurface = \"h.stl\"\nunit = \"mm\"\ntranslate_mm = [0, 0, 30]\n\
rotate_deg = [0, 0, 7]\n[points]\nx_mm = [-50, 50, 61]\ny_mm = [-50, 50, 61]\noutside = \"skip\"\n";

#[test]
fn mutated_designs_are_read_or_refused() {
    let every = include_str!("../fixtures/design/every_key.toml");
    let mut random = Random::new(7);
    let (mut read, mut refused) = (0, 0);
    for _ in 0..4000 {
        let text = mutate(every, &mut random);
        match Design::from_toml(&text, Path::new("d.toml"), Need::CALIBRATE) {
            Ok((design, warnings)) => {
                read += 1;
                assert!(!format!("{design:?}").contains("NaN"), "{text}");
                assert!(!warnings.has_errors());
            }
            Err(invalid) => {
                refused += 1;
                assert!(invalid.faults.has_errors(), "{text}");
                assert!(
                    !invalid.faults.plain().is_empty()
                        && !invalid.faults.render(true, 60).is_empty()
                );
            }
        }
    }
    assert!(
        read > 100 && refused > 1000,
        "{read} read, {refused} refused"
    );
}

#[test]
fn mutated_shapes_are_read_or_refused() {
    let mut random = Random::new(13);
    for _ in 0..4000 {
        let text = mutate(SHAPE, &mut random);
        match ShapeDocument::from_toml(&text, Path::new("s.toml")) {
            Ok((shape, _)) => assert!(!format!("{shape:?}").contains("NaN"), "{text}"),
            Err(invalid) => assert!(!invalid.faults.render(false, 60).is_empty()),
        }
    }
}

#[test]
fn noise_is_refused() {
    let mut random = Random::new(29);
    for _ in 0..2000 {
        let bytes: Vec<u8> = (0..random.below(300))
            .map(|_| random.bits() as u8)
            .collect();
        let text = String::from_utf8_lossy(&bytes);
        let invalid = Design::from_toml(&text, Path::new("d.toml"), Need::SWEEP).unwrap_err();
        assert!(!invalid.faults.render(false, 60).is_empty());
    }
}
