//! From values at the Gauss nodes of panels to values at an interior mesh's boundary, and back.
//!
//! A boundary-integral solver keeps a density at the Gauss nodes of panels, one polynomial a
//! panel and not continuous from one to the next; the interior's trace is continuous, through
//! Gauss-Lobatto nodes. Panels are the elements' edges along the generatrix. To the interior the
//! panel's polynomial is evaluated at the Lobatto nodes, and at a joint the mean of both sides is
//! taken; back, the trace is evaluated at the Gauss nodes. Constants are kept both ways.

use nalgebra::{DMatrix, DVector};

use super::lobatto;
use fluxform_numerics::gauss;

/// The maps for panels of `order` Gauss nodes and edges of one degree.
#[derive(Debug)]
pub struct Trace {
    panels: usize,
    order: usize,
    degree: usize,
    to_lobatto: DMatrix<f64>,
    to_gauss: DMatrix<f64>,
}

impl Trace {
    /// Maps for `panels` panels; 1 <= `order` <= [`gauss::MAX_ORDER`] nodes a panel, edges of
    /// `degree` >= 1. Exact both ways for polynomials of degree below `order` and at most
    /// `degree`.
    #[must_use]
    pub fn new(panels: usize, order: usize, degree: usize) -> Self {
        let (gauss, lobatto) = (&gauss::rule(order).nodes, lobatto::nodes(degree));
        Self {
            panels,
            order,
            degree,
            to_lobatto: lobatto::values(gauss, &lobatto),
            to_gauss: lobatto::values(&lobatto, gauss),
        }
    }

    /// Number of Gauss nodes.
    #[must_use]
    pub(crate) fn gauss_count(&self) -> usize {
        self.panels * self.order
    }

    /// Values along the boundary from values at the Gauss nodes.
    #[must_use]
    pub(crate) fn to_boundary(&self, gauss: &DVector<f64>) -> DVector<f64> {
        let columns = self.rows_to_boundary(&DMatrix::from_column_slice(
            gauss.len(),
            1,
            gauss.as_slice(),
        ));
        columns.column(0).into_owned()
    }

    /// Values at the Gauss nodes from values along the boundary.
    #[must_use]
    pub(crate) fn to_gauss(&self, boundary: &DVector<f64>) -> DVector<f64> {
        let mut gauss = DVector::zeros(self.gauss_count());
        for panel in 0..self.panels {
            gauss.rows_mut(panel * self.order, self.order).gemv(
                1.0,
                &self.to_gauss,
                &boundary.rows(panel * self.degree, self.degree + 1),
                0.0,
            );
        }
        gauss
    }

    /// An operator on values at the Gauss nodes as one on values along the boundary.
    #[must_use]
    pub(crate) fn operator_on_boundary(&self, on_gauss: &DMatrix<f64>) -> DMatrix<f64> {
        let rows = self.rows_to_boundary(on_gauss);
        let mut operator = DMatrix::zeros(rows.nrows(), rows.nrows());
        for panel in 0..self.panels {
            operator
                .columns_mut(panel * self.degree, self.degree + 1)
                .gemm(
                    1.0,
                    &rows.columns(panel * self.order, self.order),
                    &self.to_gauss,
                    1.0,
                );
        }
        operator
    }

    fn rows_to_boundary(&self, gauss: &DMatrix<f64>) -> DMatrix<f64> {
        let mut boundary = DMatrix::zeros(self.panels * self.degree + 1, gauss.ncols());
        for panel in 0..self.panels {
            boundary
                .rows_mut(panel * self.degree, self.degree + 1)
                .gemm(
                    1.0,
                    &self.to_lobatto,
                    &gauss.rows(panel * self.order, self.order),
                    1.0,
                );
        }
        for joint in 1..self.panels {
            boundary.row_mut(joint * self.degree).scale_mut(0.5);
        }
        boundary
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A continuous function, smooth on each of the panels [k, k + 1].
    fn kinked(s: f64) -> f64 {
        0.7 * s + (s - s.floor()) * (1.0 - (s - s.floor())) * (1.3 + s.floor())
    }

    #[test]
    fn piecewise_polynomials_go_there_and_back() {
        for (order, degree) in [(5, 4), (6, 9), (7, 5)] {
            let trace = Trace::new(3, order, degree);
            let on = |nodes: &[f64], end: f64| -> Vec<f64> {
                (0..3)
                    .flat_map(|panel| {
                        nodes
                            .iter()
                            .map(move |&x| f64::from(panel) + 0.5 * (1.0 + x))
                    })
                    .chain([end])
                    .map(kinked)
                    .collect()
            };
            let gauss = on(&gauss::rule(order).nodes, 3.0);
            let gauss = DVector::from_column_slice(&gauss[..3 * order]);
            let boundary = DVector::from_vec(on(&lobatto::nodes(degree)[..degree], 3.0));
            assert!((trace.to_boundary(&gauss) - &boundary).amax() < 1e-13);
            assert!((trace.to_gauss(&boundary) - &gauss).amax() < 1e-13);
            // The operator of multiplication by 1.3 keeps that.
            let operator = DMatrix::identity(3 * order, 3 * order) * 1.3;
            let image = trace.operator_on_boundary(&operator) * &boundary;
            assert!((image - boundary * 1.3).amax() < 1e-13);
        }
    }
}
