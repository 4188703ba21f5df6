//! `init`: a design and a shape to begin with.

pub(crate) mod command;

use std::path::Path;
use strum::{EnumMessage, EnumString, IntoStaticStr, VariantArray};

use toml::{Table, Value};

use crate::design::commented::commented;
use crate::design::keys::of_designs;
use crate::design::named_file::NamedFile;
use crate::design::template::Template;
use crate::design::{Design, InvalidDocument, Need};
use crate::numerics::axis::Axis;
use crate::plot::array::ArrayPlot;
use crate::scene::drawing::drawing;
use crate::shape::document;

/// A design to begin with.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, EnumMessage, EnumString, IntoStaticStr, VariantArray,
)]
#[strum(serialize_all = "lowercase")]
pub enum Start {
    /// nine coils with steel cores
    Seed,
    /// sixteen small coils in air
    Desk,
    /// one coil in air
    Coil,
}

impl Start {
    fn toml(self) -> &'static str {
        match self {
            Self::Seed => include_str!("../../../designs/seed.toml"),
            Self::Desk => DESK,
            Self::Coil => COIL,
        }
    }
}

const DESK: &str = "
name = 'desk'
coil = { inner_diameter_mm = 5.0, outer_diameter_mm = 18.0, length_mm = 30.0 }
wire = { diameter_mm = 0.5, conductor_diameter_mm = 0.45 }
array = { rows = 4, columns = 4, pitch_mm = 20.0 }
magnet = { diameter_mm = 10.0, length_mm = 10.0, magnetization_a_per_m = 1.05e6 }
supply = { current_max_a = 2.0, voltage_v = 24.0 }
target = { height_mm = 12.0 }
workspace = { x_mm = [-30.0, 30.0, 41], y_mm = [-30.0, 30.0, 41], z_mm = [8.0, 36.0, 29] }
";

const COIL: &str = "
name = 'coil'
coil = { inner_diameter_mm = 10.0, outer_diameter_mm = 38.0, length_mm = 40.0 }
wire = { diameter_mm = 0.7, conductor_diameter_mm = 0.65 }
magnet = { diameter_mm = 10.0, length_mm = 10.0, magnetization_a_per_m = 1.05e6 }
supply = { current_max_a = 2.0, voltage_v = 24.0 }
target = { height_mm = 15.0 }
workspace = { x_mm = [-10.0, 10.0, 21], y_mm = [-10.0, 10.0, 21], z_mm = [10.0, 45.0, 29] }
";

/// An object to begin with.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, EnumMessage, EnumString, IntoStaticStr, VariantArray,
)]
#[strum(serialize_all = "kebab-case")]
pub enum Object {
    /// a plate
    Flat,
    /// half a sphere
    HalfSphere,
    /// half a cylinder
    HalfCylinder,
    /// a plate that rises
    Wedge,
}

crate::choices!(Start, Object);

impl Object {
    /// Its sizes inside a workspace, mm. In that of the seed they are the seed's.
    fn sizes_mm(self, [x, y, z]: [Axis; 3]) -> Vec<(&'static str, f64)> {
        let span = |axis: Axis| axis.to - axis.from;
        let part = |sevenths: f64| z.from + sevenths / 7.0 * span(z);
        let side = span(x).max(span(y));
        let radius = |half: f64| half.min(z.to - part(2.0));
        match self {
            Self::Flat => vec![("side_mm", side), ("height_mm", part(4.0))],
            Self::HalfSphere => vec![
                ("radius_mm", radius(0.5 * span(x).min(span(y)))),
                ("base_mm", part(2.0)),
            ],
            Self::HalfCylinder => vec![
                ("radius_mm", radius(0.5 * span(x))),
                ("length_mm", span(y)),
                ("base_mm", part(2.0)),
            ],
            Self::Wedge => vec![("side_mm", side), ("low_mm", part(2.0)), ("high_mm", z.to)],
        }
    }
}

/// The files that are written at first.
#[derive(Debug, Clone)]
pub struct Request {
    /// The design that is changed.
    pub start: Start,
    /// The object.
    pub object: Object,
    /// Name of the design; `None` for that of the start.
    pub name: Option<String>,
    /// Keys of the design and their values.
    pub settings: Vec<(String, Value)>,
}

impl Request {
    /// Whether `key` is among the keys that are set.
    fn sets(&self, key: &str) -> bool {
        self.settings.iter().any(|(set, _)| set == key)
    }
}

/// A design and a shape, which calibrate as they are where no key is set.
#[derive(Debug, Clone)]
pub struct Documents {
    /// File name and text of the design.
    pub design: (String, String),
    /// File name and text of the shape.
    pub shape: (String, String),
    /// The array, to draw.
    pub array: Option<ArrayPlot>,
    /// The files that the design names, not read here; paths from the design's folder.
    pub named_files: Vec<NamedFile>,
}

/// Why there are no documents.
#[derive(Debug)]
pub enum Refusal {
    /// A key that leads nowhere, or is set twice.
    Setting(String),
    /// A design that no command would take.
    Design(InvalidDocument),
}

/// The documents that `request` describes.
///
/// The workspace follows the array's pitch where the request sets one and no workspace.
///
/// # Errors
/// Settings that make no design.
pub fn documents(request: &Request) -> Result<Documents, Refusal> {
    let source = Path::new("--set");
    let mut template = Template::new(request.start.toml(), source).map_err(Refusal::Design)?;
    // Axes that are given replace the template's grid.
    if request.sets("array.positions_mm") {
        for of_grid in ["array.rows", "array.columns", "array.pitch_mm"] {
            template.remove(of_grid);
        }
    }
    let mut settings = request.settings.clone();
    if let Some(name) = &request.name {
        if request.sets("name") {
            let message = "--name and --set name both name the design: leave one of them out";
            return Err(Refusal::Setting(message.to_owned()));
        }
        settings.push(("name".to_owned(), Value::String(name.clone())));
    }
    let text = text_of(&template, &settings)?;
    let (start, _) = Design::from_toml(request.start.toml(), source, Need::CALIBRATE)
        .map_err(Refusal::Design)?;
    let (given, _) = Design::from_toml(&text, source, Need::SWEEP).map_err(Refusal::Design)?;
    let chosen = settings.iter().any(|(key, _)| key.starts_with("workspace"));
    if !chosen && given.array.positions_m != start.array.positions_m {
        settings.extend(workspace_of(&start, &given));
    }
    let text = text_of(&template, &settings)?;
    let (design, _) = Design::from_toml(&text, source, Need::CALIBRATE).map_err(Refusal::Design)?;
    let head = format!(
        "A design: {}. Lengths are in mm.\nA key behind a # is not set; what it shows holds without it.\n\
         A section behind a # is left out, with what it would add.",
        request.start.meaning()
    );
    let values = Template::new(&text, source)
        .map_err(Refusal::Design)?
        .into_table();
    let shape = shape_of(request.object, &design);
    let primitive = request.object.name();
    let shape_head = format!(
        "An object, {primitive}, inside the workspace of {}.\nA key behind a # is not set; what it \
         shows holds without it. In place of primitive, surface names a file from CAD.",
        design.name
    );
    let name = &design.name;
    Ok(Documents {
        array: drawing(&design, []),
        named_files: design.named_files(),
        design: (
            format!("{name}.toml"),
            commented(&head, &of_designs(), &values),
        ),
        shape: (
            format!("{name}_{primitive}.toml"),
            commented(&shape_head, &document::keys_of(Some(primitive)), &shape),
        ),
    })
}

fn text_of(template: &Template, settings: &[(String, Value)]) -> Result<String, Refusal> {
    let settings = settings
        .iter()
        .map(|(key, value)| (key.as_str(), value.clone()));
    template.with(settings).map_err(Refusal::Setting)
}

/// A workspace for the axes of `given`, in proportion to that of `start`, never so low that the
/// magnet reaches the windings.
fn workspace_of(start: &Design, given: &Design) -> Vec<(String, Value)> {
    let extent = |design: &Design, k: usize| {
        let along = |fold: fn(f64, f64) -> f64, from: f64| {
            design
                .array
                .positions_m
                .iter()
                .map(|place| place[k])
                .fold(from, fold)
        };
        [
            along(f64::min, f64::INFINITY),
            along(f64::max, f64::NEG_INFINITY),
        ]
    };
    let mut ends = [0, 1].map(|k| extent(given, k));
    // A row of coils is as wide as one of them.
    let width = given.coil.map_or(0.0, |coil| coil.outer_diameter_m);
    for [from, to] in &mut ends {
        if to <= from {
            (*from, *to) = (*from - 0.25 * width, *to + 0.25 * width);
        }
    }
    let pitch = |design: &Design| design.array.grid.map(|grid| grid.pitch_m);
    let scale = match (pitch(start), pitch(given)) {
        (Some(before), Some(now)) => now / before,
        _ => 1.0,
    };
    let z = start.workspace.z_m;
    let least = 0.5 * given.magnet.length_m;
    let from = (scale * z.from).max(least);
    let heights = [from, from + scale * (z.to - z.from)];
    let samples = [start.workspace.x_m, start.workspace.y_m, z].map(|axis| axis.samples);
    ["x_mm", "y_mm", "z_mm"]
        .into_iter()
        .zip([ends[0], ends[1], heights])
        .zip(samples)
        .map(|((key, ends), samples)| (format!("workspace.{key}"), axis(ends, samples)))
        .collect()
}

fn axis(ends_m: [f64; 2], samples: usize) -> Value {
    let [from, to] = ends_m.map(|end| Value::Float(rounded(1e3 * end)));
    Value::Array(vec![from, to, Value::Integer(samples as i64)])
}

/// To a thousandth of a millimetre.
fn rounded(value_mm: f64) -> f64 {
    (value_mm * 1e3).round() / 1e3
}

/// The shape's values.
fn shape_of(object: Object, design: &Design) -> Table {
    let space = &design.workspace;
    let axes_mm = [space.x_m, space.y_m, space.z_m].map(|axis| Axis {
        from: 1e3 * axis.from,
        to: 1e3 * axis.to,
        samples: axis.samples,
    });
    let mut table = Table::new();
    let text = |text: &str| Value::String(text.to_owned());
    table.insert("name".to_owned(), text(object.name()));
    table.insert("primitive".to_owned(), text(object.name()));
    for (key, value) in object.sizes_mm(axes_mm) {
        table.insert(key.to_owned(), Value::Float(rounded(value)));
    }
    let points = [("x_mm", space.x_m), ("y_mm", space.y_m)]
        .map(|(key, along)| (key.to_owned(), axis([along.from, along.to], along.samples)));
    // Of a grid those of its border stand for less: alike they would be off by the first power of the spacing.
    let weights = ("weights".to_owned(), text("area"));
    table.insert(
        "points".to_owned(),
        Value::Table(points.into_iter().chain([weights]).collect()),
    );
    table
}
