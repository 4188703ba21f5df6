//! The contents of a shape file, validated, in SI units.

mod raw;
mod read;

pub use read::{keys, keys_of};

use std::path::PathBuf;
use strum::{EnumMessage, EnumString, IntoStaticStr, VariantArray};

use crate::bodies::BodyOptions;
use fluxform_base::force_direction::RequestedForce;
use fluxform_base::point_weights::Weights;
use fluxform_numerics::axis::Axis;

pub use crate::format::SurfaceFormat;
pub use fluxform_base::length_unit::{parse_unit, unit_name, unit_names};
pub use raw::{RawSurface, RawSurfaceError};

/// A validated shape document, or a raw surface with its flags.
#[derive(Debug, Clone, PartialEq)]
pub struct ShapeDocument {
    /// Names the bundle's folder.
    pub name: String,
    /// Where the surface comes from.
    pub source: SurfaceSource,
    /// How bodies are cut into facets, and which of them.
    pub bodies: BodyOptions,
    /// Factors along the file's own x, y and z, before anything else; positive.
    pub scale: [f64; 3],
    /// Applied to the surface after its unit: rotation about x, then y, then z, then translation.
    pub placement: Placement,
    /// Grid of constraint points: of a document 61 x 61 over [-50, 50] mm unless it says
    /// otherwise, of a raw surface 61 x 61 over its own extent.
    pub grid: GridRequest,
    /// The force that is requested over it.
    pub force: RequestedForce,
    /// Angle between forces that a finger just notices, degrees: how sideways errors of static currents
    /// count beside upward ones.
    pub direction_jnd_deg: f64,
    /// Whether the document or a flag gives that grid's samples.
    pub grid_is_given: bool,
    /// How the points count in the mean over the object; `None` where nothing says it.
    pub weights: Option<Weights>,
}

/// Where a surface comes from.
#[derive(Debug, Clone, PartialEq)]
pub enum SurfaceSource {
    /// A file, path resolved against the shape file's folder, and metres per file unit
    /// as the user states it; where the format itself carries the unit, `None` will do.
    File {
        /// Path to read.
        path: PathBuf,
        /// Metres per unit of the file's coordinates.
        unit_m: Option<f64>,
    },
    /// One of the seed's shapes.
    Primitive(Primitive),
}

/// The seed's shapes, exact (physics.md 8).
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Primitive {
    /// A horizontal square.
    Flat {
        /// Side, m.
        side_m: f64,
        /// Height, m.
        height_m: f64,
    },
    /// The upper half of a sphere.
    HalfSphere {
        /// Radius, m.
        radius_m: f64,
        /// Height of its base, m.
        base_m: f64,
    },
    /// The upper half of a cylinder whose axis is y.
    HalfCylinder {
        /// Radius, m.
        radius_m: f64,
        /// Length along y, m.
        length_m: f64,
        /// Height of its base, m.
        base_m: f64,
    },
    /// A plane that rises with x.
    Wedge {
        /// Side of its square footprint, m.
        side_m: f64,
        /// Height at the low side, m.
        low_m: f64,
        /// Height at the high side, m.
        high_m: f64,
    },
}

/// Placement: turn up, rotate about x, then y, then z, seat by the box, then translate.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Placement {
    /// Translation, m.
    pub translate_m: [f64; 3],
    /// Rotation angles, degrees.
    pub rotate_deg: [f64; 3],
    /// Which way the file has up, and where the surface's box goes.
    pub seat: Seat,
}

/// Where a surface goes by its own box, before it is translated.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Seat {
    /// Which of the file's directions points up.
    pub up: Up,
    /// The middle of the box comes to x = y = 0.
    pub center: bool,
    /// The lowest point comes to this height, m.
    pub rest_on_m: Option<f64>,
    /// The surface is moved into a box.
    pub fit: Option<Fit>,
}

impl Seat {
    /// Whether something of it depends on the surface's box.
    #[must_use]
    pub fn uses_box(&self) -> bool {
        self.center || self.rest_on_m.is_some() || self.fit.is_some()
    }
}

/// A box that a surface is moved into: to its middle in x and y, onto its lower end in z.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fit {
    /// From and to along x, y and z, m.
    pub box_m: [[f64; 2]; 3],
    /// Whether the surface is scaled to fill it.
    pub scale: bool,
}

/// A direction of a file that points up.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, Default, EnumMessage, EnumString, IntoStaticStr, VariantArray,
)]
#[strum(serialize_all = "lowercase")]
pub enum Up {
    /// +x
    X,
    /// +y, as in many programs that draw
    Y,
    /// +z
    #[default]
    Z,
    /// -x
    #[strum(serialize = "-x")]
    MinusX,
    /// -y
    #[strum(serialize = "-y")]
    MinusY,
    /// -z
    #[strum(serialize = "-z")]
    MinusZ,
}

fluxform_base::choices!(Up);

impl Up {
    /// The rotation about x, then y, then z that turns it to +z, degrees.
    #[must_use]
    pub(super) fn turn_deg(self) -> [f64; 3] {
        match self {
            Self::X => [0.0, -90.0, 0.0],
            Self::Y => [90.0, 0.0, 0.0],
            Self::Z => [0.0; 3],
            Self::MinusX => [0.0, 90.0, 0.0],
            Self::MinusY => [-90.0, 0.0, 0.0],
            Self::MinusZ => [180.0, 0.0, 0.0],
        }
    }
}

/// Which grid of points is requested.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GridRequest {
    /// Extent and samples along x; `None` extent: the surface's own.
    pub x: AxisRequest,
    /// The same along y.
    pub y: AxisRequest,
}

impl ShapeDocument {
    /// The same with other samples along x and y.
    #[must_use]
    pub fn with_samples(&self, samples: [usize; 2]) -> Self {
        let mut document = self.clone();
        let axes = [&mut document.grid.x, &mut document.grid.y];
        for (axis, samples) in axes.into_iter().zip(samples) {
            *axis = axis.with_samples(samples);
        }
        document
    }
}

/// One axis of the requested grid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum AxisRequest {
    /// A given axis, m.
    Given(Axis),
    /// This many samples over the surface's own extent.
    Extent(usize),
}

impl AxisRequest {
    /// Samples along it.
    #[must_use]
    pub fn samples(self) -> usize {
        match self {
            Self::Given(axis) => axis.samples,
            Self::Extent(samples) => samples,
        }
    }

    /// The same with other samples.
    #[must_use]
    pub fn with_samples(self, samples: usize) -> Self {
        match self {
            Self::Given(axis) => Self::Given(Axis { samples, ..axis }),
            Self::Extent(_) => Self::Extent(samples),
        }
    }
}
