//! Skinned meshes at rest: glTF places them by their joints and ignores their own node.
//!
//! A vertex goes where its joints, weighted, take it, each by its place in the scene after its inverse bind
//! matrix (glTF 2.0, section 3.7.3.3). Where these products are one placement for all joints of the skin, moved vertices or
//! not, the mesh is not bent.

use gltf::accessor::{DataType, Dimensions};
use gltf::{Document, Scene, Skin};

use super::held;
use crate::assembly::{Affine, Body};

/// Placements that differ by this share of their terms are one: floats, which exporters also take apart into turns
/// and factors, leave about a hundred roundings.
const ONE: f64 = 1e-5;

/// A matrix of glTF, by columns.
pub(super) fn affine(matrix: [[f32; 4]; 4]) -> Affine {
    let m = matrix.map(|column| column.map(f64::from));
    Affine {
        rows: [0, 1, 2].map(|k| [m[0][k], m[1][k], m[2][k]]),
        shift: [m[3][0], m[3][1], m[3][2]],
    }
}

/// Adds the skinned meshes of a scene to its roots, each below a body for every placement of its chain, so that
/// what cancels there counts; `bodies` begins with the file's meshes. Whether there is any.
///
/// # Errors
/// A skin that bends its mesh at rest, or whose data are missing.
pub(super) fn add(
    (file, blob): (&Document, &[u8]),
    (scene, upwards): (&Scene<'_>, Affine),
    bodies: &mut Vec<Body>,
    roots: &mut Vec<(usize, Affine)>,
) -> Result<bool, String> {
    let tree = Tree::new(file);
    let shown: Vec<usize> = scene.nodes().map(|node| node.index()).collect();
    let mut any = false;
    for node in file.nodes() {
        let (Some(skin), Some(mesh)) = (node.skin(), node.mesh()) else {
            continue;
        };
        any = true;
        let above = tree.line(node.index())?;
        if !above.iter().any(|node| shown.contains(node)) {
            continue;
        }
        let mut below = mesh.index();
        for place in tree.at_rest(&skin, blob)?.into_iter().rev() {
            bodies.push(Body {
                triangles: Vec::new(),
                children: vec![(below, place)],
            });
            below = bodies.len() - 1;
        }
        roots.push((below, upwards));
    }
    Ok(any)
}

/// The nodes by index.
struct Tree {
    places: Vec<Affine>,
    parents: Vec<Option<usize>>,
}

impl Tree {
    fn new(file: &Document) -> Self {
        let places: Vec<Affine> = (file.nodes())
            .map(|node| affine(node.transform().matrix()))
            .collect();
        let mut parents = vec![None; places.len()];
        for node in file.nodes() {
            for child in node.children() {
                parents[child.index()] = Some(node.index());
            }
        }
        Self { places, parents }
    }

    /// A node and those above it, the outermost first.
    fn line(&self, node: usize) -> Result<Vec<usize>, String> {
        let mut line = vec![node];
        let mut top = node;
        while let Some(parent) = self.parents[top] {
            if line.len() > self.parents.len() {
                return Err("the GLB file is damaged: a node is placed within itself".into());
            }
            line.push(parent);
            top = parent;
        }
        line.reverse();
        Ok(line)
    }

    /// The placements of a skin's first joint, the outermost first, its inverse bind matrix last, where all joints
    /// place the mesh as it does.
    fn at_rest(&self, skin: &Skin<'_>, blob: &[u8]) -> Result<Vec<Affine>, String> {
        let joints: Vec<usize> = skin.joints().map(|joint| joint.index()).collect();
        let binds = binds(skin, joints.len(), blob)?;
        let chain = |(joint, bind): (&usize, &Affine)| -> Result<Vec<Affine>, String> {
            let mut chain: Vec<Affine> = (self.line(*joint)?.into_iter())
                .map(|node| self.places[node])
                .collect();
            chain.push(*bind);
            Ok(chain)
        };
        let mut chains = joints.iter().zip(&binds).map(chain);
        let first = chains
            .next()
            .ok_or("the GLB file is damaged: a skin has no joint")??;
        let place = composed(&first);
        for other in chains {
            fluxform_base::progress::poll();
            if !same(&place, &composed(&other?)) {
                let what = "the GLB file holds a skin whose joints are posed apart (an armature), which is not \
                            read: apply it and export it again";
                return Err(what.into());
            }
        }
        Ok(first)
    }
}

/// The inverse bind matrices of a skin; identities where it has none.
fn binds(skin: &Skin<'_>, joints: usize, blob: &[u8]) -> Result<Vec<Affine>, String> {
    let Some(accessor) = skin.inverse_bind_matrices() else {
        return Ok(vec![Affine::IDENTITY; joints]);
    };
    held::check(&accessor, blob)?;
    let kind = (accessor.data_type(), accessor.dimensions());
    if kind != (DataType::F32, Dimensions::Mat4) || accessor.count() < joints {
        return Err("the GLB file is damaged: a skin has no matrix for each of its joints".into());
    }
    let reader = skin.reader(|_| Some(blob));
    let matrices = reader
        .read_inverse_bind_matrices()
        .ok_or_else(held::missing)?;
    Ok(matrices.map(affine).take(joints).collect())
}

/// A chain of placements, and the sums of the magnitudes of its terms.
fn composed(chain: &[Affine]) -> [Affine; 2] {
    let all = |of: fn(&Affine) -> Affine| {
        let places = chain.iter().map(of);
        places.fold(Affine::IDENTITY, |outer, inner| outer.after(&inner))
    };
    [all(|place| *place), all(Affine::magnitudes)]
}

/// Whether two placements are one but for rounding.
fn same([a, a_terms]: &[Affine; 2], [b, b_terms]: &[Affine; 2]) -> bool {
    let numbers = |place: &Affine| {
        let [x, y, z] = place.rows;
        [x, y, z, place.shift]
    };
    let pairs = numbers(a).into_iter().zip(numbers(b));
    let terms = numbers(a_terms).into_iter().zip(numbers(b_terms));
    pairs.zip(terms).all(|((a, b), (a_terms, b_terms))| {
        let largest = (a_terms.iter().chain(&b_terms)).fold(0.0, |m: f64, v| m.max(*v));
        a.iter().zip(b).all(|(a, b)| (a - b).abs() <= ONE * largest)
    })
}
