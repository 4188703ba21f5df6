//! What static currents and feedback of the upward force leave along x and y, by hand.

use fluxform_lambda::ForceProblem;
use fluxform_lambda::sideways::sideways;
use fluxform_lambda::vector_feedback::VectorProblem;

/// Two coils of 1 and 4 ohm, the second of which alone pushes along x too, under two points.
#[test]
fn shares_angles_and_power_are_those_by_hand() {
    let (up, along_x, along_y) = ([1.0, 0.5, 0.8, 0.8], [0.0, 0.5, 0.0, -0.6], [0.0; 4]);
    let problem = ForceProblem {
        forces_n_per_a: &up,
        height_m: &[0.5, 1.0],
        offset_n: None,
        weights: Some(&[1.0, 3.0]),
        lower_a: &[-9.0; 2],
        upper_a: &[9.0; 2],
        total_max_a: None,
        resistance_ohm: &[1.0, 4.0],
    };
    let fixed = [0.25, 0.5];
    let vectors = VectorProblem {
        upward: problem,
        sides_n_per_a: [&along_x, &along_y],
        direction: &[[0.0, 0.0, 1.0]; 2],
    };
    let found = sideways(&vectors, 0.8, &fixed, &[0, 1]);
    let found = found.unwrap().unwrap();
    let near = |found: f64, by_hand: f64| {
        assert!((found - by_hand).abs() < 1e-9, "{found}, not {by_hand}");
    };
    // Requested are 0.4 N once and 0.8 N three times.
    let requested = 0.4_f64.powi(2) + 3.0 * 0.8_f64.powi(2);
    let fixed_x: [f64; 2] = [0.25, -0.3];
    let share = |x: [f64; 2]| ((x[0] * x[0] + 3.0 * x[1] * x[1]) / requested).sqrt();
    near(found.static_share, share(fixed_x));
    // Up there are 0.5 N and 0.6 N; of two angles the mean is the median: it was the larger one.
    let angles = [fixed_x[0].atan2(0.5), 0.3_f64.atan2(0.6)];
    near(
        found.static_median_deg,
        (0.5 * (angles[0] + angles[1])).to_degrees(),
    );
    // Least power: currents go as force over resistance.
    let least = |up: [f64; 2], force: f64| {
        let scale = force / (up[0] * up[0] + up[1] * up[1] / 4.0);
        [scale * up[0], scale * up[1] / 4.0]
    };
    let own = [least([1.0, 0.5], 0.4), least([0.8, 0.8], 0.8)];
    near(
        found.feedback_share,
        share([0.5 * own[0][1], -0.6 * own[1][1]]),
    );
    // Nothing sideways: the first coil alone.
    let watts = |[a, b]: [f64; 2]| a * a + 4.0 * b * b;
    let alone = watts([0.4, 0.0]) + 3.0 * watts([1.0, 0.0]);
    near(
        found.vector_power_ratio,
        alone / (watts(own[0]) + 3.0 * watts(own[1])),
    );
    near(found.feedback_reached, 1.0);
    near(found.vector_reached, 1.0);
}

/// A request along a normal was held against upward: sideways 0.5 of a push that leans by as much.
#[test]
fn a_leaning_request_is_held_against_itself() {
    let problem = ForceProblem {
        forces_n_per_a: &[0.8],
        height_m: &[1.0],
        offset_n: None,
        weights: None,
        lower_a: &[-9.0],
        upper_a: &[9.0],
        total_max_a: None,
        resistance_ohm: &[1.0],
    };
    let vectors = VectorProblem {
        upward: problem,
        sides_n_per_a: [&[0.6], &[0.0]],
        direction: &[[0.6, 0.0, 0.8]],
    };
    let found = sideways(&vectors, 1.0, &[1.0], &[0]).unwrap().unwrap();
    assert!(found.static_share < 1e-12 && found.static_median_deg < 1e-6);
    assert!(found.feedback_share < 1e-12);
    // Of the same upward force, sideways the other way: twice 0.6 off.
    let opposed = VectorProblem {
        sides_n_per_a: [&[-0.6], &[0.0]],
        ..vectors
    };
    let found = sideways(&opposed, 1.0, &[1.0], &[0]).unwrap().unwrap();
    assert!((found.static_share - 1.2).abs() < 1e-12);
    assert!((found.static_median_deg - 2.0 * 0.6_f64.asin().to_degrees()).abs() < 1e-9);
}
