//! Native SOLIDWORKS parts and assemblies, experimental: the triangles that they show on the
//! screen.
//!
//! The format is not published; what is read here was found by looking at files. Everything is
//! verified (checksums, lengths, counts, the boxes of an assembly's parts), nothing is guessed: a
//! file that does not fit is refused. The body itself (a Parasolid) is not read, so the surface is
//! as coarse as its display.

mod compound;
mod container;
mod display;
mod product;

use self::compound::Compound;
use self::container::Blocks;
use self::display::Table;
use self::product::Product;
use crate::archive::text_of;
use crate::assembly::{Fineness, farthest};
use crate::file_mesh::{FileMesh, Triangle};
use crate::read_error::{Place, ReadError};
use crate::tessellation::face_deviation;

/// Advice on another way, for messages.
const ADVICE: &str = "open it in SOLIDWORKS and save the body as STEP, STL (binary, fine \
                      resolution) or 3MF";
/// The stream with what is shown.
const DISPLAY: &str = "Contents/DisplayLists";
/// The document of an assembly's parts.
const TREE: &str = "swXmlContents/COMPINSTANCETREE";

/// The two containers of SOLIDWORKS files.
enum Container<'a> {
    Blocks(Blocks<'a>),
    Compound(Box<Compound<'a>>),
}

impl<'a> Container<'a> {
    fn open(bytes: &'a [u8]) -> Result<Self, ReadError> {
        if Compound::is(bytes) {
            return Ok(Self::Compound(Box::new(Compound::open(bytes)?)));
        }
        if !Blocks::is(bytes) {
            let what = format!("this is not a SOLIDWORKS file (its sign is missing): {ADVICE}");
            return Err(ReadError::new(Place::Byte(4), what));
        }
        Ok(Self::Blocks(Blocks::open(bytes)?))
    }

    fn stream(&mut self, name: &str) -> Result<Option<Vec<u8>>, ReadError> {
        match self {
            Self::Blocks(blocks) => blocks.stream(name),
            Self::Compound(compound) => compound.stream(name),
        }
    }
}

/// True for bytes that begin as a SOLIDWORKS file does.
pub(crate) fn begins(bytes: &[u8]) -> bool {
    Blocks::is(bytes) || Compound::is(bytes)
}

/// Reads a part's or an assembly's bytes; coordinates are in metres.
///
/// # Errors
/// [`ReadError`]: no or incomplete display data, or bytes that do not verify.
pub fn read(bytes: &[u8]) -> Result<FileMesh, ReadError> {
    let mut container = Container::open(bytes)?;
    let product = match container.stream(TREE) {
        Ok(Some(tree)) => product(&tree)?,
        // Of a part this document is of no use.
        Ok(None) | Err(_) => None,
    };
    let stream = container.stream(DISPLAY)?.ok_or_else(|| {
        ReadError::file(format!(
            "this SOLIDWORKS file holds no display data (`{DISPLAY}`): {ADVICE}"
        ))
    })?;
    let tables = display::tables(&stream);
    if tables.is_empty() {
        return Err(ReadError::file(format!(
            "the display data hold no face (a file of sketches alone, or one saved without display \
             or of a newer kind): {ADVICE}"
        )));
    }
    let deviation = deviation(&stream, &tables)?;
    let mut warnings = vec![format!(
        "reading SOLIDWORKS files is experimental: the surface is the display mesh, which may lie \
         about {:.3} mm from the body (an estimate, from the angles between the facets of each \
         face); compare with a STEP, STL or 3MF file of the same part",
        deviation * 1000.0
    )];
    let laid_out = match product {
        None => {
            let mut triangles = Vec::new();
            for table in &tables {
                table.read(&stream, &mut triangles)?;
            }
            FileMesh {
                coordinate_rounding: Fineness::Floats.rounding(farthest(&triangles)),
                triangles,
                ..FileMesh::default()
            }
        }
        Some(product) => {
            let (laid_out, hidden) = product.lay_out(&stream, &tables)?;
            if hidden > 0 {
                warnings.push(format!(
                    "{hidden} hidden or suppressed components of the assembly are left out"
                ));
            }
            laid_out
        }
    };
    if laid_out.triangles.is_empty() {
        let what = format!("every component of the assembly is hidden or suppressed: {ADVICE}");
        return Err(ReadError::file(what));
    }
    Ok(FileMesh {
        unit_m: Some(1.0),
        // Of plane faces nothing but the rounding is left.
        deviation: deviation.max(laid_out.coordinate_rounding),
        deviation_is_known: false,
        warnings,
        ..laid_out
    })
}

fn product(tree: &[u8]) -> Result<Option<Product>, ReadError> {
    let fault = |what: String| ReadError::new(Place::Part(TREE.into(), 0), what);
    let start = tree.windows(5).position(|w| w == b"<?xml").unwrap_or(0);
    let text = tree[start..].trim_ascii_end();
    let end = text.iter().rposition(|b| *b == b'>').map_or(0, |k| k + 1);
    if end == 0 {
        return Ok(None);
    }
    Product::read(&text_of(text[..end].to_vec()).map_err(fault)?)
}

/// How far the facets may lie from the body: all triangles of a table are of one smooth face.
fn deviation(stream: &[u8], tables: &[Table]) -> Result<f64, ReadError> {
    let mut most = 0.0_f64;
    let mut face = Vec::new();
    for table in tables {
        face.clear();
        table.read(stream, &mut face)?;
        most = most.max(face_deviation(&face));
    }
    Ok(most)
}

/// Lower and upper corner.
fn box_of(triangles: &[Triangle]) -> [[f64; 3]; 2] {
    let mut bounds = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
    for vertex in triangles.as_flattened() {
        for k in 0..3 {
            bounds[0][k] = bounds[0][k].min(vertex[k]);
            bounds[1][k] = bounds[1][k].max(vertex[k]);
        }
    }
    bounds
}
