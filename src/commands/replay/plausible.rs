//! Whether a trajectory is plausible, before a replay of it is believed.

use crate::bundle::trajectory::Trajectory;
use crate::lambda::two_fingers::FingerMagnet;

/// A time between positions longer than so many median ones is a gap.
const GAP: f64 = 10.0;
/// A median time between positions longer than this betrays milliseconds, s.
const SLOW_S: f64 = 1.0;
/// Gaps that are listed one by one.
const GAPS_LISTED: usize = 3;
/// Millimetres taken for metres.
const MILLI: f64 = 1e-3;

fn inside(ends_m: &[[f64; 2]; 3], position: [f64; 3]) -> bool {
    let mut axes = ends_m.iter().zip(position);
    axes.all(|([from, to], value)| *from <= value && value <= *to)
}

/// The number of positions, of all fingers, for which that holds.
fn count(trajectory: &Trajectory, holds: impl Fn([f64; 3]) -> bool) -> usize {
    let positions = trajectory.fingers().flatten();
    positions.filter(|p| holds(**p)).count()
}

/// Whether a position is metres away, and inside if it is in millimetres.
fn milli(ends_m: &[[f64; 2]; 3], position: [f64; 3]) -> bool {
    let far = position.iter().any(|value| value.abs() > 1.0);
    far && inside(ends_m, position.map(|value| value * MILLI))
}

/// Whether no position lies within `ends_m` (x, y, z, m) but most would in millimetres.
#[must_use]
pub fn in_millimetres(trajectory: &Trajectory, ends_m: &[[f64; 2]; 3]) -> bool {
    let none = count(trajectory, |p| inside(ends_m, p)) == 0;
    none && 2 * count(trajectory, |p| milli(ends_m, p)) > count(trajectory, |_| true)
}

/// The first time at which the upright magnets of two fingers would overlap, as a sentence.
pub(super) fn touching(trajectory: &Trajectory, magnet: &FingerMagnet) -> Option<String> {
    let pairs = trajectory.position_m.iter().zip(&trajectory.second_m);
    let apart = pairs.map(|(a, b)| [0, 1, 2].map(|k| a[k] - b[k]));
    let mut at = apart.zip(&trajectory.t_s);
    at.find(|(apart_m, _)| magnet.overlaps(*apart_m))
        .map(|(apart_m, t_s)| {
            let [along_m, across_m] = magnet.along_and_across_m(apart_m);
            let mm = |length_m: f64| (length_m * 1e6).round() / 1e3;
            format!(
                "at {t_s} s the two fingers are {} mm apart across their magnets' axis and {} mm along it, where these, \
                 {} mm wide and {} mm long, overlap",
                mm(across_m),
                mm(along_m),
                mm(magnet.diameter_m),
                mm(magnet.length_m)
            )
        })
}

/// Warnings about an implausible trajectory.
#[must_use]
pub fn warnings(trajectory: &Trajectory, ends_m: &[[f64; 2]; 3]) -> Vec<String> {
    let mut found = Vec::new();
    let milli = count(trajectory, |p| milli(ends_m, p));
    if milli > 0 {
        found.push(format!(
            "{milli} of {} positions lie metres away, but inside the map if they are in millimetres: \
             x_m, y_m and z_m must be in metres",
            count(trajectory, |_| true)
        ));
    }
    if count(trajectory, |p| inside(ends_m, p)) == 0 {
        let micrometre = |m: f64| (m * 1e6).round() / 1e3;
        let mm = ends_m
            .map(|ends| ends.map(micrometre))
            .map(|[from, to]| format!("{from} to {to}"));
        found.push(format!(
            "no position lies inside the map, which reaches from {} mm in x, {} mm in y and {} mm \
             in z: nothing is rendered",
            mm[0], mm[1], mm[2]
        ));
    }
    let median_s = trajectory.median_step_s();
    let median = (median_s * 1e6).round() / 1e6;
    if median_s > SLOW_S {
        found.push(format!(
            "the median time between positions is {median} s: t_s must be in seconds, not in \
             milliseconds"
        ));
    }
    let times = &trajectory.t_s;
    let gaps: Vec<usize> = (1..times.len())
        .filter(|&row| times[row] - times[row - 1] > GAP * median_s && median_s > 0.0)
        .collect();
    for &row in gaps.iter().take(GAPS_LISTED) {
        found.push(format!(
            "no position from {} s to {} s, more than {GAP} times the median {median} s: the \
             last currents are held meanwhile",
            times[row - 1],
            times[row]
        ));
    }
    if gaps.len() > GAPS_LISTED {
        found.push(format!("and {} such gaps more", gaps.len() - GAPS_LISTED));
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    const BOX: [[f64; 2]; 3] = [[-0.05, 0.05], [-0.05, 0.05], [0.03, 0.07]];

    fn trajectory(t_s: &[f64], factor: f64) -> Trajectory {
        let position = |t: &f64| [0.03 * t.sin(), -0.02, 0.05].map(|v| v * factor);
        Trajectory {
            t_s: t_s.to_vec(),
            position_m: t_s.iter().map(position).collect(),
            ..Trajectory::default()
        }
    }

    #[test]
    fn millimetres_gaps_and_milliseconds_are_seen() {
        let even: Vec<f64> = (0..40).map(|k| 0.02 * f64::from(k)).collect();
        assert!(!in_millimetres(&trajectory(&even, 1.0), &BOX));
        assert!(in_millimetres(&trajectory(&even, 1e3), &BOX));
        assert!(!in_millimetres(&trajectory(&even, 1e2), &BOX));
        assert!(warnings(&trajectory(&even, 1.0), &BOX).is_empty());
        let outside = warnings(&trajectory(&even, 1e2), &BOX);
        assert!(
            outside[0].contains("no position lies inside the map"),
            "{outside:?}"
        );
        // Some rows alone.
        let mut mixed = trajectory(&even, 1.0);
        mixed.position_m[7] = [12.0, -20.0, 50.0];
        assert!(!in_millimetres(&mixed, &BOX));
        let all = warnings(&mixed, &BOX);
        assert!(
            all.len() == 1 && all[0].starts_with("1 of 40 positions lie metres away"),
            "{all:?}"
        );
        // Beside a map that reaches down to z = 0, a thousandth of anything near lies inside.
        let low = [BOX[0], BOX[1], [0.0, 0.07]];
        let mut beside = trajectory(&even, 1.0);
        beside.position_m.iter_mut().for_each(|p| p[0] = 0.3);
        assert!(!in_millimetres(&beside, &low));
        let mut late = even.clone();
        late[30..].iter_mut().for_each(|t| *t += 0.19);
        let all = warnings(&trajectory(&late, 1.0), &BOX);
        assert!(
            all.len() == 1 && all[0].contains("no position from 0.58 s to 0.79"),
            "{all:?}"
        );
        let slow: Vec<f64> = even.iter().map(|t| t * 1e3).collect();
        assert!(warnings(&trajectory(&slow, 1.0), &BOX)[0].contains("milliseconds"));
        assert!(warnings(&trajectory(&[0.7], 1.0), &BOX).is_empty());
    }
}
