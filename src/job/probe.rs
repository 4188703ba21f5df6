//! `probe`: field, gradient and force of every coil at given points.

use std::io::{self, Write};

use rayon::prelude::*;

use super::scene::{MAGNET_FINEST, MAGNET_SHARE, Scene};
use super::steel::{EVALUATION_SHARE, Solved, Steel};
use super::{JobError, KERNEL_ERROR, steel};
use crate::bundle::table::{FIELD_COLUMNS, FORCE_COLUMNS, GRADIENT_COLUMNS, write_samples};
use crate::design::Design;
use crate::field::frame::{CartesianField, to_cartesian};
use crate::field::magnet::MagnetRule;
use crate::field::steel::sources::{ArraySources, Parts};
use crate::progress::Progress;

/// What is asked at the points.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum ProbeComponents {
    /// Field and gradient tensor.
    All,
    /// Gradient tensor.
    Gradient,
    /// dB_z/dz.
    Gz,
}

/// Field and gradient per ampere, coil by coil within a point.
#[derive(Debug, Clone)]
pub struct ProbeTable {
    components: ProbeComponents,
    points_m: Vec<[f64; 3]>,
    coils: usize,
    /// [point, coil]
    fields: Vec<CartesianField>,
    /// [point, coil]: force (N/A) and torque about the centre (N m/A) of the magnet; where asked.
    forces: Vec<[f64; 6]>,
    /// Estimated error relative to |grad B| at the point; with steel, to the largest at its height.
    pub relative_error: f64,
    /// Whether it is relative to the largest at the height.
    pub relative_to_height: bool,
    /// Estimated error of the forces, relative to |m| times the largest |grad B| at the height.
    pub force_error: Option<f64>,
    /// Whether the tolerance asked for was reached.
    pub accuracy_reached: bool,
}

/// What is asked of [`probe`].
#[derive(Debug, Clone, Copy)]
pub struct ProbeRequest {
    /// Parts of the field.
    pub components: ProbeComponents,
    /// Force and torque on the design's magnet besides, its centre at the points.
    pub force: bool,
    /// Tolerance; `None` for the default.
    pub tolerance: Option<f64>,
}

impl Default for ProbeRequest {
    /// Field and gradient, to the default tolerance, without the force.
    fn default() -> Self {
        Self {
            components: ProbeComponents::All,
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
/// A design that cannot be computed; a point on a winding's edge or on the steel; a magnet that
/// touches the array, where the force is asked for; interruption.
pub fn probe(
    design: &Design,
    points_m: Vec<[f64; 3]>,
    request: ProbeRequest,
    progress: &dyn Progress,
) -> Result<ProbeTable, JobError> {
    let scene = Scene::new(design)?;
    let lowest_m = points_m.iter().fold(f64::INFINITY, |z, p| z.min(p[2]));
    let solved = steel::solve(&scene, request.tolerance, KERNEL_ERROR, lowest_m)?;
    let rule = request
        .force
        .then(|| scene.magnet_rule(lowest_m, MAGNET_SHARE * solved.tolerance.max(MAGNET_FINEST)))
        .transpose()?;
    let nodes = rule.as_ref().map_or(&[][..], MagnetRule::nodes);
    let reach_m = nodes.iter().fold(0.0_f64, |reach, node| {
        let [x, y, z] = node.offset_m;
        reach.max(x.hypot(y).hypot(z))
    });
    let places = Places::new(&scene, &solved, &points_m, reach_m)?;
    progress.begin("probe", points_m.len() as u64);
    let portions = points_m
        .par_chunks(PORTION)
        .enumerate()
        .map(|(portion, points)| {
            progress.check()?;
            let first = portion * PORTION + 1;
            let fields = places.fields(points, first)?;
            let forces = rule
                .as_ref()
                .map_or_else(|| Ok(Vec::new()), |rule| places.forces(points, first, rule))?;
            progress.advance(points.len() as u64);
            Ok((fields, forces))
        })
        .collect::<Result<Vec<_>, JobError>>()?;
    progress.end();
    let (fields, forces): (Vec<_>, Vec<_>) = portions.into_iter().unzip();
    let relative_error = match solved.steel {
        Steel::None => KERNEL_ERROR,
        Steel::Alone(_) | Steel::Coupled(_) => {
            solved.steel_estimate() + EVALUATION_SHARE * solved.tolerance
        }
    };
    Ok(ProbeTable {
        components: request.components,
        coils: scene.coils.len(),
        fields: fields.concat(),
        forces: forces.concat(),
        points_m,
        relative_error,
        relative_to_height: !matches!(solved.steel, Steel::None),
        force_error: rule.map(|rule| relative_error * rule.amplification() + rule.bound()),
        accuracy_reached: solved.tolerance >= KERNEL_ERROR && solved.reached(),
    })
}

/// What gives the field at any place.
pub(super) struct Places<'a> {
    scene: &'a Scene<'a>,
    solved: &'a Solved,
    sources: Option<ArraySources>,
}

impl<'a> Places<'a> {
    /// For places within `reach_m` of `points_m`.
    ///
    /// # Errors
    /// A point on the steel's surface or hardly off it.
    pub(super) fn new(
        scene: &'a Scene<'a>,
        solved: &'a Solved,
        points_m: &[[f64; 3]],
        reach_m: f64,
    ) -> Result<Self, JobError> {
        Ok(Self {
            scene,
            solved,
            sources: solved.sources(scene, points_m, reach_m)?,
        })
    }

    /// Field and gradient per ampere, [point, coil]; the first of `points_m` is told as number
    /// `first`.
    ///
    /// # Errors
    /// A point on a winding's edge.
    pub(super) fn fields(
        &self,
        points_m: &[[f64; 3]],
        first: usize,
    ) -> Result<Vec<CartesianField>, JobError> {
        self.driven_fields(points_m, first, &|_, _| true)
    }

    /// As [`Places::fields`], but only where `wanted` says so of a point and a coil; zero elsewhere.
    ///
    /// # Errors
    /// As [`Places::fields`].
    pub(super) fn driven_fields(
        &self,
        points_m: &[[f64; 3]],
        first: usize,
        wanted: &dyn Fn(usize, usize) -> bool,
    ) -> Result<Vec<CartesianField>, JobError> {
        let scene = self.scene;
        let count = points_m.len();
        let added = self.sources.as_ref().map_or_else(Vec::new, |sources| {
            self.solved
                .steel_fields(scene, sources, points_m, Parts::All)
        });
        let mut fields = Vec::with_capacity(count * scene.coils.len());
        for (row, [x, y, z]) in points_m.iter().enumerate() {
            for (column, coil) in scene.coils.iter().enumerate() {
                if !wanted(row, column) {
                    fields.push(CartesianField::default());
                    continue;
                }
                let (dx, dy) = (x - coil.axis_m[0], y - coil.axis_m[1]);
                let axial = scene.winding.field(dx.hypot(dy), *z).map_err(|on_edge| {
                    JobError::Input(format!(
                        "point {} ({x}, {y}, {z} m), coil {}: {on_edge}",
                        first + row,
                        coil.number
                    ))
                })?;
                let mut field = to_cartesian(&axial, dx, dy);
                if !added.is_empty() {
                    let block = column * Parts::All.count();
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
        first: usize,
        rule: &MagnetRule,
    ) -> Result<Vec<[f64; 6]>, JobError> {
        let mut felt = Vec::with_capacity(rule.nodes().len());
        for node in rule.nodes() {
            let moved: Vec<[f64; 3]> = points_m
                .iter()
                .map(|p| std::array::from_fn(|i| p[i] + node.offset_m[i]))
                .collect();
            felt.push(self.fields(&moved, first)?);
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

    /// Writes the CSV table.
    ///
    /// # Errors
    /// The writer's.
    pub fn write(&self, out: &mut dyn Write) -> io::Result<()> {
        let mut columns: Vec<&str> = Vec::new();
        if self.components == ProbeComponents::All {
            columns.extend(FIELD_COLUMNS);
        }
        let first = if self.components == ProbeComponents::Gz {
            8
        } else {
            0
        };
        columns.extend(&GRADIENT_COLUMNS[first..]);
        if !self.forces.is_empty() {
            columns.extend(FORCE_COLUMNS);
        }
        let coils: Vec<i64> = (0..self.coils as i64).collect();
        write_samples(
            out,
            &columns,
            self.points_m.iter().copied(),
            &coils,
            |point, coil| {
                let pair = point * self.coils + coil;
                let field = &self.fields[pair];
                let mut row = Vec::with_capacity(columns.len());
                if self.components == ProbeComponents::All {
                    row.extend(field.field_t_per_a);
                }
                row.extend(&field.gradient_t_per_m_per_a.as_flattened()[first..]);
                row.extend(self.forces.get(pair).into_iter().flatten());
                row
            },
        )
    }
}
