//! Quadrature for integrands with a logarithm at one end.

/// Nodes and weights on [0, 1], exact for t^k and t^k ln t, k < 12: the generalised Gaussian
/// rule of that system (Ma, Rokhlin and Wandzura, SIAM J. Numer. Anal. 33, 971, 1996). Made by
/// `scripts/make_log_rule.py`.
pub const LOG_RULE: [[f64; 2]; 12] = [
    [0.00024528426497722221, 0.00093319988306714281],
    [0.0035936980202136916, 0.006977495915143716],
    [0.017122925951596144, 0.021694689021998534],
    [0.050205612323188194, 0.045970694395591125],
    [0.11152358555736256, 0.077527038695831785],
    [0.20600300290512398, 0.11125251818373961],
    [0.33246269751360654, 0.14027310600858333],
    [0.48260670096593194, 0.15751713008682963],
    [0.64167947012399286, 0.15740834222364898],
    [0.79070908718335541, 0.13728383271778586],
    [0.90988382876556259, 0.098196695474189501],
    [0.98234793771576195, 0.044965257393590795],
];

#[cfg(test)]
mod tests {
    use super::*;

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
}
