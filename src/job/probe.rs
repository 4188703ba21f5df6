//! `probe`: field and gradient of every coil at given points.

use std::io::{self, Write};

use rayon::prelude::*;

use super::scene::Scene;
use super::{JobError, KERNEL_ERROR};
use crate::bundle::table::{Column, write_columns};
use crate::design::Design;
use crate::field::frame::{CartesianField, to_cartesian};
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
    /// Estimated error relative to |grad B| at the point.
    pub relative_error: f64,
    /// Whether the tolerance asked for was reached.
    pub accuracy_reached: bool,
}

const FIELD: [&str; 3] = ["bx_t_per_a", "by_t_per_a", "bz_t_per_a"];
const GRADIENT: [&str; 9] = [
    "dbx_dx_t_per_m_per_a",
    "dbx_dy_t_per_m_per_a",
    "dbx_dz_t_per_m_per_a",
    "dby_dx_t_per_m_per_a",
    "dby_dy_t_per_m_per_a",
    "dby_dz_t_per_m_per_a",
    "dbz_dx_t_per_m_per_a",
    "dbz_dy_t_per_m_per_a",
    "dbz_dz_t_per_m_per_a",
];

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
    progress.begin("probe", points_m.len() as u64);
    let portions = points_m
        .par_chunks(PORTION)
        .map(|points| {
            progress.check()?;
            let mut fields = Vec::with_capacity(points.len() * scene.coils.len());
            for [x, y, z] in points {
                for coil in &scene.coils {
                    let (dx, dy) = (x - coil.axis_m[0], y - coil.axis_m[1]);
                    let axial = scene.winding.field(dx.hypot(dy), *z)?;
                    fields.push(scaled(to_cartesian(&axial, dx, dy), coil.gain));
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
        relative_error: KERNEL_ERROR,
        accuracy_reached: KERNEL_ERROR <= tolerance.unwrap_or(KERNEL_ERROR),
    })
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
        let position = |axis: usize| -> Vec<f64> {
            self.points_m
                .iter()
                .flat_map(|p| std::iter::repeat_n(p[axis], self.coils))
                .collect()
        };
        let coil: Vec<i64> = (0..self.fields.len())
            .map(|row| (row % self.coils) as i64)
            .collect();
        let mut names = Vec::new();
        let mut values: Vec<Vec<f64>> = Vec::new();
        let mut add = |name, value: &dyn Fn(&CartesianField) -> f64| {
            names.push(name);
            values.push(self.fields.iter().map(value).collect());
        };
        if self.components == ProbeComponents::All {
            for (i, name) in FIELD.into_iter().enumerate() {
                add(name, &|f| f.field_t_per_a[i]);
            }
        }
        for (i, name) in GRADIENT.into_iter().enumerate() {
            if self.components != ProbeComponents::Gz || i == 8 {
                add(name, &|f| f.gradient_t_per_m_per_a[i / 3][i % 3]);
            }
        }
        let (x, y, z) = (position(0), position(1), position(2));
        let mut columns = vec![
            ("x_m", Column::Number(&x)),
            ("y_m", Column::Number(&y)),
            ("z_m", Column::Number(&z)),
            ("coil", Column::Index(&coil)),
        ];
        columns.extend(
            names
                .iter()
                .zip(&values)
                .map(|(n, v)| (*n, Column::Number(v))),
        );
        write_columns(out, &columns)
    }
}
