//! What a surface file holds, told without placing it: size, holes, faults, a guess at its unit.
//!
//! Vertices are one when their coordinates agree to what the file's number format can tell apart.
//! Nothing here changes the surface, and the guessed unit is never used.

use std::collections::HashMap;
use std::path::Path;

use serde::Serialize;

use crate::shape::document::SurfaceFormat;
use crate::shape::error::ShapeError;
use crate::shape::mesh::{FileMesh, Triangle, cross, minus};
use crate::shape::surface::read_file;

/// What a surface file holds. Lengths are in the file's unit.
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
    /// What the unit may be, likeliest first, where the format carries none. Never used.
    pub unit_guesses: Vec<UnitGuess>,
    /// How far a coordinate may lie from what was meant, because of the file's number format.
    pub coordinate_rounding: f64,
    /// Estimate of how far the triangles may lie from their body; 0 where nothing tells.
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
    /// V - E + F: 2 for a closed body without a hole through it, 2 less for each such hole.
    pub euler: i64,
    /// Sum of the triangles' areas.
    pub area: f64,
    /// Enclosed volume, negative if the triangles look inwards; absent unless watertight and
    /// consistent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub volume: Option<f64>,
    /// What a careful person would mention.
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

/// Likely units, the most usual first, and their metres.
const LIKELY: [(&str, f64); 4] = [("mm", 1e-3), ("m", 1.0), ("in", 0.0254), ("cm", 1e-2)];
/// Sizes that surfaces of haptic displays have, m.
const USUAL_M: [f64; 2] = [0.01, 0.5];

/// Coordinates beyond this are no lengths in any unit.
const FARTHEST: f64 = 1e15;
/// Two programs may round the same vertex to neighbouring numbers.
const WELD_ROUNDINGS: f64 = 2.0;

impl MeshReport {
    /// Reads the file at `path` and looks at it.
    ///
    /// # Errors
    /// [`ShapeError`] with the path and the place.
    pub fn of_file(path: &Path) -> Result<Self, ShapeError> {
        let format =
            SurfaceFormat::of(path).ok_or_else(|| ShapeError::Format { path: path.into() })?;
        let file = format.read(path, &read_file(path)?)?;
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
    pub fn new(format: SurfaceFormat, file: FileMesh) -> Self {
        let bounds = bounds(&file.triangles);
        let edges = Edges::new(&file.triangles, WELD_ROUNDINGS * file.coordinate_rounding);
        let watertight = !file.triangles.is_empty() && edges.open == 0 && edges.crowded == 0;
        let flat = |[a, b, c]: &&Triangle| cross(minus(*b, *a), minus(*c, *a)) == [0.0; 3];
        let size = (0..3)
            .map(|k| bounds[1][k] - bounds[0][k])
            .fold(0.0, f64::max);
        let (area, volume) = area_and_volume(&file.triangles, bounds);
        let guess = |(unit, metres): (&'static str, f64)| UnitGuess {
            unit,
            size_m: size * metres,
        };
        let usual = |guess: &UnitGuess| (USUAL_M[0]..=USUAL_M[1]).contains(&guess.size_m);
        let guesses = LIKELY.map(guess).into_iter().filter(usual);
        let mut report = Self {
            format: format.name(),
            triangles: file.triangles.len(),
            bounds_min: bounds[0],
            bounds_max: bounds[1],
            unit_m: file.unit_m,
            unit_guesses: match file.unit_m {
                Some(_) => Vec::new(),
                None => guesses.collect(),
            },
            coordinate_rounding: file.coordinate_rounding,
            deviation: file.deviation,
            watertight,
            open_edges: edges.open,
            crowded_edges: edges.crowded,
            inconsistent_edges: edges.inconsistent,
            degenerate: file.triangles.iter().filter(flat).count(),
            duplicate: edges.duplicate,
            euler: edges.euler,
            area,
            volume: (watertight && edges.inconsistent == 0).then_some(volume),
            warnings: file.warnings,
        };
        report.warn();
        report
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
            self.degenerate,
            "triangles have no area; they are left out of the heights",
        );
        say(
            self.duplicate,
            "triangles lie twice; heights do not depend on that",
        );
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

/// Area and signed volume, seen from the middle of the box, where least is lost in the sum.
fn area_and_volume(triangles: &[Triangle], bounds: [[f64; 3]; 2]) -> (f64, f64) {
    let middle = [0, 1, 2].map(|k| bounds[0][k] + 0.5 * (bounds[1][k] - bounds[0][k]));
    let (mut twice_area, mut six_volumes) = (0.0, 0.0);
    for triangle in triangles {
        let [a, b, c] = triangle.map(|v| minus(v, middle));
        let normal = cross(minus(b, a), minus(c, a));
        twice_area += normal[0].hypot(normal[1]).hypot(normal[2]);
        six_volumes += a[0] * normal[0] + a[1] * normal[1] + a[2] * normal[2];
    }
    (0.5 * twice_area, six_volumes / 6.0)
}

/// How triangles meet.
#[derive(Default)]
struct Edges {
    duplicate: usize,
    open: usize,
    crowded: usize,
    inconsistent: usize,
    euler: i64,
}

impl Edges {
    /// Vertices nearer than `reach` in every coordinate are one.
    fn new(triangles: &[Triangle], reach: f64) -> Self {
        let mut welder = Welder::new(reach);
        let mut corners: Vec<[u32; 3]> = triangles
            .iter()
            .map(|triangle| triangle.map(|vertex| welder.name(vertex)))
            // A triangle that welding closes leaves its neighbours joined.
            .filter(|[a, b, c]| a != b && b != c && c != a)
            .collect();
        drop(welder);
        let mut found = Self::default();
        // Each edge with whether it runs from the lower to the higher name.
        let mut edges: Vec<(u64, bool)> = Vec::with_capacity(3 * corners.len());
        for [a, b, c] in &corners {
            for (from, to) in [(*a, *b), (*b, *c), (*c, *a)] {
                let (low, high) = (from.min(to), from.max(to));
                edges.push((u64::from(low) << 32 | u64::from(high), from < to));
            }
        }
        edges.sort_unstable();
        let mut met = corners.as_flattened().to_vec();
        met.sort_unstable();
        met.dedup();
        found.euler = met.len() as i64 + corners.len() as i64;
        for group in edges.chunk_by(|a, b| a.0 == b.0) {
            found.euler -= 1;
            match group {
                [_] => found.open += 1,
                [a, b] => found.inconsistent += usize::from(a.1 == b.1),
                _ => found.crowded += 1,
            }
        }
        for corner in &mut corners {
            corner.sort_unstable();
        }
        corners.sort_unstable();
        found.duplicate = corners.windows(2).filter(|pair| pair[0] == pair[1]).count();
        found
    }
}

/// Gives vertices that lie together one name.
struct Welder {
    reach: f64,
    /// Side of the cells in which neighbours are looked for, wide enough that one is the rule.
    cell: f64,
    exact: HashMap<[u64; 3], u32>,
    cells: HashMap<[i64; 3], Vec<u32>>,
    points: Vec<[f64; 3]>,
}

impl Welder {
    fn new(reach: f64) -> Self {
        Self {
            reach,
            cell: 16.0 * reach,
            exact: HashMap::new(),
            cells: HashMap::new(),
            points: Vec::new(),
        }
    }

    fn name(&mut self, vertex: [f64; 3]) -> u32 {
        // Adding 0 turns -0 into 0.
        let bits = vertex.map(|c| (c + 0.0).to_bits());
        if let Some(name) = self.exact.get(&bits) {
            return *name;
        }
        let name = self.near(vertex).unwrap_or_else(|| {
            let next = self.points.len() as u32;
            self.points.push(vertex);
            if self.cell > 0.0 {
                let cell = vertex.map(|c| (c / self.cell).floor() as i64);
                self.cells.entry(cell).or_default().push(next);
            }
            next
        });
        self.exact.insert(bits, name);
        name
    }

    /// The first named point within reach.
    fn near(&self, vertex: [f64; 3]) -> Option<u32> {
        if self.cell <= 0.0 {
            return None;
        }
        // The casts saturate; coordinates over cells are below 2^32.
        let side = |offset: f64| vertex.map(|c| ((c + offset) / self.cell).floor() as i64);
        let (from, to) = (side(-self.reach), side(self.reach));
        let mut found: Option<u32> = None;
        for x in from[0]..=to[0] {
            for y in from[1]..=to[1] {
                for z in from[2]..=to[2] {
                    for name in self.cells.get(&[x, y, z]).into_iter().flatten() {
                        let there = self.points[*name as usize];
                        let close = (0..3).all(|k| (there[k] - vertex[k]).abs() <= self.reach);
                        if close {
                            found = Some(found.map_or(*name, |best| best.min(*name)));
                        }
                    }
                }
            }
        }
        found
    }
}
