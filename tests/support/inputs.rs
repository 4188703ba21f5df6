//! Documents of small scenes that every command takes in a moment.

use crate::place::Place;

/// Two cored coils that magnetise each other.
pub const TWO: &str = r#"name = "two"
coil = { inner_diameter_mm = 24.0, outer_diameter_mm = 38.0, length_mm = 100.0 }
wire = { diameter_mm = 0.7 }
core = { below_mm = 7.0, relative_permeability = 1300.0 }
array = { rows = 1, columns = 2, pitch_mm = 43.0 }
magnet = { diameter_mm = 10.0, length_mm = 10.0, magnetization_a_per_m = 1.1579e6 }
supply = { current_max_a = 1.3, voltage_v = 36.0 }
target = { height_mm = 30.0 }
[workspace]
x_mm = [-40.0, 40.0, 9]
y_mm = [-30.0, 30.0, 9]
z_mm = [30.0, 70.0, 9]
"#;

/// Four coils without steel.
pub const AIR: &str = r#"name = "air"
coil = { inner_diameter_mm = 24.0, outer_diameter_mm = 38.0, length_mm = 70.0 }
wire = { diameter_mm = 0.7 }
array = { rows = 2, columns = 2, pitch_mm = 43.0 }
magnet = { diameter_mm = 10.0, length_mm = 10.0, magnetization_a_per_m = 1.1579e6 }
supply = { current_max_a = 1.3, voltage_v = 36.0 }
limits = { resistance_max_ohm = 6.0, settling_max_ms = 100.0, outer_diameter_max_mm = 38.0, length_max_mm = 100.0 }
target = { height_mm = 30.0 }
[workspace]
x_mm = [-40.0, 40.0, 21]
y_mm = [-30.0, 30.0, 21]
z_mm = [30.0, 70.0, 21]
"#;

/// A half-sphere.
pub const BUMP: &str = r#"name = "bump"
primitive = "half-sphere"
radius_mm = 13
base_mm = 37
[points]
x_mm = [-13.0, 13.0, 9]
y_mm = [-13.0, 13.0, 9]
"#;

/// A wedge.
pub const RAMP: &str = r#"name = "ramp"
primitive = "wedge"
side_mm = 26
low_mm = 37
high_mm = 47
[points]
x_mm = [-13.0, 13.0, 7]
y_mm = [-13.0, 13.0, 7]
"#;

/// Where the runs of [`scenes`] write.
pub const OUT: &str = "out";

/// A place with designs, shapes, a trajectory over them and an empty folder [`OUT`].
#[must_use]
pub fn scenes() -> Place {
    let place = Place::empty();
    place.folder(OUT);
    place.write("two.toml", TWO);
    place.write("air.toml", AIR);
    // The same name and so the same folder, other numbers.
    place.write("other.toml", &TWO.replace("1300.0", "700.0"));
    place.write(
        "other_air.toml",
        &AIR.replace("length_mm = 70.0", "length_mm = 77.0"),
    );
    place.write("bump.toml", BUMP);
    place.write("ramp.toml", RAMP);
    let path = (0..700).map(|i| {
        let t = f64::from(i) * 1e-3;
        let (x, y) = (0.009 * (7.0 * t).cos(), 0.009 * (9.1 * t).sin());
        format!("{t},{x},{y},0.047\n")
    });
    place.write(
        "finger.csv",
        &format!("t_s,x_m,y_m,z_m\n{}", path.collect::<String>()),
    );
    place
}
