//! Files of a bundle for ParaView: the object with its forces, the coils, and the field.

use std::f64::consts::TAU;
use std::io;
use std::path::Path;

use super::Calibration;
use crate::RunError;
use crate::bundle::atomic::WriteError;
use crate::bundle::table::CurrentRow;
use crate::bundle::vtk::{Array, PolyData, write_image, write_poly};
use crate::commands::lambda::LambdaReport;
use crate::commands::map::workspace_grid;
use crate::field::iron::bodies::Body;
use crate::map::Components;
use crate::map::tabulate::Grid;
use crate::progress::Progress;
use crate::report::data::DirectionCell;
use crate::scene::Scene;
use crate::scene::iron::SceneIron;
use crate::scene::maps::{MagnetMean, SceneMap};
use crate::scene::working_point::{WorkingPoint, sum_of_coils};
use crate::shape::points::ConstraintPoints;

/// Sides of the prisms that stand for windings and cores.
const SIDES: usize = 48;
/// Numbers of the parts in the coils' file.
const WINDING: i64 = 0;
const CORE: i64 = 1;
const STEEL: i64 = 2;
/// The coil of what belongs to none.
const NO_COIL: i64 = -1;

/// Names of the files in a bundle.
const OBJECT: &str = "vtk/object.vtp";
const COILS: &str = "vtk/coils.vtp";
const FIELD: &str = "vtk/field.vti";

/// A name and its content.
type NamedFile = (&'static str, Vec<u8>);

impl Calibration<'_> {
    /// The files for ParaView, if they are requested; without a force constant no forces and no field.
    ///
    /// # Errors
    /// Points or nodes that cannot be computed; interruption.
    pub(super) fn vtk(
        &self,
        points: &ConstraintPoints,
        lambda: &LambdaReport,
        currents: &[CurrentRow],
        progress: &dyn Progress,
    ) -> Result<Vec<NamedFile>, RunError> {
        if !self.options.vtk {
            return Ok(Vec::new());
        }
        progress.begin("vtk", 1);
        let rows: Vec<usize> = (0..points.len()).collect();
        let cells = self.force_cells(points, &rows, lambda, progress)?;
        let written = |name, fill: &dyn Fn(&mut Vec<u8>) -> io::Result<()>| {
            let mut bytes = Vec::new();
            fill(&mut bytes)
                .map_err(|error| WriteError::from_io("write", Path::new(name), error))?;
            Ok::<_, RunError>((name, bytes))
        };
        let mut files = vec![
            written(OBJECT, &|out| object(out, points, cells.as_deref()))?,
            written(COILS, &|out| coils(out, self.scene, currents))?,
        ];
        if let Some(currents_a) = &lambda.file.currents_a {
            let grid = workspace_grid(self.scene.design);
            let field_t = self.field_t(&grid, currents_a, progress)?;
            let axes_m = [&*grid.x_m, &*grid.y_m, &*grid.z_m];
            let arrays = [Array::numbers("field_t", 3, &field_t)];
            files.push(written(FIELD, &|out| write_image(out, axes_m, &arrays))?);
        }
        progress.end();
        Ok(files)
    }

    /// B of windings and steel at these currents on the nodes of `grid`, [z, y, x, 3], T; of cores with a
    /// B-H curve that of their state, not the sum of the coils' fields.
    fn field_t(
        &self,
        grid: &Grid,
        currents_a: &[f64],
        progress: &dyn Progress,
    ) -> Result<Vec<f64>, RunError> {
        let (scene, solved) = (self.scene, &self.solved.map);
        let lowest_m = scene.design.workspace.z_m.from;
        if let Some(point) = WorkingPoint::new(scene, solved, currents_a, lowest_m)? {
            return point.field_t(scene, grid, progress);
        }
        let (all, mean) = (&scene.coils, MagnetMean::field());
        let map = SceneMap::new(scene, solved, all, grid, Components::All, &mean, progress)?;
        let per_ampere = map.map.field_t_per_a.unwrap_or_default();
        Ok(sum_of_coils(&per_ampere, currents_a))
    }
}

/// The surface that a runtime renders, a quadrilateral between four neighbouring points, and the force
/// vectors at the points.
fn object(
    out: &mut Vec<u8>,
    points: &ConstraintPoints,
    cells: Option<&[DirectionCell]>,
) -> io::Result<()> {
    let place = |row| [points.x_m[row], points.y_m[row], points.height_m[row]];
    let mut poly = PolyData {
        points_m: (0..points.len()).map(place).collect(),
        ..PolyData::default()
    };
    let (rows, columns) = (points.row_of_grid_point(), points.grid.x_m.samples);
    for (node, _) in rows.iter().enumerate() {
        if (node + 1) % columns == 0 {
            continue;
        }
        let corners = [node, node + 1, node + columns + 1, node + columns];
        let corners = corners.map(|node| rows.get(node).copied().flatten());
        if let [Some(a), Some(b), Some(c), Some(d)] = corners {
            poly.push([a, b, c, d]);
        }
    }
    let forces = cells.map(|cells| {
        [
            ("requested_n", column(cells, |cell| cell.requested_n)),
            ("static_n", column(cells, |cell| cell.static_n)),
            ("feedback_n", column(cells, |cell| cell.feedback_n)),
        ]
    });
    let mut arrays = vec![Array::numbers("normal", 3, points.normal.as_flattened())];
    let forces = forces.as_ref().into_iter().flatten();
    arrays.extend(forces.map(|(name, values)| Array::numbers(name, 3, values)));
    write_poly(out, &poly, &arrays, &[])
}

fn column(cells: &[DirectionCell], pick: fn(&DirectionCell) -> [f64; 3]) -> Vec<f64> {
    cells.iter().flat_map(pick).collect()
}

/// Windings and cores with their coil's number and current, and the plate and other steel.
fn coils(out: &mut Vec<u8>, scene: &Scene, currents: &[CurrentRow]) -> io::Result<()> {
    let coil = &scene.coil;
    let [inner_m, outer_m] = [coil.inner_diameter_m, coil.outer_diameter_m].map(|d| 0.5 * d);
    let bottom_m = -coil.length_m;
    let winding = [
        [inner_m, bottom_m],
        [outer_m, bottom_m],
        [outer_m, 0.0],
        [inner_m, 0.0],
        [inner_m, bottom_m],
    ];
    let core = scene.core.as_ref().map(|core| {
        let shape = core.shape;
        [
            [shape.radius_m, shape.bottom_m],
            [shape.radius_m, shape.top_m],
        ]
    });
    let mut poly = PolyData::default();
    let (mut number, mut part, mut current_a) = (Vec::new(), Vec::new(), Vec::new());
    for row in currents {
        let mut add = |profile: &[[f64; 2]], kind: i64| {
            revolve(&mut poly, [row.x_m, row.y_m], profile);
            number.resize(poly.ends.len(), row.coil as i64);
            part.resize(poly.ends.len(), kind);
            current_a.resize(poly.ends.len(), row.current_a);
        };
        add(&winding, WINDING);
        if let Some(core) = &core {
            add(core, CORE);
        }
    }
    for body in scene.iron.iter().flat_map(SceneIron::solids) {
        faces(&mut poly, &body);
    }
    number.resize(poly.ends.len(), NO_COIL);
    part.resize(poly.ends.len(), STEEL);
    current_a.resize(poly.ends.len(), 0.0);
    let arrays = [
        Array::indices("coil", &number),
        Array::indices("part", &part),
        Array::numbers("current_a", 1, &current_a),
    ];
    write_poly(out, &poly, &[], &arrays)
}

/// The surface of a body.
fn faces(poly: &mut PolyData, body: &Body) {
    let first = poly.points_m.len();
    let (places_m, polygons) = body.drawn();
    poly.points_m.extend(places_m);
    for polygon in polygons {
        poly.push(polygon.into_iter().map(|at| first + at));
    }
}

/// The surface that a profile of radii and heights sweeps about an axis; one that does not close is
/// closed by its ends' disks.
fn revolve(poly: &mut PolyData, axis_m: [f64; 2], profile: &[[f64; 2]]) {
    let first = poly.points_m.len();
    let around = |[radius_m, z_m]: &[f64; 2]| {
        let (radius_m, z_m) = (*radius_m, *z_m);
        (0..SIDES).map(move |k| {
            let (sin, cos) = (TAU * k as f64 / SIDES as f64).sin_cos();
            [axis_m[0] + radius_m * cos, axis_m[1] + radius_m * sin, z_m]
        })
    };
    poly.points_m.extend(profile.iter().flat_map(around));
    let at = |ring: usize, side: usize| first + ring * SIDES + side % SIDES;
    let last = profile.len() - 1;
    for ring in 0..last {
        for k in 0..SIDES {
            poly.push([
                at(ring, k),
                at(ring, k + 1),
                at(ring + 1, k + 1),
                at(ring + 1, k),
            ]);
        }
    }
    if profile[0] != profile[last] {
        poly.push((0..SIDES).rev().map(|k| at(0, k)));
        poly.push((0..SIDES).map(|k| at(last, k)));
    }
}
