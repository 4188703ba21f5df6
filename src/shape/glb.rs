//! Binary glTF (GLB): the triangles of its scene, placed by its nodes; metres, y upwards.
//!
//! The `gltf` crate parses and checks the document; here what it claims is held against the
//! file's length. Read are meshes of triangles, strips and fans; z is made to point upwards.

mod extensions;
mod held;
mod skins;

use gltf::accessor::{DataType, Dimensions};
use gltf::json::Root;
use gltf::json::mesh::Primitive;
use gltf::mesh::Mode;
use gltf::{Document, Node, Semantic};
use serde_json::Value;

use crate::assembly::{Affine, Body, Fineness, corner, lay_out};
use crate::file_mesh::{FileMesh, Triangle};
use crate::read_error::ReadError;

/// glTF's y upwards becomes z.
const UPWARDS: Affine = Affine {
    rows: [[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]],
    shift: [0.0; 3],
};

/// The version of glTF that is read: major and minor.
const VERSION: [u32; 2] = [2, 0];
/// Characters of a version that a message shows.
const LONGEST_VERSION: usize = 20;

/// True for bytes that begin as GLB files do.
pub(crate) fn begins(bytes: &[u8]) -> bool {
    bytes.starts_with(b"glTF")
}

/// Reads a GLB file's bytes.
///
/// # Errors
/// [`ReadError`]: a document that does not verify, data in other files or compressed, no triangle.
pub fn read(bytes: &[u8]) -> Result<FileMesh, ReadError> {
    if !begins(bytes) {
        let what = "this is not a binary glTF file (.glb): it does not begin with `glTF`";
        return Err(ReadError::file(what));
    }
    let (json, blob) = chunks(bytes).ok_or_else(|| {
        ReadError::file("the GLB file does not hold what its header states: it was cut short")
    })?;
    let damaged = |text: String| {
        let text: String = text.chars().take(200).collect();
        ReadError::file(format!("the GLB file is damaged: {text}"))
    };
    let root: Value = serde_json::from_slice(json).map_err(|error| damaged(error.to_string()))?;
    check_version(&root).map_err(ReadError::file)?;
    let mut warnings = extensions::check(&root).map_err(ReadError::file)?;
    let mut root: Root = serde_json::from_value(extensions::surface_alone(root))
        .map_err(|error| damaged(error.to_string()))?;
    // Those that are left change no triangle.
    root.extensions_required.clear();
    check_morphs(&root).map_err(ReadError::file)?;
    // The check that follows takes these indices on trust.
    let primitives = root.meshes.iter().flat_map(|mesh| &mesh.primitives);
    let mut indices = primitives.flat_map(|p| p.attributes.values().chain(p.indices.iter()));
    if indices.any(|index| index.value() >= root.accessors.len()) {
        let what = "the GLB file is damaged: a mesh names data that are missing";
        return Err(ReadError::file(what));
    }
    let file = Document::from_json(root).map_err(|error| damaged(error.to_string()))?;
    let mut bodies = Vec::with_capacity(file.meshes().len());
    for mesh in file.meshes() {
        let mut body = Body::default();
        for primitive in mesh.primitives() {
            fluxform_base::progress::poll();
            triangles(&primitive, blob, &mut body.triangles).map_err(ReadError::file)?;
        }
        bodies.push(body);
    }
    let meshes = bodies.len();
    bodies.resize(meshes + file.nodes().len(), Body::default());
    for node in file.nodes() {
        bodies[meshes + node.index()].children = children(&node, meshes);
    }
    let scene = file.default_scene().or_else(|| file.scenes().next());
    let scene = scene.ok_or_else(|| ReadError::file("the GLB file shows no scene"))?;
    let mut roots: Vec<(usize, Affine)> = scene
        .nodes()
        .map(|node| (meshes + node.index(), UPWARDS))
        .collect();
    let skinned = skins::add((&file, blob), (&scene, UPWARDS), &mut bodies, &mut roots);
    if skinned.map_err(ReadError::file)? {
        let what = "the file bends meshes by skins; they are read as they are at rest";
        warnings.push(what.to_owned());
    }
    let laid_out = lay_out(&bodies, &roots, Fineness::Floats).map_err(ReadError::file)?;
    if laid_out.triangles.is_empty() {
        let what = "the GLB file's scene holds no triangle: export a body as a mesh";
        return Err(ReadError::file(what));
    }
    Ok(FileMesh {
        unit_m: Some(1.0),
        warnings,
        ..laid_out
    })
}

/// Refuses documents that need another glTF than 2.0: a later 2.x is read unless it states that 2.0 does not do, and
/// so is a later major that states that 2.0 does. A document without a version is damaged, which is found later.
fn check_version(root: &Value) -> Result<(), String> {
    let stated = |key: &str| root["asset"][key].as_str();
    let parsed = |version: &str| -> Option<[u32; 2]> {
        let (major, minor) = version.split_once('.')?;
        Some([major.parse().ok()?, minor.parse().ok()?])
    };
    let (least, version) = (stated("minVersion"), stated("version"));
    let refused = match (least, version) {
        (Some(least), _) if parsed(least).is_none_or(|v| v > VERSION) => least,
        (None, Some(version)) if parsed(version).is_none_or(|v| v[0] != VERSION[0]) => version,
        (Some(_), Some(version)) if parsed(version).is_none_or(|v| v[0] < VERSION[0]) => version,
        _ => return Ok(()),
    };
    let refused: String = refused.chars().take(LONGEST_VERSION).collect();
    Err(format!(
        "the GLB file needs glTF `{refused}`, which is not read: export it again as glTF 2.0"
    ))
}

/// Refuses meshes that morph targets bend as they are at rest.
fn check_morphs(root: &Root) -> Result<(), String> {
    let bent = root.nodes.iter().any(|node| {
        let mesh = node.mesh.and_then(|mesh| root.meshes.get(mesh.value()));
        let Some(mesh) = mesh else { return false };
        let weights = node.weights.as_ref().or(mesh.weights.as_ref());
        let targets = |p: &Primitive| p.targets.as_ref().is_some_and(|t| !t.is_empty());
        weights.is_some_and(|weights| weights.iter().any(|w| *w != 0.0))
            && mesh.primitives.iter().any(targets)
    });
    match bent {
        true => Err(
            "the GLB file bends a mesh by morph targets (shape keys), which are not read: apply \
                     them and export it again"
                .into(),
        ),
        false => Ok(()),
    }
}

/// The document and the data behind it: each a length, a type and so many bytes.
fn chunks(bytes: &[u8]) -> Option<(&[u8], &[u8])> {
    let word = |at: usize| {
        let word = bytes.get(at..)?.first_chunk()?;
        Some(u32::from_le_bytes(*word) as usize)
    };
    let whole = bytes.get(..word(8)?)?;
    let chunk = |at: usize, kind: &[u8]| {
        let start = at + 8;
        let known = whole.get(at + 4..start)? == kind;
        let chunk = whole.get(start..start.checked_add(word(at)?)?)?;
        known.then_some(chunk)
    };
    let json = chunk(12, b"JSON")?;
    let next = 20 + json.len();
    let blob = match next < whole.len() {
        true => chunk(next, b"BIN\0")?,
        false => &[],
    };
    Some((json, blob))
}

/// A node's mesh and nodes, placed by its own transformation, which a skinned mesh does not follow.
fn children(node: &Node<'_>, meshes: usize) -> Vec<(usize, Affine)> {
    let place = skins::affine(node.transform().matrix());
    let stiff = node.mesh().filter(|_| node.skin().is_none());
    let own = stiff.map(|mesh| (mesh.index(), place));
    let nodes = node.children().map(|child| (meshes + child.index(), place));
    own.into_iter().chain(nodes).collect()
}

/// A primitive's points and the indices of its corners.
fn points_and_indices(
    primitive: &gltf::Primitive<'_>,
    blob: &[u8],
) -> Result<(Vec<[f64; 3]>, Vec<u32>), String> {
    let positions = primitive
        .get(&Semantic::Positions)
        .ok_or_else(held::missing)?;
    held::check(&positions, blob)?;
    if (positions.data_type(), positions.dimensions()) != (DataType::F32, Dimensions::Vec3) {
        return Err("the GLB file holds positions that are not three floats each".into());
    }
    let reader = primitive.reader(|_| Some(blob));
    let points: Vec<[f64; 3]> = reader
        .read_positions()
        .ok_or_else(held::missing)?
        .map(|p| p.map(f64::from))
        .collect();
    if points.as_flattened().iter().any(|c| !c.is_finite()) {
        return Err("a position is not a finite number; repair the mesh".into());
    }
    let Some(accessor) = primitive.indices() else {
        let in_order = (0..points.len() as u32).collect();
        return Ok((points, in_order));
    };
    held::check(&accessor, blob)?;
    let whole = matches!(
        accessor.data_type(),
        DataType::U8 | DataType::U16 | DataType::U32
    );
    if !whole || accessor.dimensions() != Dimensions::Scalar {
        return Err("the GLB file holds indices that are not whole numbers".into());
    }
    let indices = reader.read_indices().ok_or_else(held::missing)?;
    Ok((points, indices.into_u32().collect()))
}

/// Adds a primitive's triangles.
fn triangles(
    primitive: &gltf::Primitive<'_>,
    blob: &[u8],
    triangles: &mut Vec<Triangle>,
) -> Result<(), String> {
    let fans = match primitive.mode() {
        Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan => primitive.mode(),
        // Points and lines are no surface.
        Mode::Points | Mode::Lines | Mode::LineLoop | Mode::LineStrip => return Ok(()),
    };
    let (points, indices) = points_and_indices(primitive, blob)?;
    let mut add = |a: u32, b: u32, c: u32| -> Result<(), String> {
        let mut triangle = [[0.0; 3]; 3];
        for (slot, index) in triangle.iter_mut().zip([a, b, c]) {
            *slot = corner(&points, index as usize)?;
        }
        triangles.push(triangle);
        Ok(())
    };
    match fans {
        Mode::TriangleStrip => {
            for (k, w) in indices.windows(3).enumerate() {
                // Every other triangle of a strip runs the other way.
                add(w[k % 2], w[1 - k % 2], w[2])?;
            }
        }
        Mode::TriangleFan => {
            for w in indices.windows(2).skip(1) {
                add(indices[0], w[0], w[1])?;
            }
        }
        _ => {
            let (whole, rest) = indices.as_chunks::<3>();
            if !rest.is_empty() {
                return Err(format!(
                    "the GLB file holds a mesh of {} indices, which are no whole triangles: it is \
                     damaged; export it again",
                    indices.len()
                ));
            }
            for [a, b, c] in whole {
                add(*a, *b, *c)?;
            }
        }
    }
    Ok(())
}
