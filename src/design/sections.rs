//! The design file's keys: one line each, with its rule and its default.
//!
//! The sections are read into a draft in the file's own units, with the place of every value that a
//! check may speak of.

use super::array::{COILS_MAX, grid_positions_m};
use super::message_text::number;
use super::model::{ArrayGrid, Coupling, Driver, MagnetModel, Polarity};
use super::reader::{Located, Section};
use super::rule::{
    BODY_MM, Bound, LOW_CARBON_KNEE_T, MAGNET_MM, OFFSET_MM, RELATIVE_PERMEABILITY,
    RELATIVE_PERMEABILITY_DEFAULT, Rule, WIRE_MM, slip,
};
use super::values::OneOrMany;
use fluxform_base::heating::Cooling;
use fluxform_base::uncertainty::Uncertainty;
use fluxform_base::units::{MU_0_T_M_PER_A, REFERENCE_TEMPERATURE_C, m_from_mm};
use fluxform_numerics::axis::Axis;

/// By its linear law copper has no resistivity at -234.45 C.
const COLDEST_COPPER_C: f64 = -234.4;

/// Resistivity of copper at 20 C, ohm m.
const COPPER_RESISTIVITY_OHM_M: f64 = 1.68e-8;

/// Metals lie between 1e-8 and 2e-6.
const RESISTIVITY_OHM_M: Rule = Rule::any("ohm m").slips(&[
    slip(0.0, 1e-9, "a slip of the exponent", 1.0),
    slip(1e-4, 0.5, "ohm mm^2/m", 1e-6),
    slip(0.5, 10.0, "microohm cm", 1e-8),
    slip(10.0, 1e4, "nanoohm m", 1e-9),
]);
const MAGNETIZATION_A_PER_M: Rule = Rule::any("A/m").slips(&[
    slip(0.0, 3.0, "tesla", 1.0 / MU_0_T_M_PER_A),
    slip(3.0, 5000.0, "kA/m", 1000.0),
]);
const CONDUCTIVITY_S_PER_M: Rule = Rule::any("S/m")
    .bound(Bound::NotNegative)
    .slips(&[slip(0.0, 1000.0, "MS/m", 1e6)]);
const AMPERE: Rule = Rule::any("A");
const BANDWIDTH_HZ: Rule = Rule::any("Hz");

/// `[coil]`, mm.
#[derive(Debug)]
pub struct CoilDraft {
    pub inner: Located<f64>,
    pub outer: Located<f64>,
    pub length: Located<f64>,
    pub turns: Option<Located<f64>>,
}

pub fn coil(mut s: Section<'_>) -> Option<CoilDraft> {
    let draft = s.is_present().then(|| CoilDraft {
        inner: s.required("inner_diameter_mm", &BODY_MM.positive()),
        outer: s.required("outer_diameter_mm", &BODY_MM.positive()),
        length: s.required("length_mm", &BODY_MM.positive()),
        turns: s.number("turns", &Rule::any("").positive()),
    });
    s.finish();
    draft
}

/// `[wire]`, mm.
#[derive(Debug)]
pub struct WireDraft {
    pub diameter: Located<f64>,
    pub conductor: Located<f64>,
    pub resistivity_ohm_m: Located<f64>,
    pub temperature_c: Located<f64>,
    pub choices: Vec<f64>,
}

pub fn wire(mut s: Section<'_>) -> WireDraft {
    let temperature = Rule::any("C").bound(Bound::AtLeast(COLDEST_COPPER_C));
    let diameter = s.required("diameter_mm", &WIRE_MM.positive());
    let conductor = s.number("conductor_diameter_mm", &WIRE_MM.positive());
    let conductor = conductor.unwrap_or_else(|| {
        s.assume("conductor_diameter_mm", number(diameter.value));
        diameter.clone()
    });
    let insulated = diameter.value / conductor.value;
    let draft = WireDraft {
        conductor,
        diameter,
        resistivity_ohm_m: s.number_or(
            "resistivity_ohm_m",
            &RESISTIVITY_OHM_M.positive(),
            COPPER_RESISTIVITY_OHM_M,
        ),
        temperature_c: s.number_or("temperature_c", &temperature, REFERENCE_TEMPERATURE_C),
        choices: wire_choices(&mut s, insulated),
    };
    s.finish();
    draft
}

/// Diameters over the insulation that may be chosen, mm: that of a gauge, which is a conductor's, is `insulated`
/// times as large.
fn wire_choices(s: &mut Section<'_>, insulated: f64) -> Vec<f64> {
    let Some(choices) = s.numbers("choices_mm", &WIRE_MM.positive()) else {
        return Vec::new();
    };
    let gauges = s.texts_among("choices_mm");
    let over = |(diameter, gauge)| {
        if gauge {
            diameter * insulated
        } else {
            diameter
        }
    };
    choices.value.into_iter().zip(gauges).map(over).collect()
}

/// `[core]`, mm.
#[derive(Debug)]
pub struct CoreDraft {
    pub clearance: Located<f64>,
    pub above: Located<f64>,
    pub below: Located<f64>,
    pub relative_permeability: f64,
    pub bh_curve: Option<String>,
    pub knee_t: Option<f64>,
    pub conductivity_s_per_m: f64,
    pub lamination: Option<f64>,
}

pub fn core(mut s: Section<'_>) -> Option<CoreDraft> {
    let draft = s.is_present().then(|| CoreDraft {
        clearance: s.number_or("clearance_mm", &OFFSET_MM, 0.0),
        above: s.number_or("above_mm", &OFFSET_MM, 0.0),
        below: s.number_or("below_mm", &OFFSET_MM, 10.0),
        relative_permeability: of_linear(
            &mut s,
            "relative_permeability",
            &RELATIVE_PERMEABILITY,
            RELATIVE_PERMEABILITY_DEFAULT,
        )
        .unwrap_or(RELATIVE_PERMEABILITY_DEFAULT),
        bh_curve: s.text("bh_curve").map(|text| text.value),
        knee_t: of_linear(
            &mut s,
            "knee_t",
            &Rule::any("T").positive(),
            LOW_CARBON_KNEE_T,
        ),
        conductivity_s_per_m: s
            .number_or("conductivity_s_per_m", &CONDUCTIVITY_S_PER_M, 5.8e6)
            .value,
        lamination: s
            .number("lamination_mm", &OFFSET_MM.positive())
            .map(|sheet| sheet.value),
    });
    if s.has("relative_permeability") && s.has("bh_curve") {
        let message = "relative_permeability and bh_curve exclude each other";
        s.fault("bh_curve", message, "keep the one that describes the steel");
    }
    if draft
        .as_ref()
        .is_some_and(|core| core.bh_curve.as_deref() == Some(""))
    {
        s.fault(
            "bh_curve",
            "expected the path of a B-H table, found an empty text",
            "name a CSV file",
        );
    }
    s.finish();
    draft
}

/// A number that has a default for steel without a magnetisation curve alone.
fn of_linear(s: &mut Section<'_>, key: &'static str, rule: &Rule, default: f64) -> Option<f64> {
    if s.has("bh_curve") {
        return s.number(key, rule).map(|number| number.value);
    }
    Some(s.number_or(key, rule, default).value)
}

/// How the axes of the array are given.
#[derive(Debug)]
pub enum Layout {
    /// One coil at the origin.
    Single,
    /// A grid, and the place of its pitch.
    Grid(ArrayGrid, Located<f64>),
    /// A list, mm.
    Listed(Vec<Located<[f64; 2]>>),
    /// The file's statement on it is at fault.
    Unknown,
}

impl Layout {
    /// Positions in coil order, m; empty where at fault.
    pub fn positions_m(&self) -> Vec<[f64; 2]> {
        match self {
            Self::Single => vec![[0.0, 0.0]],
            Self::Grid(grid, pitch) => grid_positions_m(grid.rows, grid.columns, pitch.value),
            Self::Listed(list) => list.iter().map(|p| p.value.map(m_from_mm)).collect(),
            Self::Unknown => Vec::new(),
        }
    }
}

/// `[array]`.
#[derive(Debug)]
pub struct ArrayDraft {
    pub layout: Layout,
    pub coupling: Option<Coupling>,
    pub gain: Option<Located<Vec<f64>>>,
}

pub fn array(mut s: Section<'_>) -> ArrayDraft {
    const OF_GRIDS: [&str; 3] = ["rows", "columns", "pitch_mm"];
    let layout = match s.pairs("positions_mm", &BODY_MM, COILS_MAX) {
        _ if !s.is_present() => {
            s.assume_whole("\"one coil at the origin\"");
            Layout::Single
        }
        Some(list) => {
            for key in OF_GRIDS.into_iter().filter(|key| s.has(key)) {
                let message = format!("{key} and positions_mm exclude each other");
                s.fault(key, message, "give a grid, or give the positions");
            }
            s.ignore(&OF_GRIDS);
            if list.is_empty() {
                Layout::Unknown
            } else {
                Layout::Listed(list)
            }
        }
        None => {
            let (rows, columns) = (s.count_or("rows", 3), s.count_or("columns", 3));
            let pitch = s.number_or("pitch_mm", &BODY_MM.positive(), 50.0);
            match rows.zip(columns) {
                Some((rows, columns)) => grid(&s, rows, columns, pitch),
                None => Layout::Unknown,
            }
        }
    };
    let coupling = s.choice("coupling");
    let gain = s.numbers("gain", &Rule::any(""));
    s.finish();
    ArrayDraft {
        layout,
        coupling,
        gain,
    }
}

fn grid(s: &Section<'_>, rows: usize, columns: usize, pitch: Located<f64>) -> Layout {
    if rows
        .checked_mul(columns)
        .is_none_or(|coils| coils > COILS_MAX)
    {
        let message = format!("{rows} x {columns} coils are more than {COILS_MAX}");
        s.fault(
            if s.has("rows") { "rows" } else { "columns" },
            message,
            "lower rows or columns",
        );
        return Layout::Unknown;
    }
    let pitch_m = m_from_mm(pitch.value);
    Layout::Grid(
        ArrayGrid {
            rows,
            columns,
            pitch_m,
        },
        pitch,
    )
}

/// `[magnet]`, mm.
#[derive(Debug)]
pub struct MagnetDraft {
    pub diameter: f64,
    pub length: f64,
    pub magnetization_a_per_m: f64,
    pub polarity: Polarity,
    pub model: MagnetModel,
    pub tilt_deg: [f64; 2],
    pub passive_force: bool,
}

pub fn magnet(mut s: Section<'_>) -> MagnetDraft {
    let tilt = Rule::any("degrees").bound(Bound::Within(-180.0, 180.0));
    let draft = MagnetDraft {
        diameter: s
            .number_or("diameter_mm", &MAGNET_MM.positive(), 10.0)
            .value,
        length: s.number_or("length_mm", &MAGNET_MM.positive(), 10.0).value,
        magnetization_a_per_m: s
            .number_or(
                "magnetization_a_per_m",
                &MAGNETIZATION_A_PER_M.positive(),
                1.1579e6,
            )
            .value,
        polarity: s.choice_or_first("polarity"),
        model: s.choice_or_first("model"),
        tilt_deg: s.tuple("tilt_deg", &tilt),
        passive_force: s.flag_or("passive_force", false),
    };
    remanence(&mut s);
    s.finish();
    draft
}

/// Magnets are sold by their remanence: how much magnetisation that is.
fn remanence(s: &mut Section<'_>) {
    const NAMES: [(&str, f64); 7] = [
        ("remanence_t", 1.0),
        ("br_t", 1.0),
        ("b_r_t", 1.0),
        ("remanence_mt", 1e-3),
        ("br_mt", 1e-3),
        ("remanence", 1.0),
        ("br", 1.0),
    ];
    for (name, tesla) in NAMES {
        if let Some(given) = s.unlisted(name) {
            let magnetisation = given * tesla / MU_0_T_M_PER_A;
            let help = if magnetisation.is_finite() {
                format!("write magnetization_a_per_m = {magnetisation:.4e}, which is B_r / mu_0")
            } else {
                "write magnetization_a_per_m, which is B_r / mu_0".to_owned()
            };
            let message = "a magnet is given by its magnetisation, not by its remanence";
            s.fault(name, message, &help);
        }
    }
}

/// `[supply]`.
#[derive(Debug)]
pub struct SupplyDraft {
    pub current_max_a: Located<OneOrMany>,
    pub current_min_a: Located<OneOrMany>,
    pub total_current_max_a: Option<f64>,
    pub voltage_v: Option<f64>,
    pub driver: Driver,
    pub bandwidth_hz: Option<Located<f64>>,
}

pub fn supply(mut s: Section<'_>) -> SupplyDraft {
    let draft = SupplyDraft {
        current_max_a: s.one_or_many("current_max_a", &AMPERE.bound(Bound::NotNegative), 2.0),
        current_min_a: s.one_or_many("current_min_a", &AMPERE.bound(Bound::NotPositive), 0.0),
        total_current_max_a: s
            .number("total_current_max_a", &AMPERE.bound(Bound::NotNegative))
            .map(|i| i.value),
        voltage_v: s
            .number("voltage_v", &Rule::any("V").positive())
            .map(|v| v.value),
        driver: s.choice("driver").unwrap_or_default(),
        bandwidth_hz: s.number("bandwidth_hz", &BANDWIDTH_HZ.positive()),
    };
    if draft.driver == Driver::Voltage && draft.bandwidth_hz.is_some() {
        let message = "bandwidth_hz is that of a current loop, but the driver sets voltages";
        s.fault(
            "bandwidth_hz",
            message,
            "add driver = \"current\", or leave bandwidth_hz out",
        );
    }
    s.finish();
    draft
}

/// Free convection and radiation of a dark surface some ten degrees above a room, about half each.
const SURFACE_W_PER_M2_K: f64 = 12.0;
/// Thermal class F of enamelled wire (IEC 60085).
const WINDING_MAX_C: f64 = 155.0;

/// `[cooling]`.
pub fn cooling(mut s: Section<'_>) -> Cooling {
    let warm = Rule::any("C").bound(Bound::AtLeast(COLDEST_COPPER_C));
    let surface = Rule::any("W/(m^2 K)").positive();
    let cooling = Cooling {
        surface_w_per_m2_k: s
            .number_or("surface_w_per_m2_k", &surface, SURFACE_W_PER_M2_K)
            .value,
        ambient_c: s
            .number_or("ambient_c", &warm, REFERENCE_TEMPERATURE_C)
            .value,
        winding_max_c: s.number_or("winding_max_c", &warm, WINDING_MAX_C).value,
        heating_s: s
            .number_or("heating_s", &Rule::any("s").positive(), 60.0)
            .value,
    };
    s.finish();
    cooling
}

/// `[uncertainty]`.
pub fn uncertainty(mut s: Section<'_>) -> Uncertainty {
    let mut bound = |key, rule: Rule, most| {
        let given = s.number(key, &rule.bound(Bound::Within(0.0, most)));
        given.map_or(0.0, |bound| bound.value)
    };
    let uncertainty = Uncertainty {
        sensor_m: m_from_mm(bound(
            "sensor_mm",
            OFFSET_MM,
            1e3 * Uncertainty::MOST.sensor_m,
        )),
        tilt_deg: bound("tilt_deg", Rule::any("degrees"), Uncertainty::MOST.tilt_deg),
        heat_c: bound("heat_c", Rule::any("C"), Uncertainty::MOST.heat_c),
        driver: bound(
            "driver_percent",
            Rule::any("%"),
            100.0 * Uncertainty::MOST.driver,
        ) / 100.0,
    };
    s.finish();
    uncertainty
}

/// Height of the magnet's centre, mm.
pub(crate) fn target_height_mm(mut s: Section<'_>) -> Located<f64> {
    let height = s.number_or("height_mm", &BODY_MM, 30.0);
    s.finish();
    height
}

/// `[workspace]`, mm; `None` where an axis is at fault.
#[derive(Debug)]
pub struct WorkspaceDraft {
    pub x: Option<Located<Axis>>,
    pub y: Option<Located<Axis>>,
    pub z: Option<Located<Axis>>,
    pub is_given: bool,
}

/// The seed's grid along x and y, mm.
pub const SEED_SIDE_MM: Axis = Axis {
    from: -50.0,
    to: 50.0,
    samples: 61,
};

pub fn workspace(mut s: Section<'_>) -> WorkspaceDraft {
    let heights = Axis {
        from: 10.0,
        to: 80.0,
        samples: 29,
    };
    let is_given = ["x_mm", "y_mm", "z_mm"].iter().any(|key| s.has(key));
    let draft = WorkspaceDraft {
        is_given,
        x: s.axis_or("x_mm", &BODY_MM, SEED_SIDE_MM),
        y: s.axis_or("y_mm", &BODY_MM, SEED_SIDE_MM),
        z: s.axis_or("z_mm", &BODY_MM, heights),
    };
    s.finish();
    draft
}

/// An axis in metres.
#[must_use]
pub fn axis_m(axis: Axis) -> Axis {
    Axis {
        from: m_from_mm(axis.from),
        to: m_from_mm(axis.to),
        samples: axis.samples,
    }
}
