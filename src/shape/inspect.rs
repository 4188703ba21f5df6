//! Contents of a surface file as it is, before placing: size, holes, faults, a guess at its unit.
//!
//! Vertices are one when their coordinates agree to what the file's number format can distinguish.
//! Nothing here changes the surface, and the guessed unit is never used.

use std::path::Path;

use rayon::prelude::*;
use serde::Serialize;

use crate::bodies::{BodyOptions, NamedBody};
use crate::crossings::crossings;
use crate::document::{Placement, SurfaceFormat};
use crate::edges::{Edges, WELD_ROUNDINGS, parts, weld};
use crate::error::ShapeError;
use crate::file_mesh::{FileMesh, Triangle};
use crate::height::Grid;
use crate::hidden::MOST_MET;
use crate::mesh::Mesh;
use crate::placement::Transform;
use crate::scattered::Probe;
use crate::sides::Sides;
use crate::surface::{ByteObserver, Surface, read_mesh};
use fluxform_base::progress::Progress;
use fluxform_numerics::axis::Axis;
use fluxform_numerics::vec3::{cross, minus};

/// Contents of a surface file. Lengths are in the file's unit.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MeshReport {
    /// The format's usual name.
    pub format: &'static str,
    /// Triangles in the file.
    pub triangles: usize,
    /// Lower corner of their box.
    pub bounds_min: [f64; 3],
    /// Upper corner.
    pub bounds_max: [f64; 3],
    /// Metres of the file's unit, where the format carries it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unit_m: Option<f64>,
    /// Possible units, likeliest first, where the format carries none. Never used.
    pub unit_guesses: Vec<UnitGuess>,
    /// How far a coordinate may lie from what was meant, because of the file's number format.
    pub coordinate_rounding: f64,
    /// Estimate of how far the triangles may lie from their body; 0 where unknown.
    pub deviation: f64,
    /// Every edge has exactly two triangles.
    pub watertight: bool,
    /// Edges with a triangle on one side only: borders and holes.
    pub open_edges: usize,
    /// Edges with more than two triangles.
    pub crowded_edges: usize,
    /// Edges whose two triangles look to different sides.
    pub inconsistent_edges: usize,
    /// Triangles without area.
    pub degenerate: usize,
    /// Triangles whose three corners another triangle has too.
    pub duplicate: usize,
    /// Parts that share no vertex.
    pub bodies: usize,
    /// V - E + F: 2 for a closed body without a hole through it, 2 less for each such hole.
    pub euler: i64,
    /// Pairs of triangles that pass through each other or partly lie on each other.
    pub self_intersections: usize,
    /// False where so many triangles lie over each other that not all pairs were looked at.
    pub self_intersections_complete: bool,
    /// Two such triangles, counted from 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub self_intersection_first: Option<[usize; 2]>,
    /// The most sheets that a vertical line meets, over `LINES` x `LINES` lines; a body has 2.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub layers: Option<u32>,
    /// Sum of the triangles' areas.
    pub area: f64,
    /// Enclosed volume, negative if the triangles of all bodies look inwards; absent unless watertight and
    /// consistent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub volume: Option<f64>,
    /// Bodies whose triangles look inwards, where others look outwards.
    #[serde(skip_serializing_if = "is_zero")]
    pub turned_bodies: usize,
    /// The bodies that the file names, in its order; absent where the format names none.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub named_bodies: Vec<NamedBody>,
    /// Another program that made the triangles of the file, with its version.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub read_by: Option<String>,
    /// Warnings for the user.
    pub warnings: Vec<String>,
}

/// A unit in which the surface would have the size of a haptic display's.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct UnitGuess {
    /// As `--unit` takes it.
    pub unit: &'static str,
    /// The box's longest side in this unit, m.
    pub size_m: f64,
}

/// Vertical lines along x, and as many along y.
const LINES: usize = 101;
/// Likely units, the most usual first, and their metres.
const LIKELY: [(&str, f64); 4] = [("mm", 1e-3), ("m", 1.0), ("in", 0.0254), ("cm", 1e-2)];
/// Sizes that surfaces of haptic displays have, m.
const USUAL_M: [f64; 2] = [0.01, 0.5];

/// Coordinates beyond this are no lengths in any unit.
const FARTHEST: f64 = 1e15;

impl MeshReport {
    /// Reads the file at `path` and looks at it.
    ///
    /// # Errors
    /// [`ShapeError`] with the path and the place.
    pub fn of_file(
        path: &Path,
        bodies: &BodyOptions,
        progress: &dyn Progress,
    ) -> Result<Self, ShapeError> {
        Self::of_file_observed(path, bodies, &mut (), progress)
    }

    /// As [`MeshReport::of_file`]; `observer` sees the file's bytes.
    ///
    /// # Errors
    /// As [`MeshReport::of_file`].
    pub fn of_file_observed(
        path: &Path,
        bodies: &BodyOptions,
        observer: &mut dyn ByteObserver,
        progress: &dyn Progress,
    ) -> Result<Self, ShapeError> {
        let (format, file) = read_mesh(path, bodies, observer, progress)?;
        let coordinates = file.triangles.as_flattened().as_flattened().iter();
        let largest = coordinates.fold(0.0, |m: f64, c| m.max(c.abs()));
        if largest > FARTHEST {
            return Err(ShapeError::Document(format!(
                "{}: a coordinate is {largest:e}: no unit makes that a length; the file is damaged",
                path.display()
            )));
        }
        Ok(Self::new(format, file))
    }

    /// Looks at what was read.
    #[must_use]
    pub fn new(format: SurfaceFormat, mut file: FileMesh) -> Self {
        let warnings = std::mem::take(&mut file.warnings);
        let named = std::mem::take(&mut file.bodies);
        let read_by = file.read_by.take();
        let (mut report, names) = Self::with_names(format, &file);
        let reach = WELD_ROUNDINGS * file.coordinate_rounding;
        let crossings = crossings(&file.triangles, &names, reach);
        report.self_intersections = crossings.pairs;
        report.self_intersections_complete = crossings.complete;
        report.self_intersection_first = crossings.first;
        report.layers = layers(file);
        report.warnings = warnings;
        report.named_bodies = named;
        report.read_by = read_by;
        report.warn();
        report
    }

    fn with_names(format: SurfaceFormat, file: &FileMesh) -> (Self, Vec<[u32; 3]>) {
        let bounds = bounds(&file.triangles);
        let reach = WELD_ROUNDINGS * file.coordinate_rounding;
        let names = weld(&file.triangles, reach);
        let edges = Edges::new(&names);
        let watertight = !file.triangles.is_empty() && edges.closed();
        let flat = |[a, b, c]: &&Triangle| cross(minus(*b, *a), minus(*c, *a)) == [0.0; 3];
        let size = (0..3)
            .map(|k| bounds[1][k] - bounds[0][k])
            .fold(0.0, f64::max);
        let parts = parts(&names);
        let bodies = parts.1;
        let enclosed =
            (watertight && edges.inconsistent == 0).then(|| Sides::new(&file.triangles, parts));
        let turned = enclosed.as_ref().map_or([0; 2], Sides::counts);
        let guess = |(unit, metres): (&'static str, f64)| UnitGuess {
            unit,
            size_m: size * metres,
        };
        let usual = |guess: &UnitGuess| (USUAL_M[0]..=USUAL_M[1]).contains(&guess.size_m);
        let guesses = LIKELY.map(guess).into_iter().filter(usual);
        let report = Self {
            format: format.name(),
            triangles: file.triangles.len(),
            bounds_min: bounds[0],
            bounds_max: bounds[1],
            unit_m: file.unit_m,
            unit_guesses: match file.unit_m {
                Some(_) => Vec::new(),
                None => guesses.collect(),
            },
            coordinate_rounding: file.coordinate_rounding.max(file.level_rounding),
            deviation: file.deviation,
            watertight,
            open_edges: edges.open,
            crowded_edges: edges.crowded,
            inconsistent_edges: edges.inconsistent,
            degenerate: file.triangles.iter().filter(flat).count(),
            duplicate: edges.duplicate,
            bodies,
            euler: edges.euler,
            self_intersections: 0,
            self_intersections_complete: false,
            self_intersection_first: None,
            layers: None,
            area: area(&file.triangles),
            // Inside out as a whole.
            volume: enclosed.map(|of| {
                if turned[0] == turned[1] {
                    -of.volume
                } else {
                    of.volume
                }
            }),
            turned_bodies: if turned[0] == turned[1] { 0 } else { turned[1] },
            named_bodies: Vec::new(),
            read_by: None,
            warnings: Vec::new(),
        };
        (report, names)
    }

    fn warn(&mut self) {
        let mut say = |count: usize, what: &str| {
            if count > 0 {
                self.warnings.push(format!("{count} {what}"));
            }
        };
        say(
            self.open_edges,
            "edges have a triangle on one side only: the surface is open; seen through a hole, \
             its height is that of what lies below",
        );
        say(
            self.crowded_edges,
            "edges have more than two triangles: bodies touch, or faces lie twice",
        );
        say(
            self.inconsistent_edges,
            "edges have triangles that look to different sides; heights do not depend on that",
        );
        say(
            self.turned_bodies,
            "connected parts have triangles that look inwards, unlike the others; heights do not depend on that",
        );
        say(
            self.degenerate,
            "triangles have no area; they are left out of the heights",
        );
        say(
            self.duplicate,
            "triangles lie twice; heights do not depend on that",
        );
        say(
            self.self_intersections,
            "pairs of triangles pass through each other or overlap; the height is that of the \
             upper one",
        );
        if !self.self_intersections_complete {
            let what = "not all pairs of triangles were looked at: there may be more";
            self.warnings.push(what.into());
        }
        if self.volume.is_some_and(|v| v < 0.0) {
            let what = "the triangles look inwards; heights do not depend on that";
            self.warnings.push(what.into());
        }
    }
}

fn bounds(triangles: &[Triangle]) -> [[f64; 3]; 2] {
    if triangles.is_empty() {
        return [[0.0; 3]; 2];
    }
    let mut bounds = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
    for vertex in triangles.as_flattened() {
        for k in 0..3 {
            bounds[0][k] = bounds[0][k].min(vertex[k]);
            bounds[1][k] = bounds[1][k].max(vertex[k]);
        }
    }
    bounds
}

fn area(triangles: &[Triangle]) -> f64 {
    let twice = triangles.iter().map(|[a, b, c]| {
        let normal = cross(minus(*b, *a), minus(*c, *a));
        normal[0].hypot(normal[1]).hypot(normal[2])
    });
    0.5 * twice.sum::<f64>()
}

fn is_zero(count: &usize) -> bool {
    *count == 0
}

/// The most sheets over each other, looked for along vertical lines over the whole box; `None`
/// without area, and for coordinates that no surface may have.
fn layers(file: FileMesh) -> Option<u32> {
    let as_it_is = Transform::new(1.0, &Placement::default());
    let mesh = Mesh::place(file, &as_it_is).ok()?;
    // Lines half a step inside: a body's own sides are no sheets.
    let [x_m, y_m] = mesh.facts().bounds.plan().map(|[low, high]| {
        let half = 0.5 * (high - low) / LINES as f64;
        Axis {
            from: low + half,
            to: high - half,
            samples: LINES,
        }
    });
    let grid = Grid { x_m, y_m };
    let (x, y) = (grid.x_m.nodes(), grid.y_m.nodes());
    let surface = Surface::Mesh(mesh);
    let probe = Probe::new(&surface, &grid);
    let at = |k: usize| probe.at([x[k % LINES], y[k / LINES]]);
    // Where triangles lie over each other many times, a line meets all of them: fewer lines.
    let met = |k: usize| probe.near([x[k % LINES], y[k / LINES]]);
    let met: usize = (0..grid.len()).into_par_iter().map(met).sum();
    let lines = (0..grid.len()).into_par_iter();
    let lines = lines.step_by((met / MOST_MET).max(1));
    lines.filter_map(at).map(|(_, marks)| marks.layers).max()
}
