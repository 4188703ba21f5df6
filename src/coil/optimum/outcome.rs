//! The result of an optimisation.

use super::domain::Contradiction;
use super::model::{Strand, Window};
use super::problem::{LimitName, Regime};
pub use fluxform_base::accuracy::CertificateKind;

/// How an optimisation ended.
#[derive(Debug, Clone, PartialEq)]
pub enum OptimumStatus {
    /// The best coil within the limits.
    Optimal,
    /// No coil meets the limits: those that the least violating coil breaks, worst first.
    Infeasible {
        /// What it breaks.
        violations: Vec<Violation>,
        /// That coil.
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

/// A limit that the least violating coil breaks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Violation {
    /// Which.
    pub name: LimitName,
    /// The coil's value, SI.
    pub value: f64,
    /// The limit, SI.
    pub limit: f64,
    /// ln(value / limit), or the same for a lower limit: by how much, relatively.
    pub excess: f64,
}

/// A limit beside the optimum's value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LimitUse {
    /// Which.
    pub name: LimitName,
    /// The coil's value, SI.
    pub value: f64,
    /// The limit, SI.
    pub limit: f64,
    /// Whether it holds the optimum back.
    pub active: bool,
    /// Force that the limit costs: dF/d(limit), N per SI unit.
    pub sensitivity_n_per_unit: f64,
}

/// The best coil.
#[derive(Debug, Clone, PartialEq)]
pub struct BestCoil {
    /// Its section.
    pub window: Window,
    /// Its wire.
    pub strand: Strand,
    /// Turns, not rounded.
    pub turns: f64,
    /// Who sets the rated current.
    pub regime: Regime,
    /// Rated current, A.
    pub current_a: f64,
    /// |force| at the target at the rated current, N.
    pub force_n: f64,
    /// The limits.
    pub limits: Vec<LimitUse>,
}

/// What was proven.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Certificate {
    /// How.
    pub kind: CertificateKind,
    /// No coil within the limits exceeds this force, N; `None` where nothing is proven.
    pub upper_bound_n: Option<f64>,
    /// Upper bound over the force found, less one.
    pub gap: Option<f64>,
    /// Boxes of coils that were bounded, or coils that were examined.
    pub cells: usize,
}

impl Certificate {
    /// What `starts` local searches say; `lazy_table` were bounded in vain.
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

/// What the best force of one wire is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WireOutcome {
    /// The wire.
    pub strand: Strand,
    /// Its best force, N; `None` where no coil of it meets the limits.
    pub force_n: Option<f64>,
}

/// The result.
#[derive(Debug, Clone, PartialEq)]
pub struct Outcome {
    /// How it ended.
    pub status: OptimumStatus,
    /// The best coil; present with [`OptimumStatus::Optimal`].
    pub best: Option<BestCoil>,
    /// What is proven about it.
    pub certificate: Certificate,
    /// Every wire's best.
    pub wires: Vec<WireOutcome>,
    /// Evaluations of a coil.
    pub evaluations: usize,
    /// Local searches.
    pub starts: usize,
    /// Bores between which a coil within [`super::near_optimal_bore::SHARE`] of the best force exists,
    /// inner diameters in m.
    pub valley_m: Option<[f64; 2]>,
}
