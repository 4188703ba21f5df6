//! Which reader a surface file needs, and what it gives.

use std::path::Path;

use crate::document::SurfaceFormat;
use crate::error::ShapeError;
use crate::mesh::FileMesh;
use crate::read_error::ReadError;
use crate::{amf, obj, ply, sldprt, stl, three_dxml, three_mf};

impl SurfaceFormat {
    /// The triangles of a file's bytes, in the file's unit; `path` names it in messages.
    ///
    /// # Errors
    /// [`ShapeError::Stl`] and [`ShapeError::Content`] with the place.
    pub fn read(self, path: &Path, bytes: &[u8]) -> Result<FileMesh, ShapeError> {
        let read: fn(&[u8]) -> Result<FileMesh, ReadError> = match self {
            Self::Stl => {
                return stl::read(bytes).map_err(|source| ShapeError::Stl {
                    path: path.into(),
                    source,
                });
            }
            Self::Obj => obj::read,
            Self::Ply => ply::read,
            Self::ThreeMf => three_mf::read,
            Self::Amf => amf::read,
            Self::ThreeDxml => three_dxml::read,
            Self::Sldprt => sldprt::read,
            #[cfg(feature = "step")]
            Self::Step => crate::step::read,
            #[cfg(not(feature = "step"))]
            Self::Step => step,
        };
        let mesh = if bytes.is_empty() {
            Err(ReadError::file(
                "the file is empty (0 bytes): the export or the download failed",
            ))
        } else {
            read(bytes)
        };
        mesh.map_err(|source| ShapeError::Content {
            path: path.into(),
            source,
        })
    }
}

#[cfg(not(feature = "step"))]
fn step(_: &[u8]) -> Result<FileMesh, ReadError> {
    Err(ReadError::file(
        "STEP files are not read by this version: open it in the CAD program and save the body \
         as 3MF or STL (binary, fine resolution)",
    ))
}
