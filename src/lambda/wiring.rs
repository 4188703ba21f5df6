//! Coils that are broken, or wired in series, as changes of a force problem.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::problem::ForceProblem;

/// Coils that do not carry a current of their own.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
pub struct Wiring {
    /// Coils without current.
    pub broken: Vec<usize>,
    /// Pairs with one current, which counts once in the sum that the supply limits.
    pub series: Vec<[usize; 2]>,
}

/// Why coils cannot be wired like that.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum WiringError {
    /// No such coil.
    #[error("coil {coil} is not in the array: its coils are numbered 0 to {last}")]
    NoCoil {
        /// The number given.
        coil: usize,
        /// The largest there is.
        last: usize,
    },
    /// A coil in two pairs, twice in one, or broken in a pair.
    #[error("coil {0} is named twice among broken coils and pairs in series")]
    Twice(usize),
}

/// The changed lists of a problem.
#[derive(Debug, Clone)]
pub struct Rewired {
    forces_n_per_a: Vec<f64>,
    lower_a: Vec<f64>,
    upper_a: Vec<f64>,
    resistance_ohm: Vec<f64>,
}

impl Wiring {
    /// Whether nothing is changed.
    #[must_use]
    pub fn is_plain(&self) -> bool {
        self.broken.is_empty() && self.series.is_empty()
    }

    /// Checks the coils' numbers.
    ///
    /// # Errors
    /// A coil that is not there, or named twice.
    pub fn validate(&self, coils: usize) -> Result<(), WiringError> {
        let mut seen = vec![false; coils];
        for &coil in self.broken.iter().chain(self.series.as_flattened()) {
            match seen.get_mut(coil) {
                None => {
                    return Err(WiringError::NoCoil {
                        coil,
                        last: coils.saturating_sub(1),
                    });
                }
                Some(true) => return Err(WiringError::Twice(coil)),
                Some(seen) => *seen = true,
            }
        }
        Ok(())
    }

    /// The problem's lists with these changes. The first coil of a pair stands for both; the
    /// second one, like a broken coil, is left without force and current. A pair is one circuit: a
    /// supply of `voltage_v` drives it at most by that over the sum of both resistances.
    #[must_use]
    pub fn apply(&self, problem: &ForceProblem, voltage_v: Option<f64>) -> Rewired {
        let mut changed = Rewired {
            forces_n_per_a: problem.forces_n_per_a.to_vec(),
            lower_a: problem.lower_a.to_vec(),
            upper_a: problem.upper_a.to_vec(),
            resistance_ohm: problem.resistance_ohm.to_vec(),
        };
        for &[a, b] in &self.series {
            changed.resistance_ohm[a] += changed.resistance_ohm[b];
            let most_a = voltage_v.map_or(f64::INFINITY, |v| v / changed.resistance_ohm[a]);
            changed.lower_a[a] = changed.lower_a[a].max(changed.lower_a[b]).max(-most_a);
            changed.upper_a[a] = changed.upper_a[a].min(changed.upper_a[b]).min(most_a);
        }
        for row in changed.forces_n_per_a.chunks_exact_mut(problem.coils()) {
            for &[a, b] in &self.series {
                row[a] += row[b];
            }
            for coil in self.silent() {
                row[coil] = 0.0;
            }
        }
        for coil in self.silent() {
            changed.lower_a[coil] = 0.0;
            changed.upper_a[coil] = 0.0;
        }
        changed
    }

    /// Coils without a current of their own.
    fn silent(&self) -> impl Iterator<Item = usize> + '_ {
        let second = self.series.iter().map(|&[_, b]| b);
        self.broken.iter().copied().chain(second)
    }

    /// The currents as the changed problem has them: that of a pair is its first coil's, whose resistance is both coils'.
    #[must_use]
    pub fn own(&self, currents_a: &[f64]) -> Vec<f64> {
        let mut own = currents_a.to_vec();
        for coil in self.silent() {
            own[coil] = 0.0;
        }
        own
    }

    /// Gives the second coil of every pair the current of the first.
    pub fn spread(&self, currents_a: &mut [f64]) {
        for &[a, b] in &self.series {
            currents_a[b] = currents_a[a];
        }
    }
}

impl Rewired {
    /// `problem` with the changed lists in place of its own.
    #[must_use]
    pub fn problem<'a>(&'a self, problem: &ForceProblem<'a>) -> ForceProblem<'a> {
        ForceProblem {
            forces_n_per_a: &self.forces_n_per_a,
            lower_a: &self.lower_a,
            upper_a: &self.upper_a,
            resistance_ohm: &self.resistance_ohm,
            ..*problem
        }
    }
}
