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
