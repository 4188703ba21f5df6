//! The table of a magnetisation curve, read from CSV: its shape, its numbers, its order.
//!
//! Whether the points are a curve that a steel can have is for the curve made of them to say.

use std::ops::Range;
use std::path::Path;

use csv::{ReaderBuilder, StringRecord, Trim};

use super::diagnostics::{Fault, Faults, InvalidDocument, place_of};
use super::message_text::{number, token};
use super::source;

/// The columns, in the order of the usual header.
const COLUMNS: [&str; 2] = ["b_t", "h_a_per_m"];

/// At most so many faults of one table are reported.
const FAULTS_MAX: usize = 20;
/// After so many faults reading stops.
const FOUND_MAX: usize = 1000;

/// The points of a magnetisation curve, both columns growing.
#[derive(Debug, Clone, PartialEq)]
pub struct BhTable {
    /// Flux density B, T.
    pub b_t: Vec<f64>,
    /// Field H, A/m.
    pub h_a_per_m: Vec<f64>,
}

/// The table in the CSV file `path`.
///
/// # Errors
/// As [`BhTable::from_csv`], or why the file cannot be read: missing, a directory, over 4 MiB,
/// not in UTF-8.
pub fn read_bh_table(path: &Path) -> Result<BhTable, InvalidDocument> {
    BhTable::from_csv(&source::table_text_of(path)?, path)
}

impl BhTable {
    /// The table that `text` holds; `path` names it in messages.
    ///
    /// One header line `b_t,h_a_per_m` (either order), then one row per point. A byte order mark,
    /// CRLF, empty lines and blanks around cells are tolerated.
    ///
    /// # Errors
    /// A header with other columns; rows with other than two cells or with something that is no
    /// finite number; a column that does not grow; no rows. Each with its line, the first twenty.
    pub fn from_csv(text: &str, path: &Path) -> Result<Self, InvalidDocument> {
        // A byte order mark would count as a column.
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        let mut faults = Vec::new();
        let table = read(text, &mut faults);
        if faults.is_empty() {
            return Ok(table);
        }
        let stopped = if faults.len() < FOUND_MAX {
            ""
        } else {
            "at least "
        };
        let more = faults.len().saturating_sub(FAULTS_MAX);
        faults.truncate(FAULTS_MAX);
        if more > 0 {
            faults.push(
                Fault::error("", format!("and {stopped}{more} faults more"))
                    .at(&(text.len()..text.len())),
            );
        }
        Err(InvalidDocument {
            faults: Faults::new(path, text, faults),
        })
    }
}

fn read(text: &str, faults: &mut Vec<Fault>) -> BhTable {
    let mut table = BhTable {
        b_t: Vec::new(),
        h_a_per_m: Vec::new(),
    };
    let mut reader = ReaderBuilder::new()
        .has_headers(false)
        .trim(Trim::All)
        .flexible(true)
        .from_reader(text.as_bytes());
    let mut record = StringRecord::new();
    let mut order = None;
    let mut before: Option<([f64; 2], usize)> = None;
    // A table that is wrong throughout is not read to its end.
    while faults.len() < FOUND_MAX {
        match reader.read_record(&mut record) {
            Ok(true) => {}
            Ok(false) => break,
            Err(error) => {
                faults.push(Fault::error("", format!("cannot be read as CSV: {error}")));
                return table;
            }
        }
        let span = span_of(text, &record);
        let Some(order) = order else {
            order = header(&record, &span, faults);
            if order.is_none() {
                return table;
            }
            continue;
        };
        let Some(row) = row(&record, order, &span, faults) else {
            continue;
        };
        if let Some((last, last_start)) = before {
            let line = || place_of(text, last_start).line;
            grows(row, last, line, &span, faults);
        }
        before = Some((row, span.start));
        table.b_t.push(row[0]);
        table.h_a_per_m.push(row[1]);
    }
    if order.is_none() {
        faults.push(
            Fault::error("", "the table is empty").help(
                "begin with the line b_t,h_a_per_m, then one row per point: B in T, H in A/m",
            ),
        );
    } else if table.b_t.is_empty() && faults.is_empty() {
        let fault = Fault::error("", "the table has a header but no rows");
        faults.push(fault.help("add one row per point, beginning with 0,0"));
    }
    table
}

/// Bytes of the record's text, without the line ends before it.
fn span_of(text: &str, record: &StringRecord) -> Range<usize> {
    let at = record.position().map_or(0, |p| p.byte() as usize);
    let rest = text.get(at..).unwrap_or("");
    let start = at + rest.len() - rest.trim_start_matches(['\r', '\n']).len();
    let rest = text.get(start..).unwrap_or("");
    let end = start + rest.find(['\r', '\n']).unwrap_or(rest.len());
    start..end
}

/// The places of the two columns; none, and a fault, where the header is another one.
fn header(
    record: &StringRecord,
    span: &Range<usize>,
    faults: &mut Vec<Fault>,
) -> Option<[usize; 2]> {
    let place = |name: &str| record.iter().position(|cell| cell == name);
    if let (2, Some(b), Some(h)) = (record.len(), place(COLUMNS[0]), place(COLUMNS[1])) {
        return Some([b, h]);
    }
    let found = |marks: &[char]| record.iter().any(|cell| cell.contains(marks));
    let help = if record.iter().all(|cell| cell.parse::<f64>().is_ok()) {
        "the header line is missing: add it before the first row"
    } else if found(&[';', '\t']) {
        "separate the columns by commas, and write decimals with a point"
    } else {
        "two columns, B in T and H in A/m, with these names"
    };
    // The file is whatever a document names: no more than a word of it is shown.
    let strange = record.iter().find(|cell| !COLUMNS.contains(cell));
    let columns = match record.len() {
        1 => "1 column".to_owned(),
        many => format!("{many} columns"),
    };
    let message = format!(
        "expected the header line \"b_t,h_a_per_m\", found {columns} and {}",
        token(strange.unwrap_or(&record[0]))
    );
    faults.push(Fault::error("", message).at(span).help(help));
    None
}

/// B and H of a row; none, and its faults, where it holds anything else.
fn row(
    record: &StringRecord,
    order: [usize; 2],
    span: &Range<usize>,
    faults: &mut Vec<Fault>,
) -> Option<[f64; 2]> {
    if record.len() != COLUMNS.len() {
        let message = format!("expected two cells, B and H, found {}", record.len());
        let help = "separate by commas, and write decimals with a point";
        faults.push(Fault::error("", message).at(span).help(help));
        return None;
    }
    let mut values = [f64::NAN; 2];
    for ((value, place), name) in values.iter_mut().zip(order).zip(COLUMNS) {
        let cell = &record[place];
        match cell.parse::<f64>() {
            Ok(found) if found.is_finite() => *value = found,
            _ => {
                let message = format!("expected a finite number, found {}", token(cell));
                faults.push(Fault::error(name, message).at(span));
            }
        }
    }
    values.iter().all(|v| v.is_finite()).then_some(values)
}

/// A fault for each column that is not larger than in the row before.
fn grows(
    row: [f64; 2],
    last: [f64; 2],
    last_line: impl Fn() -> usize,
    span: &Range<usize>,
    faults: &mut Vec<Fault>,
) {
    for ((now, then), name) in row.into_iter().zip(last).zip(COLUMNS) {
        if now <= then {
            let message = format!(
                "expected more than the {} of line {}, found {}",
                number(then),
                last_line(),
                number(now)
            );
            let help = "sort the rows by B, and keep one of equal ones";
            faults.push(Fault::error(name, message).at(span).help(help));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<BhTable, String> {
        BhTable::from_csv(text, Path::new("s.csv")).map_err(|invalid| invalid.faults.plain())
    }

    fn said(text: &str) -> Vec<String> {
        let lines = read(text).unwrap_err();
        lines.lines().map(str::to_owned).collect()
    }

    #[test]
    fn tables_as_programs_and_spreadsheets_write_them() {
        let requested = BhTable {
            b_t: vec![0.0, 0.7, 1.3],
            h_a_per_m: vec![0.0, 170.0, 1300.0],
        };
        for text in [
            "b_t,h_a_per_m\n0,0\n0.7,170\n1.3,1300\n",
            "b_t,h_a_per_m\n0,0\n0.7,170\n1.3,1300",
            "\u{feff}b_t,h_a_per_m\r\n0,0\r\n0.7,170\r\n1.3,1300\r\n",
            "\n b_t , h_a_per_m\n\n0,0\n\n\n 0.7 ,170\n\"1.3\",1.3e3\n\n",
            "h_a_per_m,b_t\n0,0\n170,0.7\n1300,1.3\n",
        ] {
            assert_eq!(read(text), Ok(requested.clone()), "{text:?}");
        }
    }

    #[test]
    fn the_header_is_required_as_it_is() {
        let help = "two columns, B in T and H in A/m, with these names";
        let expected = "s.csv:1:1: error: expected the header line \"b_t,h_a_per_m\", found";
        assert_eq!(
            said("B,H\n0,0\n"),
            [format!("{expected} 2 columns and \"B\" ({help})")]
        );
        assert_eq!(
            said("b_t,h_a_per_m,mu\n0,0,1\n"),
            [format!("{expected} 3 columns and \"mu\" ({help})")]
        );
        assert_eq!(
            said("b_t,b_t\n0,0\n"),
            [format!("{expected} 2 columns and \"b_t\" ({help})")]
        );
        assert_eq!(
            said("0,0\n0.7,170\n"),
            [format!(
                "{expected} 2 columns and \"0\" (the header line is missing: add it before the first row)"
            )]
        );
        assert_eq!(
            said("b_t;h_a_per_m\n0;0\n0,7;170\n"),
            [format!(
                "{expected} 1 column and \"b_t;h_a_per_m\" (separate the columns by commas, and write decimals with a point)"
            )]
        );
        let long = said(&"x,".repeat(50_000));
        assert!(long[0].len() < 300, "{long:?}");
    }

    #[test]
    fn every_row_s_fault_has_its_line() {
        let text = "b_t,h_a_per_m\n0,0\n0.7,1l0\n\n0.9,200,1\n1.1\nnan,-inf\n1.3,1300\n1.3,1200\n1.4,1500\n";
        assert_eq!(
            said(text),
            [
                "s.csv:3:1: error: h_a_per_m: expected a finite number, found \"1l0\"",
                "s.csv:5:1: error: expected two cells, B and H, found 3 (separate by commas, and write decimals with a point)",
                "s.csv:6:1: error: expected two cells, B and H, found 1 (separate by commas, and write decimals with a point)",
                "s.csv:7:1: error: b_t: expected a finite number, found \"nan\"",
                "s.csv:7:1: error: h_a_per_m: expected a finite number, found \"-inf\"",
                "s.csv:9:1: error: b_t: expected more than the 1.3 of line 8, found 1.3 (sort the rows by B, and keep one of equal ones)",
                "s.csv:9:1: error: h_a_per_m: expected more than the 1300 of line 8, found 1200 (sort the rows by B, and keep one of equal ones)",
            ]
        );
        let many = said(&format!("b_t,h_a_per_m\n{}", "a,b\n".repeat(70)));
        assert_eq!(many.len(), 21);
        assert!(many[20].ends_with("and 120 faults more"), "{}", many[20]);
    }

    #[test]
    fn a_table_has_rows() {
        for text in ["", "\u{feff}", "\n\r\n"] {
            assert_eq!(
                said(text),
                [
                    "s.csv: error: the table is empty (begin with the line b_t,h_a_per_m, then one row per point: B in T, H in A/m)"
                ]
            );
        }
        assert_eq!(
            said("b_t,h_a_per_m\n"),
            [
                "s.csv: error: the table has a header but no rows (add one row per point, beginning with 0,0)"
            ]
        );
    }

    #[test]
    fn the_file_itself_may_be_at_fault() {
        let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."));
        let why = |path: &Path| read_bh_table(path).unwrap_err().faults.plain();
        assert!(why(folder).contains("expected a CSV table, found a directory"));
        assert!(why(&folder.join("no_such.csv")).contains("cannot read the file"));
        let table = read_bh_table(&folder.join("designs/steel_1010.csv")).unwrap();
        assert_eq!((table.b_t.len(), table.h_a_per_m[37]), (38, 316_804.0));
    }
}
