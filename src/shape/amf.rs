//! AMF: XML, as it is or zipped; objects with their volumes, and constellations that place them.

use std::collections::HashMap;

use crate::archive::{Archive, text_of};
use crate::assembly::{Affine, Body, Fineness, corner, lay_out};
use crate::document::parse_unit;
use crate::file_mesh::FileMesh;
use crate::number::Numbers;
use crate::placement::sin_cos_deg;
use crate::read_error::ReadError;
use crate::xml::{Document, Element, Step};

/// True for XML whose first element is `amf`, zipped or not.
pub(crate) fn begins(bytes: &[u8]) -> bool {
    let head = &bytes[..bytes.len().min(1024)];
    Archive::has(bytes, ".amf") || head.windows(4).any(|w| w == b"<amf")
}

/// Reads an AMF file's bytes. Without a unit it is in millimetres.
///
/// # Errors
/// [`ReadError`] with the line.
pub fn read(bytes: &[u8]) -> Result<FileMesh, ReadError> {
    if !Archive::is(bytes) {
        let text = text_of(bytes.to_vec()).map_err(ReadError::file)?;
        return Reader::default().read("", &text);
    }
    let mut archive = Archive::open(bytes)?;
    let is_amf = |name: &String| name.to_ascii_lowercase().ends_with(".amf");
    let part = archive.names().find(is_amf);
    let part = part.ok_or_else(|| ReadError::file("the ZIP archive holds no AMF part"))?;
    let text = archive.text(&part)?;
    Reader::default().read(&part, &text)
}

#[derive(Default)]
struct Reader {
    unit: Option<String>,
    numbers: Numbers,
    /// Objects and constellations by their ids.
    ids: HashMap<String, usize>,
    bodies: Vec<Body>,
    /// Placements of every body, still by id.
    instances: Vec<Vec<(String, Affine)>>,
    vertices: Vec<[f64; 3]>,
    vertex: [Option<f64>; 3],
    corners: [Option<usize>; 3],
    support: bool,
    supports: usize,
    curved: bool,
    placed: Placed,
}

/// An instance being read.
#[derive(Default)]
struct Placed {
    id: String,
    shift: [f64; 3],
    turn_deg: [f64; 3],
}

impl Reader {
    fn read(mut self, part: &str, text: &str) -> Result<FileMesh, ReadError> {
        let mut document = Document::new(part, text);
        let mut any = false;
        loop {
            fluxform_base::progress::poll();
            let step = document.step()?;
            match step {
                Step::Start(e) => {
                    if !any && e.name() != "amf" {
                        let what = format!("this is not an AMF file but XML of `{}`", e.name());
                        return Err(document.fault(what));
                    }
                    any = true;
                    self.begin(&e).map_err(|what| document.fault(what))?;
                }
                Step::End { name, text, .. } => {
                    self.end(&name, text.trim())
                        .map_err(|what| document.fault(what))?;
                }
                Step::Done if any => return self.finish().map_err(ReadError::file),
                Step::Done => return Err(ReadError::file("this is not an AMF file: no XML")),
            }
        }
    }

    fn begin(&mut self, e: &Element<'_>) -> Result<(), String> {
        match e.name() {
            "amf" => self.unit = e.get_exact("unit").map(|unit| unit.to_ascii_lowercase()),
            "object" | "constellation" => {
                let id = e.get_exact("id").unwrap_or_default().into_owned();
                if self.ids.insert(id.clone(), self.bodies.len()).is_some() {
                    return Err(format!("two objects have the id `{id}`"));
                }
                self.bodies.push(Body::default());
                self.instances.push(Vec::new());
                self.vertices.clear();
            }
            "instance" => {
                let id = e.get_exact("objectid").unwrap_or_default().into_owned();
                self.placed = Placed {
                    id,
                    ..Placed::default()
                };
            }
            "vertex" => self.vertex = [None; 3],
            "triangle" => self.corners = [None; 3],
            "volume" => {
                self.support = e.get_exact("type").is_some_and(|kind| kind == "support");
                self.supports += usize::from(self.support);
            }
            "normal" | "edge" => self.curved = true,
            _ => {}
        }
        Ok(())
    }

    fn end(&mut self, name: &str, text: &str) -> Result<(), String> {
        match name {
            "x" => self.vertex[0] = Some(self.numbers.read(text.as_bytes())?),
            "y" => self.vertex[1] = Some(self.numbers.read(text.as_bytes())?),
            "z" => self.vertex[2] = Some(self.numbers.read(text.as_bytes())?),
            "vertex" => match self.vertex {
                [Some(x), Some(y), Some(z)] => self.vertices.push([x, y, z]),
                _ => return Err("a vertex lacks one of x, y and z".into()),
            },
            "v1" => self.corners[0] = Some(index(text)?),
            "v2" => self.corners[1] = Some(index(text)?),
            "v3" => self.corners[2] = Some(index(text)?),
            "triangle" => self.triangle()?,
            "deltax" => self.placed.shift[0] = number(text)?,
            "deltay" => self.placed.shift[1] = number(text)?,
            "deltaz" => self.placed.shift[2] = number(text)?,
            "rx" => self.placed.turn_deg[0] = number(text)?,
            "ry" => self.placed.turn_deg[1] = number(text)?,
            "rz" => self.placed.turn_deg[2] = number(text)?,
            "instance" => {
                let Placed {
                    id,
                    shift,
                    turn_deg,
                } = std::mem::take(&mut self.placed);
                if let Some(within) = self.instances.last_mut() {
                    within.push((id, turned(turn_deg, shift)));
                }
            }
            _ => {}
        }
        Ok(())
    }

    fn triangle(&mut self) -> Result<(), String> {
        let [Some(a), Some(b), Some(c)] = self.corners else {
            return Err("a triangle lacks one of v1, v2 and v3".into());
        };
        let mut corners = [[0.0; 3]; 3];
        for (slot, index) in corners.iter_mut().zip([a, b, c]) {
            *slot = corner(&self.vertices, index)?;
        }
        if let (false, Some(body)) = (self.support, self.bodies.last_mut()) {
            body.triangles.push(corners);
        }
        Ok(())
    }

    fn finish(mut self) -> Result<FileMesh, String> {
        let mut is_child = vec![false; self.bodies.len()];
        for (body, instances) in self.bodies.iter_mut().zip(self.instances) {
            for (id, place) in instances {
                let child = *self
                    .ids
                    .get(&id)
                    .ok_or_else(|| format!("a constellation places `{id}`, which is missing"))?;
                is_child[child] = true;
                body.children.push((child, place));
            }
        }
        // A body that nothing places is read where it is.
        let roots: Vec<(usize, Affine)> = (0..self.bodies.len())
            .filter(|k| !is_child[*k])
            .map(|k| (k, Affine::IDENTITY))
            .collect();
        let laid_out = lay_out(&self.bodies, &roots, Fineness::Printed(&self.numbers))?;
        if laid_out.triangles.is_empty() {
            return Err("the AMF file holds no triangle: export a body".into());
        }
        let unit = self.unit.unwrap_or_else(|| "millimeter".into());
        let unit_m = parse_unit(unit.trim_end_matches('s')).or(match unit.as_str() {
            "feet" => Some(0.3048),
            "inches" => Some(0.0254),
            _ => None,
        });
        let unit_m = unit_m.ok_or_else(|| {
            format!(
                "the unit `{unit}` is unknown; expected millimeter, inch, feet, meter or micron"
            )
        })?;
        let mut warnings = Vec::new();
        if self.curved {
            warnings.push(
                "the file bends its triangles by normals or edges; they are read as flat".into(),
            );
        }
        if self.supports > 0 {
            warnings.push(format!(
                "{} volumes are supports of printing and are left out",
                self.supports
            ));
        }
        Ok(FileMesh {
            unit_m: Some(unit_m),
            warnings,
            ..laid_out
        })
    }
}

/// Turned about x, then y, then z, then shifted.
fn turned(turn_deg: [f64; 3], shift: [f64; 3]) -> Affine {
    let [(sx, cx), (sy, cy), (sz, cz)] = turn_deg.map(sin_cos_deg);
    let rows = |rows| Affine {
        rows,
        shift: [0.0; 3],
    };
    let x = rows([[1.0, 0.0, 0.0], [0.0, cx, -sx], [0.0, sx, cx]]);
    let y = rows([[cy, 0.0, sy], [0.0, 1.0, 0.0], [-sy, 0.0, cy]]);
    let z = rows([[cz, -sz, 0.0], [sz, cz, 0.0], [0.0, 0.0, 1.0]]);
    Affine {
        shift,
        ..z.after(&y).after(&x)
    }
}

fn number(text: &str) -> Result<f64, String> {
    Numbers::default().read(text.as_bytes())
}

fn index(text: &str) -> Result<usize, String> {
    text.parse().map_err(|_| {
        let shown: String = text.chars().take(40).collect();
        format!("expected an index, found `{shown}`")
    })
}
