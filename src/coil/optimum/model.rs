//! The optimiser's view of a coil's physics, so that air and cored coils are solved alike.

use fluxform_base::units::{
    COPPER_DENSITY_KG_PER_M3, COPPER_TEMPERATURE_COEFFICIENT_PER_K, REFERENCE_TEMPERATURE_C,
};
use fluxform_design::Wire;
use std::f64::consts::PI;

use crate::circuit::CoilSize;

/// The winding's section: a1 <= r <= a1 + depth, -length <= z <= 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Window {
    /// Inner radius a1, m; >= 0.
    pub inner_radius_m: f64,
    /// Outer less inner radius, m; > 0.
    pub depth_m: f64,
    /// Length, m; > 0.
    pub length_m: f64,
}

impl Window {
    /// Outer radius, m.
    #[must_use]
    pub fn outer_radius_m(&self) -> f64 {
        self.inner_radius_m + self.depth_m
    }

    /// Volume over pi: (a2^2 - a1^2) L, m^3; resistance, length and mass of the wire are
    /// proportional to it.
    #[must_use]
    pub fn volume_over_pi_m3(&self) -> Sloped {
        let (a, w, l) = (self.inner_radius_m, self.depth_m, self.length_m);
        let sum = 2.0 * a + w;
        Sloped {
            value: sum * w * l,
            slope: [2.0 * w * l, 2.0 * (a + w) * l, sum * w, 0.0],
        }
    }
}

impl From<&Window> for CoilSize {
    fn from(window: &Window) -> Self {
        Self {
            inner_diameter_m: 2.0 * window.inner_radius_m,
            outer_diameter_m: 2.0 * window.outer_radius_m(),
            length_m: window.length_m,
        }
    }
}

/// A value with its derivatives by inner radius (depth held), depth, length and current.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Sloped {
    /// Value.
    pub value: f64,
    /// Derivatives.
    pub slope: [f64; 4],
}

impl Sloped {
    /// Times a constant.
    #[must_use]
    pub fn times(self, factor: f64) -> Self {
        Self {
            value: self.value * factor,
            slope: self.slope.map(|s| s * factor),
        }
    }

    /// Times another.
    #[must_use]
    pub(crate) fn product(self, by: Self) -> Self {
        Self {
            value: self.value * by.value,
            slope: std::array::from_fn(|i| self.slope[i] * by.value + self.value * by.slope[i]),
        }
    }

    /// Over another.
    #[must_use]
    pub(crate) fn ratio(self, over: Self) -> Self {
        let value = self.value / over.value;
        Self {
            value,
            slope: std::array::from_fn(|i| (self.slope[i] - value * over.slope[i]) / over.value),
        }
    }

    /// With the current's dependence on the window put in.
    #[must_use]
    pub fn along(self, current: Self) -> Self {
        let by_current = self.slope[3];
        let by_window = |i: usize| self.slope[i] + by_current * current.slope[i];
        Self {
            value: self.value,
            slope: [by_window(0), by_window(1), by_window(2), 0.0],
        }
    }
}

/// The wire of one coil.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Strand {
    /// Diameter over the insulation, m.
    pub diameter_m: f64,
    /// Diameter of the metal, m.
    pub conductor_diameter_m: f64,
    /// Resistivity at the wire's temperature, ohm m.
    pub resistivity_ohm_m: f64,
}

impl Strand {
    /// The wires that `wire` admits: its choices, or else itself. A choice keeps the ratio of
    /// metal to insulated diameter of the wire named.
    #[must_use]
    pub fn choices(wire: &Wire) -> Vec<Self> {
        let warmth = 1.0
            + COPPER_TEMPERATURE_COEFFICIENT_PER_K * (wire.temperature_c - REFERENCE_TEMPERATURE_C);
        let filled = wire.conductor_diameter_m / wire.diameter_m;
        let strand = |diameter_m: f64, conductor_diameter_m: f64| Self {
            diameter_m,
            conductor_diameter_m,
            resistivity_ohm_m: wire.resistivity_ohm_m * warmth,
        };
        if wire.choices_m.is_empty() {
            return vec![strand(wire.diameter_m, wire.conductor_diameter_m)];
        }
        let mut choices: Vec<Self> = wire
            .choices_m
            .iter()
            .map(|&diameter_m| strand(diameter_m, diameter_m * filled))
            .collect();
        choices.sort_by(|a, b| a.diameter_m.total_cmp(&b.diameter_m));
        choices.dedup();
        choices
    }

    /// Turns a square metre of section holds, layers stacked squarely, 1/m^2.
    #[must_use]
    pub(crate) fn turns_per_m2(&self) -> f64 {
        1.0 / (self.diameter_m * self.diameter_m)
    }

    /// Turns in a window, not rounded.
    #[must_use]
    pub fn turns(&self, window: &Window) -> f64 {
        (window.depth_m / self.diameter_m) * (window.length_m / self.diameter_m)
    }

    /// Wire length over the window's volume over pi, 1/m^2.
    #[must_use]
    pub(crate) fn length_per_volume(&self) -> f64 {
        PI * self.turns_per_m2()
    }

    /// Resistance over the window's volume over pi, ohm/m^3.
    #[must_use]
    pub fn resistance_per_volume(&self) -> f64 {
        self.resistivity_ohm_m * self.length_per_volume() / self.section_m2()
    }

    /// Mass of the metal over the window's volume over pi, kg/m^3.
    #[must_use]
    pub fn mass_per_volume(&self) -> f64 {
        COPPER_DENSITY_KG_PER_M3 * self.length_per_volume() * self.section_m2()
    }

    fn section_m2(&self) -> f64 {
        0.25 * PI * self.conductor_diameter_m * self.conductor_diameter_m
    }
}

/// Values of a coil at a current, with derivatives by window and current.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Response {
    /// |force| on the magnet at the target, N.
    pub force_n: Sloped,
    /// Self inductance, H; zero where it was not requested.
    pub inductance_h: Sloped,
    /// Mass of the core, kg; zero without one.
    pub core_mass_kg: Sloped,
    /// Largest flux density in the core, T; zero without one.
    pub core_field_t: Sloped,
}

/// Errors of a response, in logarithms.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Doubts {
    /// Of the force.
    pub force_ln: f64,
    /// Of the flux density in the core.
    pub core_field_ln: f64,
}

/// A window whose response cannot be computed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("the coil cannot be computed: {0}")]
pub struct NoResponse(pub String);

/// A coil's physics.
pub trait CoilModel: Sync {
    /// The response of `window`, wound with `turns_per_m2`, at `current_a`.
    ///
    /// # Errors
    /// [`NoResponse`] where the model does not hold: the optimiser keeps away.
    fn response(
        &self,
        window: &Window,
        turns_per_m2: f64,
        current_a: f64,
        with_inductance: bool,
    ) -> Result<Response, NoResponse>;

    /// Relative error of a response; what the optimiser need not resolve.
    fn relative_error(&self) -> f64;

    /// How far the response at `window` may be from that of a better model.
    fn doubts(&self, _window: &Window) -> Doubts {
        const DOUBT: f64 = 5.0;
        let ln = DOUBT * self.relative_error();
        Doubts {
            force_ln: ln,
            core_field_ln: ln,
        }
    }

    /// Heights of the dipoles that stand for the magnet and their moments, m and A m^2, where
    /// the coil has no core and the magnet lies on the axis: global bounds exist for those.
    fn air_dipoles(&self) -> Option<&[(f64, f64)]> {
        None
    }

    /// Rough length on which the response varies, m: starting points spread around it.
    fn length_scale_m(&self) -> f64;

    /// The same coil computed roughly, to some hundredths, where that is much cheaper: shows
    /// which starting points are worth a search.
    fn draft(&self) -> Option<Box<dyn CoilModel>> {
        None
    }

    /// Says about which window a model that tabulates will be evaluated at most. Its table follows the first time; later,
    /// where a border of the table is near, the model with a table of its own. Not for use within a parallel loop.
    fn focus(&self, _window: &Window) -> Option<Box<dyn CoilModel>> {
        None
    }

    /// The same coil computed more exactly about `window`, where the model is a coarse one meant
    /// for the search. Not for use within a parallel loop.
    fn sharpened(&self, _window: &Window) -> Option<Box<dyn CoilModel>> {
        None
    }

    /// The coarse model again, with what was learnt when it was sharpened; `None` where it was
    /// not.
    fn blunted(&self) -> Option<Box<dyn CoilModel>> {
        None
    }
}
