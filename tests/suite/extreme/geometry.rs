//! Windings from disc to needle on their axis, and off it against 40-digit values.

use std::f64::consts::PI;

use super::check::{Outcome, SEED, known_winding, number, off, reported, winding, worst};
use super::{Case, case};
use fluxform::field::winding::{AxialField, Winding};
use fluxform::numerics::gauss;
use fluxform::units::MU_0_T_M_PER_A;

/// Error that `Winding::field` states.
const STATED: f64 = 1e-12;
pub const DISC: Winding = winding(0.010, 0.050, 1e-5, 37.0);
pub const NEEDLE: Winding = winding(0.0005, 0.001, 1.0, 4100.0);
pub const FILM: Winding = winding(0.013, 0.013_000_001, 0.07, 91.0);
pub const LEAF: Winding = winding(0.013, 0.047, 1e-9, 3.0);
pub const SOLID: Winding = winding(0.0, 0.021, 0.017, 700.0);

pub fn cases() -> Vec<Case> {
    [on_the_axis(), against_the_oracle()].concat()
}

/// F with B_z = mu_0 J / 2 [F(z + L) - F(z)] on the axis, and its first two derivatives, with
/// s = hypot(a, u): F = u ln((a2 + s2) / (a1 + s1)), F' = ln + a1 / s1 - a2 / s2.
fn axis_terms(w: &Winding, u: f64) -> [f64; 3] {
    let (a1, a2) = (w.inner_radius_m, w.outer_radius_m);
    let (s1, s2) = (a1.hypot(u), a2.hypot(u));
    let wider = (a2 - a1) * (1.0 + (a1 + a2) / (s1 + s2));
    let ln = (wider / (a1 + s1)).ln_1p();
    let second = |a: f64, s: f64| u / (s * (a + s)) + a * u / s.powi(3);
    [
        u * ln,
        ln + a1 / s1 - a2 / s2,
        second(a2, s2) - second(a1, s1),
    ]
}

/// Closed form of B_z and dB_z/dz on the axis. Where the winding is short against its bore, the
/// differences are integrals of the slopes, which lose no digits.
fn axis_closed(w: &Winding, z_m: f64) -> [f64; 2] {
    let half = 0.5 * MU_0_T_M_PER_A * w.current_density_per_m2();
    if w.length_m < 0.1 * w.inner_radius_m {
        let mut sums = [0.0; 2];
        let rule = gauss::rule(20);
        for (x, weight) in rule.nodes.iter().zip(&rule.weights) {
            let [_, first, second] = axis_terms(w, z_m + 0.5 * w.length_m * (1.0 + x));
            sums[0] += 0.5 * w.length_m * weight * first;
            sums[1] += 0.5 * w.length_m * weight * second;
        }
        return sums.map(|sum| half * sum);
    }
    let (bottom, top) = (axis_terms(w, z_m + w.length_m), axis_terms(w, z_m));
    [0, 1].map(|k| half * (bottom[k] - top[k]))
}

fn axis(w: &Winding, z_m: f64) -> Outcome {
    let found = w.field(0.0, z_m).map_err(reported)?;
    let [b, g] = axis_closed(w, z_m);
    // In a winding's middle the gradient vanishes: there the field over the radius is its size.
    let size = found.gradient_norm().max(b.abs() / w.outer_radius_m);
    worst(
        [off(found.b_z, b), (found.dbz_dz - g).abs() / size],
        &format!(
            "B_z {:.9e} T/A, dB_z/dz {:.9e} T/m/A",
            found.b_z, found.dbz_dz
        ),
    )
}

fn on_the_axis() -> Vec<Case> {
    let words = "B_z and dB_z/dz of the closed form on the axis (T/A, T/m/A)";
    vec![
        case(
            "geometry: seed on its axis, 30 mm up",
            words,
            STATED,
            || axis(&SEED, 0.03),
        ),
        case(
            "geometry: seed on its axis, 1 nm above the face",
            words,
            STATED,
            || axis(&SEED, 1e-9),
        ),
        case(
            "geometry: seed on its axis, in the face's plane",
            words,
            STATED,
            || axis(&SEED, 0.0),
        ),
        case(
            "geometry: seed on its axis, in its middle",
            words,
            STATED,
            || axis(&SEED, -0.05),
        ),
        case(
            "geometry: seed on its axis, 1 nm below its bottom",
            words,
            STATED,
            || axis(&SEED, -0.1 - 1e-9),
        ),
        // The closed form's difference loses L / z = 1e3 of the doubles' digits.
        case(
            "geometry: disc 4000 times wider than long, 10 mm up",
            words,
            1e-11,
            || axis(&DISC, 0.01),
        ),
        case("geometry: disc, 1 nm above its face", words, 1e-11, || {
            axis(&DISC, 1e-9)
        }),
        case("geometry: disc, in its middle", words, 1e-11, || {
            axis(&DISC, -5e-6)
        }),
        case(
            "geometry: needle 1000 times longer than wide, 1 nm up",
            words,
            STATED,
            || axis(&NEEDLE, 1e-9),
        ),
        case("geometry: needle, in its middle", words, STATED, || {
            axis(&NEEDLE, -0.5)
        }),
        case("geometry: needle, 10 mm up", words, STATED, || {
            axis(&NEEDLE, 0.01)
        }),
        // 1 nm on 13 mm: the radii state the width to 1e-9 of itself.
        case("geometry: winding 1 nm deep, 10 mm up", words, 1e-8, || {
            axis(&FILM, 0.01)
        }),
        case(
            "geometry: winding 1 nm long, 10 mm up",
            words,
            1e-11,
            || axis(&LEAF, 0.01),
        ),
        case("geometry: winding 1 nm long, 1 mm up", words, 1e-11, || {
            axis(&LEAF, 0.001)
        }),
        case(
            "geometry: winding without a bore, 1 um above its axis",
            words,
            STATED,
            || axis(&SOLID, 1e-6),
        ),
        case(
            "geometry: winding without a bore, inside the conductor",
            words,
            STATED,
            || axis(&SOLID, -0.006),
        ),
        case(
            "geometry: bore of 1 nm in a winding of 21 mm",
            words,
            STATED,
            || axis(&winding(1e-9, 0.021, 0.017, 700.0), 0.002),
        ),
        case(
            "geometry: a million times larger",
            "B falls with the scale, the gradient with its square",
            1e-11,
            || scaled(1e6),
        ),
        case(
            "geometry: a million times smaller",
            "B grows with 1/scale, the gradient with its square",
            1e-11,
            || scaled(1e-6),
        ),
    ]
}

/// Field of a scaled winding at scaled places, scaled back.
fn scaled(k: f64) -> Outcome {
    let big = winding(0.012 * k, 0.019 * k, 0.1 * k, 1429.0);
    let mut errors = Vec::new();
    for (r, z) in [
        (0.0, 0.031),
        (0.0131, 0.0007),
        (0.0143, -0.021),
        (0.07, -0.013),
    ] {
        let one = SEED.field(r, z).map_err(reported)?;
        let other = big.field(r * k, z * k).map_err(reported)?;
        errors.push((other.b_z * k - one.b_z).abs() / one.b_z.hypot(one.b_r));
        errors.push((other.dbz_dz * k * k - one.dbz_dz).abs() / one.gradient_norm());
        errors.push((other.dbr_dz * k * k - one.dbr_dz).abs() / one.gradient_norm());
    }
    worst(errors, "difference from the unscaled field")
}

/// A point of the committed 40-digit values.
fn exact(name: &str, r: &str, z: &str) -> Outcome {
    let (table, w) = known_winding(name)?;
    let points = table["points"].as_array().ok_or("no points")?;
    let point = points
        .iter()
        .find(|p| p["winding"] == name && p["r_m"] == r && p["z_m"] == z)
        .ok_or("no such point in the oracle")?;
    let found = w
        .field(number(&point["r_m"])?, number(&point["z_m"])?)
        .map_err(reported)?;
    let of = |key: &str| number(&point[key]);
    let size = of("b_r")?.hypot(of("b_z")?);
    let norm = AxialField {
        dbr_dr: of("dbr_dr")?,
        dbr_dz: of("dbr_dz")?,
        dbz_dr: of("dbz_dr")?,
        dbz_dz: of("dbz_dz")?,
        br_over_r: of("br_over_r")?,
        ..AxialField::default()
    }
    .gradient_norm();
    let pairs = [
        (found.b_r, of("b_r")?, size),
        (found.b_z, of("b_z")?, size),
        (found.dbr_dr, of("dbr_dr")?, norm),
        (found.dbr_dz, of("dbr_dz")?, norm),
        (found.dbz_dr, of("dbz_dr")?, norm),
        (found.dbz_dz, of("dbz_dz")?, norm),
        (found.br_over_r, of("br_over_r")?, norm),
    ];
    worst(
        pairs.map(|(a, b, scale)| (a - b).abs() / scale),
        &format!("dB_z/dz {:.12e} T/m/A; seven components", found.dbz_dz),
    )
}

fn against_the_oracle() -> Vec<Case> {
    let words = "all components of 40-digit integration, relative to |B| and |grad B|";
    vec![
        case("geometry: 1 nm off the axis", words, STATED, || {
            exact("seed", "1e-9", "0.03")
        }),
        case("geometry: 1 um above the inner edge", words, STATED, || {
            exact("seed", "0.012", "1e-6")
        }),
        case("geometry: 1 um above the outer edge", words, STATED, || {
            exact("seed", "0.019", "1e-6")
        }),
        case("geometry: 1 pm above the end face", words, STATED, || {
            exact("seed", "0.016", "1e-12")
        }),
        case(
            "geometry: 1 nm below the face, in the conductor",
            words,
            STATED,
            || exact("seed", "0.0121", "-1e-9"),
        ),
        case(
            "geometry: 100 nm inside the outer face",
            words,
            STATED,
            || exact("seed", "0.0189999", "-0.0999"),
        ),
        case(
            "geometry: 100 nm outside the outer face",
            words,
            STATED,
            || exact("seed", "0.0190001", "-0.06"),
        ),
        case(
            "geometry: 10 m up, 100 nm off the axis",
            words,
            STATED,
            || exact("seed", "1e-7", "10"),
        ),
        case("geometry: 10 m aside", words, STATED, || {
            exact("seed", "9.9", "0.3")
        }),
        case(
            "geometry: inside a disc 300 times deeper than long",
            words,
            STATED,
            || exact("thin_disc", "0.02", "-0.00004"),
        ),
        case(
            "geometry: 2 um above a disc's outer edge",
            words,
            STATED,
            || exact("thin_disc", "0.047", "2e-6"),
        ),
        case("geometry: 300 nm above a disc", words, STATED, || {
            exact("thin_disc", "0.0131", "0.0000003")
        }),
        case("geometry: beside a disc of 1.7 um", words, STATED, || {
            exact("thinner_disc", "0.09", "-0.0000013")
        }),
        case(
            "geometry: above the edge of a disc of 1.7 um",
            words,
            STATED,
            || exact("thinner_disc", "0.047", "2e-6"),
        ),
        case(
            "geometry: in the wall of a tube of aspect 1000",
            words,
            STATED,
            || exact("tube", "0.0009", "-0.4"),
        ),
        case("geometry: 1 um above a tube's edge", words, STATED, || {
            exact("tube", "0.0011", "1e-6")
        }),
        case("geometry: beside a tube's middle", words, STATED, || {
            exact("tube", "0.05", "-0.7")
        }),
        case("geometry: in a sheet of 300 nm", words, STATED, || {
            exact("thin_sheet", "0.05000015", "-0.011")
        }),
        case(
            "geometry: 700 nm above a sheet of 300 nm",
            words,
            STATED,
            || exact("thin_sheet", "0.0500001", "0.0000007"),
        ),
        case(
            "geometry: off the axis, by brute force",
            "the section's current elements added up: trapezoids in angle, Gauss in the section",
            1e-11,
            brute_force,
        ),
    ]
}

/// Biot-Savart over the section, without elliptic integrals.
fn brute_force() -> Outcome {
    const ANGLES: usize = 400;
    let w = winding(0.0123, 0.0171, 0.0137, 311.0);
    let rule = gauss::rule(24);
    let mut errors = Vec::new();
    for (r, z) in [
        (0.0057, 0.0131),
        (0.0311, 0.0071),
        (0.0291, -0.0093),
        (0.0031, -0.0069),
    ] {
        let mut sums = [0.0_f64; 3];
        for (x, weight_x) in rule.nodes.iter().zip(&rule.weights) {
            let a = 0.5 * (w.inner_radius_m + w.outer_radius_m)
                + 0.5 * (w.outer_radius_m - w.inner_radius_m) * x;
            for (y, weight_y) in rule.nodes.iter().zip(&rule.weights) {
                let u = z + 0.5 * w.length_m * (1.0 + y);
                for k in 0..ANGLES {
                    let cosine = (2.0 * PI * (k as f64 + 0.5) / ANGLES as f64).cos();
                    let square = a * a + r * r + u * u - 2.0 * a * r * cosine;
                    let weight = weight_x * weight_y * a / square.powf(1.5);
                    sums[0] += weight * (a - r * cosine);
                    sums[1] += weight * u * cosine;
                    sums[2] -= weight * 3.0 * u * (a - r * cosine) / square;
                }
            }
        }
        // mu_0 / (4 pi) times the step 2 pi / n, over a section of half-widths whose product
        // the density turns into turns.
        let scale = MU_0_T_M_PER_A * 0.5 / ANGLES as f64 * 0.25 * w.turns;
        let found = w.field(r, z).map_err(reported)?;
        let size = found.b_z.hypot(found.b_r);
        errors.push((found.b_z - scale * sums[0]).abs() / size);
        errors.push((found.b_r - scale * sums[1]).abs() / size);
        errors.push((found.dbz_dz - scale * sums[2]).abs() / found.gradient_norm());
    }
    worst(errors, "difference from current elements")
}
