//! A finished drawing, written as the ending of its file asks.

use kuva::backend::pdf::PdfBackend;
use kuva::backend::png::PngBackend;
use kuva::backend::svg::SvgBackend;
use kuva::render::render::{Primitive, Scene, TextAnchor};

/// Pixels of a PNG along a pixel of the drawing: sharp on screens of today and in print.
const PNG_SCALE: f32 = 2.0;

/// How a drawing is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DrawingFormat {
    /// Text, the same bytes for the same numbers.
    Svg,
    /// Pixels.
    Png,
    /// One page of the drawing's size.
    Pdf,
}

impl DrawingFormat {
    /// All of them, each named by its ending.
    pub const ALL: [(&str, Self); 3] = [("svg", Self::Svg), ("png", Self::Png), ("pdf", Self::Pdf)];

    /// The one that an ending names, in any case.
    #[must_use]
    pub fn of(ending: &str) -> Option<Self> {
        let named = |(name, _): &&(&str, Self)| name.eq_ignore_ascii_case(ending);
        Self::ALL.iter().find(named).map(|(_, format)| *format)
    }
}

/// A drawing, its sizes in pixels.
#[derive(Debug)]
pub struct Drawing(Scene);

impl Drawing {
    pub(super) fn new(mut scene: Scene) -> Self {
        fit(&mut scene);
        Self(scene)
    }

    /// As SVG.
    #[must_use]
    pub fn svg(&self) -> String {
        renumbered(&SvgBackend::default().render_scene(&self.0))
    }

    /// As SVG that takes the size of the place that it stands in.
    #[must_use]
    pub fn markup(&self) -> String {
        let scales = format!("<svg viewBox=\"0 0 {} {}\" ", self.0.width, self.0.height);
        self.svg().replacen("<svg ", &scales, 1)
    }

    /// In `format`.
    ///
    /// # Errors
    /// A drawing that is too large for it.
    pub fn bytes(&self, format: DrawingFormat) -> Result<Vec<u8>, String> {
        match format {
            DrawingFormat::Svg => Ok(self.svg().into_bytes()),
            DrawingFormat::Png => PngBackend::new()
                .with_scale(PNG_SCALE)
                .render_scene(&self.0),
            DrawingFormat::Pdf => PdfBackend::new().render_scene(&self.0),
        }
    }
}

/// Shortens titles over the whole drawing that would leave it.
fn fit(scene: &mut Scene) {
    let width = scene.width;
    let mut within = 0;
    for element in &mut scene.elements {
        match element {
            Primitive::GroupStart { .. } => within += 1,
            Primitive::GroupEnd => within -= 1,
            Primitive::Text {
                x,
                content,
                size,
                anchor: TextAnchor::Middle,
                rotate: None,
                ..
            } if within == 0 => {
                let room = 2.0 * x.min(width - *x) - f64::from(*size);
                *content = shortened(content, room / f64::from(*size));
            }
            _ => {}
        }
    }
}

/// A text of at most so many times its size in width: its beginning and its end.
fn shortened(text: &str, most: f64) -> String {
    let wide = |c: &char| match c {
        'M' | 'W' | 'm' | 'w' => 0.95,
        'A'..='Z' | '0'..='9' | '_' => 0.72,
        _ => 0.58,
    };
    let mut characters: Vec<char> = text.chars().collect();
    let width = |of: &[char]| of.iter().map(wide).sum::<f64>();
    if width(&characters) <= most {
        return text.to_owned();
    }
    while width(&characters) + 1.0 > most && characters.len() > 2 {
        characters.remove(characters.len() / 2);
    }
    characters.insert(characters.len() / 2, '\u{2026}');
    characters.into_iter().collect()
}

/// The drawing with its clip paths counted from 0: the crate counts on through a process.
fn renumbered(svg: &str) -> String {
    const NAME: &str = "kuva-clip-";
    let mut parts = svg.split(NAME);
    let mut text = parts.next().unwrap_or("").to_owned();
    let mut seen: Vec<&str> = Vec::new();
    for part in parts {
        let digits = part.bytes().take_while(u8::is_ascii_digit).count();
        let (number, rest) = part.split_at(digits);
        let at = seen.iter().position(|one| *one == number);
        let at = at.unwrap_or_else(|| {
            seen.push(number);
            seen.len() - 1
        });
        text.push_str(&format!("{NAME}{at}{rest}"));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Titles of long names ended beyond both sides of the drawing.
    #[test]
    fn regression_a_long_title_left_the_drawing() {
        let title = "W".repeat(100) + ": the array";
        let fitted = shortened(&title, 24.0);
        assert!(
            fitted.starts_with("WWWW") && fitted.ends_with("the array"),
            "{fitted}"
        );
        assert!(
            fitted.contains('\u{2026}') && fitted.chars().count() < 32,
            "{fitted}"
        );
        assert_eq!(shortened("seed: the array", 24.0), "seed: the array");
    }
}
