//! Quantiles.

use fluxform_numerics::quantile::{quantile, weighted_quantile};

#[test]
fn between_order_statistics_they_are_linear() {
    let odd = [1.0, 3.0, 5.0, 7.0, 9.0];
    assert_eq!(
        [0.0, 0.25, 0.5, 1.0].map(|part| quantile(&odd, part)),
        [1.0, 3.0, 5.0, 9.0]
    );
    assert_eq!(
        [0.25, 0.5, 0.75].map(|part| quantile(&[1.0, 2.0], part)),
        [1.25, 1.5, 1.75]
    );
    assert_eq!(quantile(&[1.3], 0.95), 1.3);
    assert!(quantile(&[], 0.5).is_nan());
}

#[test]
fn weights_that_are_alike_change_nothing_and_a_weight_of_two_is_two_values() {
    let ascending = [1.0, 2.0, 4.0, 8.0, 8.5];
    let weighted = ascending.map(|value| (value, 0.3));
    for part in [0.0, 0.1, 0.5, 0.77, 1.0] {
        let (plain, weighted) = (
            quantile(&ascending, part),
            weighted_quantile(&weighted, part),
        );
        assert!(
            (plain - weighted).abs() < 1e-12,
            "{part}: {plain} {weighted}"
        );
    }
    // Nine tenths of the weight lie at 3 and above.
    let uneven = [(1.0, 0.05), (2.0, 0.05), (3.0, 0.4), (5.0, 0.5)];
    let median = weighted_quantile(&uneven, 0.5);
    assert!(median > 3.0 && median < 5.0, "{median}");
    assert!(weighted_quantile(&[], 0.5).is_nan());
    assert_eq!(weighted_quantile(&[(7.0, 2.0)], 0.5), 7.0);
}
