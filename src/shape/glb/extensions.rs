//! Extensions of glTF: those that change no triangle are passed over, others are refused with what to do.

use serde_json::Value;

/// How the names of extensions begin that change no triangle.
const HARMLESS: [&str; 6] = [
    "KHR_materials_",
    "KHR_texture_",
    "KHR_lights_",
    "KHR_xmp",
    "EXT_texture_",
    "EXT_lights_",
];
/// How the names of others begin, and what helps.
const ADVICE: [(&str, &str); 4] = [
    (
        "KHR_draco_mesh_compression",
        "save it again without compression",
    ),
    (
        "EXT_meshopt_compression",
        "save it again without compression",
    ),
    (
        "KHR_mesh_quantization",
        "save it again without quantization, its positions as floats",
    ),
    (INSTANCING, REALIZE),
];
const INSTANCING: &str = "EXT_mesh_gpu_instancing";
const REALIZE: &str = "make its instances real objects and export it again";
const VISIBILITY: &str = "KHR_node_visibility";
/// Characters of a name that a message shows.
const LONGEST_NAME: usize = 60;

/// Warnings about the extensions of a document.
///
/// # Errors
/// One that changes triangles and is required, or repeats meshes.
pub(super) fn check(root: &Value) -> Result<Vec<String>, String> {
    let list = |key: &str| root[key].as_array().into_iter().flatten();
    for name in list("extensionsRequired").filter_map(Value::as_str) {
        if HARMLESS.iter().any(|known| name.starts_with(known)) {
            continue;
        }
        let advice = ADVICE.iter().find(|(known, _)| name == *known);
        let advice = advice.map_or("export it as a plain mesh", |(_, advice)| advice);
        let name: String = name.chars().take(LONGEST_NAME).collect();
        return Err(format!(
            "the GLB file requires the extension `{name}`, which is not read: {advice}"
        ));
    }
    let nodes = || list("nodes").map(|node| &node["extensions"]);
    if nodes().any(|node| node.get(INSTANCING).is_some()) {
        return Err(format!(
            "the GLB file repeats meshes by `{INSTANCING}`, which is not read: {REALIZE}"
        ));
    }
    let mut warnings = Vec::new();
    if nodes().any(|node| node[VISIBILITY]["visible"] == Value::Bool(false)) {
        warnings.push(format!(
            "the file hides objects by `{VISIBILITY}`; they are read as the others are: leave them out of \
             the export if that is not meant"
        ));
    }
    Ok(warnings)
}

/// The document without what only colours it: extensions leave out keys that are required without them.
pub(super) fn surface_alone(mut root: Value) -> Value {
    if let Some(root) = root.as_object_mut() {
        for key in ["materials", "textures", "images", "samplers"] {
            root.remove(key);
        }
    }
    for mesh in list_in(&mut root, "meshes") {
        for primitive in list_in(mesh, "primitives") {
            if let Some(primitive) = primitive.as_object_mut() {
                primitive.remove("material");
            }
        }
    }
    root
}

/// The entries of a list in an object; none where there is no such list.
fn list_in<'a>(object: &'a mut Value, key: &str) -> impl Iterator<Item = &'a mut Value> {
    let list = object.get_mut(key).and_then(Value::as_array_mut);
    list.into_iter().flatten()
}
