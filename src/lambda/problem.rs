//! The problem to be solved: forces per ampere at the points, heights and limits.

use fluxform_base::force_constant::Criterion;
use rayon::prelude::*;

/// Forces, heights and limits of one object (eq. 9 and 10). Borrowed, never copied.
#[derive(Debug, Clone, Copy)]
pub struct ForceProblem<'a> {
    /// Force per ampere of every coil at every point, N/A: row by row, one row a point.
    pub forces_n_per_a: &'a [f64],
    /// Height of each point, m: the requested force there is lambda times it.
    pub height_m: &'a [f64],
    /// Force at each point without any current, N; `None`: none.
    pub offset_n: Option<&'a [f64]>,
    /// Weight of each point in the mean square error, such as the area it stands for (> 0, any
    /// unit); `None`: all alike. The worst-point form does not depend on it.
    pub weights: Option<&'a [f64]>,
    /// Lower current limit of each coil, A (<= 0).
    pub lower_a: &'a [f64],
    /// Upper current limit of each coil, A (>= 0).
    pub upper_a: &'a [f64],
    /// Limit of the sum of the currents, A (>= 0).
    pub total_max_a: Option<f64>,
    /// Resistance of each coil, ohm (> 0): among equally good currents those of least power are taken.
    pub resistance_ohm: &'a [f64],
}

impl ForceProblem<'_> {
    /// Its first `points`, and the others.
    ///
    /// # Panics
    /// When there are fewer.
    #[must_use]
    pub fn split_at(&self, points: usize) -> (Self, Self) {
        let forces = self.forces_n_per_a.split_at(points * self.upper_a.len());
        let heights = self.height_m.split_at(points);
        let offsets = self.offset_n.map(|all| all.split_at(points)).unzip();
        let weights = self.weights.map(|all| all.split_at(points)).unzip();
        let part = |forces_n_per_a, height_m, offset_n, weights| Self {
            forces_n_per_a,
            height_m,
            offset_n,
            weights,
            ..*self
        };
        (
            part(forces.0, heights.0, offsets.0, weights.0),
            part(forces.1, heights.1, offsets.1, weights.1),
        )
    }
}

/// The directions of current that a driver has, whatever its size.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Directions {
    /// Above zero.
    pub up: bool,
    /// Below zero.
    pub down: bool,
}

/// A coil whose largest force is a smaller share of the strongest coil's is refused: what it adds
/// is lost in the rounding of the worst-point form, and far below that in the range of doubles.
const LEAST_REACH: f64 = 1e-20;

/// How the problem is solved.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// The chosen force constant.
    pub criterion: Criterion,
    /// w of the just-noticeable difference, relative to the RMS of the requested force.
    pub jnd_weight: f64,
    /// A force constant at which currents and errors are also computed, N/m.
    pub at_n_per_m: Option<f64>,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            criterion: Criterion::Jnd,
            jnd_weight: fluxform_base::units::FORCE_JND,
            at_n_per_m: None,
        }
    }
}

/// Why a problem cannot be stated. Each names the entry at fault.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ProblemError {
    /// No points.
    #[error("no constraint points: at least one height is needed")]
    NoPoints,
    /// No coils.
    #[error("no coils: at least one current limit is needed")]
    NoCoils,
    /// A list of the wrong length.
    #[error("{name} has {found} entries, expected {expected}")]
    Length {
        /// Which list.
        name: &'static str,
        /// Entries found.
        found: usize,
        /// Entries expected.
        expected: usize,
    },
    /// A coil that is too weak beside another one.
    #[error(
        "coil {coil} gives at most {most_n:.3e} N and coil {strongest} {strongest_n:.3e} N: a force \
         that is a smaller share of it than 1e-20 cannot be computed; leave the coil out of the \
         array, or set its gain to 0"
    )]
    TooWeak {
        /// Its number.
        coil: usize,
        /// Its largest force at any point within its limits, N.
        most_n: f64,
        /// The strongest coil.
        strongest: usize,
        /// Its largest force, N.
        strongest_n: f64,
    },
    /// A path that ended before the force constant.
    #[error(
        "the path over lambda could not be followed as far as the force constant; please report this design and shape"
    )]
    Unfollowed,
    /// Infinite or not a number.
    #[error("{name}[{index}] is {value}: only finite numbers can be used")]
    NotFinite {
        /// Which list.
        name: &'static str,
        /// Position in the list; for forces point * coils + coil.
        index: usize,
        /// The value found.
        value: f64,
    },
    /// On the wrong side of zero.
    #[error("{name}[{index}] is {value}, expected {expected}")]
    Sign {
        /// Which list.
        name: &'static str,
        /// Position in the list.
        index: usize,
        /// The value found.
        value: f64,
        /// The expectation.
        expected: &'static str,
    },
}

/// The first entry that is not finite.
fn finite(name: &'static str, values: &[f64]) -> Result<(), ProblemError> {
    // One pass without branches over the common case.
    let clean = |part: &[f64]| {
        part.iter()
            .fold(true, |clean, value| clean & value.is_finite())
    };
    if values.par_chunks(65_536).all(clean) {
        return Ok(());
    }
    let found = values
        .iter()
        .copied()
        .enumerate()
        .find(|(_, value)| !value.is_finite());
    found.map_or(Ok(()), |(index, value)| {
        Err(ProblemError::NotFinite { name, index, value })
    })
}

fn signed(
    name: &'static str,
    values: &[f64],
    expected: &'static str,
    good: impl Fn(f64) -> bool,
) -> Result<(), ProblemError> {
    finite(name, values)?;
    let found = values
        .iter()
        .copied()
        .enumerate()
        .find(|&(_, value)| !good(value));
    found.map_or(Ok(()), |(index, value)| {
        Err(ProblemError::Sign {
            name,
            index,
            value,
            expected,
        })
    })
}

impl ForceProblem<'_> {
    /// Number of points.
    #[must_use]
    pub fn points(&self) -> usize {
        self.height_m.len()
    }

    /// Number of coils.
    #[must_use]
    pub fn coils(&self) -> usize {
        self.upper_a.len()
    }

    /// Root mean square of the heights, m, each point with its weight.
    #[must_use]
    pub fn rms_height_m(&self) -> f64 {
        let heights = self.height_m.iter().enumerate();
        let (sum, total) = heights.fold((0.0, 0.0), |(sum, total), (row, height_m)| {
            (
                sum + self.weight(row) * height_m * height_m,
                total + self.weight(row),
            )
        });
        (sum / total).sqrt()
    }

    /// The weight of a point in the mean.
    #[must_use]
    pub fn weight(&self, point: usize) -> f64 {
        self.weights.map_or(1.0, |all| all[point])
    }

    /// The largest weight; 1 without weights.
    pub(super) fn heaviest(&self) -> f64 {
        let weights = self.weights.unwrap_or(&[1.0]);
        weights.iter().copied().fold(0.0, f64::max)
    }

    /// The directions of current of coil `i`; a driver without any counts as one with currents above zero, beside
    /// others that all have theirs below as one of those.
    pub(super) fn directions(&self, i: usize) -> Directions {
        let any = |limits_a: &[f64]| limits_a.iter().any(|limit_a| *limit_a != 0.0);
        let (up, down) = (self.upper_a[i] > 0.0, self.lower_a[i] < 0.0);
        let reversed = !up && !down && any(self.lower_a) && !any(self.upper_a);
        Directions {
            up: up || !(down || reversed),
            down: down || reversed,
        }
    }

    /// Largest |current| of coil `i`, A.
    pub(super) fn reach_a(&self, i: usize) -> f64 {
        self.upper_a[i].max(-self.lower_a[i])
    }

    /// Checks that no coil is lost beside the strongest one; `largest` holds the largest force per
    /// ampere of every coil.
    ///
    /// # Errors
    /// The first coil that is.
    pub(super) fn comparable(&self, largest: &[f64]) -> Result<(), ProblemError> {
        // A product may leave the range of doubles, so products are compared by their logarithms.
        let reach = |i: usize| largest[i].log10() + self.reach_a(i).log10();
        let live = (0..self.coils()).filter(|&i| largest[i] > 0.0 && self.reach_a(i) > 0.0);
        let Some(strongest) = live
            .clone()
            .reduce(|a, b| if reach(b) > reach(a) { b } else { a })
        else {
            return Ok(());
        };
        let least = reach(strongest) + LEAST_REACH.log10();
        live.into_iter()
            .find(|&i| reach(i) < least)
            .map_or(Ok(()), |coil| {
                Err(ProblemError::TooWeak {
                    coil,
                    most_n: largest[coil] * self.reach_a(coil),
                    strongest,
                    strongest_n: largest[strongest] * self.reach_a(strongest),
                })
            })
    }

    /// Checks shapes, finiteness and signs.
    ///
    /// # Errors
    /// The first fault found.
    pub fn validate(&self, settings: &Settings) -> Result<(), ProblemError> {
        let (points, coils) = (self.points(), self.coils());
        if points == 0 {
            return Err(ProblemError::NoPoints);
        }
        if coils == 0 {
            return Err(ProblemError::NoCoils);
        }
        let lengths = [
            ("forces_n_per_a", self.forces_n_per_a.len(), points * coils),
            ("lower_a", self.lower_a.len(), coils),
            ("resistance_ohm", self.resistance_ohm.len(), coils),
            (
                "offset_n",
                self.offset_n.map_or(points, <[f64]>::len),
                points,
            ),
            ("weights", self.weights.map_or(points, <[f64]>::len), points),
        ];
        for (name, found, expected) in lengths {
            if found != expected {
                return Err(ProblemError::Length {
                    name,
                    found,
                    expected,
                });
            }
        }
        finite("forces_n_per_a", self.forces_n_per_a)?;
        finite("height_m", self.height_m)?;
        finite("offset_n", self.offset_n.unwrap_or(&[]))?;
        signed(
            "weights",
            self.weights.unwrap_or(&[]),
            "a weight above zero",
            |v| v > 0.0,
        )?;
        signed("lower_a", self.lower_a, "a limit of zero or below", |v| {
            v <= 0.0
        })?;
        signed("upper_a", self.upper_a, "a limit of zero or above", |v| {
            v >= 0.0
        })?;
        signed(
            "resistance_ohm",
            self.resistance_ohm,
            "a positive resistance",
            |v| v > 0.0,
        )?;
        signed(
            "total_max_a",
            self.total_max_a.as_slice(),
            "a limit of zero or above",
            |v| v >= 0.0,
        )?;
        signed(
            "jnd_weight",
            &[settings.jnd_weight],
            "a weight of zero or above",
            |v| v >= 0.0,
        )?;
        signed(
            "at_n_per_m",
            settings.at_n_per_m.as_slice(),
            "zero or above",
            |v| v >= 0.0,
        )
    }
}
