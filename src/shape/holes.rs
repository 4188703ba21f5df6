//! Grid points without surface inside the silhouette: found, and filled when asked to.

use crate::height::{Grid, Sample};
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

/// Sweeps over a hole, at most, for each of its points along the longer side.
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
        fluxform_base::progress::poll();
        let (column, row) = (index % columns, index / columns);
        let border = column == 0 || row == 0 || column + 1 == columns || row + 1 == rows;
        if border && sample.is_none() {
            outside[index] = true;
            open.push(index);
        }
    }
    while let Some(index) = open.pop() {
        fluxform_base::progress::poll();
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
/// squares of the steps (Laplace's equation); its normal is the membrane's.
pub fn fill(grid: &Grid, samples: &mut [Option<Sample>], holes: &[usize]) {
    let steps = [grid.x_m.step(), grid.y_m.step()];
    let weights = steps.map(|step| 1.0 / (step * step));
    let known = samples.iter().flatten().map(|sample| sample.height_m);
    let (count, sum, largest) = known.fold((0.0, 0.0, 0.0_f64), |(n, sum, most), h| {
        (n + 1.0, sum + h, most.max(h.abs()))
    });
    let start = if count > 0.0 { sum / count } else { 0.0 };
    for &index in holes {
        samples[index] = Some(Sample {
            height_m: start,
            normal: [0.0, 0.0, 1.0],
        });
    }
    let height = |samples: &[Option<Sample>], index: Option<usize>| {
        index
            .and_then(|k| samples[k])
            .map_or(start, |sample| sample.height_m)
    };
    let longest = grid.x_m.samples.max(grid.y_m.samples).min(holes.len() + 1);
    // Successive over-relaxation with the factor that suits the longest hole there can be.
    let factor = 2.0 / (1.0 + (std::f64::consts::PI / (longest + 1) as f64).sin());
    for _ in 0..SWEEPS * longest {
        fluxform_base::progress::poll();
        let mut change = 0.0_f64;
        for &index in holes {
            let around = neighbours(grid, index).map(|k| height(samples, k));
            let mean = (weights[0] * (around[0] + around[1])
                + weights[1] * (around[2] + around[3]))
                / (2.0 * (weights[0] + weights[1]));
            if let Some(sample) = &mut samples[index] {
                let step = factor * (mean - sample.height_m);
                sample.height_m += step;
                change = change.max(step.abs());
            }
        }
        if change <= AT_REST * largest {
            break;
        }
    }
    for &index in holes {
        let around = neighbours(grid, index).map(|k| height(samples, k));
        let x = (around[0] - around[1]) / (2.0 * steps[0]);
        let y = (around[2] - around[3]) / (2.0 * steps[1]);
        let length = (x * x + y * y + 1.0).sqrt();
        if let Some(sample) = &mut samples[index] {
            sample.normal = [x / length + 0.0, y / length + 0.0, 1.0 / length];
        }
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
