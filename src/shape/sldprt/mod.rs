//! Native SOLIDWORKS parts, experimental: the triangles that the part shows on the screen.
//!
//! The format is not published; what is read here was found by looking at files. Everything is
//! verified (checksums, lengths, counts), nothing is guessed: a part that does not fit is refused.
//! The body itself (a Parasolid) is not read, so the surface is as coarse as its display.

mod container;
mod display;

use crate::mesh::{FileMesh, Triangle};
use crate::number::F32_ROUNDING;
use crate::read_error::ReadError;

/// What to do instead, for messages.
const ADVICE: &str = "open it in SOLIDWORKS and save the body as STL (binary, fine resolution) \
                      or 3MF";
/// The stream with what is shown.
const DISPLAY: &str = "Contents/DisplayLists";

/// Reads a part's bytes; coordinates are in metres.
///
/// # Errors
/// [`ReadError`]: a part saved before 2015, an assembly, a part without display data, or bytes
/// that do not verify.
pub fn read(bytes: &[u8]) -> Result<FileMesh, ReadError> {
    if bytes.starts_with(b"\xd0\xcf\x11\xe0") {
        return Err(ReadError::file(format!(
            "this is an OLE document, as SOLIDWORKS wrote up to 2014; such parts are not read: \
             {ADVICE}"
        )));
    }
    let blocks = container::blocks(bytes)?;
    let names = || blocks.iter().map(|block| block.name.as_str());
    // What only assemblies and drawings hold.
    if names().any(|name| name.starts_with("Contents/Components") || name.contains("CompInst")) {
        return Err(ReadError::file(format!(
            "this is an assembly, not a part: {ADVICE}"
        )));
    }
    let block = blocks.iter().find(|block| block.name == DISPLAY);
    let block = block.ok_or_else(|| {
        ReadError::file(format!(
            "this SOLIDWORKS file holds no display data (`{DISPLAY}`): {ADVICE}"
        ))
    })?;
    let stream = block.unpack(bytes)?;
    let triangles = display::triangles(&stream)?;
    if triangles.is_empty() {
        return Err(ReadError::file(format!(
            "the part's display data hold no face (a part saved without display, or of a newer \
             kind): {ADVICE}"
        )));
    }
    let (largest, deviation) = (largest(&triangles), deviation(&triangles));
    let warnings = vec![format!(
        "reading SOLIDWORKS parts is experimental: the surface is the part's display mesh, which \
         may lie up to about {:.3} mm from the body (an estimate for the coarsest setting of the \
         image quality); compare with a STL or 3MF file of the same part",
        deviation * 1000.0
    )];
    Ok(FileMesh {
        triangles,
        coordinate_rounding: largest * F32_ROUNDING,
        unit_m: Some(1.0),
        deviation,
        deviation_is_known: false,
        warnings,
        ..FileMesh::default()
    })
}

fn largest(triangles: &[Triangle]) -> f64 {
    let coordinates = triangles.as_flattened().as_flattened().iter();
    coordinates.fold(0.0, |m: f64, c| m.max(c.abs()))
}

/// The display's deviation is about 0.025 2 d / (6 + 1.6 Q), d being the diagonal of the box and
/// Q the image quality in per cent. Q is not known here, so it is taken as 0.
fn deviation(triangles: &[Triangle]) -> f64 {
    let (mut min, mut max) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for vertex in triangles.as_flattened() {
        for k in 0..3 {
            min[k] = min[k].min(vertex[k]);
            max[k] = max[k].max(vertex[k]);
        }
    }
    let square: f64 = (0..3).map(|k| (max[k] - min[k]).powi(2)).sum();
    0.025 * 2.0 * square.sqrt() / 6.0
}
