//! The problem of t_0: without the drivers' size, with their directions of current alone.
//!
//! A driver that reverses has two columns, `G_i` and `-G_i`, and one that only pulls has the second,
//! so that all currents are at least zero and every vertex of the program is one of its limits.

use crate::problem::ForceProblem;

/// The lists of that problem, where they are not those of the limited one.
pub(super) struct FreeProblem {
    forces_n_per_a: Vec<f64>,
    lower_a: Vec<f64>,
    upper_a: Vec<f64>,
    resistance_ohm: Vec<f64>,
    /// Largest force per ampere of every column, largest height and offset, all absolute.
    pub largest: Vec<f64>,
}

impl FreeProblem {
    /// `None` where every driver only pushes: then the limited problem's own lists serve.
    pub fn new(problem: &ForceProblem, largest: &[f64]) -> Option<Self> {
        let coils = problem.coils();
        let columns: Vec<(usize, f64)> = (0..coils)
            .flat_map(|i| {
                let go = problem.directions(i);
                let up = go.up.then_some((i, 1.0));
                up.into_iter().chain(go.down.then_some((i, -1.0)))
            })
            .collect();
        if columns.iter().all(|&(_, sign)| sign > 0.0) {
            return None;
        }
        let of_coils = |value: &dyn Fn(usize) -> f64| -> Vec<f64> {
            columns.iter().map(|&(i, _)| value(i)).collect()
        };
        let rows = problem.forces_n_per_a.chunks_exact(coils);
        let mut all = of_coils(&|i| largest[i]);
        all.extend_from_slice(&largest[coils..]);
        Some(Self {
            forces_n_per_a: rows
                .flat_map(|row| columns.iter().map(|&(i, sign)| sign * row[i]))
                .collect(),
            lower_a: vec![0.0; columns.len()],
            // Only the units of force and current follow from it.
            upper_a: of_coils(&|i| problem.reach_a(i)),
            resistance_ohm: of_coils(&|i| problem.resistance_ohm[i]),
            largest: all,
        })
    }

    /// The same points with these columns.
    pub fn problem<'a>(&'a self, problem: &ForceProblem<'a>) -> ForceProblem<'a> {
        ForceProblem {
            forces_n_per_a: &self.forces_n_per_a,
            lower_a: &self.lower_a,
            upper_a: &self.upper_a,
            total_max_a: None,
            resistance_ohm: &self.resistance_ohm,
            ..*problem
        }
    }
}
