//! The field of all coils at their rated currents in the upright plane of an array's section.

use crate::field::steel::clearance::Clearance;
use std::collections::BTreeMap;

use rayon::prelude::*;

use super::Scene;
use super::steel::{Solved, clearance_of_m, solve};
use super::working_point::{TotalField, WorkingPoint};
use crate::RunError;
use crate::design::Design;
use crate::field::components::Components;
use crate::field::frame::to_cartesian;
use crate::numerics::streamlines::PlaneField;
use crate::plot::slices::{Shades, Slice, SliceLine, SlicesPlot};
use crate::progress::Progress;

/// Cells along the longer side.
const CELLS: f64 = 80.0;
/// Space around the array, in parts of the longer side.
const MARGIN: f64 = 0.12;
/// Distance of field lines, in cells.
const APART: f64 = 2.7;
/// Places closer to steel than this part of a core's radius are left out: the cost of one grows with the
/// inverse square of its distance.
const NEAREST: f64 = 0.2;
/// Accuracy of a picture, relative to the largest |grad B| at a height.
const TOLERANCE: f64 = 1e-2;

/// B in the middle of equal cells of an upright plane.
#[derive(Debug, Clone, PartialEq)]
pub struct FieldSlice {
    /// Ends along x and z, m.
    pub ends_m: [[f64; 2]; 2],
    /// The plane's y, m.
    pub y_m: f64,
    /// Cells along x, which is fastest.
    pub columns: usize,
    /// B_x, B_y and B_z, T; `None` in steel and hardly off it.
    pub field_t: Vec<Option<[f64; 3]>>,
}

/// The field of `design` at the rated current of every coil, as a drawing with field lines; `None`
/// without a coil.
///
/// # Errors
/// Steel that cannot be solved; interruption.
pub fn picture(design: &Design, progress: &dyn Progress) -> Result<Option<SlicesPlot>, RunError> {
    if design.coil.is_none() {
        return Ok(None);
    }
    let scene = Scene::with_tolerance(design, Some(TOLERANCE))?;
    let Some(array) = scene.drawing() else {
        return Ok(None);
    };
    let solved = solve(&scene, scene.tolerances.field, f64::NEG_INFINITY)?;
    let rated_a = scene.rated_currents_a();
    let state = WorkingPoint::new(&scene, &solved, &rated_a, f64::NEG_INFINITY)?;
    let y_m = array.section_y_m;
    let around = array.section_ends_m();
    let margin_m = MARGIN
        * around
            .iter()
            .map(|[from, to]| to - from)
            .fold(0.0, f64::max);
    let around = around.map(|[from, to]| [from - margin_m, to + margin_m]);
    let space = [design.workspace.x_m, design.workspace.z_m].map(|axis| [axis.from, axis.to]);
    let slice = |ends_m| FieldSlice::new(&scene, &solved, state.as_ref(), y_m, ends_m, progress);
    let (section, above) = (slice(around)?, slice(space)?);
    let outlines: Vec<SliceLine> = (array.sections_m().into_iter())
        .map(|(stroke, points_m)| SliceLine { points_m, stroke })
        .collect();
    let mut lines = section.lines();
    lines.extend(outlines);
    let size = |field: &[f64; 3]| field.iter().map(|part| part * part).sum::<f64>().sqrt();
    Ok(Some(SlicesPlot {
        title: format!(
            "{}: field with every coil at its rated current{}",
            design.name,
            if state.is_some() {
                ", along the B-H curve"
            } else {
                ""
            }
        ),
        slices: vec![
            section.panel(["|B|", ", with field lines"], size, Shades::Decades, lines),
            above.panel(
                ["B_z", ", workspace"],
                |field| field[2],
                Shades::Signed,
                Vec::new(),
            ),
        ],
        columns: 3,
        curves_title: String::new(),
        curves: Vec::new(),
    }))
}

impl FieldSlice {
    /// At the rated current of every coil; of steel in the `state` there, if it has one, else linear.
    ///
    /// # Errors
    /// Interruption.
    pub fn new(
        scene: &Scene,
        solved: &Solved,
        state: Option<&WorkingPoint>,
        y_m: f64,
        ends_m: [[f64; 2]; 2],
        progress: &dyn Progress,
    ) -> Result<Self, RunError> {
        let spans_m = ends_m.map(|[from, to]| to - from);
        let cell_m = spans_m[0].max(spans_m[1]) / CELLS;
        let counts = spans_m.map(|span| (span / cell_m).round().max(2.0) as usize);
        let at = |axis: usize, k: usize| {
            ends_m[axis][0] + spans_m[axis] * (k as f64 + 0.5) / counts[axis] as f64
        };
        let cells = (0..counts[1]).flat_map(|row| (0..counts[0]).map(move |column| [column, row]));
        let places_m: Vec<[f64; 3]> = cells.map(|[x, z]| [at(0, x), y_m, at(1, z)]).collect();
        let mut field_t = windings_t(scene, &places_m, &scene.rated_currents_a(), progress)?;
        if solved.has_steel() {
            add_steel(scene, solved, state, &places_m, &mut field_t);
        }
        Ok(Self {
            ends_m,
            y_m,
            columns: counts[0],
            field_t,
        })
    }

    fn panel(
        &self,
        [name, remark]: [&str; 2],
        pick: fn(&[f64; 3]) -> f64,
        shades: Shades,
        lines: Vec<SliceLine>,
    ) -> Slice {
        let values = self.field_t.iter();
        let y_mm = (1e7 * self.y_m).round() / 1e4;
        Slice {
            title: [name.to_owned(), format!("at y = {y_mm} mm{remark}")],
            unit: "T",
            axes: ["x", "z"],
            ends_m: self.ends_m,
            columns: self.columns,
            values: values.map(|field| field.as_ref().map(pick)).collect(),
            shades,
            lines,
        }
    }

    /// Lines along the field's part in the plane.
    fn lines(&self) -> Vec<SliceLine> {
        let [from, to] = self.ends_m[0];
        let apart_m = APART * (to - from) / self.columns as f64;
        let vectors = self.field_t.iter();
        let plane = PlaneField {
            ends: self.ends_m,
            columns: self.columns,
            vectors: vectors.map(|field| field.map(|[x, _, z]| [x, z])).collect(),
        };
        let lines = plane.streamlines(apart_m).into_iter();
        lines
            .map(|points_m| SliceLine {
                points_m,
                stroke: SliceLine::FIELD,
            })
            .collect()
    }
}

/// B of the windings; `None` on a winding's edge.
fn windings_t(
    scene: &Scene,
    places_m: &[[f64; 3]],
    currents_a: &[f64],
    progress: &dyn Progress,
) -> Result<Vec<Option<[f64; 3]>>, RunError> {
    progress.begin("field", places_m.len() as u64);
    let field = |[x, y, z]: &[f64; 3]| {
        let mut sum = [0.0; 3];
        for (coil, current) in scene.coils.iter().zip(currents_a) {
            let (dx, dy) = (x - coil.axis_m[0], y - coil.axis_m[1]);
            let axial = scene.winding.field(dx.hypot(dy), *z).ok()?;
            let field = to_cartesian(&axial, dx, dy).field_t_per_a;
            for (sum, part) in sum.iter_mut().zip(field) {
                *sum += current * coil.gain * part;
            }
        }
        Some(sum)
    };
    let rows = places_m.par_chunks(CELLS as usize).map(|row| {
        progress.check()?;
        progress.advance(row.len() as u64);
        Ok(row.iter().map(field).collect::<Vec<_>>())
    });
    let rows = rows.collect::<Result<Vec<_>, RunError>>()?;
    progress.end();
    Ok(rows.concat())
}

/// Adds what steel gives; cells on its surface and hardly off it have no field. Places are taken together
/// by powers of two of their distance from it, so that few of them need its sources finely divided.
fn add_steel(
    scene: &Scene,
    solved: &Solved,
    state: Option<&WorkingPoint>,
    places_m: &[[f64; 3]],
    field_t: &mut [Option<[f64; 3]>],
) {
    let core = scene.core.as_ref();
    let radius_m = core.map_or(scene.winding.inner_radius_m, |core| core.shape.radius_m);
    let mut groups: BTreeMap<i32, Vec<usize>> = BTreeMap::new();
    for (number, place) in places_m.iter().enumerate() {
        let distance_m = clearance_of_m(scene, number, *place, 0.0).unwrap_or(0.0);
        let step = (distance_m / (NEAREST * radius_m)).log2().floor();
        if step < 0.0 {
            field_t[number] = None;
        } else {
            groups.entry(step as i32).or_default().push(number);
        }
    }
    let driven = scene.coils.iter().zip(scene.rated_currents_a());
    let driven: Vec<f64> = driven.map(|(coil, current)| coil.gain * current).collect();
    let parts = Components::All;
    for (step, numbers) in groups {
        let places: Vec<[f64; 3]> = numbers.iter().map(|number| places_m[*number]).collect();
        let distance_m = NEAREST * radius_m * f64::from(step).exp2();
        let clearance = Clearance::above(f64::NEG_INFINITY, distance_m);
        let total = match state {
            Some(state) => Some(state.field(scene, clearance)),
            None => TotalField::linear(scene, solved, &driven, clearance),
        };
        let added = total.map_or_else(Vec::new, |total| total.at(&places, parts));
        let field_parts = added.chunks_exact(places.len()).skip(parts.count() - 3);
        for (axis, values) in field_parts.enumerate() {
            for (number, value) in numbers.iter().zip(values) {
                if let Some(field) = &mut field_t[*number] {
                    field[axis] += value;
                }
            }
        }
    }
}
