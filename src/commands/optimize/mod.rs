//! `optimize`: the best coil within a design's limits (eq. 11).

pub mod array;
pub(crate) mod command;
mod compared;
mod design_document;
mod model;
mod no_coil;
pub mod page;
mod picture;
mod result;
mod text;

use std::collections::BTreeMap;

pub use design_document::Document;
pub use result::*;

use strum::{EnumMessage, EnumString, IntoStaticStr, VariantArray};

use crate::RunError;
use crate::accuracy::StageAccuracy;
use crate::bundle::artefact::{FLUXFORM_VERSION, Input, SCHEMA_VERSION};
use crate::coil::circuit::Circuit;
use crate::coil::limits::{
    LIMITS, LimitCheck, LimitName, bobbin_bore_m as bobbin_bore_m_of, by_key,
};
use crate::coil::optimum::alternatives::alternatives;
use crate::coil::optimum::landscape::{CoilLandscape, landscape};
use crate::coil::optimum::neighbours::Neighbours;
use crate::coil::optimum::problem::Task;
use crate::coil::optimum::task::{self, Surroundings};
use crate::coil::optimum::{
    Advantage, Alternative, BestCoil, Fixed, LimitUse, Outcome, Settings, Window, optimise,
    optimise_wound,
};
use crate::design::{Design, Limits};
use crate::progress::{Progress, Silent};
use crate::report::number::force;
use crate::scene::rated::Rated;
use crate::scene::steel;
use crate::scene::{Scene, coupled};

/// How well the optimiser's force among neighbours agrees with a coupled solution: what the
/// latter is solved to there.
const NEIGHBOURS_AGREE: f64 = 1e-3;

/// A dimension that may be given.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, EnumMessage, EnumString, IntoStaticStr, VariantArray,
)]
pub enum Dimension {
    /// The bore
    #[strum(serialize = "inner_diameter_mm")]
    InnerDiameter,
    /// The outer diameter
    #[strum(serialize = "outer_diameter_mm")]
    OuterDiameter,
    /// The length
    #[strum(serialize = "length_mm")]
    Length,
}

/// The options of [`optimize`].
#[derive(Debug, Clone, PartialEq)]
pub struct OptimizeRequest {
    /// Whole layers and turns.
    pub wound: bool,
    /// Whether the neighbours' cores are there too, where the design couples them: force and
    /// settling are those of the coil nearest to the array's centre.
    pub neighbours: bool,
    /// Dimensions that keep the design's value.
    pub fixed: Vec<Dimension>,
    /// Local searches for every wire.
    pub starts: usize,
    /// Where their sequence of starts begins.
    pub seed: u64,
    /// Boxes of coils that a certificate may take; 0 for none.
    pub cells: usize,
    /// Whether valley and alternatives are computed.
    pub around: bool,
    /// Whether coils around the best one are computed, for a drawing.
    pub landscape: bool,
    /// Allowed error of the best coil's evaluation.
    pub tolerance: Option<f64>,
}

impl Default for OptimizeRequest {
    fn default() -> Self {
        let Settings {
            starts,
            seed,
            cells,
            ..
        } = Settings::default();
        Self {
            wound: false,
            neighbours: false,
            fixed: Vec::new(),
            starts,
            seed,
            cells,
            around: true,
            landscape: false,
            tolerance: None,
        }
    }
}

/// The best coil within the limits of a design, evaluated as `evaluate` does.
///
/// # Errors
/// A design that cannot be optimised; a best coil that cannot be computed; interruption.
pub fn optimize(
    document: &Document<'_>,
    inputs: Vec<Input>,
    request: &OptimizeRequest,
    progress: &dyn Progress,
) -> Result<Optimization, RunError> {
    let (has_iron, alone) = (document.design.has_iron(), document.design.without_iron());
    let document = &Document {
        design: &alone,
        ..*document
    };
    let design = document.design;
    let fixed = fixed(design, &request.fixed)?;
    // Before the search, which takes long: a design whose own coil is at fault is found at once.
    let given = design
        .coil
        .map(|_| design_document::rated(design, request.tolerance));
    let mut task =
        task::of_design(design, fixed).map_err(|refused| RunError::Input(refused.to_string()))?;
    // Equation 11's own coil has any bore; one that is to be wound has that of a bobbin.
    task.bobbin = request.wound;
    let (outcome, landscape) = search(design, &task, request, progress)?;
    let mut result = Optimization {
        schema_version: SCHEMA_VERSION,
        fluxform_version: FLUXFORM_VERSION,
        design: design.name.clone(),
        inputs,
        status: outcome.status.ending(),
        no_coil: no_coil::why(&outcome, request.wound),
        wound: request.wound,
        fixed: sensitivities(
            &fixed,
            outcome.continuous.as_ref().or(outcome.best.as_ref()),
        ),
        coil: None,
        objective: None,
        limits: BTreeMap::new(),
        limits_left_out: Vec::new(),
        bounds: BTreeMap::new(),
        certificate: outcome.certificate,
        evaluations: outcome.evaluations,
        starts: outcome.starts,
        seed: request.seed,
        valley: outcome.valley,
        wires: outcome.wires,
        continuous_force_n: outcome.continuous_force_n,
        continuous_wire_diameter_m: (outcome.continuous.as_ref())
            .map(|coil| coil.strand.diameter_m),
        bobbin_bore_m: bobbin_bore_m(&task, outcome.best.as_ref(), &outcome.alternatives),
        alternatives: Vec::new(),
        given: None,
        accuracy: BTreeMap::new(),
        accuracy_reached: true,
        design_text: None,
        picture: None,
        warnings: Vec::new(),
    };
    if let Some(best) = &outcome.best {
        // The optimiser's numbers are left behind here: the coil is written as a design and
        // evaluated as any other, so no number differs from what `evaluate` says of the file.
        let (written, rated) = design_document::write(document, best, &task, request.tolerance)?;
        result.alternatives = outcome.alternatives;
        result.take(best, rated);
        if surroundings(design, request.neighbours) == Surroundings::Neighbours {
            result.among_neighbours(&written.design, best, request.tolerance)?;
        }
        result.leave_out(&design.limits);
        result.picture = landscape.map(|around| picture::picture(&around, best, &written.design));
        result.design_text = Some(written.text);
    }
    result.take_given(given, design);
    result.warn_of_pull();
    if has_iron {
        let alone = "one coil with its core alone is optimised: [plate] and [[iron]] stay in the design, but do not \
                     count; `optimize --for SHAPE` searches arrays with them";
        result.warnings.push(alone.to_owned());
    }
    Ok(result)
}

impl Optimization {
    /// The best coil as it was evaluated.
    fn take(&mut self, best: &BestCoil, rated: Rated) {
        self.take_limits(best, &rated.limits);
        let force_n = rated.target.current_force_n();
        // The bound is the optimiser's; what evaluate adds is rounding.
        let bound_n = self.certificate.upper_bound_n;
        let bound_n = bound_n.map(|bound| bound.max(force_n.abs()));
        self.certificate.upper_bound_n = bound_n;
        self.certificate.gap = bound_n.map(|bound| (bound / force_n.abs() - 1.0).max(0.0));
        let sign = if force_n < 0.0 { -1.0 } else { 1.0 };
        for other in &mut self.alternatives {
            other.force_n *= sign;
        }
        self.coil = Some(BestCoilSummary {
            size: rated.coil.size,
            turns: rated.coil.turns,
            whole: best.whole,
            wire_diameter_m: best.strand.diameter_m,
            conductor_diameter_m: best.strand.conductor_diameter_m,
            circuit: rated.coil.circuit,
            core_peak_field_t: rated.core.as_ref().map(|core| core.peak_field_t),
        });
        let target = &rated.target;
        self.objective = Some(Objective {
            force_n,
            current_a: target.current_a,
            current_set_by: best.regime,
            gradient_t_per_m_per_a: target.gradient_t_per_m_per_a,
            height_m: target.height_m,
            alone_force_n: None,
            passive_force_n: target.passive_force_n,
        });
        self.accuracy_reached = rated.accuracy_missed.is_empty();
        self.accuracy = rated.accuracy;
        self.agreement(best.force_n, force_n, "evaluate's");
        self.warnings = rated.warnings;
    }

    /// The pull of the unpowered core does not take part in the search of one coil.
    fn warn_of_pull(&mut self) {
        let Some(objective) = &self.objective else {
            return;
        };
        let Some(pull_n) = objective.passive_force_n.filter(|&pull_n| pull_n != 0.0) else {
            return;
        };
        let whole_n = objective.force_n + pull_n;
        self.warnings.push(format!(
            "the force of the current is optimised, not the pull of the unpowered core, {}; with it {} is left: another coil \
             may leave more (`evaluate` counts both, `optimize --for SHAPE` searches with both)",
            force(pull_n),
            force(whole_n)
        ));
    }

    /// Names those of `limits` on more than the coil that the best one misses, or that follow from shapes.
    fn leave_out(&mut self, limits: &Limits) {
        let of_more = LIMITS.iter().filter(|row| row.quantity.is_none());
        for row in of_more.filter(|row| (row.of)(limits).is_some()) {
            let key = row.design_key;
            match self.limits.get(row.key) {
                Some(used) if used.met => continue,
                Some(_) => self.warnings.push(format!(
                    "{key} is missed: the search of one coil leaves it out; set a tighter limit of the coil, or search the \
                     whole array with `optimize --for SHAPE`"
                )),
                None => self.warnings.push(format!(
                    "{key} is not checked: it depends on shapes; `optimize --for SHAPE` keeps it"
                )),
            }
            self.limits_left_out.push(key);
        }
    }

    /// The limits that hold for the certificate, in words.
    fn within(&self) -> String {
        match self.limits_left_out.as_slice() {
            [] => "within the limits".to_owned(),
            keys => format!("within the limits other than {}", keys.join(" and ")),
        }
    }

    /// The keys of limits that the best coil misses.
    fn missed(&self) -> Vec<&'static str> {
        let missed = self.limits.values().filter(|used| !used.met);
        missed.map(|used| used.name.limit().design_key).collect()
    }

    /// The design's limits as `evaluate` checks them and what else bounds the coil, with what each
    /// costs.
    fn take_limits(&mut self, best: &BestCoil, checks: &BTreeMap<&'static str, LimitCheck>) {
        let inequality = |used: &&LimitUse| !used.name.is_equality();
        for (key, check) in checks {
            let Some(row) = by_key(key).filter(|row| row.name != LimitName::WindingFill) else {
                continue;
            };
            let known = best.limit(row.name).filter(inequality);
            let LimitCheck { value, limit, met } = *check;
            let used = LimitUse {
                name: row.name,
                value,
                limit,
                met,
                active: known.is_some_and(|used| used.active),
                // A dimension that is given cannot move to its limit.
                sensitivity_n_per_unit: known
                    .filter(|_| !self.fixed.contains_key(key))
                    .map_or(0.0, |used| used.sensitivity_n_per_unit),
            };
            self.limits.insert(key, used);
        }
        self.bounds = best
            .limits
            .iter()
            .filter(inequality)
            .filter(|used| !self.limits.contains_key(used.name.key()))
            .map(|used| (used.name.key(), *used))
            .collect();
    }

    /// States how far the optimiser's force is from that of a better computation; returns it.
    fn agreement(&mut self, optimiser_n: f64, force_n: f64, whose: &str) -> f64 {
        let estimate = (optimiser_n / force_n.abs() - 1.0).abs();
        self.accuracy.insert(
            "optimiser",
            StageAccuracy {
                estimate,
                relative_to: "the force".to_owned(),
                method: format!("the optimiser's force against {whose} at the best coil"),
            },
        );
        estimate
    }

    /// Force and settling among the neighbours' cores, which `evaluate` leaves out, by a coupled
    /// solution of the coil that was found.
    fn among_neighbours(
        &mut self,
        design: &Design,
        best: &BestCoil,
        tolerance: Option<f64>,
    ) -> Result<(), RunError> {
        let scene = Scene::with_tolerance(design, tolerance)?;
        let Some(neighbours) = Neighbours::new(&design.array.positions_m) else {
            return Ok(());
        };
        let coil = neighbours.drive();
        let [x_m, y_m] = design.array.positions_m[coil];
        let height_m = design.target_height_m;
        let solved = steel::solve(&scene, scene.tolerances.field, height_m)?;
        let per_ampere = scene.forces_n_per_a(&solved, &[[x_m, y_m, height_m]], &Silent)?;
        let Some(objective) = &mut self.objective else {
            return Ok(());
        };
        // The gain is a correction of a built coil's map.
        let current_a = objective.current_a;
        let force_n = per_ampere[coil] / scene.coils[coil].gain * current_a;
        objective.alone_force_n = Some(objective.force_n);
        objective.force_n = force_n;
        let off = self.agreement(best.force_n, force_n, "a coupled solution");
        if off > NEIGHBOURS_AGREE || !solved.reached() {
            self.accuracy_reached = false;
            self.warnings.push(format!(
                "among the neighbours' cores the coupled solution gives {force_n:.6} N where the \
                 optimiser counted on {:.6} N: the best coil may be another",
                best.force_n
            ));
        }
        if let Some(used) = self.limits.get_mut(LimitName::Settling.key()) {
            let added_h = solved.steel().added_inductance_h(coil, coil);
            let circuit = Circuit {
                inductance_h: scene.circuit.inductance_h + added_h,
                ..scene.circuit
            };
            used.value = circuit.settling_under_s(&design.supply, current_a);
            used.met = used.value <= used.limit * (1.0 + NEIGHBOURS_AGREE);
        }
        Ok(())
    }

    /// The design's own coil, where it can be computed.
    fn take_given(&mut self, given: Option<Result<Rated, RunError>>, design: &Design) {
        match given {
            Some(Ok(rated)) => {
                self.given = Some(GivenCoil {
                    coil: rated.coil,
                    wire_diameter_m: design.wire.diameter_m,
                    force_n: rated.target.current_force_n(),
                    limits: rated.limits,
                });
            }
            Some(Err(error)) => self.warnings.push(format!(
                "the design's own coil cannot be computed and is left out of the comparison: \
                 {error}"
            )),
            None => {}
        }
    }
}

fn fixed(design: &Design, dimensions: &[Dimension]) -> Result<Fixed, RunError> {
    let mut fixed = Fixed::default();
    if dimensions.is_empty() {
        return Ok(fixed);
    }
    let coil = design.coil.ok_or_else(|| {
        RunError::Input(
            "--fix holds a dimension of the design's [coil], which the design has not".to_owned(),
        )
    })?;
    for dimension in dimensions {
        match dimension {
            Dimension::InnerDiameter => fixed.inner_diameter_m = Some(coil.inner_diameter_m),
            Dimension::OuterDiameter => fixed.outer_diameter_m = Some(coil.outer_diameter_m),
            Dimension::Length => fixed.length_m = Some(coil.length_m),
        }
    }
    Ok(fixed)
}

/// The coil's surroundings: the neighbours' cores where they are requested, are coupled and
/// are there.
fn surroundings(design: &Design, neighbours: bool) -> Surroundings {
    if neighbours && coupled(design) {
        Surroundings::Neighbours
    } else {
        Surroundings::Alone
    }
}

fn search(
    design: &Design,
    task: &Task,
    request: &OptimizeRequest,
    progress: &dyn Progress,
) -> Result<(Outcome, Option<CoilLandscape>), RunError> {
    let model = model::coil_model(
        design,
        request.tolerance,
        surroundings(design, request.neighbours),
    )?;
    let model = model.as_ref();
    let settings = Settings {
        starts: request.starts,
        seed: request.seed,
        cells: request.cells,
        initial: design.coil.as_ref().map(Window::of_coil),
        valley: request.around,
    };
    let mut outcome = if request.wound {
        optimise_wound(model, task, &settings, progress)?
    } else {
        optimise(model, task, &settings, progress)?
    };
    let best = outcome.best.as_ref();
    let around = best.filter(|_| request.around && !request.wound);
    let alternatives = around.map(|best| alternatives(model, task, best, progress));
    let drawn = best.filter(|_| request.landscape);
    let landscape = drawn.map(|best| landscape(model, task, best, progress));
    if let Some(alternatives) = alternatives {
        outcome.alternatives = alternatives?;
    }
    Ok((outcome, landscape.transpose()?))
}

/// The least bore of a bobbin, m, where a coil in the result is limited by it.
fn bobbin_bore_m(task: &Task, best: Option<&BestCoil>, others: &[Alternative]) -> Option<f64> {
    let limits = task
        .limits
        .inner_diameter_min_m
        .or(task.fixed.inner_diameter_m);
    let windable = |other: &Alternative| other.better.contains(&Advantage::Windable);
    let best = best.filter(|_| limits.is_none() && (task.bobbin || others.iter().any(windable)))?;
    Some(bobbin_bore_m_of(best.strand.diameter_m))
}

/// Dimensions that were given, with the force that a metre more of each would add to `best`.
fn sensitivities(fixed: &Fixed, best: Option<&BestCoil>) -> BTreeMap<&'static str, FixedDimension> {
    let dimensions = [
        (LimitName::FixedInner, fixed.inner_diameter_m),
        (LimitName::FixedOuter, fixed.outer_diameter_m),
        (LimitName::FixedLength, fixed.length_m),
    ];
    let given = dimensions.into_iter().filter_map(|(name, value)| {
        let used = best.and_then(|best| best.limit(name));
        let dimension = FixedDimension {
            value: value?,
            sensitivity_n_per_unit: used.map(|used| used.sensitivity_n_per_unit),
        };
        Some((name.key(), dimension))
    });
    given.collect()
}
