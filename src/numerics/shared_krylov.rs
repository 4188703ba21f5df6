//! Linear systems with several right-hand sides that share what is learnt of the operator.

use nalgebra::DMatrix;

/// Result of [`SharedSpace::solve`].
#[derive(Debug, Clone)]
pub struct Outcome {
    /// Solutions, one column a right-hand side.
    pub solutions: DMatrix<f64>,
    /// Largest norm of a residual relative to its right-hand side, by the recurrence.
    pub relative_residual: f64,
    /// Applications of the operator.
    pub iterations: usize,
}

/// Singular values of directions, relative to the largest, below which they are one that is known.
const DEPENDENT: f64 = 1e-6;

/// Directions whose images under one operator are orthonormal: they serve every right-hand side.
#[derive(Debug, Default)]
pub struct SharedSpace {
    /// Directions and their images.
    blocks: Vec<[DMatrix<f64>; 2]>,
}

impl SharedSpace {
    /// Solves A x = b for every column of `rhs`, `apply` being X -> A X, of one A at every call, until every
    /// residual is below `tolerance` relative to its right-hand side or `most` applications are spent.
    ///
    /// Block generalised conjugate residuals: the least residuals over a space that the residuals of all
    /// columns extend together, so that many columns need fewer applications than one. Eisenstat, Elman and
    /// Schultz, SIAM J. Numer. Anal. 20, 345 (1983); dependent directions are dropped as by Stathopoulos and
    /// Wu, SIAM J. Sci. Comput. 23, 2165 (2002).
    pub fn solve(
        &mut self,
        rhs: &DMatrix<f64>,
        tolerance: f64,
        most: usize,
        mut apply: impl FnMut(&DMatrix<f64>) -> DMatrix<f64>,
    ) -> Outcome {
        let norms: Vec<f64> = rhs.column_iter().map(|c| c.norm()).collect();
        let mut residuals = rhs.clone();
        for (mut column, norm) in residuals.column_iter_mut().zip(&norms) {
            if *norm > 0.0 {
                column.unscale_mut(*norm);
            }
        }
        let mut solutions = DMatrix::zeros(rhs.nrows(), rhs.ncols());
        for block in &self.blocks {
            lessen(block, &mut solutions, &mut residuals);
        }
        let mut iterations = 0;
        let relative_residual = loop {
            fluxform_base::progress::poll();
            let sizes: Vec<f64> = residuals.column_iter().map(|c| c.norm()).collect();
            let largest = sizes.iter().copied().fold(0.0, f64::max);
            let open: Vec<usize> = (0..sizes.len()).filter(|k| sizes[*k] > tolerance).collect();
            if open.is_empty() || iterations == most {
                break largest;
            }
            let mut directions = residuals.select_columns(&open);
            for (mut column, place) in directions.column_iter_mut().zip(&open) {
                column.unscale_mut(sizes[*place]);
            }
            let mut images = apply(&directions);
            iterations += 1;
            // Twice is enough.
            for _ in 0..2 {
                if images.is_empty() {
                    break;
                }
                for [known, known_images] in &self.blocks {
                    let shares = transposed_product(known_images, &images);
                    images.gemm(-1.0, known_images, &shares, 1.0);
                    directions.gemm(-1.0, known, &shares, 1.0);
                }
                (directions, images) = orthonormal(&directions, &images);
            }
            if images.is_empty() {
                break largest;
            }
            let block = [directions, images];
            lessen(&block, &mut solutions, &mut residuals);
            self.blocks.push(block);
        };
        for (mut column, norm) in solutions.column_iter_mut().zip(&norms) {
            column.scale_mut(*norm);
        }
        Outcome {
            solutions,
            relative_residual,
            iterations,
        }
    }
}

/// The least residuals over a block's directions.
fn lessen(
    [directions, images]: &[DMatrix<f64>; 2],
    solutions: &mut DMatrix<f64>,
    residuals: &mut DMatrix<f64>,
) {
    let shares = transposed_product(images, residuals);
    solutions.gemm(1.0, directions, &shares, 1.0);
    residuals.gemm(-1.0, images, &shares, 1.0);
}

/// a' b, by the fast product: nalgebra's own of a transpose is one of dots.
fn transposed_product(a: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
    a.transpose() * b
}

/// Combinations of `images` that are orthonormal, but for those that depend on others, and the same of
/// `directions`.
fn orthonormal(directions: &DMatrix<f64>, images: &DMatrix<f64>) -> (DMatrix<f64>, DMatrix<f64>) {
    let mut products = transposed_product(images, images);
    let scales: Vec<f64> = (0..products.nrows())
        .map(|k| products[(k, k)].sqrt())
        .map(|norm| if norm > 0.0 { norm.recip() } else { 0.0 })
        .collect();
    for (k, scale) in scales.iter().enumerate() {
        products.row_mut(k).scale_mut(*scale);
        products.column_mut(k).scale_mut(*scale);
    }
    let eigen = products.symmetric_eigen();
    let least = DEPENDENT * DEPENDENT * eigen.eigenvalues.max();
    let kept: Vec<usize> = (0..scales.len())
        .filter(|k| eigen.eigenvalues[*k] > least)
        .collect();
    let mut to = eigen.eigenvectors.select_columns(&kept);
    for (mut column, k) in to.column_iter_mut().zip(&kept) {
        column.unscale_mut(eigen.eigenvalues[*k].sqrt());
    }
    for (mut row, scale) in to.row_iter_mut().zip(&scales) {
        row.scale_mut(*scale);
    }
    (directions * &to, images * &to)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Eigenvalues 1 + 0.82 cos: plain iteration gains 0.82 a step.
    fn stalling(n: usize) -> DMatrix<f64> {
        DMatrix::from_fn(n, n, |i, j| {
            let ring = if (i + 1) % n == j || (j + 1) % n == i {
                0.41
            } else {
                0.0
            };
            let skew = if i > j { 0.003 } else { -0.002 };
            f64::from(u8::from(i == j)) + ring + skew
        })
    }

    #[test]
    fn solves_several_columns_of_a_contraction_that_stalls() {
        let matrix = stalling(40);
        let rhs = DMatrix::from_fn(40, 3, |i, j| ((i * i + 3 * j) as f64 * 0.37).sin());
        let mut space = SharedSpace::default();
        let outcome = space.solve(&rhs, 1e-12, 60, |x| &matrix * x);
        assert!(outcome.relative_residual <= 1e-12);
        let fault = &matrix * &outcome.solutions - &rhs;
        assert!(fault.norm() < 1e-11 * rhs.norm(), "{}", fault.norm());
        // Its combinations are in the space.
        let again = space.solve(&rhs.columns(0, 2).into_owned(), 1e-10, 60, |x| &matrix * x);
        assert_eq!(again.iterations, 0);
        assert!((again.solutions.column(1) - outcome.solutions.column(1)).amax() < 1e-9);
    }

    #[test]
    fn many_columns_need_fewer_applications_than_one() {
        let matrix = stalling(200);
        let rhs = DMatrix::from_fn(200, 24, |i, j| f64::from(u8::from(i == 8 * j)));
        let steps = |columns: usize| {
            let rhs = rhs.columns(0, columns).into_owned();
            let outcome = SharedSpace::default().solve(&rhs, 1e-8, 100, |x| &matrix * x);
            let fault = &matrix * &outcome.solutions - &rhs;
            assert!(fault.amax() < 1e-8, "{}", fault.amax());
            outcome.iterations
        };
        assert!(2 * steps(24) < steps(1), "{} {}", steps(24), steps(1));
    }

    #[test]
    fn zero_and_equal_columns_are_solved() {
        let mut rhs = DMatrix::from_element(5, 3, 0.7);
        rhs.column_mut(1).fill(0.0);
        let outcome = SharedSpace::default().solve(&rhs, 1e-14, 10, |x| x * 1.3);
        assert!((outcome.solutions[(2, 0)] - 0.7 / 1.3).abs() < 1e-15);
        assert!((outcome.solutions[(2, 2)] - 0.7 / 1.3).abs() < 1e-15);
        assert_eq!(outcome.solutions.column(1).norm(), 0.0);
        assert_eq!(outcome.iterations, 1);
    }
}
