//! A page of a made-up object with names that want to be more than names.

use std::collections::BTreeMap;

use fluxform_base::force_direction::ForceDirection;
use fluxform_bundle::lambda_file::LambdaFile;
use fluxform_bundle::manifest::{ForceSummary, Manifest};
use fluxform_bundle::npz::{MapArrays, Runtime};
use fluxform_bundle::table::PointRow;
use fluxform_coil::limits::LimitCheck;
use serde_json::{Value, from_value, json};

use super::{directions, page};
use crate::plot::lambda::{ChosenForces, ErrorMap, LambdaPlot};
use crate::report::data::{CalibratedObject, CoilPlan, DirectionCell, DirectionField, ErrorTime};
use crate::report::measured::{MeasuredCurve, MeasuredRow};

const HOSTILE: &str = "</script><img src=x onerror=alert(1)>\u{202e}\u{0}\"'&<!--";

fn plot() -> LambdaPlot {
    LambdaPlot {
        title: HOSTILE.to_owned(),
        end_n_per_m: 1.3,
        lambda_n_per_m: vec![0.0, 0.7, 1.3],
        rms_error_n: vec![0.0, 1e-3, 5e-3],
        relative_error: vec![None, Some(0.07), Some(0.13)],
        currents_a: vec![vec![0.0, 0.0], vec![0.7, 1.3], vec![1.3, 1.3]],
        breakpoint: vec![true, true, false],
        constants: Vec::new(),
        chosen: Some(ChosenForces {
            lambda_n_per_m: 0.7,
            requested_n: vec![0.021, 0.028, 0.035],
            static_n: vec![0.020, 0.029, 0.032],
            feedback_n: Vec::new(),
            map: ErrorMap::Scattered {
                points_mm: Vec::new(),
                errors_mn: Vec::new(),
            },
        }),
    }
}

fn measured((error, seconds): &(f64, f64)) -> MeasuredRow {
    MeasuredRow {
        knob: *error,
        marked: *error < 1e-4,
        error: *error,
        stated: None,
        seconds: *seconds,
        quartiles_s: [*seconds, *seconds],
    }
}

/// Files of a bundle as any program may have written them.
fn lambda_file() -> LambdaFile {
    let constants = json!({
        "lambda_linear_n_per_m": 0.5, "lambda_jnd_n_per_m": 0.7, "lambda_saturation_n_per_m": null,
        "lambda_floor_n_per_m": null,
    });
    let mut file = json!({
        "schema_version": "1.0.0", "fluxform_version": "0.1.0",
        "design": HOSTILE, "shape": HOSTILE, "inputs": [{"path": HOSTILE, "sha256": "00"}],
        "lambda_n_per_m": 0.7, "criterion": "jnd", "jnd": 0.07, "currents_a": [0.7, 1.3],
        "rms_error_n": 1e-3, "worst_error_n": 3e-3, "relative_rms_error": 0.13,
        "duality_gap_n2": 1e-18, "rank": 2, "points": 3,
        "path": [{"lambda_n_per_m": 0.7, "currents_a": [0.7, 1.3], "event": HOSTILE}],
        "worst_point": {
            "lambda_linear_n_per_m": null, "lambda_jnd_n_per_m": null, "relative_floor": null,
            "worst_error_n": null, "relative_worst_error": null, "currents_a": null,
            "gap_n": null, "active": [{"point": 0, "multiplier": -0.7}],
            "path": [
                {"lambda_n_per_m": 0.0, "worst_error_n": 0.0, "currents_a": [0.0, 0.0],
                 "active_points": [0], "event": HOSTILE},
                {"lambda_n_per_m": 1.3, "worst_error_n": 7e-3, "currents_a": [1.3, 1.3],
                 "active_points": [0], "event": HOSTILE},
            ],
        },
        "accuracy": {},
    });
    let both = file.as_object_mut().unwrap();
    both.extend(constants.as_object().unwrap().clone());
    from_value(file).unwrap()
}

fn manifest() -> Manifest {
    let axis = |from: f64, to: f64| json!({"from_m": from, "to_m": to, "samples": 2});
    let interpolation = json!({
        "name": HOSTILE, "order": 3, "borders": HOSTILE, "largest_error": 3e-5,
        "largest_error_definition": HOSTILE,
    });
    let stage = json!({"estimate": 3e-5, "relative_to": HOSTILE, "method": HOSTILE});
    let manifest: Value = json!({
        "schema_version": "1.0.0", "fluxform_version": "0.1.0",
        "design": HOSTILE, "shape": HOSTILE, "inputs": [], "units": HOSTILE,
        "array": {"positions_m": [[-0.025, 0.0], [0.025, 0.0]], "coupling": HOSTILE,
                  "gain": [1.0, 1.0]},
        "limits": {"current_min_a": [0.0, 0.0], "current_max_a": [1.3, 1.3],
                   "total_current_max_a": 2.6},
        "resistance_ohm": [6.0, 6.0],
        "magnet": {"moment_a_m2": [0.0, 0.0, -0.909], "model": HOSTILE, "polarity": HOSTILE,
                   "diameter_m": 0.01, "length_m": 0.01},
        "lambda": {"lambda_n_per_m": 0.7, "criterion": "jnd"},
        "points": {"x_m": axis(-0.05, 0.05), "y_m": axis(-0.05, 0.05), "count": 3,
                   "present": ["10", "11"]},
        "map": {"x_m": axis(-0.05, 0.05), "y_m": axis(-0.05, 0.05), "z_m": axis(0.03, 0.03),
                "coil": [0, 1], "components": HOSTILE, "interpolation": interpolation},
        "left_out": [{"what": HOSTILE, "why": HOSTILE, "error_cost": 0.0}],
        "accuracy": {HOSTILE: stage}, "files": [],
    });
    from_value(manifest).unwrap()
}

fn map() -> MapArrays<'static> {
    MapArrays {
        x_m: vec![-0.05, 0.05].into(),
        y_m: vec![-0.05, 0.05].into(),
        z_m: vec![0.03].into(),
        coil: vec![0, 1].into(),
        gz_t_per_m_per_a: vec![0.1, 0.2, 0.3, 0.4, 0.4, 0.3, 0.2, 0.1].into(),
        sides_t_per_m_per_a: None,
        gradient_t_per_m_per_a: None,
        field_t_per_a: None,
        passive_force_n: None,
        working_point_gz_t_per_m: None,
        runtime: Runtime {
            moment_a_m2: [0.0, 0.0, -0.909],
            current_min_a: vec![],
            current_max_a: vec![],
            resistance_ohm: vec![],
            total_current_max_a: None,
            lambda_n_per_m: None,
            rendering: None,
        },
    }
}

fn point(x_m: f64, y_m: f64, height_m: f64) -> PointRow {
    PointRow {
        x_m,
        y_m,
        height_m,
        normal: [0.0, 0.0, 1.0],
    }
}

/// The parts of a bundle.
struct Parts {
    lambda: LambdaFile,
    manifest: Manifest,
    points: [PointRow; 3],
    map: MapArrays<'static>,
    curves: LambdaPlot,
    warnings: Vec<String>,
}

impl Parts {
    fn new() -> Self {
        Self {
            lambda: lambda_file(),
            manifest: manifest(),
            points: [
                point(-0.05, -0.05, 0.03),
                point(-0.05, 0.05, 0.04),
                point(0.05, 0.05, 0.05),
            ],
            map: map(),
            curves: plot(),
            warnings: vec![HOSTILE.to_owned()],
        }
    }

    fn object(&self, rows: &[(f64, f64)]) -> CalibratedObject<'_> {
        let missed = LimitCheck {
            value: 6.075,
            limit: 6.0,
            met: false,
        };
        CalibratedObject {
            directions: None,
            lambda: &self.lambda,
            manifest: &self.manifest,
            points: &self.points,
            map: &self.map,
            curves: &self.curves,
            array: None,
            section: CoilPlan {
                inner_radius_m: 0.012,
                outer_radius_m: 0.019,
                core_radius_m: Some(0.011),
            },
            limits: BTreeMap::from([("resistance_ohm", missed)]),
            unchecked: vec!["core field (`fluxform evaluate` reports it)"],
            warnings: &self.warnings,
            error_time: Some(ErrorTime {
                curve: MeasuredCurve {
                    name: HOSTILE.to_owned(),
                    knob: HOSTILE,
                    peer: false,
                    rows: rows.iter().map(measured).collect(),
                },
                timed: HOSTILE,
                error_of: HOSTILE,
                tolerance: 1e-4,
                version: HOSTILE,
                machine: HOSTILE,
            }),
        }
    }
}

/// The drawing had a size of its own, and the page scrolled sideways; rounding got a number and arrows.
#[test]
fn the_drawing_of_directions_takes_the_size_of_the_page_and_shows_no_rounding() {
    let mut parts = Parts::new();
    parts.manifest.force = Some(ForceSummary {
        direction: ForceDirection::VerticalOnly,
        normal_force: None,
        sideways_weight: 1.3,
        crease_points: 0,
        rim_points: 0,
        static_currents: "vertical".to_owned(),
    });
    let cell = |k: usize| DirectionCell {
        position_m: [0.01 * k as f64, 0.0, 0.03],
        requested_n: [0.0, 0.0, 0.7],
        static_n: [0.1 * k as f64, 0.0, 0.7],
        feedback_n: [1e-17, 0.0, 0.7],
    };
    let mut object = parts.object(&[]);
    object.directions = Some(DirectionField {
        x_m: [0.0, 0.03],
        y_m: [0.0, 0.0],
        columns: 4,
        cells: (0..4).map(|k| Some(cell(k))).collect(),
    });
    let body = directions::section(&object).unwrap().body.finish();
    let scrolls = "<figure><div class=\"wide\" tabindex=\"0\" role=\"region\" aria-label=\"Drawing\"><svg viewBox=";
    assert!(body.contains(scrolls), "{body}");
    assert!(body.contains("within 0 degrees with feedback"), "{body}");
    assert!(body.contains("degrees (all 0)<"), "{body}");
    // Of the arrows, the three sideways forces of the static currents are left.
    assert_eq!(body.matches("<path").count(), 3, "{body}");
}

#[test]
fn names_stay_names_everywhere() {
    let parts = Parts::new();
    let html = page(&parts.object(&[(1e-3, 0.01), (1e-6, 0.1)]), &[HOSTILE]);
    assert_eq!(html.matches("<script").count(), 2);
    assert_eq!(html.matches("</script>").count(), 2);
    assert!(!html.contains("<img") && !html.contains("<!--"));
    assert!(!html.contains(['\u{0}', '\u{202e}']));
    assert!(html.matches("&lt;img src=x").count() > 10);
}

#[test]
fn the_same_object_gives_the_same_bytes_with_every_part() {
    let mut parts = Parts::new();
    let object = parts.object(&[(1e-3, 0.01), (1e-6, 0.1)]);
    let html = page(&object, &[]);
    assert!(html == page(&object, &[]));
    for text in [
        "draw-cost",
        "too weak",
        "misses its limit of resistance",
        "core field",
        "\u{25b2} 1.3",
        "6.075 \u{3a9}",
        "1 of 2 coils at the limit: 1.",
        "too strong 70 %",
    ] {
        assert!(html.contains(text), "{text}");
    }
    parts.lambda.lambda_n_per_m = None;
    parts.curves.chosen = None;
    let without = CalibratedObject {
        error_time: None,
        ..parts.object(&[])
    };
    let html = page(&without, &[]);
    assert!(!html.contains("draw-cost") && html.contains("There is no force constant"));
}
