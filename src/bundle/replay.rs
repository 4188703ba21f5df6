//! `replay.csv`: what a runtime commands at every position of a trajectory, and what it gives.

use std::io::{self, Write};
use strum::{EnumMessage, IntoStaticStr, VariantArray};

use super::number::push_number;
pub use fluxform_lambda::vector_feedback::angle_deg;

/// Rows are gathered to blocks of about this size.
const BLOCK_BYTES: usize = 64 << 10;

/// How a position was answered.
#[derive(Debug, Clone, Copy, PartialEq, Eq, EnumMessage, IntoStaticStr, VariantArray)]
#[strum(serialize_all = "lowercase")]
pub enum Answer {
    /// The force commanded is the requested one.
    Ok,
    /// The limits of the currents allow only the nearest force.
    Saturated,
    /// The position lies outside the map: no current, no force.
    Outside,
}

fluxform_base::choices!(Answer);

/// Force and error at one finger, one entry per position.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct FingerRows {
    /// m.
    pub position_m: Vec<[f64; 3]>,
    /// The height of the surface there, m; 0 where there is none.
    pub height_m: Vec<f64>,
    /// lambda h(x, y), N.
    pub wanted_force_n: Vec<f64>,
    /// Given with the currents that flow, N.
    pub force_n: Vec<f64>,
    /// Given with the bundle's fixed currents, N.
    pub static_force_n: Vec<f64>,
    /// Requested along x and y, N; empty where the upward force alone is requested, as the next.
    pub wanted_sideways_n: Vec<[f64; 2]>,
    /// Given along x and y, N.
    pub sideways_n: Vec<[f64; 2]>,
    /// How each position was answered.
    pub answer: Vec<Answer>,
}

impl FingerRows {
    /// Requested force minus the given one at a position (eq. 7), N.
    #[must_use]
    pub fn error_n(&self, row: usize) -> f64 {
        self.wanted_force_n[row] - self.force_n[row]
    }

    /// The same with the fixed currents, N.
    #[must_use]
    pub fn static_error_n(&self, row: usize) -> f64 {
        self.wanted_force_n[row] - self.static_force_n[row]
    }

    /// Angle between the given force and the requested one at a position, degrees; 0 where none is requested,
    /// 180 where none is given.
    #[must_use]
    pub fn direction_error_deg(&self, row: usize) -> f64 {
        let ([wx, wy], [fx, fy]) = (self.wanted_sideways_n[row], self.sideways_n[row]);
        angle_deg(
            [wx, wy, self.wanted_force_n[row]],
            [fx, fy, self.force_n[row]],
        )
    }

    /// The positions inside the map.
    pub fn inside(&self) -> impl Iterator<Item = usize> {
        let rows = self.answer.iter().enumerate();
        rows.filter(|(_, answer)| **answer != Answer::Outside)
            .map(|(row, _)| row)
    }
}

/// The columns of `replay.csv`, one entry per position; currents coil by coil within a position.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ReplayRows {
    /// Number of coils.
    pub coils: usize,
    /// s.
    pub t_s: Vec<f64>,
    /// The finger.
    pub first: FingerRows,
    /// Another one on the same array.
    pub second: Option<FingerRows>,
    /// Currents that flow, A.
    pub current_a: Vec<f64>,
    /// Currents that were commanded, A; empty where they are the same.
    pub commanded_a: Vec<f64>,
}

impl ReplayRows {
    /// Number of positions.
    #[must_use]
    pub fn len(&self) -> usize {
        self.t_s.len()
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.t_s.is_empty()
    }

    /// The fingers.
    pub fn fingers(&self) -> impl Iterator<Item = &FingerRows> {
        std::iter::once(&self.first).chain(&self.second)
    }

    /// The currents at a position, A.
    #[must_use]
    pub fn currents_a(&self, row: usize) -> &[f64] {
        &self.current_a[row * self.coils..(row + 1) * self.coils]
    }

    /// Writes the table.
    ///
    /// # Errors
    /// The writer's; `InvalidData` for a number that is not finite.
    pub fn write(&self, out: &mut dyn Write) -> io::Result<()> {
        let columns = self.columns();
        let mut block = self.names(&columns).join(",").into_bytes();
        block.push(b'\n');
        for row in 0..self.len() {
            for (column, finger, _) in &columns {
                match column.cells {
                    Cells::Number(value) => self.push(&mut block, row, value(self, row))?,
                    Cells::OfFinger(value) | Cells::OfVector(value) => {
                        self.push(&mut block, row, value(finger, row))?;
                    }
                    Cells::PerCoil(values) => {
                        let range = row * self.coils..(row + 1) * self.coils;
                        for value in &values(self)[range] {
                            self.push(&mut block, row, *value)?;
                        }
                    }
                    Cells::Word(word) => {
                        block.extend_from_slice(word(finger, row).as_bytes());
                        block.push(b',');
                    }
                }
            }
            if let Some(last) = block.last_mut() {
                *last = b'\n';
            }
            if block.len() >= BLOCK_BYTES {
                out.write_all(&block)?;
                block.clear();
            }
        }
        out.write_all(&block)
    }

    /// The columns that this table has, with their finger and its number: those of a second finger last.
    fn columns(&self) -> Vec<(&'static ReplayColumn, &FingerRows, usize)> {
        let mut columns = Vec::new();
        for (number, finger) in self.fingers().enumerate() {
            columns.extend(COLUMNS.iter().filter_map(|column| {
                let there = match column.cells {
                    Cells::Number(_) => number == 0,
                    // Currents that were commanded are left out where they are those that flow.
                    Cells::PerCoil(values) => number == 0 && !values(self).is_empty(),
                    Cells::OfFinger(_) | Cells::Word(_) => true,
                    Cells::OfVector(_) => !finger.sideways_n.is_empty(),
                };
                there.then_some((column, finger, number))
            }));
        }
        columns
    }

    /// The header's names.
    fn names(&self, columns: &[(&ReplayColumn, &FingerRows, usize)]) -> Vec<String> {
        let mut names = Vec::new();
        for (column, _, finger) in columns {
            match (column.cells, finger) {
                (Cells::PerCoil(_), _) => {
                    let name = |coil: usize| column.name.replace("{}", &coil.to_string());
                    names.extend((0..self.coils).map(name));
                }
                (_, 0) => names.push(column.name.to_owned()),
                // x2_m, wanted_force2_n, status2.
                _ => names.push(column.name.rsplit_once('_').map_or_else(
                    || format!("{}2", column.name),
                    |(quantity, unit)| format!("{quantity}2_{unit}"),
                )),
            }
        }
        names
    }

    fn push(&self, block: &mut Vec<u8>, row: usize, value: f64) -> io::Result<()> {
        if !value.is_finite() {
            let message = format!("row {row} of the replay is not finite");
            return Err(io::Error::new(io::ErrorKind::InvalidData, message));
        }
        // Minus nothing is nothing.
        push_number(block, value + 0.0);
        block.push(b',');
        Ok(())
    }
}

/// A column of `replay.csv`.
struct ReplayColumn {
    /// Its header; `{}` stands for the number of the coil.
    name: &'static str,
    cells: Cells,
}

#[derive(Clone, Copy)]
enum Cells {
    /// A number at every position.
    Number(fn(&ReplayRows, usize) -> f64),
    /// A number of each finger at every position.
    OfFinger(fn(&FingerRows, usize) -> f64),
    /// The same, where all three components of the force are requested.
    OfVector(fn(&FingerRows, usize) -> f64),
    /// A number for every coil at every position.
    PerCoil(fn(&ReplayRows) -> &[f64]),
    /// A word of each finger at every position.
    Word(fn(&FingerRows, usize) -> &'static str),
}

const fn number(name: &'static str, value: fn(&FingerRows, usize) -> f64) -> ReplayColumn {
    ReplayColumn {
        name,
        cells: Cells::OfFinger(value),
    }
}

const fn of_vector(name: &'static str, value: fn(&FingerRows, usize) -> f64) -> ReplayColumn {
    ReplayColumn {
        name,
        cells: Cells::OfVector(value),
    }
}

const fn per_coil(name: &'static str, values: fn(&ReplayRows) -> &[f64]) -> ReplayColumn {
    ReplayColumn {
        name,
        cells: Cells::PerCoil(values),
    }
}

/// The columns of `replay.csv`: the one place that names them.
const COLUMNS: &[ReplayColumn] = &[
    ReplayColumn {
        name: "t_s",
        cells: Cells::Number(|rows, at| rows.t_s[at]),
    },
    number("x_m", |rows, at| rows.position_m[at][0]),
    number("y_m", |rows, at| rows.position_m[at][1]),
    number("z_m", |rows, at| rows.position_m[at][2]),
    number("wanted_force_n", |rows, at| rows.wanted_force_n[at]),
    number("force_n", |rows, at| rows.force_n[at]),
    number("error_n", FingerRows::error_n),
    per_coil("current_{}_a", |rows| &rows.current_a),
    number("static_force_n", |rows, at| rows.static_force_n[at]),
    number("static_error_n", FingerRows::static_error_n),
    per_coil("commanded_{}_a", |rows| &rows.commanded_a),
    of_vector("wanted_x_n", |rows, at| rows.wanted_sideways_n[at][0]),
    of_vector("wanted_y_n", |rows, at| rows.wanted_sideways_n[at][1]),
    of_vector("force_x_n", |rows, at| rows.sideways_n[at][0]),
    of_vector("force_y_n", |rows, at| rows.sideways_n[at][1]),
    of_vector("direction_error_deg", FingerRows::direction_error_deg),
    ReplayColumn {
        name: "status",
        cells: Cells::Word(|rows, at| rows.answer[at].name()),
    },
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_a_position_with_its_status() {
        let mut rows = ReplayRows {
            coils: 2,
            t_s: vec![0.0, 0.02],
            first: FingerRows {
                position_m: vec![[0.01, -0.02, 0.05], [0.07, 0.0, 0.05]],
                height_m: vec![0.05, 0.0],
                wanted_force_n: vec![0.3, 0.0],
                force_n: vec![0.25, -0.0],
                static_force_n: vec![0.3, 0.0],
                answer: vec![Answer::Saturated, Answer::Outside],
                ..FingerRows::default()
            },
            second: None,
            current_a: vec![0.7, 1.3, 0.0, 0.0],
            commanded_a: Vec::new(),
        };
        let text = |rows: &ReplayRows| {
            let mut text = Vec::new();
            rows.write(&mut text)
                .map(|()| String::from_utf8(text).unwrap())
        };
        assert_eq!(
            text(&rows).unwrap(),
            "t_s,x_m,y_m,z_m,wanted_force_n,force_n,error_n,current_0_a,current_1_a,\
             static_force_n,static_error_n,status\n\
             0,0.01,-0.02,0.05,0.3,0.25,0.04999999999999999,0.7,1.3,0.3,0,saturated\n\
             0.02,0.07,0,0.05,0,0,0,0,0,0,0,outside\n"
        );
        rows.commanded_a = vec![1.0; 4];
        let header = text(&rows).unwrap();
        assert!(header.contains("static_error_n,commanded_0_a,commanded_1_a,status\n"));
        rows.commanded_a.clear();
        rows.second = Some(rows.first.clone());
        let two = text(&rows).unwrap();
        assert!(
            two.contains(
                "static_error_n,status,x2_m,y2_m,z2_m,wanted_force2_n,force2_n,error2_n,static_force2_n,\
                 static_error2_n,status2\n"
            ),
            "{two}"
        );
        rows.second = None;
        rows.first.wanted_sideways_n = vec![[0.0, 0.0]; 2];
        rows.first.sideways_n = vec![[0.0, -0.25], [0.0, 0.0]];
        let vectors = text(&rows).unwrap();
        assert!(vectors.contains(
            "static_error_n,wanted_x_n,wanted_y_n,force_x_n,force_y_n,direction_error_deg,status\n"
        ));
        assert!(vectors.contains(",0,0,0,-0.25,45,saturated\n"), "{vectors}");
        rows.first.force_n[0] = f64::NAN;
        assert!(text(&rows).is_err());
        let page = include_str!("../../results/README.md");
        for column in COLUMNS {
            let name = column.name.replace("{}", "0");
            assert!(page.contains(&name), "{name}");
        }
    }
}
