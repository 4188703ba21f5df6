//! Two fingers on one array: both get their force, whose magnets push each other too.

use fluxform::bundle::replay::{Answer, FingerRows};
use fluxform::bundle::trajectory::Trajectory;
use fluxform::commands::replay::summary::TrajectorySource;
use fluxform::commands::replay::{Opened, ReplayReport, run};
use fluxform::design::{Design, Need};
use fluxform::lambda::two_fingers::between_magnets_n;
use fluxform::progress::Silent;
use fluxform::scene::moment_a_m2;
use fluxform_testing::Random;
use fluxform_testing::place::Place;

use crate::support::{both_ways, both_ways_along_the_normal};

fn replayed(opened: &Opened, trajectory: &Trajectory) -> Result<ReplayReport, String> {
    let source = TrajectorySource {
        source: "a test".to_owned(),
        input: None,
        synthesis: None,
    };
    run(opened, trajectory, source, false, &Silent).map_err(|error| error.to_string())
}

/// Pairs 45 to 60 mm apart near the surface.
fn pairs(count: usize) -> Trajectory {
    let mut random = Random::new(29);
    let mut trajectory = Trajectory::default();
    for row in 0..count {
        let half = 0.0225 + 0.0075 * random.unit();
        let (sine, cosine) = (6.0 * random.unit()).sin_cos();
        let mut finger = |sign: f64| {
            let z = 0.048 + 0.003 * random.unit();
            [sign * half * cosine, sign * half * sine, z]
        };
        trajectory.position_m.push(finger(1.0));
        trajectory.second_m.push(finger(-1.0));
        trajectory.t_s.push(0.01 * row as f64);
    }
    trajectory
}

fn moment(opened: &Opened) -> [f64; 3] {
    let path = opened.bundle.folder.join("design.toml");
    moment_a_m2(&Design::read(&path, Need::SWEEP).unwrap().0)
}

fn expected(rows: &FingerRows, row: usize) -> [f64; 3] {
    let [x, y] = rows.wanted_sideways_n.get(row).copied().unwrap_or_default();
    [x, y, rows.wanted_force_n[row]]
}

#[test]
fn both_get_their_force_from_coils_and_from_the_other_s_magnet() {
    for (opened, axes) in [
        (both_ways().open("flat"), 2..3),
        (both_ways_along_the_normal().open("flat"), 0..3),
    ] {
        let trajectory = pairs(300);
        let report = replayed(&opened, &trajectory).unwrap();
        let (rows, moment) = (&report.rows, moment(&opened));
        let fingers: Vec<&FingerRows> = rows.fingers().collect();
        let mut per_ampere = vec![[0.0; 3]; rows.coils];
        let mut upward = vec![0.0; rows.coils];
        let mut both = 0;
        for row in 0..rows.len() {
            let apart: [f64; 3] = std::array::from_fn(|axis| {
                trajectory.second_m[row][axis] - trajectory.position_m[row][axis]
            });
            let on_second = between_magnets_n(moment, apart);
            if fingers
                .iter()
                .all(|finger| finger.answer[row] == Answer::Ok)
            {
                both += 1;
            }
            for (finger, sign) in fingers.iter().zip([-1.0, 1.0]) {
                // By the bundle's own lookup, not by the loop's.
                let at = finger.position_m[row];
                if axes.start == 2 {
                    opened.bundle.force_per_ampere(at, &mut upward);
                    let parts = per_ampere.iter_mut().zip(&upward);
                    parts.for_each(|(vector, force)| vector[2] = *force);
                } else {
                    opened.bundle.force_vector_per_ampere(at, &mut per_ampere);
                }
                let request = expected(finger, row);
                let scale = 1e-3 * request[2].abs().max(0.01);
                for axis in axes.clone() {
                    let terms = per_ampere.iter().zip(rows.currents_a(row));
                    let coils: f64 = terms.map(|(force, current)| force[axis] * current).sum();
                    let force = coils + sign * on_second[axis];
                    if axis == 2 {
                        assert!((force - finger.force_n[row]).abs() < 1e-12);
                    } else {
                        assert!((force - finger.sideways_n[row][axis]).abs() < 1e-12);
                    }
                    let error = (force - request[axis]).abs();
                    assert!(
                        finger.answer[row] != Answer::Ok || error < scale,
                        "{row}: {error}"
                    );
                }
            }
        }
        let share = f64::from(both) / 300.0;
        let two = report.summary.two_fingers.as_ref().unwrap();
        assert!(
            (two.both_given_time_fraction - share).abs() < 1e-9 && share > 0.0,
            "{axes:?} {share} of {}",
            two.both_given_time_fraction
        );
        assert!(two.magnets_force_n > 0.0);
    }
}

#[test]
fn neither_is_the_first() {
    let opened = both_ways().open("flat");
    let trajectory = pairs(40);
    let swapped = Trajectory {
        position_m: trajectory.second_m.clone(),
        second_m: trajectory.position_m.clone(),
        t_s: trajectory.t_s.clone(),
    };
    let one = replayed(&opened, &trajectory).unwrap().rows;
    let other = replayed(&opened, &swapped).unwrap().rows;
    for (a, b) in one.current_a.iter().zip(&other.current_a) {
        assert!((a - b).abs() < 1e-9, "{a} {b}");
    }
    for (a, b) in one.first.force_n.iter().zip(&other.second.unwrap().force_n) {
        assert!((a - b).abs() < 1e-9);
    }
}

#[test]
fn a_finger_outside_the_map_counts_for_nothing() {
    let outside = vec![[0.3, 0.0, 0.05]; 40];
    for bundles in [both_ways(), both_ways_along_the_normal()] {
        let opened = bundles.open("flat");
        let Trajectory {
            position_m, t_s, ..
        } = pairs(40);
        let replay = |position_m: &[[f64; 3]], second_m: &[[f64; 3]]| {
            let trajectory = Trajectory {
                position_m: position_m.to_vec(),
                second_m: second_m.to_vec(),
                t_s: t_s.clone(),
            };
            replayed(&opened, &trajectory).unwrap().rows
        };
        let alone = replay(&position_m, &[]);
        let first = replay(&position_m, &outside);
        assert_eq!(first.second.as_ref().unwrap().answer[0], Answer::Outside);
        let second = replay(&outside, &position_m);
        assert_eq!(alone.first, first.first);
        assert_eq!(Some(&alone.first), second.second.as_ref());
        assert_eq!(alone.current_a, first.current_a);
        assert_eq!(alone.current_a, second.current_a);
    }
}

#[test]
fn out_of_reach_a_sideways_error_counts_by_its_weight() {
    let opened = both_ways_along_the_normal().open("flat");
    let rows = replayed(&opened, &pairs(100)).unwrap().rows;
    let runtime = &opened.bundle.map.runtime;
    let requested = runtime.rendering.as_ref().unwrap().requested.as_ref();
    let weight = requested.unwrap().sideways_weight;
    let fingers: Vec<&FingerRows> = rows.fingers().collect();
    let mut per_ampere = [vec![[0.0; 3]; rows.coils], vec![[0.0; 3]; rows.coils]];
    let mut saturated = 0;
    for row in 0..rows.len() {
        if fingers
            .iter()
            .all(|finger| finger.answer[row] == Answer::Ok)
        {
            continue;
        }
        saturated += 1;
        let mut errors_n = [[0.0; 3]; 2];
        for (at, finger) in fingers.iter().enumerate() {
            opened
                .bundle
                .force_vector_per_ampere(finger.position_m[row], &mut per_ampere[at]);
            let [x, y] = finger.sideways_n[row];
            let request = expected(finger, row);
            errors_n[at] = [
                x - request[0],
                y - request[1],
                finger.force_n[row] - request[2],
            ];
        }
        // Along every current that may move, the weighted square of the errors does not fall.
        let currents_a = rows.currents_a(row);
        let sum: f64 = currents_a.iter().sum();
        for coil in 0..rows.coils {
            let mut slope = 0.0;
            let mut size = 0.0;
            for (errors, forces) in errors_n.iter().zip(&per_ampere) {
                for (axis, share) in [weight, weight, 1.0].into_iter().enumerate() {
                    let term = 2.0 * share * share * errors[axis] * forces[coil][axis];
                    slope += term;
                    size += term.abs();
                }
            }
            let room = 1e-9;
            let total = runtime.total_current_max_a.unwrap_or(f64::INFINITY);
            let up = currents_a[coil] < runtime.current_max_a[coil] - room && sum < total - room;
            let down = currents_a[coil] > runtime.current_min_a[coil] + room;
            assert!(
                !up || slope > -1e-3 * size,
                "{row}, coil {coil}: {slope} of {size}"
            );
            assert!(
                !down || sum > total - room || slope < 1e-3 * size,
                "{row}, coil {coil}: {slope} of {size}"
            );
        }
    }
    assert!(saturated > 10, "{saturated}");
}

#[test]
fn magnets_that_overlap_are_refused_with_their_time() {
    let opened = both_ways().open("flat");
    let mut trajectory = pairs(3);
    trajectory.second_m[1] = trajectory.position_m[1].map(|part| part + 1e-3);
    let message = replayed(&opened, &trajectory).unwrap_err();
    assert!(
        message
            .contains("at 0.01 s the two fingers are 1.414 mm apart across their magnets' axis and 1 mm along it"),
        "{message}"
    );
}

/// Beside the push of dipoles that of whole cylinders, 31 mN away, was in no error.
#[test]
fn regression_whole_magnets_pushed_each_other_as_dipoles_without_a_word() {
    let place = Place::new();
    let design = place
        .text("designs/seed_air.toml")
        .replace("model = \"dipole\"", "model = \"cylinder\"");
    place.write("whole.toml", &design);
    let args = [
        "calibrate",
        "whole.toml",
        "shapes/flat.toml",
        "--out",
        "b",
        "--no-report",
    ];
    place.run(&args).ends(0);
    place.write(
        "pair.csv",
        "t_s,x_m,y_m,z_m,x2_m,y2_m,z2_m\n0,0,0,0.045,0.02,0,0.055\n",
    );
    let args = [
        "replay",
        "b/seed_air/flat",
        "pair.csv",
        "--out",
        "r.csv",
        "--format",
        "json",
    ];
    let report = place.run(&args).ends(0).json();
    let stated = report["accuracy"]["force"]["estimate"].as_f64().unwrap();
    assert!((0.03099..0.033).contains(&stated), "{stated}");
    let warnings = report["warnings"].to_string();
    assert!(
        warnings.contains("as whole cylinders by up to"),
        "{warnings}"
    );
}
