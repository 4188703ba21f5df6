//! What `optimize` tells, SI.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::accuracy::{CertificateKind, StageAccuracy};
use crate::bundle::artefact::Input;
use crate::coil::limits::LimitCheck;

/// What `optimize` tells; all SI.
#[derive(Debug, Clone, Serialize)]
pub struct Optimization {
    /// Layout of the artefact.
    pub schema_version: &'static str,
    /// Program that wrote it.
    pub fluxform_version: &'static str,
    /// Name of the design.
    pub design: String,
    /// What went in.
    pub inputs: Vec<Input>,
    /// `optimal`, `infeasible` or `unbounded`.
    pub status: &'static str,
    /// Why there is no coil, and what to do; absent where there is one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub no_coil: Option<NoCoil>,
    /// Whether layers and turns are whole numbers.
    pub wound: bool,
    /// Dimensions that were given.
    pub fixed: BTreeMap<&'static str, FixedFacts>,
    /// The best coil.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub coil: Option<BestFacts>,
    /// What it does.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub objective: Option<ObjectiveFacts>,
    /// The design's limits by name.
    pub limits: BTreeMap<&'static str, LimitFacts>,
    /// What bounds the coil besides: current and voltage, one layer, one turn.
    pub bounds: BTreeMap<&'static str, LimitFacts>,
    /// How sure it is that no coil is better.
    pub certificate: CertificateFacts,
    /// Evaluations of a coil by the local searches.
    pub evaluations: usize,
    /// Local searches.
    pub starts: usize,
    /// Where their sequence of starts begins.
    pub seed: u64,
    /// Bores that cost next to no force.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub valley: Option<ValleyFacts>,
    /// Best force of every wire to choose from.
    pub wires: Vec<WireFacts>,
    /// Best force of a coil whose turns need not be whole, N.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub continuous_force_n: Option<f64>,
    /// Coils a little weaker, and shorter, lighter or cooler.
    pub alternatives: Vec<AlternativeFacts>,
    /// The design's own coil as given; absent where it has none that can be computed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub given: Option<GivenFacts>,
    /// Each stage's estimated error.
    pub accuracy: BTreeMap<&'static str, StageAccuracy>,
    /// Whether the tolerance asked for was reached.
    pub accuracy_reached: bool,
    /// The design with the best coil, TOML.
    #[serde(skip)]
    pub design_text: Option<String>,
    /// Warnings for the user.
    #[serde(skip)]
    pub notes: Vec<String>,
}

/// Why there is no coil.
#[derive(Debug, Clone, Serialize)]
pub struct NoCoil {
    /// In words, with what to do.
    pub message: String,
    /// What the coil that breaks the limits least breaks, worst first.
    pub violations: Vec<ViolationFacts>,
    /// That coil.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub least: Option<SizeFacts>,
    /// Limits of which one is missing.
    pub missing: Vec<&'static str>,
}

/// A limit that is broken.
#[derive(Debug, Clone, Serialize)]
pub struct ViolationFacts {
    /// Its name.
    pub name: &'static str,
    /// The coil's value.
    pub value: f64,
    /// The limit.
    pub limit: f64,
    /// By what part of the limit.
    pub excess: f64,
}

/// A coil's dimensions.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SizeFacts {
    /// Inner diameter, m.
    pub inner_diameter_m: f64,
    /// Outer diameter, m.
    pub outer_diameter_m: f64,
    /// Length, m.
    pub length_m: f64,
}

/// A dimension that was given.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct FixedFacts {
    /// Its value, m.
    pub value: f64,
    /// Force that a metre more would add, N/m; with whole turns that of the coil whose turns
    /// need not be whole.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sensitivity_n_per_unit: Option<f64>,
}

/// The best coil.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct BestFacts {
    /// Its dimensions.
    #[serde(flatten)]
    pub size: SizeFacts,
    /// Number of turns; whole with `--wound`.
    pub turns: f64,
    /// Layers, with `--wound`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub layers: Option<u64>,
    /// Turns a layer, with `--wound`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub turns_per_layer: Option<u64>,
    /// Diameter of the wire over its insulation, m.
    pub wire_diameter_m: f64,
    /// Diameter of its metal, m.
    pub conductor_diameter_m: f64,
    /// Circuit and mass.
    #[serde(flatten)]
    pub circuit: CircuitFacts,
    /// Largest |B| in the core at the rated current, T; absent for air coils.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub core_peak_field_t: Option<f64>,
}

/// Circuit and mass of a coil.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct CircuitFacts {
    /// Resistance at the wire's temperature, ohm.
    pub resistance_ohm: f64,
    /// Self inductance, H; with a B-H curve flux over current.
    pub inductance_h: f64,
    /// L/R, s.
    pub time_constant_s: f64,
    /// Five time constants, s.
    pub settling_s: f64,
    /// Length of wire, m.
    pub wire_length_m: f64,
    /// Mass of wire and core, kg.
    pub mass_kg: f64,
    /// Heat at the rated current, W.
    pub power_w: f64,
}

/// What the best coil does.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ObjectiveFacts {
    /// Upward force on the magnet of the rated current, N: its size is what is maximised.
    pub force_n: f64,
    /// The rated current, A.
    pub current_a: f64,
    /// `driver` or `supply`: whose limit it is.
    pub current_set_by: &'static str,
    /// dB_z/dz on the axis at the target, T/m/A.
    pub gradient_t_per_m_per_a: f64,
    /// Height of the magnet's centre, m.
    pub height_m: f64,
    /// The force of the coil alone, N; told where `force_n` is that among the neighbours' cores.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub alone_force_n: Option<f64>,
    /// The unpowered steel's pull, N, which is not part of `force_n`; told where the design asks
    /// for it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub passive_force_n: Option<f64>,
}

/// A limit beside the optimum's value.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct LimitFacts {
    /// The coil's value.
    pub value: f64,
    /// The limit.
    pub limit: f64,
    /// Whether the value respects it.
    pub met: bool,
    /// Whether it holds the force back.
    pub active: bool,
    /// d|force|/d(limit), N per SI unit; negative for lower limits. With whole turns that of the
    /// coil whose turns need not be whole.
    pub sensitivity_n_per_unit: f64,
}

/// How sure it is that no coil is better.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct CertificateFacts {
    /// What was proven, or searched.
    pub kind: CertificateKind,
    /// No coil within the limits gives more, N; null where nothing is proven.
    pub upper_bound_n: Option<f64>,
    /// The bound over the force, less one.
    pub gap: Option<f64>,
    /// Boxes of coils that were bounded.
    pub cells: usize,
}

/// Bores that cost next to no force.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ValleyFacts {
    /// Part of the force that is lost at most, all other dimensions chosen again.
    pub force_share: f64,
    /// Smallest and largest inner diameter, m.
    pub inner_diameter_m: [f64; 2],
}

/// A wire's best force.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct WireFacts {
    /// Diameter over the insulation, m.
    pub wire_diameter_m: f64,
    /// N; null where no coil of it meets the limits.
    pub force_n: Option<f64>,
}

/// Another coil worth a look.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AlternativeFacts {
    /// Its dimensions.
    #[serde(flatten)]
    pub size: SizeFacts,
    /// Number of turns.
    pub turns: f64,
    /// Layers, with `--wound`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub layers: Option<u64>,
    /// Turns a layer, with `--wound`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub turns_per_layer: Option<u64>,
    /// Diameter of the wire over its insulation, m.
    pub wire_diameter_m: f64,
    /// Upward force of the rated current, N.
    pub force_n: f64,
    /// Part of the best force that it lacks.
    pub force_lost: f64,
    /// Mass of the wire's metal, kg.
    pub wire_mass_kg: f64,
    /// Heat at the rated current, W.
    pub power_w: f64,
    /// In what it is better: `shorter`, `lighter`, `cooler`.
    pub better: Vec<&'static str>,
}

/// The design's own coil.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GivenFacts {
    /// Its dimensions.
    #[serde(flatten)]
    pub size: SizeFacts,
    /// Number of turns.
    pub turns: f64,
    /// Circuit and mass.
    #[serde(flatten)]
    pub circuit: CircuitFacts,
    /// Upward force of its rated current, N.
    pub force_n: f64,
    /// Its limits.
    pub limits: BTreeMap<&'static str, LimitCheck>,
}
