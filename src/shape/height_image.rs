//! A height image: a PNG of grey, 8 or 16 bit, read as a surface over its pixels.
//!
//! A pixel's centre is a vertex: x to the right and y upwards in pixels from the lower left one,
//! z from 0 (black) to 1 (white). Unit and scale make lengths of these: `unit = "mm"` and
//! `scale = [0.2, 0.2, 25]` are pixels of 0.2 mm, white 25 mm high. Transparent pixels are holes.

use std::io::Cursor;

use png::{ColorType, Decoder, Limits, Transformations};

use crate::file_mesh::{FileMesh, Triangle};
use crate::memory;
use crate::read_error::ReadError;

/// More pixels than this are more triangles than a computer holds.
const MOST_PIXELS: u64 = 50_000_000;
/// Highest grey levels of the two depths that images are read in.
const LEVELS: [f64; 2] = [255.0, 65535.0];

/// True for bytes that begin as PNG files do.
pub(crate) fn begins(bytes: &[u8]) -> bool {
    bytes.starts_with(b"\x89PNG\r\n\x1a\n")
}

/// Reads a PNG file's bytes.
///
/// # Errors
/// [`ReadError`]: a damaged image, colours, fewer than two pixels a side, too many.
pub fn read(bytes: &[u8]) -> Result<FileMesh, ReadError> {
    let damaged = |error: png::DecodingError| {
        ReadError::file(format!("the PNG image is damaged: {error}; save it again"))
    };
    let limits = Limits {
        bytes: 8 * MOST_PIXELS as usize,
    };
    let mut decoder = Decoder::new_with_limits(Cursor::new(bytes), limits);
    // Palettes and depths below 8 bit become grey or colours of 8.
    decoder.set_transformations(Transformations::EXPAND);
    let mut reader = decoder.read_info().map_err(damaged)?;
    let (width, height) = reader.info().size();
    // Of the file: samples of less than 8 bit are widened to the same heights.
    let bits = reader.info().bit_depth as u8;
    let pixels = u64::from(width) * u64::from(height);
    if width < 2 || height < 2 || pixels > MOST_PIXELS {
        let what = format!(
            "the image has {width} x {height} pixels; a surface needs 2 x 2 and at most \
             {MOST_PIXELS} altogether"
        );
        return Err(ReadError::file(what));
    }
    // The deflated rows cannot hold more than a thousand times their bytes.
    if pixels / 1100 > bytes.len() as u64 {
        let what = "the image claims more pixels than its bytes can hold: it was cut short";
        return Err(ReadError::file(what));
    }
    let triangles = 2 * u64::from(width - 1) * u64::from(height - 1);
    memory::check(triangles).map_err(ReadError::file)?;
    let channels = match reader.output_color_type().0 {
        ColorType::Grayscale => 1,
        ColorType::GrayscaleAlpha => 2,
        ColorType::Rgb | ColorType::Rgba | ColorType::Indexed => {
            let what = "the image is in colour: heights are read from grey; save it as a PNG of 16 \
                        bit grey";
            return Err(ReadError::file(what));
        }
    };
    let size = reader.output_buffer_size();
    let size = size.ok_or_else(|| ReadError::file("the image is too large"))?;
    let mut data = vec![0; size];
    let frame = reader.next_frame(&mut data).map_err(damaged)?;
    let wide = frame.bit_depth == png::BitDepth::Sixteen;
    let image = Image {
        data: &data,
        columns: width as usize,
        rows: height as usize,
        channels,
        wide,
    };
    let triangles = image.triangles();
    if triangles.is_empty() {
        let what = "no four neighbouring pixels of the image are opaque: there is no surface";
        return Err(ReadError::file(what));
    }
    let mut warnings = Vec::new();
    if !wide {
        warnings.push(format!(
            "the image has {bits} bit: its heights are steps of 1/{} of its range; save it with 16 bit",
            highest_level(bits)
        ));
    }
    Ok(FileMesh {
        triangles,
        // Pixels are exact, as far as doubles are; heights are known to half a level.
        coordinate_rounding: f64::from(width.max(height)) * f64::EPSILON,
        level_rounding: 0.5 / highest_level(bits),
        warnings,
        ..FileMesh::default()
    })
}

/// The highest grey level of so many bits.
fn highest_level(bits: u8) -> f64 {
    f64::from((1_u32 << bits) - 1)
}

struct Image<'a> {
    data: &'a [u8],
    columns: usize,
    rows: usize,
    channels: usize,
    /// Whether samples have 16 bit.
    wide: bool,
}

impl Image<'_> {
    fn sample(&self, column: usize, row: usize, channel: usize) -> f64 {
        let at = (row * self.columns + column) * self.channels + channel;
        let value = match self.wide {
            true => f64::from(u16::from_be_bytes([
                self.data[2 * at],
                self.data[2 * at + 1],
            ])),
            false => f64::from(self.data[at]),
        };
        value / LEVELS[usize::from(self.wide)]
    }

    /// The vertex of a pixel, rows counted from the top; `None` where it is transparent.
    fn vertex(&self, column: usize, row: usize) -> Option<[f64; 3]> {
        let opaque = self.channels == 1 || self.sample(column, row, 1) > 0.0;
        let y = (self.rows - 1 - row) as f64;
        opaque.then(|| [column as f64, y, self.sample(column, row, 0)])
    }

    /// Two triangles for each four neighbouring pixels, parted along the diagonal whose ends
    /// differ less in height.
    fn triangles(&self) -> Vec<Triangle> {
        let mut triangles = Vec::with_capacity(2 * (self.columns - 1) * (self.rows - 1));
        for row in 1..self.rows {
            fluxform_base::progress::poll();
            for column in 1..self.columns {
                let corner = |right: usize, up: usize| self.vertex(column - 1 + right, row - up);
                let corners = (corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1));
                let (Some(a), Some(b), Some(c), Some(d)) = corners else {
                    continue;
                };
                if (a[2] - c[2]).abs() <= (b[2] - d[2]).abs() {
                    triangles.extend([[a, b, c], [a, c, d]]);
                } else {
                    triangles.extend([[a, b, d], [b, c, d]]);
                }
            }
        }
        triangles
    }
}
