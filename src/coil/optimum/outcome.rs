//! The result of an optimisation.

use serde::Serialize;
use strum::{EnumMessage, IntoStaticStr, VariantArray};

use super::domain::Contradiction;
use super::model::{Strand, Window};
use super::problem::{LimitName, Regime};
use crate::circuit::CoilSize;
pub use fluxform_base::accuracy::CertificateKind;

/// How an optimisation ended.
#[derive(Debug, Clone, PartialEq)]
pub enum OptimumStatus {
    /// The best coil within the limits.
    Optimal,
    /// No coil meets the limits.
    Infeasible {
        /// Limits that `least` breaks, worst first.
        violations: Vec<Violation>,
        /// The coil that breaks the limits least; where coils of any turns meet them, of the whole ones next to
        /// the best of those.
        least: Window,
    },
    /// Two limits exclude each other.
    Contradictory(Contradiction),
    /// The force grows without end, or towards a value no coil reaches: one of these limits is
    /// missing.
    Unbounded {
        /// Any one of them ends it, where one alone is named; else both are needed, or a limit
        /// on the amount of wire.
        missing: Vec<LimitName>,
    },
}

/// [`OptimumStatus`] in one word.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Ending {
    /// There is a best coil.
    Optimal,
    /// No coil meets the limits.
    Infeasible,
    /// The force grows without end.
    Unbounded,
}

impl OptimumStatus {
    /// The status in one word.
    #[must_use]
    pub fn ending(&self) -> Ending {
        match self {
            Self::Optimal => Ending::Optimal,
            Self::Infeasible { .. } | Self::Contradictory(_) => Ending::Infeasible,
            Self::Unbounded { .. } => Ending::Unbounded,
        }
    }
}

/// A limit that a coil breaks.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Violation {
    /// Which.
    pub name: LimitName,
    /// The coil's value, SI.
    pub value: f64,
    /// The limit, SI.
    pub limit: f64,
    /// value / limit - 1, or limit / value - 1 for a lower limit.
    pub excess: f64,
}

/// A limit beside the optimum's value.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct LimitUse {
    /// Which.
    #[serde(skip)]
    pub name: LimitName,
    /// The coil's value, SI.
    pub value: f64,
    /// The limit, SI.
    pub limit: f64,
    /// Whether the value respects it, but for a rounding.
    pub met: bool,
    /// Whether the optimum lies on it.
    pub active: bool,
    /// d|force|/d(limit) as this limit alone is relaxed, N per SI unit; negative for lower limits, 0 where others hold
    /// the optimum back as well. With whole turns that of the coil whose turns need not be whole.
    pub sensitivity_n_per_unit: f64,
}

impl LimitUse {
    /// A limit that the optimiser set, beside `value`.
    #[must_use]
    pub fn new(
        name: LimitName,
        value: f64,
        limit: f64,
        active: bool,
        sensitivity_n_per_unit: f64,
    ) -> Self {
        let slack = MET * limit.abs();
        let met = if name.is_lower() {
            value >= limit - slack
        } else {
            value <= limit + slack
        };
        Self {
            name,
            value,
            limit,
            met,
            active,
            sensitivity_n_per_unit,
        }
    }

    /// Whether it holds the force back: a coil of whole turns, which leave room below most limits, by what holds back
    /// the one whose turns need not be whole.
    #[must_use]
    pub fn holds_back(&self) -> bool {
        self.active || self.sensitivity_n_per_unit != 0.0
    }
}

/// Relative difference from a limit that is a rounding.
const MET: f64 = 1e-9;

/// Whole layers of whole turns.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct WholeTurns {
    /// Layers.
    pub layers: u64,
    /// Turns in each layer.
    pub turns_per_layer: u64,
}

/// The best coil.
#[derive(Debug, Clone, PartialEq)]
pub struct BestCoil {
    /// Its section.
    pub window: Window,
    /// Its wire.
    pub strand: Strand,
    /// Turns; not rounded where they need not be whole.
    pub turns: f64,
    /// Layers and turns of a coil that can be wound.
    pub whole: Option<WholeTurns>,
    /// Who sets the rated current.
    pub regime: Regime,
    /// Rated current, A.
    pub current_a: f64,
    /// |force| at the target at the rated current, N.
    pub force_n: f64,
    /// Mass of wire and core, kg.
    pub mass_kg: f64,
    /// The limits.
    pub limits: Vec<LimitUse>,
}

impl BestCoil {
    /// Its dimensions.
    #[must_use]
    pub fn size(&self) -> CoilSize {
        CoilSize::from(&self.window)
    }

    /// Mass of the wire's metal, kg.
    #[must_use]
    pub fn wire_mass_kg(&self) -> f64 {
        self.window.volume_over_pi_m3().value * self.strand.mass_per_volume()
    }

    /// Heat at the rated current, W.
    #[must_use]
    pub fn power_w(&self) -> f64 {
        let volume = self.window.volume_over_pi_m3().value;
        let resistance_ohm = volume * self.strand.resistance_per_volume();
        self.current_a * self.current_a * resistance_ohm
    }

    /// State of a limit.
    #[must_use]
    pub fn limit(&self, name: LimitName) -> Option<&LimitUse> {
        self.limits.iter().find(|used| used.name == name)
    }
}

/// In what a coil may be better than the strongest one.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, EnumMessage, IntoStaticStr, VariantArray, Serialize,
)]
#[serde(rename_all = "lowercase")]
#[strum(serialize_all = "lowercase")]
pub enum Advantage {
    /// Its length.
    Shorter,
    /// Mass of wire and core.
    Lighter,
    /// Heat at the rated current.
    Cooler,
    /// Its bore, which a bobbin needs and the best coil has not.
    Windable,
}

fluxform_base::choices!(Advantage);

impl Advantage {
    /// Every one that has less of something, in the order of `Advantage::amounts`.
    pub const LESS: [Self; 3] = [Self::Shorter, Self::Lighter, Self::Cooler];

    /// Length, m, mass, kg, and heat, W, of `coil`.
    pub(super) fn amounts(coil: &BestCoil) -> [f64; 3] {
        [coil.window.length_m, coil.mass_kg, coil.power_w()]
    }
}

/// A coil a little weaker than the best one, and better in something.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Alternative {
    /// Its dimensions.
    #[serde(flatten)]
    pub size: CoilSize,
    /// Number of turns.
    pub turns: f64,
    /// Layers and turns of a coil that can be wound.
    #[serde(flatten)]
    pub whole: Option<WholeTurns>,
    /// Diameter of the wire over its insulation, m.
    pub wire_diameter_m: f64,
    /// |force| of the rated current, N.
    pub force_n: f64,
    /// Part of the best force that it lacks.
    pub force_lost: f64,
    /// Mass of the wire's metal, kg.
    pub wire_mass_kg: f64,
    /// Mass of wire and core, kg.
    pub mass_kg: f64,
    /// Heat at the rated current, W.
    pub power_w: f64,
    /// In what it is better.
    pub better: Vec<Advantage>,
}

impl Alternative {
    /// `coil` beside `best`: better where it is so by more than rounding, and in `sought`.
    pub(super) fn new(coil: &BestCoil, best: &BestCoil, sought: Option<Advantage>) -> Self {
        let amounts = Advantage::amounts(coil)
            .into_iter()
            .zip(Advantage::amounts(best));
        let better = Advantage::LESS
            .into_iter()
            .zip(amounts)
            .filter(|(advantage, (ours, theirs))| {
                *ours < theirs * (1.0 - 1e-9) || sought == Some(*advantage)
            })
            .map(|(advantage, _)| advantage)
            .collect();
        Self {
            size: coil.size(),
            turns: coil.turns,
            whole: coil.whole,
            wire_diameter_m: coil.strand.diameter_m,
            force_n: coil.force_n,
            force_lost: 1.0 - coil.force_n / best.force_n,
            wire_mass_kg: coil.wire_mass_kg(),
            mass_kg: coil.mass_kg,
            power_w: coil.power_w(),
            better,
        }
    }

    /// Whether two coils differ by less than `relative`.
    pub(super) fn is_near(&self, other: &Self, relative: f64) -> bool {
        let near = |a: f64, b: f64| (a - b).abs() <= relative * b;
        near(self.size.length_m, other.size.length_m)
            && near(self.size.outer_diameter_m, other.size.outer_diameter_m)
            && near(self.wire_mass_kg, other.wire_mass_kg)
    }
}

/// How sure it is that no coil is better.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Certificate {
    /// The proof, or the search.
    pub kind: CertificateKind,
    /// No coil within the limits exceeds this force, N; `None` where nothing is proven.
    pub upper_bound_n: Option<f64>,
    /// Upper bound over the force found, less one.
    pub gap: Option<f64>,
    /// Boxes of coils that were bounded, or coils that were examined.
    pub cells: usize,
}

impl Certificate {
    /// Result of `starts` local searches; `cells` boxes were bounded in vain.
    #[must_use]
    pub fn of_searches(starts: usize, cells: usize) -> Self {
        Self {
            kind: CertificateKind::of_searches(starts),
            upper_bound_n: None,
            gap: None,
            cells,
        }
    }
}

/// The best force of one wire.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct WireOutcome {
    /// Diameter over the insulation, m.
    pub wire_diameter_m: f64,
    /// Its best force, N, with a core to about a thousandth where another wire is better; `None` where no coil of it
    /// meets the limits.
    pub force_n: Option<f64>,
}

/// Bores that cost next to no force.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Valley {
    /// Part of the force that is lost at most, all other dimensions chosen again.
    pub force_share: f64,
    /// Smallest and largest inner diameter, m.
    pub inner_diameter_m: [f64; 2],
}

/// The result.
#[derive(Debug, Clone, PartialEq)]
pub struct Outcome {
    /// How it ended.
    pub status: OptimumStatus,
    /// The best coil; present with [`OptimumStatus::Optimal`].
    pub best: Option<BestCoil>,
    /// Of a coil with whole turns: that whose turns need not be whole, with what its limits cost.
    pub continuous: Option<BestCoil>,
    /// The best force of that coil, N.
    pub continuous_force_n: Option<f64>,
    /// Coils a little weaker, and shorter, lighter or cooler: of coils that can be wound none
    /// beaten by another in force, length, mass and heat together, strongest first.
    pub alternatives: Vec<Alternative>,
    /// Its proof.
    pub certificate: Certificate,
    /// Every wire's best; empty for coils that can be wound.
    pub wires: Vec<WireOutcome>,
    /// Evaluations of a coil.
    pub evaluations: usize,
    /// Local searches.
    pub starts: usize,
    /// Bores that cost next to no force.
    pub valley: Option<Valley>,
}
