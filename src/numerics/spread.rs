//! A few of many, evenly, whatever pattern the many have.

/// The golden ratio's fraction: its multiples fill the unit interval most evenly.
const GOLDEN: f64 = 0.618_033_988_749_894_9;

/// The `n`-th part of a sequence that fills `[0, 1)` evenly and never repeats.
#[must_use]
pub fn part(n: usize) -> f64 {
    (n as f64 * GOLDEN).fract()
}

/// Indices of `most` of `count` items in order; of no more than that all.
///
/// Of every of `most` equal parts one, at multiples of the golden ratio within it: over a grid that is stored row by
/// row a lattice over rows and columns. Equal steps would meet the same columns in every row that they divide.
#[must_use]
pub fn spread(count: usize, most: usize) -> Vec<usize> {
    if count <= most {
        return (0..count).collect();
    }
    let from = |number: usize| number * count / most;
    let within = |number: usize| {
        let width = from(number + 1) - from(number);
        from(number) + (part(number) * width as f64) as usize
    };
    (0..most).map(within).collect()
}

#[cfg(test)]
mod tests {
    use super::spread;

    #[test]
    fn some_of_a_grid_are_spread_over_rows_and_columns() {
        assert_eq!(spread(4, 4), [0, 1, 2, 3]);
        assert_eq!(spread(3, 0), [0_usize; 0]);
        for (columns, rows, most) in [
            (200, 200, 200),
            (199, 199, 200),
            (100, 100, 200),
            (61, 61, 61),
        ] {
            let some = spread(columns * rows, most);
            assert_eq!(some.len(), most);
            assert!(some.windows(2).all(|two| two[0] < two[1]));
            // Sums over smooth values are those over all: equal steps are 7 to 60 % off.
            let value = |at: usize| {
                let [u, v] = [(at % columns) as f64, (at / columns) as f64];
                (u / columns as f64) * (1.0 + v / rows as f64)
            };
            let mean =
                |all: &[usize]| all.iter().map(|at| value(*at)).sum::<f64>() / all.len() as f64;
            let all: Vec<usize> = (0..columns * rows).collect();
            let off = mean(&some) / mean(&all) - 1.0;
            assert!(off.abs() < 0.02, "{columns} x {rows}: {off}");
            // Parts of the columns have their share of the places.
            for tenth in 0..10 {
                let inside = |at: &&usize| (**at % columns) * 10 / columns == tenth;
                let share = some.iter().filter(inside).count() as f64 / most as f64;
                assert!((share - 0.1).abs() < 0.04, "{columns} x {rows}: {share}");
            }
        }
    }
}
