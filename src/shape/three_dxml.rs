//! 3DXML: the tessellated bodies of a Dassault product, placed by its structure; millimetres.
//!
//! A zipped XML file. Its `Manifest.xml` names the document with the structure, whose references
//! and instances form a tree; representations lie in parts of their own. Only tessellations in
//! XML are read, not Dassault's binary representations. An instance of what lies in another document
//! is refused.

use std::collections::HashMap;

use crate::archive::Archive;
use crate::assembly::{Affine, Body, Fineness, corner, lay_out};
use crate::file_mesh::{FileMesh, Triangle};
use crate::number::Numbers;
use crate::read_error::{Place, ReadError};
use crate::three_mf::transform;
use crate::xml::{Document, Element, Step};

/// True for an archive with Dassault's manifest.
pub(crate) fn begins(bytes: &[u8]) -> bool {
    Archive::has(bytes, "manifest.xml")
}

/// Reads a 3DXML file's bytes.
///
/// # Errors
/// [`ReadError`] with part and line.
pub fn read(bytes: &[u8]) -> Result<FileMesh, ReadError> {
    if !Archive::is(bytes) {
        let what = "this 3DXML file is not a ZIP archive; only zipped ones are read: save it again \
                    from the CAD program, or export the body as 3MF or STL";
        return Err(ReadError::file(what));
    }
    let mut archive = Archive::open(bytes)?;
    let root = root_part(&mut archive)?;
    let text = archive.text(&root)?;
    let structure = Structure::read(&root, &text)?;
    structure.lay_out(&mut archive, &root)
}

/// The document that the manifest names.
fn root_part(archive: &mut Archive<'_>) -> Result<String, ReadError> {
    let missing = || ReadError::file("this is not a whole 3DXML file: its document is missing");
    let manifest = archive.find("Manifest.xml").ok_or_else(missing)?;
    let text = archive.text(&manifest)?;
    let mut document = Document::new(&manifest, &text);
    loop {
        match document.step()? {
            Step::End { name, text, .. } if name == "Root" => {
                return archive.find(text.trim()).ok_or_else(missing);
            }
            Step::Done => return Err(missing()),
            _ => {}
        }
    }
}

/// An instance: what holds it, what it is of, and where.
#[derive(Default)]
struct Instance {
    within: Option<u64>,
    of: Option<u64>,
    place: Option<Affine>,
}

#[derive(Default)]
struct Structure {
    root: Option<u64>,
    references: Vec<u64>,
    /// Representations: the part's name, or why it cannot be read.
    representations: HashMap<u64, Result<String, String>>,
    instances: Vec<Instance>,
}

impl Structure {
    fn read(part: &str, text: &str) -> Result<Self, ReadError> {
        let mut found = Self::default();
        let mut open = Instance::default();
        let mut document = Document::new(part, text);
        loop {
            fluxform_base::progress::poll();
            let step = document.step()?;
            let as_fault = |what: String| document.fault(what);
            match step {
                Step::Start(e) => match e.name() {
                    "ProductStructure" => {
                        found.root = e.get_exact("root").and_then(|id| last_number(&id));
                    }
                    "Reference3D" => found.references.push(id(&e).map_err(as_fault)?),
                    "ReferenceRep" => {
                        let representation = representation(&e);
                        let id = id(&e).map_err(as_fault)?;
                        found.representations.insert(id, representation);
                    }
                    "Instance3D" | "InstanceRep" => open = Instance::default(),
                    _ => {}
                },
                Step::End { name, text, .. } => match name.as_str() {
                    "IsAggregatedBy" => open.within = reference(&text, part).map_err(as_fault)?,
                    "IsInstanceOf" => open.of = reference(&text, part).map_err(as_fault)?,
                    "RelativeMatrix" => open.place = Some(transform(&text).map_err(as_fault)?),
                    "Instance3D" | "InstanceRep" => {
                        found.instances.push(std::mem::take(&mut open));
                    }
                    _ => {}
                },
                Step::Done => return Ok(found),
            }
        }
    }

    fn lay_out(self, archive: &mut Archive<'_>, part: &str) -> Result<FileMesh, ReadError> {
        let fault = |what: String| ReadError::new(Place::Part(part.to_owned(), 0), what);
        let mut numbers = Numbers::default();
        let mut bodies = vec![Body::default(); self.references.len()];
        let mut index: HashMap<u64, usize> = HashMap::new();
        let twice = |id: &u64| fault(format!("two objects have the id {id}"));
        for (body, id) in self.references.iter().enumerate() {
            if index.insert(*id, body).is_some() {
                return Err(twice(id));
            }
        }
        let mut names: Vec<(&u64, &Result<String, String>)> = self.representations.iter().collect();
        names.sort_by_key(|(id, _)| **id);
        for (id, name) in names {
            let name = name.as_ref().map_err(|what| fault(what.clone()))?;
            let found = archive
                .find(name)
                .ok_or_else(|| fault(format!("it names the part `{name}`, which is missing")))?;
            let text = archive.text(&found)?;
            if index.insert(*id, bodies.len()).is_some() {
                return Err(twice(id));
            }
            bodies.push(Body {
                triangles: representation_mesh(&found, &text, &mut numbers)?,
                children: Vec::new(),
            });
        }
        for instance in self.instances {
            let body = |id: Option<u64>| id.and_then(|id| index.get(&id).copied());
            let (Some(within), Some(of)) = (body(instance.within), body(instance.of)) else {
                let what = "an instance names a reference that is missing";
                return Err(fault(what.into()));
            };
            let place = instance.place.unwrap_or(Affine::IDENTITY);
            bodies[within].children.push((of, place));
        }
        let root = self.root.or(self.references.first().copied());
        let root = root
            .and_then(|id| index.get(&id).copied())
            .ok_or_else(|| fault("the product has no root reference".into()))?;
        let roots = [(root, Affine::IDENTITY)];
        let laid_out = lay_out(&bodies, &roots, Fineness::Printed(&numbers)).map_err(fault)?;
        if laid_out.triangles.is_empty() {
            let what =
                "the 3DXML file holds no tessellated triangle; export the body as 3MF or STL";
            return Err(fault(what.into()));
        }
        Ok(FileMesh {
            unit_m: Some(1e-3),
            ..laid_out
        })
    }
}

fn id(e: &Element<'_>) -> Result<u64, String> {
    let id = e.get_exact("id").and_then(|id| last_number(&id));
    id.ok_or_else(|| format!("`{}` has no id", e.name()))
}

/// The id that an instance in the document `part` names. The same number in another document is
/// another object, so that document must be this one.
fn reference(text: &str, part: &str) -> Result<Option<u64>, String> {
    let last = |path: &str| {
        path.rsplit([':', '/'])
            .next()
            .unwrap_or_default()
            .to_owned()
    };
    let elsewhere = match text.split_once('#') {
        Some((document, _)) => {
            let document = last(document);
            !document.is_empty() && !document.eq_ignore_ascii_case(&last(part))
        }
        None => text.contains(":ext:"),
    };
    if elsewhere {
        return Err(format!(
            "an instance is of `{text:.80}`, which lies in another document; only the product's own is \
             read: export the product with all its parts in one, or as 3MF or STL"
        ));
    }
    Ok(last_number(text))
}

/// `7`, `urn:3DXML:Reference:loc:7` and `urn:3DXML:part.3dxml#7` all mean 7.
fn last_number(text: &str) -> Option<u64> {
    let text = text.trim();
    let digits = text.len() - text.trim_end_matches(|c: char| c.is_ascii_digit()).len();
    text[text.len() - digits..].parse().ok()
}

fn representation(e: &Element<'_>) -> Result<String, String> {
    let file = e.get_exact("associatedFile").unwrap_or_default();
    let format = e.get_exact("format").unwrap_or_default();
    let name = file.rsplit(':').next().unwrap_or_default();
    if format.eq_ignore_ascii_case("TESSELLATED") && !name.is_empty() {
        Ok(name.to_owned())
    } else {
        Err(format!(
            "a body is stored as `{format}`, which is not read, only tessellations in XML are; \
             export it as 3MF or STL"
        ))
    }
}

/// A representation while it is read: bags hold others.
#[derive(Default)]
struct Rep {
    positions: Option<Vec<[f64; 3]>>,
    /// Indices of triangles, three by three.
    corners: Vec<u32>,
}

fn representation_mesh(
    part: &str,
    text: &str,
    numbers: &mut Numbers,
) -> Result<Vec<Triangle>, ReadError> {
    let mut triangles = Vec::new();
    let mut open: Vec<Rep> = Vec::new();
    // Coarser versions of the same faces, and edges, are no surface of their own.
    let mut coarser = 0usize;
    let mut document = Document::new(part, text);
    loop {
        let step = document.step()?;
        let as_fault = |what: String| document.fault(what);
        match step {
            Step::Start(e) => match (e.name(), open.last_mut()) {
                ("Rep" | "Root", _) => open.push(Rep::default()),
                ("PolygonalLOD", _) => coarser += 1,
                ("Face", Some(rep)) if coarser == 0 => face(&e, rep).map_err(as_fault)?,
                _ => {}
            },
            Step::End { name, text, .. } => match (name.as_str(), open.last_mut()) {
                ("PolygonalLOD", _) => coarser = coarser.saturating_sub(1),
                ("Positions", Some(rep)) if coarser == 0 => {
                    rep.positions = Some(positions(&text, numbers).map_err(as_fault)?);
                }
                ("Rep" | "Root", Some(_)) => {
                    if let Some(rep) = open.pop() {
                        add(&rep, &mut triangles).map_err(as_fault)?;
                    }
                }
                _ => {}
            },
            Step::Done => return Ok(triangles),
        }
    }
}

fn positions(text: &str, numbers: &mut Numbers) -> Result<Vec<[f64; 3]>, String> {
    let mut values = Vec::new();
    for word in words(text) {
        values.push(numbers.read(word.as_bytes())?);
    }
    let (points, rest) = values.as_chunks();
    if rest.is_empty() {
        Ok(points.to_vec())
    } else {
        Err(format!("{} numbers are not a list of points", values.len()))
    }
}

fn words(text: &str) -> impl Iterator<Item = &str> {
    text.split(|c: char| c == ',' || c.is_ascii_whitespace())
        .filter(|word| !word.is_empty())
}

/// Triangles one by one, strips and fans; commas separate strips and fans.
fn face(e: &Element<'_>, rep: &mut Rep) -> Result<(), String> {
    let indices = |text: &str| -> Result<Vec<u32>, String> {
        words(text)
            .map(|word| {
                word.parse()
                    .map_err(|_| format!("expected an index, found `{word:.40}`"))
            })
            .collect()
    };
    if let Some(text) = e.get_exact("triangles") {
        let all = indices(&text)?;
        if all.len() % 3 != 0 {
            return Err(format!("{} indices are not a list of triangles", all.len()));
        }
        rep.corners.extend(all);
    }
    for text in e.get_exact("strips").unwrap_or_default().split(',') {
        for (k, w) in indices(text)?.windows(3).enumerate() {
            // Every other triangle of a strip runs the other way.
            let turned = [w[k % 2], w[1 - k % 2], w[2]];
            rep.corners.extend(turned);
        }
    }
    for text in e.get_exact("fans").unwrap_or_default().split(',') {
        if let [hub, rest @ ..] = indices(text)?.as_slice() {
            for w in rest.windows(2) {
                rep.corners.extend([*hub, w[0], w[1]]);
            }
        }
    }
    Ok(())
}

fn add(rep: &Rep, triangles: &mut Vec<Triangle>) -> Result<(), String> {
    let points = rep.positions.as_deref().unwrap_or_default();
    let (corners, _) = rep.corners.as_chunks::<3>();
    triangles.reserve(corners.len());
    for indices in corners {
        let mut triangle = [[0.0; 3]; 3];
        for (slot, index) in triangle.iter_mut().zip(indices) {
            *slot = corner(points, *index as usize)?;
        }
        triangles.push(triangle);
    }
    Ok(())
}
