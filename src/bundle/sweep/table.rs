//! The table of a sweep: one row a point, the set keys beside the results.

use std::io::{self, Write};

use super::{Mode, PointFile, Value};
use crate::number::{push_index, push_number};

/// A cell of a result. Cells that do not apply are empty.
#[derive(Debug, Clone, PartialEq)]
pub enum Cell<'a> {
    /// A number, SI.
    Number(Option<f64>),
    /// A count.
    Count(Option<u64>),
    /// A yes or no.
    Flag(Option<bool>),
    /// A word.
    Text(&'a str),
}

/// A column: its name, unit last, and its cell of a point.
pub struct Column {
    /// Its name.
    pub name: &'static str,
    /// Its cell.
    pub cell: fn(&PointFile) -> Cell<'_>,
}

const fn column(name: &'static str, cell: fn(&PointFile) -> Cell<'_>) -> Column {
    Column { name, cell }
}

macro_rules! of_row {
    ($name:literal, $kind:ident, $row:ident => $value:expr) => {
        column($name, |point| {
            Cell::$kind(point.row.as_ref().and_then(|$row| $value))
        })
    };
}

macro_rules! of_optimum {
    ($name:literal, $kind:ident, $best:ident => $value:expr) => {
        of_row!($name, $kind, row => row.optimum.as_ref().and_then(|$best| $value))
    };
}

macro_rules! of_array {
    ($name:literal, $kind:ident, $best:ident => $value:expr) => {
        of_row!($name, $kind, row => row.array.as_ref().and_then(|$best| $value))
    };
}

macro_rules! of_iron {
    ($name:literal, $iron:ident => $value:expr) => {
        of_row!($name, Number, row => row.iron.as_ref().and_then(|$iron| $value))
    };
}

/// Columns after `index` and the set keys.
pub static ROW_COLUMNS: &[Column] = &[
    of_row!("turns", Number, row => Some(row.turns)),
    of_row!("resistance_ohm", Number, row => Some(row.resistance_ohm)),
    of_row!("inductance_h", Number, row => Some(row.inductance_h)),
    of_row!("settling_s", Number, row => Some(row.settling_s)),
    of_row!("power_w", Number, row => Some(row.power_w)),
    of_row!("mass_kg", Number, row => Some(row.mass_kg)),
    of_row!("wire_length_m", Number, row => Some(row.wire_length_m)),
    of_row!("current_a", Number, row => Some(row.current_a)),
    of_row!("gradient_t_per_m_per_a", Number, row => Some(row.gradient_t_per_m_per_a)),
    of_row!("force_n", Number, row => Some(row.force_n)),
    of_row!("core_peak_field_t", Number, row => row.core_peak_field_t),
    of_row!("limits_met", Flag, row => Some(row.limits_met)),
    column("status", |point| Cell::Text(point.status.name())),
    column("message", |point| {
        Cell::Text(point.message.as_deref().unwrap_or(""))
    }),
];

/// Columns after those of a sweep that optimises.
pub static OPTIMUM_COLUMNS: &[Column] = &[
    of_optimum!("best_inner_diameter_m", Number, best => Some(best.inner_diameter_m)),
    of_optimum!("best_outer_diameter_m", Number, best => Some(best.outer_diameter_m)),
    of_optimum!("best_length_m", Number, best => Some(best.length_m)),
    of_optimum!("best_wire_diameter_m", Number, best => Some(best.wire_diameter_m)),
    of_optimum!("best_layers", Count, best => best.layers),
    of_optimum!("best_turns_per_layer", Count, best => best.turns_per_layer),
    column("certificate", |point| {
        let best = point.row.as_ref().and_then(|row| row.optimum.as_ref());
        Cell::Text(best.map_or("", |best| best.certificate.name()))
    }),
    of_optimum!("upper_bound_n", Number, best => best.upper_bound_n),
];

/// Columns after those of a sweep that searches arrays; `best:KEY` of every variable follow. `gain` is against the
/// row's own given array: rows compare by `mean_lambda_n_per_m`.
pub static ARRAY_COLUMNS: &[Column] = &[
    of_array!("gain", Number, best => Some(best.gain)),
    of_array!("mean_lambda_n_per_m", Number, best => Some(best.merit().mean_lambda_n_per_m)),
    of_array!("smallest_lambda_n_per_m", Number, best => best.lambda_n_per_m.iter().copied().reduce(f64::min)),
    of_array!("coils", Count, best => Some(best.coils)),
    of_array!("evaluations", Count, best => Some(best.evaluations)),
];

/// Columns after those of a sweep of designs with a plate or other steel beyond the cores.
pub static IRON_COLUMNS: &[Column] = &[
    of_iron!("array_inductance_h", iron => Some(iron.inductance_h)),
    of_iron!("array_settling_s", iron => Some(iron.settling_s)),
    of_iron!("iron_peak_field_t", iron => iron.peak_field_t),
];

/// The columns of a sweep's results; whether its designs have steel beyond the cores.
#[must_use]
pub fn columns(mode: Mode, has_iron: bool) -> Vec<&'static Column> {
    let of_optimum: &[Column] = match mode {
        Mode::Evaluate => &[],
        Mode::Optimize | Mode::OptimizeWound => OPTIMUM_COLUMNS,
        Mode::OptimizeFor => ARRAY_COLUMNS,
    };
    let of_iron: &[Column] = if has_iron { IRON_COLUMNS } else { &[] };
    ROW_COLUMNS
        .iter()
        .chain(of_iron)
        .chain(of_optimum)
        .collect()
}

/// Writes rows as they come.
pub struct TableWriter<'a> {
    out: &'a mut dyn Write,
    columns: Vec<&'static Column>,
    /// Variables of arrays, one column each.
    variables: &'a [String],
    line: Vec<u8>,
}

impl<'a> TableWriter<'a> {
    /// Writes the header, of [`columns`] and of the `variables` of a sweep that searches arrays; `extra` are
    /// columns after all others, given to every row.
    ///
    /// # Errors
    /// The writer's.
    pub fn begin<'k>(
        out: &'a mut dyn Write,
        columns: Vec<&'static Column>,
        keys: impl IntoIterator<Item = &'k str>,
        variables: &'a [String],
        extra: &[&'k str],
    ) -> io::Result<Self> {
        let mut table = Self {
            out,
            columns,
            variables,
            line: Vec::new(),
        };
        table.text("index");
        let names: Vec<&str> = table.columns.iter().map(|column| column.name).collect();
        for key in keys.into_iter().chain(names) {
            table.text(key);
        }
        for key in variables {
            table.text(&format!("best:{key}"));
        }
        for key in extra {
            table.text(key);
        }
        table.end()?;
        Ok(table)
    }

    /// Writes one row.
    ///
    /// # Errors
    /// The writer's.
    pub fn row(&mut self, values: &[&Value], point: &PointFile, extra: &[bool]) -> io::Result<()> {
        self.line.clear();
        push_index(
            &mut self.line,
            i64::try_from(point.index).unwrap_or(i64::MAX),
        );
        self.line.push(b',');
        for value in values {
            self.value(value);
        }
        for column in self.columns.clone() {
            self.cell(&(column.cell)(point));
        }
        let array = point.row.as_ref().and_then(|row| row.array.as_ref());
        for key in self.variables {
            let value = array.and_then(|array| array.values.get(key));
            self.cell(&Cell::Number(value.copied()));
        }
        for flag in extra {
            self.text(&flag.to_string());
        }
        self.end()
    }

    fn cell(&mut self, cell: &Cell<'_>) {
        match cell {
            Cell::Number(Some(value)) => self.number(*value),
            Cell::Count(Some(count)) => self.text(&count.to_string()),
            Cell::Flag(Some(flag)) => self.text(&flag.to_string()),
            Cell::Text(text) => self.text(text),
            Cell::Number(None) | Cell::Count(None) | Cell::Flag(None) => self.text(""),
        }
    }

    fn number(&mut self, value: f64) {
        push_number(&mut self.line, value);
        self.line.push(b',');
    }

    fn value(&mut self, value: &Value) {
        match value {
            Value::Number(value) => self.number(*value),
            other => self.text(&value_text(other)),
        }
    }

    /// A cell, quoted where it has to be.
    fn text(&mut self, text: &str) {
        if text.contains([',', '"', '\n', '\r']) {
            let quoted = text.replace('"', "\"\"");
            self.line
                .extend_from_slice(format!("\"{quoted}\"").as_bytes());
        } else {
            self.line.extend_from_slice(text.as_bytes());
        }
        self.line.push(b',');
    }

    fn end(&mut self) -> io::Result<()> {
        if let Some(last) = self.line.last_mut() {
            *last = b'\n';
        }
        self.out.write_all(&self.line)
    }
}

/// A value as a cell's text.
#[must_use]
pub fn value_text(value: &Value) -> String {
    match value {
        Value::Flag(flag) => flag.to_string(),
        Value::Number(number) => {
            let mut text = Vec::new();
            push_number(&mut text, *number);
            String::from_utf8_lossy(&text).into_owned()
        }
        Value::Text(text) => text.clone(),
        Value::List(values) => {
            let cells: Vec<String> = values.iter().map(value_text).collect();
            format!("[{}]", cells.join(","))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_have_a_cell_for_every_column() {
        let mut text = Vec::new();
        let mut table = TableWriter::begin(
            &mut text,
            columns(Mode::Evaluate, false),
            ["wire.diameter_mm", "a"],
            &[],
            &["front"],
        )
        .unwrap();
        let list = Value::List(vec![Value::Number(0.7), Value::Number(13.0)]);
        let failed = PointFile::new("abc", 7, Err("no \"coil\", no row".to_owned()));
        table
            .row(&[&Value::Number(0.55), &list], &failed, &[true])
            .unwrap();
        let text = String::from_utf8(text).unwrap();
        let (head, row) = text.split_once('\n').unwrap();
        assert!(head.starts_with("index,wire.diameter_mm,a,turns,resistance_ohm,"));
        assert_eq!(
            row,
            "7,0.55,\"[0.7,13]\",,,,,,,,,,,,,failed,\"no \"\"coil\"\", no row\",true\n"
        );
        assert_eq!(head.split(',').count(), 3 + ROW_COLUMNS.len() + 1);
    }
}
