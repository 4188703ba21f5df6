//! Currents of coupled coils after voltages that are held for a while.
//!
//! `L dI/dt + R I = v`, with a voltage driver that answers a commanded current I_c by
//! `v_i = R_i I_c,i`, no larger than the supply's. With `x = sqrt(R) I` the equation is symmetric,
//! `T dx/dt + x = v / sqrt(R)`, `T = L / sqrt(R_i R_j)`; the eigenvectors of T are currents that
//! decay without mixing, its eigenvalues their time constants. Every step is the exact solution for
//! held voltages, so a step may be longer than any time constant, and two steps give what one of
//! their length does. Eddy currents are left out; `coil::transient` estimates them.

use fluxform_numerics::bounded_eigen::symmetric_eigen;
use nalgebra::DMatrix;

/// The inductance matrix may be unsymmetric by this share of its largest entry: its error.
const SYMMETRIC: f64 = 1e-2;

/// A part of a step under a current loop, in time constants of the loop, and the most parts of a step.
const PART: f64 = 0.1;
const MOST_PARTS: f64 = 20_000.0;

/// Why the currents of an array cannot be followed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum DriveError {
    /// Lists of different lengths.
    #[error("expected {coils} resistances and {coils} x {coils} inductances")]
    Lengths {
        /// Number of coils.
        coils: usize,
    },
    /// A resistance.
    #[error("coil {coil}: expected a resistance above 0")]
    Resistance {
        /// Its index.
        coil: usize,
    },
    /// The inductance matrix.
    #[error(
        "the inductance matrix is not that of coils: it must be symmetric and give every current an energy above 0"
    )]
    Inductance,
}

/// The circuit of an array, and the currents that flow.
#[derive(Debug, Clone)]
pub struct Drive {
    root_ohm: Vec<f64>,
    /// Largest current that the voltage holds up, A.
    most_a: Vec<f64>,
    /// s, one per mode.
    time_constant_s: Vec<f64>,
    /// `[mode][coil]`.
    modes: Vec<f64>,
    /// Amplitudes of the modes.
    now: Vec<f64>,
    goal: Vec<f64>,
    /// Parts of a difference that are gone and left after the step, 1 together.
    shares: Vec<[f64; 2]>,
    /// The step that `shares` are for, s.
    step_s: f64,
}

impl Drive {
    /// An array without current. `inductance_h` is its matrix, row by row; `voltage_v` the
    /// supply's, if it bounds anything.
    ///
    /// # Errors
    /// Domain: resistances above 0, a symmetric positive definite matrix.
    pub fn new(
        inductance_h: &[f64],
        resistance_ohm: &[f64],
        voltage_v: Option<f64>,
    ) -> Result<Self, DriveError> {
        let coils = resistance_ohm.len();
        if inductance_h.len() != coils * coils {
            return Err(DriveError::Lengths { coils });
        }
        let sound = |r: &f64| *r > 0.0 && r.is_finite();
        if let Some(coil) = resistance_ohm.iter().position(|r| !sound(r)) {
            return Err(DriveError::Resistance { coil });
        }
        let largest = inductance_h
            .iter()
            .fold(0.0_f64, |most, l| most.max(l.abs()));
        let entry = |i: usize, j: usize| inductance_h[i * coils + j];
        let symmetric = (0..coils)
            .all(|i| (0..i).all(|j| (entry(i, j) - entry(j, i)).abs() <= SYMMETRIC * largest));
        if !symmetric || !largest.is_finite() {
            return Err(DriveError::Inductance);
        }
        let root_ohm: Vec<f64> = resistance_ohm.iter().map(|r| r.sqrt()).collect();
        let matrix = DMatrix::from_fn(coils, coils, |i, j| {
            0.5 * (entry(i, j) + entry(j, i)) / (root_ohm[i] * root_ohm[j])
        });
        let (time_constant_s, modes) = if coils == 0 {
            (Vec::new(), Vec::new())
        } else {
            let eigen = symmetric_eigen(matrix).ok_or(DriveError::Inductance)?;
            (
                eigen.eigenvalues.as_slice().to_vec(),
                eigen.eigenvectors.as_slice().to_vec(),
            )
        };
        if !time_constant_s.iter().all(|tau| *tau > 0.0) {
            return Err(DriveError::Inductance);
        }
        let most = |r: &f64| voltage_v.map_or(f64::INFINITY, |voltage| voltage.abs() / r);
        Ok(Self {
            most_a: resistance_ohm.iter().map(most).collect(),
            time_constant_s,
            modes,
            root_ohm,
            now: vec![0.0; coils],
            goal: vec![0.0; coils],
            shares: vec![[0.0, 1.0]; coils],
            step_s: 0.0,
        })
    }

    /// The shortest and the longest time constant, s; `None` without coils.
    #[must_use]
    pub fn time_constants_s(&self) -> Option<[f64; 2]> {
        let shortest = self.time_constant_s.iter().copied().reduce(f64::min)?;
        let longest = self.time_constant_s.iter().copied().reduce(f64::max)?;
        Some([shortest, longest])
    }

    /// Lets the commanded currents (A) flow at once.
    pub fn settle(&mut self, command_a: &[f64]) {
        self.aim(command_a);
        self.now.copy_from_slice(&self.goal);
    }

    /// Holds the voltages of the commanded currents (A) for `step_s`, 0 or more.
    pub fn hold(&mut self, command_a: &[f64], step_s: f64) {
        self.aim(command_a);
        if step_s != self.step_s {
            for (share, tau) in self.shares.iter_mut().zip(&self.time_constant_s) {
                let decay = -step_s / tau;
                *share = [-decay.exp_m1(), decay.exp()];
            }
            self.step_s = step_s;
        }
        for ((now, goal), [gone, left]) in self.now.iter_mut().zip(&self.goal).zip(&self.shares) {
            // From the nearer end: a short step changes little, a long one ends at the goal.
            *now = if gone < left {
                *now + (goal - *now) * gone
            } else {
                goal + (*now - goal) * left
            };
        }
    }

    /// Lets a current loop of this bandwidth (Hz) bring the commanded currents (A) about for `step_s`,
    /// each coil's difference falling by its exponential as long as the supply's voltage suffices.
    ///
    /// Voltages are held for short parts of the step, such that the currents at the end of each are
    /// those of the loop: exact where no voltage is at its bound, else of first order in the part.
    pub fn track(&mut self, command_a: &[f64], step_s: f64, bandwidth_hz: f64) {
        if step_s <= 0.0 {
            return;
        }
        let coils = self.root_ohm.len();
        let pace = std::f64::consts::TAU * bandwidth_hz;
        let parts = (step_s * pace / PART).ceil().clamp(1.0, MOST_PARTS);
        let part_s = step_s / parts;
        let kept = (-pace * part_s).exp();
        let held: Vec<f64> = command_a
            .iter()
            .zip(&self.most_a)
            .map(|(i, most)| i.clamp(-most, *most))
            .collect();
        let mut now = vec![0.0; coils];
        for _ in 0..parts as usize {
            self.currents(&mut now);
            let off = now
                .iter()
                .zip(&held)
                .map(|(now, goal)| (now - goal).abs())
                .fold(0.0, f64::max);
            if off == 0.0 {
                break;
            }
            for (now, goal) in now.iter_mut().zip(&held) {
                *now = goal + (*now - goal) * kept;
            }
            self.voltages_for(&mut now, part_s);
            self.hold(&now, part_s);
        }
    }

    /// Makes of the currents (A) that are to flow after `step_s` those whose voltages bring them about.
    fn voltages_for(&mut self, currents_a: &mut [f64], step_s: f64) {
        let before = self.now.clone();
        self.settle_freely(currents_a);
        for ((goal, before), tau) in self.now.iter_mut().zip(&before).zip(&self.time_constant_s) {
            let decay = -step_s / tau;
            *goal = before + (*goal - before) / -decay.exp_m1();
        }
        self.currents(currents_a);
        self.now = before;
    }

    /// Lets currents flow whatever voltage holds them up.
    fn settle_freely(&mut self, currents_a: &[f64]) {
        let most = std::mem::replace(&mut self.most_a, vec![f64::INFINITY; currents_a.len()]);
        self.settle(currents_a);
        self.most_a = most;
    }

    /// Writes the currents that flow, A.
    pub fn currents(&self, currents_a: &mut [f64]) {
        let coils = self.root_ohm.len();
        let currents = &mut currents_a[..coils];
        currents.fill(0.0);
        for (mode, now) in self.modes.chunks_exact(coils.max(1)).zip(&self.now) {
            for (current, share) in currents.iter_mut().zip(mode) {
                *current += share * now;
            }
        }
        for (current, root) in currents.iter_mut().zip(&self.root_ohm) {
            *current /= root;
        }
    }

    /// The modes' amplitudes in the end.
    fn aim(&mut self, command_a: &[f64]) {
        let coils = self.root_ohm.len();
        for (goal, mode) in self
            .goal
            .iter_mut()
            .zip(self.modes.chunks_exact(coils.max(1)))
        {
            *goal = (0..coils)
                .map(|i| {
                    let held = command_a[i].clamp(-self.most_a[i], self.most_a[i]);
                    mode[i] * self.root_ohm[i] * held
                })
                .sum();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const R: [f64; 3] = [6.07, 5.3, 7.1];
    const L: [f64; 9] = [0.21, -0.02, 0.013, -0.02, 0.19, -0.03, 0.013, -0.03, 0.24];

    fn currents(drive: &Drive) -> [f64; 3] {
        let mut now = [f64::NAN; 3];
        drive.currents(&mut now);
        now
    }

    #[test]
    fn a_current_loop_follows_its_exponential_and_is_held_up_by_the_voltage() {
        let mut drive = Drive::new(&L, &R, None).unwrap();
        let goal = [1.3, -0.4, 0.7];
        drive.track(&goal, 0.0021, 130.0);
        let left = (-std::f64::consts::TAU * 130.0 * 0.0021_f64).exp();
        for (now, goal) in currents(&drive).iter().zip(goal) {
            assert!((now - goal * (1.0 - left)).abs() < 1e-9, "{now} {goal}");
        }
        // One coil on a bounded voltage reaches its current after -tau ln(1 - R I / V).
        let mut drive = Drive::new(&[0.21], &[6.07], Some(36.0)).unwrap();
        let slew_s = -(0.21 / 6.07) * (1.0 - 6.07 * 1.7 / 36.0_f64).ln();
        drive.track(&[1.7], slew_s, 1e4);
        let mut now = [0.0];
        drive.currents(&mut now);
        assert!((now[0] / 1.7 - 1.0).abs() < 5e-3, "{now:?}");
        // Regression: in no time currents were not a number.
        let before = now;
        drive.track(&[0.7], 0.0, 1e4);
        drive.currents(&mut now);
        assert_eq!(now, before);
        // The loop's own currents never pass the voltage's.
        drive.track(&[9.0], 3.0, 1e3);
        drive.currents(&mut now);
        assert!((now[0] / (36.0 / 6.07) - 1.0).abs() < 1e-9, "{now:?}");
    }

    /// Regression: after a millionth of the time constant ten digits of the current were left.
    #[test]
    fn a_step_far_shorter_than_the_time_constant_keeps_its_digits() {
        let mut drive = Drive::new(&[0.7], &[1.3], None).unwrap();
        let mut now = [0.0];
        for (steps, part) in [(1.0, 1e-6), (3.0, 2e-6)] {
            drive.hold(&[1.7], part * 0.7 / 1.3);
            drive.currents(&mut now);
            let requested = -1.7 * (-steps * 1e-6_f64).exp_m1();
            assert!(
                (now[0] / requested - 1.0).abs() < 1e-14,
                "{now:?} {requested}"
            );
        }
    }

    #[test]
    fn one_coil_reaches_its_share_after_one_and_five_time_constants() {
        let mut drive = Drive::new(&[0.184], &[6.0753], Some(36.0)).unwrap();
        let tau = 0.184 / 6.0753;
        let mut now = [0.0];
        drive.hold(&[1.3], tau);
        drive.currents(&mut now);
        assert!((now[0] / 1.3 - (1.0 - (-1.0_f64).exp())).abs() < 1e-14);
        drive.hold(&[1.3], 4.0 * tau);
        drive.currents(&mut now);
        assert!((now[0] / 1.3 - (1.0 - (-5.0_f64).exp())).abs() < 1e-14);
        // The supply holds up 36 V / R and no more.
        drive.hold(&[9.0], 1e3);
        drive.currents(&mut now);
        assert!((now[0] - 36.0 / 6.0753).abs() < 1e-13);
    }

    #[test]
    fn coupled_coils_obey_their_equation_whatever_the_step() {
        let command = [1.3, 0.0, -0.7];
        let mut once = Drive::new(&L, &R, None).unwrap();
        once.hold(&[0.2, 0.9, 0.4], 0.01);
        let mut often = once.clone();
        // L dI/dt + R I = R I_c by central differences.
        let step = 1e-6;
        let mut around = [-step, 0.0, step].map(|_| once.clone());
        for (drive, after) in around.iter_mut().zip([0.007 - step, 0.007, 0.007 + step]) {
            drive.hold(&command, after);
        }
        let [before, at, after] = around.each_ref().map(currents);
        for i in 0..3 {
            let flux: f64 = (0..3)
                .map(|j| L[3 * i + j] * (after[j] - before[j]) / (2.0 * step))
                .sum();
            assert!(
                (flux + R[i] * (at[i] - command[i])).abs() < 1e-7,
                "{i}: {flux}"
            );
        }
        once.hold(&command, 0.091);
        for _ in 0..13 {
            often.hold(&command, 0.007);
        }
        for (a, b) in currents(&once).iter().zip(currents(&often)) {
            assert!((a - b).abs() < 1e-13, "{a} {b}");
        }
        once.hold(&command, 1e6);
        for (a, b) in currents(&once).iter().zip(command) {
            assert!((a - b).abs() < 1e-14, "{a} {b}");
        }
    }

    #[test]
    fn what_is_no_array_is_refused() {
        assert_eq!(
            Drive::new(&L, &R[..2], None).unwrap_err(),
            DriveError::Lengths { coils: 2 }
        );
        assert_eq!(
            Drive::new(&[0.1], &[0.0], None).unwrap_err(),
            DriveError::Resistance { coil: 0 }
        );
        let none = [f64::NAN, 0.01, 0.01, 0.1];
        for bad in [[0.1, 0.3, 0.3, 0.1], [0.1, 0.05, 0.0, 0.1], [0.0; 4], none] {
            let refused = Drive::new(&bad, &[1.0, 1.3], None).unwrap_err();
            assert_eq!(refused, DriveError::Inductance);
        }
        assert_eq!(Drive::new(&[], &[], None).unwrap().time_constants_s(), None);
    }
}
