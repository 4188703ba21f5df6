//! Curves of error against time as the pages' script draws them.

use serde_json::{Value, json};

use super::pack::f32s;

/// One curve: what is swept, how wrong it is there, how long it takes.
#[derive(Debug, Clone, PartialEq)]
pub struct MeasuredCurve<'a> {
    /// Method and program of the computation.
    pub name: String,
    /// The parameter that is swept.
    pub knob: &'a str,
    /// Whether another program's.
    pub peer: bool,
    /// From coarse to fine.
    pub rows: Vec<MeasuredRow>,
}

/// One setting of the knob.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeasuredRow {
    /// The knob.
    pub knob: f64,
    /// Whether it is emphasised: the default, or what this run requested.
    pub marked: bool,
    /// Largest error found.
    pub error: f64,
    /// Error that the stage itself states.
    pub stated: Option<f64>,
    /// Processor time, the median, s.
    pub seconds: f64,
    /// Its quartiles, s.
    pub quartiles_s: [f64; 2],
}

impl MeasuredCurve<'_> {
    /// For the script: `unit` is the error's, or what it is relative to; `marked` names the rings.
    #[must_use]
    pub fn json(&self, unit: &str, marked: &str) -> Value {
        let column = |value: fn(&MeasuredRow) -> f64| f32s(self.rows.iter().map(value));
        let rings: Vec<usize> = (0..self.rows.len())
            .filter(|at| self.rows[*at].marked)
            .collect();
        json!({
            "name": self.name,
            "knobName": self.knob,
            "unit": unit,
            "peer": self.peer,
            "ringed": marked,
            "rings": rings,
            "knob": self.rows.iter().map(|row| row.knob).collect::<Vec<_>>(),
            "error": column(|row| row.error),
            "seconds": column(|row| row.seconds),
            "low": column(|row| row.quartiles_s[0]),
            "high": column(|row| row.quartiles_s[1]),
        })
    }
}
