//! The climb of a surrogate, on problems whose optimum is known.

use fluxform_numerics::mixed_search::descent::{Judged, climb};

/// Hock and Schittkowski's problem 71, from its usual start.
#[test]
fn a_known_problem_with_two_limits() {
    let of = |u: &[f64]| {
        let x: Vec<f64> = u.iter().map(|u| 1.0 + 4.0 * u).collect();
        let product: f64 = x.iter().product();
        let squares: f64 = x.iter().map(|x| x * x).sum();
        Judged {
            objectives: vec![-(x[0] * x[3] * (x[0] + x[1] + x[2]) + x[2]).ln()],
            limits: vec![
                1.0 - product / 25.0,
                squares / 40.0 - 1.0,
                1.0 - squares / 40.0,
            ],
        }
    };
    let ended = climb(&of, &[0.0, 1.0, 1.0, 0.0], &[0.0; 4], &[1.0; 4]);
    assert!(
        (ended.judged.objective() + 17.014_017_3_f64.ln()).abs() < 1e-5,
        "{ended:?}"
    );
    assert!(ended.judged.excess() < 1e-6);
}

/// max min(f1, f2): where both are equal. And limits that contradict each other are broken least.
#[test]
fn the_least_objective_is_raised_and_contradictions_are_shared() {
    let of = |u: &[f64]| Judged {
        objectives: vec![u[0] - u[1] * u[1], 1.3 - 2.0 * u[0] + 0.3 * u[1]],
        limits: vec![],
    };
    let ended = climb(&of, &[0.1, 0.9], &[0.0; 2], &[1.0; 2]);
    let [f1, f2] = [ended.judged.objectives[0], ended.judged.objectives[1]];
    assert!((f1 - f2).abs() < 1e-6, "{ended:?}");
    // Weights 2/3 and 1/3: 2/3 (-2 y) + 1/3 0.3 = 0.
    assert!((ended.u[1] - 0.075).abs() < 1e-4, "{ended:?}");
    let of = |u: &[f64]| Judged {
        objectives: vec![u[0]],
        limits: vec![u[0] - 0.3, 0.7 - u[0]],
    };
    let ended = climb(&of, &[0.9], &[0.0], &[1.0]);
    assert!((ended.judged.excess() - 0.2).abs() < 1e-6, "{ended:?}");
}
