//! STEP (AP203, AP214, AP242): the solid bodies of parts and assemblies, through OpenCASCADE.
//!
//! The kernel runs in a process of its own (`kernel`), where Python has it; this program links
//! nothing of it. What comes back is judged: there each facet against the exact face it stands for,
//! here (`gates`) whether the facets close the body and hold its volume.

mod gates;
mod kernel;

use std::sync::{Mutex, PoisonError};

use crate::assembly::{Affine, Body, Fineness, lay_out};
use crate::bodies::{BodyOptions, NamedBody};
use crate::file_mesh::{FileMesh, Triangle};
use crate::read_error::ReadError;
use fluxform_base::progress::Progress;

pub use kernel::{Kernel, STEP_SECONDS, configure};

/// The file read last: a picture, a report and points of one file need it once.
static LAST: Mutex<Option<(Vec<u8>, BodyOptions, FileMesh)>> = Mutex::new(None);

/// Reads a STEP file's bytes; coordinates are in its own unit.
///
/// # Errors
/// [`ReadError`]: no STEP file, no Python with OpenCASCADE, no solid body, one that does not pass a
/// gate, a limit of time or memory.
pub fn read(
    bytes: &[u8],
    options: &BodyOptions,
    progress: &dyn Progress,
) -> Result<FileMesh, ReadError> {
    if !bytes.trim_ascii_start().starts_with(b"ISO-10303-21") {
        let what = "this is not a STEP file: it does not begin with `ISO-10303-21`";
        return Err(ReadError::file(what));
    }
    let last = || LAST.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some((known, how, file)) = &*last()
        && known == bytes
        && how == options
    {
        return Ok(file.clone());
    }
    let file = kernel::mesh(bytes, options, progress)
        .and_then(|reply| laid_out(reply, options))
        .map_err(|what| ReadError::file(format!("the STEP file cannot be read: {what}")))?;
    *last() = Some((bytes.to_vec(), options.clone(), file.clone()));
    Ok(file)
}

/// The bodies of a reply in their places.
fn laid_out(reply: kernel::Reply, options: &BodyOptions) -> Result<FileMesh, String> {
    let unit = |length_mm: f64| length_mm / reply.unit_mm;
    let (bodies, mut parts) = (reply.bodies, reply.parts);
    if bodies.is_empty() {
        return Err("it holds no solid body; save one, not surfaces or drawings".into());
    }
    let mut judged = Judged {
        read_by: format!("OpenCASCADE (cadquery-ocp {})", reply.version),
        bodies: bodies.len(),
        loose: reply.loose,
        moved_roots: reply.moved_roots,
        invalid: reply.invalid,
        crossing: 0,
        deviation_mm: 0.0,
        asked_mm: (options.chord_m).map_or(reply.chord_mm, |chord_m| chord_m * 1e3),
    };
    for (index, part) in parts.iter_mut().enumerate() {
        let name = bodies.iter().find(|body| body.part == index);
        let verdict = gates::check(part).map_err(|what| {
            let name = name.map_or("", |body| &body.name);
            format!("body `{name}`: {what}; {}", kernel::ADVICE)
        })?;
        judged.crossing += verdict.crossings;
        judged.deviation_mm = judged.deviation_mm.max(part.deviation);
    }
    let placed: Vec<Body> = parts
        .into_iter()
        .map(|part| Body {
            triangles: part
                .triangles
                .into_iter()
                .map(|t| t.map(|v| v.map(unit)))
                .collect(),
            children: Vec::new(),
        })
        .collect();
    let roots: Vec<(usize, Affine)> = bodies
        .iter()
        .map(|body| {
            let rows = body.place.map(|[a, b, c, _]| [a, b, c]);
            let shift = body.place.map(|row| unit(row[3]));
            (body.part, Affine { rows, shift })
        })
        .collect();
    // How far its corners may lie from the exact body is measured, not inferred.
    let FileMesh { triangles, .. } = lay_out(&placed, &roots, Fineness::Doubles)?;
    let named = bodies.into_iter().map(|body| NamedBody {
        triangles: placed[body.part].triangles.len(),
        name: body.name,
        within: body.within,
        color: body.color,
    });
    let coordinates = triangles.as_flattened().as_flattened().iter();
    let largest = coordinates.fold(0.0, |m: f64, c| m.max(c.abs()));
    Ok(FileMesh {
        coordinate_rounding: 0.5 * gates::WELD * largest.max(longest_side(&triangles)),
        triangles,
        unit_m: Some(reply.unit_mm / 1e3),
        deviation: unit(judged.deviation_mm),
        deviation_is_known: true,
        warnings: judged.warnings(),
        bodies: named.collect(),
        read_by: Some(judged.read_by),
        ..FileMesh::default()
    })
}

/// What a file states of its bodies, and what the gates found of them.
struct Judged {
    read_by: String,
    bodies: usize,
    loose: usize,
    moved_roots: usize,
    invalid: usize,
    crossing: usize,
    deviation_mm: f64,
    asked_mm: f64,
}

impl Judged {
    fn warnings(&self) -> Vec<String> {
        let Self {
            read_by,
            bodies,
            loose,
            moved_roots,
            invalid,
            crossing,
            deviation_mm,
            asked_mm,
        } = self;
        let mut warnings = vec![format!(
            "{bodies} bodies were read by {read_by}, facets within {deviation_mm:.4} mm of their faces"
        )];
        if *loose > 0 {
            warnings.push(format!(
                "{loose} faces or shells that bound no body (drawings, dimensions, surfaces) are left out"
            ));
        }
        if *moved_roots > 0 {
            warnings.push(format!(
                "the file states {moved_roots} placements at its root that move nothing by the standard; \
                 a program that applies them puts the part elsewhere: compare where it lies"
            ));
        }
        if *invalid > 0 {
            warnings.push(format!(
                "{invalid} bodies do not pass OpenCASCADE's own check: compare volume and picture with the CAD \
                 program's"
            ));
        }
        if *crossing > 0 {
            warnings.push(format!(
                "{crossing} pairs of facets of one body pass through each other, though each lies on its \
                 face: the body itself does; the height is that of the upper one"
            ));
        }
        if deviation_mm > asked_mm {
            warnings.push(format!(
                "facets lie up to {deviation_mm:.4} mm from their faces, not {asked_mm:.4} mm: edges of \
                 the file lie beside its faces, or the mesher cannot do better; the larger number counts"
            ));
        }
        warnings
    }
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
