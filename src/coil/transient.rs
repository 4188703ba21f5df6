//! Current and force after a voltage step, with eddy currents in the solid core.
//!
//! While the current rises, eddy currents keep the flux out of the core's inside, so the force
//! lags the current. The model is a long cylinder of radius a, permeability mu = mu_0 mu_r and
//! conductivity sigma, in which the axial field H(r, t) diffuses, with its ends lumped into one
//! demagnetising factor N:
//!
//! ```text
//! mu sigma dH/dt = (1/r) d/dr (r dH/dr),   H(a, t) = h I - N M,   M = chi mean(H),   chi = mu_r - 1
//! ```
//!
//! With T = mu sigma a^2 and G(s) = 2 I_1(q) / (q I_0(q)), q^2 = s T, the mean of H is G H(a), so
//! the mean magnetisation over its static value is m(s) = (1 + beta) G / (1 + beta G) times the
//! current's Laplace transform, beta = N chi. The circuit is V = R I + d/dt (L_air I + (L - L_air) m),
//! the force follows share * I + (1 - share) * m, share being the winding's part of the gradient.
//!
//! N comes from the static inductances. Where the core's magnetisation follows the winding's field,
//! L - L_air = kappa L_air chi / (1 + N chi), with kappa the share of the air coil's field energy
//! that lies inside the core ([`core_energy_share`]): the exact limit for mu_r near 1, and one
//! equation for N.
//!
//! All poles lie on the negative real axis. With q = i x the poles of the current are the zeros of
//!
//! ```text
//! F(x) = (J_0 + beta g)(R - p L_air) - p (L - L_air)(1 + beta) g,   g = 2 J_1(x) / x,   p = x^2 / T
//! ```
//!
//! one between every two neighbours among 0, the zeros of J_1 and the x at which p = R / L_air
//! (1/G falls, and what it must equal rises, between them). Current and force are sums of
//! exponentials with the residues there; both rise monotonically.
//!
//! Left out: the coil's own eddy currents, what the core screens beyond its steel's part (1/mu_r of
//! the whole), hysteresis, and how flux spreads along the core while it settles: the ends are lumped.

use fluxform_base::accuracy::StageAccuracy;
use fluxform_base::units::MU_0_T_M_PER_A;
use fluxform_field::steel::bore::bore_field;
use fluxform_field::winding::Winding;
use fluxform_numerics::bessel::{j0_j1, zero_of_j1};
use fluxform_numerics::gauss;

/// Time constant of a current that is there at once, over the lag of the magnetisation.
const AT_ONCE: f64 = 1e-3;
/// Remainder of a step when it counts as settled.
pub const LEFT: f64 = 0.05;
/// Modes that have decayed by exp(-45) at the earliest settling time are left out.
const DECAYED: f64 = 45.0;
/// More modes than this are refused.
const MODES_MAX: u32 = 200_000;
/// Eddy currents that die out this much sooner than the current change nothing in a double.
const NO_EDDIES: f64 = 1e-18;
/// Relative slack for inductances and shares that were rounded or integrated.
const ROUNDED: f64 = 1e-6;
/// Steps of a safeguarded root search: far more than bisection alone needs.
const ROOT_STEPS: usize = 300;

/// A coil that is connected to a voltage.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VoltageStep {
    /// Resistance R, ohm; > 0.
    pub resistance_ohm: f64,
    /// Self inductance without the core, H; > 0.
    pub air_inductance_h: f64,
    /// Static self inductance with the core, H; not below that without.
    pub inductance_h: f64,
    /// The core's relative permeability; >= 1.
    pub relative_permeability: f64,
    /// The core's conductivity, S/m; >= 0, 0 for a core without eddy currents.
    pub conductivity_s_per_m: f64,
    /// The core's radius, m; >= 0.
    pub core_radius_m: f64,
    /// Share of the air coil's field energy that lies inside the core, in (0, 1]; 1 gives the
    /// shortest lag.
    pub core_energy_share: f64,
    /// Share of the static gradient that comes from the winding alone, in [0, 1].
    pub air_share: f64,
}

/// When current and force have settled.
#[derive(Debug, Clone, PartialEq)]
pub struct Settling {
    /// The current reaches 95 % of its final value, s.
    pub current_95_s: f64,
    /// The force does, s.
    pub force_95_s: f64,
    /// Five static time constants L / R, s: the measure without eddy currents.
    pub five_tau_s: f64,
    /// Mean lag of the magnetisation behind the current, T / (8 (1 + beta)), s.
    pub lag_s: f64,
    /// How far the force's time can be trusted.
    pub accuracy: StageAccuracy,
}

/// Why there is no settling time.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum TransientError {
    /// An input outside its domain.
    #[error("{name}: expected {expected}, found {found:?}")]
    OutOfDomain {
        /// The input.
        name: &'static str,
        /// Its domain.
        expected: &'static str,
        /// Its value.
        found: f64,
    },
    /// The core's diffusion is too slow against the winding alone.
    #[error(
        "the core's diffusion time, {diffusion_s:.3e} s, exceeds the winding's own time constant, \
         {air_s:.3e} s, too far for the sum over its modes"
    )]
    TooSlow {
        /// T = mu sigma a^2, s.
        diffusion_s: f64,
        /// L_air / R, s.
        air_s: f64,
    },
}

impl VoltageStep {
    /// Times to 95 % of the final current and force.
    ///
    /// The sum over the modes and the root keep 1e-12 of the time (the tests hold them against the
    /// inverted Laplace transform, `tests/oracles/transient.py`); the estimate is the
    /// model's: the largest change of the force's time under two other closures for N, all of the
    /// air coil's energy inside the core, and the static gain of the gradient instead of the
    /// inductance's.
    ///
    /// # Errors
    /// An input outside its domain; a diffusion time over 2.6e10 times L_air / R.
    pub fn settling(&self) -> Result<Settling, TransientError> {
        self.validate()?;
        let tau_s = self.inductance_h / self.resistance_ohm;
        let [current_95_s, force_95_s] = self.times_95_s(self.beta(self.core_energy_share))?;
        let mut others = vec![self.beta(1.0)];
        let core_share = 1.0 - self.air_share;
        if core_share > ROUNDED && self.air_share > ROUNDED {
            others.push(self.beta_of_gain(core_share / self.air_share));
        }
        let mut estimate = 0.0_f64;
        for beta in others {
            let [_, force] = self.times_95_s(beta)?;
            estimate = estimate.max((force / force_95_s - 1.0).abs());
        }
        Ok(Settling {
            current_95_s,
            force_95_s,
            five_tau_s: 5.0 * tau_s,
            lag_s: self.diffusion_s() / (8.0 * (1.0 + self.beta(self.core_energy_share))),
            accuracy: StageAccuracy {
                estimate,
                relative_to: "force_95_s".to_owned(),
                method:
                    "a long cylinder with lumped ends; the change under two other closures for \
                         its demagnetising factor"
                        .to_owned(),
            },
        })
    }

    /// Time to 95 % of the force after a current that is there at once, s: what eddy currents alone
    /// cost where a loop drives the current.
    ///
    /// # Errors
    /// As [`VoltageStep::settling`].
    pub fn eddies_95_s(&self) -> Result<f64, TransientError> {
        let lag_s = self.settling()?.lag_s;
        if lag_s <= 0.0 {
            return Ok(0.0);
        }
        let at_once = Self {
            resistance_ohm: self.inductance_h / (AT_ONCE * lag_s),
            ..*self
        };
        Ok(at_once.settling()?.force_95_s)
    }

    fn validate(&self) -> Result<(), TransientError> {
        let checks = [
            (
                "resistance_ohm",
                self.resistance_ohm,
                self.resistance_ohm > 0.0,
                "more than 0",
            ),
            (
                "air_inductance_h",
                self.air_inductance_h,
                self.air_inductance_h > 0.0,
                "more than 0",
            ),
            (
                "inductance_h",
                self.inductance_h,
                self.inductance_h >= self.air_inductance_h * (1.0 - ROUNDED),
                "no less than without the core",
            ),
            (
                "relative_permeability",
                self.relative_permeability,
                self.relative_permeability >= 1.0,
                "at least 1",
            ),
            (
                "conductivity_s_per_m",
                self.conductivity_s_per_m,
                self.conductivity_s_per_m >= 0.0,
                "0 or more",
            ),
            (
                "core_radius_m",
                self.core_radius_m,
                self.core_radius_m >= 0.0,
                "0 or more",
            ),
            (
                "core_energy_share",
                self.core_energy_share,
                self.core_energy_share > 0.0 && self.core_energy_share <= 1.0 + ROUNDED,
                "more than 0, up to 1",
            ),
            (
                "air_share",
                self.air_share,
                (-ROUNDED..=1.0 + ROUNDED).contains(&self.air_share),
                "0 to 1",
            ),
        ];
        for (name, found, sound, expected) in checks {
            if !(sound && found.is_finite()) {
                return Err(TransientError::OutOfDomain {
                    name,
                    expected,
                    found,
                });
            }
        }
        Ok(())
    }

    /// T = mu sigma a^2, s; 0 for a core without steel, which this model does not see.
    fn diffusion_s(&self) -> f64 {
        if self.relative_permeability == 1.0 {
            return 0.0;
        }
        MU_0_T_M_PER_A
            * self.relative_permeability
            * self.conductivity_s_per_m
            * self.core_radius_m
            * self.core_radius_m
    }

    /// L - L_air, H.
    fn core_inductance_h(&self) -> f64 {
        (self.inductance_h - self.air_inductance_h).max(0.0)
    }

    /// N chi, from the static inductances.
    fn beta(&self, core_energy_share: f64) -> f64 {
        self.beta_of_gain(self.core_inductance_h() / (core_energy_share * self.air_inductance_h))
    }

    /// N chi at which chi / (1 + N chi) is `gain`, for N between 0 and 1.
    fn beta_of_gain(&self, gain: f64) -> f64 {
        let chi = self.relative_permeability - 1.0;
        if chi == 0.0 {
            return 0.0;
        }
        (chi / gain - 1.0).clamp(0.0, chi)
    }

    /// Times at which current and force reach 95 %, s.
    fn times_95_s(&self, beta: f64) -> Result<[f64; 2], TransientError> {
        let tau_s = self.inductance_h / self.resistance_ohm;
        let core_inductance_h = self.core_inductance_h();
        if self.diffusion_s() <= NO_EDDIES * tau_s || core_inductance_h == 0.0 {
            return Ok([(1.0 / LEFT).ln() * tau_s; 2]);
        }
        let modes = Modes {
            resistance_ohm: self.resistance_ohm,
            air_inductance_h: self.air_inductance_h,
            core_inductance_h,
            diffusion_s: self.diffusion_s(),
            beta,
        };
        let list = modes.list()?;
        let air = self.air_share.clamp(0.0, 1.0);
        let force = |mode: &Mode| air * mode.current + (1.0 - air) * mode.magnetisation;
        Ok([
            modes.time_95_s(&list, |mode| mode.current),
            modes.time_95_s(&list, force),
        ])
    }
}

/// One exponential of the step's answer; what is left of the step is the sum of
/// `current * exp(-rate t)`.
#[derive(Debug, Clone, Copy)]
struct Mode {
    rate_per_s: f64,
    current: f64,
    magnetisation: f64,
}

/// The problem of the poles.
#[derive(Debug, Clone, Copy)]
struct Modes {
    resistance_ohm: f64,
    air_inductance_h: f64,
    core_inductance_h: f64,
    diffusion_s: f64,
    beta: f64,
}

impl Modes {
    /// Before this neither current nor force can be at 95 %: the core only slows the winding.
    fn earliest_s(&self) -> f64 {
        (1.0 / LEFT).ln() * self.air_inductance_h / self.resistance_ohm
    }

    /// The modes that are alive at the earliest settling time, slowest first.
    fn list(&self) -> Result<Vec<Mode>, TransientError> {
        let air_s = self.air_inductance_h / self.resistance_ohm;
        let air = (self.diffusion_s / air_s).sqrt();
        let last = (DECAYED * self.diffusion_s / self.earliest_s()).sqrt();
        if last > f64::from(MODES_MAX) * std::f64::consts::PI {
            let diffusion_s = self.diffusion_s;
            return Err(TransientError::TooSlow { diffusion_s, air_s });
        }
        let mut modes = Vec::new();
        let (mut low, mut index) = (0.0, 1);
        let mut ahead = Some(air);
        while low <= last {
            fluxform_base::progress::poll();
            let zero = zero_of_j1(index);
            let high = match ahead {
                Some(air) if air <= zero => {
                    ahead = None;
                    air
                }
                _ => {
                    index += 1;
                    zero
                }
            };
            // F begins positive and changes its sign once between every two.
            let falling = modes.len() % 2 == 0;
            modes.push(self.mode(self.root(low, high, falling)));
            low = high;
        }
        Ok(modes)
    }

    /// F and dF/dx.
    fn characteristic(&self, x: f64) -> [f64; 2] {
        let Self {
            beta,
            diffusion_s,
            air_inductance_h,
            core_inductance_h,
            ..
        } = *self;
        let [j0, j1] = j0_j1(x);
        let g = ratio(x, j1);
        let slope_g = if x < 1e-2 {
            -0.25 * x
        } else {
            2.0 * (j0 - g) / x
        };
        let (p, slope_p) = (x * x / diffusion_s, 2.0 * x / diffusion_s);
        let rest = self.resistance_ohm - p * air_inductance_h;
        let core = core_inductance_h * (1.0 + beta);
        [
            (j0 + beta * g) * rest - p * core * g,
            (beta * slope_g - j1) * rest
                - (j0 + beta * g) * slope_p * air_inductance_h
                - core * (slope_p * g + p * slope_g),
        ]
    }

    /// The zero of F between `low` and `high`, where it is `falling` or rising.
    fn root(&self, low: f64, high: f64, falling: bool) -> f64 {
        safeguarded(low, high, |x| {
            let [value, slope] = self.characteristic(x);
            if falling {
                [-value, -slope]
            } else {
                [value, slope]
            }
        })
    }

    /// The mode at a zero `x` of F.
    fn mode(&self, x: f64) -> Mode {
        let [j0, j1] = j0_j1(x);
        let g = ratio(x, j1);
        let p = x * x / self.diffusion_s;
        let (left, right) = (self.resistance_ohm, p * self.air_inductance_h);
        // J_0 + beta g and m; either is found where it keeps its digits: by F = 0, or directly.
        let flux = p * self.core_inductance_h;
        let (denominator, m) = if (left - right).abs() > 0.1 * (left + right) {
            let by_circuit = (left - right) / flux;
            ((1.0 + self.beta) * g / by_circuit, by_circuit)
        } else {
            let direct = j0 + self.beta * g;
            (direct, (1.0 + self.beta) * g / direct)
        };
        let current = -2.0 * self.resistance_ohm * denominator / (x * self.characteristic(x)[1]);
        Mode {
            rate_per_s: p,
            current,
            magnetisation: current * m,
        }
    }

    /// When the sum of the modes, weighted by `part`, has fallen to 5 %, s.
    fn time_95_s(&self, modes: &[Mode], part: impl Fn(&Mode) -> f64) -> f64 {
        let left = |t: f64| {
            modes.iter().fold([0.0, 0.0], |[value, slope], mode| {
                let now = part(mode) * (-mode.rate_per_s * t).exp();
                [value + now, slope - mode.rate_per_s * now]
            })
        };
        let low = self.earliest_s();
        let mut high = 2.0 * low;
        while left(high)[0] > LEFT {
            high *= 2.0;
        }
        safeguarded(low, high, |t| {
            let [value, slope] = left(t);
            [LEFT - value, -slope]
        })
    }
}

/// 2 J_1(x) / x.
fn ratio(x: f64, j1: f64) -> f64 {
    if x == 0.0 { 1.0 } else { 2.0 * j1 / x }
}

/// The zero between `low` and `high` of a function that is negative below and positive above it;
/// `at` gives value and derivative. Newton's method in a bracket, which is halved where Newton's
/// step leaves it or is more than half the step before. The root may be an end of the bracket.
fn safeguarded(low: f64, high: f64, at: impl Fn(f64) -> [f64; 2]) -> f64 {
    let (mut low, mut high) = (low, high);
    let mut x = 0.5 * (low + high);
    let mut longest = f64::INFINITY;
    for _ in 0..ROOT_STEPS {
        let [value, slope] = at(x);
        if value > 0.0 {
            high = x;
        } else {
            low = x;
        }
        let newton = x - value / slope;
        let step = (newton - x).abs();
        if step <= 2.0 * f64::EPSILON * x {
            return newton.clamp(low, high);
        }
        let next = if low < newton && newton < high && step <= longest {
            newton
        } else {
            0.5 * (low + high)
        };
        if high - low <= 2.0 * f64::EPSILON * high {
            return next;
        }
        longest = 0.5 * (next - x).abs();
        x = next;
    }
    x
}

/// Share of the air coil's field energy that lies inside a core from `bottom_m` to `top_m` (heights
/// above the winding's top face): the integral of |B|^2 / mu_0 per ampere over the core, over L_air.
///
/// Error: 1e-4, from the logarithm of the field at the winding's edges; the core reaches no
/// farther than the bore.
#[must_use]
pub fn core_energy_share(
    winding: &Winding,
    core_radius_m: f64,
    bottom_m: f64,
    top_m: f64,
    air_inductance_h: f64,
) -> f64 {
    // The model it feeds is good to percents.
    const TOLERANCE: f64 = 1e-4;
    const NODES: usize = 6;
    let radial = gauss::rule(NODES);
    let disc = |z: f64| {
        let nodes = radial.nodes.iter().zip(&radial.weights);
        nodes.fold(0.0, |sum, (node, weight)| {
            let r = 0.5 * core_radius_m * (1.0 + node);
            // Nodes lie inside the bore, where the field has a value.
            let (b_r, b_z) = bore_field(winding, r, z, TOLERANCE).unwrap_or_default();
            let squared = b_r * b_r + b_z * b_z;
            sum + 0.5 * core_radius_m * weight * std::f64::consts::TAU * r * squared
        })
    };
    let ends = [-winding.length_m, 0.0];
    let middle = -0.5 * winding.length_m;
    let mut energy = 0.0;
    // Each half is graded towards its end of the winding.
    for (end, from, to) in [
        (ends[0], bottom_m, top_m.min(middle)),
        (ends[1], bottom_m.max(middle), top_m),
    ] {
        if from < to {
            gauss::graded(
                from - end,
                to - end,
                0.25 * core_radius_m,
                TOLERANCE,
                |u, weight| {
                    energy += weight * disc(end + u);
                },
            );
        }
    }
    energy / MU_0_T_M_PER_A / air_inductance_h
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::Cell;

    /// The seed's coil, or one with little steel.
    fn modes(inductance_over_air: f64, diffusion_over_air: f64, beta: f64) -> Modes {
        let (resistance_ohm, air_inductance_h) = (6.0753, 0.0145019);
        Modes {
            resistance_ohm,
            air_inductance_h,
            core_inductance_h: (inductance_over_air - 1.0) * air_inductance_h,
            diffusion_s: diffusion_over_air * air_inductance_h / resistance_ohm,
            beta,
        }
    }

    /// Newton's method needs eight steps where the start is fair; bisection, fifty.
    #[test]
    fn a_root_takes_few_steps() {
        let mut most = 0;
        for (steel, diffusion, beta) in [(12.7, 440.0, 50.3), (1.3, 7.0, 0.7), (1.3, 1e4, 3.0)] {
            let problem = modes(steel, diffusion, beta);
            let list = problem.list().expect("not too slow");
            let mut before = 0.0;
            for mode in &list {
                let x = (mode.rate_per_s * problem.diffusion_s).sqrt();
                let rising = problem.characteristic(x)[1] > 0.0;
                let steps = Cell::new(0);
                let count = |x: f64| {
                    steps.set(steps.get() + 1);
                    let [value, slope] = problem.characteristic(x);
                    if rising {
                        [value, slope]
                    } else {
                        [-value, -slope]
                    }
                };
                let found = safeguarded(x - 0.7 * (x - before), x + 0.4 * (x - before), count);
                assert!((found / x - 1.0).abs() < 1e-14, "{found} {x}");
                most = most.max(steps.get());
                before = x;
            }
        }
        assert!(most <= 12, "{most}");
    }

    /// The root at either end of the bracket, and slopes that are no slopes.
    #[test]
    fn roots_are_found_in_any_bracket() {
        let cubic = |x: f64| [x * x * x - 0.7, 3.0 * x * x];
        let root = 0.7_f64.cbrt();
        for (low, high) in [(root, 1.9), (0.3, root), (root, root), (1e-9, 1e9)] {
            let found = safeguarded(low, high, cubic);
            assert!((found / root - 1.0).abs() < 1e-15, "{low} {high}: {found}");
        }
        for wrong in [1e3, 0.1, -1.0, f64::NAN, 0.0] {
            let steps = Cell::new(0);
            let found = safeguarded(0.3, 1.9, |x| {
                steps.set(steps.get() + 1);
                let [value, slope] = cubic(x);
                [value, wrong * slope]
            });
            assert!((found / root - 1.0).abs() < 1e-12, "{wrong}: {found}");
            assert!(steps.get() < 3 * 53, "{wrong}: {}", steps.get());
        }
    }

    /// Where a pole passes p = R / L_air it is a zero of J_1, too, and of the two forms of m only
    /// one keeps its digits.
    #[test]
    fn modes_pass_smoothly_where_the_core_is_out_of_the_circuit() {
        let zero = zero_of_j1(1);
        let at = |shift: f64| {
            let list = modes(1.3, zero * zero * (1.0 + shift), 0.7).list();
            list.expect("not too slow")
        };
        let (less, more) = (at(-1e-3), at(1e-3));
        for shift in [0.0, 3e-16, -7e-16, 2e-15, -1e-14, 1e-13, 1e-11] {
            for (k, mode) in at(shift).iter().enumerate().take(4) {
                for (value, less, more) in [
                    (mode.rate_per_s, less[k].rate_per_s, more[k].rate_per_s),
                    (mode.current, less[k].current, more[k].current),
                    (
                        mode.magnetisation,
                        less[k].magnetisation,
                        more[k].magnetisation,
                    ),
                ] {
                    let size = mode.current.abs().max(value.abs());
                    let off = value - 0.5 * (less + more);
                    assert!(
                        off.abs() < 1e-5 * size,
                        "{shift:e} {k}: {value} {less} {more}"
                    );
                }
            }
        }
    }
}
