//! The best coil that can be wound: whole layers, whole turns per layer, any bore.
//!
//! OD = ID + 2 n d and L = m d. Coils in air are bounded by interval arithmetic (`bounded_coils`), cored
//! ones by cheaper models (`screened_coils`), and searched through best first (`best_first`).

use super::best_first::Strongest;
use super::bounded_coils::{BoundedCoils, next_to_continuous};
use super::branch_and_bound::{self, GAP};
use super::candidates::{self, Leaf, SHARE, around_optimum};
use super::local_searches::{self, Settings, Solved};
use super::model::CoilModel;
use super::nearest_whole;
use super::outcome::{BestCoil, Certificate, CertificateKind, OptimumStatus, Outcome};
use super::problem::Task;
use super::screened_coils;
use super::search;
use super::whole_sizes::of_whole_wires;
use fluxform_base::progress::{Interrupted, Progress};

/// Maximises |force| over the coils that can be wound within `task`. Coils for which no bounds
/// exist, cored ones, are examined one by one (`screened_coils`).
///
/// # Errors
/// Interruption.
pub fn optimise_wound(
    model: &dyn CoilModel,
    task: &Task,
    settings: &Settings,
    progress: &dyn Progress,
) -> Result<Outcome, Interrupted> {
    let task = &match of_whole_wires(task) {
        Ok(task) => task,
        Err(refused) => {
            return Ok(candidates::none(
                OptimumStatus::Contradictory(refused),
                &[],
                0,
            ));
        }
    };
    let problems = match search::solve_all(model, task, settings, progress)? {
        Ok(problems) => problems,
        Err((status, problems)) => return Ok(candidates::none(status, &problems, 0)),
    };
    if model.air_dipoles().is_none() {
        return screened_coils::optimise(model, task, &problems, progress);
    }
    let open: Vec<&Solved<'_>> = problems
        .iter()
        .filter(|solved| solved.contradiction.is_none())
        .collect();
    let near: Vec<Vec<Leaf>> = open
        .iter()
        .map(|solved| next_to_continuous(solved))
        .collect();
    let forces_ln = near.iter().flatten().map(|leaf| leaf.ln_force);
    let best_ln = forces_ln.fold(f64::NEG_INFINITY, f64::max);
    // Without a coil to compare with, any positive force counts.
    let reach_n = best_ln.max(-600.0).exp() * (1.0 - SHARE);
    let mut complete = true;
    let (mut coils, mut known) = (Vec::new(), Vec::new());
    for (solved, near) in open.iter().zip(near) {
        let domain = branch_and_bound::finite_domain(&solved.problem, reach_n).or_else(|| {
            // Nothing bounds the coil for certain: what is near the continuous optimum.
            complete = false;
            around_optimum(solved)
        });
        match domain.and_then(|domain| BoundedCoils::new(solved, domain, best_ln)) {
            Some(bounded) => {
                coils.push(bounded);
                known.push(near);
            }
            None => complete = false,
        }
    }
    progress.begin("wind", open.len() as u64);
    let search = Strongest::of(&coils, known, settings.cells / 2, progress)?;
    progress.end();
    let certificate = |best: &BestCoil| {
        let top_ln = best.force_n.ln();
        let upper_ln = search.bound_ln.max(top_ln);
        let gap = (upper_ln - top_ln).exp_m1();
        let complete = complete && gap.is_finite();
        Certificate {
            kind: if complete && gap <= GAP {
                CertificateKind::Global
            } else {
                CertificateKind::of_searches(local_searches::starts_of(&problems))
            },
            upper_bound_n: complete.then(|| upper_ln.exp()),
            gap: complete.then_some(gap),
            cells: search.cells,
        }
    };
    Ok(candidates::found(search.listed, &problems, certificate)
        .unwrap_or_else(|| candidates::none(nearest_whole::status(&open), &problems, search.cells)))
}

#[cfg(test)]
mod tests {
    use super::super::domain::Domain;
    use super::*;
    use crate::optimum::tests::{HEIGHT_M, air, quick, seed_limits, task};
    use fluxform_base::progress::Silent;
    use fluxform_design::Limits;

    /// Without a budget nothing is taken apart, and what waits is still bounded.
    #[test]
    fn no_more_sets_are_taken_apart_than_the_budget_allows() {
        let limits = Limits {
            settling_max_s: None,
            ..seed_limits()
        };
        let (model, task) = (air(HEIGHT_M), task(limits, None));
        let settings = Settings {
            starts: 2,
            cells: 0,
            ..quick()
        };
        let Ok(problems) = search::solve_all(&model, &task, &settings, &Silent).expect("runs")
        else {
            panic!("bounded");
        };
        let domain = Domain::of(&problems[0].problem);
        let best_ln = problems[0].force_n().expect("a coil").ln();
        let coils = BoundedCoils::new(&problems[0], domain, best_ln).expect("an air coil");
        let coils = [coils];
        let of = |budget| {
            let known = vec![next_to_continuous(&problems[0])];
            Strongest::of(&coils, known, budget, &Silent).expect("runs")
        };
        let none = of(0);
        assert_eq!(none.cells, 1);
        assert!(none.bound_ln > best_ln);
        // The coil that was known before is one: that there was none was said without a budget.
        assert!(
            candidates::found(none.listed, &problems, |_| Certificate::of_searches(2, 1)).is_some()
        );
        let some = of(64);
        let whole = next_to_continuous(&problems[0]);
        let whole_ln = whole
            .iter()
            .map(|leaf| leaf.ln_force)
            .fold(f64::NEG_INFINITY, f64::max);
        assert!(some.cells > 64 && some.bound_ln >= whole_ln && some.bound_ln < none.bound_ln);
    }
}
