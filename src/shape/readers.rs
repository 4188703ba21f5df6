//! The readers of surface formats, and what is said of bytes that are of another one.

use std::path::Path;

use crate::archive::Archive;
use crate::bodies::BodyOptions;
use crate::error::ShapeError;
use crate::file_mesh::FileMesh;
use crate::format::SurfaceFormat;
use crate::read_error::ReadError;
use crate::text::starts;
use crate::{amf, glb, height_image, obj, off, ply, sldprt, step, stl, three_dxml, three_mf};
use fluxform_base::progress::Silent;

/// Whether bytes begin as files of a format do (never true for two formats), and its reader.
type Reader = (fn(&[u8]) -> bool, fn(&[u8]) -> Result<FileMesh, ReadError>);

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
    fn reader(self) -> Reader {
        match self {
            Self::Stl => (stl::begins, stl::read),
            Self::Obj => (obj::begins, obj::read),
            Self::Ply => (ply::begins, ply::read),
            Self::Off => (off::begins, off::read),
            Self::Glb => (glb::begins, glb::read),
            Self::HeightImage => (height_image::begins, height_image::read),
            Self::ThreeMf => (three_mf::begins, three_mf::read),
            Self::Amf => (amf::begins, amf::read),
            Self::ThreeDxml => (three_dxml::begins, three_dxml::read),
            Self::Sldprt => (sldprt::begins, sldprt::read),
            Self::Step => (
                |bytes| starts(bytes, b"ISO-10303-21"),
                |bytes| step::read(bytes, &BodyOptions::default(), &Silent),
            ),
        }
    }

    /// The format of a file's bytes, for names without an ending; `None` where they show none.
    #[must_use]
    pub fn of_content(bytes: &[u8]) -> Option<Self> {
        Self::all().find(|format| format.reader().0(bytes))
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
        let other = |what: &str| ReadError::file(format!("this is not {} {what}", self.article()));
        if let Some((_, what)) = OTHER.iter().find(|(sign, _)| starts(bytes, sign)) {
            return Err(other(&format!("file but {what}")));
        }
        let result = self.reader().1(bytes);
        // A file of another format under this name fails somewhere: the name is the fault then.
        if result.is_err() && !self.reader().0(bytes) {
            if let Some(format) = Self::of_content(bytes) {
                return Err(other(&format!(
                    "file but {} file: give it the ending .{}",
                    format.article(),
                    format.usual_ending()
                )));
            }
            if Archive::is(bytes) && !self.may_be_zip() {
                return Err(other(
                    "file but a ZIP archive: unpack it first, and name the surface in it",
                ));
            }
        }
        result
    }

    /// Whether its files may be ZIP archives; their readers say what a damaged one lacks.
    fn may_be_zip(self) -> bool {
        matches!(self, Self::ThreeMf | Self::Amf | Self::ThreeDxml)
    }

    /// Its name with an article.
    fn article(self) -> String {
        let name = self.name();
        let vowel = name.starts_with(['A', 'E', 'I', 'O']) || name == "STL";
        format!("{} {name}", if vowel { "an" } else { "a" })
    }
}
