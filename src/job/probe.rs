//! `probe`: field and gradient of every coil at given points.

use std::io::{self, Write};

use rayon::prelude::*;

use super::scene::Scene;
use super::steel::{EVALUATION_SHARE, Steel};
use super::{JobError, KERNEL_ERROR, steel};
use crate::bundle::table::{FIELD_COLUMNS, GRADIENT_COLUMNS, write_samples};
use crate::design::Design;
use crate::field::frame::{CartesianField, to_cartesian};
use crate::field::steel::sources::Parts;
use crate::progress::Progress;

/// What is asked at the points.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
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
    /// Estimated error relative to |grad B| at the point; with steel, to the largest at its height.
    pub relative_error: f64,
    /// Whether it is relative to the largest at the height.
    pub relative_to_height: bool,
    /// Whether the tolerance asked for was reached.
    pub accuracy_reached: bool,
}

/// Points between two looks at the interruption flag.
const PORTION: usize = 256;

/// Field and gradient of every coil of `design` at `points_m`, to 1e-12 of |grad B| at the point.
///
/// # Errors
/// A design that cannot be computed; a point on a winding's edge; interruption.
pub fn probe(
    design: &Design,
    points_m: Vec<[f64; 3]>,
    components: ProbeComponents,
    tolerance: Option<f64>,
    progress: &dyn Progress,
) -> Result<ProbeTable, JobError> {
    let scene = Scene::new(design)?;
    let lowest_m = points_m.iter().fold(f64::INFINITY, |z, p| z.min(p[2]));
    let solved = steel::solve(&scene, tolerance, KERNEL_ERROR, lowest_m)?;
    let count = points_m.len();
    let added = match solved.sources(&scene, &points_m, 0.0)? {
        Some(sources) => solved.steel_fields(&scene, &sources, &points_m, Parts::All),
        None => Vec::new(),
    };
    progress.begin("probe", count as u64);
    let portions = points_m
        .par_chunks(PORTION)
        .enumerate()
        .map(|(portion, points)| {
            progress.check()?;
            let mut fields = Vec::with_capacity(points.len() * scene.coils.len());
            for (row, [x, y, z]) in points.iter().enumerate() {
                for coil in &scene.coils {
                    let (dx, dy) = (x - coil.axis_m[0], y - coil.axis_m[1]);
                    let axial = scene.winding.field(dx.hypot(dy), *z).map_err(|on_edge| {
                        let number = portion * PORTION + row + 1;
                        JobError::Input(format!(
                            "point {number} ({x}, {y}, {z} m), coil {}: {on_edge}",
                            coil.number
                        ))
                    })?;
                    let mut field = to_cartesian(&axial, dx, dy);
                    if !added.is_empty() {
                        let point = portion * PORTION + row;
                        let first = coil.number * Parts::All.count();
                        add(&mut field, |part| added[(first + part) * count + point]);
                    }
                    fields.push(scaled(field, coil.gain));
                }
            }
            progress.advance(points.len() as u64);
            Ok(fields)
        })
        .collect::<Result<Vec<_>, JobError>>()?;
    progress.end();
    Ok(ProbeTable {
        components,
        coils: scene.coils.len(),
        fields: portions.concat(),
        points_m,
        relative_error: match solved.steel {
            Steel::None => KERNEL_ERROR,
            Steel::Alone(_) | Steel::Coupled(_) => {
                solved.steel_error + EVALUATION_SHARE * solved.tolerance
            }
        },
        relative_to_height: !matches!(solved.steel, Steel::None),
        accuracy_reached: solved.tolerance >= KERNEL_ERROR && solved.reached(),
    })
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
        let coils: Vec<i64> = (0..self.coils as i64).collect();
        write_samples(
            out,
            &columns,
            self.points_m.iter().copied(),
            &coils,
            |point, coil| {
                let field = &self.fields[point * self.coils + coil];
                let gradient = &field.gradient_t_per_m_per_a.as_flattened()[first..];
                match self.components {
                    ProbeComponents::All => [&field.field_t_per_a, gradient].concat(),
                    ProbeComponents::Gradient | ProbeComponents::Gz => gradient.to_vec(),
                }
            },
        )
    }
}
