//! The facts of a bundle's page that no file of the bundle states: the design's limits on one coil.

use std::collections::BTreeMap;

use super::recorded;
use crate::bundle::lambda_file::LambdaFile;
use crate::bundle::write::BundleContent;
use crate::coil::limits::{self, Evaluated, LimitCheck, LimitName, UsedPower};
use crate::coil::mutual::{largest_self_inductance_h, slowest_inductance_h};
use crate::plot::lambda::LambdaPlot;
use crate::report::data::{CalibratedObject, CoilPlan, DirectionField};
use crate::scene::Scene;
use crate::units::STEEL_DENSITY_KG_PER_M3;

/// The page's input: what the bundle will hold, and what the scene adds. `tolerance` is that of the
/// field.
pub(super) fn object<'a>(
    scene: &Scene,
    content: &'a BundleContent<'a>,
    curves: &'a LambdaPlot,
    directions: Option<DirectionField>,
    warnings: &'a [String],
    tolerance: f64,
) -> CalibratedObject<'a> {
    let (limits, unchecked) = limit_checks(scene, content);
    CalibratedObject {
        lambda: content.lambda,
        manifest: &content.manifest,
        points: content.points,
        map: content.map,
        curves,
        directions,
        array: scene.drawing(),
        section: CoilPlan {
            inner_radius_m: 0.5 * scene.coil.inner_diameter_m,
            outer_radius_m: 0.5 * scene.coil.outer_diameter_m,
            core_radius_m: scene.core.as_ref().map(|core| core.shape.radius_m),
        },
        limits,
        unchecked,
        warnings,
        error_time: recorded::curve(scene, tolerance),
    }
}

/// The design's limits on one coil, and those whose value is not known here.
fn limit_checks(
    scene: &Scene,
    content: &BundleContent,
) -> (BTreeMap<&'static str, LimitCheck>, Vec<&'static str>) {
    let mut circuit = scene.circuit;
    let mut array_inductance_h = circuit.inductance_h;
    if let Some(array) = &content.manifest.circuit {
        circuit.inductance_h = largest_self_inductance_h(&array.inductance_h);
        array_inductance_h = slowest_inductance_h(&array.inductance_h);
    }
    let steel_kg = scene
        .core
        .as_ref()
        .map_or(0.0, |core| core.shape.volume_m3() * STEEL_DENSITY_KG_PER_M3);
    let peak_t = content.lambda.working_point.as_ref();
    let peak_t = peak_t.map(|at| at.peak_field_t.iter().copied().fold(0.0, f64::max));
    let checks = limits::check(&Evaluated {
        design: scene.design,
        circuit: &circuit,
        power_w: circuit.power_w(scene.rated_current_a()),
        mass_kg: circuit.wire_mass_kg + steel_kg,
        core_field_t: peak_t,
        array_inductance_h: Some(array_inductance_h),
        used: used(scene, content.lambda),
    });
    let limited = scene.design.limits.core_field_max_t.is_some() && scene.core.is_some();
    let of_steel =
        (limited && peak_t.is_none()).then_some("core field (`fluxform evaluate` reports it)");
    let of_shapes = limits::of_shapes(&scene.design.limits);
    let unknown = of_shapes.filter(|row| !checks.contains_key(row.key));
    let of_shapes = unknown.map(|row| {
        if row.name == LimitName::FeedbackPower {
            "heat with feedback (`fluxform lambda --feedback` reports it)"
        } else {
            row.label
        }
    });
    let unchecked = of_steel.into_iter().chain(of_shapes);
    let unchecked = unchecked.collect();
    (checks, unchecked)
}

/// The heat of all coils at the chosen force constant, as far as it was computed.
fn used(scene: &Scene, lambda: &LambdaFile) -> UsedPower {
    let heat = |currents: &Vec<f64>| {
        let ohm = scene.resistances_ohm();
        currents.iter().zip(&ohm).map(|(i, ohm)| i * i * ohm).sum()
    };
    let feedback = lambda.feedback.as_ref();
    let followed = feedback.and_then(|feedback| feedback.at_chosen.as_ref());
    UsedPower {
        static_w: lambda.currents_a.as_ref().map(heat),
        feedback_w: followed.map(|rendered| rendered.mean_power_w),
    }
}
