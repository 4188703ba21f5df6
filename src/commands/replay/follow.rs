//! The numbers along a trajectory that a runtime has no time for.

use crate::RunError;
use crate::bundle::replay::{Answer, FingerRows, ReplayRows};
use crate::bundle::trajectory::Trajectory;
use crate::coil::drive::Drive;
use crate::lambda::two_fingers::FingerMagnet;
use crate::numerics::vec3::{dot, minus};
use crate::progress::Progress;

use super::felt::Felt;
use super::renderer::{Renderer, Step};
use super::summary::{Bounds, CurrentSums, Followed};
use super::{Opened, PORTION};

/// While currents follow a command forces are looked at over parts of the time, in the middle of each too; the first
/// is this share of the shortest time constant,
const FIRST: f64 = 1.0 / 8.0;
/// and each longer than the one before by this factor.
const GROWTH: f64 = 1.7;

/// A step of one finger or two.
pub(super) struct Steps {
    pub(super) first: Step,
    second: Option<Step>,
    /// Force of one magnet on the other, N.
    pushed_n: f64,
}

impl Steps {
    /// That of a row, its currents written to `currents_a`.
    pub(super) fn take(
        renderer: &mut Renderer,
        trajectory: &Trajectory,
        row: usize,
        currents_a: &mut [f64],
    ) -> Self {
        let position_m = trajectory.position_m[row];
        let Some(second_m) = trajectory.second_m.get(row) else {
            let first = renderer.step(position_m, currents_a);
            return Self {
                first,
                second: None,
                pushed_n: 0.0,
            };
        };
        let (steps, push_n) = renderer.pair_step([position_m, *second_m], currents_a);
        let [first, second] = steps;
        Self {
            first,
            second: Some(second),
            pushed_n: dot(push_n, push_n).sqrt(),
        }
    }

    fn iter(&self) -> impl Iterator<Item = &Step> {
        std::iter::once(&self.first).chain(&self.second)
    }

    /// The force on each finger with these currents, N, right after its step.
    fn given_n(&self, renderer: &Renderer, currents_a: &[f64]) -> [[f64; 3]; 2] {
        match self.second {
            None => [renderer.given_n(&self.first, currents_a), [0.0; 3]],
            Some(second) => renderer.pair_given_n(&[self.first, second], currents_a),
        }
    }
}

/// Goes through the positions again for the numbers that a runtime has no time for.
pub(super) struct Follower {
    renderer: Renderer,
    /// The bundle's static currents.
    fixed_a: Vec<f64>,
    resistance_ohm: Vec<f64>,
    pub(super) bounds: Bounds,
    /// That of the current loop, Hz, where the drivers close one.
    bandwidth_hz: Option<f64>,
    /// Where currents are chosen for uncertainties.
    pub(super) felt: Option<Felt>,
    /// The largest force of one finger's magnet on the other's, N.
    pub(super) pushed_n: f64,
    /// The magnets of two fingers where they are whole cylinders, which push each other as dipoles here.
    pub(super) cylinders: Option<FingerMagnet>,
}

/// A position with its step.
#[derive(Clone, Copy)]
struct At<'a> {
    trajectory: &'a Trajectory,
    steps: &'a Steps,
    row: usize,
}

impl Follower {
    /// Of a bundle's trajectory with these steps.
    pub(super) fn new(
        opened: &Opened,
        renderer: Renderer,
        bandwidth_hz: Option<f64>,
        steps: &[Steps],
    ) -> Self {
        let inside = steps
            .iter()
            .filter(|steps| steps.first.answer != Answer::Outside);
        let fixed = opened.bundle.currents.iter();
        Self {
            renderer,
            fixed_a: fixed.map(|row| row.current_a).collect(),
            resistance_ohm: opened.bundle.map.runtime.resistance_ohm.clone(),
            bounds: Bounds::of(&opened.bundle),
            bandwidth_hz,
            felt: opened.felt(inside.count()),
            pushed_n: 0.0,
            cylinders: None,
        }
    }

    pub(super) fn rows(
        &mut self,
        trajectory: &Trajectory,
        steps: &[Steps],
        commanded_a: Vec<f64>,
        mut drive: Option<&mut Drive>,
        progress: &dyn Progress,
    ) -> Result<Followed, RunError> {
        let coils = self.renderer.coils();
        let held_s = trajectory.held_s();
        let empty = || ReplayRows {
            coils,
            second: (!trajectory.second_m.is_empty()).then(FingerRows::default),
            ..ReplayRows::default()
        };
        let mut found = Followed {
            rows: empty(),
            within: drive.is_some().then(empty),
            counts_s: Vec::new(),
            currents: CurrentSums::new(&self.resistance_ohm),
        };
        // All at one time: each counts alike.
        let timed = held_s.iter().any(|held_s| *held_s > 0.0);
        let counts = |counts_s: f64| if timed { counts_s } else { 1.0 };
        let mut flowing = vec![0.0; coils];
        let mut again = vec![0.0; coils];
        for (row, steps) in steps.iter().enumerate() {
            if row % PORTION == 0 {
                progress.check()?;
            }
            let command = &commanded_a[row * coils..(row + 1) * coils];
            Steps::take(&mut self.renderer, trajectory, row, &mut again);
            flowing.copy_from_slice(command);
            let at = At {
                trajectory,
                steps,
                row,
            };
            if let Some(drive) = &mut drive {
                if row == 0 {
                    drive.settle(command);
                }
                self.follow(&mut found, at, (drive, command), held_s[row], counts);
                drive.currents(&mut flowing);
            } else {
                found.counts_s.push(counts(held_s[row]));
                found.currents.add(&flowing, counts(held_s[row]));
            }
            self.add(&mut found.rows, at, trajectory.t_s[row], &flowing);
            found.rows.current_a.extend(&flowing);
            self.pushed_n = self.pushed_n.max(steps.pushed_n);
            let mut answers = steps.iter().map(|step| step.answer);
            if answers.any(|answer| answer != Answer::Outside) {
                let (step, position) = (&steps.first, trajectory.position_m[row]);
                let certificate = self.renderer.certificate(step, command);
                self.bounds.certificate = self.bounds.certificate.max(certificate);
                let push = self.cylinders.filter(|_| steps.pushed_n > 0.0);
                let off_n = push
                    .zip(trajectory.second_m.get(row))
                    .map_or([0.0; 3], |(magnet, second)| {
                        magnet.off_dipoles_n(minus(*second, position))
                    });
                for finger in trajectory.fingers() {
                    self.bounds
                        .add(self.renderer.map(), finger[row], &flowing, off_n);
                }
                if let Some(felt) = &mut self.felt {
                    felt.add(&self.renderer, position, step, command);
                }
            }
        }
        if drive.is_some() {
            found.rows.commanded_a = commanded_a;
        }
        Ok(found)
    }

    /// Lets the currents follow a command while a position is held, and adds what they give meanwhile.
    fn follow(
        &self,
        found: &mut Followed,
        at: At,
        (drive, command): (&mut Drive, &[f64]),
        held_s: f64,
        counts: impl Fn(f64) -> f64,
    ) {
        let mut flowing = vec![0.0; command.len()];
        let mut look = |found: &mut Followed, drive: &Drive, since_s: f64, weight_s: f64| {
            drive.currents(&mut flowing);
            if let Some(within) = &mut found.within {
                self.add(within, at, at.trajectory.t_s[at.row] + since_s, &flowing);
                let counts_s = counts(weight_s);
                found.counts_s.push(counts_s);
                found.currents.add(&flowing, counts_s);
            }
        };
        let advance = |drive: &mut Drive, part_s: f64| match self.bandwidth_hz {
            None => drive.hold(command, part_s),
            Some(bandwidth_hz) => drive.track(command, part_s, bandwidth_hz),
        };
        let [shortest_s, _] = drive.time_constants_s().unwrap_or_default();
        let pace_s = self.bandwidth_hz.map_or(shortest_s, |bandwidth_hz| {
            shortest_s.min(1.0 / (std::f64::consts::TAU * bandwidth_hz))
        });
        let (mut part_s, mut since_s, mut before_s) = (FIRST * pace_s, 0.0, 0.0);
        loop {
            // No short part is left over at the end.
            let left_s = held_s - since_s;
            let next_s = if left_s > 1.5 * part_s && part_s > 0.0 {
                part_s
            } else {
                left_s
            };
            // Simpson's rule: what relaxes exponentially bends in the middle of a part.
            look(found, drive, since_s, (before_s + next_s) / 6.0);
            if left_s <= 0.0 {
                break;
            }
            advance(drive, 0.5 * next_s);
            look(found, drive, since_s + 0.5 * next_s, 4.0 * next_s / 6.0);
            advance(drive, 0.5 * next_s);
            since_s = if next_s == left_s {
                held_s
            } else {
                since_s + next_s
            };
            before_s = next_s;
            part_s *= GROWTH;
        }
    }

    /// Adds a row at `t_s` with the forces of the currents that flow.
    fn add(&self, rows: &mut ReplayRows, at: At, t_s: f64, flowing: &[f64]) {
        let (steps, row) = (at.steps, at.row);
        rows.t_s.push(t_s);
        let given_n = steps.given_n(&self.renderer, flowing);
        let static_n = steps.given_n(&self.renderer, &self.fixed_a);
        let fingers = std::iter::once(&mut rows.first).chain(&mut rows.second);
        let all = fingers.zip(steps.iter()).zip(at.trajectory.fingers());
        for (finger, ((rows, step), positions_m)) in all.enumerate() {
            let [x, y, z] = given_n[finger];
            rows.position_m.push(positions_m[row]);
            rows.height_m.push(step.height_m);
            rows.wanted_force_n.push(step.wanted_n);
            rows.force_n.push(z);
            if let Some(sideways) = step.sideways {
                rows.wanted_sideways_n.push(sideways.wanted_n);
                rows.sideways_n.push([x, y]);
            }
            rows.static_force_n.push(static_n[finger][2]);
            rows.answer.push(step.answer);
        }
    }
}
