//! Strictly convex quadratic programmes of some dozen variables: the dual active-set method
//! (Goldfarb and Idnani, Mathematical Programming 27, 1983).
//!
//! minimise 1/2 d'Bd + g'd with a_j'd <= b_j, B positive definite. The method starts from the free
//! minimum and adds the row that is broken most, so it needs no feasible start, and it ends after
//! finitely many sets of rows. Every step solves its small systems again: no error builds up.

use nalgebra::{DMatrix, DVector};

/// The minimiser and the multiplier of every row, 0 or more.
#[derive(Debug, Clone, PartialEq)]
pub struct Minimum {
    /// d.
    pub step: DVector<f64>,
    /// One a row.
    pub multipliers: Vec<f64>,
}

/// Excess of a row, relative to its size and that of the step, that counts as none.
const SLACK: f64 = 1e-11;
/// Part of a direction that is left after projection and counts as none.
const DEPENDENT: f64 = 1e-13;
/// Sets of rows that are tried, per row.
const TURNS: usize = 12;

/// The minimiser under `rows * d <= limits`; `None` where the rows contradict each other or `b` is not
/// positive definite.
#[must_use]
pub fn minimise(
    b: &DMatrix<f64>,
    g: &DVector<f64>,
    rows: &DMatrix<f64>,
    limits: &DVector<f64>,
) -> Option<Minimum> {
    let factor = b.clone().cholesky()?;
    let mut step = factor.solve(&-g);
    // B^-1 A', a column a row.
    let columns = factor.solve(&rows.transpose());
    let mut active: Vec<usize> = Vec::new();
    let mut multipliers = vec![0.0; rows.nrows()];
    for _ in 0..TURNS * (rows.nrows() + rows.ncols()) {
        let Some(broken) = most_broken(rows, limits, &step, &active) else {
            return Some(Minimum { step, multipliers });
        };
        loop {
            let normal = rows.row(broken).transpose();
            let (direction, change) = projected(rows, &columns, &active, broken)?;
            // How far until a multiplier is used up, and until the row is met.
            let blocking = active
                .iter()
                .zip(change.iter())
                .filter(|(_, c)| **c > 0.0)
                .map(|(row, c)| (multipliers[*row] / c, *row))
                .min_by(|a, b| a.0.total_cmp(&b.0));
            let slope = direction.dot(&normal);
            let whole = columns.column(broken).dot(&normal);
            let excess = normal.dot(&step) - limits[broken];
            let full = if slope > DEPENDENT * whole {
                excess.max(0.0) / slope
            } else {
                f64::INFINITY
            };
            let length = full.min(blocking.map_or(f64::INFINITY, |(length, _)| length));
            if length.is_infinite() {
                return None;
            }
            if full.is_finite() {
                step -= length * &direction;
            }
            for (row, c) in active.iter().zip(change.iter()) {
                multipliers[*row] = (multipliers[*row] - length * c).max(0.0);
            }
            multipliers[broken] += length;
            match blocking {
                Some((until, row)) if until < full => {
                    multipliers[row] = 0.0;
                    active.retain(|other| *other != row);
                }
                _ => {
                    active.push(broken);
                    break;
                }
            }
        }
    }
    None
}

fn most_broken(
    rows: &DMatrix<f64>,
    limits: &DVector<f64>,
    step: &DVector<f64>,
    active: &[usize],
) -> Option<usize> {
    let excess = |row: usize| {
        let normal = rows.row(row);
        let scale = normal.norm() * (1.0 + step.norm()) + limits[row].abs();
        ((normal * step)[0] - limits[row]) / scale.max(f64::MIN_POSITIVE)
    };
    (0..rows.nrows())
        .filter(|row| !active.contains(row))
        .map(|row| (excess(row), row))
        .filter(|(excess, _)| *excess > SLACK)
        .max_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1)))
        .map(|(_, row)| row)
}

/// B^-1 of the row's normal less what the active rows take of it, and by how much each of their
/// multipliers falls meanwhile.
fn projected(
    rows: &DMatrix<f64>,
    columns: &DMatrix<f64>,
    active: &[usize],
    broken: usize,
) -> Option<(DVector<f64>, DVector<f64>)> {
    let own = columns.column(broken).into_owned();
    if active.is_empty() {
        return Some((own, DVector::zeros(0)));
    }
    let count = active.len();
    let gram = DMatrix::from_fn(count, count, |i, j| {
        (rows.row(active[i]) * columns.column(active[j]))[0]
    });
    let right = DVector::from_fn(count, |i, _| (rows.row(active[i]) * &own)[0]);
    let change = gram.lu().solve(&right)?;
    let mut direction = own;
    for (row, c) in active.iter().zip(change.iter()) {
        direction -= *c * columns.column(*row);
    }
    Some((direction, change))
}
