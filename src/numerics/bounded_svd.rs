//! Singular values with a bound on the iterations.
//!
//! Golub and Reinsch's iteration takes two or three steps a singular value, and has no proof that it ends;
//! LAPACK gives up after a stated number as well.

use nalgebra::{DMatrix, Dyn, SVD};

/// Steps a singular value after which the iteration is given up.
const MOST_STEPS: usize = 30;
/// What counts as zero beside its neighbours, in units of the last place.
const ZERO: f64 = 5.0 * f64::EPSILON;

/// The singular values of `matrix`, falling, with left and right vectors as requested; `None` where the
/// iteration does not end within 30 steps a value.
#[must_use]
pub fn svd(matrix: DMatrix<f64>, [left, right]: [bool; 2]) -> Option<SVD<f64, Dyn, Dyn>> {
    let most = MOST_STEPS * matrix.nrows().min(matrix.ncols()).max(1);
    matrix.try_svd(left, right, ZERO, most)
}
