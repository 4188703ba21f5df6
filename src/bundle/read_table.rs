//! Reading CSV tables: columns by name, every fault reported with its line and column.

use std::io::Read;

use csv::{ByteRecord, ReaderBuilder, Trim};

use super::table::{CurrentRow, RowColumn};

/// No more faults than this are reported.
const MAX_FAULTS: usize = 5;

/// Faults of a table.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{}", .faults.join("\n"))]
pub struct TableError {
    /// One sentence a fault, each beginning with the file and line; never empty.
    pub faults: Vec<String>,
}

impl TableError {
    pub(super) fn one(fault: String) -> Self {
        Self {
            faults: vec![fault],
        }
    }
}

/// Larger tables are refused: a million positions take some 60 MB.
pub const TABLE_MAX_BYTES: u64 = 1 << 30;

/// The table's bytes, without a byte order mark.
fn whole(name: &str, source: impl Read) -> Result<Vec<u8>, TableError> {
    let mut text = Vec::new();
    source
        .take(TABLE_MAX_BYTES + 1)
        .read_to_end(&mut text)
        .map_err(|error| TableError::one(format!("{name}: cannot be read: {error}")))?;
    if text.len() as u64 > TABLE_MAX_BYTES {
        let fault = format!(
            "{name}: the table is larger than {TABLE_MAX_BYTES} bytes; is this the table? if so, \
             split it"
        );
        return Err(TableError::one(fault));
    }
    if text.starts_with(b"\xef\xbb\xbf") {
        text.drain(..3);
    }
    // A spreadsheet's "Unicode text"; without a mark every letter of the header has a byte of zeros.
    let header = text.split(|byte| *byte == b'\n').next().unwrap_or(&[]);
    if text.starts_with(b"\xff\xfe") || text.starts_with(b"\xfe\xff") || header.contains(&0) {
        let fault = format!(
            "{name}:1: the text is not UTF-8 but UTF-16, or no text; save the table as text: CSV in UTF-8"
        );
        return Err(TableError::one(fault));
    }
    Ok(text)
}

/// Lines of rows, from 1. The reader's own count is that before the blank lines above a row.
struct Line<'a> {
    text: &'a [u8],
    at: usize,
    line: u64,
}

impl<'a> Line<'a> {
    fn new(text: &'a [u8]) -> Self {
        Self {
            text,
            at: 0,
            line: 1,
        }
    }

    /// The line of the row that begins at `byte` or after the blank lines there; rows are requested
    /// in order.
    fn of_row(&mut self, byte: u64) -> u64 {
        let byte = usize::try_from(byte).unwrap_or(usize::MAX);
        while let Some(&found) = self.text.get(self.at) {
            let ends = found == b'\n' || found == b'\r';
            if self.at >= byte && !ends {
                break;
            }
            // CRLF is one end: its second half counts.
            let half = found == b'\r' && self.text.get(self.at + 1) == Some(&b'\n');
            self.line += u64::from(ends && !half);
            self.at += 1;
        }
        self.line
    }
}

/// Reads the requested columns of a CSV file, in the requested order; other columns are passed over.
/// A byte order mark, CRLF and blanks around cells are tolerated.
///
/// # Errors
/// Every missing or doubled column, or every cell that is not a finite number (the first five).
pub fn read_columns(
    name: &str,
    source: impl Read,
    expected: &[&str],
) -> Result<Vec<Vec<f64>>, TableError> {
    read_numbered(name, source, expected, &[]).map(|(columns, _)| columns)
}

/// As [`read_columns`], with the line of every row, for messages about what the numbers mean. The columns of
/// `group` follow where the table has any of them.
///
/// # Errors
/// As [`read_columns`].
pub(crate) fn read_numbered(
    name: &str,
    source: impl Read,
    expected: &[&str],
    group: &[&str],
) -> Result<(Vec<Vec<f64>>, Vec<u64>), TableError> {
    let text = whole(name, source)?;
    let separator = separated_by_commas(name, &text, expected);
    separator.map_or(Ok(()), |fault| Err(TableError::one(fault)))?;
    let mut reader = ReaderBuilder::new()
        .trim(Trim::All)
        .flexible(true)
        .from_reader(text.as_slice());
    let header: Vec<String> = reader
        .byte_headers()
        .map_err(|error| TableError::one(format!("{name}: cannot be read: {error}")))?
        .iter()
        .map(|cell| String::from_utf8_lossy(cell).into_owned())
        .collect();
    let grouped = group
        .iter()
        .any(|name| header.iter().any(|cell| cell == name));
    let expected = &[expected, if grouped { group } else { &[] }].concat();
    let places = find_columns(name, &header, expected)?;
    let mut columns = vec![Vec::new(); expected.len()];
    let mut lines = Vec::new();
    let mut faults = Vec::new();
    let mut more = 0usize;
    let mut record = ByteRecord::new();
    let mut place = Line::new(&text);
    loop {
        match reader.read_byte_record(&mut record) {
            Ok(false) => break,
            Ok(true) => {}
            Err(error) => {
                faults.push(format!("{name}: cannot be read: {error}"));
                break;
            }
        }
        let line = place.of_row(record.position().map_or(0, csv::Position::byte));
        let mut fault = |message: String| {
            if faults.len() < MAX_FAULTS {
                faults.push(format!("{name}:{line}: {message}"));
            } else {
                more += 1;
            }
        };
        if record.len() != header.len() {
            fault(other_cells(record.len(), header.len()));
            continue;
        }
        lines.push(line);
        for ((column, &place), expected) in columns.iter_mut().zip(&places).zip(expected) {
            let cell = std::str::from_utf8(&record[place]).unwrap_or("(not UTF-8)");
            match cell.parse::<f64>() {
                Ok(value) if value.is_finite() => column.push(value),
                _ => {
                    fault(not_a_number(expected, cell));
                }
            }
        }
    }
    if more > 0 {
        faults.push(format!("{name}: and {more} faults more"));
    }
    if faults.is_empty() {
        Ok((columns, lines))
    } else {
        Err(TableError { faults })
    }
}

fn other_cells(found: usize, expected: usize) -> String {
    let commas = if found == 2 * expected {
        "; write decimal points, 0.7 for 0,7"
    } else {
        ""
    };
    format!("{found} cells, expected {expected} as in the header{commas}")
}

fn not_a_number(column: &str, cell: &str) -> String {
    let shown: String = cell.chars().take(40).collect();
    let point = cell.replacen(',', ".", 1);
    let decimal = point != cell && point.parse::<f64>().is_ok();
    let advice = if decimal {
        format!("; write a decimal point, {point}")
    } else {
        String::new()
    };
    format!("column {column}: expected a finite number, found {shown:?}{advice}")
}

/// The fault of a table that is empty, or whose first line has the expected columns and another
/// separator than commas.
fn separated_by_commas(name: &str, text: &[u8], expected: &[&str]) -> Option<String> {
    let first = text
        .split(|byte| matches!(byte, b'\n' | b'\r'))
        .find(|line| !line.is_empty());
    let Some(first) = first else {
        let columns = expected.join(",");
        return Some(format!(
            "{name}: the table is empty; expected a header line with {columns}"
        ));
    };
    let line = String::from_utf8_lossy(first);
    let other = [(';', "semicolons"), ('\t', "tabs")]
        .into_iter()
        .find(|(separator, _)| {
            let cells: Vec<&str> = line.split(*separator).map(str::trim).collect();
            cells.len() > 1 && expected.iter().any(|column| cells.contains(column))
        });
    other.map(|(_, separators)| {
        format!(
            "{name}:1: the columns are separated by {separators}, expected commas; save it as CSV with \
             commas between the columns and decimal points in the numbers"
        )
    })
}

fn find_columns(
    name: &str,
    header: &[String],
    expected: &[&str],
) -> Result<Vec<usize>, TableError> {
    let mut places = Vec::new();
    let (mut faults, mut missing) = (Vec::new(), Vec::new());
    for column in expected {
        let mut found = header.iter().enumerate().filter(|(_, cell)| cell == column);
        match (found.next(), found.next()) {
            (Some((place, _)), None) => places.push(place),
            (Some(_), Some(_)) => faults.push(format!("{name}:1: column {column} appears twice")),
            (None, _) => missing.push(*column),
        }
    }
    if !missing.is_empty() {
        let shown: String = header.join(",").chars().take(120).collect();
        let (noun, are) = if missing.len() == 1 {
            ("column", "is")
        } else {
            ("columns", "are")
        };
        let in_mm = |column: &&str| {
            let stem = column.strip_suffix("_m")?;
            header.iter().find(|cell| **cell == format!("{stem}_mm"))
        };
        let cure = if missing.iter().any(|column| in_mm(column).is_some()) {
            "; lengths are in m: divide those in mm by 1000"
        } else if header.len() == 1 && shown.contains([';', '\t']) {
            "; columns are separated by commas"
        } else {
            ""
        };
        faults.push(format!(
            "{name}:1: {noun} {} {are} missing; expected a header line with {}, found {shown:?}{cure}",
            missing.join(", "),
            expected.join(",")
        ));
    }
    if faults.is_empty() {
        Ok(places)
    } else {
        Err(TableError { faults })
    }
}

/// Reads positions: columns `x_m,y_m,z_m`.
///
/// # Errors
/// As [`read_columns`].
pub fn read_positions(name: &str, source: impl Read) -> Result<Vec<[f64; 3]>, TableError> {
    let columns = read_columns(name, source, &["x_m", "y_m", "z_m"])?;
    Ok((0..columns[0].len())
        .map(|row| [columns[0][row], columns[1][row], columns[2][row]])
        .collect())
}

/// Reads the rows of a table, their columns by name.
///
/// # Errors
/// As [`read_columns`].
pub(crate) fn read_rows<R: Clone + Default>(
    name: &str,
    source: impl Read,
    columns: &[RowColumn<R>],
) -> Result<Vec<R>, TableError> {
    let (values, lines) = read_numbered(name, source, &names(columns), &[])?;
    Ok(rows(columns, &values, lines.len()))
}

fn names<R>(columns: &[RowColumn<R>]) -> Vec<&'static str> {
    columns.iter().map(|column| column.name).collect()
}

fn rows<R: Clone + Default>(columns: &[RowColumn<R>], values: &[Vec<f64>], count: usize) -> Vec<R> {
    let mut rows = vec![R::default(); count];
    for (column, values) in columns.iter().zip(values) {
        let Some(set) = column.set else { continue };
        for (row, value) in rows.iter_mut().zip(values) {
            set(row, *value);
        }
    }
    rows
}

/// Reads `currents.csv`; its rows must be the coils 0, 1, 2, ...
///
/// # Errors
/// As [`read_columns`].
pub(crate) fn read_currents(name: &str, source: impl Read) -> Result<Vec<CurrentRow>, TableError> {
    let columns = CurrentRow::COLUMNS;
    let (values, lines) = read_numbered(name, source, &names(columns), &[])?;
    let mut coils = values[0].iter().enumerate();
    if let Some((row, coil)) = coils.find(|(row, coil)| **coil != *row as f64) {
        let line = lines[row];
        let fault = format!("{name}:{line}: column coil: expected {row}, found {coil}");
        return Err(TableError::one(fault));
    }
    Ok(rows(columns, &values, lines.len()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::table::{PointRow, write_rows};

    #[test]
    fn what_was_written_is_read_back() {
        let points: Vec<PointRow> = (0..40)
            .map(|i| PointRow {
                x_m: 0.1 / (f64::from(i) + 0.7),
                y_m: -1e-7 * f64::from(i),
                height_m: 0.05,
                normal: [0.6, 0.0, 0.8],
            })
            .collect();
        let mut text = Vec::new();
        write_rows(&mut text, PointRow::COLUMNS, points.iter().copied()).unwrap();
        assert_eq!(
            read_rows("p", text.as_slice(), PointRow::COLUMNS).unwrap(),
            points
        );
        let currents: Vec<CurrentRow> = (0..9)
            .map(|coil| CurrentRow {
                coil,
                x_m: 0.05,
                y_m: -0.05,
                current_a: 0.7 * coil as f64,
            })
            .collect();
        let mut text = Vec::new();
        write_rows(&mut text, CurrentRow::COLUMNS, currents.iter().copied()).unwrap();
        assert_eq!(read_currents("c", text.as_slice()).unwrap(), currents);
        let text = String::from_utf8(text).unwrap().replace("\n3,", "\n4,");
        let error = read_currents("c", text.as_bytes()).unwrap_err();
        assert_eq!(error.to_string(), "c:5: column coil: expected 3, found 4");
    }

    #[test]
    fn tolerates_what_spreadsheets_do() {
        let text = "\u{feff}label, z_m ,x_m,y_m\r\n\"a, b\", 0.03 ,0.01,-0.02\r\n";
        assert_eq!(
            read_positions("p", text.as_bytes()).unwrap(),
            [[0.01, -0.02, 0.03]]
        );
    }

    #[test]
    fn lines_are_counted_past_blank_lines_and_with_every_line_end() {
        for end in ["\n", "\r\n", "\r"] {
            for mark in ["", "\u{feff}"] {
                let text = format!("{mark}x_m,y_m,z_m\n\n1,2,3\n\n\n1,bad,3\n\"1\",2,3\n1,2\n");
                let text = text.replace('\n', end);
                let error = read_positions("p.csv", text.as_bytes()).unwrap_err();
                assert!(
                    error.faults[0].starts_with("p.csv:6: column y_m"),
                    "{error}"
                );
                assert!(error.faults[1].starts_with("p.csv:8: 2 cells"), "{error}");
                let text = format!("{mark}coil,x_m,y_m,current_a\n0,1,1,1\n\n2,1,1,1\n");
                let error = read_currents("c.csv", text.replace('\n', end).as_bytes());
                assert!(
                    error
                        .unwrap_err()
                        .to_string()
                        .starts_with("c.csv:4: column coil")
                );
            }
        }
    }

    #[test]
    fn every_fault_has_its_line_and_column() {
        let text = "x_m,y_m,z_m\n0.1,0.2,0.3\n0.1,nan,0.3\n0.1,0.2\n1e999,0.2,three\n";
        let error = read_positions("p.csv", text.as_bytes()).unwrap_err();
        assert_eq!(
            error.faults,
            [
                "p.csv:3: column y_m: expected a finite number, found \"nan\"",
                "p.csv:4: 2 cells, expected 3 as in the header",
                "p.csv:5: column x_m: expected a finite number, found \"1e999\"",
                "p.csv:5: column z_m: expected a finite number, found \"three\"",
            ]
        );
        let error = read_positions("p.csv", "x_m,x_m,z\n".as_bytes()).unwrap_err();
        let header = "expected a header line with x_m,y_m,z_m, found \"x_m,x_m,z\"";
        let missing = format!("p.csv:1: columns y_m, z_m are missing; {header}");
        assert_eq!(
            error.faults,
            ["p.csv:1: column x_m appears twice", &missing]
        );
        let many = format!("x_m,y_m,z_m\n{}", "a,b,c\n".repeat(50));
        let error = read_positions("p.csv", many.as_bytes()).unwrap_err();
        assert_eq!(error.faults.len(), 6);
        assert_eq!(error.faults[5], "p.csv: and 145 faults more");
        assert!(read_positions("p.csv", "".as_bytes()).is_err());
        assert!(read_positions("p.csv", &b"\xff\xfe\x00,1\n"[..]).is_err());
    }
}
