//! `optimize`: the best coil within a design's limits (eq. 11).

pub(crate) mod command;
mod design_document;
mod model;
mod outcome_words;
pub mod page;
mod result;
mod text;

use std::collections::BTreeMap;

pub use design_document::Document;
pub use result::*;

use self::design_document::{Chosen, RatedFacts};
use crate::RunError;
use crate::accuracy::StageAccuracy;
use crate::bundle::artefact::{FLUXFORM_VERSION, Input, SCHEMA_VERSION};
use crate::coil::circuit::Circuit;
use crate::coil::optimum::alternatives::alternatives;
use crate::coil::optimum::neighbours::Neighbours;
use crate::coil::optimum::problem::{LimitName, Regime};
use crate::coil::optimum::task::Surroundings;
use crate::coil::optimum::{
    BestCoil, Certificate, Fixed, LimitUse, OptimumStatus, Settings, Window, near_optimal_bore,
    optimise, optimise_wound, task,
};
use crate::design::Design;
use crate::field::winding::KERNEL_ERROR;
use crate::progress::{Progress, Silent};
use crate::scene::Scene;
use crate::scene::steel::{self, Steel, coupled};

/// How well the optimiser's force among neighbours agrees with a coupled solution: what the
/// latter is solved to there.
const NEIGHBOURS_AGREE: f64 = 1e-3;

/// Most alternatives that are told.
const ALTERNATIVES_MAX: usize = 20;

/// A dimension that may be given.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Dimension {
    /// `coil.inner_diameter_mm`.
    InnerDiameter,
    /// `coil.outer_diameter_mm`.
    OuterDiameter,
    /// `coil.length_mm`.
    Length,
}

/// What is asked.
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
    /// Whether valley and alternatives are wanted.
    pub around: bool,
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
            tolerance: None,
        }
    }
}

/// What either search found.
struct Search {
    status: OptimumStatus,
    best: Option<BestCoil>,
    whole: Option<[u64; 2]>,
    /// The coil whose turns need not be whole.
    continuous: Option<BestCoil>,
    continuous_n: Option<f64>,
    certificate: Certificate,
    evaluations: usize,
    starts: usize,
    valley_m: Option<[f64; 2]>,
    wires: Vec<WireFacts>,
    alternatives: Vec<AlternativeFacts>,
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
    let design = document.design;
    let fixed = fixed(design, &request.fixed)?;
    let given = design
        .coil
        .map(|_| RatedFacts::of(design, request.tolerance));
    let search = search(design, fixed, request, progress)?;
    let mut result = Optimization {
        schema_version: SCHEMA_VERSION,
        fluxform_version: FLUXFORM_VERSION,
        design: design.name.clone(),
        inputs,
        status: outcome_words::status(&search.status),
        no_coil: outcome_words::no_coil(&search.status, request.wound),
        wound: request.wound,
        fixed: outcome_words::fixed(&fixed, search.continuous.as_ref()),
        coil: None,
        objective: None,
        limits: BTreeMap::new(),
        bounds: BTreeMap::new(),
        certificate: CertificateFacts {
            kind: search.certificate.kind,
            upper_bound_n: search.certificate.upper_bound_n,
            gap: search.certificate.gap,
            cells: search.certificate.cells,
        },
        evaluations: search.evaluations,
        starts: search.starts,
        seed: request.seed,
        valley: search.valley_m.map(|inner_diameter_m| ValleyFacts {
            force_share: near_optimal_bore::SHARE,
            inner_diameter_m,
        }),
        wires: search.wires.clone(),
        continuous_force_n: search.continuous_n.filter(|_| request.wound),
        alternatives: Vec::new(),
        given: None,
        accuracy: BTreeMap::new(),
        accuracy_reached: true,
        design_text: None,
        notes: Vec::new(),
    };
    if let Some(best) = &search.best {
        let chosen = Chosen {
            strand: best.strand,
            window: best.window,
            whole: search.whole,
            regime: best.regime,
            fixed,
        };
        let (written, rated) = design_document::write(document, &chosen, request.tolerance)?;
        result.take(&search, best, rated);
        if surroundings(design, request.neighbours) == Surroundings::Neighbours {
            result.among_neighbours(&written.design, best, request.tolerance)?;
        }
        result.design_text = Some(written.text);
        result.notes.extend(too_wide(&written.design));
    }
    result.take_given(design, given);
    Ok(result)
}

impl Optimization {
    /// The best coil as it was evaluated.
    fn take(&mut self, search: &Search, best: &BestCoil, rated: RatedFacts) {
        let sensitivity = |name: &str| {
            let source = search.continuous.as_ref().unwrap_or(best);
            let found = source.limits.iter().find(|l| l.name.key() == name);
            found.map_or(0.0, |used| used.sensitivity_n_per_unit)
        };
        let active = |name: &str| {
            let found = best.limits.iter().find(|l| l.name.key() == name);
            found.is_some_and(|used| used.active && !used.name.is_equality())
        };
        self.limits = rated
            .limits
            .iter()
            .filter(|(name, _)| **name != "winding_fill")
            .map(|(name, check)| {
                let held = self.fixed.contains_key(name);
                let facts = LimitFacts {
                    value: check.value,
                    limit: check.limit,
                    met: check.met,
                    active: active(name),
                    sensitivity_n_per_unit: if held { 0.0 } else { sensitivity(name) },
                };
                (*name, facts)
            })
            .collect();
        self.bounds = best
            .limits
            .iter()
            .filter(|used| !self.limits.contains_key(used.name.key()) && !used.name.is_equality())
            .map(|used| (used.name.key(), bound(used, sensitivity(used.name.key()))))
            .collect();
        let force_n = rated.force_n;
        let sign = if force_n < 0.0 { -1.0 } else { 1.0 };
        // The bound is the optimiser's; what evaluate adds is rounding.
        self.certificate.upper_bound_n = self
            .certificate
            .upper_bound_n
            .map(|bound| bound.max(force_n.abs()));
        self.certificate.gap = self
            .certificate
            .upper_bound_n
            .map(|bound| (bound / force_n.abs() - 1.0).max(0.0));
        self.alternatives = search
            .alternatives
            .iter()
            .cloned()
            .map(|mut other| {
                other.force_lost = 1.0 - other.force_n / best.force_n;
                other.force_n *= sign;
                other
            })
            .collect();
        self.coil = Some(BestFacts {
            size: rated.size,
            turns: rated.turns,
            layers: search.whole.map(|[layers, _]| layers),
            turns_per_layer: search.whole.map(|[_, turns]| turns),
            wire_diameter_m: best.strand.diameter_m,
            conductor_diameter_m: best.strand.conductor_diameter_m,
            circuit: rated.circuit,
            core_peak_field_t: rated.core_peak_field_t,
        });
        self.objective = Some(ObjectiveFacts {
            force_n,
            current_a: rated.current_a,
            current_set_by: match best.regime {
                Regime::Driver => "driver",
                Regime::Supply => "supply",
            },
            gradient_t_per_m_per_a: rated.gradient_t_per_m_per_a,
            height_m: 0.0,
            alone_force_n: None,
            passive_force_n: rated.passive_n,
        });
        self.accuracy = rated.accuracy;
        self.accuracy.insert(
            "optimiser",
            StageAccuracy {
                estimate: (best.force_n / force_n.abs() - 1.0).abs(),
                relative_to: "the force".to_owned(),
                method: "the optimiser's force against evaluate's at the best coil".to_owned(),
            },
        );
        self.accuracy_reached = rated.accuracy_reached;
        self.notes = rated.notes;
    }

    /// Force and settling among the neighbours' cores, which `evaluate` leaves out, by a coupled
    /// solution of the coil that was found.
    fn among_neighbours(
        &mut self,
        design: &Design,
        best: &BestCoil,
        tolerance: Option<f64>,
    ) -> Result<(), RunError> {
        let scene = Scene::new(design)?;
        let Some(neighbours) = Neighbours::new(&design.array.positions_m) else {
            return Ok(());
        };
        let coil = neighbours.drive();
        let [x_m, y_m] = design.array.positions_m[coil];
        let height_m = design.target_height_m;
        let solved = steel::solve(&scene, tolerance, KERNEL_ERROR, height_m)?;
        let per_ampere = scene.forces_n_per_a(&solved, &[[x_m, y_m, height_m]], &Silent)?;
        let Some(objective) = &mut self.objective else {
            return Ok(());
        };
        // The gain is a correction of a built coil's map.
        let force_n = per_ampere[coil] / scene.coils[coil].gain * objective.current_a;
        objective.alone_force_n = Some(objective.force_n);
        objective.force_n = force_n;
        let off = (best.force_n / force_n.abs() - 1.0).abs();
        self.accuracy.insert(
            "optimiser",
            StageAccuracy {
                estimate: off,
                relative_to: "the force".to_owned(),
                method: "the optimiser's force against a coupled solution at the best coil"
                    .to_owned(),
            },
        );
        if off > NEIGHBOURS_AGREE || !solved.reached() {
            self.accuracy_reached = false;
            self.notes.push(format!(
                "among the neighbours' cores the coupled solution gives {force_n:.6} N where the \
                 optimiser counted on {:.6} N: the best coil may be another",
                best.force_n
            ));
        }
        if let (Some(facts), Steel::Coupled(array)) = (
            self.limits.get_mut(LimitName::Settling.key()),
            &solved.steel,
        ) {
            let circuit = Circuit {
                inductance_h: scene.circuit.inductance_h + array.added_inductance_h[(coil, coil)],
                ..scene.circuit
            };
            facts.value = circuit.settling_s();
            facts.met = facts.value <= facts.limit * (1.0 + NEIGHBOURS_AGREE);
        }
        Ok(())
    }

    /// The design's own coil, where it can be computed.
    fn take_given(&mut self, design: &Design, given: Option<Result<RatedFacts, RunError>>) {
        if let Some(objective) = &mut self.objective {
            objective.height_m = design.target_height_m;
        }
        match given {
            Some(Ok(rated)) => {
                self.given = Some(GivenFacts {
                    size: rated.size,
                    turns: rated.turns,
                    circuit: rated.circuit,
                    force_n: rated.force_n,
                    limits: rated.limits,
                });
            }
            Some(Err(error)) => self.notes.push(format!(
                "the design's own coil cannot be computed and is left out of the comparison: \
                 {error}"
            )),
            None => {}
        }
    }
}

fn bound(used: &LimitUse, sensitivity_n_per_unit: f64) -> LimitFacts {
    let slack = 1e-9 * used.limit.abs();
    let met = if used.name.is_lower() {
        used.value >= used.limit - slack
    } else {
        used.value <= used.limit + slack
    };
    LimitFacts {
        value: used.value,
        limit: used.limit,
        met,
        active: used.active,
        sensitivity_n_per_unit,
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

/// What stands beside the coil: the neighbours' cores where they are asked for, are coupled and
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
    fixed: Fixed,
    request: &OptimizeRequest,
    progress: &dyn Progress,
) -> Result<Search, RunError> {
    let refused = |error: task::NoTask| RunError::Input(error.to_string());
    let task = task::of_design(design, fixed).map_err(refused)?;
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
    if request.wound {
        let found = optimise_wound(model, &task, &settings, progress)?;
        return Ok(outcome_words::wound(found));
    }
    let found = optimise(model, &task, &settings, progress)?;
    let around = match &found.best {
        Some(best) if request.around => alternatives(model, &task, best, progress)?,
        _ => Vec::new(),
    };
    Ok(outcome_words::continuous(found, &around))
}

/// A coil that is wider than the array's pitch fits nowhere.
fn too_wide(design: &Design) -> Option<String> {
    let coil = design.coil?;
    let places = &design.array.positions_m;
    let mut nearest = f64::INFINITY;
    for (i, a) in places.iter().enumerate() {
        for b in &places[..i] {
            nearest = nearest.min((a[0] - b[0]).hypot(a[1] - b[1]));
        }
    }
    (coil.outer_diameter_m > nearest * (1.0 + 1e-12)).then(|| {
        format!(
            "the best coil is {:.6} mm wide, but the array's coils stand {:.6} mm apart: set \
             limits.outer_diameter_max_mm, or the array wider",
            coil.outer_diameter_m * 1e3,
            nearest * 1e3
        )
    })
}
