//! The problems that peers are given: numbers, places, reference values.

use serde_json::{Value, json};

use crate::file::Curve;
use crate::inputs::{NLOPT, OPTIMUM_AIR};
use crate::stages::{Measured, problem};
use fluxform::RunError;

/// A problem for one script.
pub struct Posed {
    /// The stage whose curves it joins.
    pub stage: &'static str,
    /// File under `scripts/peers`.
    pub script: &'static str,
    /// Input of the script.
    pub content: Value,
    /// Reference of the errors.
    pub reference: String,
    /// Its own error.
    pub reference_error: f64,
}

/// Stage, its curve's number, script, and the numbers of the problem.
type Maker = fn() -> Result<Value, RunError>;
const MAKERS: [(&str, usize, &str, Maker); 6] = [
    ("inductance", 1, "inductance_cfsem.py", problem::inductance),
    ("cored-coil", 0, "core_ngsolve.py", problem::cored_coil),
    ("map-table", 0, "map_magpylib.py", problem::map_table),
    ("height-map", 1, "surface_peer.py", problem::height_map),
    ("lambda-path", 0, "lambda_peer.py", problem::lambda_path),
    ("worst-point", 0, "lambda_peer.py", problem::worst_point),
];

/// The problems of the stages that were measured.
///
/// # Errors
/// Built-in values that cannot be read.
pub fn problems(measured: &[Measured], quick: bool) -> Result<Vec<Posed>, RunError> {
    let mut posed = Vec::new();
    let mut add = |stage: &'static str, at: usize, script, content: Value| {
        let found = measured.iter().find(|m| m.curves.stage == stage);
        let curve: Option<&Curve> = found.and_then(|m| m.curves.curves.get(at));
        if let Some(curve) = curve {
            let mut content = content;
            content["curve"] = json!(curve.name);
            content["quick"] = json!(quick);
            posed.push(Posed {
                stage,
                script,
                content,
                // An exact path is the peers' reference itself.
                reference: match stage {
                    "lambda-path" | "worst-point" => {
                        "the least error by fluxform, proven by its gap"
                    }
                    _ => &curve.reference,
                }
                .to_owned(),
                reference_error: curve.reference_error,
            });
        }
    };
    for (stage, at, script, make) in MAKERS {
        if measured.iter().any(|m| m.curves.stage == stage) {
            add(stage, at, script, make()?);
        }
    }
    let reference: Value = NLOPT.values()?;
    let force_n = &reference["problems"]["seed_air"]["best"]["force_n"];
    let optimum = json!({"design": OPTIMUM_AIR.text, "force_n": force_n});
    add("coil-optimum", 0, "optimum_nlopt.py", optimum);
    Ok(posed)
}
