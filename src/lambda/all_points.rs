//! The felt errors at all points of an object, where nothing is uncertain.

use super::feedback::FeedbackError;
use super::vector_feedback::{CurrentsOf, QuarterErrors, VectorProblem, quarter_errors};

/// All points of an object, where nothing is uncertain.
#[derive(Debug, Clone, Copy)]
pub struct AllPoints<'a> {
    vectors: VectorProblem<'a>,
    /// The quarter of every point.
    quarters: &'a [usize],
    /// The force constant, N/m.
    pub lambda_n_per_m: f64,
    pub(crate) static_a: &'a [f64],
    /// The errors of the static currents.
    pub fixed: QuarterErrors,
    /// The errors with feedback.
    pub feedback: QuarterErrors,
}

impl<'a> AllPoints<'a> {
    /// Computes the errors; those of feedback with currents for the vector, or for its upward part alone.
    ///
    /// # Errors
    /// Where the problem is malformed.
    ///
    /// # Panics
    /// When directions, sideways forces, quarters or currents are fewer than the problem's.
    pub fn new(
        vectors: VectorProblem<'a>,
        quarters: &'a [usize],
        (lambda_n_per_m, static_a): (f64, &'a [f64]),
        vector: bool,
    ) -> Result<Self, FeedbackError> {
        let of = |currents| quarter_errors(&vectors, quarters, lambda_n_per_m, currents);
        Ok(Self {
            fixed: of(CurrentsOf::Static(static_a))?,
            feedback: of(if vector {
                CurrentsOf::Vector
            } else {
                CurrentsOf::Upward
            })?,
            vectors,
            quarters,
            lambda_n_per_m,
            static_a,
        })
    }

    /// The errors of other static currents.
    pub(crate) fn of_static(&self, currents_a: &[f64]) -> Result<QuarterErrors, FeedbackError> {
        let of = CurrentsOf::Static(currents_a);
        quarter_errors(&self.vectors, self.quarters, self.lambda_n_per_m, of)
    }

    /// The largest force that is requested anywhere, N.
    pub(crate) fn most_requested_n(&self) -> f64 {
        let heights = self.vectors.upward.height_m.iter();
        let square = |(direction, height_m): (&[f64; 3], &f64)| {
            let request = direction.map(|part| self.lambda_n_per_m * height_m * part);
            request.iter().map(|part| part * part).sum::<f64>()
        };
        let squares = self.vectors.direction.iter().zip(heights).map(square);
        squares.fold(0.0, f64::max).sqrt()
    }
}
