//! The surface formats: one table of their names, endings and units.

use std::path::Path;

/// Formats of surface files.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SurfaceFormat {
    /// STL, binary or ASCII; carries no unit.
    Stl,
    /// Wavefront OBJ; carries no unit.
    Obj,
    /// PLY; carries no unit.
    Ply,
    /// Geomview's OFF; carries no unit.
    Off,
    /// Binary glTF; always in metres.
    Glb,
    /// A height image, PNG of 8 or 16 bit grey; carries no unit.
    HeightImage,
    /// 3MF; carries its unit.
    ThreeMf,
    /// AMF; carries its unit.
    Amf,
    /// Dassault's 3DXML; always in millimetres.
    ThreeDxml,
    /// STEP; carries its unit.
    Step,
    /// A SOLIDWORKS part or assembly; always in metres.
    Sldprt,
}

/// Facts about a format that need no reader.
struct Row {
    format: SurfaceFormat,
    /// Its usual name.
    name: &'static str,
    /// File endings, lower case.
    endings: &'static [&'static str],
    /// Whether the file itself says what its unit is.
    carries_unit: bool,
}

const fn row(
    format: SurfaceFormat,
    name: &'static str,
    endings: &'static [&'static str],
    carries_unit: bool,
) -> Row {
    Row {
        format,
        name,
        endings,
        carries_unit,
    }
}

/// In the order of [`SurfaceFormat`].
const TABLE: &[Row] = &[
    row(SurfaceFormat::Stl, "STL", &["stl"], false),
    row(SurfaceFormat::Obj, "OBJ", &["obj"], false),
    row(SurfaceFormat::Ply, "PLY", &["ply"], false),
    row(SurfaceFormat::Off, "OFF", &["off"], false),
    row(SurfaceFormat::Glb, "GLB", &["glb"], true),
    row(SurfaceFormat::HeightImage, "height image", &["png"], false),
    row(SurfaceFormat::ThreeMf, "3MF", &["3mf"], true),
    row(SurfaceFormat::Amf, "AMF", &["amf"], true),
    row(SurfaceFormat::ThreeDxml, "3DXML", &["3dxml"], true),
    row(SurfaceFormat::Step, "STEP", &["step", "stp"], true),
    row(
        SurfaceFormat::Sldprt,
        "SOLIDWORKS",
        &["sldprt", "sldasm"],
        true,
    ),
];

/// Files that users have, which are not read: their endings, and what to do.
const ADVICE: [(&[&str], &str); 6] = [
    (
        &["igs", "iges"],
        "IGES files are not read: they hold loose faces, no body; save the body as STEP, or as STL \
         or 3MF of fine resolution, in the CAD program (FreeCAD opens IGES also)",
    ),
    (
        &[
            "x_t",
            "x_b",
            "sat",
            "ipt",
            "iam",
            "prt",
            "asm",
            "catpart",
            "catproduct",
            "f3d",
            "fcstd",
            "slddrw",
            "dwg",
            "dxf",
        ],
        "such files are read by CAD programs alone: save the body as STEP, 3MF or STL in one",
    ),
    (
        &["gltf"],
        "glTF files that name others are not read: save it as one binary file (.glb)",
    ),
    (
        &["dae", "fbx", "blend", "wrl", "x3d", "3ds", "usdz"],
        "such files are not read: export the body as STL, OBJ, PLY or 3MF (Blender does)",
    ),
    (
        &["tif", "tiff", "asc", "dem", "xyz", "pcd", "las", "laz"],
        "such files are not read: save heights as a PNG of 16 bit grey, or points as a mesh",
    ),
    (
        &["zip", "7z", "rar", "tar", "gz", "tgz", "xz"],
        "archives are not read: unpack it first, and name the surface in it",
    ),
];

impl SurfaceFormat {
    fn row(self) -> &'static Row {
        &TABLE[self as usize]
    }

    /// The format of `path` by its ending, in upper or lower case; `None` for any other.
    #[must_use]
    pub fn of(path: &Path) -> Option<Self> {
        let ending = ending(path)?;
        let row = TABLE.iter().find(|row| row.endings.contains(&&*ending))?;
        Some(row.format)
    }

    /// Its usual name.
    #[must_use]
    pub fn name(self) -> &'static str {
        self.row().name
    }

    /// True where the file itself says what its unit is.
    #[must_use]
    pub fn carries_unit(self) -> bool {
        self.row().carries_unit
    }

    /// Every format.
    pub(super) fn all() -> impl Iterator<Item = Self> {
        TABLE.iter().map(|row| row.format)
    }

    /// The ending that its files usually have.
    pub(super) fn usual_ending(self) -> &'static str {
        self.row().endings[0]
    }

    /// The endings that are read, for a message.
    #[must_use]
    pub fn endings() -> String {
        let endings = TABLE.iter().flat_map(|row| row.endings);
        let endings: Vec<String> = endings.map(|ending| format!(".{ending}")).collect();
        endings.join(", ")
    }

    /// Advice on a file of this name, which is not read.
    #[must_use]
    pub fn advice(path: &Path) -> Option<&'static str> {
        let ending = ending(path)?;
        let found = ADVICE
            .iter()
            .find(|(endings, _)| endings.contains(&&*ending));
        found.map(|(_, advice)| *advice)
    }
}

/// The ending of a path, in lower case.
fn ending(path: &Path) -> Option<String> {
    Some(path.extension()?.to_str()?.to_ascii_lowercase())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_format_has_its_row_and_its_endings() {
        for (k, row) in TABLE.iter().enumerate() {
            assert_eq!(row.format as usize, k);
            for ending in row.endings {
                let path = format!("a.b/part.{}", ending.to_uppercase());
                assert_eq!(SurfaceFormat::of(Path::new(&path)), Some(row.format));
                assert_eq!(SurfaceFormat::advice(Path::new(&path)), None);
            }
        }
        for name in ["part.dae", ".stl", "part", "part.igs"] {
            assert_eq!(SurfaceFormat::of(Path::new(name)), None, "{name}");
        }
        let advice = SurfaceFormat::advice(Path::new("part.IGS")).unwrap();
        assert!(advice.contains("STEP"), "{advice}");
    }
}
