//! Quadrature for integrands with a logarithm at one end.

/// Nodes and weights on [0, 1], exact for t^k and t^k ln t, k < 12: the generalised Gaussian
/// rule of that system (Ma, Rokhlin and Wandzura, SIAM J. Numer. Anal. 33, 971, 1996). Made by
/// `scripts/make_log_rule.py`.
pub const LOG_RULE: [[f64; 2]; 12] = [
    [0.0002452842649772222, 0.0009331998830671429],
    [0.0035936980202136916, 0.006977495915143716],
    [0.017122925951596143, 0.021694689021998535],
    [0.050205612323188195, 0.04597069439559112],
    [0.11152358555736255, 0.07752703869583179],
    [0.20600300290512397, 0.11125251818373962],
    [0.3324626975136065, 0.14027310600858334],
    [0.48260670096593195, 0.15751713008682963],
    [0.6416794701239928, 0.15740834222364897],
    [0.7907090871833554, 0.13728383271778585],
    [0.9098838287655626, 0.09819669547418951],
    [0.9823479377157619, 0.04496525739359079],
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
