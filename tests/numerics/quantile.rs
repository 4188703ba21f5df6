//! Quantiles.

use fluxform_numerics::quantile::quantile;

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
