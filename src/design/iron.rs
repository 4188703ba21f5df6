//! Steel beyond the cores: `[plate]` below them and bodies `[[iron]]`.

use std::path::PathBuf;

use strum::{EnumMessage, EnumString, IntoStaticStr, VariantArray};

use super::reader::{Located, Section};
use super::rule::{
    BODY_MM, Bound, LOW_CARBON_KNEE_T, OFFSET_MM, RELATIVE_PERMEABILITY,
    RELATIVE_PERMEABILITY_DEFAULT, Rule,
};
use fluxform_base::units::m_from_mm;

/// Linear steel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LinearSteel {
    /// mu_r.
    pub relative_permeability: f64,
    /// Flux density above which a warning is due, T.
    pub knee_t: f64,
}

/// Sides or diameter of a plate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum PlateOutline {
    /// Along x and y, m.
    Rectangle([f64; 2]),
    /// Diameter, m.
    Round(f64),
}

/// A hole through a plate, for a screw.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hole {
    /// Its axis, m.
    pub at_m: [f64; 2],
    /// Its diameter, m.
    pub diameter_m: f64,
}

/// A level plate below the coils, its middle below the middle of their axes.
#[derive(Debug, Clone, PartialEq)]
pub struct Plate {
    /// Thickness, m.
    pub thickness_m: f64,
    /// Its size.
    pub outline: PlateOutline,
    /// From the cores' (else the windings') lower ends down to its upper face, m; cores touch it at 0.
    pub gap_m: f64,
    /// Holes through it.
    pub holes: Vec<Hole>,
    /// Material.
    pub steel: LinearSteel,
}

impl Plate {
    /// Sides along x and y and diameter, m; those that it has.
    #[must_use]
    pub fn sides_m(&self) -> [Option<f64>; 3] {
        match self.outline {
            PlateOutline::Rectangle([x, y]) => [Some(x), Some(y), None],
            PlateOutline::Round(diameter) => [None, None, Some(diameter)],
        }
    }

    /// Its volume, m^3.
    #[must_use]
    pub fn volume_m3(&self) -> f64 {
        let area_m2 = match self.outline {
            PlateOutline::Rectangle([x, y]) => x * y,
            PlateOutline::Round(diameter) => std::f64::consts::FRAC_PI_4 * diameter * diameter,
        };
        let of_hole = |hole: &Hole| std::f64::consts::FRAC_PI_4 * hole.diameter_m.powi(2);
        let holes_m2: f64 = self.holes.iter().map(of_hole).sum();
        (area_m2 - holes_m2) * self.thickness_m
    }
}

/// The shape of a body about its middle.
#[derive(Debug, Clone, PartialEq)]
pub enum IronShape {
    /// Sides along x, y and z, m.
    Box([f64; 3]),
    /// About z: inner and outer diameter and length, m; the inner one 0 for a full cylinder.
    Tube([f64; 3]),
    /// Diameter, m.
    Ball(f64),
    /// A closed surface of triangles, about its file's origin.
    Mesh {
        /// Its file, the path resolved against the design file's folder.
        surface: PathBuf,
        /// Metres of the file's unit, where the design states it.
        unit_m: Option<f64>,
    },
}

/// A body of steel.
#[derive(Debug, Clone, PartialEq)]
pub struct Iron {
    /// Its shape.
    pub shape: IronShape,
    /// Its middle; of a mesh where its file's origin is, m.
    pub centre_m: [f64; 3],
    /// Rotation about x, then y, then z, degrees.
    pub rotate_deg: [f64; 3],
    /// Material.
    pub steel: LinearSteel,
}

fn steel(s: &mut Section<'_>) -> LinearSteel {
    if s.has("bh_curve") {
        s.ignore(&["bh_curve"]);
        s.fault(
            "bh_curve",
            "plates and bodies of [[iron]] are solved as linear steel, not along a curve",
            "give relative_permeability, and the curve's knee as knee_t: `evaluate` states the largest flux density beside \
             the knee (array.iron) and its error (accuracy.iron_field); above the knee the answer is worth nothing",
        );
    }
    LinearSteel {
        relative_permeability: s
            .number_or(
                "relative_permeability",
                &RELATIVE_PERMEABILITY,
                RELATIVE_PERMEABILITY_DEFAULT,
            )
            .value,
        knee_t: s
            .number_or("knee_t", &Rule::any("T").positive(), LOW_CARBON_KNEE_T)
            .value,
    }
}

pub(super) fn plate(mut s: Section<'_>) -> Option<Plate> {
    if !s.is_present() {
        return None;
    }
    let size = BODY_MM.positive();
    let thickness = s.required("thickness_mm", &size);
    let (x, y) = (s.number("x_mm", &size), s.number("y_mm", &size));
    let diameter = s.number("diameter_mm", &size);
    let gap = s.number_or("gap_mm", &OFFSET_MM.bound(Bound::NotNegative), 0.0);
    let holes = holes(&mut s);
    let steel = steel(&mut s);
    let outline = match (x, y, diameter) {
        (Some(x), Some(y), None) => Some(PlateOutline::Rectangle(
            [x, y].map(|side| m_from_mm(side.value)),
        )),
        (None, None, Some(diameter)) => Some(PlateOutline::Round(m_from_mm(diameter.value))),
        (x, _, _) => {
            let key = if x.is_some() { "x_mm" } else { "diameter_mm" };
            s.fault(
                key,
                "expected the plate's two sides or its diameter",
                "give x_mm and y_mm, or give diameter_mm",
            );
            None
        }
    };
    s.finish();
    Some(Plate {
        thickness_m: m_from_mm(thickness.value),
        outline: outline?,
        gap_m: m_from_mm(gap.value),
        holes,
        steel,
    })
}

/// Most holes of a plate.
const HOLES_MAX: usize = 1000;

fn holes(s: &mut Section<'_>) -> Vec<Hole> {
    const KEY: &str = "holes_mm";
    let given = s.tuples::<3>(KEY, &BODY_MM, HOLES_MAX, ["hole", "[x, y, diameter]"]);
    let given = given.unwrap_or_default();
    if let Some(index) = given.iter().position(|hole| hole.value[2] <= 0.0) {
        let message = format!("hole {index} has no diameter above 0");
        s.fault(KEY, message, "as in holes_mm = [[60.0, 60.0, 5.0]]");
    }
    given
        .into_iter()
        .map(|hole| {
            let [x, y, diameter] = hole.value.map(m_from_mm);
            Hole {
                at_m: [x, y],
                diameter_m: diameter,
            }
        })
        .collect()
}

/// Kinds of bodies.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, EnumMessage, EnumString, IntoStaticStr, VariantArray,
)]
#[strum(serialize_all = "lowercase")]
enum Kind {
    /// A box.
    Box,
    /// A cylinder.
    Cylinder,
    /// A tube.
    Tube,
    /// A ball.
    Ball,
    /// A closed mesh.
    Mesh,
}

/// Required keys of a kind of body.
fn required(kind: Kind) -> &'static [&'static str] {
    match kind {
        Kind::Box => &["size_mm"],
        Kind::Cylinder => &["diameter_mm", "length_mm"],
        Kind::Tube => &["diameter_mm", "inner_diameter_mm", "length_mm"],
        Kind::Ball => &["diameter_mm"],
        Kind::Mesh => &["surface"],
    }
}

/// Optional keys, and its place.
fn optional(kind: Kind) -> &'static [&'static str] {
    match kind {
        Kind::Mesh => &["unit", "translate_mm"],
        Kind::Box | Kind::Cylinder | Kind::Tube | Kind::Ball => &["center_mm"],
    }
}

/// Reports keys that the kind of body lacks, and those that it does not have.
fn check_keys(s: &Section<'_>, kind: Kind) {
    let (required, optional) = (required(kind), optional(kind));
    let all = <Kind as VariantArray>::VARIANTS.iter();
    let mut keys: Vec<&str> = all
        .flat_map(|kind| [self::required(*kind), self::optional(*kind)].concat())
        .collect();
    keys.sort_unstable();
    keys.dedup();
    for key in keys {
        let message = match (s.has(key), required.contains(&key)) {
            (false, true) => "this shape needs this key, which is missing",
            (true, false) if !optional.contains(&key) => "this shape has no such key",
            _ => continue,
        };
        let has = [required, optional].concat().join(", ");
        s.fault(key, message, &format!("it has {has}"));
    }
}

pub(super) fn body(mut s: Section<'_>) -> Option<Iron> {
    let size = BODY_MM.positive();
    let kind = s.choice::<Kind>("shape");
    if kind.is_none() && !s.has("shape") {
        let names = <Kind as VariantArray>::VARIANTS
            .iter()
            .map(|&kind| kind.into());
        let names: Vec<&'static str> = names.collect();
        s.missing("shape", &format!("one of {}", names.join(", ")));
    }
    let sides = s.tuple_if_given::<3>("size_mm", &size);
    let diameter = s.number("diameter_mm", &size);
    let inner = s.number("inner_diameter_mm", &size);
    let length = s.number("length_mm", &size);
    let surface = s.text("surface").map(|text| text.value);
    let unit_m = s.length_unit("unit");
    let centre = s.tuple::<3>("center_mm", &BODY_MM);
    let translate = s.tuple::<3>("translate_mm", &BODY_MM);
    let rotate_deg = s.tuple("rotate_deg", &Rule::any("degrees"));
    let steel = steel(&mut s);
    if let Some(kind) = kind {
        check_keys(&s, kind);
    }
    if surface.as_deref() == Some("") {
        s.fault("surface", "expected a file", "name the file of the mesh");
    }
    let of = |value: Option<Located<f64>>| value.map_or(0.0, |v| m_from_mm(v.value));
    let [inner, outer, length] = [of(inner), of(diameter), of(length)];
    if kind == Some(Kind::Tube) && inner >= outer {
        let message = "the inner diameter must be below the outer one";
        s.fault("inner_diameter_mm", message, "are the two swapped?");
    }
    s.finish();
    Some(Iron {
        shape: match kind? {
            Kind::Box => IronShape::Box(sides?.map(m_from_mm)),
            Kind::Cylinder | Kind::Tube => IronShape::Tube([inner, outer, length]),
            Kind::Ball => IronShape::Ball(outer),
            Kind::Mesh => IronShape::Mesh {
                surface: PathBuf::from(surface?),
                unit_m,
            },
        },
        // The other kind's key is at fault, hence nothing.
        centre_m: [0, 1, 2].map(|k| m_from_mm(centre[k] + translate[k])),
        rotate_deg,
        steel,
    })
}
