//! `probe --compare`: a gaussmeter scan held against a design.
//!
//! The residuals of the design as it is; scales of the coils, a background and the sensor's
//! frame fitted all at once, with standard errors; and which single parameter would explain the
//! residuals. What the scan does not determine is stated and left open.

use std::collections::BTreeMap;

use super::{groups, solve_anywhere};
use crate::RunError;
use crate::accuracy::{StageAccuracy, missed};
use crate::bundle::artefact::{FLUXFORM_VERSION, Input, SCHEMA_VERSION};
use crate::bundle::scan::{
    CoilScale, FieldLeft, FitFile, GradientLeft, Left, Measured, Residuals, Scan, ScanFile,
    ScanPlace,
};
use crate::design::Design;
use crate::numerics::least_squares::CUTOFF;
use crate::progress::Progress;
use crate::scene::Scene;
use crate::scene::core_material::Material;
use crate::scene::steel::Solved;

pub(crate) mod command;
mod explain;
mod fit;
mod keys;
mod model;
mod noise;
mod picture;
pub(super) mod units;

pub use fit::Fitted;
use fit::Parameter;
use model::{Model, Pose};
use noise::{Noise, NoisyFit};

/// Measured numbers that must be there beyond those fitted, so that an error can be estimated.
const SPARE: usize = 3;

/// The request.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ScanRequest {
    /// Parameters that are fitted.
    pub fitted: Fitted,
    /// The sensor's noise, T, where known.
    pub noise_t: Option<f64>,
    /// The noise of measured gradients, T/m, where known.
    pub noise_t_per_m: Option<f64>,
    /// Tolerance of the computed field; `None` for the default.
    pub tolerance: Option<f64>,
}

/// The comparison.
#[derive(Debug, Clone)]
pub struct ScanReport {
    /// The JSON result.
    pub file: ScanFile,
    /// Values of the design, [row, quantity].
    pub predicted: Vec<f64>,
    /// Values of the fit, [row, quantity].
    pub fitted: Vec<f64>,
    /// Warnings for the user.
    pub warnings: Vec<String>,
    /// Whether the requested tolerance was reached.
    pub accuracy_reached: bool,
    /// Points that miss it.
    pub accuracy_missed: Vec<String>,
}

/// Residuals of the design as it is, and the weights of all measured numbers.
struct Weighted {
    predicted: Vec<f64>,
    /// Measured minus predicted, times the weight.
    values: Vec<f64>,
    weights: Vec<f64>,
}

impl Weighted {
    fn of(scan: &Scan, predicted: Vec<f64>, weights: Vec<f64>) -> Self {
        let pairs = scan.values.iter().zip(&predicted);
        let residuals = pairs.map(|(measured, predicted)| measured - predicted);
        let mut weighted = Self {
            values: residuals.collect(),
            predicted,
            weights,
        };
        let residuals = std::mem::take(&mut weighted.values);
        weighted.values = weighted.weighted(residuals);
        weighted
    }

    fn weighted(&self, mut values: Vec<f64>) -> Vec<f64> {
        let pairs = values.iter_mut().zip(&self.weights);
        pairs.for_each(|(value, weight)| *value *= weight);
        values
    }
}

/// Holds `scan`, read from the file `name`, against `design`.
///
/// # Errors
/// A scan too small for what is to be fitted, without current or in other units; a design that
/// cannot be computed; a point on a winding's edge or on the steel; interruption.
pub fn compare(
    design: &Design,
    scan: &Scan,
    name: &str,
    inputs: Vec<Input>,
    request: &ScanRequest,
    progress: &dyn Progress,
) -> Result<ScanReport, RunError> {
    let refused = |why: String| RunError::Scan(format!("{name}: {why}"));
    let scene = Scene::with_tolerance(design, request.tolerance)?;
    let parameters = fit::parameters(request.fitted, scan, scene.coils.len());
    large_enough(scan, &parameters).map_err(refused)?;
    noise::is_of_values(scan, request).map_err(refused)?;
    if let Some(hint) = units::coordinates(design, &scan.positions_m) {
        return Err(refused(hint));
    }
    // As `probe` does: a fit moves the places, and what `probe` printed must be found again to the last
    // digits.
    let groups = groups(&scene, &scan.positions_m)?;
    let solved = solve_anywhere(&scene, groups.values(), &scan.positions_m)?;
    let model = Model::new(&scene, &solved, scan);
    progress.begin("scan", 0);
    let places = model.places(Pose::default())?;
    let contributions = model.contributions(&places, Pose::default(), progress)?;
    let predicted = model.sum(&contributions, |_| 1.0);
    if let Some(hint) = units::magnitudes(scan, &predicted) {
        return Err(refused(hint));
    }
    let field_t = field_size_t(scan);
    let noisy = noise::fit(&model, scan, &parameters, request, field_t, progress)?;
    // Explanations are held against the noise that the fit settled at.
    let weighted = Weighted::of(scan, predicted, noisy.weights(scan));
    let relative_error = solved.point_error();
    let task = explain::Task {
        design,
        model: &model,
        scan,
        residuals: &weighted,
        tolerance: request.tolerance,
        noise_given: noisy.given(),
        relative_error,
        field_t,
        progress,
    };
    let (explanations, best_explanation) = explain::explain(&task)?;
    progress.end();

    let report = ResidualReport {
        scan,
        noisy: &noisy,
        model_errors: model_errors(scan, &weighted.predicted, relative_error),
    };
    let mut warnings: Vec<String> = curve_warning(&scene).into_iter().collect();
    warnings.extend(noisy.warning());
    warnings.extend(scale_warnings(&task, request, &parameters, &noisy)?);
    let file = ScanFile {
        schema_version: SCHEMA_VERSION.to_owned(),
        fluxform_version: FLUXFORM_VERSION.to_owned(),
        design: design.name.clone(),
        inputs,
        rows: scan.rows(),
        values: scan.values.len(),
        measured: scan.quantities.iter().map(|q| q.column()).collect(),
        residuals: Residuals {
            as_designed: report.left(&weighted.predicted),
            fitted: report.fitted(),
        },
        fit: fit_file(design, &parameters, &noisy, scan, &mut warnings),
        explanations,
        best_explanation,
        accuracy: accuracy(&solved, relative_error),
    };
    let predicted = weighted.predicted;
    Ok(ScanReport::new(
        file,
        [noisy.fit.fitted, predicted],
        warnings,
        solved.tolerance,
    ))
}

impl ScanReport {
    /// `file` and its warnings, with the values that were fitted and those of the design as it is.
    fn new(
        file: ScanFile,
        [fitted, predicted]: [Vec<f64>; 2],
        warnings: Vec<String>,
        tolerance: f64,
    ) -> Self {
        let accuracy_missed = missed(&file.accuracy, tolerance);
        Self {
            file,
            fitted,
            predicted,
            warnings,
            accuracy_reached: accuracy_missed.is_empty(),
            accuracy_missed,
        }
    }
}

/// Along a B-H curve the field per ampere depends on the current.
fn curve_warning(scene: &Scene) -> Option<String> {
    let core = scene.core.as_ref()?;
    matches!(core.material, Material::Curve(_)).then(|| {
        "the steel follows a B-H curve and was solved at the rated current: a scan at other \
         currents may differ by what saturation changes"
            .to_owned()
    })
}

fn lowest_m(scan: &Scan) -> f64 {
    let heights = scan.positions_m.iter().map(|p| p[2]);
    heights.fold(f64::INFINITY, f64::min)
}

fn large_enough(scan: &Scan, parameters: &[Parameter]) -> Result<(), String> {
    if scan.currents_a.iter().all(Vec::is_empty) {
        return Err(
            "the current is 0 in every row, so nothing of the coils was measured; scan with \
             current in them"
                .to_owned(),
        );
    }
    let needed = parameters.len() + SPARE;
    if scan.values.len() >= needed {
        return Ok(());
    }
    let names: Vec<String> = parameters.iter().map(|p| p.name()).collect();
    Err(format!(
        "{} measured values do not determine {} numbers with their errors ({}); expected at least \
         {needed}: measure at more points, or fit less with --fit",
        scan.values.len(),
        parameters.len(),
        names.join(", ")
    ))
}

/// Kinds of measured numbers, each with a noise of its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Field,
    Gradient,
}

impl Kind {
    const ALL: [Self; 2] = [Self::Field, Self::Gradient];

    fn of(quantity: &Measured) -> Self {
        match quantity {
            Measured::Field(_) => Self::Field,
            Measured::Gradient(..) => Self::Gradient,
        }
    }
}

/// The numbers of one kind, with their place.
fn of_kind<'a>(
    scan: &'a Scan,
    values: &'a [f64],
    kind: Kind,
) -> impl Iterator<Item = (usize, f64)> + 'a {
    let count = scan.quantities.len();
    let all = values.iter().copied().enumerate();
    all.filter(move |(at, _)| Kind::of(&scan.quantities[at % count]) == kind)
}

/// Root mean square of one kind; `None` where there is none.
fn rms(scan: &Scan, values: &[f64], kind: Kind) -> Option<f64> {
    let (count, sum) = of_kind(scan, values, kind)
        .fold((0_usize, 0.0), |(count, sum), (_, value)| {
            (count + 1, sum + value * value)
        });
    (count > 0).then(|| (sum / count as f64).sqrt())
}

/// Size of the measured field, or one like it where there is none; never 0.
fn field_size_t(scan: &Scan) -> f64 {
    let measured = rms(scan, &scan.values, Kind::Field);
    measured.unwrap_or(1e-3).max(1e-9)
}

fn accuracy(solved: &Solved, estimate: f64) -> BTreeMap<String, StageAccuracy> {
    let field = StageAccuracy {
        estimate,
        relative_to: "the largest field and gradient of the scan".to_owned(),
        method: solved.point_method(),
    };
    let all = [("field", field)].into_iter();
    all.chain(solved.curve_stages())
        .map(|(name, stage)| (name.to_owned(), stage))
        .collect()
}

/// Errors claimed of the computed field and gradient.
fn model_errors(scan: &Scan, predicted: &[f64], relative_error: f64) -> [f64; 2] {
    Kind::ALL.map(|kind| {
        let values = of_kind(scan, predicted, kind);
        relative_error * values.fold(0.0_f64, |most, (_, value)| most.max(value.abs()))
    })
}

/// States what is left of a measurement.
struct ResidualReport<'a> {
    scan: &'a Scan,
    noisy: &'a NoisyFit,
    model_errors: [f64; 2],
}

impl ResidualReport<'_> {
    /// Residuals of the measurement less `given`.
    fn left(&self, given: &[f64]) -> Left {
        let scan = self.scan;
        let left: Vec<f64> = scan.values.iter().zip(given).map(|(m, g)| m - g).collect();
        let of = |kind: Kind| {
            let noise = self.noisy.of(kind)?;
            let rms_left = rms(scan, &left, kind)?;
            let first = of_kind(scan, &left, kind).next()?;
            let (at, largest) = of_kind(scan, &left, kind).fold(first, |most, one| {
                if one.1.abs() > most.1.abs() {
                    one
                } else {
                    most
                }
            });
            let measured = rms(scan, &scan.values, kind)?;
            Some((rms_left, largest, self.place(at), measured, noise))
        };
        Left {
            field: of(Kind::Field).map(|(rms_t, largest_t, at, measured_rms_t, noise)| FieldLeft {
                rms_t,
                largest_t,
                at,
                measured_rms_t,
                model_error_t: self.model_errors[0],
                noise_t: noise.given,
                estimated_noise_t: self.noisy.estimated(noise),
                reduced_chi_square: None,
            }),
            gradient: of(Kind::Gradient).map(
                |(rms_t_per_m, largest_t_per_m, at, measured_rms_t_per_m, noise)| GradientLeft {
                    rms_t_per_m,
                    largest_t_per_m,
                    at,
                    measured_rms_t_per_m,
                    model_error_t_per_m: self.model_errors[1],
                    noise_t_per_m: noise.given,
                    estimated_noise_t_per_m: self.noisy.estimated(noise),
                    reduced_chi_square: None,
                },
            ),
        }
    }

    /// Residuals of the measurement less the fit, held against each given noise.
    fn fitted(&self) -> Left {
        let mut left = self.left(&self.noisy.fit.fitted);
        let ratio = |kind| self.noisy.of(kind).and_then(Noise::reduced_chi_square);
        if let Some(field) = &mut left.field {
            field.reduced_chi_square = ratio(Kind::Field);
        }
        if let Some(gradient) = &mut left.gradient {
            gradient.reduced_chi_square = ratio(Kind::Gradient);
        }
        left
    }

    fn place(&self, at: usize) -> ScanPlace {
        let count = self.scan.quantities.len();
        let [x_m, y_m, z_m] = self.scan.positions_m[at / count];
        ScanPlace {
            line: self.scan.lines[at / count],
            column: self.scan.quantities[at % count].column(),
            x_m,
            y_m,
            z_m,
        }
    }
}

fn fit_file(
    design: &Design,
    parameters: &[Parameter],
    noisy: &NoisyFit,
    scan: &Scan,
    warnings: &mut Vec<String>,
) -> FitFile {
    let fit = &noisy.fit;
    let found = |sought: Parameter| -> (Option<f64>, Option<f64>) {
        let place = parameters.iter().position(|p| *p == sought);
        let error = place.and_then(|k| noisy.error(k));
        let value = place.filter(|_| error.is_some()).map(|k| fit.values[k]);
        (value, error)
    };
    let three = |sought: fn(usize) -> Parameter, unit: f64| {
        let fitted = (0..3).any(|i| parameters.contains(&sought(i)));
        let both: [_; 3] = std::array::from_fn(|i| found(sought(i)));
        let values = both.map(|(value, _)| value.map(|v| v * unit));
        let errors = both.map(|(_, error)| error.map(|e| e * unit));
        (fitted.then_some(values), fitted.then_some(errors))
    };
    let (scales, mut gain_toml) = coil_scales(design, parameters, &found);
    if !fit.converged {
        // Numbers on the way somewhere are not for a design.
        gain_toml = None;
        warnings.push(
            "the fit did not settle: its numbers are those of the last step; fit less with --fit, \
             or correct the scan's coordinates first"
                .to_owned(),
        );
    }
    let (background_t, background_error_t) = three(Parameter::Background, 1.0);
    let (position_m, position_error_m) = three(Parameter::Shift, 1.0);
    let (rotation_deg, rotation_error_deg) = three(Parameter::Angle, 1f64.to_degrees());
    let alone = fit.linear.without_effect.iter().map(|k| vec![*k]);
    let sets = alone.chain(fit.linear.degenerate.iter().cloned());
    FitFile {
        scales,
        gain_toml,
        background_t,
        background_error_t,
        position_m,
        position_error_m,
        rotation_deg,
        rotation_error_deg,
        undetermined: sets
            .map(|set| set.into_iter().map(|k| parameters[k].name()).collect())
            .collect(),
        cutoff: CUTOFF,
        degrees_of_freedom: scan.values.len().saturating_sub(fit.linear.rank).max(1),
        reduced_chi_square: noisy.reduced_chi_square(),
        iterations: fit.iterations,
        converged: fit.converged,
    }
}

/// The fitted scales of the coils, and the gains that follow as a line of a design.
fn coil_scales(
    design: &Design,
    parameters: &[Parameter],
    found: &dyn Fn(Parameter) -> (Option<f64>, Option<f64>),
) -> (Vec<CoilScale>, Option<String>) {
    let mut scales = Vec::new();
    let mut gains = design.array.gain.clone();
    for parameter in parameters {
        let Parameter::Scale(coil) = *parameter else {
            continue;
        };
        let (scale, standard_error) = found(*parameter);
        let gain = scale.map(|scale| scale * design.array.gain[coil]);
        if let Some(gain) = gain {
            gains[coil] = gain;
        }
        scales.push(CoilScale {
            coil,
            scale,
            standard_error,
            gain,
        });
    }
    let any = scales.iter().any(|scale| scale.gain.is_some());
    let listed: Vec<String> = gains.iter().map(|gain| format!("{gain:.6}")).collect();
    let line = any.then(|| format!("gain = [{}]", listed.join(", ")));
    (scales, line)
}

/// Scales that betray a mistake of the set-up: those of the fit, or where it did not settle scales alone. These
/// always settle, and their signs may say why the rest did not.
fn scale_warnings(
    task: &explain::Task,
    request: &ScanRequest,
    parameters: &[Parameter],
    noisy: &NoisyFit,
) -> Result<Vec<String>, RunError> {
    if noisy.fit.converged {
        return Ok(warnings_of_scales(parameters, noisy));
    }
    let (scan, coils) = (task.scan, task.design.array.positions_m.len());
    let scales = fit::parameters(Fitted::SCALE, scan, coils);
    let (size_t, progress) = (task.field_t, task.progress);
    let alone = noise::fit(task.model, scan, &scales, request, size_t, progress)?;
    Ok(warnings_of_scales(&scales, &alone))
}

fn warnings_of_scales(parameters: &[Parameter], noisy: &NoisyFit) -> Vec<String> {
    let warning = |(k, parameter): (usize, &Parameter)| match *parameter {
        Parameter::Scale(coil) => scale_warning(coil, noisy.fit.values[k], noisy.error(k)?),
        _ => None,
    };
    parameters.iter().enumerate().filter_map(warning).collect()
}

fn scale_warning(coil: usize, scale: f64, error: f64) -> Option<String> {
    // No sensor measures a field of it that is less.
    const NOTHING: f64 = 1e-9;
    if scale.abs() <= (3.0 * error).max(NOTHING) {
        return Some(format!(
            "coil {coil}: the scan shows no field of it beyond three standard errors; is it \
             connected, and the number right?"
        ));
    }
    (scale < 0.0).then(|| {
        format!(
            "coil {coil}: the measured field has the opposite sign; its leads may be swapped, or \
             the sensor's axis may point down"
        )
    })
}
