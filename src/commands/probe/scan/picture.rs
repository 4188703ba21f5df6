//! A scan beside what was computed, as a drawing.

use super::{ScanReport, field, gradient};
use crate::bundle::scan::{Measured, Scan};
use crate::plot::scan_fit::{ScanColumn, ScanFitPlot, ScanKind};

impl ScanReport {
    /// Measured values over computed ones, and the residuals beside the stated noise; where it is not
    /// stated, beside their own size after the fit.
    #[must_use]
    pub fn picture(&self, scan: &Scan, name: &str) -> ScanFitPlot {
        let left = &self.file.residuals.fitted;
        let of_field = left.field.as_ref().map(|left| (left.noise_t, left.rms_t));
        let of_gradient = left
            .gradient
            .as_ref()
            .map(|left| (left.noise_t_per_m, left.rms_t_per_m));
        let kind = |quantity, of: fn(&Measured) -> bool, left: Option<(Option<f64>, f64)>| {
            let (noise, rms) = left?;
            Some(ScanKind {
                quantity,
                columns: self.columns(scan, of),
                sigma: match noise {
                    Some(noise) => (noise, "the stated noise"),
                    None => (rms, "what the fit leaves (rms)"),
                },
            })
        };
        let kinds = [
            kind(["field", "T"], field, of_field),
            kind(["gradient", "T/m"], gradient, of_gradient),
        ];
        ScanFitPlot {
            title: format!("{name} against {}", self.file.design),
            kinds: kinds.into_iter().flatten().collect(),
        }
    }

    fn columns(&self, scan: &Scan, of: fn(&Measured) -> bool) -> Vec<ScanColumn> {
        let count = scan.quantities.len();
        let quantities = scan
            .quantities
            .iter()
            .enumerate()
            .filter(|(_, quantity)| of(quantity));
        let column = |(at, quantity): (usize, &Measured)| ScanColumn {
            name: quantity.column(),
            values: [&scan.values, &self.predicted, &self.fitted]
                .map(|values| values.iter().skip(at).step_by(count).copied().collect()),
        };
        quantities.map(column).collect()
    }
}
