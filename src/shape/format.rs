//! Which reader a surface file needs, by the ending of its name.

use std::path::Path;

use crate::shape::error::ShapeError;
use crate::shape::mesh::FileMesh;
use crate::shape::stl;

/// The surface formats that are known by name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// Stereolithography, binary or ASCII.
    Stl,
    /// Wavefront.
    Obj,
    /// Polygon file.
    Ply,
    /// 3D Manufacturing Format.
    ThreeMf,
    /// STEP (ISO 10303-21).
    Step,
    /// A native SOLIDWORKS part.
    Sldprt,
}

impl Format {
    /// The format of a path, by its extension in any case.
    ///
    /// # Errors
    /// [`ShapeError::Format`] for any other ending.
    pub fn of(path: &Path) -> Result<Self, ShapeError> {
        let ending = path
            .extension()
            .map(|e| e.to_string_lossy().to_ascii_lowercase());
        match ending.as_deref() {
            Some("stl") => Ok(Self::Stl),
            Some("obj") => Ok(Self::Obj),
            Some("ply") => Ok(Self::Ply),
            Some("3mf") => Ok(Self::ThreeMf),
            Some("step" | "stp") => Ok(Self::Step),
            Some("sldprt") => Ok(Self::Sldprt),
            _ => Err(ShapeError::Format {
                path: path.into(),
                what: "the name's ending says nothing of the format; a surface is a `.stl` file, \
                       a shape file ends in `.toml`"
                    .into(),
            }),
        }
    }

    /// The format's usual name.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Stl => "STL",
            Self::Obj => "OBJ",
            Self::Ply => "PLY",
            Self::ThreeMf => "3MF",
            Self::Step => "STEP",
            Self::Sldprt => "SLDPRT",
        }
    }

    /// The triangles of a file's bytes, in the file's unit.
    ///
    /// # Errors
    /// [`ShapeError::Stl`] with the place; [`ShapeError::Format`] where no reader is built.
    pub fn read(self, path: &Path, bytes: &[u8]) -> Result<FileMesh, ShapeError> {
        match self {
            Self::Stl => stl::read(bytes).map_err(|source| ShapeError::Stl {
                path: path.into(),
                source,
            }),
            _ => Err(self.not_built(path)),
        }
    }

    /// Refuses, before the file is opened, what no reader is built for.
    ///
    /// # Errors
    /// [`ShapeError::Format`] with what to export instead.
    pub fn check(self, path: &Path) -> Result<(), ShapeError> {
        if self == Self::Stl {
            Ok(())
        } else {
            Err(self.not_built(path))
        }
    }

    fn not_built(self, path: &Path) -> ShapeError {
        let advice = match self {
            Self::Step | Self::Sldprt => {
                "open it in the CAD program and save the body as STL (binary, fine resolution)"
            }
            _ => "export the surface as STL (binary)",
        };
        ShapeError::Format {
            path: path.into(),
            what: format!(
                "{} files are not read by this version, only STL is; {advice} and state its unit",
                self.name()
            ),
        }
    }
}
