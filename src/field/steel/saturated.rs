//! A core whose permeability depends on the field: the interior's potential coupled to the
//! boundary-integral operator of its surface, by Newton's method.
//!
//! The total potential in the core is u (H = -grad u). The steel's own field outside is that of a
//! double layer of density v on the surface. With W = 1/2 + D (D the double layer's principal
//! value, W 1 = 0), phi the source's potential on the surface and S the weak map from boundary
//! values to flux of the Laplacian in the core:
//!
//! ```text
//! u = phi - W v                        continuity of the potential,
//! F(u) = S (u + v)                     continuity of the flux,
//! ```
//!
//! F(u) being the flux through the surface of the u that satisfies div B = 0 inside. With a
//! constant permeability v = (mu - 1) u and (1 + (mu - 1) W) u = phi. Inner values and v are
//! corrected together: with S_mu the condensed tangent stiffness,
//! (S_mu W + S (1 - W)) dv = F - S (u + v). The equations are the stationary point of a convex
//! energy, so the derivative of that energy along a correction decides the length of the step.
//! The constant in v is free and has no effect: it stays that of the start.
//!
//! Where B saturates within a small part of the field, the tangent holds for shorter changes than the
//! correction makes. The stiffness is therefore that of the mean slope of B(H) over as far either way
//! as the last correction moved H, which becomes the tangent as corrections become small.

mod newton;
#[cfg(test)]
mod tests;

use nalgebra::{DMatrix, DVector};

use self::newton::State;
use super::double_layer::operators;
use super::generatrix::{Face, Generatrix};
use super::permeability::Permeability;
use super::spectral_fem::{Interior, MeshError, Sample};
use super::trace::Trace;
use fluxform_base::units::MU_0_T_M_PER_A;

/// Corrections below this part of u, in the energy norm, end the iteration; the error
/// that is left is about its square.
const TOLERANCE: f64 = 1e-8;
/// Corrections after which the iteration is given up; 4 to 15 are usual, and 45 for curves with the sharpest knees.
const MAX_STEPS: usize = 80;
/// A step is long enough when the energy's slope at its end is this part of that at its start.
const SLOPE_LEFT: f64 = 0.5;
/// Trials of one step's length.
const MAX_TRIALS: usize = 12;
/// Depth below the surface from which on the peak of |B| is taken, m; a tenth of the radius
/// where that is less. At the edges |B| has no bound.
const SKIN_M: f64 = 1e-3;

/// How the iteration ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Convergence {
    /// The corrections fell below the tolerance, or to the rounding of the potential.
    Converged,
    /// They did not, within the allowed number, or the equations could not be solved (input or
    /// law not finite, a law that does not grow).
    Stalled,
}

/// One Newton correction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Step {
    /// Energy norm of the correction, relative to that of u.
    pub correction: f64,
    /// Part of it that was taken.
    pub length: f64,
}

/// A core's state under one source.
#[derive(Debug, Clone, PartialEq)]
pub struct Solution {
    /// Whether the numbers can be used.
    pub status: Convergence,
    /// Density of the equivalent double layer at the surface's Gauss nodes, A.
    pub v_a: DVector<f64>,
    /// Total potential at the interior's nodes, A.
    pub u_a: DVector<f64>,
    /// The corrections in their order.
    pub steps: Vec<Step>,
    v_boundary_a: DVector<f64>,
}

/// |B| in a core.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CoreField {
    /// Largest |B| at least 1 mm (at most a tenth of the radius) inside the surface, T.
    pub peak_b_t: f64,
    /// Where it was found: radius and height, m.
    pub peak_at_m: (f64, f64),
    /// Mean of |B| over the volume, T.
    pub mean_b_t: f64,
    /// See [`Interior::resolution`].
    pub resolution: f64,
}

/// A core ready to be solved under any axisymmetric source and law.
#[derive(Debug)]
pub struct SaturatedCore {
    interior: Interior,
    trace: Trace,
    /// W on the boundary's nodes.
    w: DMatrix<f64>,
    /// S (1 - W), m.
    outer_m: DMatrix<f64>,
}

impl SaturatedCore {
    /// The core of `outline`: elements on its panels' tensor product, of the degree that the
    /// panels' nodes carry; `quadrature` as in [`super::generatrix::Resolution`].
    ///
    /// Domain: an outline as [`Generatrix::new`] makes it, of two nodes a panel at least.
    ///
    /// # Errors
    /// [`MeshError`] when panels are too small for their place to be distinguished from their neighbours'.
    pub fn new(outline: &Generatrix, quadrature: f64) -> Result<Self, MeshError> {
        let breaks = |face: Face| -> Vec<f64> {
            let mut of_face = outline.panels.iter().filter(|panel| panel.face == face);
            let first = of_face.clone().next().map(|panel| panel.from_m);
            first
                .into_iter()
                .chain(of_face.by_ref().map(|panel| panel.to_m))
                .collect()
        };
        let degree = outline.order - 1;
        let interior = Interior::new(&breaks(Face::Bottom), &breaks(Face::Side), degree)?;
        let trace = Trace::new(outline.panels.len(), outline.order, degree);
        let w = trace.operator_on_boundary(&operators(outline, 1, quadrature).remove(0));
        let outer_m = interior.laplace_schur_m() - interior.laplace_schur_m() * &w;
        Ok(Self {
            interior,
            trace,
            w,
            outer_m,
        })
    }

    /// The interior's mesh.
    #[must_use]
    pub fn interior(&self) -> &Interior {
        &self.interior
    }

    /// Solves for the source's potential `phi_a` (A; H = -grad phi) at the surface's Gauss nodes,
    /// from the layer `start` at the same nodes, of a similar problem or a coarser outline, or from
    /// a core of constant permeability.
    ///
    /// Error: of the iteration, see [`Convergence`]; of the discretisation, the difference between two
    /// outlines' results. Sampled in the tests: on an outline for 1e-5 field and flux are within
    /// 4e-4 of those on one for 1e-7. A table's kinks, where they lie in the core, settle slowest.
    ///
    /// # Panics
    /// When `phi_a` has another length than the outline's nodes.
    pub fn solve(
        &self,
        phi_a: &DVector<f64>,
        law: &dyn Permeability,
        start: Option<&DVector<f64>>,
    ) -> Solution {
        assert_eq!(phi_a.len(), self.trace.gauss_count(), "one value a node");
        let phi = self.trace.to_boundary(phi_a);
        let start = start.filter(|v_a| v_a.len() == phi_a.len());
        let v = match start {
            Some(v_a) => self.trace.to_boundary(v_a),
            None => self.linear_start(&phi, law),
        };
        let u = self.interior.harmonic(&(&phi - &self.w * &v));
        let mut state = State {
            flux: self.interior.flux(&u, law),
            u,
            v,
        };
        // Close to the state the tangent itself is best.
        let mut last = start.is_none().then(|| state.u.clone());
        let source = self.interior.laplace_schur_m() * &phi;
        let mut steps: Vec<Step> = Vec::new();
        let mut status = Convergence::Stalled;
        while status == Convergence::Stalled && steps.len() < MAX_STEPS {
            fluxform_base::progress::poll();
            let Some((change, slope)) = self.correction(&state, law, last.as_ref()) else {
                break;
            };
            let energy = state.u.dot(&state.flux);
            // A slope upwards is rounding: the correction is then as small as can be had.
            let correction = ((-slope).max(0.0) / energy).sqrt();
            // Where the permeability is very large u is the small difference of phi and W v, and
            // its rounding may be above the tolerance, though far below the source's work.
            let settled = -slope <= TOLERANCE * TOLERANCE * state.v.dot(&source).abs()
                && steps
                    .last()
                    .is_some_and(|before| correction > 0.5 * before.correction);
            let done = energy == 0.0 || correction <= TOLERANCE || settled;
            let (length, next) = if done {
                (1.0, self.moved(&state, &change, 1.0, law))
            } else {
                self.search(&state, &change, slope, law)
            };
            state = next;
            last = Some(change.u * length);
            steps.push(Step {
                correction: if energy == 0.0 { 0.0 } else { correction },
                length,
            });
            if done {
                status = Convergence::Converged;
            }
        }
        Solution {
            status,
            v_a: self.trace.to_gauss(&state.v),
            u_a: state.u,
            steps,
            v_boundary_a: state.v,
        }
    }

    /// |B| of a solution.
    #[must_use]
    pub fn field(&self, solution: &Solution, law: &dyn Permeability) -> CoreField {
        let b_t = |sample: Sample| {
            let h = sample.h_a_per_m();
            MU_0_T_M_PER_A * law.response(h).relative * h
        };
        let skin_m = SKIN_M.min(0.1 * self.interior.radius_m());
        let mut peak = (0.0, (0.0, 0.0));
        self.interior
            .sample_inside(&solution.u_a, skin_m, |sample| {
                let b = b_t(sample);
                if b > peak.0 {
                    peak = (b, (sample.r_m, sample.z_m));
                }
            });
        let volume_m3 = self.interior.volume_m3();
        CoreField {
            peak_b_t: peak.0,
            peak_at_m: peak.1,
            mean_b_t: self.interior.integral(&solution.u_a, b_t) / volume_m3,
            resolution: self.interior.resolution(&solution.u_a, law),
        }
    }

    /// Flux that the steel links with a coil of potential `phi_per_a` (per ampere, at the Gauss
    /// nodes; the coil's own flux is not in it), Wb:
    /// mu_0 int M . H_coil dV = mu_0 int v d_n phi dS.
    #[must_use]
    pub fn flux_linkage_wb(&self, solution: &Solution, phi_per_a: &DVector<f64>) -> f64 {
        let phi = self.trace.to_boundary(phi_per_a);
        let normal = self.interior.laplace_schur_m() * phi;
        MU_0_T_M_PER_A * solution.v_boundary_a.dot(&normal)
    }
}
