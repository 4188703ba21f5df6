//! Where currents are not unique.

use fluxform_testing::force_problems::{Case, small_case, telling_lambdas};

/// Currents of least power: no exchange among coils that leaves the forces as they are, and
/// keeps within the limits, saves power.
#[test]
fn equally_good_currents_have_least_power() {
    let mut exchanges = 0;
    for seed in 0..3000 {
        let case = small_case(seed);
        let m = case.coils();
        let solution = case.solve();
        if solution.rank == m {
            continue;
        }
        let directions: Vec<Vec<f64>> = (0..7_usize.pow(m as u32))
            .map(|code| {
                (0..m)
                    .map(|i| (code / 7_usize.pow(i as u32) % 7) as f64 - 3.0)
                    .collect::<Vec<_>>()
            })
            .filter(|z| z.iter().any(|&v| v != 0.0))
            .filter(|z| {
                case.forces
                    .chunks(m)
                    .all(|row| row.iter().zip(z).map(|(g, z)| g * z).sum::<f64>() == 0.0)
            })
            .collect();
        for lambda in telling_lambdas(&solution) {
            let currents = solution.path.currents_a(lambda);
            let sum: f64 = currents.iter().sum();
            let size = case
                .upper
                .iter()
                .zip(&case.lower)
                .fold(0.0_f64, |s, (u, l)| s.max(u - l));
            for z in &directions {
                let room = |i: usize| {
                    let left = if z[i] > 0.0 {
                        case.upper[i] - currents[i]
                    } else {
                        currents[i] - case.lower[i]
                    };
                    z[i] == 0.0 || left > 1e-9 * size
                };
                let total = case
                    .total
                    .is_none_or(|t| z.iter().sum::<f64>() <= 0.0 || sum < t - 1e-9 * size);
                if (0..m).all(room) && total {
                    exchanges += 1;
                    let saved: f64 = (0..m).map(|i| -case.ohm[i] * currents[i] * z[i]).sum();
                    assert!(
                        saved <= 1e-11 * size,
                        "{seed} at {lambda}: {z:?} saves {saved:e} at {currents:?}; {case:?}"
                    );
                }
            }
        }
    }
    assert!(exchanges > 1000, "{exchanges}");
}

#[test]
fn coincident_coils_share_the_current_by_their_resistance() {
    // Coils 0 and 2 stand at one place; coil 2 has 3 times the resistance and a low limit.
    let column = [0.31, 0.27, 0.44];
    let other = [0.05, 0.21, 0.13];
    let case = Case {
        forces: (0..3)
            .flat_map(|j| [column[j], other[j], column[j]])
            .collect(),
        heights: vec![0.03, 0.05, 0.04],
        offset: None,
        lower: vec![0.0; 3],
        upper: vec![2.0, 2.0, 0.01],
        total: None,
        ohm: vec![2.0, 6.0, 6.0],
    };
    let solution = case.solve();
    assert_eq!(solution.rank, 2);
    let small = solution.path.currents_a(0.1);
    assert!((small[0] / small[2] - 3.0).abs() < 1e-13, "{small:?}");
    // The shared coil's limit costs nothing as long as its twin can take over.
    let linear = solution
        .constants
        .lambda_linear_n_per_m
        .expect("limits bind");
    let currents = solution.path.currents_a(linear);
    assert!(
        (currents[2] - 0.01).abs() < 1e-13 && (currents[0] - 2.0).abs() < 1e-10
            || (currents[1] - 2.0).abs() < 1e-10
    );
    // A difference within rounding changes nothing of this.
    let mut rounded = case.clone();
    for j in 0..3 {
        rounded.forces[3 * j + 2] *= 1.0 + f64::EPSILON * (j as f64 - 1.0);
    }
    let again = rounded.solve();
    assert_eq!(again.rank, 2);
    let close = |a: f64, b: f64| (a / b - 1.0).abs() < 1e-12;
    assert!(close(
        again.constants.lambda_linear_n_per_m.expect("limits bind"),
        linear
    ));
    assert!(
        again
            .path
            .currents_a(0.1)
            .iter()
            .zip(&small)
            .all(|(a, b)| close(*a, *b))
    );
}
