//! gaussmeter scans: the table that is read, the comparison and the residuals that are written.

use std::collections::BTreeMap;
use std::io::{self, Write};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::array_check::LARGEST;
use super::artefact::Input;
use super::read_table::{TableError, read_numbered};
use super::table::{Column, GRADIENT_COLUMNS, write_columns};
use fluxform_base::accuracy::StageAccuracy;

/// Columns of field components, T.
const FIELD: [&str; 3] = ["bx_t", "by_t", "bz_t"];
/// Columns of where the sensor was, m.
const PLACE: [&str; 3] = ["x_m", "y_m", "z_m"];

/// Kinds of columns of a scan.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Measured {
    /// A component of the field, T.
    Field(usize),
    /// Field component and direction of the derivative, T/m.
    Gradient(usize, usize),
}

impl Measured {
    /// Every quantity that a scan may hold.
    fn all() -> impl Iterator<Item = Self> {
        let field = (0..3).map(Self::Field);
        field.chain((0..9).map(|k| Self::Gradient(k / 3, k % 3)))
    }

    /// Name without the unit.
    fn stem(self) -> &'static str {
        match self {
            Self::Field(i) => FIELD[i].trim_end_matches("_t"),
            Self::Gradient(i, j) => GRADIENT_COLUMNS[3 * i + j].trim_end_matches("_t_per_m_per_a"),
        }
    }

    fn unit(self) -> &'static str {
        match self {
            Self::Field(_) => "t",
            Self::Gradient(..) => "t_per_m",
        }
    }

    /// Name of the column: `bz_t`, `dbz_dz_t_per_m`.
    #[must_use]
    pub fn column(self) -> String {
        format!("{}_{}", self.stem(), self.unit())
    }

    /// Whether `probe` writes this quantity to a column `name`: measured, per ampere, computed or a residual.
    fn is_written_as(self, name: &str) -> bool {
        let (stem, unit) = (self.stem(), self.unit());
        let of_table = ["design", "residual", "fitted_residual"];
        name == self.column()
            || name == format!("{stem}_{unit}_per_a")
            || of_table
                .iter()
                .any(|what| name == format!("{stem}_{what}_{unit}"))
    }
}

/// A scan as read.
#[derive(Debug, Clone, PartialEq)]
pub struct Scan {
    /// Where the sensor was, by its own frame, m.
    pub positions_m: Vec<[f64; 3]>,
    /// Currents that flowed, row by row: coil and A; those of 0 A are left out.
    pub currents_a: Vec<Vec<(usize, f64)>>,
    /// The measured quantities.
    pub quantities: Vec<Measured>,
    /// [row, quantity], T or T/m.
    pub values: Vec<f64>,
    /// The line of every row.
    pub lines: Vec<u64>,
}

impl Scan {
    /// Reads a scan: `x_m,y_m,z_m`, any of `bx_t` ... `dbz_dz_t_per_m`, and either `coil,current_a`
    /// or `current_0_a,current_1_a,...` (coils without a column carry none).
    ///
    /// # Errors
    /// Missing or misnamed columns, cells that are no numbers, coils that `coils` coils do not have.
    pub fn read(name: &str, bytes: &[u8], coils: usize) -> Result<Self, TableError> {
        let head = bytes.split(|b| *b == b'\n').next().unwrap_or_default();
        let head = String::from_utf8_lossy(head);
        let header: Vec<&str> = head
            .trim_start_matches('\u{feff}')
            .split(',')
            .map(|cell| cell.trim().trim_matches('"'))
            .collect();
        let quantities: Vec<Measured> = Measured::all()
            .filter(|quantity| header.contains(&quantity.column().as_str()))
            .collect();
        let one = |message: String| TableError {
            faults: vec![format!("{name}:1: {message}")],
        };
        if quantities.is_empty() {
            let shown: String = header.join(",").chars().take(120).collect();
            return Err(one(format!(
                "expected at least one measured column, in SI: bx_t, by_t, bz_t, or one of \
                 dbx_dx_t_per_m to dbz_dz_t_per_m, found {shown:?}"
            )));
        }
        let faults = misnamed(name, &header);
        if !faults.is_empty() {
            return Err(TableError { faults });
        }
        let drives = drive_columns(&header, coils).map_err(one)?;
        let mut requested: Vec<String> = PLACE.map(str::to_owned).to_vec();
        requested.extend(quantities.iter().map(|quantity| quantity.column()));
        requested.extend(drives.iter().map(|(column, _)| column.clone()));
        let requested: Vec<&str> = requested.iter().map(String::as_str).collect();
        let (columns, lines) = read_numbered(name, bytes, &requested, &[])?;
        for (column, values) in requested.iter().zip(&columns) {
            if let Some(row) = values.iter().position(|value| value.abs() > LARGEST) {
                return Err(TableError::one(format!(
                    "{name}:{}: column {column}: {} is beyond {LARGEST:e}, which no sensor measures",
                    lines[row], values[row]
                )));
            }
        }
        let (places, rest) = columns.split_at(3);
        let (measured, driven) = rest.split_at(quantities.len());
        let currents_a = flowing(name, &drives, driven, &lines, coils)?;
        let rows = 0..lines.len();
        Ok(Self {
            positions_m: rows
                .clone()
                .map(|row| std::array::from_fn(|axis| places[axis][row]))
                .collect(),
            currents_a,
            values: rows
                .flat_map(|row| measured.iter().map(move |column| column[row]))
                .collect(),
            quantities,
            lines,
        })
    }

    /// Number of rows.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.positions_m.len()
    }

    /// Writes the rows with what the design gives, what is left of the measurement then, and what is
    /// left after the fit: `predicted` and `fitted` are [row, quantity].
    ///
    /// # Errors
    /// The writer's.
    pub fn write_residuals(
        &self,
        out: &mut dyn Write,
        predicted: &[f64],
        fitted: &[f64],
    ) -> io::Result<()> {
        let count = self.quantities.len();
        let mut named: Vec<(String, Vec<f64>)> = PLACE
            .iter()
            .enumerate()
            .map(|(axis, name)| {
                let values = self.positions_m.iter().map(|p| p[axis]).collect();
                ((*name).to_owned(), values)
            })
            .collect();
        for (k, quantity) in self.quantities.iter().enumerate() {
            let (stem, unit) = (quantity.stem(), quantity.unit());
            let column = |values: &dyn Fn(usize) -> f64| -> Vec<f64> {
                (0..self.rows())
                    .map(|row| values(row * count + k))
                    .collect()
            };
            named.push((quantity.column(), column(&|at| self.values[at])));
            named.push((format!("{stem}_design_{unit}"), column(&|at| predicted[at])));
            let left = column(&|at| self.values[at] - predicted[at]);
            named.push((format!("{stem}_residual_{unit}"), left));
            let left = column(&|at| self.values[at] - fitted[at]);
            named.push((format!("{stem}_fitted_residual_{unit}"), left));
        }
        let columns: Vec<(&str, Column)> = named
            .iter()
            .map(|(name, values)| (name.as_str(), Column::Number(values)))
            .collect();
        write_columns(out, &columns)
    }
}

/// Columns named almost as one that is read. They would be passed over like a comment, and what they hold
/// would be missing from the comparison: without a coil's current its field goes into the other scales.
fn misnamed(name: &str, header: &[&str]) -> Vec<String> {
    let fault = |cell: &&str| {
        let expected = expected_for(cell)?;
        let shown: String = cell.chars().take(40).collect();
        Some(format!(
            "{name}:1: column {shown}: this name is not read, expected {expected}, in SI units; a column of \
             something else needs a name that does not begin like that"
        ))
    };
    header.iter().filter_map(fault).take(20).collect()
}

/// What was probably meant by `cell`; `None` where it is read, is one of the columns that `probe` writes, or
/// begins like none of them.
fn expected_for(cell: &str) -> Option<String> {
    let lower = cell.to_ascii_lowercase();
    if let Some(rest) = lower.strip_prefix("current") {
        return current_for(cell, rest);
    }
    if Measured::all().any(|quantity| quantity.is_written_as(cell)) {
        return None;
    }
    let short = lower.replacen("b_", "b", 1);
    let short = short.replacen(['/', ' ', '-'], "_", 1);
    let begins = |stem: &str| {
        let rest = short.strip_prefix(stem);
        // A name may well begin with the letters of a word like "bypass".
        let word = |rest: &str| stem == "by" && rest.starts_with(char::is_alphabetic);
        rest.is_some_and(|rest| !word(rest))
    };
    if let Some(quantity) = Measured::all().find(|quantity| begins(quantity.stem())) {
        return Some(quantity.column());
    }
    let stem = ["dbx", "dby", "dbz"]
        .into_iter()
        .find(|stem| begins(stem))?;
    let all = ["x", "y", "z"].map(|along| format!("{stem}_d{along}_t_per_m"));
    Some(all.join(", "))
}

/// As [`expected_for`], for a cell that is "current" and `rest`.
fn current_for(cell: &str, rest: &str) -> Option<String> {
    let digits: String = rest.chars().filter(char::is_ascii_digit).collect();
    match digits.parse::<usize>() {
        Ok(coil) => Some(format!("current_{coil}_a")).filter(|expected| cell != expected),
        Err(_) if cell == "current_a" => None,
        Err(_) => Some("current_a beside coil, or current_0_a,current_1_a,...".to_owned()),
    }
}

/// Which columns say what current flowed: the column, and its coil where the name states it.
fn drive_columns(header: &[&str], coils: usize) -> Result<Vec<(String, Option<usize>)>, String> {
    let numbered: Vec<(String, Option<usize>)> = header
        .iter()
        .filter_map(|cell| {
            let number = cell.strip_prefix("current_")?.strip_suffix("_a")?;
            Some(((*cell).to_owned(), Some(number.parse().ok()?)))
        })
        .collect();
    let by_row = header.contains(&"coil") || header.contains(&"current_a");
    match (by_row, numbered.is_empty()) {
        (true, true) => {
            let columns = ["coil", "current_a"];
            Ok(columns.map(|name| (name.to_owned(), None)).to_vec())
        }
        (false, false) => match numbered.iter().find(|(_, n)| n.is_some_and(|n| n >= coils)) {
            Some((column, _)) => Err(format!(
                "column {column}: the design has {coils} coils, expected numbers from 0 to {}",
                coils.saturating_sub(1)
            )),
            None => Ok(numbered),
        },
        (true, false) => Err(
            "expected the currents once, found coil or current_a beside current_0_a ...; keep one \
             of them"
                .to_owned(),
        ),
        (false, true) => Err(
            "expected columns that say which current flowed, in ampere: coil,current_a, or \
             current_0_a,current_1_a,..."
                .to_owned(),
        ),
    }
}

/// The currents of every row.
fn flowing(
    name: &str,
    drives: &[(String, Option<usize>)],
    columns: &[Vec<f64>],
    lines: &[u64],
    coils: usize,
) -> Result<Vec<Vec<(usize, f64)>>, TableError> {
    let mut faults = Vec::new();
    let mut rows = Vec::with_capacity(lines.len());
    for (row, line) in lines.iter().enumerate() {
        let mut currents: Vec<(usize, f64)> = Vec::new();
        if drives[0].1.is_some() {
            currents.extend(
                drives
                    .iter()
                    .zip(columns)
                    .filter_map(|((_, coil), column)| Some(((*coil)?, column[row]))),
            );
        } else {
            let coil = columns[0][row];
            if coil >= 0.0 && coil < coils as f64 && coil.fract() == 0.0 {
                currents.push((coil as usize, columns[1][row]));
            } else if faults.len() < 20 {
                faults.push(format!(
                    "{name}:{line}: column coil: expected a number from 0 to {}, found {coil}",
                    coils.saturating_sub(1)
                ));
            }
        }
        currents.retain(|(_, current)| *current != 0.0);
        rows.push(currents);
    }
    if faults.is_empty() {
        Ok(rows)
    } else {
        Err(TableError { faults })
    }
}

/// `probe --compare`: a scan held against a design. Null where the scan does not determine a number.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ScanFile {
    /// Layout, `major.minor.patch`.
    pub schema_version: String,
    /// Program that wrote it.
    pub fluxform_version: String,
    /// Name of the design.
    pub design: String,
    /// Design and scan.
    pub inputs: Vec<Input>,
    /// Rows of the scan.
    pub rows: usize,
    /// Measured numbers: rows times measured columns.
    pub values: usize,
    /// The measured columns.
    pub measured: Vec<String>,
    /// Residuals of the measurement.
    pub residuals: Residuals,
    /// Fitted parameters.
    pub fit: FitFile,
    /// Part of the residuals that one parameter, or one group of them, would explain; the
    /// most first.
    pub explanations: Vec<Explanation>,
    /// The explanation that is best for its number of parameters; null where none is worth it.
    pub best_explanation: Option<String>,
    /// Stated error of the computed field.
    pub accuracy: BTreeMap<String, StageAccuracy>,
}

/// Residuals before and after the fit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Residuals {
    /// Measured minus computed from the design as it is.
    pub as_designed: Left,
    /// Measured minus fitted.
    pub fitted: Left,
}

/// Residuals of the measured quantities.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Left {
    /// Of the field.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub field: Option<FieldLeft>,
    /// Of its gradient.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gradient: Option<GradientLeft>,
}

/// Residuals of the measured field.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct FieldLeft {
    /// Root mean square over all components, T.
    pub rms_t: f64,
    /// Largest, with its sign, T.
    pub largest_t: f64,
    /// Where that is.
    pub at: ScanPlace,
    /// Root mean square of the measured field, T.
    pub measured_rms_t: f64,
    /// Largest error claimed of the computed field, T.
    pub model_error_t: f64,
    /// The sensor's noise as stated, T.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noise_t: Option<f64>,
    /// Where it is not stated: the noise estimated from what the fit leaves of the field, T.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub estimated_noise_t: Option<f64>,
    /// After the fit and with stated noise: sum of the squares in units of that noise over the field's degrees
    /// of freedom.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reduced_chi_square: Option<f64>,
}

/// Residuals of the measured gradient.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct GradientLeft {
    /// Root mean square over all components, T/m.
    pub rms_t_per_m: f64,
    /// Largest, with its sign, T/m.
    pub largest_t_per_m: f64,
    /// Where that is.
    pub at: ScanPlace,
    /// Root mean square of the measured gradient, T/m.
    pub measured_rms_t_per_m: f64,
    /// Largest error claimed of the computed gradient, T/m.
    pub model_error_t_per_m: f64,
    /// The sensor's noise as stated, T/m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noise_t_per_m: Option<f64>,
    /// Where it is not stated: the noise estimated from what the fit leaves of the gradient, T/m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub estimated_noise_t_per_m: Option<f64>,
    /// After the fit and with stated noise: sum of the squares in units of that noise over the gradient's
    /// degrees of freedom.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reduced_chi_square: Option<f64>,
}

/// A value of the scan.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ScanPlace {
    /// Line in the file.
    pub line: u64,
    /// Column.
    pub column: String,
    /// m.
    pub x_m: f64,
    /// m.
    pub y_m: f64,
    /// m.
    pub z_m: f64,
}

/// Parameters fitted together.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct FitFile {
    /// One a coil that carried current; empty where scales were not fitted.
    pub scales: Vec<CoilScale>,
    /// The line for the design's `[array]` with the scales in it; null unless a fit that settled gives one.
    pub gain_toml: Option<String>,
    /// A constant field beside that of the coils, T.
    pub background_t: Option<[Option<f64>; 3]>,
    /// Its standard errors, T.
    pub background_error_t: Option<[Option<f64>; 3]>,
    /// Offset from the scan's coordinates to those of the design, m.
    pub position_m: Option<[Option<f64>; 3]>,
    /// Its standard errors, m.
    pub position_error_m: Option<[Option<f64>; 3]>,
    /// The sensor's frame turned about x, then y, then z, around the scan's middle, degrees.
    pub rotation_deg: Option<[Option<f64>; 3]>,
    /// Its standard errors, degrees.
    pub rotation_error_deg: Option<[Option<f64>; 3]>,
    /// Sets of parameters of which the scan determines only some combinations, or nothing.
    pub undetermined: Vec<Vec<String>>,
    /// Directions with a singular value below this part of the largest are not solved for.
    pub cutoff: f64,
    /// Measured numbers minus fitted directions.
    pub degrees_of_freedom: usize,
    /// Sum of the squares in units of the stated noise over the degrees of freedom, of what noise is
    /// stated for: 1 where noise is all that is left.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reduced_chi_square: Option<f64>,
    /// Linearisations.
    pub iterations: usize,
    /// Whether the last one changed next to nothing.
    pub converged: bool,
}

/// A coil's scale.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct CoilScale {
    /// Number of the coil.
    pub coil: usize,
    /// Measured over computed, with the design's gain in the computed.
    pub scale: Option<f64>,
    /// Its standard error.
    pub standard_error: Option<f64>,
    /// The design's gain times the scale: what goes into `[array] gain`.
    pub gain: Option<f64>,
}

/// Part that one parameter would explain.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Explanation {
    /// The design's key, or `scale`, `scale of each coil`, `background`, `position`, `height`,
    /// `rotation`.
    pub parameter: String,
    /// Share of the sum of the squares of the residuals as designed that it takes away when fitted.
    pub share: f64,
    /// How many numbers are free.
    pub parameters: usize,
    /// The change that does it, in the unit of the key; for one free number.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub change: Option<f64>,
    /// Its standard error.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub standard_error: Option<f64>,
    /// Parameters that this scan cannot distinguish from it.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    #[serde(default)]
    pub alike: Vec<String>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scan_is_read_in_either_form() {
        let text = "\u{feff}x_m, y_m,z_m,bz_t,coil,current_a\r\n0.1,0.2,0.3,0.7e-3,1,1.3\r\n0.1,0.2,0.4,0,0,0\r\n";
        let scan = Scan::read("s", text.as_bytes(), 2).unwrap();
        assert_eq!(scan.currents_a, [vec![(1, 1.3)], vec![]]);
        assert_eq!(scan.quantities, [Measured::Field(2)]);
        assert_eq!(scan.lines, [2, 3]);
        let text = "x_m,y_m,z_m,dbz_dz_t_per_m,bx_t,current_1_a,current_0_a\n0.1,0.2,0.3,7,1,2,3\n";
        let scan = Scan::read("s", text.as_bytes(), 2).unwrap();
        assert_eq!(scan.currents_a, [vec![(1, 2.0), (0, 3.0)]]);
        assert_eq!(scan.values, [1.0, 7.0]);
        let mut out = Vec::new();
        scan.write_residuals(&mut out, &[0.25, 6.5], &[1.0, 7.5])
            .unwrap();
        let out = String::from_utf8(out).unwrap();
        assert_eq!(
            out,
            "x_m,y_m,z_m,bx_t,bx_design_t,bx_residual_t,bx_fitted_residual_t,dbz_dz_t_per_m,\
             dbz_dz_design_t_per_m,dbz_dz_residual_t_per_m,dbz_dz_fitted_residual_t_per_m\n\
             0.1,0.2,0.3,1,0.25,0.75,0,7,6.5,0.5,-0.5\n"
        );
    }

    #[test]
    fn what_is_missing_is_named() {
        let reported = |text: &str| Scan::read("s", text.as_bytes(), 2).unwrap_err().to_string();
        assert!(reported("x_m,y_m,z_m,bz_mt,coil,current_a\n").contains("bx_t, by_t, bz_t"));
        assert!(reported("x_m,y_m,z_m,bz_t\n").contains("current_0_a"));
        assert!(reported("x_m,y_m,z_m,bz_t,coil\n").contains("column current_a is missing"));
        assert!(reported("x_m,y_m,z_m,bz_t,current_2_a\n").contains("from 0 to 1"));
        assert!(reported("x_m,y_m,z_m,bz_t,coil,current_0_a\n").contains("keep one"));
        let coil = reported("x_m,y_m,z_m,bz_t,coil,current_a\n0,0,0,0,2,1\n");
        assert!(
            coil.contains("s:2: column coil: expected a number from 0 to 1"),
            "{coil}"
        );
    }
}
