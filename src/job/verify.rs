//! `verify`: a bundle's checksums and layout, and its numbers by an independent route.
//!
//! The maps and forces were made by telescoped end-face integrals with shared distances and
//! tables; here every sampled value is the loops' derivative integrated over the section,
//! directly at the point. The optimality of the currents is judged by the duality gap, which
//! does not trust the solver.

mod worst;

use std::path::Path;

use rayon::prelude::*;
use serde::Serialize;

use super::air_sample::spread;
use super::calibrate::{CURVE_FILE, DESIGN_FILE, PASSIVE_STAGE};
use super::passive::{self, PASSIVE_TOLERANCE};
use super::passive_map::PassiveMap;
use super::scene::Scene;
use super::steel::{Solved, Steel};
use super::{JobError, KERNEL_ERROR, steel};
use crate::bundle::artefact::{Input, sha256_hex};
use crate::bundle::load::{Bundle, BundleError};
use crate::bundle::plain::read_plain;
use crate::design::{Design, Need, Steel as Described};
use crate::field::magnet::MagnetRule;
use crate::field::steel::sources::Parts;
use crate::lambda::{self, Criterion, ForceProblem, Settings};
use crate::map::tabulate::Grid;
use crate::numerics::lagrange;
use crate::progress::Progress;

/// Map nodes sampled, and force-matrix entries sampled.
const SAMPLES: usize = 2000;
/// The fewest that are sampled.
const FEWEST: usize = 200;
/// Largest difference of a force constant that is solved for again, relative.
const LAMBDA_AGREES: f64 = 1e-8;
/// How much a force constant may move with the stated error of steel's forces.
const FORCES_MOVE: f64 = 10.0;
/// Inputs that are looked at again: a bundle names them, and is not trusted with any number or size.
const INPUTS_MAX: usize = 16;
/// The largest of them.
const INPUT_MAX_BYTES: u64 = 1 << 30;
/// Largest duality gap, relative to the mean square of the wanted force.
const GAP_ALLOWED: f64 = 1e-10;

/// What was checked.
#[derive(Debug, Clone, Serialize)]
pub struct VerifyReport {
    /// Name of the design.
    pub design: String,
    /// Name of the shape.
    pub shape: String,
    /// Every check.
    pub checks: Vec<Check>,
    /// What is worth knowing and no fault of the bundle.
    pub notes: Vec<String>,
    /// Whether all passed.
    pub passed: bool,
}

/// One check.
#[derive(Debug, Clone, Serialize)]
pub struct Check {
    /// What was checked.
    pub name: &'static str,
    /// What was measured.
    pub measured: f64,
    /// The most it may be.
    pub allowed: f64,
    /// Whether it passed.
    pub passed: bool,
    /// How.
    pub how: String,
}

/// Verifies the bundle at `path`.
///
/// # Errors
/// A bundle that is damaged or inconsistent; interruption. Numbers that do not agree are no
/// error: see [`VerifyReport::passed`].
pub fn run(path: &Path, progress: &dyn Progress) -> Result<VerifyReport, JobError> {
    progress.begin("verify", 5);
    let bundle = Bundle::open(path)?;
    progress.advance(1);
    let design = design(&bundle)?;
    let scene = Scene::new(&design)?;
    let mut checks = vec![
        check(
            "files",
            0.0,
            0.0,
            "sizes, digests and schema of every listed file".to_owned(),
        ),
        scene_agrees(&bundle, &scene),
    ];
    let route = Route::new(&scene, &bundle)?;
    checks.push(map_nodes(&bundle, &route)?);
    checks.push(between_nodes(&bundle, &route)?);
    progress.advance(1);
    progress.check()?;
    checks.extend(force_constant(&bundle, &route, progress)?);
    progress.advance(1);
    progress.check()?;
    checks.extend(passive_force(&bundle, &scene)?);
    progress.advance(1);
    let notes = changed_inputs(&bundle);
    progress.end();
    Ok(VerifyReport {
        design: bundle.manifest.design,
        shape: bundle.manifest.shape,
        passed: checks.iter().all(|check| check.passed),
        checks,
        notes,
    })
}

fn check(name: &'static str, measured: f64, allowed: f64, how: String) -> Check {
    // A measurement that is not a number fails, and stays out of the report.
    let passed = measured <= allowed;
    let measured = if measured.is_finite() {
        measured
    } else {
        f64::MAX
    };
    Check {
        name,
        measured,
        allowed,
        passed,
        how,
    }
}

/// An error relative to a size; nothing is no error of nothing.
fn ratio(error: f64, size: f64) -> f64 {
    if error == 0.0 { 0.0 } else { error / size }
}

/// The design kept in the bundle, its magnetisation curve the copy kept beside it; their digests
/// were checked with the others'.
fn design(bundle: &Bundle) -> Result<Design, JobError> {
    let path = bundle.folder.join(DESIGN_FILE);
    let lists = |name: &str| bundle.manifest.files.iter().any(|file| file.path == name);
    if !lists(DESIGN_FILE) {
        let message = "is not listed in manifest.json: nothing tells what to verify against; \
                       calibrate again"
            .to_owned();
        return Err(BundleError::Content { path, message }.into());
    }
    let (mut design, _) = Design::read(&path, Need::CALIBRATE)
        .map_err(|invalid| JobError::Input(invalid.to_string()))?;
    if let Some(core) = &mut design.core
        && let Described::Curve(curve) = &mut core.steel
    {
        if !lists(CURVE_FILE) {
            let message = format!("has a core.bh_curve, but the bundle keeps no {CURVE_FILE}");
            return Err(BundleError::Content { path, message }.into());
        }
        *curve = bundle.folder.join(CURVE_FILE);
    }
    Ok(design)
}

fn difference(a: &[f64], b: &[f64]) -> f64 {
    if a.len() != b.len() {
        return f64::INFINITY;
    }
    a.iter()
        .zip(b)
        .map(|(a, b)| {
            if a == b {
                0.0
            } else {
                (a - b).abs() / a.abs().max(b.abs())
            }
        })
        .fold(0.0, f64::max)
}

/// Positions, gains, limits and moment against the design.
fn scene_agrees(bundle: &Bundle, scene: &Scene) -> Check {
    let manifest = &bundle.manifest;
    let ours = scene.array_geometry();
    let limits = scene.current_limits();
    let worst = [
        difference(
            manifest.array.positions_m.as_flattened(),
            ours.positions_m.as_flattened(),
        ),
        difference(&manifest.array.gain, &ours.gain),
        difference(&manifest.limits.current_max_a, &limits.current_max_a),
        difference(&manifest.limits.current_min_a, &limits.current_min_a),
        difference(
            manifest.limits.total_current_max_a.as_slice(),
            limits.total_current_max_a.as_slice(),
        ),
        difference(&manifest.magnet.moment_a_m2, &scene.moment_a_m2),
        difference(&manifest.resistance_ohm, &scene.resistances_ohm()),
    ]
    .into_iter()
    .fold(0.0, f64::max);
    let how = "positions, gains, limits, resistance and moment against design.toml";
    check("scene", worst, 1e-14, how.to_owned())
}

/// Fields by another route than the bundle's: the winding's derivative integrated over its
/// section, the steel solved anew and finer, the magnet by a finer rule.
struct Route<'a> {
    scene: &'a Scene<'a>,
    solved: Solved,
    rule: MagnetRule,
}

/// How much finer than the bundle's tolerance steel and magnet are computed again.
const FINER: f64 = 0.3;

impl<'a> Route<'a> {
    fn new(scene: &'a Scene<'a>, bundle: &Bundle) -> Result<Self, JobError> {
        let stated = |stage: &str| {
            let stage = bundle.manifest.accuracy.get(stage);
            stage.map_or(KERNEL_ERROR, |stage| stage.estimate)
        };
        let lowest_m = bundle.map.z_m.first().copied().unwrap_or(0.0);
        let tolerance = FINER * stated("map").min(stated("forces")).max(KERNEL_ERROR);
        Ok(Self {
            scene,
            solved: steel::solve(scene, Some(tolerance), KERNEL_ERROR, lowest_m)?,
            rule: scene.magnet_rule(lowest_m, tolerance)?,
        })
    }

    /// Places sampled: fewer where the magnet is made of many dipoles, each of which costs as much
    /// as a place.
    fn samples(&self) -> usize {
        (SAMPLES / self.rule.nodes().len().max(1)).clamp(FEWEST, SAMPLES)
    }

    /// dB_x/dz, dB_y/dz, dB_z/dz of a coil at a point, the mean that the magnet feels, gains
    /// applied; for every (coil, point).
    fn gradients(&self, wanted: &[(usize, [f64; 3])]) -> Result<Vec<[f64; 3]>, JobError> {
        let centres: Vec<[f64; 3]> = wanted.iter().map(|(_, point)| *point).collect();
        let moment = self.scene.moment_a_m2;
        let square: f64 = moment.iter().map(|m| m * m).sum();
        let mut out = vec![[0.0; 3]; wanted.len()];
        let sources = self
            .solved
            .sources(self.scene, &centres, self.rule.reach_m())?;
        for node in self.rule.nodes() {
            let share: f64 = node
                .moment_a_m2
                .iter()
                .zip(moment)
                .map(|(a, b)| a * b)
                .sum::<f64>()
                / square;
            let places: Vec<[f64; 3]> = centres
                .iter()
                .map(|p| std::array::from_fn(|i| p[i] + node.offset_m[i]))
                .collect();
            let steel = match &sources {
                Some(sources) => {
                    let parts = Parts::Gradient;
                    self.solved
                        .steel_fields(self.scene, sources, &places, parts)
                }
                None => Vec::new(),
            };
            out.par_iter_mut().enumerate().for_each(|(row, sums)| {
                let (coil, place) = (&self.scene.coils[wanted[row].0], places[row]);
                let (dx, dy) = (place[0] - coil.axis_m[0], place[1] - coil.axis_m[1]);
                let (zz, rz_over_r) = of_winding(self.scene, dx.hypot(dy), place[2]);
                let part = |component: usize| {
                    let block = wanted[row].0 * Parts::Gradient.count() + component;
                    steel
                        .get(block * places.len() + row)
                        .copied()
                        .unwrap_or(0.0)
                };
                let factor = coil.gain * share;
                sums[0] += factor * (rz_over_r * dx + part(2));
                sums[1] += factor * (rz_over_r * dy + part(3));
                sums[2] += factor * (zz + part(4));
            });
        }
        Ok(out)
    }
}

/// dB_z/dz and (dB_r/dz)/r of a winding at a point, integrated over the section. Close to the end
/// face, where that integral is nearly singular, the exact kernel serves; on an edge nothing agrees.
fn of_winding(scene: &Scene, r_m: f64, z_m: f64) -> (f64, f64) {
    const CLOSE: f64 = 0.01;
    if z_m < CLOSE * scene.winding.outer_radius_m {
        return scene
            .winding
            .field(r_m, z_m)
            .map_or((f64::INFINITY, f64::INFINITY), |field| {
                (field.dbz_dz, field.dbr_dz_over_r)
            });
    }
    scene.winding.gradient_by_section(r_m, z_m)
}

/// Largest |dB_z/dz| at a height: on the axis or anywhere of the map's plane.
fn largest_in_plane(bundle: &Bundle, level: usize) -> f64 {
    let map = &bundle.map;
    let plane = map.x_m.len() * map.y_m.len();
    (0..map.coil.len())
        .flat_map(|coil| {
            let start = (coil * map.z_m.len() + level) * plane;
            &map.gz_t_per_m_per_a[start..start + plane]
        })
        .fold(0.0, |most: f64, g| most.max(g.abs()))
}

fn map_nodes(bundle: &Bundle, route: &Route) -> Result<Check, JobError> {
    let map = &bundle.map;
    let [coils, nz, ny, nx] = map.shape();
    let sizes: Vec<f64> = (0..nz)
        .map(|level| largest_in_plane(bundle, level))
        .collect();
    let places = spread(coils * nz * ny * nx, route.samples());
    let wanted: Vec<(usize, [f64; 3])> = places
        .iter()
        .map(|index| {
            let (x, y, z) = (index % nx, index / nx % ny, index / (nx * ny) % nz);
            let coil = map.coil[index / (nx * ny * nz)] as usize;
            (coil, [map.x_m[x], map.y_m[y], map.z_m[z]])
        })
        .collect();
    let exact = route.gradients(&wanted)?;
    let worst = places
        .iter()
        .zip(&exact)
        .map(|(index, exact)| {
            let error = (map.gz_t_per_m_per_a[*index] - exact[2]).abs();
            ratio(error, sizes[index / (nx * ny) % nz])
        })
        .fold(0.0, f64::max);
    let allowed = bundle
        .manifest
        .accuracy
        .get("map")
        .map_or(0.0, |stage| stage.estimate);
    let how = format!("{} nodes by an independent route", places.len());
    Ok(check("map nodes", worst, allowed.max(KERNEL_ERROR), how))
}

fn between_nodes(bundle: &Bundle, route: &Route) -> Result<Check, JobError> {
    let map = &bundle.map;
    let [coils, nz, ny, nx] = map.shape();
    let cells = [nx, ny, nz].map(|n| n.saturating_sub(1).max(1));
    let nodes = nx * ny * nz;
    let at = |nodes: &[f64], cell: usize, t: f64| match nodes.get(cell + 1) {
        Some(next) => nodes[cell] + t * (next - nodes[cell]),
        None => nodes[cell],
    };
    // (layer, coil's place in the map, point)
    let places: Vec<(usize, usize, [f64; 3])> =
        spread(coils * cells[0] * cells[1] * cells[2], route.samples())
            .into_iter()
            .map(|index| {
                let (i, rest) = (index % cells[0], index / cells[0]);
                let (j, rest) = (rest % cells[1], rest / cells[1]);
                let (k, place) = (rest % cells[2], rest / cells[2]);
                // Places inside the cells, different from cell to cell.
                let t = |salt: usize| ((index * 7 + salt * 13) % 29) as f64 / 29.0;
                let point = [
                    at(&map.x_m, i, t(1)),
                    at(&map.y_m, j, t(2)),
                    at(&map.z_m, k, t(3)),
                ];
                (k, place, point)
            })
            .collect();
    let wanted: Vec<(usize, [f64; 3])> = places
        .iter()
        .map(|(_, place, point)| (map.coil[*place] as usize, *point))
        .collect();
    let exact = route.gradients(&wanted)?;
    let worst = places
        .iter()
        .zip(&exact)
        .map(|((k, place, point), exact)| {
            let Some(cell) = lagrange::locate([&map.x_m, &map.y_m, &map.z_m], *point) else {
                return f64::INFINITY;
            };
            let value = cell.value(&map.gz_t_per_m_per_a[place * nodes..(place + 1) * nodes]);
            // The lower of the two planes around the point has the larger values.
            ratio((value - exact[2]).abs(), largest_in_plane(bundle, *k))
        })
        .fold(0.0, f64::max);
    let allowed = bundle.manifest.map.interpolation.largest_error;
    let how = format!(
        "{} places between nodes, interpolated as the loaders do",
        places.len()
    );
    Ok(check(
        "map between nodes",
        worst,
        allowed.max(KERNEL_ERROR),
        how,
    ))
}

/// The force constant, the currents and their errors from forces computed anew.
fn force_constant(
    bundle: &Bundle,
    route: &Route,
    progress: &dyn Progress,
) -> Result<Vec<Check>, JobError> {
    let scene = route.scene;
    let positions: Vec<[f64; 3]> = bundle
        .points
        .iter()
        .map(|p| [p.x_m, p.y_m, p.height_m])
        .collect();
    let stated = bundle.manifest.accuracy.get("forces");
    let lowest_m = bundle.map.z_m.first().copied().unwrap_or(0.0);
    // Forces that differ by their stated error move force constants and errors by a few times it.
    let slack = match route.solved.steel {
        Steel::None => 0.0,
        Steel::Alone(_) | Steel::Coupled(_) => {
            FORCES_MOVE * stated.map_or(0.0, |stage| stage.estimate)
        }
    };
    let solved = match &route.solved.steel {
        Steel::None => steel::solve(scene, None, scene.force_tolerance(), lowest_m)?,
        Steel::Alone(_) | Steel::Coupled(_) => route.solved.clone(),
    };
    let forces = scene.forces_n_per_a(&solved, &positions, progress)?;
    let coils = scene.coils.len();
    let mut checks = vec![sampled_forces(bundle, route, &positions, &forces)?];

    let heights: Vec<f64> = bundle.points.iter().map(|p| p.height_m).collect();
    let stored = &bundle.lambda;
    let offset_n = offset_n(scene, &positions)?;
    let slack = slack + passive_slack(bundle, offset_n.as_deref(), &heights);
    let agrees = slack.max(LAMBDA_AGREES);
    let resistance_ohm = scene.resistances_ohm();
    let problem = ForceProblem {
        forces_n_per_a: &forces,
        height_m: &heights,
        offset_n: offset_n.as_deref(),
        weights: None,
        lower_a: &scene.lower_a,
        upper_a: &scene.upper_a,
        total_max_a: scene.design.supply.total_current_max_a,
        resistance_ohm: &resistance_ohm,
    };
    let criterion = match stored.criterion.as_str() {
        "linear" => Criterion::Linear,
        "saturation" => Criterion::Saturation,
        "maxmin" => Criterion::Maxmin,
        _ => Criterion::Jnd,
    };
    let settings = Settings {
        criterion,
        jnd_weight: stored.jnd,
        at_n_per_m: stored.lambda_n_per_m,
    };
    let again = lambda::solve(&problem, &settings)?;
    let constants = [
        (stored.lambda_linear_n_per_m, again.lambda_linear_n_per_m),
        (stored.lambda_jnd_n_per_m, again.lambda_jnd_n_per_m),
        (
            stored.lambda_saturation_n_per_m,
            again.lambda_saturation_n_per_m,
        ),
        (stored.lambda_maxmin_n_per_m, again.lambda_maxmin_n_per_m),
        (stored.lambda_floor_n_per_m, again.lambda_floor_n_per_m),
        (
            stored.lambda_n_per_m,
            again.chosen.as_ref().map(|c| c.lambda_n_per_m),
        ),
    ];
    let worst = constants
        .iter()
        .map(|(told, found)| difference(told.as_slice(), found.as_slice()))
        .fold(0.0, f64::max);
    let how = "all force constants solved for again";
    checks.push(check("lambda", worst, agrees, how.to_owned()));

    if let Some(told) = &stored.worst_point {
        let lambda = stored.lambda_n_per_m;
        checks.extend(worst::checks(&problem, &settings, told, lambda, agrees)?);
    }
    let (Some(lambda), Some(currents)) = (stored.lambda_n_per_m, &stored.currents_a) else {
        return Ok(checks);
    };
    let residual: Vec<f64> = forces
        .chunks_exact(coils)
        .enumerate()
        .map(|(point, row)| {
            let pull = offset_n.as_ref().map_or(0.0, |offset| offset[point]);
            let pushed: f64 = row.iter().zip(currents).map(|(g, i)| g * i).sum();
            lambda * heights[point] - pull - pushed
        })
        .collect();
    let n = heights.len() as f64;
    let wanted = lambda * lambda * heights.iter().map(|h| h * h).sum::<f64>() / n;
    let mean_square = residual.iter().map(|e| e * e).sum::<f64>() / n;
    let rms = stored
        .rms_error_n
        .map_or(f64::INFINITY, |told| (told - mean_square.sqrt()).abs());
    let how = "the mean square error summed over all points";
    checks.push(check(
        "rms error",
        ratio(rms, wanted.sqrt()),
        agrees,
        how.to_owned(),
    ));
    let worst = residual.iter().fold(0.0_f64, |most, e| most.max(e.abs()));
    let worst = stored
        .worst_error_n
        .map_or(f64::INFINITY, |told| (told - worst).abs());
    let how = "the largest error over all points";
    checks.push(check(
        "worst error",
        ratio(worst, wanted.sqrt()),
        agrees,
        how.to_owned(),
    ));
    if criterion == Criterion::Maxmin {
        // These currents are for the weakest point, not for the mean square.
        checks.push(worst::weakest_point(&residual, wanted.sqrt(), agrees));
        return Ok(checks);
    }
    let gap = ratio(duality_gap(&problem, &residual, currents), wanted);
    let how = "proof of optimality: no currents within the limits are better by more";
    checks.push(check(
        "duality gap",
        gap,
        slack.max(GAP_ALLOWED),
        how.to_owned(),
    ));
    Ok(checks)
}

/// The unpowered steel's pull at the points, finer than the bundle's; `None` where the design does
/// not ask for it.
fn offset_n(scene: &Scene, positions: &[[f64; 3]]) -> Result<Option<Vec<f64>>, JobError> {
    if !scene.design.magnet.passive_force {
        return Ok(None);
    }
    let pull = passive::pull_to(scene, positions, false, FINER * PASSIVE_TOLERANCE)?;
    Ok(pull.map(|pull| pull.forces_z_n(positions)))
}

/// How much the pull's stated error may move force constants and errors, relative.
fn passive_slack(bundle: &Bundle, offset_n: Option<&[f64]>, heights: &[f64]) -> f64 {
    let Some(offset_n) = offset_n else { return 0.0 };
    let stated = bundle.manifest.accuracy.get("passive_force");
    let estimate = stated.map_or(0.0, |stage| stage.estimate);
    let rms = |values: &[f64]| values.iter().map(|v| v * v).sum::<f64>().sqrt();
    let told = [
        bundle.lambda.lambda_n_per_m,
        bundle.lambda.lambda_linear_n_per_m,
    ];
    let least = told
        .into_iter()
        .flatten()
        .filter(|l| *l > 0.0)
        .fold(f64::INFINITY, f64::min);
    FORCES_MOVE * estimate * ratio(rms(offset_n), least * rms(heights)).min(1.0)
}

/// Places at which the pull is computed by another route: on nodes, and as many between them.
const PULL_SAMPLES: usize = 40;

/// The map of the unpowered steel's pull: every node against a finer map, some of them and places
/// between them against another route.
fn passive_force(bundle: &Bundle, scene: &Scene) -> Result<Vec<Check>, JobError> {
    const NODES: &str = "passive force nodes";
    let map = &bundle.map;
    let wanted = scene.design.magnet.passive_force && scene.core.is_some();
    let (Some(values), Some(told)) = (&map.passive_force_n, &bundle.manifest.map.passive_force)
    else {
        let how = "the design has passive_force, the bundle holds none: make it anew".to_owned();
        return Ok(wanted
            .then(|| check(NODES, f64::MAX, 0.0, how))
            .into_iter()
            .collect());
    };
    if !wanted {
        let how = "the bundle holds a passive force, the design has none".to_owned();
        return Ok(vec![check(NODES, f64::MAX, 0.0, how)]);
    }
    let stated = bundle.manifest.accuracy.get(PASSIVE_STAGE);
    let stated = stated.map_or(0.0, |stage| stage.estimate);
    let tolerance = FINER * PASSIVE_TOLERANCE;
    let grid = Grid {
        x_m: map.x_m.to_vec(),
        y_m: map.y_m.to_vec(),
        z_m: map.z_m.to_vec(),
    };
    let Some(finer) = PassiveMap::new(scene, &grid, tolerance)? else {
        return Ok(Vec::new());
    };
    let [_, nz, ny, nx] = map.shape();
    let sizes: Vec<f64> = finer
        .force_z_n
        .chunks_exact(nx * ny)
        .map(|plane| plane.iter().fold(0.0_f64, |most, f| most.max(f.abs())))
        .collect();
    let worst = values
        .iter()
        .zip(&finer.force_z_n)
        .enumerate()
        .map(|(i, (told, found))| ratio((told - found).abs(), sizes[i / (nx * ny)]))
        .fold(0.0, f64::max);
    let allowed = stated + finer.accuracy.estimate;
    let mut checks = vec![check(
        NODES,
        worst,
        allowed,
        "every node against a finer map of the pull".to_owned(),
    )];

    // The level below a place, and the place; the first half on nodes.
    let cells = [nx, ny, nz].map(|n| n.saturating_sub(1).max(1));
    let places: Vec<(usize, [f64; 3])> = spread(nx * ny * nz, PULL_SAMPLES)
        .into_iter()
        .map(|i| (i / (nx * ny), [i % nx, i / nx % ny, i / (nx * ny)], 0.0))
        .chain(
            spread(cells[0] * cells[1] * cells[2], PULL_SAMPLES)
                .into_iter()
                .map(|i| {
                    let k = i / (cells[0] * cells[1]);
                    (k, [i % cells[0], i / cells[0] % cells[1], k], 0.43)
                }),
        )
        .map(|(level, cell, t)| {
            let at = |nodes: &[f64], i: usize| match nodes.get(i + 1) {
                Some(next) => nodes[i] + t * (next - nodes[i]),
                None => nodes[i],
            };
            let [x, y, z] = cell;
            (
                level,
                [at(&grid.x_m, x), at(&grid.y_m, y), at(&grid.z_m, z)],
            )
        })
        .collect();
    let points: Vec<[f64; 3]> = places.iter().map(|(_, at)| *at).collect();
    let Some(sure) = passive::direct_z_n(scene, &points, tolerance)? else {
        return Ok(checks);
    };
    let errors: Vec<f64> = places
        .iter()
        .zip(&sure)
        .map(|((level, at), sure)| {
            let found = bundle.passive_force_n(*at).unwrap_or(f64::INFINITY);
            ratio((found - sure).abs(), sizes[*level])
        })
        .collect();
    let (on, between) = errors.split_at(PULL_SAMPLES.min(nx * ny * nz));
    let worst = |errors: &[f64]| errors.iter().copied().fold(0.0, f64::max);
    let how = format!("{} nodes by the field that the steel sends back", on.len());
    checks.push(check("passive force", worst(on), stated + tolerance, how));
    checks.push(check(
        "passive force between nodes",
        worst(between),
        told.interpolation.largest_error + stated + tolerance,
        format!(
            "{} places between nodes, interpolated as the loaders do",
            between.len()
        ),
    ));
    Ok(checks)
}

fn sampled_forces(
    bundle: &Bundle,
    route: &Route,
    positions: &[[f64; 3]],
    forces: &[f64],
) -> Result<Check, JobError> {
    let coils = route.scene.coils.len();
    let largest = forces.iter().fold(0.0_f64, |most, f| most.max(f.abs()));
    let moment = route.scene.moment_a_m2;
    let places = spread(forces.len(), route.samples());
    let wanted: Vec<(usize, [f64; 3])> = places
        .iter()
        .map(|index| (index % coils, positions[index / coils]))
        .collect();
    let exact = route.gradients(&wanted)?;
    let worst = places
        .iter()
        .zip(&exact)
        .map(|(index, gradient)| {
            let exact: f64 = moment.iter().zip(gradient).map(|(m, g)| m * g).sum();
            (forces[*index] - exact).abs()
        })
        .fold(0.0, f64::max);
    let how = format!(
        "{} entries of the force matrix by an independent route",
        places.len()
    );
    // The estimate is relative to |grad B| at each height; the lowest points have the largest.
    let stated = bundle.manifest.accuracy.get("forces");
    let allowed = stated
        .map_or(0.0, |stage| stage.estimate)
        .max(10.0 * KERNEL_ERROR);
    Ok(check("forces", ratio(worst, largest), allowed, how))
}

/// 2 (max over the feasible z of s'z - s'x), s = G'r/n: a fractional knapsack (physics of the
/// bound: the error is convex, so no feasible currents lie below its tangent).
fn duality_gap(problem: &ForceProblem, residual: &[f64], currents: &[f64]) -> f64 {
    let coils = currents.len();
    let n = residual.len() as f64;
    let mut slope = vec![0.0; coils];
    for (row, r) in problem.forces_n_per_a.chunks_exact(coils).zip(residual) {
        for (s, g) in slope.iter_mut().zip(row) {
            *s += g * r / n;
        }
    }
    // Start every coil at its better end, then give back the cheapest ones until the sum fits.
    let mut z: Vec<f64> = slope
        .iter()
        .enumerate()
        .map(|(i, s)| {
            if *s > 0.0 {
                problem.upper_a[i]
            } else {
                problem.lower_a[i]
            }
        })
        .collect();
    if let Some(total) = problem.total_max_a {
        let mut excess = z.iter().sum::<f64>() - total;
        let mut order: Vec<usize> = (0..coils).collect();
        order.sort_by(|a, b| slope[*a].total_cmp(&slope[*b]));
        for i in order {
            let back = excess.min(z[i] - problem.lower_a[i]).max(0.0);
            z[i] -= back;
            excess -= back;
        }
    }
    let gain: f64 = slope
        .iter()
        .zip(z.iter().zip(currents))
        .map(|(s, (z, x))| s * (z - x))
        .sum();
    (2.0 * gain).max(0.0)
}

/// Input files that are still at their paths and are not what they were.
fn changed_inputs(bundle: &Bundle) -> Vec<String> {
    let changed = |input: &&Input| {
        read_plain(Path::new(&input.path), INPUT_MAX_BYTES)
            .is_ok_and(|bytes| sha256_hex(&bytes) != input.sha256)
    };
    bundle
        .manifest
        .inputs
        .iter()
        .take(INPUTS_MAX)
        .filter(changed)
        .map(|input| format!("{} has changed since the bundle was made", input.path))
        .collect()
}
