//! Assemblies: the placement of each part, and which of the display's tables are theirs.
//!
//! The document `swXmlContents/COMPINSTANCETREE` names the files, the models made of them (one
//! per file and configuration, with its box) and the references that place models in models. The
//! display lists hold each part once, in its own coordinates, behind the path of its file. A part
//! is taken only where its tables fill the box that the document states for it.

use std::collections::{BTreeMap, HashMap};

use super::display::Table;
use super::{ADVICE, box_of};
use crate::assembly::{Affine, Body, Fineness, lay_out};
use crate::file_mesh::{FileMesh, Triangle};
use crate::read_error::ReadError;
use crate::xml::{Document, Element, Step};

/// The document's name, for messages.
const PART: &str = "swXmlContents/COMPINSTANCETREE";
/// How far the tables of a part may lie outside its stated box, and how far they may leave it
/// unfilled (the box of a curved body is wider than it), in diagonals of it.
const OUTSIDE: f64 = 0.01;
const UNFILLED: f64 = 0.05;
/// Parts that a message names.
const NAMED: usize = 3;

/// A file of the assembly in one configuration.
#[derive(Default)]
struct Model {
    id: String,
    name: String,
    file: String,
    bounds: Option<[[f64; 3]; 2]>,
    references: Vec<Reference>,
}

/// A model placed in another.
struct Reference {
    model: String,
    place: Affine,
    hidden: bool,
}

/// An assembly's models; the first is the assembly itself.
pub(super) struct Product {
    models: Vec<Model>,
    /// Paths by the ids of files.
    files: HashMap<String, String>,
}

impl Product {
    /// Reads the document; `None` for that of a part, which places nothing.
    pub(super) fn read(text: &str) -> Result<Option<Self>, ReadError> {
        let mut product = Self {
            models: Vec::new(),
            files: HashMap::new(),
        };
        let mut document = Document::new(PART, text);
        loop {
            fluxform_base::progress::poll();
            match document.step()? {
                Step::Start(e) => product.add(&e).map_err(|what| document.fault(what))?,
                Step::End { .. } => {}
                Step::Done => break,
            }
        }
        let places = product.models.iter().any(|m| !m.references.is_empty());
        Ok(places.then_some(product))
    }

    fn add(&mut self, e: &Element<'_>) -> Result<(), String> {
        let get = |key: &str| e.get_exact(key).unwrap_or_default().into_owned();
        match e.name() {
            "swFile" => {
                self.files.insert(get("id"), base_name(&get("swPath")));
            }
            "swModel" => self.models.push(Model {
                id: get("id"),
                name: get("swName"),
                file: get("swFileRef"),
                bounds: numbers::<6>(&get("swBoundingBox"))
                    .map(|b| [[b[0], b[1], b[2]], [b[3], b[4], b[5]]]),
                references: Vec::new(),
            }),
            "swReference" => {
                let transform = get("swTransform");
                let t = numbers::<16>(&transform)
                    .ok_or_else(|| format!("`{transform:.40}` is not a placement"))?;
                let columns = [0, 1, 2, 4, 5, 6, 8, 9, 10, 12, 13, 14];
                let model = self.models.last_mut();
                let model = model.ok_or("a reference stands outside a model")?;
                model.references.push(Reference {
                    model: get("swModelRef"),
                    place: Affine::from_columns(columns.map(|k| t[k])),
                    hidden: get("swSuppressed") != "NO" || get("swHidden") != "NO",
                });
            }
            _ => {}
        }
        Ok(())
    }

    /// The triangles of all parts that are shown, placed; also how many references are hidden.
    pub(super) fn lay_out(
        &self,
        stream: &[u8],
        tables: &[Table],
    ) -> Result<(FileMesh, usize), ReadError> {
        let index: HashMap<&str, usize> = (self.models.iter().enumerate())
            .map(|(k, model)| (model.id.as_str(), k))
            .collect();
        let parts = parts(stream, tables)?;
        let mut bodies = Vec::with_capacity(self.models.len());
        let mut hidden = 0;
        for model in &self.models {
            let mut body = Body::default();
            for reference in &model.references {
                match index.get(reference.model.as_str()) {
                    _ if reference.hidden => hidden += 1,
                    Some(child) => body.children.push((*child, reference.place)),
                    None => return Err(ReadError::file(lacks(&["?"], self.models.len()))),
                }
            }
            bodies.push(body);
        }
        let root = self.root(&index)?;
        let shown = shown(&bodies, root);
        let mut missing = Vec::new();
        for (k, model) in self.models.iter().enumerate() {
            // An assembly of which every reference is hidden shows nothing.
            if !shown[k] || !model.references.is_empty() {
                continue;
            }
            let file = self.files.get(&model.file).map_or("", String::as_str);
            match parts.get(file).and_then(|parts| model.fitting(parts)) {
                Some(triangles) => bodies[k].triangles.clone_from(triangles),
                None => missing.push(model.name.as_str()),
            }
        }
        if !missing.is_empty() {
            let all = (0..self.models.len())
                .filter(|k| shown[*k] && self.models[*k].references.is_empty());
            return Err(ReadError::file(lacks(&missing, all.count())));
        }
        let roots = [(root, Affine::IDENTITY)];
        let laid_out = lay_out(&bodies, &roots, Fineness::Floats).map_err(ReadError::file)?;
        Ok((laid_out, hidden))
    }

    /// The one model that nothing places.
    fn root(&self, index: &HashMap<&str, usize>) -> Result<usize, ReadError> {
        let mut placed = vec![false; self.models.len()];
        for reference in self.models.iter().flat_map(|m| &m.references) {
            if let Some(k) = index.get(reference.model.as_str()) {
                placed[*k] = true;
            }
        }
        let mut roots = (0..placed.len()).filter(|k| !placed[*k]);
        match (roots.next(), roots.next()) {
            (Some(root), None) => Ok(root),
            _ => Err(ReadError::file(format!(
                "the assembly has several configurations, and its display data do not state which \
                 one is shown: {ADVICE}"
            ))),
        }
    }
}

impl Model {
    /// Of the parts of this model's file the one that fills its box.
    fn fitting<'a>(&self, parts: &'a [Vec<Triangle>]) -> Option<&'a Vec<Triangle>> {
        let [low, high] = self.bounds?;
        let diagonal = (0..3).fold(0.0_f64, |d, k| d.hypot(high[k] - low[k]));
        let unfilled = |part: &Vec<Triangle>| {
            let [min, max] = box_of(part);
            let gaps = (0..3).flat_map(|k| [min[k] - low[k], high[k] - max[k]]);
            let (least, most) =
                gaps.fold((0.0_f64, 0.0_f64), |(l, m), gap| (l.min(gap), m.max(gap)));
            (least >= -OUTSIDE * diagonal && most <= UNFILLED * diagonal).then_some(most)
        };
        let fitting = parts
            .iter()
            .filter_map(|part| Some((unfilled(part)?, part)));
        let best = fitting.min_by(|a, b| a.0.total_cmp(&b.0))?;
        Some(best.1)
    }
}

/// Which bodies are reached from the root.
fn shown(bodies: &[Body], root: usize) -> Vec<bool> {
    let mut shown = vec![false; bodies.len()];
    let mut open = vec![root];
    while let Some(k) = open.pop() {
        if !std::mem::replace(&mut shown[k], true) {
            open.extend(bodies[k].children.iter().map(|child| child.0));
        }
    }
    shown
}

/// The triangles of the tables behind every path of a part's file, by the file's name.
fn parts(
    stream: &[u8],
    tables: &[Table],
) -> Result<BTreeMap<String, Vec<Vec<Triangle>>>, ReadError> {
    let mut paths = paths(stream).into_iter().peekable();
    let mut parts: BTreeMap<String, Vec<Vec<Triangle>>> = BTreeMap::new();
    let mut open: Option<(String, Vec<Triangle>)> = None;
    for table in tables {
        while let Some((_, name)) = paths.next_if(|(at, _)| *at < table.start()) {
            if let Some((name, part)) = open.replace((name, Vec::new()))
                && !part.is_empty()
            {
                parts.entry(name).or_default().push(part);
            }
        }
        if let Some((_, part)) = &mut open {
            table.read(stream, part)?;
        }
    }
    if let Some((name, part)) = open {
        parts.entry(name).or_default().push(part);
    }
    Ok(parts)
}

/// The names of parts' files in a stream, with their offsets: FF FE FF, the length, UTF-16.
fn paths(stream: &[u8]) -> Vec<(usize, String)> {
    let mut found = Vec::new();
    for (at, sign) in stream.windows(4).enumerate() {
        let &[0xff, 0xfe, 0xff, length] = sign else {
            continue;
        };
        let text = stream[at + 4..].get(..2 * usize::from(length));
        let Some(text) = text.filter(|_| length < 0xff) else {
            continue;
        };
        let (units, _) = text.as_chunks::<2>();
        let units = units.iter().map(|unit| u16::from_le_bytes(*unit));
        let text: Result<String, _> = char::decode_utf16(units).collect();
        if let Ok(text) = text {
            let name = base_name(&text);
            if name.ends_with(".sldprt") || name.ends_with(".prt") {
                found.push((at, name));
            }
        }
    }
    found
}

/// The last part of a path of any system, in lower case.
fn base_name(path: &str) -> String {
    let last = path.rsplit(['/', '\\']).next().unwrap_or_default();
    last.to_lowercase()
}

fn numbers<const N: usize>(text: &str) -> Option<[f64; N]> {
    let numbers: Vec<f64> = text
        .split_ascii_whitespace()
        .map_while(|word| word.parse().ok())
        .filter(|number: &f64| number.is_finite())
        .collect();
    numbers.try_into().ok()
}

fn lacks(missing: &[&str], all: usize) -> String {
    let mut names: Vec<String> = (missing.iter().take(NAMED))
        .map(|name| format!("`{name}`"))
        .collect();
    if missing.len() > NAMED {
        names.push("...".into());
    }
    format!(
        "the assembly's display data lack {} of its {all} parts, or hold them in another shape \
         ({}): parts that were not loaded when it was saved; open it in SOLIDWORKS with all parts \
         resolved and save it as STEP, 3MF or STL, or give the part's own file",
        missing.len(),
        names.join(", ")
    )
}
