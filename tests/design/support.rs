//! Designs to bend, and what is said of them.

use std::path::Path;

use fluxform_design::{Design, Faults, Need};

/// A design without a fault; line 1 is the name.
pub const SOUND: &str = r#"name = "sound"
[coil]
inner_diameter_mm = 24.0
outer_diameter_mm = 38.0
length_mm = 100.0
[wire]
diameter_mm = 0.7
"#;

/// The same with a core in a 2 x 3 array.
pub const CORED: &str = r#"name = "cored"
[coil]
inner_diameter_mm = 24.0
outer_diameter_mm = 38.0
length_mm = 100.0
[wire]
diameter_mm = 0.7
[core]
[array]
rows = 2
columns = 3
pitch_mm = 41.0
"#;

pub fn read(text: &str, need: Need) -> Result<(Design, Faults), Faults> {
    Design::from_toml(text, Path::new("d.toml"), need).map_err(|invalid| invalid.faults)
}

pub fn sound(text: &str) -> Design {
    match read(text, Need::EVALUATE) {
        Ok((design, warnings)) if warnings.is_empty() => design,
        Ok((_, warnings)) => panic!("{warnings}"),
        Err(faults) => panic!("{faults}"),
    }
}

/// The lines said of a design that must be refused.
pub fn refused(text: &str, need: Need) -> Vec<String> {
    match read(text, need) {
        Ok(_) => panic!("this should be refused:\n{text}"),
        Err(faults) => faults.plain().lines().map(str::to_owned).collect(),
    }
}

/// The lines said of a design that is read all the same.
pub fn warned(text: &str, need: Need) -> Vec<String> {
    match read(text, need) {
        Ok((_, warnings)) => warnings.plain().lines().map(str::to_owned).collect(),
        Err(faults) => panic!("this should be read:\n{faults}"),
    }
}

/// `SOUND` with `line` replaced by `by`.
pub fn sound_but(line: &str, by: &str) -> String {
    but(SOUND, line, by)
}

/// `text` with its only `line` replaced by `by`.
pub fn but(text: &str, line: &str, by: &str) -> String {
    assert_eq!(text.matches(line).count(), 1, "{line}");
    text.replace(line, by)
}
