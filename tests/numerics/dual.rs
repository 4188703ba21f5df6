//! Dual numbers, against a derivative in closed form.

use fluxform_numerics::dual::{Dual, Number};

#[test]
fn differentiates_a_composite() {
    // f = sqrt(1.3 x + x^2) / (x - 0.2); f' in closed form
    let x = Dual::variable(0.7);
    let f = (x * 1.3 + x * x).sqrt() / (x + -0.2);
    let root = (1.3_f64 * 0.7 + 0.49).sqrt();
    let slope = (1.3 + 1.4) / (2.0 * root) / 0.5 - root / 0.25;
    assert!((f.re - root / 0.5).abs() < 1e-15);
    assert!((f.du - slope).abs() < 1e-14);
}
