//! `lambda --plot`: the picture of a solved object.

use crate::bundle::lambda_file::LambdaFile;
use crate::lambda::{Criterion, ForceProblem, Solution};
use crate::numerics::spread::spread;
use crate::plot::lambda::{ChosenForces, Constant, ErrorMap, LambdaPlot};
use crate::plot::plane::{Cells, Together};

use super::PosedProblem;

/// Evenly spaced force constants beside the breakpoints.
const STEPS: usize = 240;
/// The axis ends this much beyond the last constant shown,
const MARGIN: f64 = 1.12;
/// and constants are shown up to so many times the chosen one.
const FARTHEST: f64 = 4.0;
/// Points on no grid are drawn up to this many.
const MOST_POINTS: usize = 20_000;

impl PosedProblem<'_> {
    /// The picture of a solved object. `feedback_n` are the forces with feedback at the chosen
    /// lambda, N; empty where not requested.
    pub(super) fn picture(
        &self,
        file: &LambdaFile,
        solution: &Solution,
        feedback_n: Vec<f64>,
    ) -> LambdaPlot {
        let path = &solution.path;
        let feedback = file
            .feedback
            .as_ref()
            .and_then(|f| f.largest.lambda_n_per_m);
        let constants: Vec<Constant> = Criterion::ALL
            .iter()
            .map(|&criterion| (criterion.name(), file.constants.of(criterion)))
            .chain([("feedback", feedback)])
            .filter_map(|(name, lambda_n_per_m)| {
                lambda_n_per_m.map(|lambda_n_per_m| Constant {
                    name,
                    lambda_n_per_m,
                })
            })
            .collect();
        let turns: Vec<f64> = path
            .breakpoints()
            .iter()
            .map(|b| b.lambda_n_per_m)
            .collect();
        let all = constants.iter().map(|one| one.lambda_n_per_m);
        let last = all.chain(turns.last().copied()).fold(0.0, f64::max);
        let shown = match file.lambda_n_per_m.filter(|lambda| *lambda > 0.0) {
            Some(chosen) => last.min(FARTHEST * chosen),
            None => last,
        };
        let end_n_per_m = if shown > 0.0 { MARGIN * shown } else { 1.0 };
        let mut lambdas: Vec<f64> = (0..=STEPS)
            .map(|k| end_n_per_m * k as f64 / STEPS as f64)
            .chain(turns.iter().copied().filter(|turn| *turn <= end_n_per_m))
            .collect();
        lambdas.sort_by(f64::total_cmp);
        lambdas.dedup();
        let rms_height_m = rms_height_m(&self.problem);
        let rms_error_n: Vec<f64> = lambdas.iter().map(|l| path.error_n2(*l).sqrt()).collect();
        let relative = |(lambda, error): (&f64, &f64)| {
            let requested = lambda * rms_height_m;
            // More than the whole force is no rendering: the axis is for the rest.
            (requested > 0.0)
                .then(|| error / requested)
                .filter(|part| *part <= 1.0)
        };
        let currents = |lambda: &f64| {
            let mut currents = path.currents_a(*lambda);
            self.options.wiring.spread(&mut currents);
            currents
        };
        LambdaPlot {
            title: format!("{} on {}", file.shape, file.design),
            end_n_per_m,
            relative_error: lambdas.iter().zip(&rms_error_n).map(relative).collect(),
            currents_a: lambdas.iter().map(currents).collect(),
            breakpoint: lambdas.iter().map(|l| turns.contains(l)).collect(),
            lambda_n_per_m: lambdas,
            rms_error_n,
            constants,
            chosen: self.chosen_forces(solution, feedback_n),
        }
    }

    fn chosen_forces(&self, solution: &Solution, feedback_n: Vec<f64>) -> Option<ChosenForces> {
        let (problem, at) = (&self.problem, solution.chosen.as_ref()?);
        let lambda_n_per_m = at.lambda_n_per_m;
        let requested_n: Vec<f64> = problem
            .height_m
            .iter()
            .map(|h| lambda_n_per_m * h)
            .collect();
        let rows = problem.forces_n_per_a.chunks_exact(problem.coils());
        let static_n: Vec<f64> = rows
            .enumerate()
            .map(|(point, row)| {
                let offset = problem.offset_n.map_or(0.0, |offset| offset[point]);
                let terms = row.iter().zip(&at.currents_a);
                terms.fold(offset, |sum, (force, current)| sum + force * current)
            })
            .collect();
        let errors = static_n.iter().zip(&requested_n);
        let errors_mn: Vec<f64> = errors
            .map(|(given, requested)| (given - requested) * 1e3)
            .collect();
        let map = match &self.points.grid {
            Some(grid) => {
                let mut values = vec![None; grid.columns * grid.rows];
                for (place, error) in grid.index.iter().zip(&errors_mn) {
                    values[*place] = Some(*error);
                }
                let [x_mm, y_mm] = grid.plan_m.map(|ends| ends.map(|end| end * 1e3));
                ErrorMap::Grid {
                    x_mm,
                    y_mm,
                    cells: Cells {
                        columns: grid.columns,
                        values,
                        together: Together::Largest,
                    },
                }
            }
            None => {
                let some = spread(errors_mn.len(), MOST_POINTS);
                let places = some.iter().map(|point| self.points.positions_m[*point]);
                ErrorMap::Scattered {
                    points_mm: places.map(|p| (p[0] * 1e3, p[1] * 1e3)).collect(),
                    errors_mn: some.iter().map(|point| errors_mn[*point]).collect(),
                }
            }
        };
        Some(ChosenForces {
            lambda_n_per_m,
            requested_n,
            static_n,
            feedback_n,
            map,
        })
    }
}

/// Root of the weighted mean of h^2.
fn rms_height_m(problem: &ForceProblem) -> f64 {
    let weight = |point: usize| problem.weights.map_or(1.0, |weights| weights[point]);
    let heights = problem.height_m.iter().enumerate();
    let (sum, all) = heights.fold((0.0, 0.0), |(sum, all), (point, h)| {
        (sum + weight(point) * h * h, all + weight(point))
    });
    (sum / all).sqrt()
}
