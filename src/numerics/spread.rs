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
