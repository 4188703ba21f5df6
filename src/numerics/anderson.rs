//! Anderson's acceleration of a fixed-point iteration x -> g(x).
//!
//! The next iterate is the combination of the last images whose residuals g(x) - x, combined the
//! same way, are smallest (Anderson, J. ACM 12, 547 (1965); Walker and Ni, SIAM J. Numer. Anal.
//! 49, 1715 (2011)). For an affine g it does what GMRES does.

use nalgebra::{DMatrix, DVector};

use super::bounded_svd::svd;

/// Directions whose share of the largest is below this one are left out.
const RANK: f64 = 1e-10;

/// The iterates that are remembered.
#[derive(Debug, Clone)]
pub struct Anderson {
    depth: usize,
    /// Images and residuals, the oldest first.
    history: Vec<(DVector<f64>, DVector<f64>)>,
}

impl Anderson {
    /// Remembers `depth` iterates beside the last; with none it is the plain iteration.
    #[must_use]
    pub fn new(depth: usize) -> Self {
        Self {
            depth,
            history: Vec::new(),
        }
    }

    /// The next iterate after `x`, whose image is `image`.
    ///
    /// # Panics
    /// When vectors differ in length.
    pub fn next(&mut self, x: &DVector<f64>, image: DVector<f64>) -> DVector<f64> {
        let residual = &image - x;
        let columns = self.history.len();
        let mut next = image.clone();
        if columns > 0 {
            let (images, residuals): (Vec<_>, Vec<_>) = self
                .history
                .iter()
                .map(|(g, r)| (&image - g, &residual - r))
                .unzip();
            let images = DMatrix::from_columns(&images);
            let residuals = DMatrix::from_columns(&residuals);
            // Where there are no shares this is a step of the plain iteration.
            let shares = svd(residuals, [true, true]).and_then(|svd| {
                let least = RANK * svd.singular_values.max();
                svd.solve(&residual, least).ok()
            });
            if let Some(shares) = shares {
                next -= images * shares;
            }
        }
        self.history.push((image, residual));
        if self.history.len() > self.depth {
            self.history.remove(0);
        }
        next
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_affine_map_takes_as_many_steps_as_dimensions() {
        // Contracts nowhere: the plain iteration diverges.
        let matrix =
            DMatrix::from_row_slice(3, 3, &[1.7, 0.3, 0.0, -0.2, -1.9, 0.4, 0.1, 0.6, 2.3]);
        let shift = DVector::from_vec(vec![0.7, -1.3, 0.4]);
        let mut anderson = Anderson::new(5);
        let mut x = DVector::zeros(3);
        for _ in 0..5 {
            x = anderson.next(&x, &matrix * &x + &shift);
        }
        assert!((&matrix * &x + &shift - &x).norm() < 1e-9);
    }

    #[test]
    fn a_nonlinear_map_gains_over_the_plain_iteration() {
        let map = |x: &DVector<f64>| DVector::from_vec(vec![(x[1] + 0.3).cos(), 0.9 * x[0].sin()]);
        let error = |depth: usize| {
            let mut anderson = Anderson::new(depth);
            let mut x = DVector::from_vec(vec![0.2, 0.1]);
            for _ in 0..9 {
                x = anderson.next(&x, map(&x));
            }
            (map(&x) - x).norm()
        };
        assert!(error(3) < 1e-6 * error(0), "{} {}", error(3), error(0));
        // At the fixed point nothing is left to combine.
        let mut anderson = Anderson::new(3);
        let x = DVector::zeros(2);
        for _ in 0..4 {
            assert_eq!(anderson.next(&x, x.clone()), x);
        }
    }
}
