//! One coil and a hundred; touching, far apart, coincident.

use std::f64::consts::PI;
use std::path::Path;

use super::check::{Outcome, SEED, close, holds, measured, off, refused, reported, worst};
use super::{Case, case};
use fluxform::coil::drive::Drive;
use fluxform::coil::inductance::self_inductance_h;
use fluxform::coil::mutual::{inductance_matrix_h, mutual_inductance_h};
use fluxform::design::array::grid_positions_m;
use fluxform::design::{Design, Need};
use fluxform::field::steel::CoreShape;
use fluxform::field::steel::array::CoupledArray;
use fluxform::field::steel::cored_coil::CoredCoil;
use fluxform::field::steel::symmetry::motions;
use fluxform::numerics::gauss;

const CORE: CoreShape = CoreShape {
    radius_m: 0.012,
    bottom_m: -0.11,
    top_m: 0.0,
};

pub fn cases() -> Vec<Case> {
    [in_air(), with_steel(), as_designs()].concat()
}

/// Flux of one winding through the other's turns, from B_z over their discs.
fn by_flux(distance_m: f64) -> Outcome {
    const ANGLES: usize = 48;
    let (few, many) = (gauss::rule(6), gauss::rule(14));
    let mut sum = 0.0;
    for (x, wx) in few.nodes.iter().zip(&few.weights) {
        let a = 0.0155 + 0.0035 * x;
        for (y, wy) in many.nodes.iter().zip(&many.weights) {
            let z = -0.05 * (1.0 + y);
            for (t, wt) in many.nodes.iter().zip(&many.weights) {
                let rho = 0.5 * a * (1.0 + t);
                for k in 0..ANGLES {
                    let angle = PI * (k as f64 + 0.5) / ANGLES as f64;
                    let r = (distance_m + rho * angle.cos()).hypot(rho * angle.sin());
                    let b_z = SEED.field(r, z).map_err(reported)?.b_z;
                    sum += wx * wy * wt * rho * 0.5 * a * b_z;
                }
            }
        }
    }
    // Two halves of the angle, means over the section, all turns.
    let flux = sum * 0.25 * 2.0 * PI / ANGLES as f64 * SEED.turns;
    close(mutual_inductance_h(&SEED, distance_m), flux, "H")
}

fn matrix(columns: usize, rows: usize, pitch_m: f64) -> Vec<f64> {
    let axes = grid_positions_m(rows, columns, pitch_m * 1e3);
    inductance_matrix_h(&SEED, self_inductance_h(&SEED), &axes).concat()
}

fn in_air() -> Vec<Case> {
    vec![
        case(
            "arrays: two touching coils, mutual inductance",
            "flux of the one through the other's turns, H, to the stated 1e-3",
            1e-3,
            || by_flux(0.038),
        ),
        case(
            "arrays: two coils 1 nm apart, mutual inductance",
            "that of touching ones, H",
            1e-6,
            || {
                close(
                    mutual_inductance_h(&SEED, 0.038 + 1e-9),
                    mutual_inductance_h(&SEED, 0.038),
                    "H",
                )
            },
        ),
        case(
            "arrays: two coils 12 mm apart, mutual inductance",
            "flux of the one through the other's turns, H, to the stated 1e-6 and the flux' 1e-6",
            3e-6,
            || by_flux(0.05),
        ),
        case(
            "arrays: nine touching coils",
            "every current has an energy above 0: nine time constants of their own",
            0.0,
            || {
                let drive = Drive::new(&matrix(3, 3, 0.038), &[6.0; 9], None).map_err(reported)?;
                let [short, long] = drive.time_constants_s().ok_or("none")?;
                holds(
                    short > 0.0 && long < 9.0 * short,
                    format!("{short:.4e} to {long:.4e} s"),
                )
            },
        ),
        case(
            "arrays: a hundred touching coils",
            "every current has an energy above 0; the mean of the time constants is L / R",
            0.0,
            || {
                let m = matrix(10, 10, 0.038);
                let drive = Drive::new(&m, &[6.0; 100], None).map_err(reported)?;
                let [short, long] = drive.time_constants_s().ok_or("none")?;
                let mean = self_inductance_h(&SEED) / 6.0;
                holds(
                    short > 0.0 && short < mean && mean < long,
                    format!("{short:.4e} to {long:.4e} s"),
                )
            },
        ),
        case(
            "arrays: one coil",
            "its self inductance alone, H",
            0.0,
            || {
                let m = matrix(1, 1, 0.05);
                measured(off(m[0], self_inductance_h(&SEED)), format!("{m:?} H"))
            },
        ),
        case(
            "arrays: a hundred coils, positions",
            "centred, mirrored exactly, neighbours a pitch apart",
            1e-15,
            || {
                let p = grid_positions_m(10, 10, 50.0);
                let mirrored =
                    (0..100).all(|i| p[i][0] == -p[99 - i][0] && p[i][1] == -p[99 - i][1]);
                if !mirrored {
                    return Err("not mirrored".to_owned());
                }
                worst(
                    (0..9).map(|i| off(p[i + 1][0] - p[i][0], 0.05) * 0.1),
                    "pitch, of the array's size",
                )
            },
        ),
        case(
            "arrays: coincident axes, symmetry",
            "the motions found keep every coil in place or exchange equals; nothing hangs",
            0.0,
            || {
                let found = motions(&[[0.01, 0.02]; 3]);
                holds(
                    found.iter().all(|m| m.coil.iter().all(|&c| c < 3)),
                    format!("{} motions", found.len()),
                )
            },
        ),
    ]
}

fn coupled(positions_m: &[[f64; 2]], tolerance: f64) -> Result<CoupledArray, String> {
    CoupledArray::new(&SEED, CORE, 1000.0, positions_m, tolerance, 0.01).map_err(reported)
}

fn alone() -> Result<f64, String> {
    let coil = CoredCoil::new(&SEED, CORE, 1000.0, 1e-6, 0.01).map_err(reported)?;
    Ok(coil.added_inductance_h)
}

/// Symmetry and energy of an array's inductances, air part included.
fn sound(array: &CoupledArray, positions_m: &[[f64; 2]]) -> Outcome {
    let count = positions_m.len();
    let added = &array.added_inductance_h;
    let air = inductance_matrix_h(&SEED, self_inductance_h(&SEED), positions_m).concat();
    let whole: Vec<f64> = (0..count * count)
        .map(|k| air[k] + added[(k / count, k % count)])
        .collect();
    Drive::new(&whole, &vec![6.0; count], None).map_err(reported)?;
    let largest = added.amax();
    worst(
        (0..count * count).map(|k| {
            (added[(k / count, k % count)] - added[(k % count, k / count)]).abs() / largest
        }),
        &format!("estimate {:.1e}; M_ij against M_ji", array.relative_error),
    )
}

fn with_steel() -> Vec<Case> {
    vec![
        case(
            "arrays: one cored coil as an array",
            "the single coil's inductance, H, to both tolerances",
            1.1e-4,
            || {
                let array = coupled(&[[0.013, -0.007]], 1e-4)?;
                close(array.added_inductance_h[(0, 0)], alone()?, "H")
            },
        ),
        case(
            "arrays: two cored coils 100 m apart",
            "the single coil's inductance; mutual below 1e-9 of it",
            1.1e-4,
            || {
                let array = coupled(&[[0.0, 0.0], [100.0, 3.0]], 1e-4)?;
                let added = &array.added_inductance_h;
                worst(
                    [
                        off(added[(0, 0)], alone()?),
                        1e5 * (added[(0, 1)] / added[(0, 0)]).abs(),
                    ],
                    &format!("{:.6e} and {:.1e} H", added[(0, 0)], added[(0, 1)]),
                )
            },
        ),
        case(
            "arrays: four touching cored coils",
            "M_ij = M_ji to the tolerance, every current has an energy above 0",
            1e-4,
            || {
                let p = grid_positions_m(2, 2, 38.0);
                sound(&coupled(&p, 1e-4)?, &p)
            },
        ),
        case(
            "arrays: five scattered cored coils",
            "M_ij = M_ji to the tolerance, every current has an energy above 0",
            1e-4,
            || {
                let p = [
                    [0.0, 0.0],
                    [0.053, 0.007],
                    [-0.031, 0.049],
                    [0.022, -0.061],
                    [-0.047, -0.013],
                ];
                sound(&coupled(&p, 1e-4)?, &p)
            },
        ),
        case(
            "arrays: a hundred cored coils",
            "M_ij = M_ji to the tolerance, every current has an energy above 0",
            1e-3,
            || {
                let p = grid_positions_m(10, 10, 50.0);
                sound(&coupled(&p, 1e-3)?, &p)
            },
        )
        .not_in_ci()
        .within(1800.0),
    ]
}

/// A design of coils at the places given, mm.
fn design(array: &str) -> Result<Design, String> {
    let text = format!(
        "name = \"array\"\n[coil]\ninner_diameter_mm = 24.0\nouter_diameter_mm = 38.0\n\
         length_mm = 100.0\n[wire]\ndiameter_mm = 0.7\n[magnet]\ndiameter_mm = 10.0\n\
         length_mm = 10.0\nmagnetization_a_per_m = 1.1579e6\n[supply]\ncurrent_max_a = 2.0\n\
         [target]\nheight_mm = 30.0\n[array]\n{array}\n"
    );
    Design::from_toml(&text, Path::new("array.toml"), Need::PROBE)
        .map(|(design, _)| design)
        .map_err(|invalid| invalid.faults.plain())
}

fn as_designs() -> Vec<Case> {
    let overlap = "refused: coils overlap, named with their distance";
    vec![
        case("arrays: two coincident coils", overlap, 0.0, || {
            refused(
                design("positions_mm = [[3.0, 4.0], [3.0, 4.0]]"),
                &["coils 0 and 1 overlap", "0 mm apart"],
            )
        }),
        case(
            "arrays: two coils that overlap by 1 nm",
            overlap,
            0.0,
            || {
                refused(
                    design("positions_mm = [[0.0, 0.0], [37.999999, 0.0]]"),
                    &["overlap", "37.999999"],
                )
            },
        ),
        case(
            "arrays: two coils that touch",
            "accepted: touching is no overlap",
            0.0,
            || {
                let d = design("positions_mm = [[0.0, 0.0], [38.0, 0.0]]")?;
                holds(d.array.positions_m.len() == 2, "two coils")
            },
        ),
        case(
            "arrays: a hundred touching coils as a design",
            "accepted: 100 coils",
            0.0,
            || {
                let d = design("rows = 10\ncolumns = 10\npitch_mm = 38.0")?;
                holds(d.array.positions_m.len() == 100, "100 coils")
            },
        ),
        case("arrays: a million coils", "refused: too many", 0.0, || {
            refused(
                design("rows = 1000\ncolumns = 1000\npitch_mm = 50.0"),
                &["10000"],
            )
        }),
        case("arrays: no coil", "refused: at least one", 0.0, || {
            refused(design("rows = 0\ncolumns = 3\npitch_mm = 50.0"), &["rows"])
        }),
        case(
            "arrays: a coil at no place",
            "refused: finite numbers only",
            0.0,
            || refused(design("positions_mm = [[0.0, nan]]"), &["finite"]),
        ),
    ]
}
