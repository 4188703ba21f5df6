//! Some places of a grid, spread over its rows and columns.

use fluxform_numerics::spread::spread;

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
        let mean = |all: &[usize]| all.iter().map(|at| value(*at)).sum::<f64>() / all.len() as f64;
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
