//! By how much a share of the requested force may be off because it is taken over some points of an object.

use super::limit::{GridPlaces, MARGIN};

/// Parts of the points, each spread over the whole object.
pub const QUARTERS: usize = 4;

/// Sums over the points of a quarter, by their weights.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Squares {
    /// Of the force's upward error.
    pub upward: f64,
    /// Of its sideways error.
    pub sideways: f64,
    /// Of the requested force.
    pub requested: f64,
}

/// The root of the squares of an error over those of the request, as those of all quarters have it.
#[must_use]
pub fn share(quarters: &[Squares; QUARTERS], error: impl Fn(&Squares) -> f64) -> f64 {
    let requested: f64 = quarters.iter().map(|of| of.requested).sum();
    if requested <= 0.0 {
        return 0.0;
    }
    (quarters.iter().map(error).sum::<f64>() / requested).sqrt()
}

/// The share of the whole error, and by how much it may be off: as much as the share of a quarter alone differs at most,
/// with the margin of the force constant's estimate. A rule of a quarter of the points is off twice as far as that of
/// all, or farther. All of it where one quarter alone has any.
#[must_use]
pub fn share_and_error(quarters: &[Squares; QUARTERS]) -> (f64, f64) {
    let error = |of: &Squares| of.upward + of.sideways;
    let whole = share(quarters, error);
    let some = || quarters.iter().filter(|of| of.requested > 0.0);
    if some().count() == 1 {
        return (whole, whole);
    }
    let off = some().map(|of| ((error(of) / of.requested).sqrt() - whole).abs());
    (whole, MARGIN * off.fold(0.0, f64::max))
}

/// The squares of all points where `exact` are those with nothing uncertain, and `uncertain` and `without` are those of
/// some points with what is uncertain and with nothing (a control variate): what the uncertainties add at some points
/// they add at all. Where they take away, as the weaker force of a warm magnet does, they take the same part, so that no
/// square falls below zero.
#[must_use]
pub fn over_all_points(
    exact: &[Squares; QUARTERS],
    uncertain: &[Squares; QUARTERS],
    without: &[Squares; QUARTERS],
) -> [Squares; QUARTERS] {
    std::array::from_fn(|quarter| {
        let all = exact[quarter];
        let (uncertain, without) = (uncertain[quarter], without[quarter]);
        // Without a point of some in it, it differs from the other quarters: the error says how little is known.
        if uncertain.requested <= 0.0 {
            return all;
        }
        let changed = |all_n2: f64, with: f64, without: f64| {
            if with < without {
                all_n2 * with / without
            } else {
                all_n2 + all.requested * (with - without) / uncertain.requested
            }
        };
        Squares {
            upward: changed(all.upward, uncertain.upward, without.upward),
            sideways: changed(all.sideways, uncertain.sideways, without.sideways),
            requested: all.requested,
        }
    })
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
                sums[quarter].upward += error(place % columns);
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
            upward: 0.25,
            sideways: 0.0,
            requested: 1.0,
        };
        let mut all = [Squares::default(); QUARTERS];
        assert_eq!(share_and_error(&all), (0.0, 0.0));
        all[2] = one;
        assert_eq!(share_and_error(&all), (0.5, 0.5));
    }

    /// A strip that decides is in one of some points or in none: what uncertainties add was stated without it.
    #[test]
    fn what_some_points_gain_is_added_to_the_squares_of_all() {
        let even = |upward: f64, sideways: f64| {
            let requested = 2.0;
            [Squares {
                upward: requested * upward,
                sideways: requested * sideways,
                requested,
            }; QUARTERS]
        };
        let exact = even(1.44, 0.25);
        let found = over_all_points(&exact, &even(0.05, 0.02), &even(0.01, 0.04));
        let upward = share(&found, |of| of.upward);
        assert!((upward.powi(2) - 1.48).abs() < 1e-12, "{upward}");
        // Half of the square is left at some points, and so at all: never less than nothing.
        let sideways = share(&found, |of| of.sideways);
        assert!((sideways.powi(2) - 0.125).abs() < 1e-12, "{sideways}");
        assert!(share_and_error(&found).1 < 1e-12);
        // Of a quarter that no point of some is in, nothing is known.
        let [mut with, mut without] = [even(0.05, 0.02), even(0.01, 0.02)];
        (with[1], without[1]) = (Squares::default(), Squares::default());
        let (expected, off) = share_and_error(&over_all_points(&exact, &with, &without));
        assert!((expected + off).powi(2) > 1.73, "{expected} +- {off}");
        assert_eq!(over_all_points(&exact, &with, &with), exact);
    }
}
