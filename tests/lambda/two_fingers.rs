//! Two fingers on one array: the magnets' own force, and who gets what was requested.

use fluxform_base::units::MU_0_T_M_PER_A;
use fluxform_lambda::ForceProblem;
use fluxform_lambda::two_fingers::{FingerMagnet, TwoFingers, between_magnets_n, two_fingers};
use fluxform_lambda::vector_feedback::VectorProblem;

/// m . B of one dipole in the field of another one, J.
fn energy(moment: [f64; 3], apart: [f64; 3]) -> f64 {
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let r = dot(apart, apart).sqrt();
    let along = dot(moment, apart) / r;
    let scale = MU_0_T_M_PER_A / (4.0 * std::f64::consts::PI * r.powi(3));
    scale * (3.0 * along * along - dot(moment, moment))
}

#[test]
fn magnets_push_each_other_as_their_energy_says() {
    let moment = [0.13, -0.07, -0.9];
    for apart in [[0.05, 0.01, 0.003], [-0.02, 0.04, -0.03], [0.0, 0.0, 0.07]] {
        let found = between_magnets_n(moment, apart);
        for axis in 0..3 {
            let moved = |by: f64| {
                let mut at = apart;
                at[axis] += by;
                energy(moment, at)
            };
            let slope = (moved(1e-6) - moved(-1e-6)) / 2e-6;
            assert!(
                (found[axis] - slope).abs() < 1e-6 * slope.abs().max(1e-3),
                "{found:?} {slope}"
            );
        }
    }
}

/// Coils that each reach one of four points along x, y and z, apart from the others.
fn pairs(upper_a: f64, moment: [f64; 3], apart_m: [f64; 2]) -> TwoFingers {
    let positions: Vec<[f64; 3]> = (0..4).map(|k| [0.05 * f64::from(k), 0.0, 0.04]).collect();
    let mut axes = [0, 1, 2].map(|_| vec![0.0; 4 * 12]);
    for point in 0..4 {
        for (axis, rows) in axes.iter_mut().enumerate() {
            rows[12 * point + 3 * point + axis] = 0.1;
        }
    }
    let problem = VectorProblem {
        upward: ForceProblem {
            forces_n_per_a: &axes[2],
            height_m: &[0.04; 4],
            offset_n: None,
            weights: None,
            lower_a: &[-upper_a; 12],
            upper_a: &[upper_a; 12],
            total_max_a: None,
            resistance_ohm: &[6.0; 12],
        },
        sides_n_per_a: [&axes[0], &axes[1]],
        direction: &[[0.0, 0.0, 1.0]; 4],
    };
    let magnet = FingerMagnet {
        moment_a_m2: moment,
        diameter_m: 0.01,
        length_m: 0.01,
    };
    two_fingers(&problem, &positions, magnet, 3.0, apart_m).unwrap()
}

#[test]
fn both_get_their_force_if_the_limits_leave_it_after_the_magnets_own() {
    // 0.12 N of 0.1 N/A: 1.2 A each, 8.64 W a finger.
    let enough = pairs(1.3, [0.0; 3], [0.04, 0.2]);
    assert!(enough.pairs > 100);
    assert_eq!([enough.upward_share, enough.vector_share], [1.0; 2]);
    assert!((enough.upward_power_w - 17.28).abs() < 1e-4, "{enough:?}");
    assert_eq!(pairs(1.1, [0.0; 3], [0.04, 0.2]).upward_share, 0.0);
    // Upright magnets beside each other push sideways alone: 48 mN at 50 mm for 1 A m^2, 0.48 A.
    let pushed = pairs(1.3, [0.0, 0.0, -1.0], [0.04, 0.06]);
    assert!((pushed.magnets_force_n - 0.048).abs() < 1e-6, "{pushed:?}");
    assert!((pushed.magnets_force_share - 0.4).abs() < 1e-5);
    assert!(
        (pushed.vector_power_w - 17.28 - 2.0 * 6.0 * 0.48_f64.powi(2)).abs() < 1e-3,
        "{pushed:?}"
    );
    assert!((pushed.upward_power_w - 17.28).abs() < 1e-4);
    // Stronger ones are more than the sideways coils can hold.
    let torn = pairs(1.3, [0.0, 0.0, -2.0], [0.04, 0.06]);
    assert_eq!([torn.upward_share, torn.vector_share], [1.0, 0.0]);
    assert_eq!(pairs(1.3, [0.0; 3], [0.3, 0.4]).pairs, 0);
}

/// Tilted magnets were taken for upright ones: 20 mm of 40 mm lay in each other unnoticed, and 5 mm apart was refused.
#[test]
fn regression_magnets_that_lie_overlapped_as_if_they_stood() {
    let magnet = |moment_a_m2| FingerMagnet {
        moment_a_m2,
        diameter_m: 0.01,
        length_m: 0.04,
    };
    let (stands, lies) = (magnet([0.0, 0.0, 0.5]), magnet([0.0, -0.5, 0.0]));
    let above = [0.0, 0.0, 0.015];
    let behind = [0.0, 0.02, 0.0];
    assert!(stands.overlaps(above) && !stands.overlaps(behind));
    assert!(lies.overlaps(behind) && !lies.overlaps(above));
    let turned = magnet([0.3, 0.0, 0.4]);
    let [along, across] = turned.along_and_across_m([0.03, 0.0, 0.04]);
    assert!((along - 0.05).abs() < 1e-15 && across < 1e-15);
}
