//! How finely an array of coupled cores is solved for a tolerance.

use super::CoreShape;
use super::exchange::{Grading, LEAST_GAP, PART, side_panels};
use super::generatrix::Resolution;

/// Most azimuthal modes; beyond, the stated error grows.
pub(super) const MOST_MODES: usize = 17;
/// Most unknowns a core, and most entries of all the dense matrices (2.4 GB): cores closer than
/// about half their radius ask for more, and the stated error grows.
const MOST_UNKNOWNS: usize = 3500;
const MOST_ENTRIES: usize = 300_000_000;
/// By how much more is left out of what passes between cores at the resolution that one is compared with.
const LEFT_OUT_MORE: f64 = 3.0;
/// Share of the tolerance given to the linear solver.
pub(super) const SOLVER_SHARE: f64 = 0.01;

/// How finely a coupled array is solved.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ArrayResolution {
    /// The outline of each core.
    pub outline: Resolution,
    /// Azimuthal modes.
    pub modes: usize,
    /// Length of the exchange panels beside the ends of cores and windings, m.
    pub panel_m: f64,
    /// Exchange rings a panel.
    pub order: usize,
    /// Relative residual of the linear solver.
    pub residual: f64,
}

impl ArrayResolution {
    /// The resolution for a relative error `tolerance`, `closest_m` being the smallest distance
    /// of two axes.
    ///
    /// A mode m that a core sends to another, and gets back, decays like ((d - R)/R)^(-2 m); the
    /// kernels between two cores are analytic within their gap.
    #[must_use]
    pub fn for_tolerance(tolerance: f64, shape: CoreShape, closest_m: f64) -> Self {
        let tolerance = tolerance.clamp(1e-9, 0.1);
        // The outline is the cheap part, and the edges' error decays slowest.
        let outline = Resolution::for_tolerance(0.3 * tolerance);
        let residual = SOLVER_SHARE * tolerance;
        if closest_m.is_infinite() {
            return Self {
                outline,
                modes: 1,
                panel_m: shape.length_m().max(shape.radius_m),
                order: 2,
                residual,
            };
        }
        let radius_m = shape.radius_m;
        let decay = 2.0 * ((closest_m - radius_m) / radius_m).ln();
        let modes = 2 + ((1.0 / tolerance).ln() / decay.max(1e-3)).ceil() as usize;
        let gap_m = (closest_m - 2.0 * radius_m).max(LEAST_GAP * radius_m);
        Self {
            outline,
            modes: modes.clamp(2, MOST_MODES),
            panel_m: PART * gap_m,
            order: (2.0 - 1.3 * tolerance.log10()).ceil() as usize,
            residual,
        }
    }

    /// The exchange panels of a core about which a winding reaches `winding_length_m` down.
    pub(super) fn grading(&self, shape: CoreShape, winding_length_m: f64) -> Grading {
        Grading::new(self.panel_m, shape, winding_length_m)
    }

    /// Unknowns a core.
    pub(super) fn unknowns(&self, shape: CoreShape, winding_length_m: f64) -> usize {
        let grading = self.grading(shape, winding_length_m);
        let side = side_panels(shape, |z_m| grading.length_m(z_m)).len();
        let end = (shape.radius_m / self.panel_m).ceil().max(1.0) as usize;
        let rings = self.order * (side + 2 * end);
        rings * self.angles()
    }

    /// Longer exchange panels, if these would take more memory than the caps for an array with
    /// `offsets` different offsets between cores.
    pub(super) fn within_memory(
        mut self,
        shape: CoreShape,
        winding_length_m: f64,
        offsets: usize,
    ) -> Self {
        let entries = (MOST_ENTRIES / (offsets + 1)) as f64;
        let most = MOST_UNKNOWNS.min(entries.sqrt() as usize);
        while self.unknowns(shape, winding_length_m) > most
            && self.panel_m < shape.length_m() + shape.radius_m
        {
            self.panel_m *= 1.1;
        }
        self
    }

    /// Error of what the closest cores exchange, relative: aliasing in the azimuth, quadrature
    /// along the panels.
    pub(super) fn exchange_error(&self, shape: CoreShape, closest_m: f64) -> f64 {
        let radius_m = shape.radius_m;
        let azimuth = (radius_m / (closest_m - radius_m)).powf(2.0 * self.modes as f64);
        let ratio = 2.0 * (closest_m - 2.0 * radius_m) / self.panel_m;
        let along = (ratio + 1.0_f64.hypot(ratio)).powf(-2.0 * self.order as f64);
        azimuth.max(along)
    }

    /// Angles of the exchange grid: a multiple of four, for the array's symmetries; enough for
    /// the modes' products.
    #[must_use]
    pub fn angles(&self) -> usize {
        (2 * self.modes).next_multiple_of(4)
    }

    /// The resolution that shows the error of this one: the next coarser, with as many modes fewer as halve
    /// what they come to, and more left out of what passes.
    ///
    /// Close to a core the modes m that another sends it are seen as they arrive, and decay like
    /// ((d - R)/R)^-m: of cores that nearly touch one mode more or less shows little of all that are missing.
    pub(super) fn reference(&self, shape: CoreShape, closest_m: f64) -> Self {
        let decay = ((closest_m - shape.radius_m) / shape.radius_m).ln();
        let fewer = (std::f64::consts::LN_2 / decay).ceil().max(1.0) as usize;
        Self {
            modes: self.modes.saturating_sub(fewer).max(1),
            residual: LEFT_OUT_MORE * self.residual,
            ..self.coarser()
        }
    }

    /// The next coarser resolution.
    #[must_use]
    pub fn coarser(&self) -> Self {
        Self {
            outline: self.outline.coarser(),
            modes: (self.modes - 1).max(1),
            order: (self.order - 1).max(2),
            ..*self
        }
    }
}
