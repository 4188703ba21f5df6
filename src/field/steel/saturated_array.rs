//! An array of identical cored coils at given currents, whose steel saturates.
//!
//! Every core's layer is the linear one, of a reference permeability, and a correction of the
//! axisymmetric mode. With phi the potential of that mode on a core's outline, of its own winding
//! and of all that others send,
//!
//! ```text
//! delta = v(phi) - v_lin(phi),     q - T K q = T p + q_own + q(delta),
//! ```
//!
//! v being what [`SaturatedCore`] finds and the second equation that of the linear array (see
//! [`super::array`]). What the cores send changes phi; that fixed point is sought by Anderson's
//! iteration, the unknowns being the potentials of mode 0 on the exchange rings.
//!
//! The other modes stay linear: across the core the permeability that counts is the secant, and a
//! cylinder's transverse magnetisation is all but that of infinite permeability as long as the
//! secant is some tens. The reference is the secant of the most saturated core, and what the
//! initial permeability in its place changes is part of the stated error.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::CoreShape;
use super::array::{ArrayResolution, closest_m};
use super::clearance::Clearance;
use super::core_layers::CoreLayers;
use super::cored_coil::Excitation;
use super::coupling::Coupling;
use super::curve_refinement::{AlongCurve, Level, Try, refined};
use super::equivalent_dipoles::{ArraySources, Near};
use super::generatrix::{Generatrix, Resolution};
use super::offsets::Offsets;
use super::permeability::Permeability;
use super::response::{Response, Rings, mean};
use super::saturated::{Convergence, CoreField, SaturatedCore, Solution};
use super::spectral_fem::MeshError;
use super::symmetry::motions;
use crate::components::Components;
use crate::winding::{OnEdge, Winding};
use fluxform_base::units::MU_0_T_M_PER_A;
use fluxform_numerics::anderson::Anderson;

/// Iterates that the acceleration remembers.
const DEPTH: usize = 5;
/// Steps after which the iteration is given up; 3 to 10 are usual.
const MOST_STEPS: usize = 60;
/// Change of the potentials, relative to the largest on any core and in units of the linear
/// solver's residual, at which the iteration ends.
const SETTLED: f64 = 3.0;
/// Times what the other modes' permeability changes is stated: a margin for places between those
/// compared, not a bound. Without it 9 of 40 random pairs of coils lay up to 1.3 times above.
const MODES_SAFETY: f64 = 2.0;
/// Share of the tolerance that the outlines are allowed where the linear modes take most of it.
const MODES_LEAVE: f64 = 0.3;
/// Share of a try's aim that the outlines aim at: they are the cheap part.
const OUTLINE_SHARE: f64 = 0.3;
/// Distance above the cores, in radii, below which no error is estimated.
const CLOSEST: f64 = 0.1;
/// Places about every coil at which two solutions are compared, in units of its outer radius.
const PLACES: [[f64; 2]; 8] = [
    [0.0, 0.0],
    [0.7, 0.2],
    [-0.7, -0.1],
    [0.1, 0.6],
    [-0.2, -0.6],
    [-0.4, 1.1],
    [-0.6, 0.9],
    [1.5, -1.2],
];

/// Why an array cannot be solved.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SaturatedArrayError {
    /// A node of the outline lies on the winding's edge.
    #[error(transparent)]
    OnEdge(#[from] OnEdge),
    /// The core cannot be meshed.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// As many currents as coils are needed.
    #[error("{currents} currents were given for {coils} coils")]
    Currents {
        /// Currents given.
        currents: usize,
        /// Coils there are.
        coils: usize,
    },
}

/// The array at its working point.
#[derive(Debug, Clone)]
pub struct SaturatedArray {
    /// Whether the numbers can be used.
    pub status: Convergence,
    /// Axes, m.
    pub positions_m: Vec<[f64; 2]>,
    /// Current in every coil, A.
    pub currents_a: Vec<f64>,
    /// The winding of every coil.
    pub winding: Winding,
    /// Relative permeability of the modes that are not axisymmetric.
    pub reference_permeability: f64,
    /// |B| in every core, of the axisymmetric mode: what lies across the axis adds its square.
    pub fields: Vec<CoreField>,
    /// Flux of all cores through every coil, Wb; the windings' own flux is not in it.
    pub flux_linkage_wb: Vec<f64>,
    /// Estimated error: of the total gradient above, relative to the largest |grad B| at the
    /// height, and of the flux, relative to the largest; the larger. What three solutions state as
    /// of one coil along its curve, or what the caps on resolution cost where that is more, plus
    /// [`SaturatedArray::modes_error`]; infinite where the iteration stalled at any.
    pub relative_error: f64,
    /// The part of it that is due to the other modes being linear: twice what they change
    /// when their permeability is the initial one.
    pub modes_error: f64,
    /// Change of the potentials in every step of the iteration, relative to the largest.
    pub steps: Vec<f64>,
    response: Response,
    /// Total layers of every core on the nodes, columns as [`SaturatedArray::layers`] has them, A.
    layers_a: Vec<DMatrix<f64>>,
    /// Where another solution of the same array can start from.
    state: State,
}

/// Unknowns of the iteration.
#[derive(Debug, Clone)]
struct State {
    /// Potential of mode 0 that others send, [ring, core], A.
    sent_a: DMatrix<f64>,
    /// Every core's last solution.
    cores: Vec<Option<Solution>>,
}

/// Tables of one resolution for any reference permeability.
struct Setup {
    outline: Generatrix,
    excitation: Excitation,
    core: SaturatedCore,
    resolution: ArrayResolution,
}

impl Setup {
    fn new(
        winding: &Winding,
        shape: CoreShape,
        resolution: &ArrayResolution,
    ) -> Result<Self, SaturatedArrayError> {
        let outline = Generatrix::of_coil(winding, shape, &resolution.outline);
        let excitation = Excitation::new(winding, &outline, resolution.outline.quadrature)?;
        let core = SaturatedCore::new(&outline, resolution.outline.quadrature)?;
        Ok(Self {
            outline,
            excitation,
            core,
            resolution: *resolution,
        })
    }
}

impl SaturatedArray {
    /// Solves for `currents_a` to an estimated error below `tolerance` at heights from `lowest_m`
    /// up, or as far as the method and the caps on resolution allow:
    /// [`SaturatedArray::relative_error`] says what was reached.
    ///
    /// Domain: as for [`super::array::CoupledArray::at_resolution`], and a law as
    /// [`Permeability`] asks for.
    ///
    /// # Errors
    /// See [`SaturatedArrayError`].
    pub fn new(
        winding: &Winding,
        shape: CoreShape,
        law: &dyn Permeability,
        positions_m: &[[f64; 2]],
        currents_a: &[f64],
        tolerance: f64,
        lowest_m: f64,
    ) -> Result<Self, SaturatedArrayError> {
        check(positions_m, currents_a)?;
        let mut sequence = Sequence {
            winding,
            shape,
            law,
            positions_m,
            currents_a,
            reference: law.response(0.0).relative,
            tolerance,
            lowest_m: lowest_m.max(shape.top_m.max(0.0) + CLOSEST * shape.radius_m),
        };
        let first = Try::first(tolerance);
        let linear = sequence.setup(&first, Level::Coarsest)?;
        let initial = sequence.at(&linear, None);
        sequence.reference = initial.least_secant(&linear.core, law);
        let coarsest = sequence.at(&linear, Some(&initial.state));
        let modes_error =
            MODES_SAFETY * coarsest.difference(&initial, sequence.lowest_m, tolerance)?;
        // No resolution reduces the error of the modes.
        let left = tolerance - modes_error;
        let left = if left > 0.0 {
            left.max(MODES_LEAVE * tolerance)
        } else {
            tolerance
        };
        let found = refined(&sequence, first, left, Some(coarsest))?;
        Ok(Self {
            modes_error,
            relative_error: if initial.status == Convergence::Converged {
                found.error + modes_error
            } else {
                f64::INFINITY
            },
            ..found.fine
        })
    }

    /// Solves at one resolution, with a given permeability of the modes that are not
    /// axisymmetric; no error is estimated.
    ///
    /// # Errors
    /// See [`SaturatedArrayError`].
    pub fn at_resolution(
        winding: &Winding,
        shape: CoreShape,
        law: &dyn Permeability,
        positions_m: &[[f64; 2]],
        currents_a: &[f64],
        reference_permeability: f64,
        resolution: &ArrayResolution,
    ) -> Result<Self, SaturatedArrayError> {
        check(positions_m, currents_a)?;
        let setup = Setup::new(winding, shape, resolution)?;
        Ok(Self::solve(
            winding,
            &setup,
            law,
            positions_m,
            currents_a,
            reference_permeability,
            None,
        ))
    }

    fn solve(
        winding: &Winding,
        setup: &Setup,
        law: &dyn Permeability,
        positions_m: &[[f64; 2]],
        currents_a: &[f64],
        reference_permeability: f64,
        start: Option<&State>,
    ) -> Self {
        let resolution = &setup.resolution;
        let exchange = Rings::graded(
            &setup.outline,
            resolution.order,
            &resolution.grading(setup.outline.shape, winding.length_m),
        );
        let response = Response::new(
            setup.outline.clone(),
            exchange,
            resolution.angles(),
            resolution.modes,
            reference_permeability,
            resolution.outline.quadrature,
        );
        let coupling = Coupling::new(winding, positions_m, &response, resolution.residual);
        let problem = Problem {
            setup,
            response: &response,
            coupling: &coupling,
            own_layer: response.axial_layer(&setup.excitation.potential),
            windings: coupling.of_windings(currents_a),
            currents_a,
            alike: alike(positions_m, currents_a),
        };
        let cores = positions_m.len();
        let mut state = start.cloned().unwrap_or_else(|| State {
            sent_a: DMatrix::zeros(response.exchange.rings.len(), cores),
            cores: vec![None; cores],
        });
        let solved = problem.iterate(&mut state, law);
        let solutions: Vec<&Solution> = state.cores.iter().flatten().collect();
        let fields = solutions
            .iter()
            .map(|solution| setup.core.field(solution, law))
            .collect();
        let weights = setup.excitation.flux_weights_wb_per_a(&setup.outline);
        let of_others_wb = coupling.flux_of_others_wb(|core| {
            let rows = solved.moments.nrows();
            &solved.moments.as_slice()[core * rows..(core + 1) * rows]
        });
        let flux_linkage_wb = (solved.layers_a.iter().zip(of_others_wb))
            .map(|(layers, of_others_wb)| weights.dot(&layers.column(0)) + of_others_wb)
            .collect();
        Self {
            status: solved.status,
            positions_m: positions_m.to_vec(),
            currents_a: currents_a.to_vec(),
            winding: *winding,
            reference_permeability,
            fields,
            flux_linkage_wb,
            relative_error: f64::NAN,
            modes_error: f64::NAN,
            steps: solved.steps,
            layers_a: solved.layers_a,
            response,
            state,
        }
    }

    /// Total layers of one core on the nodes of [`SaturatedArray::outline`]: column 0 for mode 0,
    /// then cosine and sine of every mode, A.
    #[must_use]
    pub fn layers(&self, core: usize) -> &DMatrix<f64> {
        &self.layers_a[core]
    }

    /// The outline of every core.
    #[must_use]
    pub fn outline(&self) -> &Generatrix {
        &self.response.outline
    }

    /// Number of azimuthal modes.
    #[must_use]
    pub fn modes(&self) -> usize {
        self.response.layers.len()
    }

    /// Smallest ratio of mean |B| to mean |H| of any core, over mu_0.
    fn least_secant(&self, core: &SaturatedCore, law: &dyn Permeability) -> f64 {
        let interior = core.interior();
        self.state
            .cores
            .iter()
            .flatten()
            .map(|solution| {
                let sum = |weight: &dyn Fn(f64) -> f64| {
                    interior.integral(&solution.u_a, |at| {
                        let h = at.h_a_per_m();
                        h * weight(h)
                    })
                };
                let b = sum(&|h| law.response(h).relative);
                let h = sum(&|_| 1.0);
                if h > 0.0 { b / h } else { f64::INFINITY }
            })
            .fold(law.response(0.0).relative, f64::min)
    }

    /// Largest difference of the gradients at a few heights, relative to the largest |grad B|
    /// there, and of the flux.
    fn difference(&self, other: &Self, lowest_m: f64, tolerance: f64) -> Result<f64, OnEdge> {
        let shape = self.outline().shape;
        let current_a = self.currents_a.iter().fold(0.0_f64, |m, i| m.max(i.abs()));
        if current_a == 0.0 {
            return Ok(0.0);
        }
        let above = Clearance::above(lowest_m, lowest_m - shape.top_m);
        let sources = |array: &Self| ArraySources::of_saturated(array, above, 0.1 * tolerance);
        let (fine, coarse) = (sources(self), sources(other));
        let parts = Components::Gradient;
        let reach = self.winding.outer_radius_m;
        let mut worst = 0.0_f64;
        for height in [0.0, 1.0, 4.0] {
            let z_m = lowest_m + height * shape.radius_m;
            let points: Vec<[f64; 3]> = self
                .positions_m
                .iter()
                .flat_map(|[x, y]| PLACES.map(|[dx, dy]| [x + reach * dx, y + reach * dy, z_m]))
                .collect();
            let mut values = vec![0.0; parts.count() * points.len()];
            let mut others = values.clone();
            fine.sample(&points, parts, &mut values);
            coarse.sample(&points, parts, &mut others);
            let air = current_a * self.winding.field(0.0, z_m)?.gradient_norm();
            let size = values.iter().fold(0.0_f64, |m, v| m.max(v.abs())) + air;
            worst = worst.max(farthest(&values, &others) / size);
        }
        let turns = self.winding.turns;
        let least = 0.1 * MU_0_T_M_PER_A * turns * turns * self.winding.inner_radius_m * current_a;
        let size = self
            .flux_linkage_wb
            .iter()
            .fold(least, |m, f| m.max(f.abs()));
        Ok(worst.max(farthest(&self.flux_linkage_wb, &other.flux_linkage_wb) / size))
    }
}

impl ArraySources {
    /// As [`ArraySources::of_array`] for a saturated array at its working point: one drive, of all its currents.
    #[must_use]
    pub fn of_saturated(array: &SaturatedArray, clearance: Clearance, tolerance: f64) -> Self {
        let waves = 2 * array.modes() - 1;
        let all: Vec<_> = (0..array.positions_m.len())
            .flat_map(|core| array.layers(core).column_iter())
            .collect();
        let layers = DMatrix::from_columns(&all);
        Self::new(
            array.outline(),
            &array.positions_m,
            &CoreLayers::of_each((array.positions_m.len(), 1), waves, layers),
            Near {
                clearance,
                tolerance,
                many: false,
                winding: &array.winding,
            },
        )
    }
}

/// One array at its currents, compared from a height up.
struct Sequence<'a> {
    winding: &'a Winding,
    shape: CoreShape,
    law: &'a dyn Permeability,
    positions_m: &'a [[f64; 2]],
    currents_a: &'a [f64],
    /// Permeability of the modes that are not axisymmetric.
    reference: f64,
    tolerance: f64,
    lowest_m: f64,
}

impl Sequence<'_> {
    /// How finely the finest solution of a try is cut, but for its outline.
    fn finest(&self, aim: f64) -> ArrayResolution {
        let offsets = Offsets::of_pairs(self.positions_m).count();
        ArrayResolution::for_tolerance(aim, self.shape, closest_m(self.positions_m)).within_memory(
            self.shape,
            self.winding.length_m,
            offsets,
        )
    }

    /// The exchange between the cores converges as its order says, so that both coarser solutions
    /// share theirs.
    fn setup(&self, of: &Try, level: Level) -> Result<Setup, SaturatedArrayError> {
        let finest = self.finest(of.aim);
        let exchange = match level {
            Level::Fine => finest,
            Level::Coarse | Level::Coarsest => finest.coarser(),
        };
        let of_aim = Resolution::for_tolerance(OUTLINE_SHARE * of.aim);
        let resolution = ArrayResolution {
            outline: of.outline(level, of_aim),
            ..exchange
        };
        Setup::new(self.winding, self.shape, &resolution)
    }

    fn at(&self, setup: &Setup, start: Option<&State>) -> SaturatedArray {
        SaturatedArray::solve(
            self.winding,
            setup,
            self.law,
            self.positions_m,
            self.currents_a,
            self.reference,
            start,
        )
    }
}

impl AlongCurve for Sequence<'_> {
    type Solution = SaturatedArray;
    type Error = SaturatedArrayError;

    fn solve(
        &self,
        of: &Try,
        level: Level,
        _start: Option<&SaturatedArray>,
    ) -> Result<SaturatedArray, SaturatedArrayError> {
        Ok(self.at(&self.setup(of, level)?, None))
    }

    fn difference(
        &self,
        a: &SaturatedArray,
        b: &SaturatedArray,
    ) -> Result<f64, SaturatedArrayError> {
        if a.status == Convergence::Stalled || b.status == Convergence::Stalled {
            return Ok(f64::INFINITY);
        }
        Ok(a.difference(b, self.lowest_m, self.tolerance)?)
    }

    /// Where the caps bind, wrong solutions may agree by chance.
    fn floor(&self, of: &Try) -> f64 {
        let finest = self.finest(of.aim);
        finest.exchange_error(self.shape, closest_m(self.positions_m))
    }
}

/// Largest difference of a potential from its mean: its constant is no field.
fn variation(potential: &DVector<f64>) -> f64 {
    potential.add_scalar(-potential.mean()).amax()
}

/// The fixed point of one array.
struct Problem<'a> {
    setup: &'a Setup,
    response: &'a Response,
    coupling: &'a Coupling,
    /// Linear layer of a core under its own winding, A/A.
    own_layer: DVector<f64>,
    /// Potential sent to every core by the other coils' windings, A.
    windings: DMatrix<f64>,
    currents_a: &'a [f64],
    /// For every core the first one in the same state.
    alike: Vec<usize>,
}

/// Result of the iteration.
struct Solved {
    status: Convergence,
    steps: Vec<f64>,
    layers_a: Vec<DMatrix<f64>>,
    moments: DMatrix<f64>,
}

impl Problem<'_> {
    fn iterate(&self, state: &mut State, law: &dyn Permeability) -> Solved {
        let residual = self.setup.resolution.residual;
        let (rings, cores) = state.sent_a.shape();
        let scale = self.scale();
        let mut anderson = Anderson::new(DEPTH);
        let mut steps = Vec::new();
        loop {
            let layers = self.cores(state, law);
            let corrections = self.corrections(&state.sent_a, &layers);
            let mut own = DMatrix::zeros(self.response.size(), cores);
            for (core, correction) in corrections.iter().enumerate() {
                let layer = &self.own_layer * self.currents_a[core] + correction;
                own.set_column(core, &self.response.on_grid(&layer));
            }
            let solved = self
                .coupling
                .solve(self.windings.clone(), &own, 0.1 * residual);
            let modes: Vec<DMatrix<f64>> = solved
                .potentials
                .column_iter()
                .map(|p| self.response.modes_of(p.into_owned().as_slice()))
                .collect();
            let axial: Vec<DVector<f64>> = modes.iter().map(|m| m.column(0).into_owned()).collect();
            let image = DMatrix::from_columns(&axial);
            let change = (0..cores)
                .map(|core| variation(&(image.column(core) - state.sent_a.column(core))))
                .fold(0.0, f64::max);
            let relative = if scale > 0.0 { change / scale } else { change };
            steps.push(relative);
            let found = state.cores.iter().all(|c| {
                c.as_ref()
                    .is_some_and(|c| c.status == Convergence::Converged)
            });
            let settled = relative <= SETTLED * residual;
            if settled || steps.len() >= MOST_STEPS || !relative.is_finite() {
                let layers_a = modes
                    .iter()
                    .zip(&corrections)
                    .enumerate()
                    .map(|(core, (modes, correction))| {
                        let mut layers = self.response.layers_of(modes);
                        let own = &self.own_layer * self.currents_a[core] + correction;
                        layers.column_mut(0).axpy(1.0, &own, 1.0);
                        layers
                    })
                    .collect();
                return Solved {
                    status: if settled && found {
                        Convergence::Converged
                    } else {
                        Convergence::Stalled
                    },
                    steps,
                    layers_a,
                    moments: solved.moments,
                };
            }
            let flat = |m: &DMatrix<f64>| DVector::from_column_slice(m.as_slice());
            let next = anderson.next(&flat(&state.sent_a), flat(&image));
            state.sent_a = DMatrix::from_column_slice(rings, cores, next.as_slice());
        }
    }

    /// Largest potential on a core, of all coils' currents together: half its rise from end to
    /// end.
    fn scale(&self) -> f64 {
        let own = &self.setup.excitation.potential;
        let current_a = self.currents_a.iter().fold(0.0_f64, |m, i| m.max(i.abs()));
        0.5 * current_a * (own.max() - own.min())
    }

    /// Layers of mode 0 of all cores, under their own windings and the potentials sent.
    fn cores(&self, state: &mut State, law: &dyn Permeability) -> Vec<DVector<f64>> {
        let to_nodes = &self.response.exchange.to_nodes;
        let found: Vec<Option<Solution>> = (0..self.alike.len())
            .into_par_iter()
            .map(|core| {
                (self.alike[core] == core).then(|| {
                    let phi = &self.setup.excitation.potential * self.currents_a[core]
                        + to_nodes * state.sent_a.column(core);
                    let start = state.cores[core].as_ref().map(|solution| &solution.v_a);
                    self.setup.core.solve(&phi, law, start)
                })
            })
            .collect();
        state.cores = self
            .alike
            .iter()
            .map(|&first| found[first].clone())
            .collect();
        state
            .cores
            .iter()
            .flatten()
            .map(|solution| {
                let shift = mean(&self.setup.outline, solution.v_a.iter());
                solution.v_a.add_scalar(-shift)
            })
            .collect()
    }

    /// Layers of mode 0 less the linear ones.
    fn corrections(&self, sent_a: &DMatrix<f64>, layers: &[DVector<f64>]) -> Vec<DVector<f64>> {
        layers
            .iter()
            .enumerate()
            .map(|(core, layer)| {
                let linear = &self.response.layers[0] * sent_a.column(core);
                layer - linear - &self.own_layer * self.currents_a[core]
            })
            .collect()
    }
}

fn check(positions_m: &[[f64; 2]], currents_a: &[f64]) -> Result<(), SaturatedArrayError> {
    if positions_m.len() == currents_a.len() {
        Ok(())
    } else {
        Err(SaturatedArrayError::Currents {
            currents: currents_a.len(),
            coils: positions_m.len(),
        })
    }
}

/// For every coil the first one that a motion of the array, currents and all, brings it to.
fn alike(positions_m: &[[f64; 2]], currents_a: &[f64]) -> Vec<usize> {
    let kept: Vec<_> = motions(positions_m)
        .into_iter()
        .filter(|m| {
            m.coil
                .iter()
                .zip(currents_a)
                .all(|(&to, i)| currents_a[to] == *i)
        })
        .collect();
    (0..positions_m.len())
        .map(|coil| kept.iter().map(|m| m.coil[coil]).fold(coil, usize::min))
        .collect()
}

fn farthest(a: &[f64], b: &[f64]) -> f64 {
    a.iter()
        .zip(b)
        .fold(0.0, |m, (a, b)| f64::max(m, (a - b).abs()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_constant_is_no_variation() {
        for constant in [-1.3, 0.0, 7.0] {
            let values = [0.7, -0.2, -0.5].map(|v| v + constant);
            let found = variation(&DVector::from_row_slice(&values));
            assert!((found - 0.7).abs() < 1e-14, "{constant}: {found}");
        }
    }
}
