//! The error of the finest of three solutions, each finer than the one before.
//!
//! Let e_1, e_2, e_3 be the errors from coarse to fine; their differences d_12 and d_23 are known.
//! Where they fall by a factor q from one to the next, e_3 = q / (1 - q) d_23 at most: the last
//! difference covers it for q up to 1/2 and twice that for q up to 2/3. Where kinks cross the
//! elements the errors do not fall: each is about as large as the one before and of either sign.
//! Two such solutions agree by chance as often as not, and the last difference alone says nothing;
//! that the difference before is small too is hardly ever chance, and half of it counts.

/// Times the larger of both differences the error is stated, and how much the former counts.
/// `cargo test --test field steel -- --ignored --nocapture along_curves_in_full` prints how the
/// statement compares with far finer solutions along magnetisation curves.
const SAFETY: f64 = 2.0;
const BEFORE: f64 = 0.5;

/// Error of the finest of three solutions: `last` is its difference from the second, `before`
/// that of the second from the coarsest; all in one unit, none negative. NaN if either is.
#[must_use]
pub fn error_of_finest(last: f64, before: f64) -> f64 {
    let weighted = BEFORE * before;
    // `max` would drop a NaN.
    let larger = if last >= weighted || last.is_nan() {
        last
    } else {
        weighted
    };
    SAFETY * larger
}
