//! The summary of a replay beside its table.

use std::collections::BTreeMap;

use serde::Serialize;

use super::Opened;
use super::felt::FeltSummary;
use super::synthesize::{Synthesis, made_with};
use crate::accuracy::StageAccuracy;
use crate::bundle::artefact::{FLUXFORM_VERSION, FileEntry, Input, Options, SCHEMA_VERSION};
use crate::bundle::force_map::ForceMap;
use crate::bundle::load::Bundle;
use crate::bundle::replay::{Answer, FingerRows, ReplayRows};
use crate::bundle::trajectory::Trajectory;
use crate::coil::circuit::farthest_from_zero;
use crate::coil::drive::Drive;
use crate::commands::map::PASSIVE_STAGE;
use crate::force_direction::ForceDirection;
use crate::scene::steel::{LINEAR_CORES, SMALLER_CURRENTS};
use crate::units::FORCE_JND;

/// The stage of the forces' errors.
const FORCE: &str = "force";

/// A map whose largest error is below this resolves the field: nodes beside a position show the error there. Coarser
/// ones may miss what lies between their nodes.
const RESOLVED: f64 = 0.5;

/// Where a trajectory is from.
#[derive(Debug, Clone, PartialEq)]
pub struct TrajectorySource {
    /// The file as given, or the synthesis in words.
    pub source: String,
    /// The file's entry among the inputs.
    pub input: Option<Input>,
    /// The synthesis, where the trajectory is not from a file.
    pub synthesis: Option<Synthesis>,
}

/// The JSON result of a replay.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ReplaySummary {
    /// Layout, `major.minor.patch`.
    pub schema_version: &'static str,
    /// Program that wrote it.
    pub fluxform_version: &'static str,
    /// Name of the design.
    pub design: String,
    /// Name of the shape.
    pub shape: String,
    /// The bundle's manifest and the trajectory.
    pub inputs: Vec<Input>,
    /// The options of the run.
    pub made_with: Options,
    /// The bundle's force constant, N/m.
    pub lambda_n_per_m: f64,
    /// The trajectory.
    pub trajectory: TrajectorySummary,
    /// Forces with position feedback (Case I) and with fixed currents (Case II).
    pub force: ForceSummary,
    /// Currents that flow.
    pub currents: CurrentSummary,
    /// Heat in the coils.
    pub power: PowerSummary,
    /// A second finger; absent with one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub two_fingers: Option<TwoFingers>,
    /// Part of the time during which the limits allow only the nearest force, of two fingers on either.
    pub saturated_time_fraction: f64,
    /// Part of the time outside the map, of two fingers with either.
    pub outside_time_fraction: f64,
    /// How fast the currents follow; null where they are taken to follow at once.
    pub dynamics: Option<DynamicsSummary>,
    /// Each stage's estimated error.
    pub accuracy: BTreeMap<&'static str, StageAccuracy>,
    /// Warnings for the user.
    pub warnings: Vec<String>,
    /// The table beside it, as written.
    pub files: Vec<FileEntry>,
}

/// A trajectory.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TrajectorySummary {
    /// The file as given, or the synthesis in words.
    pub source: String,
    /// How many positions.
    pub positions: usize,
    /// From the first to the last, s.
    pub duration_s: f64,
    /// Median time between two, s.
    pub median_step_s: f64,
}

/// A second finger on the same array.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TwoFingers {
    /// Part of the time during which both get their force.
    pub both_given_time_fraction: f64,
    /// The largest force of one magnet on the other, as dipoles, N.
    pub magnets_force_n: f64,
    /// Forces on the second one.
    pub second: ForceSummary,
}

/// Forces along a trajectory.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ForceSummary {
    /// The largest force requested, N.
    pub wanted_max_n: f64,
    /// With position feedback.
    pub feedback: ErrorSummary,
    /// With the bundle's fixed currents.
    #[serde(rename = "static")]
    pub fixed: ErrorSummary,
    /// All three components with feedback; absent where the upward one alone is requested.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub vector: Option<VectorErrors>,
    /// Under the uncertainties that the bundle was made with; absent where currents are not chosen for them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub felt: Option<FeltSummary>,
}

/// Differences from the requested force vector, over the time inside the map.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct VectorErrors {
    /// Where the force points.
    pub direction: ForceDirection,
    /// Length of the difference, root mean square, N.
    pub rms_error_n: f64,
    /// The longest, N.
    pub worst_error_n: f64,
    /// Angle between the given force and the requested one where one is requested, median, degrees.
    pub direction_median_deg: f64,
    /// 95 % of the angles are no larger, degrees.
    pub direction_95_deg: f64,
}

/// Differences from the requested force, over the time inside the map.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ErrorSummary {
    /// Root mean square, N.
    pub rms_error_n: f64,
    /// The same over the requested force's root mean square; null where none is requested.
    pub relative_rms_error: Option<f64>,
    /// Largest size, N.
    pub worst_error_n: f64,
    /// Where and when; null where no position is inside the map.
    pub worst_at: Option<TimedPlace>,
}

/// A place at a time.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct TimedPlace {
    /// s.
    pub t_s: f64,
    /// m.
    pub x_m: f64,
    /// m.
    pub y_m: f64,
    /// m.
    pub z_m: f64,
}

/// Currents along a trajectory.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CurrentSummary {
    /// Largest size in every coil, A.
    pub max_a: Vec<f64>,
    /// Root mean square over time in every coil, A.
    pub rms_a: Vec<f64>,
    /// Sum over the coils where it is farthest from zero, with its sign, A.
    pub max_sum_a: f64,
}

/// Heat along a trajectory.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PowerSummary {
    /// Mean over time, W.
    pub mean_w: f64,
    /// Largest, W.
    pub max_w: f64,
    /// With the bundle's fixed currents, W.
    pub static_w: f64,
}

/// The coils' circuit.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DynamicsSummary {
    /// The fastest pattern of currents, s.
    pub time_constant_min_s: f64,
    /// The slowest, s.
    pub time_constant_max_s: f64,
    /// The bound of the coils' voltages, V; null without one.
    pub voltage_v: Option<f64>,
    /// Bandwidth of the current loop, Hz; absent where drivers set voltages.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bandwidth_hz: Option<f64>,
}

impl DynamicsSummary {
    pub(super) fn of(drive: &Drive, bundle: &Bundle, bandwidth_hz: Option<f64>) -> Self {
        let [shortest, longest] = drive.time_constants_s().unwrap_or_default();
        let rendering = bundle.map.runtime.rendering.as_ref();
        Self {
            time_constant_min_s: shortest,
            time_constant_max_s: longest,
            voltage_v: rendering.and_then(|rendering| rendering.voltage_v),
            bandwidth_hz,
        }
    }
}

/// What is measured along a trajectory.
pub(super) struct Followed {
    /// The table: a row a position, at the end of its time.
    pub(super) rows: ReplayRows,
    /// With currents that follow their command the same at times within those of the positions, but for the currents;
    /// else the rows are all there is.
    pub(super) within: Option<ReplayRows>,
    /// How long each of these counts, s; alike where all positions are of one time.
    pub(super) counts_s: Vec<f64>,
    pub(super) currents: CurrentSums,
}

/// Currents over the times that count.
pub(super) struct CurrentSums {
    resistance_ohm: Vec<f64>,
    max_a: Vec<f64>,
    square_a2s: Vec<f64>,
    max_sum_a: f64,
    heat_ws: f64,
    max_w: f64,
    time_s: f64,
}

impl CurrentSums {
    pub(super) fn new(resistance_ohm: &[f64]) -> Self {
        let none = vec![0.0; resistance_ohm.len()];
        Self {
            resistance_ohm: resistance_ohm.to_vec(),
            max_a: none.clone(),
            square_a2s: none,
            max_sum_a: 0.0,
            heat_ws: 0.0,
            max_w: 0.0,
            time_s: 0.0,
        }
    }

    /// Currents that flow for `counts_s`.
    pub(super) fn add(&mut self, currents_a: &[f64], counts_s: f64) {
        let (mut sum_a, mut heat_w) = (0.0, 0.0);
        for (coil, current) in currents_a.iter().enumerate() {
            let square = current * current;
            self.max_a[coil] = self.max_a[coil].max(current.abs());
            self.square_a2s[coil] += counts_s * square;
            sum_a += current;
            heat_w += self.resistance_ohm[coil] * square;
        }
        self.max_sum_a = farthest_from_zero([self.max_sum_a, sum_a]);
        self.heat_ws += counts_s * heat_w;
        self.max_w = self.max_w.max(heat_w);
        self.time_s += counts_s;
    }

    fn summary(&self) -> CurrentSummary {
        let squares = self.square_a2s.iter();
        CurrentSummary {
            max_a: self.max_a.clone(),
            rms_a: squares.map(|sum| (sum / self.time_s).sqrt()).collect(),
            max_sum_a: self.max_sum_a,
        }
    }
}

impl Followed {
    /// The rows that errors, currents and heat are taken of.
    pub(super) fn measured(&self) -> &ReplayRows {
        self.within.as_ref().unwrap_or(&self.rows)
    }
}

/// Error bounds, gathered along a trajectory.
#[derive(Debug, Clone)]
pub(super) struct Bounds {
    /// Of the force per ampere at the nodes, relative to the largest at the height.
    relative: f64,
    /// The largest between them, along x, y and z, relative to the same.
    between: [f64; 3],
    /// What it differs by at smaller currents.
    smaller_currents: f64,
    /// The currents that the forces per ampere hold at, at most, A.
    most_a: f64,
    /// Of the unpowered steel's pull at the nodes, N.
    passive_at_nodes_n: f64,
    /// The largest between them, relative to `passive_largest_n`.
    passive_between: f64,
    /// The largest pull on the lowest plane of nodes, N.
    passive_largest_n: f64,
    /// The largest of the force, N.
    force_n: f64,
    /// The largest difference of two fingers' magnets from dipoles in what they push each other by, N.
    pub(super) off_dipoles_n: f64,
    /// The largest of the allocation's certificates.
    pub(super) certificate: f64,
}

impl Bounds {
    pub(super) fn of(bundle: &Bundle) -> Self {
        let manifest = &bundle.manifest;
        let stage = |name: &str| manifest.accuracy.get(name).map_or(0.0, |of| of.estimate);
        let runtime = &bundle.map.runtime;
        let limits_a = runtime.current_min_a.iter().chain(&runtime.current_max_a);
        let passive = manifest.map.passive_force.as_ref();
        let sides = manifest.map.sides.as_ref();
        Self {
            relative: stage("map") + stage(LINEAR_CORES),
            between: {
                let [x, y] = sides.map_or([0.0; 2], |sides| sides.largest_error);
                [x, y, manifest.map.interpolation.largest_error]
            },
            smaller_currents: stage(SMALLER_CURRENTS),
            most_a: limits_a.fold(0.0, |most, limit| most.max(limit.abs())),
            passive_at_nodes_n: stage(PASSIVE_STAGE) * passive.map_or(0.0, |p| p.largest_n),
            passive_between: passive.map_or(0.0, |p| p.interpolation.largest_error),
            passive_largest_n: passive.map_or(0.0, |p| p.largest_n),
            force_n: 0.0,
            off_dipoles_n: 0.0,
            certificate: 0.0,
        }
    }

    /// A position of a finger with the currents that flow; `off_dipoles_n` is how far the other finger's push is from that
    /// of dipoles.
    pub(super) fn add(
        &mut self,
        map: &ForceMap,
        position_m: [f64; 3],
        currents_a: &[f64],
        off_dipoles_n: [f64; 3],
    ) {
        let Some(local_n) = map.interpolation_error_n(position_m, currents_a) else {
            return;
        };
        let largest_n_per_a = map.largest_near_n_per_a(position_m[2]);
        let sizes_a = || currents_a.iter().map(|current| current.abs());
        let off_a = sizes_a().map(|size_a| {
            // Along the curve a smaller current gives no more force than a larger one, and nearly that one's close to it.
            let left_a = (self.most_a - size_a).max(0.0);
            self.relative * size_a + (self.smaller_currents * size_a).min(left_a)
        });
        let at_nodes_n = largest_n_per_a[2] * off_a.sum::<f64>() + self.passive_at_nodes_n;
        // The manifest's figure is the largest of the whole map, and adds up over the coils.
        let sum_a: f64 = sizes_a().sum();
        let [x, y, up] = [0, 1, 2].map(|axis| {
            let passive = if axis == 2 { self.passive_between } else { 0.0 };
            let stated_n = self.between[axis] * largest_n_per_a[axis] * sum_a
                + passive * self.passive_largest_n;
            if self.between[axis].max(passive) < RESOLVED {
                local_n[axis].min(stated_n)
            } else {
                stated_n
            }
        });
        let off_dipoles_n = match (map.has_vectors(), off_dipoles_n) {
            (true, [x, y, up]) => x.hypot(y).hypot(up),
            (false, [_, _, up]) => up.abs(),
        };
        let off_n = at_nodes_n + x.hypot(y).hypot(up) + off_dipoles_n;
        self.force_n = self.force_n.max(off_n);
        self.off_dipoles_n = self.off_dipoles_n.max(off_dipoles_n);
    }

    /// Currents chosen for uncertainties or for two fingers (`other`) are not those of eq. 8, whose conditions are
    /// looked at.
    fn stages(
        &self,
        bundle: &Bundle,
        dynamics: bool,
        other: bool,
    ) -> BTreeMap<&'static str, StageAccuracy> {
        let stage = |estimate, relative_to: &str, method: &str| StageAccuracy {
            estimate,
            relative_to: relative_to.to_owned(),
            method: method.to_owned(),
        };
        let mut stages = BTreeMap::from([
            (
                FORCE,
                stage(
                    self.force_n,
                    "absolute, N: the largest over the positions",
                    "the map's stated errors at its nodes, and what it leaves of the cores' B-H curve, times the largest \
                     force per ampere at the height and the sum of the currents' sizes; and between the nodes how far \
                     interpolation through others beside them is off at the position, or the map's largest stated \
                     error where that is smaller, or half of the force and more; and for magnets that are whole cylinders \
                     how far the push of two fingers is from that of dipoles",
                ),
            ),
            (
                "allocation",
                stage(
                    self.certificate,
                    "the sizes of the terms of every optimality condition",
                    "residuals of the optimality conditions at every position",
                ),
            ),
        ]);
        if other {
            stages.remove("allocation");
        }
        let inductances = bundle.manifest.accuracy.get("inductances");
        if let (true, Some(inductances)) = (dynamics, inductances) {
            stages.insert("inductances", inductances.clone());
        }
        stages
    }
}

impl ReplaySummary {
    pub(super) fn new(
        opened: &Opened,
        source: TrajectorySource,
        followed: &Followed,
        dynamics: Option<DynamicsSummary>,
        bounds: &Bounds,
        warnings: Vec<String>,
    ) -> Self {
        let bundle = &opened.bundle;
        let robust = opened.renderer.setting().is_some();
        let t_s = &followed.rows.t_s;
        let trajectory = Trajectory {
            t_s: t_s.clone(),
            ..Trajectory::default()
        };
        let (rows, times) = (followed.measured(), Times::new(&followed.counts_s));
        let direction = bundle.manifest.force.as_ref().map(|force| force.direction);
        let any = |answer: Answer| times.part(rows, |finger, row| finger.answer[row] == answer);
        let fixed = bundle.currents.iter().map(|row| row.current_a);
        let fixed = fixed.zip(&bundle.map.runtime.resistance_ohm);
        Self {
            schema_version: SCHEMA_VERSION,
            fluxform_version: FLUXFORM_VERSION,
            design: bundle.manifest.design.clone(),
            shape: bundle.manifest.shape.clone(),
            inputs: std::iter::once(opened.input.clone())
                .chain(source.input)
                .collect(),
            made_with: made_with(source.synthesis.as_ref(), dynamics.is_some(), robust),
            lambda_n_per_m: opened.renderer.lambda_n_per_m(),
            trajectory: TrajectorySummary {
                source: source.source,
                positions: t_s.len(),
                duration_s: t_s.last().zip(t_s.first()).map_or(0.0, |(b, a)| b - a),
                median_step_s: trajectory.median_step_s(),
            },
            force: ForceSummary::of(&rows.first, (&rows.t_s, &times), direction),
            two_fingers: rows.second.as_ref().map(|second| TwoFingers {
                both_given_time_fraction: 1.0
                    - times.part(rows, |finger, row| finger.answer[row] != Answer::Ok),
                magnets_force_n: 0.0,
                second: ForceSummary::of(second, (&rows.t_s, &times), direction),
            }),
            currents: followed.currents.summary(),
            power: PowerSummary {
                mean_w: followed.currents.heat_ws / followed.currents.time_s,
                max_w: followed.currents.max_w,
                static_w: fixed.map(|(i, ohm)| ohm * i * i).sum(),
            },
            saturated_time_fraction: any(Answer::Saturated),
            outside_time_fraction: any(Answer::Outside),
            accuracy: bounds.stages(bundle, dynamics.is_some(), robust || rows.second.is_some()),
            dynamics,
            warnings,
            files: Vec::new(),
        }
    }

    /// The forces on every finger, named where there are two.
    pub(super) fn fingers(&self) -> Vec<(Option<&'static str>, &ForceSummary)> {
        match &self.two_fingers {
            None => vec![(None, &self.force)],
            Some(two) => vec![
                (Some("first finger"), &self.force),
                (Some("second finger"), &two.second),
            ],
        }
    }

    /// Estimate of the forces' error, N.
    pub(super) fn force_error_n(&self) -> f64 {
        self.accuracy[FORCE].estimate
    }

    /// The largest force requested on any finger, N.
    pub(super) fn wanted_max_n(&self) -> f64 {
        let fingers = self.fingers().into_iter();
        fingers.fold(0.0, |most, (_, force)| most.max(force.wanted_max_n))
    }

    /// Warns where a finger notices the forces' error, of which `off_dipoles_n` is what cylinders push each other
    /// otherwise than dipoles.
    pub(super) fn warn_of_forces(&mut self, off_dipoles_n: f64) {
        let wanted_n = self.wanted_max_n();
        let noticed = |error_n: f64| wanted_n > 0.0 && error_n > FORCE_JND * wanted_n;
        let of_cylinders = noticed(off_dipoles_n).then(|| {
            format!(
                "the fingers' magnets push each other as dipoles here: as whole cylinders by up to {:.2} mN otherwise, \
                 which the stated error of the forces allows for",
                1e3 * off_dipoles_n
            )
        });
        let error_n = self.force_error_n();
        let of_map = noticed(error_n - off_dipoles_n).then(|| {
            format!(
                "the forces are known to {:.2} mN only, {:.0} % of the largest one requested: the errors stated here leave that \
                 out; take more nodes in [workspace] or a smaller --tolerance and calibrate again",
                1e3 * error_n,
                100.0 * error_n / wanted_n
            )
        });
        self.warnings.extend(of_cylinders.into_iter().chain(of_map));
    }
}

impl ForceSummary {
    /// Of one finger, where the force requested points in `direction`.
    fn of(
        rows: &FingerRows,
        (t_s, times): (&[f64], &Times),
        direction: Option<ForceDirection>,
    ) -> Self {
        let largest = |most: f64, value: &f64| most.max(value.abs());
        Self {
            wanted_max_n: rows.wanted_force_n.iter().fold(0.0, largest),
            feedback: errors(rows, (t_s, times), |row| rows.error_n(row)),
            fixed: errors(rows, (t_s, times), |row| rows.static_error_n(row)),
            vector: direction.and_then(|direction| vector_errors(rows, times, direction)),
            felt: None,
        }
    }
}

/// `None` where the upward force alone is requested.
fn vector_errors(
    rows: &FingerRows,
    times: &Times,
    direction: ForceDirection,
) -> Option<VectorErrors> {
    if rows.sideways_n.is_empty() {
        return None;
    }
    let mut angles_deg = Vec::new();
    let mut errors_n = Vec::new();
    for row in rows.inside() {
        let ([wx, wy], [fx, fy]) = (rows.wanted_sideways_n[row], rows.sideways_n[row]);
        errors_n.push((row, (wx - fx).hypot(wy - fy).hypot(rows.error_n(row))));
        if wx.hypot(wy).hypot(rows.wanted_force_n[row]) > 0.0 {
            angles_deg.push((row, rows.direction_error_deg(row)));
        }
    }
    angles_deg.sort_by(|(_, a), (_, b)| a.total_cmp(b));
    Some(VectorErrors {
        direction,
        rms_error_n: times.rms(&errors_n),
        worst_error_n: errors_n
            .iter()
            .fold(0.0, |worst, (_, error)| error.max(worst)),
        direction_median_deg: times.quantile(&angles_deg, 0.5),
        direction_95_deg: times.quantile(&angles_deg, 0.95),
    })
}

/// How long rows count.
struct Times {
    weights: Vec<f64>,
    total: f64,
}

impl Times {
    fn new(counts_s: &[f64]) -> Self {
        Self {
            total: counts_s.iter().sum(),
            weights: counts_s.to_vec(),
        }
    }

    fn mean(&self, values: impl Iterator<Item = f64>) -> f64 {
        let sum: f64 = values.zip(&self.weights).map(|(v, w)| v * w).sum();
        sum / self.total
    }

    /// How much each of some rows counts; where none of them does, each alike.
    fn among(&self, rows: impl Iterator<Item = usize>) -> Vec<f64> {
        let weights: Vec<f64> = rows.map(|row| self.weights[row]).collect();
        match weights.iter().all(|weight| *weight == 0.0) {
            true => vec![1.0; weights.len()],
            false => weights,
        }
    }

    /// Root mean square of the values of some rows; 0 of none.
    fn rms(&self, values: &[(usize, f64)]) -> f64 {
        let weights = self.among(values.iter().map(|(row, _)| *row));
        let squares = values.iter().zip(&weights).map(|((_, v), w)| w * v * v);
        (squares.sum::<f64>() / weights.iter().sum::<f64>().max(f64::MIN_POSITIVE)).sqrt()
    }

    /// The value of some rows, which ascend, that is exceeded for the rest of the time; 0 of none.
    fn quantile(&self, ascending: &[(usize, f64)], part: f64) -> f64 {
        let weights = self.among(ascending.iter().map(|(row, _)| *row));
        let mut left = part * weights.iter().sum::<f64>();
        for ((_, value), weight) in ascending.iter().zip(&weights) {
            left -= weight;
            if left < 0.0 {
                return *value;
            }
        }
        ascending.last().map_or(0.0, |(_, value)| *value)
    }

    /// The part during which that holds of any finger.
    fn part(&self, rows: &ReplayRows, holds: impl Fn(&FingerRows, usize) -> bool) -> f64 {
        let any = |row: usize| rows.fingers().any(|finger| holds(finger, row));
        self.mean((0..rows.len()).map(|row| f64::from(u8::from(any(row)))))
    }
}

/// Errors over the time inside the map.
fn errors(
    rows: &FingerRows,
    (t_s, times): (&[f64], &Times),
    error: impl Fn(usize) -> f64,
) -> ErrorSummary {
    let inside: Vec<usize> = rows.inside().collect();
    let rms = |value: &dyn Fn(usize) -> f64| {
        let values: Vec<(usize, f64)> = inside.iter().map(|&row| (row, value(row))).collect();
        times.rms(&values)
    };
    let (rms_error_n, wanted_n) = (rms(&error), rms(&|row| rows.wanted_force_n[row]));
    let worst = inside.iter().copied().reduce(|a, b| {
        if error(b).abs() > error(a).abs() {
            b
        } else {
            a
        }
    });
    ErrorSummary {
        rms_error_n,
        relative_rms_error: (wanted_n > 0.0).then(|| rms_error_n / wanted_n),
        worst_error_n: worst.map_or(0.0, |row| error(row).abs()),
        worst_at: worst.map(|row| {
            let [x_m, y_m, z_m] = rows.position_m[row];
            TimedPlace {
                t_s: t_s[row],
                x_m,
                y_m,
                z_m,
            }
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The largest signed sum of drivers that only reverse was 0 A.
    #[test]
    fn sums_below_zero_count_by_their_size() {
        let mut sums = CurrentSums::new(&[1.0, 2.0]);
        for currents_a in [[0.0, 0.0], [-2.0, -1.5], [0.5, -1.0]] {
            sums.add(&currents_a, 0.1);
        }
        let summary = sums.summary();
        assert_eq!((summary.max_sum_a, summary.max_a), (-3.5, vec![2.0, 1.5]));
    }
}
