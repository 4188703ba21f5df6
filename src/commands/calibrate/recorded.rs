//! The shipped curve of error against time that a bundle's page shows: of the computation that
//! the field's tolerance costs most in.

use std::sync::OnceLock;

use serde::Deserialize;

use crate::report::data::ErrorTime;
use crate::report::measured::{MeasuredCurve, MeasuredRow};
use crate::scene::Scene;
use crate::scene::coupled;

/// The table of a whole run of the measuring suite.
const TABLE: &str = include_str!("../../../results/bench/bench.json");
/// The machine on which it was recorded; to be changed with the table.
const MACHINE: &str = "one core of a shared two-core x86-64 machine";
/// Name of the knob.
const KNOB: &str = "tolerance";

/// The part of the table that the page shows.
#[derive(Deserialize)]
struct Recorded {
    fluxform_version: String,
    stages: Vec<Stage>,
}

#[derive(Deserialize)]
struct Stage {
    stage: String,
    timed: String,
    error_of: String,
    curves: Vec<Curve>,
}

#[derive(Deserialize)]
struct Curve {
    name: String,
    program: String,
    knob: String,
    rows: Vec<Row>,
}

#[derive(Deserialize)]
struct Row {
    knob: f64,
    error: f64,
    stated_error: Option<f64>,
    seconds: f64,
    seconds_low: f64,
    seconds_high: f64,
}

fn table() -> Option<&'static Recorded> {
    static READ: OnceLock<Option<Recorded>> = OnceLock::new();
    READ.get_or_init(|| serde_json::from_str(TABLE).ok())
        .as_ref()
}

/// The curve for `scene`, `tolerance` marked; the same for the same scene, whatever this run took.
/// `None` for a table without it.
pub(super) fn curve(scene: &Scene, tolerance: f64) -> Option<ErrorTime<'static>> {
    if scene.iron.is_some() {
        return None;
    }
    let name = match (&scene.core, coupled(scene.design)) {
        (None, _) => "map-table",
        (Some(_), false) => "cored-coil",
        (Some(_), true) => "coupled-array",
    };
    of_stage(name, tolerance)
}

fn of_stage(name: &str, tolerance: f64) -> Option<ErrorTime<'static>> {
    let file = table()?;
    let stage = file.stages.iter().find(|stage| stage.stage == name)?;
    let ours = |curve: &&Curve| curve.program == "fluxform" && curve.knob == KNOB;
    let curve = stage.curves.iter().find(ours)?;
    let rows = curve.rows.iter().map(|row| MeasuredRow {
        knob: row.knob,
        marked: (row.knob / tolerance - 1.0).abs() < 1e-9,
        error: row.error,
        stated: row.stated_error,
        seconds: row.seconds,
        quartiles_s: [row.seconds_low, row.seconds_high],
    });
    Some(ErrorTime {
        curve: MeasuredCurve {
            name: curve.name.clone(),
            knob: KNOB,
            peer: false,
            rows: rows.collect(),
        },
        timed: &stage.timed,
        // The text in brackets is about other curves of the stage.
        error_of: stage.error_of.split([';', '(']).next()?.trim(),
        tolerance,
        version: &file.fluxform_version,
        machine: MACHINE,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shipped_table_has_a_curve_for_every_kind_of_scene_with_its_default_on_it() {
        for (name, default) in [
            ("map-table", 1e-9),
            ("cored-coil", 1e-6),
            ("coupled-array", 1e-4),
        ] {
            let shipped = of_stage(name, default).expect(name);
            let marked: Vec<_> = shipped.curve.rows.iter().filter(|r| r.marked).collect();
            assert_eq!(marked.len(), 1, "{name}");
            assert!(marked[0].error <= default && marked[0].seconds > 0.0);
            assert!(shipped.error_of.starts_with("largest "));
            let off = of_stage(name, 0.7 * default).expect(name);
            assert!(off.curve.rows.iter().all(|row| !row.marked));
        }
    }
}
