//! Intervals contain what is exact, rounded outwards.

use fluxform_numerics::interval::Interval;

#[test]
fn results_contain_every_sample() {
    let (x, y) = (Interval::new(-0.7, 1.3), Interval::new(0.3, 0.9));
    let inside = |interval: Interval, v: f64| interval.lo <= v && v <= interval.hi;
    for i in 0..=10 {
        for j in 0..=10 {
            let a = -0.7 + 0.2 * f64::from(i);
            let b = 0.3 + 0.06 * f64::from(j);
            assert!(inside(x + y, a + b) && inside(x - y, a - b));
            assert!(inside(x * y, a * b) && inside(x / y, a / b));
            assert!(inside(x.square(), a * a) && inside(y.sqrt(), b.sqrt()));
            assert!(inside(-x * 0.7, -a * 0.7));
        }
    }
}

#[test]
fn rounding_is_outwards() {
    let third = Interval::point(1.0) / Interval::point(3.0);
    assert!(third.lo < third.hi);
    assert!((third * 3.0).lo < 1.0 && (third * 3.0).hi > 1.0);
    let all = Interval::point(1.0) / Interval::new(-0.1, 0.1);
    assert_eq!((all.lo, all.hi), (f64::NEG_INFINITY, f64::INFINITY));
}

#[test]
fn widening_is_a_share_of_the_larger_end_on_both_sides() {
    let wide = Interval::new(-0.7, 1.3).widened(0.01);
    assert!(wide.lo <= -0.713 && wide.lo > -0.713 - 1e-15);
    assert!(wide.hi >= 1.313 && wide.hi < 1.313 + 1e-15);
}
