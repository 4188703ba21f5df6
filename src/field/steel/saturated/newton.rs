//! One Newton correction, the length of its step, and where to begin.

use nalgebra::{DMatrix, DVector};

use super::{MAX_TRIALS, SLOPE_LEFT, SaturatedCore};
use crate::steel::permeability::Permeability;

/// Trials of the uniform permeability to begin with.
const START_TRIALS: usize = 12;
/// Smallest susceptibility that is tried.
const LEAST_CHI: f64 = 1e-3;

/// Iterates that satisfy u = phi - W v on the boundary.
pub(super) struct State {
    pub(super) u: DVector<f64>,
    pub(super) v: DVector<f64>,
    /// Weak flux of u at every node of the interior.
    pub(super) flux: DVector<f64>,
}

/// Corrections of u at every node and of v.
pub(super) struct Change {
    pub(super) u: DVector<f64>,
    v: DVector<f64>,
}

impl SaturatedCore {
    /// v of a core whose permeability is that of the law at its own mean field.
    pub(super) fn linear_start(&self, phi: &DVector<f64>, law: &dyn Permeability) -> DVector<f64> {
        let schur = self.interior.laplace_schur_m();
        let volume_m3 = self.interior.volume_m3();
        let solve = |chi: f64| {
            let system = DMatrix::identity(phi.len(), phi.len()) + &self.w * chi;
            let u = system.lu().solve(phi).unwrap_or_else(|| phi.clone());
            let h = (u.dot(&(schur * &u)).max(0.0) / volume_m3).sqrt();
            (u, law.response(h).relative - 1.0)
        };
        // Bisection on log chi for a core whose own mean field gives it that chi.
        let mut chi = (law.response(0.0).relative - 1.0).max(LEAST_CHI);
        let (mut lo, mut hi) = (LEAST_CHI, chi);
        let (mut u, mut found) = solve(chi);
        for _ in 0..START_TRIALS {
            if found >= chi {
                lo = chi;
            } else {
                hi = chi;
            }
            if hi < 1.3 * lo {
                break;
            }
            chi = (lo * hi).sqrt();
            (u, found) = solve(chi);
        }
        // A constant in v has no effect but that of its rounding, which at large chi is great.
        let v = u * chi;
        let mean = v.mean();
        v.add_scalar(-mean)
    }

    /// Newton's correction, and the energy's slope along it; `None` when there is none. `last` is the change of u
    /// that led here.
    pub(super) fn correction(
        &self,
        state: &State,
        law: &dyn Permeability,
        last: Option<&DVector<f64>>,
    ) -> Option<(Change, f64)> {
        let tangent = self.interior.linearize(&state.u, law, last).ok()?;
        let mut system = &tangent.matrix * &self.w + &self.outer_m;
        // Constants in v have no effect and the residual's sum is zero: with a constant added to
        // every entry the correction is the one whose sum is zero.
        let count = system.nrows();
        let scale = system.diagonal().amax();
        system.add_scalar_mut(scale / count as f64);
        let through = self.through(state);
        let dv = system.lu().solve(&(&tangent.load - &through))?;
        let du = self.interior.correction(&tangent, &-(&self.w * &dv));
        let change = Change { u: du, v: dv };
        let slope = self.slope(&state.flux, &through, &change);
        slope.is_finite().then_some((change, slope))
    }

    /// S (u + v): the flux that comes out of the surface.
    fn through(&self, state: &State) -> DVector<f64> {
        let u = self.on_boundary(&state.u);
        self.interior.laplace_schur_m() * (u + &state.v)
    }

    fn on_boundary(&self, all: &DVector<f64>) -> DVector<f64> {
        let boundary = self.interior.boundary();
        DVector::from_iterator(boundary.len(), boundary.iter().map(|&node| all[node]))
    }

    /// Derivative of the energy along a change, where the interior's flux and that through the
    /// surface are as given.
    fn slope(&self, flux: &DVector<f64>, through: &DVector<f64>, change: &Change) -> f64 {
        flux.dot(&change.u) - through.dot(&self.on_boundary(&change.u))
    }

    pub(super) fn moved(
        &self,
        state: &State,
        change: &Change,
        length: f64,
        law: &dyn Permeability,
    ) -> State {
        let u = &state.u + &change.u * length;
        State {
            flux: self.interior.flux(&u, law),
            u,
            v: &state.v + &change.v * length,
        }
    }

    /// Moves along a change until the slope has fallen enough. It grows with the length, because
    /// the energy is convex: regula falsi, the kept end counting half, finds where it is zero.
    pub(super) fn search(
        &self,
        state: &State,
        change: &Change,
        slope: f64,
        law: &dyn Permeability,
    ) -> (f64, State) {
        let (mut before, mut after) = ((0.0, slope), None);
        let mut length = 1.0;
        let mut trial = self.moved(state, change, length, law);
        for _ in 1..MAX_TRIALS {
            let found = self.slope(&trial.flux, &self.through(&trial), change);
            if found.abs() <= SLOPE_LEFT * slope.abs() {
                break;
            }
            if found < 0.0 {
                before = (length, found);
                if let Some((_, value)) = &mut after {
                    *value *= 0.5;
                }
            } else {
                // NaN counts as too far.
                after = Some((length, if found.is_finite() { found } else { -before.1 }));
                before.1 *= 0.5;
            }
            length = match after {
                None => 2.0 * length,
                Some((end, value)) => {
                    let part = -before.1 / (value - before.1);
                    before.0 + (end - before.0) * part.clamp(0.1, 0.9)
                }
            };
            trial = self.moved(state, change, length, law);
        }
        (length, trial)
    }
}
