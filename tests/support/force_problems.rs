//! Problems that own their data, and random ones with everything that goes wrong.

use fluxform_lambda::{ForceProblem, Settings, Solution, solve};
use fluxform_numerics::double_double::DoubleDouble;
use fluxform_numerics::random::Random;
use fluxform_numerics::real::Real;

pub type D = DoubleDouble;

pub fn d(value: f64) -> D {
    D::exactly(value)
}

/// An owned problem.
#[derive(Debug, Clone)]
pub struct Case {
    pub forces: Vec<f64>,
    pub heights: Vec<f64>,
    pub offset: Option<Vec<f64>>,
    pub lower: Vec<f64>,
    pub upper: Vec<f64>,
    pub total: Option<f64>,
    pub ohm: Vec<f64>,
}

impl Case {
    pub fn problem(&self) -> ForceProblem<'_> {
        ForceProblem {
            forces_n_per_a: &self.forces,
            height_m: &self.heights,
            offset_n: self.offset.as_deref(),
            weights: None,
            lower_a: &self.lower,
            upper_a: &self.upper,
            total_max_a: self.total,
            resistance_ohm: &self.ohm,
        }
    }

    pub fn coils(&self) -> usize {
        self.upper.len()
    }

    pub fn solve(&self) -> Solution {
        solve(&self.problem(), &Settings::default()).expect("a well-formed problem")
    }

    /// Mean h^2.
    pub fn mean_square(&self) -> f64 {
        self.heights.iter().map(|h| h * h).sum::<f64>() / self.heights.len() as f64
    }

    /// Mean square error of given currents.
    pub fn error(&self, lambda: D, currents: &[D]) -> D {
        let m = self.coils();
        let mut sum = D::ZERO;
        for (j, &h) in self.heights.iter().enumerate() {
            let mut r = lambda * d(h) - d(self.offset.as_ref().map_or(0.0, |o| o[j]));
            for (i, &x) in currents.iter().enumerate() {
                r -= d(self.forces[j * m + i]) * x;
            }
            sum += r * r;
        }
        sum / d(self.heights.len() as f64)
    }
}

/// Random problems with everything that goes wrong: ties, copies, zero columns, limits over
/// decades, limits of zero, a binding sum, currents below zero, few points.
pub fn small_case(seed: u64) -> Case {
    let mut n = Random::new(seed);
    let m = 1 + n.below(4);
    let points = 1 + n.below(7);
    let style = n.below(8);
    let mut forces: Vec<f64> = (0..points * m)
        .map(|_| match style {
            0 => n.normal(),
            // Few values: ties and exact dependences.
            1 => n.below(3) as f64 * 0.5,
            2 => n.below(5) as f64 - 2.0,
            _ => n.unit(),
        })
        .collect();
    let mut heights: Vec<f64> = (0..points)
        .map(|_| match style {
            1 | 3 => 0.05,
            2 => n.below(3) as f64 * 0.5,
            _ => n.between(0.02, 0.08),
        })
        .collect();
    if style == 4 && m > 1 {
        // A copy, or a nearly equal column.
        let shift = [0.0, 0.0, 1e-3, 1e-6, 1e-9][n.below(5)];
        for j in 0..points {
            forces[j * m + m - 1] = forces[j * m] + shift * n.normal();
        }
    }
    if style == 5 {
        let zero = n.below(m);
        for j in 0..points {
            forces[j * m + zero] = 0.0;
        }
    }
    if style == 6 {
        // A ring of coils over points that turn with it: all coils tie.
        let base: Vec<f64> = (0..m).map(|_| n.unit()).collect();
        forces = (0..m * m).map(|k| base[(k / m + k % m) % m]).collect();
        heights = vec![0.05; m];
    }
    let decades = [0.0, 0.0, 1.0, 6.0][n.below(4)];
    let signed = n.below(4) == 0;
    let equal = style == 6 || n.below(3) == 0;
    let first = 2.0 * 10_f64.powf(n.between(-decades, 0.0));
    let upper: Vec<f64> = (0..m)
        .map(|_| match (equal, n.below(12)) {
            (true, _) => first,
            (false, 0) => 0.0,
            _ => 2.0 * 10_f64.powf(n.between(-decades, 0.0)),
        })
        .collect();
    let lower = upper
        .iter()
        .map(|u| {
            if signed && n.below(4) > 0 {
                -u * n.unit()
            } else {
                0.0
            }
        })
        .collect();
    let all: f64 = upper.iter().sum();
    let total = match n.below(5) {
        0 | 1 => None,
        2 => Some(all),
        3 => Some(if n.below(6) == 0 { 0.0 } else { all * n.unit() }),
        _ => Some(all * 0.5),
    };
    Case {
        heights,
        offset: None,
        lower,
        upper,
        total,
        ohm: (0..m).map(|_| n.between(1.0, 9.0)).collect(),
        forces,
    }
}

/// Force constants that matter: around and between all breakpoints, and far out.
pub fn telling_lambdas(solution: &Solution) -> Vec<f64> {
    let turns: Vec<f64> = solution
        .path
        .breakpoints()
        .iter()
        .map(|b| b.lambda_n_per_m)
        .collect();
    let mut all = Vec::new();
    for pair in turns.windows(2) {
        all.extend([0.5 * (pair[0] + pair[1]), pair[1]]);
    }
    let last = turns[turns.len() - 1];
    all.extend([last * 1.3 + 0.7, last * 17.0 + 0.3]);
    all
}
