//! The differences drawn: how large for every two objects, and where.

use super::difference::{Felt, stronger};
use super::{CompareReport, Object, Pair, RenderedForces};
use crate::plot::matrix::{MatrixPlot, Panel};
use crate::plot::slices::{Shades, Slice, SlicesPlot};

/// A way to drive the coils, and the forces that it gives.
type Drive = (&'static str, fn(&RenderedForces) -> &[Felt]);

const DRIVES: [Drive; 2] = [
    ("static currents", |forces| &forces.fixed),
    ("position feedback", |forces| &forces.feedback),
];

/// How much stronger the first of every two objects is, over the plan of either; none where one of them
/// has no force constant.
pub(super) fn maps(objects: &[Object], fields: &[Vec<RenderedForces>], jnd: f64) -> Vec<Slice> {
    let mut maps = Vec::new();
    for (i, a) in objects.iter().enumerate() {
        for (j, b) in objects.iter().enumerate().skip(i + 1) {
            if a.rendered.is_none() || b.rendered.is_none() {
                continue;
            }
            for (on, surface) in [(a, i), (b, j)] {
                for (drive, felt) in DRIVES {
                    let [of_a, of_b] = [i, j].map(|object| felt(&fields[surface][object]));
                    let points = &on.points.discretized.points;
                    let mut values = vec![None; points.grid.len()];
                    for (row, &place) in points.grid_index.iter().enumerate() {
                        values[place] = Some(stronger(of_a[row], of_b[row], jnd));
                    }
                    maps.push(Slice {
                        title: [
                            format!("{} over {}", a.name(), b.name()),
                            format!("on {}, {drive}", on.name()),
                        ],
                        unit: Slice::JND,
                        axes: ["x", "y"],
                        ends_m: points.grid.plan(),
                        columns: points.grid.x_m.samples,
                        values,
                        shades: Shades::Signed,
                        lines: Vec::new(),
                    });
                }
            }
        }
    }
    maps
}

impl CompareReport {
    /// Where every two objects differ, a row a surface: static currents beside position feedback.
    #[must_use]
    pub fn map(&self) -> SlicesPlot {
        SlicesPlot {
            title: format!(
                "{}: how much stronger the first object is felt, in just-noticeable differences",
                self.design
            ),
            slices: self.maps.clone(),
            columns: DRIVES.len(),
            curves_title: String::new(),
            curves: Vec::new(),
        }
    }

    /// The differences as matrices: largest and rms, static beside feedback.
    #[must_use]
    pub fn picture(&self) -> MatrixPlot {
        let names: Vec<String> = self.shapes.iter().map(|s| s.shape.clone()).collect();
        let panel = |title: &str, pick: fn(&Pair) -> Option<f64>| {
            let mut values = vec![Some(0.0); names.len() * names.len()];
            let at = |name: &str| names.iter().position(|n| n == name);
            for pair in &self.pairs {
                if let (Some(i), Some(j)) = (at(&pair.a), at(&pair.b)) {
                    values[i * names.len() + j] = pick(pair);
                    values[j * names.len() + i] = pick(pair);
                }
            }
            Panel {
                title: title.to_owned(),
                values,
            }
        };
        let panels = vec![
            panel("largest, static currents", |p| p.static_jnd),
            panel("largest, position feedback", |p| p.feedback_jnd),
            panel("rms, static currents", |p| p.static_rms_jnd),
            panel("rms, position feedback", |p| p.feedback_rms_jnd),
        ];
        MatrixPlot {
            title: format!("{}: just-noticeable differences of force", self.design),
            panels,
            columns: 2,
            names,
        }
    }
}
