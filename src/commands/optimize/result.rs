//! The result of `optimize`, SI: JSON, screen, page and a sweep's row are made of it.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::accuracy::StageAccuracy;
use crate::bundle::artefact::Input;
use crate::coil::circuit::CoilSize;
use crate::coil::limits::{LimitCheck, LimitName};
use crate::coil::optimum::outcome::Alternative;
use crate::coil::optimum::outcome::Violation;
use crate::coil::optimum::problem::Regime;
use crate::coil::optimum::{Certificate, Ending, LimitUse, Valley, WholeTurns, WireOutcome};
use crate::plot::landscape::Landscape;
use crate::scene::rated::{CircuitSummary, CoilSummary};

/// The result of `optimize`; all SI.
#[derive(Debug, Clone, Serialize)]
pub struct Optimization {
    /// Layout of the artefact.
    pub schema_version: &'static str,
    /// Program that wrote it.
    pub fluxform_version: &'static str,
    /// Name of the design.
    pub design: String,
    /// The files it was made from.
    pub inputs: Vec<Input>,
    /// How it ended.
    pub status: Ending,
    /// Why there is no coil, and what to do; absent where there is one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub no_coil: Option<NoCoil>,
    /// Whether layers and turns are whole numbers.
    pub wound: bool,
    /// Dimensions that were given.
    pub fixed: BTreeMap<&'static str, FixedDimension>,
    /// The best coil.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub coil: Option<BestCoilSummary>,
    /// Its force and current.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub objective: Option<Objective>,
    /// The design's limits by name.
    pub limits: BTreeMap<&'static str, LimitUse>,
    /// Limits that the design sets, by their keys in it, that the search of one coil leaves out, unless the best coil meets
    /// them all the same.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub limits_left_out: Vec<&'static str>,
    /// Other bounds of the coil: current and voltage, one layer, one turn.
    pub bounds: BTreeMap<&'static str, LimitUse>,
    /// How sure it is that no coil is better.
    pub certificate: Certificate,
    /// Evaluations of a coil by the local searches.
    pub evaluations: usize,
    /// Local searches.
    pub starts: usize,
    /// Where their sequence of starts begins.
    pub seed: u64,
    /// Bores that cost next to no force.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub valley: Option<Valley>,
    /// Best force of every wire to choose from.
    pub wires: Vec<WireOutcome>,
    /// With whole turns: best force of a coil whose turns need not be whole, N.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub continuous_force_n: Option<f64>,
    /// With whole turns: wire of that coil, over the insulation, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub continuous_wire_diameter_m: Option<f64>,
    /// Least bore of a bobbin for the best coil's wire, m, where the design names no least bore and
    /// coils are to be wound.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bobbin_bore_m: Option<f64>,
    /// Coils a little weaker, and shorter, lighter or cooler; their forces are upward ones.
    pub alternatives: Vec<Alternative>,
    /// The design's own coil as given; absent where it has none that can be computed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub given: Option<GivenCoil>,
    /// Each stage's estimated error.
    pub accuracy: BTreeMap<&'static str, StageAccuracy>,
    /// Whether the requested tolerance was reached.
    pub accuracy_reached: bool,
    /// The design with the best coil, TOML.
    #[serde(skip)]
    pub design_text: Option<String>,
    /// Coils around the best one, and its section; where they were requested.
    #[serde(skip)]
    pub picture: Option<Landscape>,
    /// Warnings for the user.
    #[serde(skip)]
    pub warnings: Vec<String>,
}

/// Why there is no coil.
#[derive(Debug, Clone, Serialize)]
pub struct NoCoil {
    /// In words, with what to do.
    pub message: String,
    /// The limits that `least` breaks, worst first.
    pub violations: Vec<Violation>,
    /// The coil that breaks the limits least: of all, or of whole ones next to the best one of any turns, where that
    /// one meets the limits.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub least: Option<CoilSize>,
    /// Limits of which one is missing.
    pub missing: Vec<LimitName>,
}

/// A dimension that was given.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct FixedDimension {
    /// Its value, m.
    pub value: f64,
    /// Force that a metre more would add, N/m; with whole turns that of the coil whose turns
    /// need not be whole.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sensitivity_n_per_unit: Option<f64>,
}

/// The best coil.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct BestCoilSummary {
    /// Its dimensions.
    #[serde(flatten)]
    pub size: CoilSize,
    /// Number of turns; whole with `--wound`.
    pub turns: f64,
    /// Layers and turns per layer, with `--wound`.
    #[serde(flatten)]
    pub whole: Option<WholeTurns>,
    /// Diameter of the wire over its insulation, m.
    pub wire_diameter_m: f64,
    /// Diameter of its metal, m.
    pub conductor_diameter_m: f64,
    /// Circuit and mass.
    #[serde(flatten)]
    pub circuit: CircuitSummary,
    /// Largest |B| in the core at the rated current, T; absent for air coils.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub core_peak_field_t: Option<f64>,
}

/// Force and current of the best coil.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Objective {
    /// Upward force on the magnet at the rated current, N.
    pub force_n: f64,
    /// The rated current, A.
    pub current_a: f64,
    /// Who sets it: the driver's limit, or the supply's voltage.
    pub current_set_by: Regime,
    /// dB_z/dz at the target on the axis, T/m/A.
    pub gradient_t_per_m_per_a: f64,
    /// Height of the magnet's centre, m.
    pub height_m: f64,
    /// With `--neighbours`, the coil without them: N.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub alone_force_n: Option<f64>,
    /// The unpowered steel's pull, N, which is not part of `force_n`; where the design includes it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub passive_force_n: Option<f64>,
}

/// The design's own coil.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GivenCoil {
    /// The coil.
    #[serde(flatten)]
    pub coil: CoilSummary,
    /// Diameter of its wire over the insulation, m.
    #[serde(skip)]
    pub wire_diameter_m: f64,
    /// Upward force of its rated current, N.
    pub force_n: f64,
    /// Its limits.
    pub limits: BTreeMap<&'static str, LimitCheck>,
}
