//! Steel from next to nothing to next to infinite, and curves with kinks from no current to any.

use super::check::{
    Outcome, SEED, holds, measured, number, numbers, off, oracle, refused, reported, winding, worst,
};
use super::{Case, case};
use fluxform::field::steel::CoreShape;
use fluxform::field::steel::bh_curve::BhCurve;
use fluxform::field::steel::cored_coil::{CoredCoil, Excitation};
use fluxform::field::steel::generatrix::{Generatrix, Resolution};
use fluxform::field::steel::permeability::{Constant, Permeability, Response};
use fluxform::field::steel::saturated::{Convergence, SaturatedCore};
use fluxform::field::winding::Winding;
use fluxform::numerics::gauss;
use fluxform::units::MU_0_T_M_PER_A;

const CORE: CoreShape = core(0.012, -0.11, 0.0);

const fn core(radius_m: f64, bottom_m: f64, top_m: f64) -> CoreShape {
    CoreShape {
        radius_m,
        bottom_m,
        top_m,
    }
}

pub fn cases() -> Vec<Case> {
    [
        weak_and_strong(),
        shapes(),
        curves(),
        bad_curves(),
        saturated(),
    ]
    .concat()
}

fn solved(relative_permeability: f64, tolerance: f64) -> Result<CoredCoil, String> {
    CoredCoil::new(&SEED, CORE, relative_permeability, tolerance, 0.006).map_err(reported)
}

/// Part of steel of susceptibility `chi`, over chi.
fn per_chi(chi: f64) -> Result<[f64; 2], String> {
    let mu_r = 1.0 + chi;
    let coil = solved(mu_r, 1e-8)?;
    let chi = mu_r - 1.0;
    Ok([
        coil.core.field(0.0, 0.03).dbz_dz / chi,
        coil.added_inductance_h / chi,
    ])
}

/// Against chi = 1e-6, whose second order is chi times a demagnetising factor below 1.
fn weak(chi: f64) -> Outcome {
    let (found, expected) = (per_chi(chi)?, per_chi(1e-6)?);
    worst(
        [0, 1].map(|k| off(found[k], expected[k])),
        &format!("{:.6e} T/m/A and {:.6e} H per chi", found[0], found[1]),
    )
}

/// Gradient at 30 mm and added inductance of two permeabilities.
fn limit(mu_r: f64, other: f64) -> Outcome {
    let (a, b) = (solved(mu_r, 1e-7)?, solved(other, 1e-7)?);
    let of = |c: &CoredCoil| [c.core.field(0.0, 0.03).dbz_dz, c.added_inductance_h];
    let (found, expected) = (of(&a), of(&b));
    worst(
        [0, 1].map(|k| off(found[k], expected[k])),
        &format!("{:.9e} T/m/A, {:.9e} H", found[0], found[1]),
    )
}

fn weak_and_strong() -> Vec<Case> {
    let first = "what it adds is in proportion to chi, to 1e-6 and the solver's 1e-8 a component";
    vec![
        case("materials: mu_r = 1", "air: nothing added", 0.0, || {
            let coil = solved(1.0, 1e-6)?;
            let (with, without) = (
                coil.field(0.007, 0.013).map_err(reported)?,
                SEED.field(0.007, 0.013).map_err(reported)?,
            );
            holds(
                coil.added_inductance_h == 0.0 && with == without,
                format!("{} H added", coil.added_inductance_h),
            )
        }),
        case("materials: mu_r = 1 + 1e-12", first, 3e-6, || weak(1e-12)),
        case("materials: mu_r = 1 + 1e-9", first, 3e-6, || weak(1e-9)),
        case("materials: mu_r = 1 - 1e-9", first, 3e-6, || weak(-1e-9)),
        case(
            "materials: mu_r = 0.5",
            "inductance is taken away, by less than the air coil's",
            0.0,
            || {
                let found = solved(0.5, 1e-6)?.added_inductance_h;
                holds(found < 0.0 && found > -0.0145, format!("{found:.6e} H"))
            },
        ),
        case(
            "materials: mu_r = 1e-9",
            "a superconductor's limit: as 1e-6, to 1e-6 over the demagnetising factor",
            1e-3,
            || limit(1e-9, 1e-6),
        ),
        case(
            "materials: mu_r = 1e6",
            "as 1e9, to 1 / (N mu_r), N > 0.01",
            1e-4,
            || limit(1e6, 1e9),
        ),
        case(
            "materials: mu_r = 1e9",
            "as 1e14, to the solver's 1e-7 a side",
            1e-6,
            || limit(1e9, 1e14),
        ),
        case(
            "materials: mu_r from 1.1 to 1e9",
            "inductance grows with permeability, and ever less than in proportion to chi",
            0.0,
            || {
                let mut before = (0.0, f64::INFINITY);
                let mut good = true;
                for mu_r in [1.1, 2.0, 10.0, 1e2, 1e3, 1e4, 1e6, 1e9] {
                    let added = solved(mu_r, 1e-6)?.added_inductance_h;
                    good &= added > before.0 && added / (mu_r - 1.0) < before.1;
                    before = (added, added / (mu_r - 1.0));
                }
                holds(good, format!("{:.6e} H at 1e9", before.0))
            },
        ),
        case(
            "materials: a wire of aspect 1000, mu_r = 50",
            "B inside is mu_r times the applied, to N chi = 3e-4 and the ends",
            2e-3,
            || {
                let w = winding(6e-5, 0.019, 0.1, 1000.0);
                let coil = CoredCoil::new(&w, core(5e-5, -0.1, 0.0), 50.0, 1e-6, 1e-3)
                    .map_err(reported)?;
                let inside = coil.field(1.7e-5, -0.049).map_err(reported)?.b_z;
                let applied = w.field(1.7e-5, -0.049).map_err(reported)?.b_z;
                measured(
                    off(inside / applied, 50.0),
                    format!("{:.6} times", inside / applied),
                )
            },
        ),
        case(
            "materials: a coin of aspect 1000 across the field, mu_r = 2",
            "B inside is the applied one, to chi (1 - N) = 2e-3",
            3e-3,
            || {
                let w = winding(0.012, 0.019, 1.0, 1000.0);
                let coil = CoredCoil::new(&w, core(0.01, -0.50001, -0.49999), 2.0, 1e-6, 1e-3)
                    .map_err(reported)?;
                let inside = coil.field(0.001, -0.5).map_err(reported)?.b_z;
                let applied = w.field(0.001, -0.5).map_err(reported)?.b_z;
                measured(
                    off(inside / applied, 1.0),
                    format!("{:.6} times", inside / applied),
                )
            },
        ),
    ]
}

/// The error against a much finer resolution, over the estimate.
fn shape(w: &Winding, shape: CoreShape, mu_r: f64) -> Outcome {
    let finest = Resolution {
        order: 15,
        ratio: 0.2,
        tip: 1e-6,
        quadrature: 1e-13,
    };
    let lowest_m = shape.top_m.max(0.0) + 0.5 * shape.radius_m;
    let coil = CoredCoil::new(w, shape, mu_r, 1e-6, lowest_m).map_err(reported)?;
    let fine = CoredCoil::at_resolution(w, shape, mu_r, &finest).map_err(reported)?;
    let size = coil.field(0.0, lowest_m).map_err(reported)?.gradient_norm();
    let own = 0.1 * MU_0_T_M_PER_A * w.turns.powi(2) * w.inner_radius_m;
    let difference = (coil.added_inductance_h - fine.added_inductance_h).abs();
    let errors = [
        difference / coil.added_inductance_h.abs().max(own),
        (coil.core.field(0.0, lowest_m).dbz_dz - fine.core.field(0.0, lowest_m).dbz_dz).abs()
            / size,
    ];
    let estimate = coil.relative_error;
    if estimate > 1e-6 {
        return Err(format!("only {estimate:e} was reached"));
    }
    worst(
        errors.map(|e| e / estimate),
        &format!(
            "estimate {estimate:.1e}, {:.6e} H added; error over estimate",
            coil.added_inductance_h
        ),
    )
}

fn shapes() -> Vec<Case> {
    let words = "1e-6 is reached, and the estimate covers the distance from a far finer solution";
    vec![
        case(
            "materials: a coin at the top, mu_r = 1e9",
            words,
            1.0,
            || shape(&SEED, core(0.012, -0.0001, 0.0), 1e9),
        ),
        case(
            "materials: a micrometre of air about the core, mu_r = 1e9",
            words,
            1.0,
            || shape(&SEED, core(0.011_999, -0.11, 0.0), 1e9),
        ),
        case(
            "materials: a core that stands 10 nm out, mu_r = 1e9",
            words,
            1.0,
            || shape(&SEED, core(0.012, -0.100_000_01, 1e-8), 1e9),
        ),
        case(
            "materials: a wire through a short coil, mu_r = 1e9",
            words,
            1.0,
            || {
                shape(
                    &winding(1e-4, 0.019, 0.001, 1000.0),
                    core(1e-4, -0.05, 0.05),
                    1e9,
                )
            },
        ),
        case(
            "materials: a core far below its coil, mu_r = 0.5",
            words,
            1.0,
            || shape(&SEED, core(0.01, -0.3, -0.2), 0.5),
        ),
    ]
}

fn table(name: &str) -> Result<(Vec<f64>, Vec<f64>), String> {
    let all = oracle(include_str!("../../oracles/bh_curve.json"))?;
    Ok((
        numbers(&all[name]["b_t"])?,
        numbers(&all[name]["h_a_per_m"])?,
    ))
}

fn curve(name: &str) -> Result<BhCurve, String> {
    let (b, h) = table(name)?;
    BhCurve::new(&b, &h).map_err(reported)
}

/// Steep, then a kink at 1.5 T, then as vacuum.
fn kinked() -> Result<BhCurve, String> {
    let knee = 1.5 / (1e4 * MU_0_T_M_PER_A);
    let last = knee + 1.0 / MU_0_T_M_PER_A;
    BhCurve::new(&[0.0, 0.75, 1.5, 2.5], &[0.0, 0.5 * knee, knee, last]).map_err(reported)
}

fn back_and_forth(curve: &BhCurve) -> Outcome {
    let found = (-120..=40).map(|e| {
        let b = 10.0_f64.powf(0.1 * f64::from(e));
        off(curve.b_t(curve.h_a_per_m(b)), b)
    });
    worst(found, "B back from its H, 1e-12 T to 1e4 T")
}

fn scipy(name: &str) -> Outcome {
    let all = oracle(include_str!("../../oracles/bh_curve.json"))?;
    let curve = curve(name)?;
    let mut errors = Vec::new();
    for point in all[name]["points"].as_array().ok_or("no points")? {
        let b = number(&point["b_t"])?;
        errors.push(off(curve.h_a_per_m(b), number(&point["h_a_per_m"])?));
        errors.push(off(curve.dh_db(b), number(&point["dh_db_m_per_h"])?));
        errors.push(off(
            curve.energy_j_per_m3(b),
            number(&point["energy_j_per_m3"])?,
        ));
    }
    worst(errors, "H, dH/dB and energy")
}

fn curves() -> Vec<Case> {
    let pchip = "scipy's monotone cubics: H, slope and energy";
    let inverse = "B(H(B)) = B from 1e-12 T to 1e4 T";
    vec![
        case("materials: curve of a steel", pchip, 1e-12, || {
            scipy("steel_1010")
        }),
        case("materials: curve of three points", pchip, 1e-12, || {
            scipy("three_points")
        }),
        case("materials: curve that starts level", pchip, 1e-12, || {
            scipy("level_origin")
        }),
        case("materials: curve with uneven steps", pchip, 1e-12, || {
            scipy("uneven")
        }),
        case(
            "materials: curve of a steel, there and back",
            inverse,
            1e-12,
            || back_and_forth(&curve("steel_1010")?),
        ),
        case(
            "materials: kinked curve, there and back",
            inverse,
            1e-12,
            || back_and_forth(&kinked()?),
        ),
        case(
            "materials: a steel at 1 kT",
            "slope of vacuum beyond the table: 1 / mu_0, A/m/T",
            1e-12,
            || {
                let c = curve("steel_1010")?;
                let slope = (c.h_a_per_m(1000.0) - c.h_a_per_m(500.0)) / 500.0;
                measured(off(slope * MU_0_T_M_PER_A, 1.0), format!("{slope:.9e} m/H"))
            },
        ),
        case(
            "materials: energy across a kink",
            "the integral of H dB by Gauss on every interval, J/m^3",
            1e-12,
            || {
                let c = kinked()?;
                let rule = gauss::rule(8);
                let mut sum = 0.0;
                for (from, to) in [(0.0, 0.75), (0.75, 1.5), (1.5, 2.5), (2.5, 7.0)] {
                    for (x, w) in rule.nodes.iter().zip(&rule.weights) {
                        let half: f64 = 0.5 * (to - from);
                        sum += half * w * c.h_a_per_m(from + half * (1.0 + x));
                    }
                }
                measured(
                    off(c.energy_j_per_m3(7.0), sum),
                    format!("{sum:.12e} J/m^3"),
                )
            },
        ),
    ]
}

fn bad_curves() -> Vec<Case> {
    let words = "refused with the row at fault";
    vec![
        case(
            "materials: curve less permeable than vacuum",
            words,
            0.0,
            || {
                refused(
                    BhCurve::new(&[0.0, 1.0, 1.1], &[0.0, 100.0, 1e6]),
                    &["row 3", "vacuum"],
                )
            },
        ),
        case("materials: curve with two equal rows", words, 0.0, || {
            refused(
                BhCurve::new(&[0.0, 1.0, 1.0], &[0.0, 100.0, 200.0]),
                &["row 3", "grow"],
            )
        }),
        case("materials: curve with a not-a-number", words, 0.0, || {
            refused(
                BhCurve::new(&[0.0, f64::NAN, 1.0], &[0.0, 100.0, 200.0]),
                &["row 2", "finite"],
            )
        }),
        case(
            "materials: curve that does not start at the origin",
            words,
            0.0,
            || {
                refused(
                    BhCurve::new(&[0.1, 0.5, 1.0], &[0.0, 100.0, 200.0]),
                    &["first row"],
                )
            },
        ),
        case("materials: curve of one point", words, 0.0, || {
            refused(BhCurve::new(&[0.0], &[0.0]), &["too few"])
        }),
    ]
}

/// Steel of mu_r = 1000 that stops at once at M = 1.3 T / mu_0: a kink in every core.
#[derive(Debug)]
struct Kinked;

const FULL_A_PER_M: f64 = 1.3 / MU_0_T_M_PER_A;

impl Permeability for Kinked {
    fn response(&self, h_a_per_m: f64) -> Response {
        if 999.0 * h_a_per_m < FULL_A_PER_M {
            Response {
                relative: 1000.0,
                differential: 1000.0,
            }
        } else {
            Response {
                relative: 1.0 + FULL_A_PER_M / h_a_per_m,
                differential: 1.0,
            }
        }
    }
}

/// The steel's flux through the winding, Wb, along `law` at each current.
fn fluxes(law: &dyn Permeability, currents_a: &[f64]) -> Result<Vec<f64>, String> {
    let resolution = Resolution::for_tolerance(1e-5);
    let outline = Generatrix::of_coil(&SEED, CORE, &resolution);
    let excitation = Excitation::new(&SEED, &outline, resolution.quadrature).map_err(reported)?;
    let core = SaturatedCore::new(&outline, resolution.quadrature).map_err(reported)?;
    currents_a
        .iter()
        .map(|&current_a| {
            let solution = core.solve(&(&excitation.potential * current_a), law, None);
            if solution.status != Convergence::Converged {
                return Err(format!("{:?} at {current_a:e} A", solution.status));
            }
            Ok(core.flux_linkage_wb(&solution, &excitation.potential))
        })
        .collect()
}

fn saturated() -> Vec<Case> {
    vec![
        case(
            "materials: elements inside the core, constant mu_r = 1000",
            "the surface equation's inductance, to the elements' stated 4e-4",
            4e-4,
            || {
                let found = fluxes(&Constant { relative: 1000.0 }, &[1.0])?[0];
                let expected = solved(1000.0, 1e-7)?.added_inductance_h;
                measured(off(found, expected), format!("{found:.9e} H"))
            },
        ),
        case(
            "materials: a kink far above the field, 1 uA",
            "the linear core's inductance, to the elements' stated 4e-4",
            4e-4,
            || {
                let found = fluxes(&Kinked, &[1e-6])?[0] / 1e-6;
                let expected = solved(1000.0, 1e-7)?.added_inductance_h;
                measured(off(found, expected), format!("{found:.9e} H"))
            },
        ),
        case(
            "materials: a kink far below the field, 10 MA",
            "M everywhere at its most along the coil's field: its flux by quadrature, Wb, to 4e-4",
            4e-4,
            || {
                let found = fluxes(&Kinked, &[1e7])?[0];
                let rule = gauss::rule(40);
                let mut sum = 0.0;
                for (x, wx) in rule.nodes.iter().zip(&rule.weights) {
                    let r = 0.5 * CORE.radius_m * (1.0 + x);
                    for (y, wy) in rule.nodes.iter().zip(&rule.weights) {
                        let z = -0.5 * 0.11 * (1.0 + y);
                        let f = SEED.field(r, z).map_err(reported)?;
                        sum += wx * wy * r * f.b_r.hypot(f.b_z);
                    }
                }
                let volume = std::f64::consts::TAU * 0.5 * CORE.radius_m * 0.5 * 0.11;
                let expected = FULL_A_PER_M * volume * sum;
                measured(
                    off(found, expected),
                    format!("{found:.6e} Wb of {expected:.6e}"),
                )
            },
        ),
        case(
            "materials: a kink crossing the core, 1 mA to 1 kA",
            "every state is found; flux grows with the current, flux over current falls",
            0.0,
            || {
                let currents = [1e-3, 1.0, 3.0, 7.0, 20.0, 100.0, 1000.0];
                let flux = fluxes(&Kinked, &currents)?;
                let mut good = true;
                for k in 1..flux.len() {
                    // Equal below the kink, up to the iteration's rounding.
                    let per = |k: usize| flux[k] / currents[k];
                    good &= flux[k] > flux[k - 1] && per(k) <= per(k - 1) * (1.0 + 1e-9);
                }
                holds(good, format!("{flux:.4?} Wb"))
            },
        ),
        case(
            "materials: a curve without current",
            "no flux, Wb",
            0.0,
            || {
                let found = fluxes(&curve("steel_1010")?, &[0.0])?[0];
                measured(found.abs(), format!("{found} Wb"))
            },
        ),
        case(
            "materials: a curve that starts level, 1 nA to 1 MA",
            "every state is found; flux grows with the current",
            0.0,
            || {
                let flux = fluxes(&curve("level_origin")?, &[1e-9, 1e-3, 1.0, 1e3, 1e6])?;
                holds(
                    flux.windows(2).all(|f| f[1] > f[0] && f[0] > 0.0),
                    format!("{flux:?} Wb"),
                )
            },
        ),
    ]
}
