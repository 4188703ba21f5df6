//! Reading a shape file: text to a validated [`ShapeDocument`], or every fault in it.

use std::path::Path;
use strum::{EnumMessage, EnumString, IntoStaticStr, VariantArray};

use super::unit_names;
use super::{
    AxisRequest, Fit, GridRequest, Placement, Primitive, Seat, ShapeDocument, SurfaceSource, Up,
};
use crate::bodies::BodyOptions;
use crate::format::SurfaceFormat;
use fluxform_base::force_direction::{ForceDirection, NormalForce, RequestedForce};
use fluxform_base::point_weights::Weights;
use fluxform_base::units::{DIRECTION_JND_DEG, m_from_mm};
use fluxform_design::diagnostics::{Faults, InvalidDocument};
use fluxform_design::keys::{Key, with_meanings};
use fluxform_design::message_text::quoted;
use fluxform_design::reader::{Section, list_keys, read_document};
use fluxform_design::rule::{Bound, Rule};
use fluxform_design::source;
use fluxform_design::values::OneOrMany;
use fluxform_design::{BODY_MM, SEED_SIDE_MM, axis_m};

/// Most grid points of one shape.
pub const POINTS_MAX: usize = 100_000_000;

const SIZES: [&str; 7] = [
    "side_mm",
    "height_mm",
    "radius_mm",
    "length_mm",
    "base_mm",
    "low_mm",
    "high_mm",
];

/// A surface by its sizes alone.
#[derive(Debug, Clone, Copy, EnumMessage, EnumString, IntoStaticStr, VariantArray)]
#[strum(serialize_all = "kebab-case")]
enum Kind {
    Flat,
    HalfSphere,
    HalfCylinder,
    Wedge,
}

fluxform_base::choices!(Kind);

/// Points outside the workspace.
#[derive(Debug, Clone, Copy, EnumMessage, EnumString, IntoStaticStr, VariantArray)]
#[strum(serialize_all = "lowercase")]
enum Outside {
    Skip,
}

impl ShapeDocument {
    /// The shape that `text` describes, and the warnings about it. `path` names it in messages,
    /// and its folder is where a relative `surface` is looked for.
    ///
    /// # Errors
    /// Every fault found. Whether the surface exists is for the reader of surfaces to say.
    pub fn from_toml(text: &str, path: &Path) -> Result<(Self, Faults), InvalidDocument> {
        read_document(text, path, keys, |root, _| document(root, path))
    }

    /// The shape in the file `path`, as [`ShapeDocument::from_toml`].
    ///
    /// # Errors
    /// Every fault found, or why the file cannot be read.
    pub fn read(path: &Path) -> Result<(Self, Faults), InvalidDocument> {
        Self::from_toml(&source::text_of(path)?, path)
    }
}

fn document(root: &mut Section<'_>, path: &Path) -> Option<ShapeDocument> {
    let name = root.name();
    let source = match (root.has("surface"), root.has("primitive")) {
        (true, false) => surface(root, path),
        (false, true) => primitive(root),
        (given, _) => neither_or_both(root, given),
    };
    let scale = scale(root);
    let placement = Placement {
        translate_m: root.tuple("translate_mm", &BODY_MM).map(m_from_mm),
        rotate_deg: root.tuple("rotate_deg", &Rule::any("degrees")),
        seat: seat(root),
    };
    let bodies = bodies(root);
    let force = force(root);
    let noticed = Rule::any("degrees").bound(Bound::Within(1.0, 89.0));
    let direction_jnd = root.number_or("direction_jnd_deg", &noticed, DIRECTION_JND_DEG);
    if root.has("direction_jnd_deg") && !force.direction.is_vector() {
        let message = "it weighs sideways errors, which a vertical force leaves open";
        let help = "add force = \"vertical-only\" or \"normal\"";
        root.fault("direction_jnd_deg", message, help);
    }
    let Points {
        grid,
        is_given,
        weights,
    } = points(root.section("points"));
    Some(ShapeDocument {
        name: name?,
        source: source?,
        bodies,
        scale: scale?,
        placement,
        grid: grid?,
        force,
        direction_jnd_deg: direction_jnd.value,
        weights,
        grid_is_given: is_given,
    })
}

/// Whether the shape is a primitive: then `keys`, which it does not take, are at fault.
fn of_primitive(root: &mut Section<'_>, keys: &[&'static str], message: &str, help: &str) -> bool {
    if !root.has("primitive") {
        return false;
    }
    for key in keys.iter().filter(|key| root.has(key)) {
        root.fault(key, message, help);
    }
    root.ignore(keys);
    true
}

/// Where the surface goes by its own box.
fn seat(root: &mut Section<'_>) -> Seat {
    let (message, help) = (
        "a primitive lies where its base is",
        "use base_mm, height_mm or translate_mm",
    );
    let keys = ["up", "center", "rest_on_mm", "fit_mm", "scale_to_fit"];
    if of_primitive(root, &keys, message, help) {
        return Seat::default();
    }
    let up = root.choice::<Up>("up").unwrap_or_default();
    let center = root.flag_or("center", false);
    let rest_on = root.number("rest_on_mm", &BODY_MM);
    let ends = root.tuple_if_given::<6>("fit_mm", &BODY_MM);
    let scale = root.flag_or("scale_to_fit", false);
    if scale && !root.has("fit_mm") {
        let message = "there is no box to scale to";
        root.fault("scale_to_fit", message, "add fit_mm, the ends of a box");
    }
    if center && root.has("fit_mm") {
        let message = "fit_mm puts the surface into the middle of its box";
        root.fault("center", message, "leave one of the two out");
    }
    if root.has("rest_on_mm") && root.has("fit_mm") {
        let message = "fit_mm puts the surface onto the lower end of its box";
        root.fault("rest_on_mm", message, "leave one of the two out");
    }
    let fit = ends.map(|ends| {
        let [a, b, c, d, e, f] = ends.map(m_from_mm);
        Fit {
            box_m: [[a, b], [c, d], [e, f]],
            scale,
        }
    });
    if fit.is_some_and(|fit| fit.box_m.iter().any(|[from, to]| from >= to)) {
        let message = "a side of the box ends before it begins";
        root.fault("fit_mm", message, "write x, y and z, each FROM, TO, in mm");
    }
    Seat {
        up,
        center,
        rest_on_m: rest_on.map(|length| m_from_mm(length.value)),
        fit,
    }
}

/// The force that is requested over the surface.
fn force(root: &mut Section<'_>) -> RequestedForce {
    let direction: ForceDirection = root.choice_or_first("force");
    let normal_force: NormalForce = root.choice_or_first("normal_force");
    if root.has("normal_force") && direction != ForceDirection::Normal {
        let message = "the force is not along the normal";
        root.fault("normal_force", message, "add force = \"normal\"");
    }
    RequestedForce {
        direction,
        normal_force,
    }
}

/// How bodies of STEP files are cut into facets, and which.
fn bodies(root: &mut Section<'_>) -> BodyOptions {
    let message = "a primitive has no facets and no bodies";
    if of_primitive(root, &["chord_mm", "body"], message, "leave the key out") {
        return BodyOptions::default();
    }
    // A chord is far below any body's size: 10 um are no metres.
    let chord = root.number("chord_mm", &Rule::any("mm").positive());
    let body = root.text("body").map(|body| body.value);
    if body.as_deref() == Some("") {
        let help = "name one, as --inspect lists them, or leave the key out";
        root.fault("body", "names no body", help);
    }
    BodyOptions {
        chord_m: chord.map(|chord| m_from_mm(chord.value)),
        body,
    }
}

/// The keys of a shape: those of a surface file, then those of the primitives.
#[must_use]
pub fn keys() -> Vec<Key> {
    let mut all: Vec<Key> = Vec::new();
    for source in std::iter::once("surface").chain(Kind::ALL.iter().map(|kind| kind.name())) {
        for key in keys_read(source) {
            if !all.iter().any(|known| known.path() == key.path()) {
                all.push(key);
            }
        }
    }
    // The top level before its section.
    all.sort_by_key(|key| !key.section.is_empty());
    with_meanings(all, MEANINGS)
}

/// The keys of a shape with this primitive, or with a surface file where that is `None`.
#[must_use]
pub fn keys_of(primitive: Option<&str>) -> Vec<Key> {
    let read = keys_read(primitive.unwrap_or("surface"));
    let path = |key: &Key| read.iter().any(|one| one.path() == key.path());
    keys().into_iter().filter(path).collect()
}

/// Without their meanings.
fn keys_read(source: &str) -> Vec<Key> {
    let text = match source {
        "surface" => "surface = \"a.stl\"\n[points]\n".to_owned(),
        primitive => format!("primitive = {primitive:?}\n[points]\n"),
    };
    list_keys(&text, |root| {
        document(root, Path::new(""));
    })
}

const MEANINGS: &[(&str, &str)] = &[
    ("name", "names the folder of results"),
    (
        "surface",
        "a file from CAD, beside the shape; this or `primitive` is required",
    ),
    (
        "unit",
        "of the file's coordinates: mm, cm, m, um, in or ft; required where the format carries none",
    ),
    ("stretch", "whether `scale` may differ along the axes"),
    (
        "scale",
        "factor on a surface's size, or one along each of x, y and z",
    ),
    ("translate_mm", "moves the surface, after its rotation"),
    ("rotate_deg", "rotates it about x, then y, then z"),
    ("up", "the file's direction that points up"),
    ("center", "whether the middle of its box comes to x = y = 0"),
    ("rest_on_mm", "height of its lowest point"),
    (
        "fit_mm",
        "box that it is moved into, from and to along x, y and z: to the middle, onto the lower end",
    ),
    ("scale_to_fit", "whether it is also scaled to fill that box"),
    (
        "chord_mm",
        "STEP: how far a facet may lie from its face; without it a 4000th of the size",
    ),
    (
        "body",
        "STEP: the one body or assembly to read, by name or number",
    ),
    ("primitive", "a body with a formula, instead of a file"),
    ("side_mm", "of `flat` and `wedge`: length of a side"),
    ("height_mm", "of `flat`: its height above the windings"),
    ("radius_mm", "of `half-sphere` and `half-cylinder`"),
    ("base_mm", "of both: height of the plane they rise from"),
    ("length_mm", "of `half-cylinder`: its length"),
    ("low_mm", "of `wedge`: its height at the low side"),
    ("high_mm", "of `wedge`: its height at the high side"),
    (
        "points.x_mm",
        "grid of constraint points along x; where neither x_mm nor y_mm is given, `lambda` and `calibrate` take as many as --error needs",
    ),
    ("points.y_mm", "grid of constraint points along y"),
    (
        "force",
        "`vertical`: upward, sideways not controlled; `vertical-only`: no sideways force; `normal`: along the surface's normal; the last two with feedback",
    ),
    (
        "normal_force",
        "of `normal`: lambda times the height is the force's `magnitude`, or its `upward` part",
    ),
    (
        "direction_jnd_deg",
        "angle between forces that a finger just notices: how static currents weigh sideways errors",
    ),
    (
        "points.outside",
        "what becomes of grid points beside the surface: there is no point",
    ),
    (
        "points.weights",
        "how points count in lambda's mean: `equal`, or `area`, by the area each stands for",
    ),
];

/// Factors of size; `None` where they are at fault.
fn scale(root: &mut Section<'_>) -> Option<[f64; 3]> {
    let (message, help) = ("a primitive has its own sizes", "change its sizes instead");
    if of_primitive(root, &["scale", "stretch"], message, help) {
        return Some([1.0; 3]);
    }
    let rule = Rule::any("").bound(Bound::Positive);
    let stretch = root.flag_or("stretch", false);
    let factors = match root.one_or_many("scale", &rule, 1.0).value {
        OneOrMany::One(factor) => [factor; 3],
        OneOrMany::Many(factors) => match <[f64; 3]>::try_from(factors) {
            Ok(factors) => factors,
            Err(other) => {
                // An empty list is at fault already.
                if !other.is_empty() {
                    let message = format!("expected one number or 3, found {}", other.len());
                    root.fault("scale", message, "give factors along x, y and z");
                }
                return None;
            }
        },
    };
    if !stretch && factors.iter().any(|factor| *factor != factors[0]) {
        let message = "different factors change the surface's form";
        root.fault("scale", message, "add stretch = true if that is meant");
        return None;
    }
    Some(factors)
}

fn neither_or_both(root: &mut Section<'_>, both: bool) -> Option<SurfaceSource> {
    root.ignore(&["surface", "primitive", "unit"]);
    root.ignore(&SIZES);
    let help = "write surface = \"part.stl\" with its unit, or primitive = \"flat\"";
    if both {
        root.fault(
            "primitive",
            "surface and primitive exclude each other",
            help,
        );
    } else {
        root.missing("surface", help);
    }
    None
}

fn surface(root: &mut Section<'_>, path: &Path) -> Option<SurfaceSource> {
    root.ignore(&["primitive"]);
    let file = root.text("surface").map(|text| text.value);
    let unit_m = root.length_unit("unit");
    let file = file?;
    let format = SurfaceFormat::of(Path::new(&file));
    // The content of a file without an ending states its format once it is read.
    if format.is_none() && Path::new(&file).extension().is_some() {
        let message = format!(
            "expected a file ending in {}, found {}",
            SurfaceFormat::endings(),
            quoted(&file)
        );
        let advice = SurfaceFormat::advice(Path::new(&file));
        let advice = advice.unwrap_or("convert the surface to one of these");
        root.fault("surface", message, advice);
        return None;
    }
    if format.is_some_and(|format| !format.carries_unit()) && !root.has("unit") {
        let help = format!(
            "add unit = \"mm\" or what it was drawn in ({})",
            unit_names().join(", ")
        );
        root.missing("unit", &help);
    }
    Some(SurfaceSource::File {
        path: path.parent().unwrap_or(Path::new("")).join(file),
        unit_m,
    })
}

fn primitive(root: &mut Section<'_>) -> Option<SurfaceSource> {
    root.ignore(&["surface"]);
    if root.has("unit") {
        root.fault(
            "unit",
            "a primitive has no unit: its sizes are in mm",
            "leave the key out",
        );
    }
    root.ignore(&["unit"]);
    let Some(kind) = root.choice::<Kind>("primitive") else {
        root.ignore(&SIZES);
        return None;
    };

    let primitive = match kind {
        Kind::Flat => Primitive::Flat {
            side_m: size(root, "side_mm", 100.0),
            height_m: level(root, "height_mm", 50.0),
        },
        Kind::HalfSphere => Primitive::HalfSphere {
            radius_m: size(root, "radius_mm", 50.0),
            base_m: level(root, "base_mm", 30.0),
        },
        Kind::HalfCylinder => Primitive::HalfCylinder {
            radius_m: size(root, "radius_mm", 50.0),
            length_m: size(root, "length_mm", 100.0),
            base_m: level(root, "base_mm", 30.0),
        },
        Kind::Wedge => Primitive::Wedge {
            side_m: size(root, "side_mm", 100.0),
            low_m: level(root, "low_mm", 30.0),
            high_m: level(root, "high_mm", 80.0),
        },
    };
    Some(SurfaceSource::Primitive(primitive))
}

/// A size, m.
fn size(root: &mut Section<'_>, key: &'static str, default_mm: f64) -> f64 {
    m_from_mm(root.number_or(key, &BODY_MM.positive(), default_mm).value)
}

/// A height, m; a surface may start anywhere, the placement lifts it.
fn level(root: &mut Section<'_>, key: &'static str, default_mm: f64) -> f64 {
    m_from_mm(root.number_or(key, &BODY_MM, default_mm).value)
}

/// `[points]`.
struct Points {
    grid: Option<GridRequest>,
    is_given: bool,
    weights: Option<Weights>,
}

fn points(mut s: Section<'_>) -> Points {
    let is_given = s.has("x_mm") || s.has("y_mm");
    let x = s.axis_or("x_mm", &BODY_MM, SEED_SIDE_MM);
    let y = s.axis_or("y_mm", &BODY_MM, SEED_SIDE_MM);
    s.choice_or_first::<Outside>("outside");
    let weights = s.choice("weights");
    let grid = x.zip(y).map(|(x, y)| [x.value, y.value]);
    if let Some([x, y]) = &grid
        && x.samples
            .checked_mul(y.samples)
            .is_none_or(|n| n > POINTS_MAX)
    {
        let message = format!(
            "{} x {} points are more than {POINTS_MAX}",
            x.samples, y.samples
        );
        let finer = if x.samples < y.samples {
            "y_mm"
        } else {
            "x_mm"
        };
        s.fault(finer, message, "ask for fewer samples");
    }
    s.finish();
    let grid = grid.map(|axes| {
        let [x, y] = axes.map(|axis| AxisRequest::Given(axis_m(axis)));
        GridRequest { x, y }
    });
    Points {
        grid,
        is_given,
        weights,
    }
}
