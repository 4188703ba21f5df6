//! Nine coils against exact rational solutions.

use fluxform_lambda::Status;

use fluxform_testing::force_problems::Case;

#[derive(serde::Deserialize)]
struct Oracle {
    cases: Vec<OracleCase>,
}

#[derive(serde::Deserialize)]
struct OracleCase {
    name: String,
    forces_n_per_a: Vec<f64>,
    height_m: Vec<f64>,
    lower_a: Vec<f64>,
    upper_a: Vec<f64>,
    total_max_a: Option<f64>,
    lambda_linear_n_per_m: Option<String>,
    lambda_jnd_n_per_m: Option<String>,
    points: Vec<OraclePoint>,
}

#[derive(serde::Deserialize)]
struct OraclePoint {
    lambda_n_per_m: f64,
    relative_error: String,
}

/// Exact rational solutions by another method (`tests/oracles/lambda.py`): nine coils,
/// condition numbers from 1 to 1e9, nearly equal columns, limits over six decades.
#[test]
fn nine_coils_match_exact_rational_solutions() {
    let oracle: Oracle =
        serde_json::from_str(include_str!("../oracles/lambda.json")).expect("the oracle file");
    assert_eq!(oracle.cases.len(), 20);
    let number = |text: &str| text.parse::<f64>().expect("a number");
    for exact in oracle.cases {
        let case = Case {
            forces: exact.forces_n_per_a,
            heights: exact.height_m,
            offset: None,
            ohm: vec![6.0; exact.upper_a.len()],
            lower: exact.lower_a,
            upper: exact.upper_a,
            total: exact.total_max_a,
        };
        let solution = case.solve();
        assert_eq!(
            (solution.status, solution.rank),
            (Status::Solved, 9),
            "{}",
            exact.name
        );
        for point in &exact.points {
            let scale = point.lambda_n_per_m.powi(2) * case.mean_square();
            let found = solution.path.error_n2(point.lambda_n_per_m) / scale;
            let error = (found - number(&point.relative_error)).abs();
            assert!(
                error < 1e-13,
                "{} at {}: {error:e}",
                exact.name,
                point.lambda_n_per_m
            );
        }
        for (found, exact_value) in [
            (
                solution.constants.lambda_linear_n_per_m,
                exact.lambda_linear_n_per_m,
            ),
            (
                solution.constants.lambda_jnd_n_per_m,
                exact.lambda_jnd_n_per_m,
            ),
        ] {
            if let Some(text) = exact_value {
                let error = found.expect("limits bind") / number(&text) - 1.0;
                assert!(error.abs() < 1e-11, "{}: {error:e}", exact.name);
            }
        }
    }
}
