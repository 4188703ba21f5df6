//! A scan beside what was computed, as a drawing.

use super::{Kind, ScanReport};
use crate::bundle::scan::{Measured, Scan};
use crate::plot::scan_fit::{ScanColumn, ScanFitPlot, ScanKind};

impl ScanReport {
    /// Measured values over computed ones, and the residuals beside the stated noise; where it is not
    /// stated, beside the estimated one.
    #[must_use]
    pub fn picture(&self, scan: &Scan, name: &str) -> ScanFitPlot {
        let left = &self.file.residuals.fitted;
        let field = left.field.as_ref();
        let field = field.map(|left| (left.noise_t, left.estimated_noise_t));
        let gradient = left.gradient.as_ref();
        let gradient = gradient.map(|left| (left.noise_t_per_m, left.estimated_noise_t_per_m));
        let kind = |quantity, kind: Kind, noise: Option<(Option<f64>, Option<f64>)>| {
            let (stated, estimated) = noise?;
            let stated = stated.map(|noise| (noise, "the stated noise"));
            let estimated = estimated.map(|noise| (noise, "the estimated noise"));
            Some(ScanKind {
                quantity,
                columns: self.columns(scan, kind),
                sigma: stated.or(estimated)?,
            })
        };
        let kinds = [
            kind(["field", "T"], Kind::Field, field),
            kind(["gradient", "T/m"], Kind::Gradient, gradient),
        ];
        ScanFitPlot {
            title: format!("{name} against {}", self.file.design),
            kinds: kinds.into_iter().flatten().collect(),
        }
    }

    fn columns(&self, scan: &Scan, kind: Kind) -> Vec<ScanColumn> {
        let count = scan.quantities.len();
        let quantities = scan
            .quantities
            .iter()
            .enumerate()
            .filter(|(_, quantity)| Kind::of(quantity) == kind);
        let column = |(at, quantity): (usize, &Measured)| ScanColumn {
            name: quantity.column(),
            values: [&scan.values, &self.predicted, &self.fitted]
                .map(|values| values.iter().skip(at).step_by(count).copied().collect()),
        };
        quantities.map(column).collect()
    }
}
