//! `replay.csv`: what a runtime commands at every position of a trajectory, and what it gives.

use std::io::{self, Write};

use super::number::push_number;

/// Rows are gathered to blocks of about this size.
const BLOCK_BYTES: usize = 64 << 10;

/// How a position was answered.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Answer {
    /// The force commanded is the requested one.
    Ok,
    /// The limits of the currents allow only the nearest force.
    Saturated,
    /// The position lies outside the map: no current, no force.
    Outside,
}

impl Answer {
    /// The word in the column `status`.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Ok => "ok",
            Self::Saturated => "saturated",
            Self::Outside => "outside",
        }
    }
}

/// The columns of `replay.csv`, one entry a position; currents coil by coil within a position.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ReplayRows {
    /// Number of coils.
    pub coils: usize,
    /// s.
    pub t_s: Vec<f64>,
    /// m.
    pub position_m: Vec<[f64; 3]>,
    /// The height of the surface there, m; 0 where there is none.
    pub height_m: Vec<f64>,
    /// lambda h(x, y), N.
    pub wanted_force_n: Vec<f64>,
    /// Given with the currents below, N.
    pub force_n: Vec<f64>,
    /// Currents that flow, A.
    pub current_a: Vec<f64>,
    /// Currents that were commanded, A; empty where they are the same.
    pub commanded_a: Vec<f64>,
    /// Given with the bundle's fixed currents, N.
    pub static_force_n: Vec<f64>,
    /// How each position was answered.
    pub answer: Vec<Answer>,
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

    /// Wanted force minus the given one at a position (eq. 7), N.
    #[must_use]
    pub fn error_n(&self, row: usize) -> f64 {
        self.wanted_force_n[row] - self.force_n[row]
    }

    /// The same with the fixed currents, N.
    #[must_use]
    pub fn static_error_n(&self, row: usize) -> f64 {
        self.wanted_force_n[row] - self.static_force_n[row]
    }

    /// The currents at a position, A.
    #[must_use]
    pub fn currents_a(&self, row: usize) -> &[f64] {
        &self.current_a[row * self.coils..(row + 1) * self.coils]
    }

    /// The header's names.
    fn names(&self) -> Vec<String> {
        let mut names: Vec<String> = ["t_s", "x_m", "y_m", "z_m"].map(str::to_owned).to_vec();
        names.extend(["wanted_force_n", "force_n", "error_n"].map(str::to_owned));
        names.extend((0..self.coils).map(|coil| format!("current_{coil}_a")));
        names.extend(["static_force_n", "static_error_n"].map(str::to_owned));
        if !self.commanded_a.is_empty() {
            names.extend((0..self.coils).map(|coil| format!("commanded_{coil}_a")));
        }
        names.push("status".to_owned());
        names
    }

    /// Writes the table.
    ///
    /// # Errors
    /// The writer's; `InvalidData` for a number that is not finite.
    pub fn write(&self, out: &mut dyn Write) -> io::Result<()> {
        let mut block = self.names().join(",").into_bytes();
        block.push(b'\n');
        for row in 0..self.len() {
            let range = row * self.coils..(row + 1) * self.coils;
            let forces = [
                self.wanted_force_n[row],
                self.force_n[row],
                self.error_n(row),
            ];
            let fixed = [self.static_force_n[row], self.static_error_n(row)];
            let commanded = self.commanded_a.get(range.clone()).unwrap_or_default();
            let numbers = std::iter::once(&self.t_s[row])
                .chain(&self.position_m[row])
                .chain(&forces)
                .chain(&self.current_a[range])
                .chain(&fixed)
                .chain(commanded);
            for value in numbers {
                if !value.is_finite() {
                    let message = format!("row {row} of the replay is not finite");
                    return Err(io::Error::new(io::ErrorKind::InvalidData, message));
                }
                // Minus nothing is nothing.
                push_number(&mut block, value + 0.0);
                block.push(b',');
            }
            block.extend_from_slice(self.answer[row].word().as_bytes());
            block.push(b'\n');
            if block.len() >= BLOCK_BYTES {
                out.write_all(&block)?;
                block.clear();
            }
        }
        out.write_all(&block)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_a_position_with_its_status() {
        let mut rows = ReplayRows {
            coils: 2,
            t_s: vec![0.0, 0.02],
            position_m: vec![[0.01, -0.02, 0.05], [0.07, 0.0, 0.05]],
            height_m: vec![0.05, 0.0],
            wanted_force_n: vec![0.3, 0.0],
            force_n: vec![0.25, -0.0],
            current_a: vec![0.7, 1.3, 0.0, 0.0],
            commanded_a: Vec::new(),
            static_force_n: vec![0.3, 0.0],
            answer: vec![Answer::Saturated, Answer::Outside],
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
        rows.force_n[0] = f64::NAN;
        assert!(text(&rows).is_err());
    }
}
