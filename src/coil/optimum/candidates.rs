//! Coils that can be wound: what is reported of them, and which are worth a look.

use super::domain::Domain;
use super::local_searches::{self, Solved};
use super::model::Window;
use super::outcome::{
    Advantage, Alternative, BestCoil, Certificate, LimitUse, OptimumStatus, Outcome, WholeTurns,
};
use super::problem::Problem;
use super::search;
use super::sqp::ACTIVE;

/// Share of the best force that a listed coil may lack.
pub const SHARE: f64 = 0.01;
/// Most coils listed beside the best, and reported.
const LISTED: usize = 50;
const ALTERNATIVES: usize = 20;

/// One coil with its best bore.
#[derive(Debug, Clone, Copy)]
pub(super) struct Leaf {
    pub layers: u64,
    pub turns: u64,
    pub window: Window,
    pub ln_force: f64,
}

/// No coil that can be wound among `cells` sets of them, beside what `problems` found of those that cannot.
pub(super) fn none(status: OptimumStatus, problems: &[Solved<'_>], cells: usize) -> Outcome {
    let best = local_searches::best_of(problems);
    let starts = local_searches::starts_of(problems);
    Outcome {
        certificate: Certificate::of_searches(starts, cells),
        continuous_force_n: best.and_then(Solved::force_n),
        continuous: best.and_then(search::describe),
        wires: Vec::new(),
        ..search::without_coil(status, problems)
    }
}

/// The best coil of `listed` and what is `certificate`d of it, its limits as dear as they are to
/// the coil whose turns need not be whole; `None` where no coil is listed.
pub(super) fn found(
    listed: Listed,
    problems: &[Solved<'_>],
    certificate: impl FnOnce(&BestCoil) -> Certificate,
) -> Option<Outcome> {
    let (mut best, others) = (listed.best?, listed.others);
    let outcome = none(OptimumStatus::Optimal, problems, 0);
    for used in &mut best.limits {
        let continuous = outcome.continuous.as_ref();
        used.sensitivity_n_per_unit = continuous
            .and_then(|coil| coil.limit(used.name))
            .map_or(0.0, |other| other.sensitivity_n_per_unit);
    }
    // Of many the strongest, the weakest and those evenly between.
    let count = others.len().min(ALTERNATIVES);
    let at = |k: usize| k * (others.len() - 1) / (count - 1).max(1);
    Some(Outcome {
        alternatives: (0..count)
            .map(|k| Alternative::new(&others[at(k)], &best, None))
            .collect(),
        certificate: certificate(&best),
        best: Some(best),
        ..outcome
    })
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

/// The coil of a leaf in SI units.
pub(super) fn describe(problem: &Problem<'_>, leaf: &Leaf) -> Option<BestCoil> {
    let rated = problem.rate(leaf.window)?;
    let point = problem.scaled(&rated);
    let limits = problem
        .bounds
        .iter()
        .enumerate()
        .filter(|(_, bound)| !bound.name.is_least_size())
        .map(|(row, bound)| {
            let active = point.rows[row].abs() <= ACTIVE;
            LimitUse::new(
                bound.name,
                rated.values[row].value,
                bound.limit,
                active,
                0.0,
            )
        })
        .collect();
    Some(BestCoil {
        window: leaf.window,
        strand: problem.strand,
        turns: (leaf.layers * leaf.turns) as f64,
        whole: Some(WholeTurns {
            layers: leaf.layers,
            turns_per_layer: leaf.turns,
        }),
        regime: problem.regime,
        current_a: rated.current_a,
        force_n: rated.force_n.value,
        mass_kg: rated.mass_kg,
        limits,
    })
}

/// The strongest coil and, of those that follow, the ones better than it in length, mass or heat and
/// not beaten by a stronger one in all three.
#[derive(Debug, Default)]
pub(super) struct Listed {
    best: Option<BestCoil>,
    others: Vec<BestCoil>,
}

impl Listed {
    /// Takes the next coil in the order of force.
    pub fn add(&mut self, coil: BestCoil) {
        let ours = Advantage::amounts(&coil);
        // Rounding is no advantage.
        let beaten = |other: &BestCoil| {
            let pairs = Advantage::amounts(other).into_iter().zip(ours);
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
