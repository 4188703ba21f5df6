//! `probe`: field, gradient and force of every coil at given points.

pub(crate) mod command;
pub mod scan;

use crate::field::components::Components;
use crate::field::steel::clearance::Clearance;
use std::collections::BTreeMap;
use std::io::{self, Write};
use std::sync::Arc;

use rayon::prelude::*;

use crate::RunError;
use crate::accuracy::{StageAccuracy, missed, missed_of_force};
use crate::bundle::table::{
    FIELD_COLUMNS, FORCE_COLUMNS, GRADIENT_COLUMNS, SAMPLE_COLUMNS, write_samples,
};
use crate::design::Design;
use crate::field::frame::{CartesianField, to_cartesian};
use crate::field::magnet::{MagnetRule, Sources};
use crate::field::steel::CLOSEST;
use crate::field::steel::array_steel::SteelField;
use crate::progress::Progress;
use crate::scene::evaluation_sample::{Evaluation, sharper_forces};
use crate::scene::steel;
use crate::scene::steel::{Solved, clearance, clearance_of_m};
use crate::scene::tolerances::MAGNET_FINEST;
use crate::scene::{MAGNET_SHARE, Scene, magnet_rule};

/// Field and gradient per ampere, coil by coil within a point.
#[derive(Debug, Clone)]
pub struct ProbeTable {
    components: Components,
    points_m: Vec<[f64; 3]>,
    coils: usize,
    /// [point, coil]
    fields: Vec<CartesianField>,
    /// [point, coil]: force (N/A) and torque about the centre (N m/A) of the magnet; where requested.
    forces: Vec<[f64; 6]>,
    /// Estimated error relative to |grad B| at the point; with steel, to the largest at its height.
    pub relative_error: f64,
    /// How it is known.
    pub method: String,
    /// Whether it is relative to the largest at the height.
    pub relative_to_height: bool,
    /// With steel of any shape the estimated error of B at some of the points, relative to |B| there.
    pub iron_error: Option<f64>,
    /// What the field per ampere leaves of the cores' B-H curve, by the stages' names.
    pub of_curve: Vec<(&'static str, StageAccuracy)>,
    /// Of the forces, where requested.
    pub force: Option<StageAccuracy>,
    /// The stages that miss the tolerance.
    pub accuracy_missed: Vec<String>,
    /// Warnings for the user.
    pub warnings: Vec<String>,
}

/// The options of [`probe`].
#[derive(Debug, Clone, Copy)]
pub struct ProbeRequest {
    /// Components of the field.
    pub components: Components,
    /// Also force and torque on the design's magnet, its centre at the points.
    pub force: bool,
    /// Tolerance; `None` for the default.
    pub tolerance: Option<f64>,
}

impl Default for ProbeRequest {
    /// Field and gradient, to the default tolerance, without the force.
    fn default() -> Self {
        Self {
            components: Components::All,
            force: false,
            tolerance: None,
        }
    }
}

/// Points between two looks at the interruption flag.
const PORTION: usize = 256;

/// Field and gradient of every coil of `design` at `points_m`: in air to 1e-12 of |grad B| at the
/// point, with steel to the tolerance of the largest |grad B| at its height.
///
/// # Errors
/// A design that cannot be computed; a point that is not finite, on a winding's edge or on the steel; a
/// magnet that touches the array, where the force is requested; interruption.
pub fn probe(
    design: &Design,
    points_m: Vec<[f64; 3]>,
    request: ProbeRequest,
    progress: &dyn Progress,
) -> Result<ProbeTable, RunError> {
    finite(&points_m)?;
    let scene = Scene::with_tolerance(design, request.tolerance)?;
    let groups = groups(&scene, &points_m)?;
    let solved = solve_anywhere(&scene, groups.values(), &points_m)?;
    progress.begin("probe", points_m.len() as u64);
    let coils = scene.coils.len();
    let mut fields = vec![CartesianField::default(); points_m.len() * coils];
    let mut forces = vec![[0.0; 6]; if request.force { fields.len() } else { 0 }];
    let finest = MAGNET_SHARE * solved.tolerance.max(MAGNET_FINEST);
    let groups = match request.force {
        true => with_rules(&scene, groups, &points_m, finest)?,
        false => groups.into_values().map(|group| (group, None)).collect(),
    };
    for (group, rule) in &groups {
        let own: Vec<[f64; 3]> = group.rows.iter().map(|row| points_m[*row]).collect();
        let places = FieldAt::of_group(&scene, &solved, group, &points_m, rule.as_ref())?;
        let portions = own
            .par_chunks(PORTION)
            .zip(group.rows.par_chunks(PORTION))
            .map(|(points, rows)| {
                progress.check()?;
                let number = |place: usize| rows[place] + 1;
                let fields = places.numbered_fields(points, &number, &|_, _| true)?;
                let forces = rule.as_ref().map_or_else(
                    || Ok(Vec::new()),
                    |rule| places.forces(points, &number, rule),
                )?;
                progress.advance(points.len() as u64);
                Ok((rows, fields, forces))
            })
            .collect::<Result<Vec<_>, RunError>>()?;
        for (rows, of_rows, felt) in portions {
            for (place, row) in rows.iter().enumerate() {
                let from = place * coils..(place + 1) * coils;
                let to = row * coils..(row + 1) * coils;
                fields[to.clone()].clone_from_slice(&of_rows[from.clone()]);
                if request.force {
                    forces[to].copy_from_slice(&felt[from]);
                }
            }
        }
    }
    let iron_error = solved.iron_error(&points_m)?;
    progress.end();
    let mut accuracy_missed = missed([(&"field", &field_error(&solved))], solved.tolerance);
    let force = if request.force {
        let stage = force_error(&scene, &solved, &points_m, &forces, &groups)?;
        let of_force = missed_of_force([(&"force", &stage)], scene.tolerances.forces);
        accuracy_missed.extend(of_force);
        Some(stage)
    } else {
        None
    };
    Ok(ProbeTable {
        components: request.components,
        coils,
        fields,
        forces,
        points_m,
        relative_error: solved.point_error(),
        method: solved.point_method(),
        relative_to_height: solved.has_steel(),
        iron_error,
        of_curve: solved.curve_stages().collect(),
        force,
        warnings: solved.above_knee(&scene).into_iter().collect(),
        accuracy_missed,
    })
}

/// Refuses coordinates that are no numbers: no error could be stated of a field there.
fn finite(points_m: &[[f64; 3]]) -> Result<(), RunError> {
    let finite = |point: &[f64; 3]| point.iter().all(|x| x.is_finite());
    let Some(row) = points_m.iter().position(|point| !finite(point)) else {
        return Ok(());
    };
    let [x, y, z] = points_m[row];
    Err(RunError::Input(format!(
        "point {} ({x}, {y}, {z} m): expected finite coordinates",
        row + 1
    )))
}

/// The steel of `scene` for `groups` of `points_m`.
///
/// A value depends on its own point alone: neither the solution nor how it is evaluated may depend on where
/// the other points are. What is stated of them all may.
///
/// # Errors
/// As [`steel::solve`].
fn solve_anywhere<'a>(
    scene: &Scene,
    groups: impl Iterator<Item = &'a Group>,
    points_m: &[[f64; 3]],
) -> Result<Solved, RunError> {
    let solved = steel::solve(scene, scene.tolerances.field, f64::NEG_INFINITY)?;
    let clearances = groups.map(|group| {
        let own: Vec<[f64; 3]> = group.rows.iter().map(|row| points_m[*row]).collect();
        clearance(scene, &own, 0.0)
    });
    solved.for_groups(scene, &clearances.collect::<Result<Vec<_>, RunError>>()?)
}

/// The error of the field.
fn field_error(solved: &Solved) -> StageAccuracy {
    StageAccuracy {
        estimate: solved.point_error(),
        relative_to: if solved.has_steel() {
            "the largest |grad B| at the point's height"
        } else {
            "|grad B| at the point"
        }
        .to_owned(),
        method: String::new(),
    }
}

/// The error of the forces, [point, coil]: that of the steel, which grows over the magnet, and of evaluating them.
fn force_error(
    scene: &Scene,
    solved: &Solved,
    points_m: &[[f64; 3]],
    forces: &[[f64; 6]],
    groups: &[(Group, Option<MagnetRule>)],
) -> Result<StageAccuracy, RunError> {
    let (mut growth, mut evaluation) = (1.0_f64, 0.0_f64);
    for (group, rule) in groups {
        if let Some(rule) = rule {
            growth = growth.max(scene.magnet_growth(group.sources));
            let proven = solved.force_evaluation(rule.amplification(), rule.bound());
            evaluation = evaluation.max(proven);
        }
    }
    let proven = Evaluation {
        estimate: evaluation,
        method: "the field's error and the a-priori bound of the magnet's dipoles".to_owned(),
    };
    let given = |point: usize, coil: usize| {
        let [x, y, z, ..] = forces[point * scene.coils.len() + coil];
        [x, y, z]
    };
    let sampled = sharper_forces(scene, solved, points_m, given, proven)?;
    Ok(StageAccuracy {
        estimate: sampled.estimate + solved.steel_error * growth,
        relative_to: "the moment times the largest |grad B| at the point's height".to_owned(),
        method: sampled.method,
    })
}

/// Rows that are evaluated alike, whatever other rows there are.
struct Group {
    rows: Vec<usize>,
    /// Of every row's point.
    clearance: Clearance,
    /// Where windings and steel are, seen from the magnet.
    sources: Sources,
}

/// The points by powers of two of their distance from the nearest core and of the gap between
/// array and magnet; beside the array, where they are closer to a core than its radius, by heights of a radius.
fn groups(scene: &Scene, points_m: &[[f64; 3]]) -> Result<BTreeMap<[i32; 3], Group>, RunError> {
    let core = scene.core.as_ref();
    let top_m = scene.sources_top_m();
    let radius_m = core.map_or(scene.winding.inner_radius_m, |core| core.shape.radius_m);
    let unit_m = CLOSEST * radius_m;
    let depth_m = scene.magnet_depth_m();
    let step = |length_m: f64| (length_m / unit_m).log2().floor();
    let mut groups = BTreeMap::new();
    for (row, point) in points_m.iter().enumerate() {
        let distance_m = if scene.steel_extent_m().is_some() {
            clearance_of_m(scene, row + 1, *point, 0.0)?
        } else {
            unit_m
        };
        let near = step(distance_m).max(0.0);
        let gap_m = point[2] - top_m - depth_m;
        let up = (gap_m > 0.0).then(|| step(gap_m));
        let above_m = up.map(|up| top_m + depth_m + unit_m * up.exp2());
        let distance_m = unit_m * near.exp2();
        let down = (above_m.is_none() && distance_m < radius_m)
            .then(|| ((top_m - point[2]) / radius_m).floor());
        let [lowest_m, highest_m] = match (above_m, down) {
            (Some(above_m), _) => [above_m, f64::INFINITY],
            (None, Some(down)) => [down + 1.0, down].map(|radii| top_m - radii * radius_m),
            (None, None) => [f64::NEG_INFINITY, f64::INFINITY],
        };
        let of = |step: Option<f64>| step.map_or(i32::MIN, |step| step as i32);
        let key = [near as i32, of(up), of(down)];
        let group = groups.entry(key).or_insert_with(|| Group {
            rows: Vec::new(),
            clearance: Clearance {
                lowest_m,
                highest_m,
                distance_m,
            },
            sources: scene.below(above_m.unwrap_or(top_m)),
        });
        group.rows.push(row);
    }
    Ok(groups)
}

/// The groups with the dipoles that stand for the magnet there. Where a group's lowest height leaves too small a gap,
/// every row of it has those of its own, where it is beside windings and steel by its distance from them.
///
/// # Errors
/// A magnet that touches the array, or is too close for the tolerance, with the number of its point.
fn with_rules(
    scene: &Scene,
    groups: BTreeMap<[i32; 3], Group>,
    points_m: &[[f64; 3]],
    finest: f64,
) -> Result<Vec<(Group, Option<MagnetRule>)>, RunError> {
    let mut ready = Vec::new();
    for group in groups.into_values() {
        if let Ok(rule) = magnet_rule(scene.design, group.sources, finest) {
            ready.push((group, Some(rule)));
            continue;
        }
        for &row in &group.rows {
            let at_m = points_m[row];
            let above = scene.below(at_m[2]);
            let mut own = Group {
                rows: vec![row],
                sources: above,
                ..group
            };
            let mut rule = magnet_rule(scene.design, above, finest);
            if rule.is_err() {
                let steel_m = clearance_of_m(scene, row + 1, at_m, 0.0)?;
                let distance_m = match scene.steel_extent_m() {
                    Some(_) => steel_m.min(scene.windings_distance_m(at_m)),
                    None => scene.windings_distance_m(at_m),
                };
                let beside = Sources::Beyond { distance_m };
                let found = magnet_rule(scene.design, beside, finest);
                if found.is_ok() || above.distance_m() <= 0.0 {
                    rule = found;
                    own.sources = beside;
                    own.clearance = Clearance {
                        lowest_m: at_m[2],
                        highest_m: at_m[2],
                        distance_m: steel_m,
                    };
                }
            }
            let rule = rule.map_err(|fault| match fault {
                RunError::Input(why) => RunError::Input(format!("point {}: {why}", row + 1)),
                other => other,
            })?;
            ready.push((own, Some(rule)));
        }
    }
    Ok(ready)
}

/// The field of every coil at places within reach of the steel's sources.
pub(crate) struct FieldAt<'a> {
    scene: &'a Scene<'a>,
    sources: Option<Arc<SteelField>>,
}

impl<'a> FieldAt<'a> {
    /// For places within `reach_m` of `points_m`.
    ///
    /// # Errors
    /// A point on the steel's surface or hardly off it.
    pub(crate) fn new(
        scene: &'a Scene<'a>,
        solved: &'a Solved,
        points_m: &[[f64; 3]],
        reach_m: f64,
    ) -> Result<Self, RunError> {
        Ok(Self {
            scene,
            sources: solved.sources(scene, points_m, reach_m, 1.0)?,
        })
    }

    /// For the points of a group and the dipoles of the magnet about them.
    fn of_group(
        scene: &'a Scene<'a>,
        solved: &'a Solved,
        group: &Group,
        points_m: &[[f64; 3]],
        rule: Option<&MagnetRule>,
    ) -> Result<Self, RunError> {
        let reach_m = rule.map_or(0.0, MagnetRule::reach_m);
        let amplification = rule.map_or(1.0, MagnetRule::amplification);
        if solved.has_steel() {
            for row in &group.rows {
                clearance_of_m(scene, row + 1, points_m[*row], reach_m)?;
            }
        }
        Ok(Self {
            scene,
            sources: solved.sources_at(scene, group.clearance.within(reach_m), amplification),
        })
    }

    /// Field and gradient per ampere, [point, coil]; messages give the first of `points_m` the
    /// number `first`.
    ///
    /// # Errors
    /// A point on a winding's edge.
    pub(crate) fn fields(
        &self,
        points_m: &[[f64; 3]],
        first: usize,
    ) -> Result<Vec<CartesianField>, RunError> {
        self.driven_fields(points_m, first, &|_, _| true)
    }

    /// As [`FieldAt::fields`], but only where `needed` says so of a point and a coil; zero elsewhere.
    ///
    /// # Errors
    /// As [`FieldAt::fields`].
    pub(crate) fn driven_fields(
        &self,
        points_m: &[[f64; 3]],
        first: usize,
        needed: &dyn Fn(usize, usize) -> bool,
    ) -> Result<Vec<CartesianField>, RunError> {
        self.numbered_fields(points_m, &|row| first + row, needed)
    }

    /// As [`FieldAt::driven_fields`], with the numbers by which messages name the points.
    fn numbered_fields(
        &self,
        points_m: &[[f64; 3]],
        number: &dyn Fn(usize) -> usize,
        needed: &dyn Fn(usize, usize) -> bool,
    ) -> Result<Vec<CartesianField>, RunError> {
        let scene = self.scene;
        let count = points_m.len();
        let added = self.sources.as_ref().map_or_else(Vec::new, |sources| {
            scene.steel_fields(sources, points_m, Components::All)
        });
        let mut fields = Vec::with_capacity(count * scene.coils.len());
        for (row, [x, y, z]) in points_m.iter().enumerate() {
            for (column, coil) in scene.coils.iter().enumerate() {
                if !needed(row, column) {
                    fields.push(CartesianField::default());
                    continue;
                }
                let (dx, dy) = (x - coil.axis_m[0], y - coil.axis_m[1]);
                let axial = scene.winding.field(dx.hypot(dy), *z).map_err(|on_edge| {
                    RunError::Input(format!(
                        "point {} ({x}, {y}, {z} m), coil {}: {on_edge}",
                        number(row),
                        coil.number
                    ))
                })?;
                let mut field = to_cartesian(&axial, dx, dy);
                if !added.is_empty() {
                    let block = column * Components::All.count();
                    add(&mut field, |part| added[(block + part) * count + row]);
                }
                fields.push(scaled(field, coil.gain));
            }
        }
        Ok(fields)
    }

    /// Force and torque per ampere on the magnet that `rule` stands for, [point, coil].
    fn forces(
        &self,
        points_m: &[[f64; 3]],
        number: &dyn Fn(usize) -> usize,
        rule: &MagnetRule,
    ) -> Result<Vec<[f64; 6]>, RunError> {
        let mut felt = Vec::with_capacity(rule.nodes().len());
        for node in rule.nodes() {
            let moved: Vec<[f64; 3]> = points_m
                .iter()
                .map(|p| std::array::from_fn(|i| p[i] + node.offset_m[i]))
                .collect();
            felt.push(self.numbered_fields(&moved, number, &|_, _| true)?);
        }
        let pairs = points_m.len() * self.scene.coils.len();
        Ok((0..pairs)
            .map(|pair| {
                let at_nodes = felt.iter().map(|fields| &fields[pair]);
                let (fields, gradients): (Vec<_>, Vec<_>) = at_nodes
                    .map(|field| (field.field_t_per_a, field.gradient_t_per_m_per_a))
                    .unzip();
                let [fx, fy, fz] = rule.force_n(&gradients);
                let [tx, ty, tz] = rule.torque_n_m(&fields, &gradients);
                [fx, fy, fz, tx, ty, tz]
            })
            .collect())
    }
}

/// Adds what steel gives: five components of the gradient, then the field.
fn add(field: &mut CartesianField, part: impl Fn(usize) -> f64) {
    let [xx, xy, xz, yz, zz] = std::array::from_fn(&part);
    let tensor = [[xx, xy, xz], [xy, -xx - zz, yz], [xz, yz, zz]];
    for (sums, rows) in field.gradient_t_per_m_per_a.iter_mut().zip(tensor) {
        for (sum, value) in sums.iter_mut().zip(rows) {
            *sum += value;
        }
    }
    for (axis, sum) in field.field_t_per_a.iter_mut().enumerate() {
        *sum += part(5 + axis);
    }
}

fn scaled(mut field: CartesianField, gain: f64) -> CartesianField {
    field.field_t_per_a.iter_mut().for_each(|b| *b *= gain);
    field
        .gradient_t_per_m_per_a
        .as_flattened_mut()
        .iter_mut()
        .for_each(|g| *g *= gain);
    field
}

impl ProbeTable {
    /// Number of rows.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.fields.len()
    }

    /// Field and gradient per ampere of one coil at one point, both counted from 0.
    ///
    /// # Panics
    /// For a point or a coil that there is not.
    #[must_use]
    pub fn field(&self, point: usize, coil: usize) -> &CartesianField {
        assert!(coil < self.coils, "coil {coil} of {}", self.coils);
        &self.fields[point * self.coils + coil]
    }

    /// Number of coils: rows of a point.
    #[must_use]
    pub fn coils(&self) -> usize {
        self.coils
    }

    /// Force (N/A) and torque about the centre (N m/A) on the magnet, [point, coil]; empty where they
    /// were not requested.
    #[must_use]
    pub fn forces(&self) -> &[[f64; 6]] {
        &self.forces
    }

    /// Writes the CSV table.
    ///
    /// # Errors
    /// The writer's.
    pub fn write(&self, out: &mut dyn Write) -> io::Result<()> {
        let coils: Vec<i64> = (0..self.coils as i64).collect();
        let points_m = self.points_m.iter().copied();
        write_samples(out, &self.quantities(), points_m, &coils, |point, coil| {
            self.values(point * self.coils + coil)
        })
    }

    /// The table's columns by their names.
    #[must_use]
    pub fn columns(&self) -> BTreeMap<&'static str, Vec<f64>> {
        let names: Vec<&str> = SAMPLE_COLUMNS
            .into_iter()
            .chain(self.quantities())
            .collect();
        let mut columns = vec![Vec::with_capacity(self.rows()); names.len()];
        for pair in 0..self.rows() {
            let [point, coil] = [pair / self.coils, pair % self.coils];
            let place = self.points_m[point].into_iter().chain([coil as f64]);
            for (column, value) in columns.iter_mut().zip(place.chain(self.values(pair))) {
                column.push(value);
            }
        }
        names.into_iter().zip(columns).collect()
    }

    fn quantities(&self) -> Vec<&'static str> {
        quantities(self.components, !self.forces.is_empty())
    }

    /// The [`quantities`] of one row.
    fn values(&self, row: usize) -> Vec<f64> {
        let field = &self.fields[row];
        let mut values = Vec::with_capacity(18);
        if self.components == Components::All {
            values.extend(field.field_t_per_a);
        }
        let derivatives = field.gradient_t_per_m_per_a.as_flattened();
        values.extend(&derivatives[first_derivative(self.components)..]);
        values.extend(self.forces.get(row).into_iter().flatten());
        values
    }
}

/// Number of the first derivative that a table has.
fn first_derivative(components: Components) -> usize {
    match components {
        Components::Gz => 8,
        // The tensor is symmetric: the derivatives of B_z are the others along z.
        Components::Force => 6,
        Components::Gradient | Components::All => 0,
    }
}

/// Names of what every row of a table has beside place and coil.
#[must_use]
pub fn quantities(components: Components, has_forces: bool) -> Vec<&'static str> {
    let mut names = Vec::new();
    if components == Components::All {
        names.extend(FIELD_COLUMNS);
    }
    names.extend(&GRADIENT_COLUMNS[first_derivative(components)..]);
    if has_forces {
        names.extend(FORCE_COLUMNS);
    }
    names
}
