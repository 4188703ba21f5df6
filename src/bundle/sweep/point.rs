//! A point's file: its row, whose it is, and a checksum.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::de::IgnoredAny;
use serde::{Deserialize, Serialize};
use strum::{EnumMessage, IntoStaticStr, VariantArray};

use crate::artefact::{FLUXFORM_VERSION, SCHEMA_VERSION, sha256_hex};
use crate::json::{JsonError, to_json};
use fluxform_base::accuracy::CertificateKind;

/// How a point ended.
#[derive(
    Debug,
    Clone,
    Copy,
    PartialEq,
    Eq,
    EnumMessage,
    IntoStaticStr,
    VariantArray,
    Serialize,
    Deserialize,
    JsonSchema,
)]
#[serde(rename_all = "snake_case")]
#[strum(serialize_all = "snake_case")]
pub enum Status {
    /// Computed to the tolerance.
    Done,
    /// Computed, but not to the tolerance.
    AccuracyNotReached,
    /// No coil or array that was found meets the design's limits; the message says which is to blame.
    Infeasible,
    /// The design lacks a limit without which there is no best coil.
    Unbounded,
    /// The design cannot be computed; the message says why.
    Failed,
}

fluxform_base::choices!(Status);

impl Status {
    /// Whether there is a coil.
    #[must_use]
    pub(crate) fn has_row(self) -> bool {
        matches!(self, Self::Done | Self::AccuracyNotReached)
    }
}

/// Row of one design: one coil alone at its rated current, SI.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Row {
    /// Number of turns.
    pub turns: f64,
    /// Resistance at the wire's temperature.
    pub resistance_ohm: f64,
    /// Self inductance; with a B-H curve the flux linkage over the current.
    pub inductance_h: f64,
    /// Five time constants; under a current loop the time until a step to the rated current has settled.
    pub settling_s: f64,
    /// Heat.
    pub power_w: f64,
    /// Mass of wire and core.
    pub mass_kg: f64,
    /// Length of wire.
    pub wire_length_m: f64,
    /// The rated current.
    pub current_a: f64,
    /// dB_z/dz at the target.
    pub gradient_t_per_m_per_a: f64,
    /// Upward force on the magnet at the target.
    pub force_n: f64,
    /// Largest |B| in the core; null for air coils.
    pub core_peak_field_t: Option<f64>,
    /// Whether the design's limits are met.
    pub limits_met: bool,
    /// The best coil's dimensions; absent where the coil is the design's own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub optimum: Option<OptimumRow>,
    /// The best array; absent where none was searched.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub array: Option<ArrayRow>,
    /// The coils of an array with steel beyond its cores; absent without.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub iron: Option<IronRow>,
}

/// All coils among a plate and other bodies of steel.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct IronRow {
    /// Largest self inductance.
    pub inductance_h: f64,
    /// Five time constants of the slowest pattern of currents, or a current loop's time for it.
    pub settling_s: f64,
    /// Largest |B| in the plate and other bodies with all coils at their rated currents; null where their permeability
    /// is that of air.
    pub peak_field_t: Option<f64>,
}

/// The array that renders the shapes best within a design's limits.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ArrayRow {
    /// Geometric mean of its force constants over those of the point's own given array.
    pub gain: f64,
    /// Force constant of every shape.
    pub lambda_n_per_m: Vec<f64>,
    /// Coils.
    pub coils: u64,
    /// Arrays that were computed.
    pub evaluations: u64,
    /// Its variables by key, in the key's unit.
    pub values: BTreeMap<String, f64>,
}

/// How good an array is for the shapes.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ArrayMerit {
    /// Geometric mean of the force constants, N/m, which all points of a sweep share: over one given array it
    /// ranks as `gain` does. 0 without a shape.
    pub mean_lambda_n_per_m: f64,
    /// The same over that of the point's own design as given.
    pub gain: f64,
}

impl ArrayRow {
    /// See [`ArrayMerit`].
    #[must_use]
    pub fn merit(&self) -> ArrayMerit {
        let logs: f64 = self.lambda_n_per_m.iter().map(|lambda| lambda.ln()).sum();
        ArrayMerit {
            mean_lambda_n_per_m: match self.lambda_n_per_m.len() {
                0 => 0.0,
                shapes => (logs / shapes as f64).exp(),
            },
            gain: self.gain,
        }
    }
}

/// Result for a design.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct OptimumRow {
    /// Inner diameter.
    pub inner_diameter_m: f64,
    /// Outer diameter.
    pub outer_diameter_m: f64,
    /// Length.
    pub length_m: f64,
    /// Diameter of the wire over its insulation.
    pub wire_diameter_m: f64,
    /// Whole layers; null where turns need not be whole.
    pub layers: Option<u64>,
    /// Whole turns a layer; null where they need not be.
    pub turns_per_layer: Option<u64>,
    /// How sure it is that no coil is better.
    pub certificate: CertificateKind,
    /// No coil within the limits gives more force; null where nothing is proven.
    pub upper_bound_n: Option<f64>,
}

/// A point's file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PointFile {
    /// Layout, `major.minor.patch`.
    pub schema_version: String,
    /// Program that computed it.
    pub fluxform_version: String,
    /// The plan it belongs to.
    pub plan_sha256: String,
    /// Which point of the plan, from 0.
    pub index: u64,
    /// How it ended.
    pub status: Status,
    /// Why it failed.
    pub message: Option<String>,
    /// Absent where it failed.
    pub row: Option<Row>,
    /// Digest of this file with this value empty, as compact JSON: a torn file is recognised.
    pub point_sha256: String,
}

/// Head of every point's file.
const OPENING: &[u8] = b"{\n  \"schema_version\": \"";

impl PointFile {
    /// A sealed point; of a design that cannot be computed, with the reason.
    #[must_use]
    pub fn new(plan_sha256: &str, index: u64, outcome: Result<(Row, Status), String>) -> Self {
        match outcome {
            Ok((row, status)) => Self::sealed(plan_sha256, index, status, Some(row), None),
            Err(message) => Self::without_row(plan_sha256, index, Status::Failed, message),
        }
    }

    /// A sealed point that has no coil; the message says why.
    #[must_use]
    pub fn without_row(plan_sha256: &str, index: u64, status: Status, message: String) -> Self {
        Self::sealed(plan_sha256, index, status, None, Some(message))
    }

    fn sealed(
        plan_sha256: &str,
        index: u64,
        status: Status,
        row: Option<Row>,
        message: Option<String>,
    ) -> Self {
        let mut point = Self {
            schema_version: SCHEMA_VERSION.to_owned(),
            fluxform_version: FLUXFORM_VERSION.to_owned(),
            plan_sha256: plan_sha256.to_owned(),
            index,
            status,
            message,
            row,
            point_sha256: String::new(),
        };
        point.point_sha256 = point.digest();
        point
    }

    /// The file's bytes.
    ///
    /// # Errors
    /// A number that is none.
    pub fn to_bytes(&self) -> Result<Vec<u8>, JsonError> {
        to_json(self)
    }

    /// The point in `bytes`; `None` where they are no whole point.
    #[must_use]
    pub fn parse(bytes: &[u8]) -> Option<Self> {
        let point: Self = serde_json::from_slice(bytes).ok()?;
        let whole = point.digest() == point.point_sha256;
        let reported = point.status.has_row() == point.row.is_some();
        (whole && reported).then_some(point)
    }

    /// Whether `bytes`, which are no whole point, may be what a lost system left of one: a beginning of
    /// ours, if any, then zeros, if any.
    #[must_use]
    pub(crate) fn is_torn(bytes: &[u8]) -> bool {
        let end = bytes
            .iter()
            .rposition(|byte| *byte != 0)
            .map_or(0, |at| at + 1);
        let text = &bytes[..end];
        let common = text.len().min(OPENING.len());
        // A whole document is somebody's, whatever it begins with.
        let last = text
            .split(|byte| *byte == b'\n')
            .next_back()
            .unwrap_or_default();
        let lines = text.split(|byte| *byte == b'\n').count();
        let cut = |error: serde_json::Error| {
            error.is_eof() || (error.line() == lines && error.column() >= last.len())
        };
        text[..common] == OPENING[..common]
            && serde_json::from_slice::<IgnoredAny>(text).is_err_and(cut)
    }

    fn digest(&self) -> String {
        let open = Self {
            point_sha256: String::new(),
            ..self.clone()
        };
        sha256_hex(&serde_json::to_vec(&open).unwrap_or_default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point() -> PointFile {
        let row = Row {
            turns: 1_428.571_428_571_4,
            resistance_ohm: 0.1 + 0.2,
            inductance_h: 5e-324,
            settling_s: 0.011_9,
            power_w: 7.0,
            mass_kg: 0.3,
            wire_length_m: 13.0,
            current_a: 2.0,
            gradient_t_per_m_per_a: -0.7,
            force_n: 0.099_709,
            core_peak_field_t: None,
            limits_met: true,
            optimum: None,
            array: None,
            iron: None,
        };
        PointFile::new("abc", 7, Ok((row, Status::Done)))
    }

    #[test]
    fn a_point_is_read_back_to_the_bit_and_any_cut_or_change_is_seen() {
        let bytes = point().to_bytes().unwrap();
        assert_eq!(PointFile::parse(&bytes), Some(point()));
        // The final newline alone may go: nothing is lost with it.
        for cut in 0..bytes.len() - 1 {
            assert_eq!(PointFile::parse(&bytes[..cut]), None, "{cut}");
            assert!(PointFile::is_torn(&bytes[..cut]));
        }
        let text = String::from_utf8(bytes).unwrap();
        for (from, to) in [
            ("1428", "1429"),
            ("\"index\": 7", "\"index\": 8"),
            ("done", "failed"),
        ] {
            assert_eq!(PointFile::parse(text.replace(from, to).as_bytes()), None);
        }
        assert!(PointFile::is_torn(&[0; 700]));
        assert!(!PointFile::is_torn(b"precious"));
        // Of another kind, or edited: whole, and somebody's.
        assert!(!PointFile::is_torn(
            text.replace("done", "failed").as_bytes()
        ));
    }

    #[test]
    fn a_number_that_is_none_is_no_file() {
        let mut row = point().row.unwrap();
        row.force_n = f64::NAN;
        let error = PointFile::new("abc", 7, Ok((row, Status::Done))).to_bytes();
        assert!(error.unwrap_err().to_string().contains("row.force_n"));
    }
}
