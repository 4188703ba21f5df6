//! The noise of each kind of measured number, and the fit whose weights follow from it.
//!
//! A noise that is given is used. One that is not given is estimated from what the fit leaves of its own
//! kind: squares left over (numbers of the kind - their share of the fitted directions), the share being the
//! trace of the hat matrix over the kind's rows (Helmert's variance components). The fit is repeated with
//! weights of one over the noise until those settle. The variance of parameter j is
//! sum_k noise_k^2 |A+_jk|^2, A+_jk being its row of the pseudo-inverse in the columns of kind k: this holds
//! for any weights, also where they have not settled or a given noise is exceeded.

use rayon::prelude::*;

use super::fit::{self, Fit, Parameter};
use super::model::Model;
use super::{Kind, SPARE, ScanRequest, of_kind, rms};
use crate::RunError;
use crate::bundle::scan::Scan;
use crate::numerics::least_squares;
use crate::progress::Progress;

/// Most repetitions of the fit with other weights.
const ROUNDS: usize = 12;
/// Weights whose ratio changes by less than this part have settled: far less than an estimate's own error.
const SETTLED: f64 = 3e-3;
/// Noise below this part of the measured values is rounding.
const ROUNDING: f64 = 1e-9;
/// One kind's noise, as a part of the measured values, counts as at least this part of the other's: what
/// the other kind alone determines then stays above the least-squares cutoff.
const LOWEST: f64 = 1e-3;

/// The noise of one kind.
pub(super) struct Noise {
    kind: Kind,
    pub(super) given: Option<f64>,
    /// Root mean square of the measured values.
    size: f64,
    /// One over the weight.
    unit: f64,
    /// Sum of the squares that are left, in squares of `unit`.
    left: f64,
    /// Numbers of the kind minus their share of the fitted directions.
    freedom: f64,
    /// Part of each parameter's variance that comes from this kind, for errors of one `unit`.
    parts: Vec<f64>,
}

impl Noise {
    fn chi_square(&self) -> f64 {
        self.left / self.freedom.max(1.0)
    }

    /// Of a given noise: what is left in units of it, 1 where noise is all that is left.
    pub(super) fn reduced_chi_square(&self) -> Option<f64> {
        self.given
            .filter(|_| self.freedom >= 1.0)
            .map(|_| self.chi_square())
    }
}

/// A fit with the noise of every kind that was measured.
pub(super) struct NoisyFit {
    pub(super) fit: Fit,
    noises: Vec<Noise>,
    /// A kind has too few values for an estimate of its own: noise that is not given is taken as the same
    /// part of the measured values in both kinds.
    shared: bool,
}

/// Fits `parameters` with weights of one over the noise.
///
/// # Errors
/// A scan on a winding's edge or the steel; interruption.
pub(super) fn fit(
    model: &Model,
    scan: &Scan,
    parameters: &[Parameter],
    request: &ScanRequest,
    field_t: f64,
    progress: &dyn Progress,
) -> Result<NoisyFit, RunError> {
    let noises = first(scan, request);
    let first_units: Vec<f64> = noises.iter().map(|noise| noise.unit).collect();
    let fit_from = |noises: &[Noise], start: Option<&Fit>| {
        let weights = weights(scan, noises);
        fit::fit(model, scan, parameters, &weights, field_t, start, progress)
    };
    let mut noisy = NoisyFit {
        fit: fit_from(&noises, None)?,
        noises,
        shared: false,
    };
    noisy.measure(scan);
    for _ in 0..ROUNDS {
        let units = if noisy.too_few() {
            noisy.shared = true;
            first_units.clone()
        } else {
            noisy.next_units()
        };
        // A fit that did not settle leaves no noise to weigh by.
        if noisy.settled(&units) || !noisy.fit.converged {
            break;
        }
        for (noise, unit) in noisy.noises.iter_mut().zip(units) {
            noise.unit = unit;
        }
        noisy.fit = fit_from(&noisy.noises, Some(&noisy.fit))?;
        noisy.measure(scan);
        if noisy.shared {
            break;
        }
    }
    Ok(noisy)
}

impl Kind {
    /// Its name and the option that states its noise.
    fn words(self) -> (&'static str, &'static str) {
        match self {
            Self::Field => ("field", "--noise-t"),
            Self::Gradient => ("gradient", "--noise-t-per-m"),
        }
    }

    fn given(self, request: &ScanRequest) -> Option<f64> {
        match self {
            Self::Field => request.noise_t,
            Self::Gradient => request.noise_t_per_m,
        }
    }
}

/// Refuses a noise of what was not measured.
pub(super) fn is_of_values(scan: &Scan, request: &ScanRequest) -> Result<(), String> {
    let absent =
        |kind: &Kind| kind.given(request).is_some() && rms(scan, &scan.values, *kind).is_none();
    Kind::ALL.into_iter().find(absent).map_or(Ok(()), |kind| {
        let (values, option) = kind.words();
        Err(format!(
            "{option}: the scan holds no {values} values; leave it out"
        ))
    })
}

/// The given noises; the same part of the measured values for one that is not given.
fn first(scan: &Scan, request: &ScanRequest) -> Vec<Noise> {
    let sizes = Kind::ALL.map(|kind| (kind, rms(scan, &scan.values, kind)));
    let kinds = sizes.into_iter().filter_map(|(kind, size)| {
        let size = size?;
        Some((
            kind,
            if size > 0.0 { size } else { 1.0 },
            kind.given(request),
        ))
    });
    let kinds: Vec<_> = kinds.collect();
    let relative = kinds
        .iter()
        .find_map(|(_, size, given)| Some((*given)? / size));
    let noise = |(kind, size, given): (Kind, f64, Option<f64>)| Noise {
        kind,
        given,
        size,
        unit: given.unwrap_or(size * relative.unwrap_or(1.0)),
        left: 0.0,
        freedom: 1.0,
        parts: Vec::new(),
    };
    kinds.into_iter().map(noise).collect()
}

/// One over the unit of every measured number.
fn weights(scan: &Scan, noises: &[Noise]) -> Vec<f64> {
    let one = |quantity| {
        let noise = noises.iter().find(|n| n.kind == Kind::of(quantity));
        noise.map_or(1.0, |noise| 1.0 / noise.unit)
    };
    let row: Vec<f64> = scan.quantities.iter().map(one).collect();
    row.repeat(scan.rows())
}

impl NoisyFit {
    pub(super) fn of(&self, kind: Kind) -> Option<&Noise> {
        self.noises.iter().find(|noise| noise.kind == kind)
    }

    /// Whether a noise is given: what is left is then held against it.
    pub(super) fn given(&self) -> bool {
        self.noises.iter().any(|noise| noise.given.is_some())
    }

    /// The weights of the last fit.
    pub(super) fn weights(&self, scan: &Scan) -> Vec<f64> {
        weights(scan, &self.noises)
    }

    /// The estimate of a noise that is not given.
    pub(super) fn estimated(&self, noise: &Noise) -> Option<f64> {
        let of_unit = || self.squared(noise).sqrt();
        noise.given.is_none().then(|| noise.unit * of_unit())
    }

    /// Squares left over the degrees of freedom, of the kinds whose noise is given; 1 where noise is all that
    /// is left.
    pub(super) fn reduced_chi_square(&self) -> Option<f64> {
        self.given()
            .then(|| mean_square(self.noises.iter().filter(|noise| noise.given.is_some())))
    }

    /// The standard error of a parameter, in its unit; `None` where it is not determined.
    pub(super) fn error(&self, parameter: usize) -> Option<f64> {
        let unit_error = self.fit.linear.unit_errors[parameter]?;
        let terms = self.noises.iter();
        let terms = terms.map(|noise| noise.parts[parameter] * self.squared(noise));
        Some(unit_error * self.fit.steps[parameter] * terms.sum::<f64>().sqrt())
    }

    /// The noise squared, in units of the fit's. Stated noise is believed unless more is left.
    fn squared(&self, noise: &Noise) -> f64 {
        match noise.given {
            Some(_) => noise.reduced_chi_square().unwrap_or(1.0).max(1.0),
            None if self.shared && self.given() => mean_square(&self.noises).max(1.0),
            None if self.shared => mean_square(&self.noises),
            None => noise.chi_square(),
        }
    }

    /// That a noise follows from the other kind's.
    pub(super) fn warning(&self) -> Option<String> {
        self.shared.then(|| {
            let few = self.noises.iter().filter(|noise| noise.given.is_none());
            let few = few.min_by(|a, b| a.freedom.total_cmp(&b.freedom))?;
            let (values, option) = few.kind.words();
            Some(format!(
                "the scan has too few {values} values to estimate their noise: it is taken as the \
                 same part of the measured values for field and gradient; state it with {option}"
            ))
        })?
    }

    /// Whether a kind whose noise must be estimated has too few values for that.
    fn too_few(&self) -> bool {
        let few = |noise: &Noise| noise.given.is_none() && noise.freedom < SPARE as f64;
        self.noises.len() > 1 && self.noises.iter().any(few)
    }

    /// The units that follow from what the last fit leaves.
    fn next_units(&self) -> Vec<f64> {
        let noises = self.noises.iter();
        let found = noises.map(|noise| noise.given.or(self.estimated(noise)).unwrap_or(0.0));
        let parts: Vec<f64> = found.zip(&self.noises).map(|(n, of)| n / of.size).collect();
        let least = ROUNDING.max(LOWEST * parts.iter().copied().fold(0.0, f64::max));
        let unit =
            |(noise, part): (&Noise, &f64)| noise.given.unwrap_or(noise.size * part.max(least));
        self.noises.iter().zip(&parts).map(unit).collect()
    }

    /// Whether other units would weigh alike: a factor common to all changes nothing.
    fn settled(&self, units: &[f64]) -> bool {
        let changes = units.iter().zip(&self.noises);
        let changes = changes.map(|(unit, noise)| (unit / noise.unit).ln());
        let (low, high) = changes.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), c| {
            (low.min(c), high.max(c))
        });
        high - low <= SETTLED
    }

    /// What the fit leaves of every kind, and how much of the fit each kind carries.
    fn measure(&mut self, scan: &Scan) {
        let residuals: Vec<f64> = scan
            .values
            .iter()
            .zip(&self.fit.fitted)
            .map(|(m, g)| m - g)
            .collect();
        let carried = carried(scan, &self.fit, &self.noises);
        for (noise, (rank, parts)) in self.noises.iter_mut().zip(carried) {
            let (mut count, mut left, weight) = (0_usize, 0.0, 1.0 / noise.unit);
            for (_, residual) in of_kind(scan, &residuals, noise.kind) {
                count += 1;
                left += (residual * weight).powi(2);
            }
            noise.left = left;
            noise.freedom = (count as f64 - rank).max(0.0);
            noise.parts = parts;
        }
    }
}

/// Squares left over the degrees of freedom of several kinds.
fn mean_square<'a>(noises: impl IntoIterator<Item = &'a Noise>) -> f64 {
    let (left, freedom) = noises
        .into_iter()
        .fold((0.0, 0.0), |(left, freedom), noise| {
            (left + noise.left, freedom + noise.freedom)
        });
    left / freedom.max(1.0)
}

/// For each kind: its share of the fitted directions, and of the variance of each parameter.
///
/// The row of A+ that gives parameter j is r_j / |r_j|^2, with r_j what the other columns leave of column j.
fn carried(scan: &Scan, fit: &Fit, noises: &[Noise]) -> Vec<(f64, Vec<f64>)> {
    let (rank, columns) = (fit.linear.rank as f64, &fit.columns);
    if noises.len() == 1 {
        return vec![(rank, vec![1.0; columns.len()])];
    }
    let of_column = |(j, error): (usize, &Option<f64>)| {
        let rest = error.map_or_else(Vec::new, |_| rest(columns, j));
        let square = dot(&rest, &rest);
        let shares = |noise: &Noise| {
            let at = of_kind(scan, &rest, noise.kind);
            let (direction, part) = at.fold((0.0, 0.0), |(direction, part), (at, r)| {
                (direction + r * columns[j][at], part + r * r)
            });
            [direction, part].map(|sum| if square > 0.0 { sum / square } else { 0.0 })
        };
        noises.iter().map(shares).collect::<Vec<_>>()
    };
    let errors = fit.linear.unit_errors.par_iter();
    let shares: Vec<Vec<[f64; 2]>> = errors.enumerate().map(of_column).collect();
    // Directions of which only some combinations are determined are shared as the others are.
    let all = shares.iter().flatten().map(|[direction, _]| direction);
    let all = all.sum::<f64>().max(f64::MIN_POSITIVE);
    let total = |kind: usize| {
        let directions: f64 = shares.iter().map(|of| of[kind][0]).sum();
        let parts = shares.iter().map(|of| of[kind][1]).collect();
        (rank * directions / all, parts)
    };
    (0..noises.len()).map(total).collect()
}

/// What the other columns leave of column `j`.
fn rest(columns: &[Vec<f64>], j: usize) -> Vec<f64> {
    let others = [&columns[..j], &columns[j + 1..]].concat();
    let solution = least_squares::solve(&others, &columns[j]);
    let mut rest = columns[j].clone();
    for (column, value) in others.iter().zip(&solution.values) {
        let pairs = rest.iter_mut().zip(column);
        pairs.for_each(|(rest, entry)| *rest -= value * entry);
    }
    rest
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
