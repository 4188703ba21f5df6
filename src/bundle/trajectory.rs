//! Trajectories: measured positions over time, as CSV.

use std::io::{self, Read, Write};

use super::read_table::{TableError, read_numbered};
use super::table::{Column, write_columns};

/// Columns of a trajectory.
pub(crate) const TRAJECTORY_COLUMNS: [&str; 4] = ["t_s", "x_m", "y_m", "z_m"];
/// Columns of a second finger.
const SECOND_COLUMNS: [&str; 3] = ["x2_m", "y2_m", "z2_m"];

/// Beyond this size of a time, s, or position, m, sums over rows are not finite.
const MOST: f64 = 1e30;

/// Positions of the magnet's centre over time, of one finger or two; times never decrease.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Trajectory {
    /// Time of each position, s.
    pub t_s: Vec<f64>,
    /// x, y, z, m.
    pub position_m: Vec<[f64; 3]>,
    /// The same of a second finger; empty without one.
    pub second_m: Vec<[f64; 3]>,
}

impl Trajectory {
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

    /// The positions of every finger, finger by finger.
    pub fn fingers(&self) -> impl Iterator<Item = &[[f64; 3]]> {
        let all = [self.position_m.as_slice(), &self.second_m];
        let count = if self.second_m.is_empty() { 1 } else { 2 };
        all.into_iter().take(count)
    }

    /// The median of the times between positions, s; 0 for a single one.
    #[must_use]
    pub fn median_step_s(&self) -> f64 {
        let mut steps: Vec<f64> = self.t_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
        steps.sort_by(f64::total_cmp);
        steps.get(steps.len() / 2).copied().unwrap_or(0.0)
    }

    /// How long each position is held: until the next one, the last for the median step, s.
    #[must_use]
    pub fn held_s(&self) -> Vec<f64> {
        let mut held: Vec<f64> = self.t_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
        if !self.is_empty() {
            held.push(self.median_step_s());
        }
        held
    }

    /// Reads a table with the columns `t_s,x_m,y_m,z_m`, of two fingers `x2_m,y2_m,z2_m` too.
    ///
    /// # Errors
    /// As [`super::read_table::read_columns`]; no rows; the first time that is smaller than the one
    /// before it; times and positions beyond 1e30.
    pub fn read(name: &str, source: impl Read) -> Result<Self, TableError> {
        let (columns, lines) = read_numbered(name, source, &TRAJECTORY_COLUMNS, &SECOND_COLUMNS)?;
        let t_s = &columns[0];
        if t_s.is_empty() {
            let fault = format!("{name}: holds no position; expected a row a measured position");
            return Err(TableError::one(fault));
        }
        if let Some(row) = (1..t_s.len()).find(|&row| t_s[row] < t_s[row - 1]) {
            return Err(TableError::one(format!(
                "{name}:{}: column t_s: time runs backwards, from {} to {}; sort the rows by time",
                lines[row],
                t_s[row - 1],
                t_s[row]
            )));
        }
        let names = TRAJECTORY_COLUMNS.iter().chain(&SECOND_COLUMNS);
        for (column, values) in names.zip(&columns) {
            if let Some(row) = values.iter().position(|value| value.abs() > MOST) {
                return Err(TableError::one(format!(
                    "{name}:{}: column {column}: {:e} is beyond {MOST:e}; times are in seconds, positions in metres",
                    lines[row], values[row]
                )));
            }
        }
        let finger = |axes: &[Vec<f64>]| match axes {
            [x, y, z] => (0..t_s.len()).map(|row| [x[row], y[row], z[row]]).collect(),
            _ => Vec::new(),
        };
        Ok(Self {
            position_m: finger(&columns[1..4]),
            second_m: finger(&columns[4..]),
            t_s: t_s.clone(),
        })
    }

    /// Writes such a table.
    ///
    /// # Errors
    /// The writer's.
    pub fn write(&self, out: &mut dyn Write) -> io::Result<()> {
        let axes = self.fingers().flat_map(|finger| {
            (0..3).map(|axis| -> Vec<f64> { finger.iter().map(|p| p[axis]).collect() })
        });
        let axes: Vec<_> = axes.collect();
        let values = std::iter::once(&self.t_s).chain(&axes);
        let names = TRAJECTORY_COLUMNS.into_iter().chain(SECOND_COLUMNS);
        let columns: Vec<(&str, Column)> = names
            .zip(values.map(|values| Column::Number(values)))
            .collect();
        write_columns(out, &columns)
    }
}

#[cfg(test)]
mod tests {
    use super::Trajectory;

    fn read(text: &str) -> Result<Trajectory, String> {
        Trajectory::read("finger.csv", text.as_bytes()).map_err(|error| error.to_string())
    }

    #[test]
    fn what_was_written_is_read_back() {
        let text =
            "note,t_s,x_m,y_m,z_m\na,0.7,0.01,-0.02,0.05\n\nb,0.7,0,0,0.06\nc,1.3,0.1,0.2,0.3\n";
        let found = read(text).unwrap();
        assert_eq!((found.len(), found.position_m[1]), (3, [0.0, 0.0, 0.06]));
        assert_eq!(found.held_s(), [0.0, 1.3 - 0.7, 1.3 - 0.7]);
        let mut written = Vec::new();
        found.write(&mut written).unwrap();
        assert_eq!(read(std::str::from_utf8(&written).unwrap()).unwrap(), found);
        let two = read("t_s,y2_m,x_m,y_m,z_m,x2_m,z2_m\n0,5,1,2,3,4,6\n").unwrap();
        assert_eq!(two.second_m, [[4.0, 5.0, 6.0]]);
        let mut written = Vec::new();
        two.write(&mut written).unwrap();
        assert_eq!(read(std::str::from_utf8(&written).unwrap()).unwrap(), two);
        let single = read("t_s,x_m,y_m,z_m\n3,0,0,0.05\n").unwrap();
        assert_eq!((single.median_step_s(), single.held_s()), (0.0, vec![0.0]));
    }

    #[test]
    fn faults_are_reported_with_their_line() {
        for (text, words) in [
            ("", "finger.csv: the table is empty; expected a header line"),
            (
                "t_s,x_m,y_m\n0,0,0\n",
                "finger.csv:1: column z_m is missing",
            ),
            ("t_s,x_m,y_m,z_m\n", "holds no position"),
            (
                "t_s,x_m,y_m,z_m,x2_m,y2_m\n0,0,0,0,0,0\n",
                "finger.csv:1: column z2_m is missing",
            ),
            (
                "t_s,x_m,y_m,z_m\n0,0,0,0.05\n0.02,nan,0,0.05\n",
                "finger.csv:3: column x_m: expected a finite number, found \"nan\"",
            ),
            (
                "t_s,x_m,y_m,z_m\n0.7,0,0,0.05\n0.7,0,0,0.05\n0.6,0,0,0.05\n",
                "finger.csv:4: column t_s: time runs backwards, from 0.7 to 0.6",
            ),
            (
                "t_s,x_m,y_m,z_m\n-1e308,0,0,0.05\n1e308,0,0,0.05\n",
                "finger.csv:2: column t_s: -1e308 is beyond 1e30",
            ),
            (
                "t_s,x_m,y_m,z_m\n0,0,0,0.05\n1,1e306,0,0.05\n",
                "finger.csv:3: column x_m: 1e306 is beyond 1e30",
            ),
        ] {
            let fault = read(text).unwrap_err();
            assert!(fault.contains(words), "{fault}");
        }
    }
}
