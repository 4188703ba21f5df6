//! Windings from 100 m, on their edges and faces, cut in two; inductances from disc to needle.

use std::f64::consts::PI;

use super::check::{
    Outcome, SEED, close, holds, known_winding, measured, number, off, refused, reported, winding,
    worst,
};
use super::geometry::{DISC, FILM, LEAF, NEEDLE, SOLID};
use super::{Case, case};
use fluxform::coil::inductance::self_inductance_h;
use fluxform::coil::mutual::mutual_inductance_h;
use fluxform::field::components::Components;
use fluxform::field::winding::{AxialField, Winding};
use fluxform::units::MU_0_T_M_PER_A;

pub fn cases() -> Vec<Case> {
    [far_away(), singular_lines(), inductances()].concat()
}

/// The field against that of a dipole in the winding's middle, over 6 (R / d)^2: the next
/// multipole's largest share (3.4 for a long winding's gradient, 2.5 for a wide one's).
fn dipole(w: &Winding, r_m: f64, z_m: f64) -> Outcome {
    let (a1, a2) = (w.inner_radius_m, w.outer_radius_m);
    let moment = w.turns * PI * (a1 * a1 + a1 * a2 + a2 * a2) / 3.0;
    let z = z_m + 0.5 * w.length_m;
    let d = r_m.hypot(z);
    let scale = MU_0_T_M_PER_A * moment / (4.0 * PI);
    let found = w.field(r_m, z_m).map_err(reported)?;
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
        .gradients(&r, &z, tolerance, Components::Gradient)
        .map_err(reported)?;
    let sure: Result<Vec<AxialField>, _> = r.iter().map(|&r| SEED.field(r, z_m)).collect();
    let sure = sure.map_err(reported)?;
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
                    SEED.field(0.0133, 1e-9).map_err(reported)?,
                    SEED.field(0.0133, -0.1 - 1e-9).map_err(reported)?,
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
    let near = SEED.field(r_m, z_m + side * 1e-9).map_err(reported)?;
    let far = SEED.field(r_m, z_m + side * 1e-6).map_err(reported)?;
    let per_e = MU_0_T_M_PER_A * SEED.current_density_per_m2() / (2.0 * PI);
    close(
        near.dbz_dz - far.dbz_dz,
        sign * per_e * 1000.0_f64.ln(),
        "T/m/A",
    )
}

/// Outside against inside, 2 nm apart.
fn jump(outside: (f64, f64), inside: (f64, f64), of_face: bool) -> Outcome {
    let out = SEED.field(outside.0, outside.1).map_err(reported)?;
    let within = SEED.field(inside.0, inside.1).map_err(reported)?;
    let whole = MU_0_T_M_PER_A * SEED.current_density_per_m2();
    let found = if of_face {
        within.dbr_dz - out.dbr_dz
    } else {
        out.dbz_dr - within.dbz_dr
    };
    worst(
        [
            off(found, whole),
            // The field changes by its slope times 2 nm: 1e-7 of slope times radius.
            (within.b_z - out.b_z).abs() / (whole * SEED.outer_radius_m),
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
            upper.field(r, z).map_err(reported)?,
            lower.field(r, z + depth).map_err(reported)?,
        ],
        SEED.field(r, z).map_err(reported)?,
    )
}

fn cut_along(gap_m: f64) -> Outcome {
    let at = 0.0151;
    let inner = winding(0.012, at, 0.1, 1429.0 * (at - 0.012) / 0.007);
    let outer = winding(at, 0.019, 0.1, 1429.0 * (0.019 - at) / 0.007);
    let (r, z) = (at + gap_m, -0.043);
    sum_of(
        [
            inner.field(r, z).map_err(reported)?,
            outer.field(r, z).map_err(reported)?,
        ],
        SEED.field(r, z).map_err(reported)?,
    )
}

/// A winding of the committed 20-digit inductances.
fn exact_inductance(name: &str) -> Outcome {
    let (table, w) = known_winding(name)?;
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
                let expected = MU_0_T_M_PER_A * a * 9.0 * ((8.0 * a / mean).ln() - 2.0);
                close(self_inductance_h(&ring), expected, "H")
            },
        ),
        case(
            "geometry: inductance of a needle",
            "mu_0 N^2 pi a^2 / l (1 - 8 a / (3 pi l) + a^2 / (2 l^2)), up to depth / radius",
            3e-6,
            || {
                let (a, w, l) = (0.0005, 1e-9, 0.7);
                let ratio: f64 = a / l;
                let expected = MU_0_T_M_PER_A * 1e6 * PI * a * a / l
                    * (1.0 - 8.0 * ratio / (3.0 * PI) + 0.5 * ratio * ratio);
                close(
                    self_inductance_h(&winding(a, a + w, l, 1000.0)),
                    expected,
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
                let expected = -MU_0_T_M_PER_A * moment * moment / (4.0 * PI * 1e6);
                close(mutual_inductance_h(&SEED, 100.0), expected, "H")
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
