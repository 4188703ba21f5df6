//! The rule for a logarithm at one end, on the functions that it is exact for and on another.

use fluxform_numerics::log_rule::LOG_RULE;

#[test]
fn is_exact_for_its_system() {
    for k in 0..12 {
        let (mut plain, mut log) = (0.0, 0.0);
        for [t, weight] in LOG_RULE {
            plain += weight * t.powi(k);
            log += weight * t.powi(k) * t.ln();
        }
        let exact = 1.0 / (f64::from(k) + 1.0);
        assert!((plain - exact).abs() < 1e-15, "{k}: {plain}");
        assert!((log + exact * exact).abs() < 1e-15, "{k}: {log}");
    }
}

#[test]
fn integrates_a_smooth_function_times_a_logarithm() {
    // int_0^1 cos(t) ln t dt = -Si(1).
    let sum: f64 = LOG_RULE.iter().map(|[t, w]| w * t.cos() * t.ln()).sum();
    assert!((sum + 0.946_083_070_367_183).abs() < 1e-15, "{sum}");
}
