//! The surface formats: one table of their names, endings, signs and readers.

use std::path::Path;

use crate::error::ShapeError;
use crate::mesh::FileMesh;
use crate::read_error::ReadError;
use crate::step::{self, BodyOptions};
use crate::{amf, glb, height_image, obj, off, ply, sldprt, stl, three_dxml, three_mf};
use fluxform_base::progress::Silent;

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

/// All that is to be known of a format.
struct Row {
    format: SurfaceFormat,
    /// Its usual name.
    name: &'static str,
    /// File endings, lower case.
    endings: &'static [&'static str],
    /// Whether the file itself says what its unit is.
    carries_unit: bool,
    /// Whether bytes begin as such files do: never true for two formats.
    begins: fn(&[u8]) -> bool,
    read: fn(&[u8]) -> Result<FileMesh, ReadError>,
}

/// In the order of [`SurfaceFormat`].
const TABLE: [Row; 11] = [
    Row {
        format: SurfaceFormat::Stl,
        name: "STL",
        endings: &["stl"],
        carries_unit: false,
        begins: stl::begins,
        read: stl::read,
    },
    Row {
        format: SurfaceFormat::Obj,
        name: "OBJ",
        endings: &["obj"],
        carries_unit: false,
        begins: obj::begins,
        read: obj::read,
    },
    Row {
        format: SurfaceFormat::Ply,
        name: "PLY",
        endings: &["ply"],
        carries_unit: false,
        begins: ply::begins,
        read: ply::read,
    },
    Row {
        format: SurfaceFormat::Off,
        name: "OFF",
        endings: &["off"],
        carries_unit: false,
        begins: off::begins,
        read: off::read,
    },
    Row {
        format: SurfaceFormat::Glb,
        name: "GLB",
        endings: &["glb"],
        carries_unit: true,
        begins: glb::begins,
        read: glb::read,
    },
    Row {
        format: SurfaceFormat::HeightImage,
        name: "height image",
        endings: &["png"],
        carries_unit: false,
        begins: height_image::begins,
        read: height_image::read,
    },
    Row {
        format: SurfaceFormat::ThreeMf,
        name: "3MF",
        endings: &["3mf"],
        carries_unit: true,
        begins: three_mf::begins,
        read: three_mf::read,
    },
    Row {
        format: SurfaceFormat::Amf,
        name: "AMF",
        endings: &["amf"],
        carries_unit: true,
        begins: amf::begins,
        read: amf::read,
    },
    Row {
        format: SurfaceFormat::ThreeDxml,
        name: "3DXML",
        endings: &["3dxml"],
        carries_unit: true,
        begins: three_dxml::begins,
        read: three_dxml::read,
    },
    Row {
        format: SurfaceFormat::Step,
        name: "STEP",
        endings: &["step", "stp"],
        carries_unit: true,
        begins: |bytes| starts(bytes, b"ISO-10303-21"),
        read: |bytes| step::read(bytes, &BodyOptions::default(), &Silent),
    },
    Row {
        format: SurfaceFormat::Sldprt,
        name: "SOLIDWORKS",
        endings: &["sldprt", "sldasm"],
        carries_unit: true,
        begins: sldprt::begins,
        read: sldprt::read,
    },
];

/// Files that users have, which are not read: their endings, and what to do.
const ADVICE: [(&[&str], &str); 5] = [
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
];

/// Kinds of files that are no surface of any format, by their first bytes in lower case.
const OTHER: [(&[u8], &str); 4] = [
    (
        b"version https://git-lfs",
        "a git-LFS pointer to one: run `git lfs pull` in its repository, or download the file itself",
    ),
    (
        b"<!doctype",
        "a web page: the download went wrong; fetch the raw file",
    ),
    (
        b"<html",
        "a web page: the download went wrong; fetch the raw file",
    ),
    (b"\x1f\x8b", "compressed with gzip; unpack it"),
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

    /// The format of a file's bytes, for names without an ending; `None` where they show none.
    #[must_use]
    pub fn of_content(bytes: &[u8]) -> Option<Self> {
        let row = TABLE.iter().find(|row| (row.begins)(bytes))?;
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

    /// The triangles of a file's bytes, in the file's unit; `path` names it in messages.
    ///
    /// # Errors
    /// [`ShapeError::Content`] with the place.
    pub fn read(self, path: &Path, bytes: &[u8]) -> Result<FileMesh, ShapeError> {
        self.read_bytes(bytes)
            .map_err(|source| ShapeError::Content {
                path: path.into(),
                source,
            })
    }

    fn read_bytes(self, bytes: &[u8]) -> Result<FileMesh, ReadError> {
        if bytes.is_empty() {
            return Err(ReadError::file(
                "the file is empty (0 bytes): the export or the download failed",
            ));
        }
        let row = self.row();
        let other = |what: &str| ReadError::file(format!("this is not {} {what}", row.article()));
        if let Some((_, what)) = OTHER.iter().find(|(sign, _)| starts(bytes, sign)) {
            return Err(other(&format!("file but {what}")));
        }
        let result = (row.read)(bytes);
        // A file of another format under this name fails somewhere: the name is the fault then.
        if result.is_err()
            && !(row.begins)(bytes)
            && let Some(format) = Self::of_content(bytes)
        {
            let real = format.row();
            return Err(other(&format!(
                "file but {} file: give it the ending .{}",
                real.article(),
                real.endings[0]
            )));
        }
        result
    }
}

impl Row {
    /// Its name with an article.
    fn article(&self) -> String {
        let vowel = self.name.starts_with(['A', 'E', 'I', 'O']) || self.name == "STL";
        format!("{} {}", if vowel { "an" } else { "a" }, self.name)
    }
}

/// The ending of a path, in lower case.
fn ending(path: &Path) -> Option<String> {
    Some(path.extension()?.to_str()?.to_ascii_lowercase())
}

/// Whether bytes begin with a sign, in any case, after a byte-order mark and blanks.
pub(super) fn starts(bytes: &[u8], sign: &[u8]) -> bool {
    let body = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let body = body.trim_ascii_start();
    body.get(..sign.len())
        .is_some_and(|first| first.eq_ignore_ascii_case(sign))
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
