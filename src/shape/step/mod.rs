//! STEP (AP203, AP214, AP242): parts through the `monstertruck` crates, behind gates.
//!
//! That reader is young and at times wrong without saying so. So units and the number of bodies
//! are read here from the text, every shell is meshed twice and passes `gates` or the file is
//! refused: nothing is believed because it was returned.

mod gates;
mod references;
mod units;

use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicUsize, Ordering};

use monstertruck_io::step::load::Table;
use monstertruck_meshing::prelude::*;

use crate::assembly::{Affine, Body, lay_out};
use crate::mesh::{FileMesh, Triangle};
use crate::read_error::ReadError;
use fluxform_base::progress::pass_interruption;

/// Readings under way whose panics are caught and told as faults of the file.
static GUARDED: AtomicUsize = AtomicUsize::new(0);

/// True while a panic would be caught: nothing need be said of it.
#[must_use]
pub fn guards_panics() -> bool {
    GUARDED.load(Ordering::SeqCst) > 0
}

/// Chord tolerance of the coarse mesh against the body's size; the fine one's is a quarter.
const CHORD: f64 = 1e-3;
/// Vertices of neighbouring faces agree to this, against the body's size.
const WELD: f64 = 1e-7;

const ADVICE: &str = "save the body as 3MF or STL in the CAD program, or convert it with \
                      scripts/step_to_stl.py, which uses OpenCASCADE";

/// Reads a STEP file's bytes; coordinates are in its own unit.
///
/// # Errors
/// [`ReadError`]: no STEP file, no solid body, or one that does not pass a gate.
pub fn read(bytes: &[u8]) -> Result<FileMesh, ReadError> {
    if !bytes.trim_ascii_start().starts_with(b"ISO-10303-21") {
        let what = "this is not a STEP file: it does not begin with `ISO-10303-21`";
        return Err(ReadError::file(what));
    }
    guarded(|| solids(bytes)).map_err(|what| {
        ReadError::file(format!(
            "the STEP file cannot be read safely: {what}; {ADVICE}"
        ))
    })
}

/// The result of `work`, or of its panic: the crates state no freedom from panics on damaged files.
fn guarded<T>(work: impl FnOnce() -> Result<T, String>) -> Result<T, String> {
    GUARDED.fetch_add(1, Ordering::SeqCst);
    let caught = catch_unwind(AssertUnwindSafe(work));
    GUARDED.fetch_sub(1, Ordering::SeqCst);
    caught.unwrap_or_else(|panic| {
        pass_interruption(&*panic);
        Err("its reader stopped on an entity that is damaged or beyond it".into())
    })
}

fn solids(bytes: &[u8]) -> Result<FileMesh, String> {
    let text = String::from_utf8_lossy(bytes);
    let stated = units::Statements::of(&text);
    if stated.solids == 0 {
        return Err("it holds no solid body".into());
    }
    // On a real assembly the crates' placements were wrong, and volume and topology cannot tell.
    if stated.placed {
        return Err("it is an assembly, whose placements are not read".into());
    }
    if stated.others > 0 {
        return Err("beside solid bodies it holds others, which are not read".into());
    }
    references::check(&text)?;
    let unit_m = stated.unit_m()?;
    let table = Table::from_step_bytes(bytes).map_err(|error| error.to_string())?;
    let mut ids: BTreeMap<u64, usize> = BTreeMap::new();
    for id in table.manifold_solid_brep.keys() {
        ids.insert(*id, 0);
    }
    if ids.len() != stated.solids {
        return Err(format!(
            "{} of its {} bodies were understood",
            ids.len(),
            stated.solids
        ));
    }
    let mut bodies = Vec::new();
    let mut deviation = 0.0f64;
    for (id, index) in &mut ids {
        *index = bodies.len();
        let (triangles, chord) =
            solid(&table, *id).map_err(|what| format!("body #{id}: {what}"))?;
        deviation = deviation.max(chord);
        bodies.push(Body {
            triangles,
            children: Vec::new(),
        });
    }
    let roots: Vec<(usize, Affine)> = ids
        .values()
        .map(|index| (*index, Affine::IDENTITY))
        .collect();
    let triangles = lay_out(&bodies, &roots)?;
    let coordinates = triangles.as_flattened().as_flattened().iter();
    let largest = coordinates.fold(0.0, |m: f64, c| m.max(c.abs()));
    Ok(FileMesh {
        coordinate_rounding: 0.5 * WELD * largest.max(longest_side(&triangles)),
        triangles,
        unit_m: Some(unit_m),
        deviation,
        deviation_is_known: true,
        warnings: vec![format!(
            "reading STEP is experimental: {} bodies passed every check, meshed to a chord \
             of {:.4} mm; compare with another export of the same part",
            roots.len(),
            deviation * unit_m * 1000.0
        )],
    })
}

/// The longest side of the box around the triangles.
fn longest_side(triangles: &[Triangle]) -> f64 {
    let side = |k: usize| {
        let values = triangles.iter().flatten().map(|vertex| vertex[k]);
        let ends = values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], c| {
            [low.min(c), high.max(c)]
        });
        ends[1] - ends[0]
    };
    (0..3).map(side).fold(0.0, f64::max)
}

/// The triangles of one solid, gated, and their chord tolerance.
fn solid(table: &Table, id: u64) -> Result<(Vec<Triangle>, f64), String> {
    let holder = &table.manifold_solid_brep[&id];
    let (solid, reports) = table
        .to_compressed_solid_reported(holder)
        .map_err(|error| error.to_string())?;
    for report in &reports {
        report
            .require_lossless()
            .map_err(|error| error.to_string())?;
    }
    if solid.boundaries.is_empty() {
        return Err("it has no shell".into());
    }
    let mut all = Vec::new();
    let mut worst = 0.0f64;
    for shell in &solid.boundaries {
        let vertices: Vec<[f64; 3]> = shell.vertices.iter().map(|p| [p.x, p.y, p.z]).collect();
        let loops: usize = shell.faces.iter().map(|face| face.boundaries.len()).sum();
        let count = |n: usize| i64::try_from(n).unwrap_or(i64::MAX);
        let faces = count(shell.faces.len());
        let stated = gates::Stated {
            euler: count(vertices.len()) - count(shell.edges.len()) + 2 * faces - count(loops),
            vertices,
        };
        let mesh = |chord: f64| -> Result<Vec<Triangle>, String> {
            let meshed = shell.robust_triangulation(chord);
            if meshed.faces.iter().any(|face| face.surface.is_none()) {
                return Err("a face could not be meshed".into());
            }
            let polygons = meshed.to_polygon();
            let points = polygons.positions();
            let corner = |v: StandardVertex| {
                let p = points[v.pos];
                [p.x, p.y, p.z]
            };
            Ok(polygons
                .faces()
                .triangle_iter()
                .map(|t| t.map(corner))
                .collect())
        };
        // A mesh for its size alone: vertices do not tell it, a sphere may have one.
        let rough = extent(&stated.vertices).max(f64::MIN_POSITIVE);
        let size = extent(mesh(CHORD * rough.max(1e-3))?.as_flattened());
        if !is_extent(size) {
            return Err("it has no extent".into());
        }
        let chords = [CHORD * size, 0.25 * CHORD * size];
        let meshed = gates::Meshed {
            coarse: (chords[0], mesh(chords[0])?),
            fine: (chords[1], mesh(chords[1])?),
            weld: WELD * size,
        };
        gates::check(&stated, &meshed)?;
        worst = worst.max(chords[1]);
        all.extend(meshed.fine.1);
    }
    Ok((all, worst))
}

/// Whether chords can be taken from a body of this diagonal.
fn is_extent(size: f64) -> bool {
    size > 0.0 && size.is_finite()
}

/// The diagonal of the points' box; 0 without points.
fn extent(points: &[[f64; 3]]) -> f64 {
    let (mut min, mut max) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for point in points {
        for k in 0..3 {
            min[k] = min[k].min(point[k]);
            max[k] = max[k].max(point[k]);
        }
    }
    let square: f64 = (0..3).map(|k| (max[k] - min[k]).max(0.0).powi(2)).sum();
    square.sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_guarded_panic_is_told_as_a_fault_of_the_file() {
        let said = guarded(|| -> Result<(), String> {
            assert!(guards_panics());
            // Unwinds like a panic, without its words on the screen.
            std::panic::resume_unwind(Box::new(()))
        });
        assert!(said.unwrap_err().contains("damaged or beyond it"));
        assert_eq!(guarded(|| Ok(guards_panics())), Ok(true));
    }

    #[test]
    fn no_points_one_point_and_points_without_end_have_no_extent() {
        let far = f64::INFINITY;
        for points in [
            vec![],
            vec![[0.7, -1.3, 2.9]; 3],
            vec![[0.7, 0.0, 0.0], [far, 0.0, 0.0]],
        ] {
            assert!(!is_extent(extent(&points)), "{points:?}");
        }
        // A box of 2, 3 and 6 has the diagonal 7.
        let corners = [[1.0, 2.0, 5.0], [-1.0, 2.5, -1.0], [0.3, -0.5, 0.7]];
        assert!((extent(&corners) - 7.0).abs() < 1e-15 && is_extent(7.0));
    }
}
