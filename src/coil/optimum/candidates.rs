//! Coils that can be wound: what is reported of them, and which are worth a look.

use super::diagnosis;
use super::domain::Domain;
use super::local_searches::{self, Solved};
use super::model::{Strand, Window};
use super::outcome::{BestCoil, Certificate, LimitUse, OptimumStatus, Violation};
use super::problem::{LimitName, Problem};
use super::search;

/// Share of the best force that a listed coil may lack.
pub const SHARE: f64 = 0.01;
/// Most coils listed beside the best.
const LISTED: usize = 50;

/// A coil that can be wound.
#[derive(Debug, Clone, PartialEq)]
pub struct WoundCoil {
    /// Its wire.
    pub strand: Strand,
    /// Layers n.
    pub layers: u64,
    /// Turns a layer m.
    pub turns_per_layer: u64,
    /// Its section.
    pub window: Window,
    /// Rated current, A.
    pub current_a: f64,
    /// |force| at the target, N.
    pub force_n: f64,
    /// Mass of the wire's metal, kg.
    pub wire_mass_kg: f64,
    /// Heat at the rated current, W.
    pub power_w: f64,
    /// The limits; sensitivities are the continuous problem's and zero here.
    pub limits: Vec<LimitUse>,
}

/// The best coil that can be wound, and others worth a look.
#[derive(Debug, Clone, PartialEq)]
pub struct WoundOutcome {
    /// How it ended.
    pub status: OptimumStatus,
    /// The best; present with [`OptimumStatus::Optimal`].
    pub best: Option<WoundCoil>,
    /// Coils within [`SHARE`] of its force that are shorter, lighter or cooler, none of them
    /// beaten by another in force, length, mass and heat together; strongest first.
    pub alternatives: Vec<WoundCoil>,
    /// What is proven.
    pub certificate: Certificate,
    /// Best force of a coil whose turns need not be whole, N.
    pub continuous_n: Option<f64>,
    /// That coil, with what its limits cost.
    pub continuous: Option<BestCoil>,
    /// Evaluations of a coil by the local searches.
    pub evaluations: usize,
    /// Local searches.
    pub starts: usize,
}

/// One coil with its best bore.
#[derive(Debug, Clone, Copy)]
pub(super) struct Leaf {
    pub layers: u64,
    pub turns: u64,
    pub window: Window,
    pub ln_force: f64,
}

impl WoundOutcome {
    /// No coil that can be wound, beside what `problems` found of those that cannot.
    pub(super) fn none(status: OptimumStatus, problems: &[Solved<'_>]) -> Self {
        Self {
            status,
            best: None,
            alternatives: Vec::new(),
            certificate: Certificate::of_searches(local_searches::starts_of(problems), 0),
            continuous_n: local_searches::best_of(problems).and_then(Solved::force_n),
            continuous: local_searches::best_of(problems).and_then(search::describe),
            evaluations: problems.iter().map(|s| s.evaluations).sum(),
            starts: local_searches::starts_of(problems),
        }
    }
}

/// A finite box about a problem's continuous optimum.
pub(super) fn around_optimum(solved: &Solved<'_>) -> Option<Domain> {
    const WIDER: f64 = 3.0;
    let window = Problem::window(solved.best.as_ref()?.x);
    let mut domain = Domain::of(&solved.problem);
    domain.outer_m[1] = domain.outer_m[1].min(WIDER * window.outer_radius_m());
    domain.length_m[1] = domain.length_m[1].min(WIDER * window.length_m);
    Some(domain)
}

/// Why no coil can be wound though coils of any turns exist: what the nearest whole one breaks.
pub(super) fn rounded_status(open: &[&Solved<'_>]) -> OptimumStatus {
    let mut least: Option<(Vec<Violation>, Window)> = None;
    for solved in open {
        let Some(local) = &solved.best else { continue };
        let wire_m = solved.problem.strand.diameter_m;
        let mut window = Problem::window(local.x);
        let whole = |length_m: f64| (length_m / wire_m).floor().max(1.0) * wire_m;
        window.depth_m = whole(window.depth_m);
        window.length_m = whole(window.length_m);
        let broken = diagnosis::violations(&solved.problem, window);
        if least.is_none() {
            least = Some((broken, window));
        }
    }
    let (violations, least) = least.unwrap_or((
        Vec::new(),
        Window {
            inner_radius_m: 0.0,
            depth_m: 0.0,
            length_m: 0.0,
        },
    ));
    OptimumStatus::Infeasible { violations, least }
}

/// The coil of a leaf in SI units.
pub(super) fn describe(problem: &Problem<'_>, leaf: &Leaf) -> Option<WoundCoil> {
    let rated = problem.rate(leaf.window)?;
    let point = problem.scaled(&rated);
    let limits = problem
        .bounds
        .iter()
        .enumerate()
        .filter(|(_, bound)| {
            !matches!(
                bound.name,
                LimitName::Axis | LimitName::OneLayer | LimitName::OneTurn
            )
        })
        .map(|(row, bound)| LimitUse {
            name: bound.name,
            value: rated.values[row].value,
            limit: bound.limit,
            active: point.rows[row].abs() <= 1e-9,
            sensitivity_n_per_unit: 0.0,
        })
        .collect();
    let volume = leaf.window.volume_over_pi_m3().value;
    let resistance_ohm = volume * problem.strand.resistance_per_volume();
    Some(WoundCoil {
        strand: problem.strand,
        layers: leaf.layers,
        turns_per_layer: leaf.turns,
        window: leaf.window,
        current_a: rated.current_a,
        force_n: rated.force_n.value,
        wire_mass_kg: volume * problem.strand.mass_per_volume(),
        power_w: rated.current_a * rated.current_a * resistance_ohm,
        limits,
    })
}

/// The strongest coil and, of those that follow, the ones better than it in length, mass or heat and
/// not beaten by a stronger one in all three.
#[derive(Debug, Default)]
pub(super) struct Listed {
    best: Option<WoundCoil>,
    others: Vec<WoundCoil>,
}

impl Listed {
    /// Takes the next coil in the order of force.
    pub fn add(&mut self, coil: WoundCoil) {
        let traits = |coil: &WoundCoil| [coil.window.length_m, coil.wire_mass_kg, coil.power_w];
        let ours = traits(&coil);
        // Rounding is no advantage.
        let beaten = |other: &WoundCoil| {
            let pairs = traits(other).into_iter().zip(ours);
            pairs.fold(true, |all, (theirs, ours)| {
                all && theirs <= ours * (1.0 + 1e-9)
            })
        };
        if self.best.is_none() {
            self.best = Some(coil);
        } else if !self.best.iter().chain(&self.others).any(beaten) {
            self.others.push(coil);
        }
    }

    /// Whether no more are listed.
    pub(crate) fn is_full(&self) -> bool {
        self.others.len() >= LISTED
    }

    pub fn finish(self) -> (Option<WoundCoil>, Vec<WoundCoil>) {
        (self.best, self.others)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::optimum::sqp::{Local, Smooth};
    use crate::optimum::tests::{air, task};
    use fluxform_design::Limits;

    #[test]
    fn where_nothing_bounds_a_coil_the_box_is_three_times_the_best_one() {
        let window = Window {
            inner_radius_m: 0.007,
            depth_m: 0.006,
            length_m: 0.05,
        };
        let x = Problem::coordinates(&window);
        for limit_m in [None, Some(0.03)] {
            let limits = Limits {
                settling_max_s: Some(0.1),
                length_max_m: limit_m,
                ..Limits::default()
            };
            let (model, task) = (air(0.03), task(limits, None));
            let problem = Problem::of_wire(&model, &task, task.strands[0]).remove(0);
            let point = problem.at(x).expect("in the domain");
            let solved = Solved {
                best: Some(Local {
                    x,
                    multipliers: vec![0.0; point.rows.len()],
                    point,
                    evaluations: 0,
                }),
                problem,
                contradiction: None,
                missing: Vec::new(),
                evaluations: 0,
                starts: 0,
            };
            let domain = around_optimum(&solved).expect("a best coil");
            assert!((domain.outer_m[1] / 0.039 - 1.0).abs() < 1e-12);
            let longest_m = limit_m.unwrap_or(0.15);
            assert!((domain.length_m[1] / longest_m - 1.0).abs() < 1e-12);
        }
    }
}
