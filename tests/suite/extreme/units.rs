//! Units, gauges and numbers as text, at both ends.

use std::path::Path;

use super::check::{Outcome, close, holds, measured, off, refused, reported, worst};
use super::{Case, case};
use fluxform::bundle::json::to_json;
use fluxform::commands::evaluate::{Evaluation, evaluate};
use fluxform::design::{Design, Need};
use fluxform::field::dipole::cylinder_moment_a_m2;
use fluxform::progress::Silent;
use fluxform::shape::bodies::BodyOptions;
use fluxform::shape::document::{Placement, parse_unit};
use fluxform::shape::file_mesh::FileMesh;
use fluxform::shape::placement::Transform;
use fluxform::shape::{ShapeError, surface};
use fluxform::units::m_from_mm;

pub fn cases() -> Vec<Case> {
    [lengths(), designs(), numbers()].concat()
}

/// The seed's air coil with every length, and the wire's, times k; in mm.
fn text(k: f64, magnetization: &str) -> String {
    let mm = |length: f64| format!("{:?}", length * k);
    format!(
        "name = \"units\"\n[coil]\ninner_diameter_mm = {}\nouter_diameter_mm = {}\nlength_mm = {}\n\
         turns = 1429\n[wire]\ndiameter_mm = {}\n[magnet]\ndiameter_mm = {}\nlength_mm = {}\n\
         magnetization_a_per_m = {magnetization}\n[supply]\ncurrent_max_a = 2.0\n[target]\n\
         height_mm = {}\n",
        mm(24.0),
        mm(38.0),
        mm(100.0),
        mm(0.7),
        mm(10.0),
        mm(10.0),
        mm(30.0)
    )
}

fn design(text: &str) -> Result<(Design, bool), String> {
    Design::from_toml(text, Path::new("units.toml"), Need::EVALUATE)
        .map(|(design, warnings)| (design, !warnings.is_empty()))
        .map_err(|invalid| invalid.faults.plain())
}

fn evaluated(k: f64, magnetization: &str) -> Result<Evaluation, String> {
    evaluate(&design(&text(k, magnetization))?.0, vec![], None).map_err(reported)
}

/// R ~ 1/k, L ~ k, gradient ~ 1/k^2, field ~ 1/k at the same current; the moment ~ k^3.
fn of_size(k: f64) -> Outcome {
    let (one, other) = (evaluated(1.0, "1.1579e6")?, evaluated(k, "1.1579e6")?);
    worst(
        [
            off(
                other.coil.circuit.resistance_ohm * k,
                one.coil.circuit.resistance_ohm,
            ),
            off(
                other.coil.circuit.inductance_h / k,
                one.coil.circuit.inductance_h,
            ),
            off(other.target.field_t_per_a * k, one.target.field_t_per_a),
            off(
                other.target.gradient_t_per_m_per_a * k * k,
                one.target.gradient_t_per_m_per_a,
            ),
            off(other.target.force_n / k, one.target.force_n),
        ],
        &format!("force {:.6e} N", other.target.force_n),
    )
}

fn unit(name: &str, metres: f64) -> Outcome {
    let found = parse_unit(name).ok_or("unknown")?;
    let placed = Transform::new(found, &Placement::default()).apply([3.0, -7.0, 1e6]);
    worst(
        [
            off(found, metres),
            off(placed[0], 3.0 * metres),
            off(placed[2], 1e6 * metres),
        ],
        &format!("{found} m"),
    )
}

fn lengths() -> Vec<Case> {
    let words = "its metres, and coordinates in proportion";
    vec![
        case("units: micrometres", words, 1e-15, || unit("um", 1e-6)),
        case("units: inches", words, 1e-15, || unit("in", 0.0254)),
        case("units: feet", words, 1e-15, || unit("ft", 0.3048)),
        case("units: metres", words, 0.0, || unit("m", 1.0)),
        case("units: furlongs", "unknown, not guessed", 0.0, || {
            holds(parse_unit("furlong").is_none(), "none")
        }),
        case("units: MM in capitals", "unknown, not guessed", 0.0, || {
            holds(parse_unit("MM").is_none(), "none")
        }),
        case(
            "units: a surface without a unit",
            "refused: no guess",
            0.0,
            || refused(read_surface(None), &["unit"]),
        ),
        case(
            "units: a surface in units of 0 m",
            "refused: it must be positive",
            0.0,
            || refused(read_surface(Some(0.0)), &["positive"]),
        ),
        case(
            "units: millimetres to metres",
            "38 and 0.7 exactly, 1e-300 and 1e300 mm to one rounding",
            f64::EPSILON,
            || {
                let exact =
                    m_from_mm(38.0) == 0.038 && m_from_mm(0.7) == 7e-4 && m_from_mm(1e300) == 1e297;
                measured(
                    off(m_from_mm(1e-300), 1e-303) + f64::from(u8::from(!exact)),
                    "38 mm, 0.7 mm, 1e300 mm",
                )
            },
        ),
    ]
}

fn designs() -> Vec<Case> {
    let words = "R ~ 1/size, L ~ size, field ~ 1/size, gradient ~ 1/size^2, force on the magnet's size^3 ~ size";
    vec![
        case("units: a coil of micrometres", words, 1e-11, || {
            of_size(1e-3)
        }),
        case("units: a coil of nanometres", words, 1e-11, || {
            of_size(1e-6)
        }),
        case("units: a coil of kilometres", words, 1e-11, || of_size(1e4)),
        case(
            "units: magnetisation of 1e-9 A/m and 1e12 A/m",
            "force in proportion, N",
            1e-14,
            || {
                let one = evaluated(1.0, "1.1579e6")?.target.force_n;
                let (weak, strong) = (
                    evaluated(1.0, "1e-9")?.target.force_n,
                    evaluated(1.0, "1e12")?.target.force_n,
                );
                worst(
                    [
                        off(weak / 1e-9, one / 1.1579e6),
                        off(strong / 1e12, one / 1.1579e6),
                    ],
                    &format!("{weak:.3e} and {strong:.3e} N"),
                )
            },
        ),
        case(
            "units: the seed's magnet",
            "M pi d^2 l / 4 = 0.90941 A m^2, to the five digits stated",
            1e-5,
            || {
                close(
                    cylinder_moment_a_m2(0.01, 0.01, 1.1579e6),
                    0.909_41,
                    "A m^2",
                )
            },
        ),
        case(
            "units: metres in a millimetre key",
            "accepted with a warning",
            0.0,
            || {
                let (_, warned) = design(&text(1e-3, "1.1579e6"))?;
                holds(warned, if warned { "warned" } else { "silent" })
            },
        ),
        case(
            "units: tesla in an A/m key",
            "accepted with a warning",
            0.0,
            || {
                let (_, warned) = design(&text(1.0, "1.45"))?;
                holds(warned, if warned { "warned" } else { "silent" })
            },
        ),
        case(
            "units: a length that is not a number",
            "refused with the key",
            0.0,
            || {
                let bad = text(1.0, "1.1579e6").replace("length_mm = 100.0", "length_mm = nan");
                refused(design(&bad), &["coil.length_mm"])
            },
        ),
        case(
            "units: a length of 1e400",
            "refused: not finite, or not TOML",
            0.0,
            || {
                let bad = text(1.0, "1.1579e6").replace("length_mm = 100.0", "length_mm = 1e400");
                refused(design(&bad), &[""])
            },
        ),
        case(
            "units: a length of 1e-300 mm",
            "a refusal, or a finite result",
            0.0,
            || {
                let tiny = text(1.0, "1.1579e6").replace("length_mm = 100.0", "length_mm = 1e-300");
                match design(&tiny).and_then(|d| evaluate(&d.0, vec![], None).map_err(reported)) {
                    Err(message) => holds(true, format!("refused: {message}")),
                    Ok(e) => holds(
                        e.coil.circuit.inductance_h.is_finite() && e.target.force_n.is_finite(),
                        format!(
                            "{:e} H, {:e} N",
                            e.coil.circuit.inductance_h, e.target.force_n
                        ),
                    ),
                }
            },
        ),
    ]
}

fn back(value: f64) -> Outcome {
    let json = to_json(&[value]).map_err(reported)?;
    let read: Vec<f64> = serde_json::from_slice(&json).map_err(reported)?;
    holds(
        read == [value],
        format!(
            "{value:e} as {}",
            String::from_utf8_lossy(&json).replace(['[', ']', '\n', ' '], "")
        ),
    )
}

fn numbers() -> Vec<Case> {
    let words = "the same double back from JSON";
    vec![
        case("units: the smallest double as text", words, 0.0, || {
            back(5e-324)
        }),
        case("units: the largest double as text", words, 0.0, || {
            back(f64::MAX)
        }),
        case("units: a double of 17 digits as text", words, 0.0, || {
            back(0.1 + 0.2)
        }),
        case("units: mu_0 as text", words, 0.0, || {
            back(fluxform::units::MU_0_T_M_PER_A)
        }),
        case(
            "units: a not-a-number as text",
            "refused: JSON has none",
            0.0,
            || refused(to_json(&[f64::NAN]), &["finite"]),
        ),
        case(
            "units: an infinity as text",
            "refused: JSON has none",
            0.0,
            || refused(to_json(&[f64::INFINITY]), &["finite"]),
        ),
    ]
}

fn read_surface(stated_m: Option<f64>) -> Result<(FileMesh, f64), ShapeError> {
    let path = Path::new("surface.stl");
    surface::read(path, stated_m, &BodyOptions::default(), &Silent)
}
