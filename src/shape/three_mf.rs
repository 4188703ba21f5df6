//! 3MF: meshes and components of an archive's model parts, placed by the build.
//!
//! Read: the core specification, and of the production extension components and items in other
//! parts. Materials, slices and properties change no surface and are passed over, and so are elements of
//! other namespaces; an extension
//! that the file requires and that is not known is refused, since it may change the surface.

use std::collections::{HashMap, HashSet};

use crate::archive::Archive;
use crate::assembly::{Affine, Body, Fineness, corner, counts, lay_out};
use crate::bodies::NamedBody;
use crate::document::parse_unit;
use crate::file_mesh::FileMesh;
use crate::number::Numbers;
use crate::read_error::{Place, ReadError};
use crate::xml::{Document, Element, Step};

/// More model parts than this belong to no surface.
const MOST_PARTS: usize = 1000;
/// A file that requires more extensions than this is none that a program wrote.
const MOST_EXTENSIONS: usize = 64;
/// Parts of the names of extensions that change no triangle.
const HARMLESS: [&str; 5] = [
    "/core/",
    "/production/",
    "/material/",
    "/slice/",
    "/trianglesets/",
];

/// True for an archive with a model part.
pub(crate) fn begins(bytes: &[u8]) -> bool {
    Archive::has(bytes, ".model")
}

/// Reads a 3MF file's bytes.
///
/// # Errors
/// [`ReadError`] with part and line.
pub fn read(bytes: &[u8]) -> Result<FileMesh, ReadError> {
    if !Archive::is(bytes) {
        let what = "this is not a 3MF file: it is not a ZIP archive; export it again";
        return Err(ReadError::file(what));
    }
    let mut archive = Archive::open(bytes)?;
    let root = root_part(&mut archive)?;
    let mut model = Model::default();
    model.part(&mut archive, &root)?;
    model.finish(&mut archive, &root)
}

/// The part that the package's relations name as the model.
fn root_part(archive: &mut Archive<'_>) -> Result<String, ReadError> {
    let mut target = None;
    if let Some(name) = archive.find("_rels/.rels") {
        let text = archive.text(&name)?;
        let mut document = Document::new(&name, &text);
        loop {
            fluxform_base::progress::poll();
            match document.step()? {
                Step::Start(e)
                    if e.name() == "Relationship"
                        && e.get("Type").is_some_and(|t| t.ends_with("/3dmodel")) =>
                {
                    target = target.or(e.get("Target").map(String::from));
                }
                Step::Done => break,
                _ => {}
            }
        }
    }
    let named = target.as_deref().unwrap_or("3D/3dmodel.model");
    archive.find(named).ok_or_else(|| {
        ReadError::file(format!(
            "this is not a whole 3MF file: its model part `{named}` is missing; export it again"
        ))
    })
}

/// An object's name: its part and its number there.
type Key = (String, u32);

/// Characters of an object's name that are reported: a file may place it a million times.
const LONGEST_NAME: usize = 60;

#[derive(Default)]
struct Model {
    unit: Option<String>,
    /// Name of every object, and where it is among the bodies.
    objects: HashMap<Key, usize>,
    bodies: Vec<Body>,
    /// Their names.
    names: Vec<String>,
    /// Components of every body, yet by name.
    components: Vec<Vec<(Key, Affine)>>,
    /// Items that the root part builds.
    items: Vec<(Key, Affine)>,
    supports: usize,
    numbers: Numbers,
    parts: HashSet<String>,
}

/// An object while it is read.
#[derive(Default)]
struct Open {
    id: u32,
    name: String,
    support: bool,
    vertices: Vec<[f64; 3]>,
    body: Body,
    components: Vec<(Key, Affine)>,
}

impl Model {
    fn part(&mut self, archive: &mut Archive<'_>, name: &str) -> Result<(), ReadError> {
        let is_root = self.parts.is_empty();
        if self.parts.len() >= MOST_PARTS {
            let what = format!("the file has more than {MOST_PARTS} model parts");
            return Err(ReadError::file(what));
        }
        self.parts.insert(name.to_owned());
        let text = archive.text(name)?;
        let mut document = Document::new(name, &text);
        let mut open: Option<Open> = None;
        loop {
            let step = document.step()?;
            let as_fault = |what: String| document.fault(what);
            match step {
                Step::Start(e) => match (e.name(), &mut open) {
                    ("beamlattice" | "volumetricstack" | "booleans", Some(_)) => {
                        let what = format!(
                            "an object is a `{}`, which is not read; export it as a mesh",
                            e.name()
                        );
                        return Err(as_fault(what));
                    }
                    // A vendor's own `vertex` would shift the numbers of all that follow.
                    _ if e.is_foreign() => {}
                    ("model", _) => self.begin(&e, is_root).map_err(as_fault)?,
                    ("object", None) => open = Some(object(&e).map_err(as_fault)?),
                    ("vertex", Some(object)) => {
                        let vertex = self.vertex(&e).map_err(as_fault)?;
                        object.vertices.push(vertex);
                    }
                    ("triangle", Some(object)) => triangle(&e, object).map_err(as_fault)?,
                    ("component", Some(object)) => {
                        let placed = placed(&e, name).map_err(as_fault)?;
                        object.components.push(placed);
                    }
                    ("item", None) if is_root => {
                        self.items.push(placed(&e, name).map_err(as_fault)?);
                    }
                    _ => {}
                },
                Step::End {
                    name: ended,
                    foreign: false,
                    ..
                } if ended == "object" => {
                    if let Some(object) = open.take() {
                        self.add(name, object).map_err(as_fault)?;
                    }
                }
                Step::End { .. } => {}
                Step::Done => return Ok(()),
            }
        }
    }

    fn begin(&mut self, model: &Element<'_>, is_root: bool) -> Result<(), String> {
        let unit = model.get_exact("unit").unwrap_or("millimeter".into());
        if is_root {
            self.unit = Some(unit.into_owned());
        } else if self.unit.as_deref() != Some(&unit) {
            return Err(format!(
                "this part is in `{unit}`, the root part in `{}`; export it in one unit",
                self.unit.as_deref().unwrap_or_default()
            ));
        }
        let required = model.get("requiredextensions").unwrap_or_default();
        if required.split_whitespace().count() > MOST_EXTENSIONS {
            return Err(format!(
                "the file requires more than {MOST_EXTENSIONS} extensions; export it as a plain mesh"
            ));
        }
        for prefix in required.split_whitespace() {
            let space = model
                .get_exact(&format!("xmlns:{prefix}"))
                .unwrap_or_default();
            if !HARMLESS.iter().any(|known| space.contains(known)) {
                return Err(format!(
                    "the file requires the extension `{prefix}` ({space}), which is not read; \
                     export it as a plain mesh"
                ));
            }
        }
        Ok(())
    }

    fn vertex(&mut self, e: &Element<'_>) -> Result<[f64; 3], String> {
        let mut vertex = [0.0; 3];
        for (value, name) in vertex.iter_mut().zip(["x", "y", "z"]) {
            let text = e
                .get_exact(name)
                .ok_or(format!("a vertex has no `{name}`"))?;
            *value = self.numbers.read(text.trim().as_bytes())?;
        }
        Ok(vertex)
    }

    fn add(&mut self, part: &str, object: Open) -> Result<(), String> {
        if object.support {
            self.supports += 1;
        }
        let key = (part.to_ascii_lowercase(), object.id);
        if self.objects.insert(key, self.bodies.len()).is_some() {
            return Err(format!("two objects have the id {}", object.id));
        }
        let mut body = object.body;
        if object.support {
            body.triangles.clear();
        }
        self.bodies.push(body);
        self.names.push(object.name);
        self.components.push(object.components);
        Ok(())
    }

    /// Reads the parts that components and items name, and lays everything out.
    fn finish(mut self, archive: &mut Archive<'_>, root: &str) -> Result<FileMesh, ReadError> {
        let mut roots = Vec::new();
        for (key, place) in std::mem::take(&mut self.items) {
            roots.push((self.resolve(archive, &key, root)?, place));
        }
        // Reading another part adds bodies at the end, which get their turn.
        let mut next = 0;
        while next < self.bodies.len() {
            for (key, place) in std::mem::take(&mut self.components[next]) {
                let child = self.resolve(archive, &key, root)?;
                self.bodies[next].children.push((child, place));
            }
            next += 1;
        }
        let fault = |what: String| ReadError::new(Place::Part(root.to_owned(), 0), what);
        let name = self.unit.unwrap_or_default();
        let unit_m = parse_unit(&name).ok_or_else(|| fault(unknown_unit(&name)))?;
        if roots.is_empty() {
            let what = "the 3MF file builds nothing: its `build` has no item; export it again";
            return Err(fault(what.into()));
        }
        let laid_out =
            lay_out(&self.bodies, &roots, Fineness::Printed(&self.numbers)).map_err(fault)?;
        if laid_out.triangles.is_empty() {
            let what = "the 3MF file's build has no triangle: export a body as a mesh";
            return Err(fault(what.into()));
        }
        let counts = counts(&self.bodies, &roots);
        let named = roots
            .iter()
            .zip(counts)
            .map(|((body, _), triangles)| NamedBody {
                name: self.names[*body].clone(),
                within: Vec::new(),
                color: None,
                triangles,
            });
        let mut warnings = Vec::new();
        if roots.len() > 1 {
            warnings.push(format!(
                "the file builds {} items; they are taken as one surface",
                roots.len()
            ));
        }
        if self.supports > 0 {
            warnings.push(format!(
                "{} objects are supports of printing and are left out",
                self.supports
            ));
        }
        Ok(FileMesh {
            unit_m: Some(unit_m),
            bodies: named.collect(),
            warnings,
            ..laid_out
        })
    }

    fn resolve(
        &mut self,
        archive: &mut Archive<'_>,
        key: &Key,
        root: &str,
    ) -> Result<usize, ReadError> {
        let (path, id) = key;
        let fault = |what: String| ReadError::new(Place::Part(root.to_owned(), 0), what);
        let part = archive
            .find(path)
            .ok_or_else(|| fault(format!("it names the part `{path}`, which is missing")))?;
        if !self.parts.contains(&part) {
            self.part(archive, &part)?;
        }
        let key = (part.to_ascii_lowercase(), *id);
        let found = self.objects.get(&key).copied();
        found.ok_or_else(|| {
            fault(format!(
                "it places object {id} of `{path}`, which is missing"
            ))
        })
    }
}

fn unknown_unit(name: &str) -> String {
    format!(
        "the unit `{name}` is unknown; expected micron, millimeter, centimeter, inch, foot or \
         meter"
    )
}

fn object(e: &Element<'_>) -> Result<Open, String> {
    let kind = e.get_exact("type").unwrap_or_default();
    let id = whole(e, "id")?;
    let name = e.get_exact("name").unwrap_or_default();
    Ok(Open {
        id,
        name: match name.trim() {
            "" => format!("object {id}"),
            name => name.chars().take(LONGEST_NAME).collect(),
        },
        support: matches!(&*kind, "support" | "solidsupport"),
        ..Open::default()
    })
}

fn triangle(e: &Element<'_>, object: &mut Open) -> Result<(), String> {
    let mut corners = [[0.0; 3]; 3];
    for (slot, name) in corners.iter_mut().zip(["v1", "v2", "v3"]) {
        *slot = corner(&object.vertices, whole(e, name)? as usize)?;
    }
    object.body.triangles.push(corners);
    Ok(())
}

/// The object that a component or an item places, and its transform.
fn placed(e: &Element<'_>, part: &str) -> Result<(Key, Affine), String> {
    let path = e.get("path").unwrap_or(part.into());
    let key = (path.into_owned(), whole(e, "objectid")?);
    let place = match e.get_exact("transform") {
        None => Affine::IDENTITY,
        Some(text) => transform(&text)?,
    };
    Ok((key, place))
}

/// Twelve numbers: the images of the three axes and of the origin.
pub(super) fn transform(text: &str) -> Result<Affine, String> {
    let words: Vec<f64> = text
        .split_whitespace()
        .map_while(|w| w.parse().ok().filter(|v: &f64| v.is_finite()))
        .collect();
    if words.len() != text.split_whitespace().count() || words.len() != 12 {
        let shown: String = text.chars().take(80).collect();
        return Err(format!(
            "a placement has twelve finite numbers; this one is `{shown}`"
        ));
    }
    let mut columns = [0.0; 12];
    columns.copy_from_slice(&words);
    Ok(Affine::from_columns(columns))
}

fn whole(e: &Element<'_>, name: &str) -> Result<u32, String> {
    let text = e
        .get_exact(name)
        .ok_or_else(|| format!("`{}` has no `{name}`", e.name()))?;
    text.trim().parse().map_err(|_| {
        let shown: String = text.chars().take(40).collect();
        format!("expected a whole number as `{name}`, found `{shown}`")
    })
}
