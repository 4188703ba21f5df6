//! By how much a share of the requested force may be off because it is taken over some points of an object.

use super::limit::{GridPlaces, MARGIN};

/// Parts of the points, each spread over the whole object.
pub const QUARTERS: usize = 4;

/// Sums over the points of a quarter, by their weights.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Squares {
    /// Of the force's error.
    pub error: f64,
    /// Of the requested force.
    pub requested: f64,
}

/// The root of the squares of the error over those of the request, and by how much it may be off: as much as the share of
/// a quarter alone differs at most, with the margin of the force constant's estimate. A rule of a quarter of the points
/// is off twice as far as that of all, or farther. All of it where one quarter alone has any.
#[must_use]
pub fn share_and_error(quarters: &[Squares; QUARTERS]) -> (f64, f64) {
    let some = || quarters.iter().filter(|of| of.requested > 0.0);
    let sum = |of: &dyn Fn(&Squares) -> f64| some().map(of).sum::<f64>();
    let requested = sum(&|of| of.requested);
    if requested <= 0.0 {
        return (0.0, 0.0);
    }
    let share = (sum(&|of| of.error) / requested).sqrt();
    if some().count() == 1 {
        return (share, share);
    }
    let off = some().map(|of| ((of.error / of.requested).sqrt() - share).abs());
    (share, MARGIN * off.fold(0.0, f64::max))
}

/// The quarter of each of the points `rows`: of those on a grid every second one along both axes, of others every fourth.
#[must_use]
pub fn quarters(rows: &[usize], grid: Option<GridPlaces>) -> Vec<usize> {
    let quarter = |(number, row): (usize, &usize)| {
        let place = grid.and_then(|grid| Some((grid, *grid.index.get(*row)?)));
        match place {
            Some((grid, place)) => {
                let [x, y] = grid.parity(place).map(|of| of.unwrap_or(0));
                x + 2 * y
            }
            None => number % QUARTERS,
        }
    };
    rows.iter().enumerate().map(quarter).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A spike of half a cell at the edge is in the first column's points or in none: no share of that grid is known.
    #[test]
    fn a_spike_that_one_column_sees_leaves_the_share_unknown() {
        let (columns, rows) = (16, 15);
        let index: Vec<usize> = (0..columns * rows).collect();
        let grid = GridPlaces {
            columns,
            rows,
            index: &index,
            smooth: &[],
            smooth_within: 0.0,
        };
        let of = |error: &dyn Fn(usize) -> f64| {
            let mut sums = [Squares::default(); QUARTERS];
            for (place, quarter) in quarters(&index, Some(grid)).into_iter().enumerate() {
                sums[quarter].error += error(place % columns);
                sums[quarter].requested += 1.0;
            }
            share_and_error(&sums)
        };
        let (share, off) = of(&|column| if column == 0 { 16.0 } else { 0.0 });
        assert!((share - 1.0).abs() < 1e-12 && off > 0.4, "{share} {off}");
        // Smooth over eight columns, nearly nothing is left to chance.
        let (share, off) = of(&|column| (column as f64 * 0.4).sin().powi(2));
        assert!(share > 0.5 && off < 0.1, "{share} {off}");
    }

    #[test]
    fn a_single_point_says_nothing_of_others() {
        let one = Squares {
            error: 0.25,
            requested: 1.0,
        };
        let mut all = [Squares::default(); QUARTERS];
        assert_eq!(share_and_error(&all), (0.0, 0.0));
        all[2] = one;
        assert_eq!(share_and_error(&all), (0.5, 0.5));
    }
}
