//! Grid points without surface inside the silhouette: found, and filled when asked to.

use std::f64::consts::PI;

use crate::height::{Grid, Sample};
use fluxform_base::progress;
use rayon::prelude::*;
use strum::{EnumMessage, EnumString, IntoStaticStr, VariantArray};

/// Treatment of holes.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, Default, EnumMessage, EnumString, IntoStaticStr, VariantArray,
)]
#[strum(serialize_all = "lowercase")]
pub enum Holes {
    /// They give no points, like what lies outside
    #[default]
    Skip,
    /// A membrane is spanned over them
    Fill,
    /// They are refused
    Error,
}

fluxform_base::choices!(Holes);

/// Sweeps over a hole, at most, for each point along its longer side.
const SWEEPS: usize = 40;
/// Change, against the largest height, at which the membrane is at rest.
const AT_REST: f64 = 1e-13;

/// Indices of the grid points without surface from which no way over such points, along rows and
/// columns, leads to the grid's border; ascending.
#[must_use]
pub fn holes(grid: &Grid, samples: &[Option<Sample>]) -> Vec<usize> {
    let (columns, rows) = (grid.x_m.samples, grid.y_m.samples);
    let mut outside = vec![false; samples.len()];
    let mut open: Vec<usize> = Vec::new();
    for (index, sample) in samples.iter().enumerate() {
        progress::poll();
        let (column, row) = (index % columns, index / columns);
        let border = column == 0 || row == 0 || column + 1 == columns || row + 1 == rows;
        if border && sample.is_none() {
            outside[index] = true;
            open.push(index);
        }
    }
    while let Some(index) = open.pop() {
        progress::poll();
        for next in neighbours(grid, index).into_iter().flatten() {
            if samples[next].is_none() && !outside[next] {
                outside[next] = true;
                open.push(next);
            }
        }
    }
    let hole = |index: &usize| samples[*index].is_none() && !outside[*index];
    (0..samples.len()).filter(hole).collect()
}

/// Spans a membrane over the holes: every filled height is its neighbours' mean, weighted by the
/// squares of the steps (Laplace's equation); its normal is the membrane's. Holes that no point joins do not
/// depend on each other.
pub fn fill(grid: &Grid, samples: &mut [Option<Sample>], holes: &[usize]) {
    let known: &[Option<Sample>] = samples;
    let largest_m = (known.iter().flatten()).fold(0.0_f64, |most, s| most.max(s.height_m.abs()));
    let apart = joined(grid, holes, samples.len());
    let membranes = apart
        .par_iter()
        .map(|hole| Membrane::new(grid, known, hole));
    let filled: Vec<Vec<Sample>> = membranes
        .map(|membrane| membrane.at_rest(AT_REST * largest_m))
        .collect();
    for (&index, sample) in apart.iter().flatten().zip(filled.iter().flatten()) {
        samples[index] = Some(*sample);
    }
}

/// The points of each hole, ascending.
fn joined(grid: &Grid, holes: &[usize], points: usize) -> Vec<Vec<usize>> {
    let mut open = vec![false; points];
    holes.iter().for_each(|index| open[*index] = true);
    let mut apart = Vec::new();
    for &first in holes {
        if !std::mem::take(&mut open[first]) {
            continue;
        }
        let mut hole = vec![first];
        let mut looked = 0;
        while let Some(&index) = hole.get(looked) {
            progress::poll();
            looked += 1;
            for next in neighbours(grid, index).into_iter().flatten() {
                if std::mem::take(&mut open[next]) {
                    hole.push(next);
                }
            }
        }
        hole.sort_unstable();
        apart.push(hole);
    }
    apart
}

/// Laplace's equation on the points of one hole.
struct Membrane {
    /// Heights of the hole's points, then of those around it, m.
    heights_m: Vec<f64>,
    /// The four neighbours of each of the hole's points.
    around: Vec<[usize; 4]>,
    /// Weights of the neighbours along x and y; twice their sum is 1.
    weights: [f64; 2],
    steps_m: [f64; 2],
    /// Points along x and y of the rectangle about it.
    sides: [usize; 2],
}

impl Membrane {
    fn new(grid: &Grid, known: &[Option<Sample>], hole: &[usize]) -> Self {
        let mut heights_m = vec![0.0; hole.len()];
        let mut around = Vec::with_capacity(hole.len());
        for &index in hole {
            around.push(neighbours(grid, index).map(|next| {
                // No hole reaches the grid's border.
                let next = next.unwrap_or(index);
                hole.binary_search(&next).unwrap_or_else(|_| {
                    heights_m.push(known[next].map_or(0.0, |sample| sample.height_m));
                    heights_m.len() - 1
                })
            }));
        }
        let rim_m = &heights_m[hole.len()..];
        let mean_m = rim_m.iter().sum::<f64>() / rim_m.len() as f64;
        heights_m[..hole.len()].fill(mean_m);
        let columns = grid.x_m.samples;
        let side = |of: fn(usize, usize) -> usize| {
            let places = || hole.iter().map(|index| of(*index, columns));
            places().max().unwrap_or(0) - places().min().unwrap_or(0) + 1
        };
        let steps_m = [grid.x_m.step(), grid.y_m.step()];
        let squares = steps_m.map(|step| 1.0 / (step * step));
        Self {
            heights_m,
            around,
            weights: squares.map(|square| 0.5 * square / (squares[0] + squares[1])),
            steps_m,
            sides: [
                side(|index, columns| index % columns),
                side(|index, columns| index / columns),
            ],
        }
    }

    /// Successive over-relaxation until no height changes by more than `still_m`, with the best factor for the
    /// rectangle about the hole (Young, Trans. Am. Math. Soc. 76, 92, 1954): one no larger needs no more sweeps.
    fn at_rest(mut self, still_m: f64) -> Vec<Sample> {
        let cosine = |side: usize| (PI / (side + 1) as f64).cos();
        let radius = 2.0
            * (0..2)
                .map(|k| self.weights[k] * cosine(self.sides[k]))
                .sum::<f64>();
        let factor = 2.0 / (1.0 + (1.0 - radius * radius).sqrt());
        for _ in 0..SWEEPS * self.sides[0].max(self.sides[1]) {
            progress::poll();
            let mut change_m = 0.0_f64;
            for (k, around) in self.around.iter().enumerate() {
                let [left, right, below, above] = around.map(|next| self.heights_m[next]);
                let mean = self.weights[0] * (left + right) + self.weights[1] * (below + above);
                let step = factor * (mean - self.heights_m[k]);
                self.heights_m[k] += step;
                change_m = change_m.max(step.abs());
            }
            if change_m <= still_m {
                break;
            }
        }
        let sample = |(around, height_m): (&[usize; 4], &f64)| {
            let [left, right, below, above] = around.map(|next| self.heights_m[next]);
            let x = (left - right) / (2.0 * self.steps_m[0]);
            let y = (below - above) / (2.0 * self.steps_m[1]);
            let length = (x * x + y * y + 1.0).sqrt();
            Sample {
                height_m: *height_m,
                normal: [x / length + 0.0, y / length + 0.0, 1.0 / length],
            }
        };
        self.around
            .iter()
            .zip(&self.heights_m)
            .map(sample)
            .collect()
    }
}

/// Left, right, below, above; `None` beyond the border.
fn neighbours(grid: &Grid, index: usize) -> [Option<usize>; 4] {
    let (columns, rows) = (grid.x_m.samples, grid.y_m.samples);
    let (column, row) = (index % columns, index / columns);
    [
        (column > 0).then(|| index - 1),
        (column + 1 < columns).then(|| index + 1),
        (row > 0).then(|| index - columns),
        (row + 1 < rows).then(|| index + columns),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use fluxform_numerics::axis::Axis;

    fn axis(to: f64, samples: usize) -> Axis {
        Axis {
            from: -0.01,
            to,
            samples,
        }
    }

    /// Heights whose second differences along x and y cancel, but for those in a ring and two rectangles.
    fn sheet(grid: &Grid, with_rectangles: bool) -> Vec<Option<Sample>> {
        let columns = grid.x_m.samples;
        let at = |index: usize| {
            let (column, row) = (index % columns, index / columns);
            let (x, y) = (grid.x_m.node(column), grid.y_m.node(row));
            let away = (column as f64 - 30.0).hypot(row as f64 - 20.0);
            let ring = (7.0..12.0).contains(&away);
            let rectangle = (60..90).contains(&column) && (5..8).contains(&row)
                || column == 70 && (20..35).contains(&row);
            (!(ring || with_rectangles && rectangle)).then_some(Sample {
                height_m: 0.03 + 4.0 * (x * x - y * y) + 3.0 * x * y + 0.2 * x,
                normal: [0.0, 0.0, 1.0],
            })
        };
        (0..columns * grid.y_m.samples).map(at).collect()
    }

    #[test]
    fn a_membrane_is_harmonic_and_does_not_depend_on_other_holes() {
        let grid = Grid {
            x_m: axis(0.04, 101),
            y_m: axis(0.03, 41),
        };
        let [whole, ring] = [true, false].map(|with_rectangles| {
            let mut samples = sheet(&grid, with_rectangles);
            let found = holes(&grid, &samples);
            assert_eq!(samples.iter().filter(|s| s.is_none()).count(), found.len());
            fill(&grid, &mut samples, &found);
            samples
        });
        for (index, sample) in whole.iter().enumerate() {
            let (x, y) = (grid.x_m.node(index % 101), grid.y_m.node(index / 101));
            let exact_m = 0.03 + 4.0 * (x * x - y * y) + 3.0 * x * y + 0.2 * x;
            let off_m = (sample.unwrap().height_m - exact_m).abs();
            assert!(off_m < 1e-12, "{index}: {off_m}");
        }
        // The ring's points of both, to the last bit.
        let apart = sheet(&grid, false);
        let of_ring = (0..apart.len()).filter(|index| apart[*index].is_none());
        for index in of_ring {
            assert_eq!(whole[index], ring[index], "{index}");
        }
    }
}
