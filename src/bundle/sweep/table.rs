//! The table of a sweep: one row a point, the set keys beside the results.

use std::io::{self, Write};

use super::{Mode, OptimumRow, PointFile, Value};
use crate::number::{push_index, push_number};

/// Columns after `index` and the set keys. Cells that do not apply are empty.
pub const ROW_COLUMNS: [&str; 14] = [
    "turns",
    "resistance_ohm",
    "inductance_h",
    "settling_s",
    "power_w",
    "mass_kg",
    "wire_length_m",
    "current_a",
    "gradient_t_per_m_per_a",
    "force_n",
    "core_peak_field_t",
    "limits_met",
    "status",
    "message",
];

/// Columns after those of a sweep that optimises.
pub const OPTIMUM_COLUMNS: [&str; 8] = [
    "best_inner_diameter_m",
    "best_outer_diameter_m",
    "best_length_m",
    "best_wire_diameter_m",
    "best_layers",
    "best_turns_per_layer",
    "certificate",
    "upper_bound_n",
];

/// Writes rows as they come.
pub struct TableWriter<'a> {
    out: &'a mut dyn Write,
    optimum: bool,
    line: Vec<u8>,
}

impl<'a> TableWriter<'a> {
    /// Writes the header, with [`OPTIMUM_COLUMNS`] for a `mode` that optimises; `extra` are columns
    /// after all others, given to every row.
    ///
    /// # Errors
    /// The writer's.
    pub fn begin<'k>(
        out: &'a mut dyn Write,
        mode: Mode,
        keys: impl IntoIterator<Item = &'k str>,
        extra: &[&'k str],
    ) -> io::Result<Self> {
        let mut table = Self {
            out,
            optimum: mode != Mode::Evaluate,
            line: Vec::new(),
        };
        let found: &[&str] = if table.optimum { &OPTIMUM_COLUMNS } else { &[] };
        table.text("index");
        for key in keys
            .into_iter()
            .chain(ROW_COLUMNS)
            .chain(found.iter().copied())
            .chain(extra.iter().copied())
        {
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
        match &point.row {
            Some(row) => {
                for number in [
                    row.turns,
                    row.resistance_ohm,
                    row.inductance_h,
                    row.settling_s,
                    row.power_w,
                    row.mass_kg,
                    row.wire_length_m,
                    row.current_a,
                    row.gradient_t_per_m_per_a,
                    row.force_n,
                ] {
                    self.number(number);
                }
                match row.core_peak_field_t {
                    Some(field_t) => self.number(field_t),
                    None => self.text(""),
                }
                self.text(if row.limits_met { "true" } else { "false" });
            }
            None => {
                for _ in 0..ROW_COLUMNS.len() - 2 {
                    self.text("");
                }
            }
        }
        self.text(point.status.name());
        self.text(point.message.as_deref().unwrap_or(""));
        if self.optimum {
            self.optimum(point.row.as_ref().and_then(|row| row.optimum.as_ref()));
        }
        for flag in extra {
            self.text(if *flag { "true" } else { "false" });
        }
        self.end()
    }

    fn optimum(&mut self, found: Option<&OptimumRow>) {
        let Some(found) = found else {
            OPTIMUM_COLUMNS.iter().for_each(|_| self.text(""));
            return;
        };
        for length_m in [
            found.inner_diameter_m,
            found.outer_diameter_m,
            found.length_m,
            found.wire_diameter_m,
        ] {
            self.number(length_m);
        }
        for whole in [found.layers, found.turns_per_layer] {
            self.text(&whole.map_or_else(String::new, |whole| whole.to_string()));
        }
        self.text(found.certificate.name());
        match found.upper_bound_n {
            Some(bound_n) => self.number(bound_n),
            None => self.text(""),
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
            Mode::Evaluate,
            ["wire.diameter_mm", "a"],
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
