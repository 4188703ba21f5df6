//! Products of small matrices of all shapes, against plain sums.

use fluxform_numerics::matrix::{add_product, product, transpose};

#[test]
fn products_of_all_shapes_are_the_plain_sums() {
    let value = |i: usize| ((i * 37 + 11) % 101) as f64 * 0.07 - 1.3;
    for (rows, inner, columns) in [
        (1, 1, 1),
        (4, 3, 8),
        (5, 7, 9),
        (9, 2, 17),
        (3, 13, 31),
        (13, 5, 2),
        (6, 4, 16),
    ] {
        let a: Vec<f64> = (0..rows * inner).map(value).collect();
        let b: Vec<f64> = (0..inner * columns).map(|i| value(i + 5)).collect();
        let mut out = vec![f64::NAN; rows * columns];
        product(&a, &b, inner, &mut out);
        for (place, got) in out.iter().enumerate() {
            let (i, j) = (place / columns, place % columns);
            let plain: f64 = (0..inner)
                .map(|l| a[i * inner + l] * b[l * columns + j])
                .sum();
            assert!((got - plain).abs() < 1e-13, "{rows} {inner} {columns}");
        }
        let once = out.clone();
        add_product(&a, &b, inner, &mut out);
        for (twice, once) in out.iter().zip(&once) {
            assert!(
                (twice - 2.0 * once).abs() < 1e-13,
                "{rows} {inner} {columns}"
            );
        }
        assert_eq!(transpose(&transpose(&a, inner), rows), a);
    }
}
