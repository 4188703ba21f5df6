//! GMRES for several right-hand sides that share the operator's applications.

use nalgebra::{DMatrix, DVector};

/// Result of a run of [`gmres`].
#[derive(Debug, Clone)]
pub struct Outcome {
    /// Solutions, one column a right-hand side.
    pub solutions: DMatrix<f64>,
    /// Largest norm of a residual relative to its right-hand side, by the recurrence.
    pub relative_residual: f64,
    /// Applications of the operator.
    pub iterations: usize,
}

/// Solves A x = b for every column of `rhs`, `apply` being X -> A X, until every residual is
/// below `tolerance` relative to its right-hand side or `most` applications are spent.
///
/// Saad and Schultz, SIAM J. Sci. Stat. Comput. 7, 856 (1986), modified Gram-Schmidt, no restart:
/// the basis takes `most` + 1 matrices of the size of `rhs`.
#[must_use]
pub fn gmres(
    rhs: &DMatrix<f64>,
    tolerance: f64,
    most: usize,
    mut apply: impl FnMut(&DMatrix<f64>) -> DMatrix<f64>,
) -> Outcome {
    let columns = rhs.ncols();
    let norms: Vec<f64> = rhs.column_iter().map(|c| c.norm()).collect();
    let mut first = rhs.clone();
    for (mut column, norm) in first.column_iter_mut().zip(&norms) {
        if *norm > 0.0 {
            column /= *norm;
        }
    }
    let mut basis = vec![first];
    let mut triangles: Vec<Triangle> = norms.iter().map(|n| Triangle::new(*n)).collect();
    let mut relative_residual = f64::from(u8::from(norms.iter().any(|n| *n > 0.0)));
    while relative_residual > tolerance && basis.len() <= most {
        let mut next = apply(&basis[basis.len() - 1]);
        for (column, triangle) in triangles.iter_mut().enumerate() {
            fluxform_base::progress::poll();
            let mut entries = Vec::with_capacity(basis.len() + 1);
            for direction in &basis {
                let direction = direction.column(column);
                let entry = direction.dot(&next.column(column));
                next.column_mut(column).axpy(-entry, &direction, 1.0);
                entries.push(entry);
            }
            let norm = next.column(column).norm();
            if norm > 0.0 {
                next.column_mut(column).unscale_mut(norm);
            }
            entries.push(norm);
            triangle.push(entries);
        }
        basis.push(next);
        relative_residual = triangles
            .iter()
            .zip(&norms)
            .map(|(t, n)| if *n > 0.0 { t.residual() / n } else { 0.0 })
            .fold(0.0, f64::max);
    }
    let mut solutions = DMatrix::zeros(rhs.nrows(), columns);
    for (column, triangle) in triangles.iter().enumerate() {
        fluxform_base::progress::poll();
        for (direction, share) in basis.iter().zip(triangle.solve().iter()) {
            solutions
                .column_mut(column)
                .axpy(*share, &direction.column(column), 1.0);
        }
    }
    Outcome {
        solutions,
        relative_residual,
        iterations: basis.len() - 1,
    }
}

/// The Hessenberg matrix of one column, kept triangular by rotations.
struct Triangle {
    columns: Vec<Vec<f64>>,
    rotations: Vec<[f64; 2]>,
    rhs: Vec<f64>,
}

impl Triangle {
    fn new(norm: f64) -> Self {
        Self {
            columns: Vec::new(),
            rotations: Vec::new(),
            rhs: vec![norm],
        }
    }

    fn push(&mut self, mut column: Vec<f64>) {
        for (row, [c, s]) in self.rotations.iter().enumerate() {
            let (a, b) = (column[row], column[row + 1]);
            (column[row], column[row + 1]) = (c * a + s * b, c * b - s * a);
        }
        let last = column.len() - 1;
        let (a, b) = (column[last - 1], column[last]);
        let length = a.hypot(b);
        let [c, s] = if length > 0.0 {
            [a / length, b / length]
        } else {
            [1.0, 0.0]
        };
        column[last - 1] = length;
        column.pop();
        self.rotations.push([c, s]);
        self.columns.push(column);
        let end = self.rhs.len() - 1;
        let value = self.rhs[end];
        self.rhs[end] = c * value;
        self.rhs.push(-s * value);
    }

    fn residual(&self) -> f64 {
        self.rhs.last().map_or(0.0, |r| r.abs())
    }

    fn solve(&self) -> DVector<f64> {
        let count = self.columns.len();
        let mut x = DVector::zeros(count);
        for row in (0..count).rev() {
            let mut value = self.rhs[row];
            for column in row + 1..count {
                value -= self.columns[column][row] * x[column];
            }
            let pivot = self.columns[row][row];
            // A column that was solved exactly adds directions of length zero.
            x[row] = if pivot == 0.0 { 0.0 } else { value / pivot };
        }
        x
    }
}
