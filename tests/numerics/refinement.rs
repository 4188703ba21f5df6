//! The error of the finest of three refinements.

use fluxform_numerics::refinement::error_of_finest;

#[test]
fn it_covers_what_falls_by_a_third_at_least() {
    for (ratio, size) in [(0.02, 0.7), (0.3, 1.3), (0.5, 2e-7), (0.66, 1.7)] {
        let (last, before) = (size * (1.0 - ratio), size * (1.0 - ratio) / ratio);
        assert!(error_of_finest(last, before) >= size * ratio, "{ratio}");
    }
}

#[test]
fn two_that_agree_by_chance_are_not_believed() {
    assert_eq!(error_of_finest(1e-9, 0.7), 0.7);
}

#[test]
fn no_number_is_no_estimate() {
    assert!(error_of_finest(f64::NAN, 0.7).is_nan());
    assert!(error_of_finest(0.7, f64::NAN).is_nan());
}
