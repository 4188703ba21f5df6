//! The best coil among those around it, as a drawing.

use crate::coil::limits::LimitName;
use crate::coil::optimum::BestCoil;
use crate::coil::optimum::landscape::CoilLandscape;
use crate::design::Design;
use crate::plot::landscape::{Landscape, LimitLine, Section, Variable};
use crate::report::limits::words;
use crate::scene::drawing::drawing;

/// The force over outer diameter and length, the limits where they are reached, and the section of the
/// array of best coils, which `design` has.
pub(super) fn picture(around: &CoilLandscape, best: &BestCoil, design: &Design) -> Landscape {
    let variable = |name: &str, values_m: &[f64]| Variable {
        name: name.to_owned(),
        labels: values_m.iter().map(|m| format!("{:.1}", 1e3 * m)).collect(),
    };
    let place = |values_m: &[f64], value_m: f64| {
        let [first, last] = [values_m[0], values_m[values_m.len() - 1]];
        (value_m - first) / (last - first) * (values_m.len() - 1) as f64
    };
    let met = |cell: usize| {
        around
            .limits
            .iter()
            .all(|(_, used)| used[cell] <= 1.0 + 1e-9)
    };
    let limit = |(name, used): &(LimitName, Vec<f64>)| LimitLine {
        name: words(name.key()).0,
        used: used.clone(),
    };
    let at = [
        place(
            &around.outer_diameters_m,
            2.0 * best.window.outer_radius_m(),
        ),
        place(&around.lengths_m, best.window.length_m),
    ];
    Landscape {
        title: format!(
            "{}: coils with a bore of {:.1} mm",
            design.name,
            1e3 * around.inner_diameter_m
        ),
        quantity: ["force on the magnet", "N"],
        across: variable("outer diameter / mm", &around.outer_diameters_m),
        up: Some(variable("length / mm", &around.lengths_m)),
        values: around.forces_n.clone(),
        met: (0..around.forces_n.len()).map(met).collect(),
        limits: around.limits.iter().map(limit).collect(),
        best: Some((at, "best coil".to_owned())),
        section: drawing(design, []).map(|array| Section {
            title: "section of the array with it".to_owned(),
            outlines: array.sections_m(),
        }),
    }
}
