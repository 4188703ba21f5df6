//! Where the coils of a searched array lie: layouts, and how coils move alike.

use fluxform_design::search::{SearchLayout, Symmetry};

/// Places that differ by less than this share of the pitch are the same.
const SAME: f64 = 1e-6;

/// Positions at pitch 1, centred on the origin; index = row * columns + column of a grid.
#[must_use]
pub fn layout(kind: SearchLayout, rows: usize, columns: usize) -> Vec<[f64; 2]> {
    let middle = |count: usize, index: usize| index as f64 - 0.5 * (count as f64 - 1.0);
    let grid = |row: usize, column: usize| [middle(columns, column), middle(rows, row)];
    let all = (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column)));
    match kind {
        SearchLayout::Grid => all.map(|(row, column)| grid(row, column)).collect(),
        SearchLayout::Shifted => {
            let shifted = |(row, column): (usize, usize)| {
                let [x, y] = grid(row, column);
                let half = if row % 2 == 0 { -0.25 } else { 0.25 };
                [x + half, y * 0.75_f64.sqrt()]
            };
            centred(all.map(shifted).collect())
        }
        SearchLayout::Ring => {
            let others = rows * columns - 1;
            // Neighbours on the ring are a pitch apart at least, and so are they from the centre.
            let step = std::f64::consts::TAU / others.max(1) as f64;
            let radius = if others > 1 {
                (0.5 / (0.5 * step).sin()).max(1.0)
            } else {
                1.0
            };
            let place = |k: usize| {
                let (sin, cos) = (k as f64 * step).sin_cos();
                [radius * cos, radius * sin]
            };
            std::iter::once([0.0, 0.0])
                .chain((0..others).map(place))
                .collect()
        }
    }
}

/// The same about the origin.
#[must_use]
pub fn centred(mut positions: Vec<[f64; 2]>) -> Vec<[f64; 2]> {
    for axis in 0..2 {
        let ends = positions.iter().map(|place| place[axis]);
        let low = ends.clone().fold(f64::INFINITY, f64::min);
        let high = ends.fold(f64::NEG_INFINITY, f64::max);
        for place in &mut positions {
            place[axis] -= 0.5 * (low + high);
        }
    }
    positions
}

/// The smallest distance of two positions.
#[must_use]
pub fn closest(positions: &[[f64; 2]]) -> f64 {
    let apart = |a: &[f64; 2], b: &[f64; 2]| (a[0] - b[0]).hypot(a[1] - b[1]);
    let pairs = positions.iter().enumerate();
    let nearest = pairs.flat_map(|(i, a)| positions[..i].iter().map(move |b| apart(a, b)));
    nearest.fold(f64::INFINITY, f64::min)
}

type Matrix = [[f64; 2]; 2];

/// A direction in which coils move alike: each coil's own part of a move by 1, which is the larger of those along x and y.
pub type Mode = Vec<[f64; 2]>;

/// The moves that keep the symmetry, as far as the positions have it.
#[must_use]
pub fn modes(positions: &[[f64; 2]], symmetry: Symmetry) -> Vec<Mode> {
    let mirrors: Vec<Matrix> = match symmetry {
        Symmetry::Free => vec![[[1.0, 0.0], [0.0, 1.0]]],
        Symmetry::Mirrored => signs(false),
        Symmetry::Square => signs(true),
    };
    let tolerance = SAME * closest(positions).min(1e6);
    let at = |place: [f64; 2]| {
        let same = |p: &[f64; 2]| (p[0] - place[0]).hypot(p[1] - place[1]) <= tolerance;
        positions.iter().position(same)
    };
    // Those under which the array is the same.
    let group: Vec<(Matrix, Vec<usize>)> = mirrors
        .into_iter()
        .filter_map(|m| {
            let images: Option<Vec<usize>> = positions.iter().map(|p| at(turned(m, *p))).collect();
            Some((m, images?))
        })
        .collect();
    let mut seen = vec![false; positions.len()];
    let mut modes = Vec::new();
    for first in 0..positions.len() {
        if seen[first] {
            continue;
        }
        for (_, images) in &group {
            seen[images[first]] = true;
        }
        // A mode is the mean over the group of a move of one coil.
        let mut own: Vec<Mode> = Vec::new();
        for direction in [[1.0, 0.0], [0.0, 1.0]] {
            let mut mode = vec![[0.0; 2]; positions.len()];
            for (m, images) in &group {
                let part = turned(*m, direction);
                for axis in 0..2 {
                    mode[images[first]][axis] += part[axis];
                }
            }
            // A move's range holds along x and y, on a diagonal too.
            let size = mode[first][0].abs().max(mode[first][1].abs());
            if size <= SAME {
                continue;
            }
            mode.iter_mut().flatten().for_each(|part| *part /= size);
            let parallel = own.iter().any(|other| {
                let cross = other[first][0] * mode[first][1] - other[first][1] * mode[first][0];
                cross.abs() < SAME
            });
            if !parallel {
                own.push(mode);
            }
        }
        modes.extend(own);
    }
    modes
}

fn signs(diagonals: bool) -> Vec<Matrix> {
    let mut all = Vec::new();
    for a in [1.0, -1.0] {
        for b in [1.0, -1.0] {
            all.push([[a, 0.0], [0.0, b]]);
            if diagonals {
                all.push([[0.0, a], [b, 0.0]]);
            }
        }
    }
    all
}

fn turned(m: Matrix, [x, y]: [f64; 2]) -> [f64; 2] {
    [m[0][0] * x + m[0][1] * y, m[1][0] * x + m[1][1] * y]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbours_are_a_pitch_apart_in_every_layout() {
        for kind in [
            SearchLayout::Grid,
            SearchLayout::Shifted,
            SearchLayout::Ring,
        ] {
            for (rows, columns) in [(3, 3), (2, 5), (4, 4)] {
                let places = layout(kind, rows, columns);
                assert_eq!(places.len(), rows * columns);
                assert!(
                    (closest(&places) - 1.0).abs() < 1e-12,
                    "{kind:?} {rows} {columns}"
                );
            }
        }
    }

    /// A square of nine: the corners move along the diagonals, the others along the axes, the centre
    /// not at all.
    #[test]
    fn coils_of_a_symmetric_array_move_alike() {
        let places = layout(SearchLayout::Grid, 3, 3);
        assert_eq!(modes(&places, Symmetry::Square).len(), 2);
        assert_eq!(modes(&places, Symmetry::Mirrored).len(), 4);
        assert_eq!(modes(&places, Symmetry::Free).len(), 18);
        let oblong = layout(SearchLayout::Grid, 2, 3);
        assert_eq!(modes(&oblong, Symmetry::Square).len(), 3);
        for mode in modes(&places, Symmetry::Square) {
            assert_eq!(mode[4], [0.0, 0.0]);
            assert!(
                mode.iter()
                    .flatten()
                    .all(|part| [-1.0, 0.0, 1.0].contains(part))
            );
            let moved: Vec<_> = places
                .iter()
                .zip(&mode)
                .map(|(p, d)| [p[0] + 0.1 * d[0], p[1] + 0.1 * d[1]])
                .collect();
            assert_eq!(modes(&moved, Symmetry::Square).len(), 2, "{mode:?}");
        }
    }

    /// Coils on a diagonal moved by the square root of half the range.
    #[test]
    fn regression_coils_on_a_diagonal_did_not_reach_the_ends_of_their_range() {
        for (kind, symmetry) in [
            (SearchLayout::Grid, Symmetry::Square),
            (SearchLayout::Ring, Symmetry::Square),
            (SearchLayout::Shifted, Symmetry::Mirrored),
        ] {
            for mode in modes(&layout(kind, 3, 3), symmetry) {
                let far = mode
                    .iter()
                    .flatten()
                    .fold(0.0_f64, |far, x| far.max(x.abs()));
                assert_eq!(far, 1.0, "{kind:?} {mode:?}");
            }
        }
    }
}
