//! Which reader a surface file needs, and what it gives.

use std::path::Path;

use crate::document::SurfaceFormat;
use crate::error::ShapeError;
use crate::mesh::FileMesh;
use crate::read_error::ReadError;
use crate::step::{self, BodyOptions};
use crate::{amf, obj, ply, sldprt, stl, three_dxml, three_mf};
use fluxform_base::progress::Silent;

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
            Self::Step => |bytes| step::read(bytes, &BodyOptions::default(), &Silent),
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
