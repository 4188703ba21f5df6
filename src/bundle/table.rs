//! CSV tables: one header line, LF, decimal point, shortest round-trip numbers, no comments.

use std::io::{self, Write};

use super::number::{push_index, push_number};

/// Rows are gathered to blocks of about this size.
const BLOCK_BYTES: usize = 64 << 10;

/// Columns of field components, T/A.
pub const FIELD_COLUMNS: [&str; 3] = ["bx_t_per_a", "by_t_per_a", "bz_t_per_a"];

/// How rows of [`write_samples`] begin.
pub const SAMPLE_COLUMNS: [&str; 4] = ["x_m", "y_m", "z_m", "coil"];

/// Columns of gradient components, T/m/A: field component, then direction.
pub const GRADIENT_COLUMNS: [&str; 9] = [
    "dbx_dx_t_per_m_per_a",
    "dbx_dy_t_per_m_per_a",
    "dbx_dz_t_per_m_per_a",
    "dby_dx_t_per_m_per_a",
    "dby_dy_t_per_m_per_a",
    "dby_dz_t_per_m_per_a",
    "dbz_dx_t_per_m_per_a",
    "dbz_dy_t_per_m_per_a",
    "dbz_dz_t_per_m_per_a",
];

/// Columns of the force on the magnet and the torque about its centre, N/A and N m/A.
pub const FORCE_COLUMNS: [&str; 6] = [
    "force_x_n_per_a",
    "force_y_n_per_a",
    "force_z_n_per_a",
    "torque_x_n_m_per_a",
    "torque_y_n_m_per_a",
    "torque_z_n_m_per_a",
];

/// A column of a table whose rows are `R`: the one place that names it. Writers, readers and the
/// tests of the documents go through these.
pub struct RowColumn<R> {
    /// Its header.
    pub name: &'static str,
    /// Its SI unit; empty for counts, flags and directions.
    pub unit: &'static str,
    /// A row's value.
    pub get: fn(&R) -> f64,
    /// Sets it in a row that is read; `None` in tables that are only written.
    pub set: Option<fn(&mut R, f64)>,
}

impl<R> RowColumn<R> {
    /// A column of a table that is only written.
    pub const fn written(name: &'static str, unit: &'static str, get: fn(&R) -> f64) -> Self {
        Self {
            name,
            unit,
            get,
            set: None,
        }
    }

    /// A column of a table that is read back.
    const fn stored(
        name: &'static str,
        unit: &'static str,
        get: fn(&R) -> f64,
        set: fn(&mut R, f64),
    ) -> Self {
        Self {
            name,
            unit,
            get,
            set: Some(set),
        }
    }
}

/// A constraint point: a row of `points.csv`.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct PointRow {
    /// m.
    pub x_m: f64,
    /// m.
    pub y_m: f64,
    /// Height of the surface above the windings' top face, m.
    pub height_m: f64,
    /// Unit normal, its z component not negative.
    pub normal: [f64; 3],
}

impl PointRow {
    /// The columns of `points.csv`.
    pub const COLUMNS: &[RowColumn<Self>] = &[
        RowColumn::stored("x_m", "m", |p| p.x_m, |p, v| p.x_m = v),
        RowColumn::stored("y_m", "m", |p| p.y_m, |p, v| p.y_m = v),
        RowColumn::stored("height_m", "m", |p| p.height_m, |p, v| p.height_m = v),
        RowColumn::stored("normal_x", "", |p| p.normal[0], |p, v| p.normal[0] = v),
        RowColumn::stored("normal_y", "", |p| p.normal[1], |p, v| p.normal[1] = v),
        RowColumn::stored("normal_z", "", |p| p.normal[2], |p, v| p.normal[2] = v),
    ];
}

/// A coil's static current: a row of `currents.csv`.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct CurrentRow {
    /// Index of the coil in the array.
    pub coil: usize,
    /// Position of its axis, m.
    pub x_m: f64,
    /// Position of its axis, m.
    pub y_m: f64,
    /// A.
    pub current_a: f64,
}

impl CurrentRow {
    /// The columns of `currents.csv`.
    pub const COLUMNS: &[RowColumn<Self>] = &[
        RowColumn::stored("coil", "", |c| c.coil as f64, |c, v| c.coil = v as usize),
        RowColumn::stored("x_m", "m", |c| c.x_m, |c, v| c.x_m = v),
        RowColumn::stored("y_m", "m", |c| c.y_m, |c, v| c.y_m = v),
        RowColumn::stored("current_a", "A", |c| c.current_a, |c, v| c.current_a = v),
    ];
}

/// A column of a table.
#[derive(Debug, Clone, Copy)]
pub enum Column<'a> {
    /// Real numbers.
    Number(&'a [f64]),
    /// Whole numbers.
    Index(&'a [i64]),
}

impl Column<'_> {
    fn len(&self) -> usize {
        match self {
            Self::Number(values) => values.len(),
            Self::Index(values) => values.len(),
        }
    }
}

/// Writes named columns of equal length.
///
/// # Errors
/// The writer's; `InvalidData` for columns of different lengths and for numbers that are not finite.
pub fn write_columns(out: &mut dyn Write, columns: &[(&str, Column)]) -> io::Result<()> {
    let rows = columns.first().map_or(0, |(_, column)| column.len());
    if let Some((name, column)) = columns.iter().find(|(_, column)| column.len() != rows) {
        let message = format!("column {name} has {} rows, expected {rows}", column.len());
        return Err(invalid(message));
    }
    let mut lines = Lines::begin(out, columns.iter().map(|(name, _)| *name))?;
    for row in 0..rows {
        for (_, column) in columns {
            match column {
                Column::Number(values) => lines.number(values[row])?,
                Column::Index(values) => lines.index(values[row]),
            }
        }
        lines.end_row()?;
    }
    lines.finish()
}

/// Writes rows in their order, all their columns in that of the table.
///
/// # Errors
/// As [`write_columns`].
pub fn write_rows<R>(
    out: &mut dyn Write,
    columns: &[RowColumn<R>],
    rows: impl IntoIterator<Item = R>,
) -> io::Result<()> {
    let none: [RowColumn<()>; 0] = [];
    let rows = rows.into_iter().map(|row| (row, ()));
    write_joined_rows(out, columns, none, rows)
}

/// As [`write_rows`], for rows of two parts: the columns of the first, then those of the second.
///
/// # Errors
/// As [`write_columns`].
pub fn write_joined_rows<A, B>(
    out: &mut dyn Write,
    first: &[RowColumn<A>],
    second: impl AsRef<[RowColumn<B>]>,
    rows: impl IntoIterator<Item = (A, B)>,
) -> io::Result<()> {
    let second = second.as_ref();
    let names = first.iter().map(|column| column.name);
    let names = names.chain(second.iter().map(|column| column.name));
    let mut lines = Lines::begin(out, names)?;
    for (a, b) in rows {
        for column in first {
            lines.number((column.get)(&a))?;
        }
        for column in second {
            lines.number((column.get)(&b))?;
        }
        lines.end_row()?;
    }
    lines.finish()
}

/// Writes samples of every coil at every point: rows in the points' order, coil by coil within a
/// point. `values` gives the numbers of (position in `points`, position in `coils`).
///
/// # Errors
/// As [`write_columns`].
pub fn write_samples<V: AsRef<[f64]>>(
    out: &mut dyn Write,
    columns: &[&str],
    points: impl Iterator<Item = [f64; 3]>,
    coils: &[i64],
    mut values: impl FnMut(usize, usize) -> V,
) -> io::Result<()> {
    let mut lines = Lines::begin(out, SAMPLE_COLUMNS.iter().chain(columns).copied())?;
    // Positions and coils are formatted once, not once a row.
    let coil_cells: Vec<Vec<u8>> = coils
        .iter()
        .map(|&coil| {
            let mut cell = Vec::new();
            push_index(&mut cell, coil);
            cell.push(b',');
            cell
        })
        .collect();
    let mut position = Vec::new();
    for (index, point) in points.enumerate() {
        let start = lines.block.len();
        for value in point {
            lines.number(value)?;
        }
        position.clear();
        position.extend_from_slice(&lines.block[start..]);
        lines.block.truncate(start);
        for (place, cell) in coil_cells.iter().enumerate() {
            lines.block.extend_from_slice(&position);
            lines.block.extend_from_slice(cell);
            for &value in values(index, place).as_ref() {
                lines.number(value)?;
            }
            lines.end_row()?;
        }
    }
    lines.finish()
}

/// Lines in the making; every cell ends with a comma until its row ends.
struct Lines<'a> {
    out: &'a mut dyn Write,
    block: Vec<u8>,
}

impl<'a> Lines<'a> {
    fn begin<'n>(
        out: &'a mut dyn Write,
        names: impl IntoIterator<Item = &'n str>,
    ) -> io::Result<Self> {
        let mut block = Vec::with_capacity(BLOCK_BYTES + 4096);
        for name in names {
            block.extend_from_slice(name.as_bytes());
            block.push(b',');
        }
        let mut lines = Self { out, block };
        lines.end_row()?;
        Ok(lines)
    }

    fn number(&mut self, value: f64) -> io::Result<()> {
        if !value.is_finite() {
            return Err(invalid("a number is not finite"));
        }
        push_number(&mut self.block, value);
        self.block.push(b',');
        Ok(())
    }

    fn index(&mut self, value: i64) {
        push_index(&mut self.block, value);
        self.block.push(b',');
    }

    fn end_row(&mut self) -> io::Result<()> {
        if let Some(last) = self.block.last_mut() {
            *last = b'\n';
        }
        if self.block.len() >= BLOCK_BYTES {
            self.out.write_all(&self.block)?;
            self.block.clear();
        }
        Ok(())
    }

    fn finish(self) -> io::Result<()> {
        self.out.write_all(&self.block)
    }
}

fn invalid(message: impl Into<String>) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, message.into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_currents_and_columns() {
        let mut text = Vec::new();
        let point = PointRow {
            x_m: -0.05,
            y_m: 1e-6,
            height_m: 0.05,
            normal: [0.0, 0.6, 0.8],
        };
        write_rows(&mut text, PointRow::COLUMNS, [point]).unwrap();
        let mut row = CurrentRow {
            coil: 7,
            x_m: 0.05,
            y_m: 0.0,
            current_a: 1.3,
        };
        write_rows(&mut text, CurrentRow::COLUMNS, [row]).unwrap();
        write_columns(
            &mut text,
            &[
                ("t_s", Column::Number(&[0.7, 30.0])),
                ("coil", Column::Index(&[3, -1])),
            ],
        )
        .unwrap();
        assert_eq!(
            String::from_utf8(text).unwrap(),
            "x_m,y_m,height_m,normal_x,normal_y,normal_z\n-0.05,1e-6,0.05,0,0.6,0.8\n\
             coil,x_m,y_m,current_a\n7,0.05,0,1.3\nt_s,coil\n0.7,3\n30,-1\n"
        );
        row.current_a = f64::NAN;
        let error = write_rows(&mut Vec::new(), CurrentRow::COLUMNS, [row]).unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::InvalidData);
        let uneven = [("a", Column::Number(&[0.7])), ("b", Column::Index(&[]))];
        assert!(write_columns(&mut Vec::new(), &uneven).is_err());
    }

    fn names<R>(columns: &[RowColumn<R>]) -> String {
        let names: Vec<&str> = columns.iter().map(|column| column.name).collect();
        names.join(",")
    }

    #[test]
    fn the_page_of_bundles_names_every_column_and_names_end_in_their_units() {
        let page = include_str!("../../results/README.md");
        for names in [names(PointRow::COLUMNS), names(CurrentRow::COLUMNS)] {
            assert!(page.contains(&format!("`{names}`")), "{names}");
        }
        let points = PointRow::COLUMNS.iter().map(|c| (c.name, c.unit));
        let currents = CurrentRow::COLUMNS.iter().map(|c| (c.name, c.unit));
        for (name, unit) in points.chain(currents).filter(|(_, unit)| !unit.is_empty()) {
            assert!(
                name.ends_with(&format!("_{}", unit.to_lowercase())),
                "{name}"
            );
        }
    }
}
