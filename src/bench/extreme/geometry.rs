//! Windings from disc to needle, seen from a nanometre and from 100 m, on every singular line.

use std::f64::consts::PI;

use super::check::{
    Outcome, SEED, close, holds, measured, number, off, oracle, refused, told, winding, worst,
};
use super::{Case, case};
use crate::coil::inductance::self_inductance_h;
use crate::coil::mutual::mutual_inductance_h;
use crate::field::batch::Wanted;
use crate::field::winding::{AxialField, Winding};
use crate::numerics::gauss;
use crate::units::MU_0_T_M_PER_A;

/// What `Winding::field` states of itself.
const STATED: f64 = 1e-12;
const DISC: Winding = winding(0.010, 0.050, 1e-5, 37.0);
const NEEDLE: Winding = winding(0.0005, 0.001, 1.0, 4100.0);
const FILM: Winding = winding(0.013, 0.013_000_001, 0.07, 91.0);
const LEAF: Winding = winding(0.013, 0.047, 1e-9, 3.0);
const SOLID: Winding = winding(0.0, 0.021, 0.017, 700.0);

pub fn cases() -> Vec<Case> {
    [
        on_the_axis(),
        against_the_oracle(),
        far_away(),
        singular_lines(),
        inductances(),
    ]
    .concat()
}

/// F with B_z = mu_0 J / 2 [F(z + L) - F(z)] on the axis, and its first two derivatives.
fn axis_terms(w: &Winding, u: f64) -> [f64; 3] {
    let of = |a: f64| {
        let s = a.hypot(u);
        let first = u * u / (s * (a + s));
        let second =
            3.0 * u / (s * (a + s)) - u.powi(3) * (a + 2.0 * s) / (s * (a + s)).powi(2) / s;
        [(a + s).ln(), first, second]
    };
    let (outer, inner) = (of(w.outer_radius_m), of(w.inner_radius_m));
    let ln = outer[0] - inner[0];
    [u * ln, ln + outer[1] - inner[1], outer[2] - inner[2]]
}

/// Closed form of B_z and dB_z/dz on the axis.
fn axis_closed(w: &Winding, z_m: f64) -> [f64; 2] {
    let half = 0.5 * MU_0_T_M_PER_A * w.current_density_per_m2();
    // For a leaf the difference is the middle's slope, to (L / z)^2 / 24.
    if w.length_m < 1e-6 * z_m.abs() {
        let [_, first, second] = axis_terms(w, z_m + 0.5 * w.length_m);
        return [first, second].map(|f| half * w.length_m * f);
    }
    let (bottom, top) = (axis_terms(w, z_m + w.length_m), axis_terms(w, z_m));
    [0, 1].map(|k| half * (bottom[k] - top[k]))
}

fn axis(w: &Winding, z_m: f64) -> Outcome {
    let found = w.field(0.0, z_m).map_err(told)?;
    let [b, g] = axis_closed(w, z_m);
    worst(
        [
            off(found.b_z, b),
            (found.dbz_dz - g).abs() / found.gradient_norm(),
        ],
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
        let one = SEED.field(r, z).map_err(told)?;
        let other = big.field(r * k, z * k).map_err(told)?;
        errors.push((other.b_z * k - one.b_z).abs() / one.b_z.hypot(one.b_r));
        errors.push((other.dbz_dz * k * k - one.dbz_dz).abs() / one.gradient_norm());
        errors.push((other.dbr_dz * k * k - one.dbr_dz).abs() / one.gradient_norm());
    }
    worst(errors, "difference from the unscaled field")
}

/// A point of the committed 40-digit values.
fn exact(name: &str, r: &str, z: &str) -> Outcome {
    let table = oracle(include_str!("../../../tests/oracles/air_coil.json"))?;
    let w = &table["windings"][name];
    let w = winding(
        number(&w["inner_radius_m"])?,
        number(&w["outer_radius_m"])?,
        number(&w["length_m"])?,
        number(&w["turns"])?,
    );
    let points = table["points"].as_array().ok_or("no points")?;
    let point = points
        .iter()
        .find(|p| p["winding"] == name && p["r_m"] == r && p["z_m"] == z)
        .ok_or("no such point in the oracle")?;
    let found = w
        .field(number(&point["r_m"])?, number(&point["z_m"])?)
        .map_err(told)?;
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
        let found = w.field(r, z).map_err(told)?;
        let size = found.b_z.hypot(found.b_r);
        errors.push((found.b_z - scale * sums[0]).abs() / size);
        errors.push((found.b_r - scale * sums[1]).abs() / size);
        errors.push((found.dbz_dz - scale * sums[2]).abs() / found.gradient_norm());
    }
    worst(errors, "difference from current elements")
}

/// The field against that of a dipole in the winding's middle, over 6 (R / d)^2: the next
/// multipole's largest share (3.4 for a long winding's gradient, 2.5 for a wide one's).
fn dipole(w: &Winding, r_m: f64, z_m: f64) -> Outcome {
    let (a1, a2) = (w.inner_radius_m, w.outer_radius_m);
    let moment = w.turns * PI * (a1 * a1 + a1 * a2 + a2 * a2) / 3.0;
    let z = z_m + 0.5 * w.length_m;
    let d = r_m.hypot(z);
    let scale = MU_0_T_M_PER_A * moment / (4.0 * PI);
    let found = w.field(r_m, z_m).map_err(told)?;
    let size = scale / d.powi(3);
    let share = 6.0 * (a2.hypot(0.5 * w.length_m) / d).powi(2);
    let b_z = scale * (2.0 * z * z - r_m * r_m) / d.powi(5);
    let b_r = scale * 3.0 * r_m * z / d.powi(5);
    let gradient = scale * z * (9.0 * r_m * r_m - 6.0 * z * z) / d.powi(7);
    let errors = [
        (found.b_z - b_z).abs() / size,
        (found.b_r - b_r).abs() / size,
        (found.dbz_dz - gradient).abs() / (size / d),
    ];
    // 2, 1.5 and 6 times `size` are the dipole's own largest values.
    worst(
        errors.map(|e| e / (6.0 * share + 1e-11)),
        &format!(
            "B_z {:.6e} T/A at {d:.1} m, part of what the next multipole may give",
            found.b_z
        ),
    )
}

fn far_away() -> Vec<Case> {
    let words = "a dipole's field, to the next multipole's share 6 (size / distance)^2";
    vec![
        case("geometry: 100 m up", words, 1.0, || {
            dipole(&SEED, 0.0, 100.0)
        }),
        case("geometry: 100 m aside", words, 1.0, || {
            dipole(&SEED, 100.0, -0.05)
        }),
        case("geometry: 100 m at an angle", words, 1.0, || {
            dipole(&SEED, 61.0, 79.0)
        }),
        case("geometry: 100 m below", words, 1.0, || {
            dipole(&SEED, 0.07, -100.0)
        }),
        case("geometry: disc from 100 m", words, 1.0, || {
            dipole(&DISC, 31.0, 95.0)
        }),
        case("geometry: needle from 100 m", words, 1.0, || {
            dipole(&NEEDLE, 81.0, 59.0)
        }),
        case("geometry: winding 1 nm long from 100 m", words, 1.0, || {
            dipole(&LEAF, 70.0, 71.0)
        }),
        case("geometry: winding 1 nm deep from 100 m", words, 1.0, || {
            dipole(&FILM, 70.0, -71.0)
        }),
        case("geometry: winding of 1 um from 100 m", words, 1.0, || {
            dipole(&winding(4e-7, 1e-6, 1.3e-6, 1.0), 59.0, 81.0)
        }),
        case(
            "geometry: many points at once, 1 nm above the face",
            "the batch within its tolerance 1e-9 of the sure path",
            1e-9,
            || batch(1e-9, 1e-9),
        ),
        case(
            "geometry: many points at once, 100 m up",
            "the batch within its tolerance 1e-9 of the sure path",
            1e-9,
            || batch(100.0, 1e-9),
        ),
        case(
            "geometry: many points at once, 30 mm up to 1e-13",
            "the batch within its tolerance 1e-13 of the sure path, and rounding",
            1e-12,
            || batch(0.03, 1e-13),
        ),
    ]
}

fn batch(z_m: f64, tolerance: f64) -> Outcome {
    let r: Vec<f64> = (0..300).map(|i| 0.000_37 * f64::from(i)).collect();
    let z = vec![z_m; r.len()];
    let many = SEED
        .gradients(&r, &z, tolerance, Wanted::Gradient)
        .map_err(told)?;
    let sure: Result<Vec<AxialField>, _> = r.iter().map(|&r| SEED.field(r, z_m)).collect();
    let sure = sure.map_err(told)?;
    let size = sure
        .iter()
        .map(AxialField::gradient_norm)
        .fold(0.0, f64::max);
    let errors = sure.iter().enumerate().flat_map(|(i, f)| {
        [many.dbz_dz[i] - f.dbz_dz, many.br_over_r[i] - f.br_over_r].map(|e| e.abs() / size)
    });
    worst(errors, "batch against sure path")
}

fn singular_lines() -> Vec<Case> {
    let edge = "refused: the gradient is unbounded on an edge";
    let log = "dB_z/dz grows by mu_0 J / (2 pi) ln 1000 from 1 um to 1 nm, up to (um / mm) ln";
    let parts = "the field of the parts added up";
    vec![
        case("geometry: on the inner upper edge", edge, 0.0, || {
            refused(SEED.field(0.012, 0.0), &["edge", "unbounded"])
        }),
        case("geometry: on the outer upper edge", edge, 0.0, || {
            refused(SEED.field(0.019, 0.0), &["edge", "unbounded"])
        }),
        case("geometry: on the inner lower edge", edge, 0.0, || {
            refused(SEED.field(0.012, -0.1), &["edge", "unbounded"])
        }),
        case("geometry: on the outer lower edge", edge, 0.0, || {
            refused(SEED.field(0.019, -0.1), &["edge", "unbounded"])
        }),
        case(
            "geometry: from 1 um to 1 nm above the inner edge",
            log,
            1e-3,
            || logarithm(0.012, 0.0, 1.0, -1.0),
        ),
        case(
            "geometry: from 1 um to 1 nm above the outer edge",
            log,
            1e-3,
            || logarithm(0.019, 0.0, 1.0, 1.0),
        ),
        case(
            "geometry: from 1 um to 1 nm below the inner lower edge",
            log,
            1e-3,
            || logarithm(0.012, -0.1, -1.0, 1.0),
        ),
        case(
            "geometry: from 1 um to 1 nm below the outer lower edge",
            log,
            1e-3,
            || logarithm(0.019, -0.1, -1.0, -1.0),
        ),
        case(
            "geometry: through the top face",
            "dB_r/dz jumps by mu_0 J, B_z and dB_z/dz do not",
            1e-6,
            || jump((0.0157, 1e-9), (0.0157, -1e-9), true),
        ),
        case(
            "geometry: through the bore's wall",
            "dB_z/dr jumps by mu_0 J, B_z and dB_z/dz do not",
            1e-6,
            || jump((0.012 - 1e-9, -0.031), (0.012 + 1e-9, -0.031), false),
        ),
        case(
            "geometry: through the outer wall",
            "dB_z/dr jumps by mu_0 J, B_z and dB_z/dz do not",
            1e-6,
            || jump((0.019 + 1e-9, -0.077), (0.019 - 1e-9, -0.077), false),
        ),
        case(
            "geometry: cut across, 1 nm above the cut",
            parts,
            1e-11,
            || cut_across(1e-9),
        ),
        case(
            "geometry: cut across, 1 nm below the cut",
            parts,
            1e-11,
            || cut_across(-1e-9),
        ),
        case(
            "geometry: cut along, 1 nm inside the cut",
            parts,
            1e-11,
            || cut_along(-1e-9),
        ),
        case(
            "geometry: cut along, 1 nm outside the cut",
            parts,
            1e-11,
            || cut_along(1e-9),
        ),
        case(
            "geometry: mirrored, 1 nm off both faces",
            "equal B_z, opposite dB_z/dz",
            // The rounding of z = -0.1 moves the point by 1e-17 m, 1e-8 of its gap.
            1e-8,
            || {
                let (up, down) = (
                    SEED.field(0.0133, 1e-9).map_err(told)?,
                    SEED.field(0.0133, -0.1 - 1e-9).map_err(told)?,
                );
                worst(
                    [off(up.b_z, down.b_z), off(up.dbz_dz, -down.dbz_dz)],
                    "difference of the two faces",
                )
            },
        ),
    ]
}

/// The growth of dB_z/dz on the way from 1 um to 1 nm off an edge.
fn logarithm(r_m: f64, z_m: f64, side: f64, sign: f64) -> Outcome {
    let near = SEED.field(r_m, z_m + side * 1e-9).map_err(told)?;
    let far = SEED.field(r_m, z_m + side * 1e-6).map_err(told)?;
    let per_e = MU_0_T_M_PER_A * SEED.current_density_per_m2() / (2.0 * PI);
    close(
        near.dbz_dz - far.dbz_dz,
        sign * per_e * 1000.0_f64.ln(),
        "T/m/A",
    )
}

/// Outside against inside, 2 nm apart.
fn jump(outside: (f64, f64), inside: (f64, f64), of_face: bool) -> Outcome {
    let out = SEED.field(outside.0, outside.1).map_err(told)?;
    let within = SEED.field(inside.0, inside.1).map_err(told)?;
    let whole = MU_0_T_M_PER_A * SEED.current_density_per_m2();
    let found = if of_face {
        within.dbr_dz - out.dbr_dz
    } else {
        out.dbz_dr - within.dbz_dr
    };
    worst(
        [
            off(found, whole),
            off(within.b_z, out.b_z),
            (within.dbz_dz - out.dbz_dz).abs() / whole,
        ],
        &format!("jump of {found:.9e} T/m/A, mu_0 J = {whole:.9e}"),
    )
}

fn sum_of(parts: [AxialField; 2], whole: AxialField) -> Outcome {
    let sum = parts[0] + parts[1];
    let norm = parts[0].gradient_norm().max(whole.gradient_norm());
    worst(
        [
            off(sum.b_z, whole.b_z),
            (sum.dbz_dz - whole.dbz_dz).abs() / norm,
            (sum.dbr_dz - whole.dbr_dz).abs() / norm,
            (sum.dbz_dr - whole.dbz_dr).abs() / norm,
        ],
        "parts against the whole",
    )
}

fn cut_across(gap_m: f64) -> Outcome {
    let depth = 0.037;
    let upper = winding(0.012, 0.019, depth, 1429.0 * depth / 0.1);
    let lower = winding(0.012, 0.019, 0.1 - depth, 1429.0 * (0.1 - depth) / 0.1);
    let (r, z) = (0.0149, gap_m - depth);
    sum_of(
        [
            upper.field(r, z).map_err(told)?,
            lower.field(r, z + depth).map_err(told)?,
        ],
        SEED.field(r, z).map_err(told)?,
    )
}

fn cut_along(gap_m: f64) -> Outcome {
    let at = 0.0151;
    let inner = winding(0.012, at, 0.1, 1429.0 * (at - 0.012) / 0.007);
    let outer = winding(at, 0.019, 0.1, 1429.0 * (0.019 - at) / 0.007);
    let (r, z) = (at + gap_m, -0.043);
    sum_of(
        [
            inner.field(r, z).map_err(told)?,
            outer.field(r, z).map_err(told)?,
        ],
        SEED.field(r, z).map_err(told)?,
    )
}

/// A winding of the committed 20-digit inductances.
fn exact_inductance(name: &str) -> Outcome {
    let table = oracle(include_str!("../../../tests/oracles/air_coil.json"))?;
    let w = &table["windings"][name];
    let w = winding(
        number(&w["inner_radius_m"])?,
        number(&w["outer_radius_m"])?,
        number(&w["length_m"])?,
        number(&w["turns"])?,
    );
    let list = table["inductances"].as_array().ok_or("no inductances")?;
    let entry = list
        .iter()
        .find(|e| e["winding"] == name)
        .ok_or("no such winding")?;
    close(self_inductance_h(&w), number(&entry["inductance_h"])?, "H")
}

fn inductances() -> Vec<Case> {
    vec![
        case(
            "geometry: inductance of a disc",
            "20-digit value, H",
            1e-12,
            || exact_inductance("thin_disc"),
        ),
        case(
            "geometry: inductance of a tube",
            "20-digit value, H",
            1e-12,
            || exact_inductance("tube"),
        ),
        case(
            "geometry: inductance of a thread in a ring",
            "mu_0 a N^2 (ln(8 a / g) - 2), g the square's mean distance, up to (w / a)^2 ln",
            1e-8,
            || {
                let (a, w) = (0.1, 1e-6);
                let ring = winding(a - 0.5 * w, a + 0.5 * w, w, 3.0);
                let mean = w * (2.0_f64.ln() / 3.0 + PI / 3.0 - 25.0 / 12.0).exp();
                let wanted = MU_0_T_M_PER_A * a * 9.0 * ((8.0 * a / mean).ln() - 2.0);
                close(self_inductance_h(&ring), wanted, "H")
            },
        ),
        case(
            "geometry: inductance of a needle",
            "mu_0 N^2 pi a^2 / l (1 - 8 a / (3 pi l) + a^2 / (2 l^2)), up to depth / radius",
            3e-6,
            || {
                let (a, w, l) = (0.0005, 1e-9, 0.7);
                let ratio: f64 = a / l;
                let wanted = MU_0_T_M_PER_A * 1e6 * PI * a * a / l
                    * (1.0 - 8.0 * ratio / (3.0 * PI) + 0.5 * ratio * ratio);
                close(
                    self_inductance_h(&winding(a, a + w, l, 1000.0)),
                    wanted,
                    "H",
                )
            },
        ),
        case(
            "geometry: inductance from 1e-9 to 1e9 of the size",
            "in proportion to the size",
            2e-12,
            || {
                let one = self_inductance_h(&SEED);
                worst(
                    [1e-9, 1e-3, 1e3, 1e9].map(|k| {
                        let w = winding(0.012 * k, 0.019 * k, 0.1 * k, 1429.0);
                        off(self_inductance_h(&w) / k, one)
                    }),
                    "relative difference",
                )
            },
        ),
        case(
            "geometry: mutual inductance 100 m apart",
            "two dipoles side by side, -mu_0 m^2 / (4 pi d^3), and the stage's 1e-6",
            2e-6,
            || {
                let moment =
                    1429.0 * PI * (0.012_f64.powi(2) + 0.012 * 0.019 + 0.019_f64.powi(2)) / 3.0;
                let wanted = -MU_0_T_M_PER_A * moment * moment / (4.0 * PI * 1e6);
                close(mutual_inductance_h(&SEED, 100.0), wanted, "H")
            },
        ),
        case(
            "geometry: inductance of a winding without a bore",
            "what a bore of 1 pm leaves of it, but for the bore's share of 1e-10",
            1e-9,
            || {
                let bored = winding(1e-12, 0.021, 0.017, 700.0);
                close(self_inductance_h(&bored), self_inductance_h(&SOLID), "H")
            },
        ),
        case(
            "geometry: a point at infinity",
            "zero field or a refusal, never a not-a-number that passes for a field",
            0.0,
            || match SEED.field(0.01, f64::MAX) {
                Err(message) => holds(true, message.to_string()),
                Ok(f) => measured(
                    if f.b_z.abs() < 1e-300 && f.dbz_dz.abs() < 1e-300 {
                        0.0
                    } else {
                        f64::INFINITY
                    },
                    format!("B_z {:e} T/A, dB_z/dz {:e} T/m/A", f.b_z, f.dbz_dz),
                ),
            },
        ),
    ]
}
