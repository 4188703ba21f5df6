//! Which force is requested at a point of a surface: how large it is (eq. 6) and where it points.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use strum::{EnumMessage, EnumString, IntoStaticStr, VariantArray};

/// Where the requested force points, and whether its sideways part is controlled. Its name in
/// documents, artefacts and on the command line is the variant's in lower case with hyphens, its
/// meaning the first line of the variant's comment.
#[derive(
    Debug,
    Clone,
    Copy,
    PartialEq,
    Eq,
    Default,
    EnumMessage,
    EnumString,
    IntoStaticStr,
    VariantArray,
    Serialize,
    Deserialize,
    JsonSchema,
)]
#[serde(rename_all = "kebab-case")]
#[strum(serialize_all = "kebab-case")]
pub enum ForceDirection {
    /// Upward, lambda times the height; the sideways force is whatever the currents give
    #[default]
    Vertical,
    /// Upward, lambda times the height, and no sideways force
    VerticalOnly,
    /// Along the surface's outward normal
    Normal,
}

impl ForceDirection {
    /// Whether all three components of the force are requested, not the upward one alone.
    #[must_use]
    pub fn is_vector(self) -> bool {
        match self {
            Self::Vertical => false,
            Self::VerticalOnly | Self::Normal => true,
        }
    }
}

/// How large a force along the normal is. The default bounds it everywhere: at a rim or a wall, where the
/// normal is horizontal, a given upward part would need a sideways force without limit.
#[derive(
    Debug,
    Clone,
    Copy,
    PartialEq,
    Eq,
    Default,
    EnumMessage,
    EnumString,
    IntoStaticStr,
    VariantArray,
    Serialize,
    Deserialize,
    JsonSchema,
)]
#[serde(rename_all = "lowercase")]
#[strum(serialize_all = "lowercase")]
pub enum NormalForce {
    /// Its magnitude is lambda times the height
    #[default]
    Magnitude,
    /// Its upward part is lambda times the height, its sideways part at most three times that
    Upward,
}

crate::choices!(ForceDirection, NormalForce);

/// The sideways part of a force whose upward part is given, over that part, at most: 72 degrees.
pub const STEEPEST: f64 = 3.0;

/// The force that is requested over a surface.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct RequestedForce {
    /// Where it points.
    pub direction: ForceDirection,
    /// Its size along the normal; without meaning for the other directions.
    pub normal_force: NormalForce,
}

impl RequestedForce {
    /// The size of a force along the normal; `None` where it points elsewhere.
    #[must_use]
    pub fn along_normal(self) -> Option<NormalForce> {
        match self.direction {
            ForceDirection::Vertical | ForceDirection::VerticalOnly => None,
            ForceDirection::Normal => Some(self.normal_force),
        }
    }

    /// The requested force over lambda times the height, for the unit normal (`n_z >= 0`) given. At a crease
    /// `other` is the unit normal of the other face; the mean of both counts.
    ///
    /// Length 1 but for [`NormalForce::Upward`], whose z component is 1.
    #[must_use]
    pub fn vector(self, normal: [f64; 3], other: Option<[f64; 3]>) -> [f64; 3] {
        match self.direction {
            ForceDirection::Vertical | ForceDirection::VerticalOnly => [0.0, 0.0, 1.0],
            ForceDirection::Normal => {
                let mean = other.map_or(normal, |other| {
                    let sum: [f64; 3] = std::array::from_fn(|k| normal[k] + other[k]);
                    let length = sum.iter().map(|v| v * v).sum::<f64>().sqrt();
                    // Two walls back to back have no mean.
                    if length > 1e-6 {
                        sum.map(|v| v / length)
                    } else {
                        [0.0, 0.0, 1.0]
                    }
                });
                match self.normal_force {
                    NormalForce::Magnitude => mean,
                    NormalForce::Upward => upright(mean),
                }
            }
        }
    }
}

/// Overrides of a shape's own request; absent parts stay as the shape has them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct ForceOverride {
    /// Where the force points.
    pub direction: Option<ForceDirection>,
    /// How large it is along the normal.
    pub normal_force: Option<NormalForce>,
}

impl From<RequestedForce> for ForceOverride {
    /// One that takes the place of all of a shape's own request.
    fn from(force: RequestedForce) -> Self {
        Self {
            direction: Some(force.direction),
            normal_force: Some(force.normal_force),
        }
    }
}

impl ForceOverride {
    /// The request that results for a shape.
    #[must_use]
    pub fn over(self, own: RequestedForce) -> RequestedForce {
        RequestedForce {
            direction: self.direction.unwrap_or(own.direction),
            normal_force: self.normal_force.unwrap_or(own.normal_force),
        }
    }
}

/// Along `normal` with z component 1, no farther sideways than [`STEEPEST`].
fn upright([x, y, z]: [f64; 3]) -> [f64; 3] {
    let sideways = x.hypot(y);
    if sideways == 0.0 {
        return [0.0, 0.0, 1.0];
    }
    let slope = (sideways / z.max(f64::MIN_POSITIVE)).min(STEEPEST);
    [slope * x / sideways, slope * y / sideways, 1.0]
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALONG: RequestedForce = RequestedForce {
        direction: ForceDirection::Normal,
        normal_force: NormalForce::Magnitude,
    };

    #[test]
    fn a_name_is_read_as_what_it_names() {
        for direction in ForceDirection::ALL {
            assert_eq!(direction.name().parse(), Ok(*direction));
        }
        for size in NormalForce::ALL {
            assert_eq!(size.name().parse(), Ok(*size));
        }
        assert_eq!(ForceDirection::VerticalOnly.name(), "vertical-only");
    }

    #[test]
    fn the_normal_gives_the_direction_and_the_key_its_size() {
        let tilted = [0.6, 0.0, 0.8];
        assert_eq!(ALONG.vector(tilted, None), tilted);
        let upward = RequestedForce {
            normal_force: NormalForce::Upward,
            ..ALONG
        };
        let [x, y, z] = upward.vector(tilted, None);
        assert!((x - 0.75).abs() < 1e-15 && y == 0.0 && z == 1.0);
        // A wall has a horizontal normal: its force is bounded.
        assert_eq!(upward.vector([0.0, -1.0, 0.0], None), [0.0, -STEEPEST, 1.0]);
        assert_eq!(ALONG.vector([0.0, -1.0, 0.0], None), [0.0, -1.0, 0.0]);
        let vertical = RequestedForce::default();
        assert_eq!(vertical.vector(tilted, None), [0.0, 0.0, 1.0]);
    }

    #[test]
    fn at_a_crease_both_faces_count_alike() {
        let (a, b) = ([0.6, 0.0, 0.8], [-0.6, 0.0, 0.8]);
        assert_eq!(ALONG.vector(a, Some(b)), [0.0, 0.0, 1.0]);
        assert_eq!(ALONG.vector(a, Some(b)), ALONG.vector(b, Some(a)));
        let walls = ALONG.vector([1.0, 0.0, 0.0], Some([-1.0, 0.0, 0.0]));
        assert_eq!(walls, [0.0, 0.0, 1.0]);
    }
}
