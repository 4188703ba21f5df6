//! The coil with its linear core as the optimiser sees it.
//!
//! The core follows the winding: its radius is the bore's less the clearance, its ends lie
//! `below` and `above` the winding's. What the steel adds, relative to the air coil's exact
//! values, is smooth in (ln core radius, ln length, ln a2/a1) and does not depend on the wire: it
//! is tabulated where the search comes ([`super::lazy_table`]): roughly for the many starting points
//! ([`CoilModel::draft`]), coarsely for the search, then finely about the best coil found
//! ([`CoilModel::sharpened`]). Slopes are those of the table's
//! polynomials, consistent with its values. All depths around one core share one factorisation.

use std::sync::Arc;

use super::air::{AirCoil, NoAirCoil};
use super::axis_gradient::axis_gradient;
use super::lazy_table::{COUNT, Cells, Interpolated, Lattice, Line, Values};
use super::model::{CoilModel, Doubts, NoResponse, Response, Sloped, Window};
use super::neighbours::Neighbours;
use crate::inductance::self_inductance_h;
use crate::section_integrals;
use fluxform_base::units::{MU_0_T_M_PER_A, STEEL_DENSITY_KG_PER_M3};
use fluxform_field::magnet::MagnetRule;
use fluxform_field::steel::CoreShape;
use fluxform_field::steel::core_flux_density::{peak_depth_m, peaks_of_family_t};
use fluxform_field::steel::cored_coil::CoredCoil;
use fluxform_field::steel::generatrix::Resolution;
use fluxform_field::winding::Winding;
use std::f64::consts::PI;

/// How a core sits in its winding.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CoreRule {
    /// Bore's radius less the core's, m; >= 0.
    pub clearance_m: f64,
    /// Height of the core's top over the winding's, m.
    pub above_m: f64,
    /// Depth of the core's bottom below the winding's, m.
    pub below_m: f64,
    /// mu_r; > 0.
    pub relative_permeability: f64,
}

impl CoreRule {
    /// The core in a winding; `None` where none fits.
    #[must_use]
    pub fn shape(&self, inner_radius_m: f64, length_m: f64) -> Option<CoreShape> {
        let shape = CoreShape {
            radius_m: inner_radius_m - self.clearance_m,
            bottom_m: -(length_m + self.below_m),
            top_m: self.above_m,
        };
        (shape.radius_m > 0.0 && shape.length_m() > 0.0).then_some(shape)
    }
}

/// Why there is no cored model.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum NoCoredCoil {
    /// As for air.
    #[error(transparent)]
    NoAirCoil(#[from] NoAirCoil),
    /// The magnet is not above the core.
    #[error("the magnet must be above the core's top: raise the target or lower core.above_mm")]
    BelowTop,
}

/// Places closer to the core's top than this share of the core's radius are not examined:
/// the field of the steel's edges is not resolved there.
const CLOSEST: f64 = 0.1;
/// Core radii below this share of the outer radius are not examined: next to no steel.
const THINNEST: f64 = 0.004;
/// Shorter cores than this share of their radius are not examined.
const FLATTEST: f64 = 1e-3;

/// Relative accuracy of the draft's solutions, of the search's and of those about the optimum.
const DRAFT: f64 = 3e-3;
const COARSE: f64 = 3e-4;
const FINE: f64 = 1e-6;
const DRAFT_LATTICE: Lattice = Lattice {
    origin: [0.0; 3],
    width: [2.0, 2.4, 2.0],
    order: [5, 5, 5],
};
const COARSE_LATTICE: Lattice = Lattice {
    origin: [0.0; 3],
    width: [1.0, 1.2, 1.0],
    order: [5, 5, 4],
};
/// Accuracy of a tabulated peak of |B| over that of the solutions, and of one that is compared
/// with.
const PEAK_SHARE: f64 = 0.3;
const PEAK_FINE: f64 = 1e-7;
const FINE_WIDTH: [f64; 3] = [0.5, 0.6, 0.8];
const FINE_ORDER: [usize; 3] = [6, 6, 7];
/// Largest width of a cell along ln(a2/a1), relative to its middle.
const WITHIN: f64 = 1.8;

/// A cored coil, alone, under a magnet on its axis.
#[derive(Clone)]
pub struct CoredModel {
    air: AirCoil,
    /// Heights and moments of the magnet's dipoles.
    dipoles: Vec<(f64, f64)>,
    rule: CoreRule,
    resolution: Resolution,
    /// (added over air force, added inductance over mu_0 x core radius x turns^2, and where it
    /// is limited ln of peak |B| per ampere-turn over mu_0 / core radius).
    added: Arc<Cells>,
    /// Whether the flux density in the core is limited.
    with_peak: bool,
    /// The last of the three, where `added` is so fine that it is tabulated for itself.
    sharp_peaks: Option<Arc<Cells>>,
    /// Whether it has been sharpened.
    sharp: bool,
    /// Whether it is the draft.
    is_draft: bool,
    /// The search's table and the draft's, kept beside the sharp one.
    coarse: Arc<Cells>,
    rough: Arc<Cells>,
    neighbours: Option<Neighbours>,
    factors: Factors,
    relative_error: f64,
}

/// Factors of the tables' values, as found at one coil.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Factors {
    /// Neighbours on force and inductance; nothing without them.
    neighbours: Option<[Power; 2]>,
    /// The table's error on the core's peak field, which has kinks.
    peak: f64,
    /// The same of the search's table.
    coarse_peak: f64,
}

const NO_FACTORS: Factors = Factors {
    neighbours: None,
    peak: 1.0,
    coarse_peak: 1.0,
};

/// A product of powers of core radius, length and a2/a1: a factor with its slopes at one coil.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Power {
    at: [f64; 3],
    value: f64,
    exponents: [f64; 3],
}

impl Power {
    /// Whether its exponents serve `at` too.
    fn is_near(&self, at: [f64; 3]) -> bool {
        (0..3).all(|i| (self.at[i] - at[i]).abs() <= KEPT)
    }

    fn interpolated(&self, at: [f64; 3]) -> Interpolated {
        let ln: f64 = (0..3)
            .map(|i| self.exponents[i] * (at[i] - self.at[i]))
            .sum();
        let value = self.value * ln.exp();
        Interpolated {
            value,
            slope: self.exponents.map(|e| e * value),
        }
    }
}

/// Step of the differences that make the exponents, in logarithms: downwards, where no pitch is
/// exceeded.
const STEP: f64 = -0.1;
/// Exponents are kept while no coordinate has moved farther than this.
const KEPT: f64 = 0.05;

/// Values of one cored coil per ampere-turn, solved for itself.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Direct {
    /// The steel's force over the air coil's.
    force_ratio: f64,
    /// Added inductance over turns^2, H.
    added_inductance_h: f64,
}

impl CoredModel {
    /// A cored coil whose target, the magnet's centre, is `height_m` above its top face;
    /// `with_peak` where the flux density in the core is limited.
    ///
    /// # Errors
    /// [`NoCoredCoil`].
    pub fn new(
        height_m: f64,
        magnet: &MagnetRule,
        rule: CoreRule,
        with_peak: bool,
    ) -> Result<Self, NoCoredCoil> {
        let air = AirCoil::new(height_m, magnet)?.with_accuracy(&section_integrals::ROUGH);
        let dipoles = air.air_dipoles().unwrap_or_default().to_vec();
        if dipoles.iter().any(|&(z_m, _)| z_m <= rule.above_m) {
            return Err(NoCoredCoil::BelowTop);
        }
        let coarse = Arc::new(Cells::new(COARSE_LATTICE));
        Ok(Self {
            air,
            dipoles,
            rule,
            resolution: Resolution::for_tolerance(COARSE),
            added: Arc::clone(&coarse),
            coarse,
            rough: Arc::new(Cells::new(DRAFT_LATTICE)),
            neighbours: None,
            factors: NO_FACTORS,
            with_peak,
            sharp_peaks: None,
            sharp: false,
            is_draft: false,
            relative_error: COARSE,
        })
    }

    /// The same coil among the unpowered coils of an array.
    ///
    /// The search is for the coil alone; the neighbours' effect enters where it is sharpened.
    #[must_use]
    pub fn among(self, neighbours: Option<Neighbours>) -> Self {
        Self { neighbours, ..self }
    }

    /// How the core sits.
    #[must_use]
    pub fn rule(&self) -> &CoreRule {
        &self.rule
    }

    /// The steel's part for several depths of winding around one core.
    fn solve(
        &self,
        radius_m: f64,
        length_m: f64,
        depths_m: &[f64],
        resolution: &Resolution,
    ) -> Option<Vec<(CoredCoil, Direct)>> {
        if depths_m.iter().any(|depth_m| *depth_m <= 0.0) {
            return None;
        }
        let inner_radius_m = radius_m + self.rule.clearance_m;
        let shape = CoreShape {
            radius_m,
            ..self.rule.shape(inner_radius_m, length_m)?
        };
        let windings: Vec<Winding> = depths_m
            .iter()
            .map(|depth_m| Winding {
                inner_radius_m,
                outer_radius_m: inner_radius_m + depth_m,
                length_m,
                turns: 1.0,
            })
            .collect();
        let mu_r = self.rule.relative_permeability;
        let family = CoredCoil::family(&windings, shape, mu_r, resolution).ok()?;
        let direct = |coil: CoredCoil, depth_m: f64| {
            let window = Window {
                inner_radius_m,
                depth_m,
                length_m,
            };
            let (mut air, mut steel) = (0.0, 0.0);
            for &(z_m, moment) in &self.dipoles {
                let density = 1.0 / (depth_m * length_m);
                air -= moment * MU_0_T_M_PER_A * density * axis_gradient(&window, z_m).value;
                steel += moment * coil.core.field(0.0, z_m).dbz_dz;
            }
            let direct = Direct {
                force_ratio: steel / air,
                added_inductance_h: coil.added_inductance_h,
            };
            let finite = direct.force_ratio.is_finite() && direct.added_inductance_h.is_finite();
            finite.then_some((coil, direct))
        };
        family
            .into_iter()
            .zip(depths_m)
            .map(|(coil, &depth_m)| direct(coil, depth_m))
            .collect()
    }

    /// Entries of `added`.
    fn line(&self, ln_radius: f64, ln_length: f64, shares: &[f64]) -> Line {
        let (radius_m, length_m) = (ln_radius.exp(), ln_length.exp());
        let depths_m = self.depths_m(radius_m, shares);
        let solved = self.solve(radius_m, length_m, &depths_m, &self.resolution)?;
        let scale_h = MU_0_T_M_PER_A * radius_m;
        let peaks = if self.with_peak && !self.sharp {
            ln_peaks(&solved, PEAK_SHARE * self.relative_error)?
        } else {
            vec![0.0; solved.len()]
        };
        let values = |((_, d), peak): (&(CoredCoil, Direct), f64)| {
            [d.force_ratio, d.added_inductance_h / scale_h, peak]
        };
        Some(solved.iter().zip(peaks).map(values).collect())
    }

    /// Entries of `sharp_peaks`.
    fn peak_line(&self, ln_radius: f64, ln_length: f64, shares: &[f64]) -> Line {
        let (radius_m, length_m) = (ln_radius.exp(), ln_length.exp());
        let depths_m = self.depths_m(radius_m, shares);
        let resolution = Resolution::for_tolerance(COARSE);
        let solved = self.solve(radius_m, length_m, &depths_m, &resolution)?;
        let values = |ln: f64| -> Values { [0.0, 0.0, ln] };
        let peaks = ln_peaks(&solved, PEAK_SHARE * COARSE)?;
        Some(peaks.into_iter().map(values).collect())
    }

    fn depths_m(&self, radius_m: f64, shares: &[f64]) -> Vec<f64> {
        let inner_radius_m = radius_m + self.rule.clearance_m;
        let depth = |share: &f64| inner_radius_m * share.exp_m1();
        shares.iter().map(depth).collect()
    }

    /// Table coordinates of a window: ln core radius, ln length, ln a2/a1.
    fn coordinates(&self, window: &Window) -> Result<[f64; 3], NoResponse> {
        let inner_m = window.inner_radius_m;
        let no = |why: &str| NoResponse(why.to_owned());
        let shape = self
            .rule
            .shape(inner_m, window.length_m)
            .filter(|shape| shape.radius_m >= THINNEST * window.outer_radius_m())
            .ok_or_else(|| no("no room for a core in the bore"))?;
        if shape.length_m() < FLATTEST * shape.radius_m {
            return Err(no("the core is a foil"));
        }
        if let Some(neighbours) = &self.neighbours
            && 2.0 * window.outer_radius_m() > neighbours.spacing_m * (1.0 + 1e-9)
        {
            return Err(no("wider than the array's pitch"));
        }
        let gap_m = self.dipoles.iter().fold(f64::INFINITY, |gap, d| {
            gap.min(d.0 - self.rule.above_m.max(0.0))
        });
        if gap_m < CLOSEST * shape.radius_m {
            return Err(no("the magnet is too close to a core so wide"));
        }
        Ok([
            shape.radius_m.ln(),
            window.length_m.ln(),
            (window.depth_m / inner_m).ln_1p(),
        ])
    }

    /// Slopes by table coordinates to slopes by inner radius, depth and length.
    fn chained(&self, window: &Window, by: &Interpolated) -> Sloped {
        let (inner, outer) = (window.inner_radius_m, window.outer_radius_m());
        let radius = inner - self.rule.clearance_m;
        let by_inner = by.slope[0] / radius - by.slope[2] * window.depth_m / (inner * outer);
        Sloped {
            value: by.value,
            slope: [
                by_inner,
                by.slope[2] / outer,
                by.slope[1] / window.length_m,
                0.0,
            ],
        }
    }

    /// The largest of the table's errors at `window`, against a solution of its own.
    fn checked(&self, window: &Window) -> Option<f64> {
        let shape = self.rule.shape(window.inner_radius_m, window.length_m)?;
        let depths_m = [window.depth_m];
        let direct = self
            .solve(
                shape.radius_m,
                window.length_m,
                &depths_m,
                &self.resolution.coarser(),
            )?
            .pop()?
            .1;
        let at = self.coordinates(window).ok()?;
        let [ratio, added, _] = self.added.at(at, |x, y, z| self.line(x, y, z))?;
        let added_h = added.value * MU_0_T_M_PER_A * shape.radius_m;
        let force = (ratio.value - direct.force_ratio).abs() / (1.0 + direct.force_ratio).abs();
        let inductance = (added_h / direct.added_inductance_h - 1.0).abs();
        Some(force.max(inductance))
    }
}

impl CoredModel {
    /// The model of the search, with what was learnt when it was sharpened.
    fn coarse_model(&self) -> Self {
        Self {
            sharp: false,
            sharp_peaks: None,
            resolution: Resolution::for_tolerance(COARSE),
            added: Arc::clone(&self.coarse),
            relative_error: COARSE,
            air: self.air.clone().with_accuracy(&section_integrals::ROUGH),
            factors: Factors {
                peak: self.factors.coarse_peak,
                ..self.factors
            },
            ..self.clone()
        }
    }

    /// ln of the peak |B| per ampere-turn over mu_0 / core radius, as tabulated.
    fn ln_peak(&self, at: [f64; 3]) -> Option<Interpolated> {
        let [_, _, ln] = match &self.sharp_peaks {
            Some(peaks) => peaks.at(at, |x, y, z| self.peak_line(x, y, z))?,
            None => self.added.at(at, |x, y, z| self.line(x, y, z))?,
        };
        Some(ln)
    }

    /// The factors that make the tables right at `window`.
    fn factors_at(&self, window: &Window) -> Option<Factors> {
        let mut factors = NO_FACTORS;
        let at = self.coordinates(window).ok()?;
        if let Some(neighbours) = &self.neighbours {
            let value = self.among_factors(neighbours, at)?;
            let exponents = match self.factors.neighbours {
                Some(old) if old.iter().all(|power| power.is_near(at)) => {
                    old.map(|power| power.exponents)
                }
                _ => {
                    let mut exponents = [[0.0; 3]; 2];
                    for i in 0..3 {
                        let mut moved = at;
                        moved[i] += STEP;
                        let there = self.among_factors(neighbours, moved)?;
                        for f in 0..2 {
                            exponents[f][i] = (there[f] / value[f]).ln() / STEP;
                        }
                    }
                    exponents
                }
            };
            factors.neighbours = Some(std::array::from_fn(|f| Power {
                at,
                value: value[f],
                exponents: exponents[f],
            }));
        }
        if self.with_peak {
            let shape = self.rule.shape(window.inner_radius_m, window.length_m)?;
            let depths_m = [window.depth_m];
            let solved =
                self.solve(shape.radius_m, window.length_m, &depths_m, &self.resolution)?;
            let coils = [solved.into_iter().next()?.0];
            let exact = ln_peaks_of(&coils, PEAK_FINE)?.pop()?;
            let blunt = self.coarse_model();
            let [_, _, coarse] = blunt.added.at(at, |x, y, z| blunt.line(x, y, z))?;
            factors.coarse_peak = (exact - coarse.value).exp();
            factors.peak = (exact - self.ln_peak(at)?.value).exp();
        }
        Some(factors)
    }

    /// Factors of the neighbours in force and inductance of the coil at table coordinates.
    fn among_factors(&self, neighbours: &Neighbours, at: [f64; 3]) -> Option<[f64; 2]> {
        let (radius_m, length_m) = (at[0].exp(), at[1].exp());
        let depths_m = self.depths_m(radius_m, &[at[2]]);
        let solved = self.solve(radius_m, length_m, &depths_m, &self.resolution);
        let (coil, _) = solved?.pop()?;
        let air_h = self_inductance_h(&coil.winding);
        let mu_r = self.rule.relative_permeability;
        neighbours.factors(&coil, mu_r, &self.dipoles, air_h)
    }
}

/// ln of the largest |B| in the core per ampere over mu_0 / core radius, of windings of one turn
/// around one core.
fn ln_peaks(solved: &[(CoredCoil, Direct)], accuracy: f64) -> Option<Vec<f64>> {
    let coils: Vec<CoredCoil> = solved.iter().map(|(coil, _)| coil.clone()).collect();
    ln_peaks_of(&coils, accuracy)
}

fn ln_peaks_of(coils: &[CoredCoil], accuracy: f64) -> Option<Vec<f64>> {
    let shape = coils.first()?.core.outline().shape;
    let peaks_t = peaks_of_family_t(coils, peak_depth_m(shape), accuracy).ok()?;
    let ln = |peak_t: f64| {
        let good = peak_t > 0.0 && peak_t.is_finite();
        good.then(|| (peak_t * shape.radius_m / MU_0_T_M_PER_A).ln())
    };
    peaks_t.into_iter().map(ln).collect()
}

impl CoilModel for CoredModel {
    fn response(
        &self,
        window: &Window,
        turns_per_m2: f64,
        current_a: f64,
        with_inductance: bool,
    ) -> Result<Response, NoResponse> {
        let at = self.coordinates(window)?;
        let mut response = self
            .air
            .response(window, turns_per_m2, current_a, with_inductance)?;
        let unsolved = || NoResponse("the steel's equations have no finite solution".to_owned());
        let [ratio, added, peak] = self
            .added
            .at(at, |x, y, z| self.line(x, y, z))
            .ok_or_else(unsolved)?;
        let mut factor = self.chained(window, &ratio);
        factor.value += 1.0;
        response.force_n = response.force_n.product(factor);
        if let Some([force, _]) = &self.factors.neighbours {
            let by = self.chained(window, &force.interpolated(at));
            response.force_n = response.force_n.product(by);
        }
        let radius_m = window.inner_radius_m - self.rule.clearance_m;
        let area_m2 = window.depth_m * window.length_m;
        if with_inductance {
            let turns = Sloped {
                value: area_m2,
                slope: [0.0, window.length_m, window.depth_m, 0.0],
            }
            .times(turns_per_m2);
            let radius = Sloped {
                value: radius_m,
                slope: [1.0, 0.0, 0.0, 0.0],
            };
            let per_turns = self
                .chained(window, &added)
                .product(radius)
                .times(MU_0_T_M_PER_A);
            let steel = per_turns.product(turns.product(turns));
            response.inductance_h.value += steel.value;
            for (sum, slope) in response.inductance_h.slope.iter_mut().zip(steel.slope) {
                *sum += slope;
            }
            if let Some([_, inductance]) = &self.factors.neighbours {
                let by = self.chained(window, &inductance.interpolated(at));
                response.inductance_h = response.inductance_h.product(by);
            }
        }
        let section = PI * STEEL_DENSITY_KG_PER_M3 * radius_m;
        let length_m = window.length_m + self.rule.below_m + self.rule.above_m;
        response.core_mass_kg = Sloped {
            value: section * radius_m * length_m,
            slope: [2.0 * section * length_m, 0.0, section * radius_m, 0.0],
        };
        if self.with_peak {
            let ln = match &self.sharp_peaks {
                Some(_) => self.ln_peak(at).ok_or_else(unsolved)?,
                None => peak,
            };
            let ln = self.chained(window, &ln);
            let per_turn = self.factors.peak * ln.value.exp() * MU_0_T_M_PER_A / radius_m;
            let peak_t = per_turn * turns_per_m2 * area_m2 * current_a;
            response.core_field_t = Sloped {
                value: peak_t,
                slope: [
                    peak_t * (ln.slope[0] - 1.0 / radius_m),
                    peak_t * (ln.slope[1] + 1.0 / window.depth_m),
                    peak_t * (ln.slope[2] + 1.0 / window.length_m),
                    peak_t / current_a,
                ],
            };
        }
        Ok(response)
    }

    fn relative_error(&self) -> f64 {
        self.relative_error
    }

    /// The draft's errors are those measured in the table's cell of `window` and its solutions',
    /// doubled.
    fn doubts(&self, window: &Window) -> Doubts {
        let doubled = |[force, _, field]: Values, solved: f64| Doubts {
            force_ln: 2.0 * (force + solved),
            core_field_ln: 2.0 * (field + solved),
        };
        if !self.is_draft {
            let solved = 2.5 * self.relative_error;
            return doubled([0.0; COUNT], solved);
        }
        let errors = |value: &Values, exact: &Values| -> Values {
            let ratio = ((1.0 + value[0]) / (1.0 + exact[0])).ln().abs();
            let ratio = if ratio.is_nan() { f64::INFINITY } else { ratio };
            [ratio, 0.0, (value[2] - exact[2]).abs()]
        };
        let measured = || {
            let at = self.coordinates(window).ok()?;
            self.added.errors(at, |x, y, z| self.line(x, y, z), errors)
        };
        doubled(measured().unwrap_or([f64::INFINITY; COUNT]), DRAFT)
    }

    fn length_scale_m(&self) -> f64 {
        self.air.length_scale_m()
    }

    fn focus(&self, window: &Window) -> Option<Box<dyn CoilModel>> {
        let at = self.coordinates(window).ok()?;
        self.added.focus(at);
        if self.added.is_clear(at) {
            return None;
        }
        let added = Arc::new(Cells::new(COARSE_LATTICE));
        added.focus(at);
        Some(Box::new(Self {
            coarse: Arc::clone(&added),
            added,
            ..self.clone()
        }))
    }

    fn sharpened(&self, window: &Window) -> Option<Box<dyn CoilModel>> {
        let at = self.coordinates(window).ok()?;
        if self.sharp && !self.with_peak && self.neighbours.is_none() {
            return None;
        }
        let mut sharp = self.clone();
        if !self.sharp {
            // The best coil is in its cell's middle, away from the borders; no winding in
            // the cell is without depth.
            let mut width = FINE_WIDTH;
            width[2] = width[2].min(WITHIN * at[2]);
            let lattice = |order| Lattice {
                origin: std::array::from_fn(|i| at[i] - 0.5 * width[i]),
                width,
                order,
            };
            sharp.sharp = true;
            sharp.resolution = CoredCoil::first_resolution(FINE);
            sharp.added = Arc::new(Cells::new(lattice(FINE_ORDER)));
            sharp.air = sharp.air.with_accuracy(&section_integrals::FINE);
            sharp.added.fill(at, |x, y, z| sharp.line(x, y, z));
            // Beside the middle, which may be a node.
            let beside = Window {
                inner_radius_m: 0.97 * window.inner_radius_m,
                depth_m: 0.93 * window.depth_m,
                length_m: 1.04 * window.length_m,
            };
            sharp.relative_error = sharp.checked(&beside)?.max(FINE);
            if sharp.with_peak {
                let peaks = Cells::new(lattice(COARSE_LATTICE.order));
                peaks.fill(at, |x, y, z| sharp.peak_line(x, y, z));
                sharp.sharp_peaks = Some(Arc::new(peaks));
            }
        }
        sharp.factors = sharp.factors_at(window)?;
        Some(Box::new(sharp))
    }

    fn blunted(&self) -> Option<Box<dyn CoilModel>> {
        self.sharp.then(|| {
            let blunt: Box<dyn CoilModel> = Box::new(self.coarse_model());
            blunt
        })
    }

    fn draft(&self) -> Option<Box<dyn CoilModel>> {
        (!self.sharp).then(|| {
            let draft: Box<dyn CoilModel> = Box::new(Self {
                resolution: Resolution::for_tolerance(DRAFT),
                added: Arc::clone(&self.rough),
                relative_error: DRAFT,
                is_draft: true,
                ..self.clone()
            });
            draft
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_power_serves_what_has_moved_little_in_every_coordinate() {
        let power = Power {
            at: [-4.4, -2.3, 0.7],
            value: 0.9,
            exponents: [-0.3, 0.2, 0.1],
        };
        let moved = |by: [f64; 3]| std::array::from_fn(|i| power.at[i] + by[i]);
        assert!(power.is_near(power.at) && power.is_near(moved([0.04, -0.04, 0.04])));
        for i in 0..3 {
            for by in [-0.06, 0.06] {
                let mut far = [0.0; 3];
                far[i] = by;
                assert!(!power.is_near(moved(far)));
            }
        }
        // A product of powers: its slopes are those of its logarithm.
        let there = power.interpolated(moved([0.1, 0.0, 0.0]));
        assert!((there.value - 0.9 * (-0.03_f64).exp()).abs() < 1e-15);
        assert!((there.slope[0] / there.value + 0.3).abs() < 1e-15);
    }
}
