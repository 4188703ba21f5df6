//! The seed's four shapes as formulas: exact heights and normals, borders inclusive.

use crate::document::{Placement, Primitive, Seat};
use crate::error::ShapeError;
use crate::file_mesh::Bounds;
use crate::height::Sample;
use crate::placement::sin_cos_deg;

/// Roundings of the largest coordinate within which a point lies on a border.
const BORDER_EPSILONS: f64 = 8.0;

/// A primitive, turned about z and moved.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlacedPrimitive {
    primitive: Primitive,
    translate_m: [f64; 3],
    /// Sine and cosine of the turn about z.
    turn: [f64; 2],
}

impl PlacedPrimitive {
    /// Checks the sizes and the placement.
    ///
    /// # Errors
    /// [`ShapeError::Document`] for a length that is not positive and finite, or a rotation
    /// about x or y.
    pub fn new(primitive: Primitive, placement: &Placement) -> Result<Self, ShapeError> {
        let lengths = match primitive {
            Primitive::Flat { side_m, .. } | Primitive::Wedge { side_m, .. } => {
                vec![("side_mm", side_m)]
            }
            Primitive::HalfSphere { radius_m, .. } => vec![("radius_mm", radius_m)],
            Primitive::HalfCylinder {
                radius_m, length_m, ..
            } => {
                vec![("radius_mm", radius_m), ("length_mm", length_m)]
            }
        };
        if placement.seat != Seat::default() {
            return Err(ShapeError::Document(
                "a primitive is not seated by its box: say where its base lies, or use \
                 translate_mm"
                    .into(),
            ));
        }
        for (key, length_m) in lengths {
            if !(length_m > 0.0 && length_m.is_finite()) {
                return Err(ShapeError::Document(format!(
                    "the primitive's {key} is {}; it must be positive",
                    length_m * 1000.0
                )));
            }
        }
        let [about_x, about_y, about_z] = placement.rotate_deg;
        if about_x % 360.0 != 0.0 || about_y % 360.0 != 0.0 {
            return Err(ShapeError::Document(format!(
                "a primitive turns about z only, not by {about_x} degrees about x and {about_y} \
                 about y; use the shape's STL file instead (`surface = ...`), which turns any way"
            )));
        }
        let (sin, cos) = sin_cos_deg(about_z);
        Ok(Self {
            primitive,
            translate_m: placement.translate_m,
            turn: [sin, cos],
        })
    }

    /// The box around it, m.
    #[must_use]
    pub fn bounds(&self) -> Bounds {
        let [sin, cos] = self.turn.map(f64::abs);
        let (half, low, high) = match self.primitive {
            Primitive::Flat { side_m, height_m } => ([side_m / 2.0; 2], height_m, height_m),
            Primitive::HalfSphere { radius_m, base_m } => {
                ([radius_m; 2], base_m, base_m + radius_m)
            }
            Primitive::HalfCylinder {
                radius_m,
                length_m,
                base_m,
            } => ([radius_m, length_m / 2.0], base_m, base_m + radius_m),
            Primitive::Wedge {
                side_m,
                low_m,
                high_m,
            } => ([side_m / 2.0; 2], low_m.min(high_m), low_m.max(high_m)),
        };
        let turned = match self.primitive {
            Primitive::HalfSphere { .. } => half,
            _ => [cos * half[0] + sin * half[1], sin * half[0] + cos * half[1]],
        };
        let [x, y, z] = self.translate_m;
        Bounds {
            min_m: [x - turned[0], y - turned[1], z + low],
            max_m: [x + turned[0], y + turned[1], z + high],
        }
    }

    /// Distance in plan to the shape, 0 over it, m.
    #[must_use]
    pub(super) fn distance_in_plan_m(&self, [x_m, y_m]: [f64; 2]) -> f64 {
        let [u, v] = self.own(x_m, y_m);
        let beyond = |c: f64, half: f64| (c.abs() - half).max(0.0);
        match self.primitive {
            Primitive::Flat { side_m, .. } | Primitive::Wedge { side_m, .. } => {
                beyond(u, side_m / 2.0).hypot(beyond(v, side_m / 2.0))
            }
            Primitive::HalfSphere { radius_m, .. } => beyond(u.hypot(v), radius_m),
            Primitive::HalfCylinder {
                radius_m, length_m, ..
            } => beyond(u, radius_m).hypot(beyond(v, length_m / 2.0)),
        }
    }

    /// A place of the plan in the shape's own axes, m.
    fn own(&self, x_m: f64, y_m: f64) -> [f64; 2] {
        let [sin, cos] = self.turn;
        let [dx, dy] = [x_m - self.translate_m[0], y_m - self.translate_m[1]];
        [cos * dx + sin * dy, cos * dy - sin * dx]
    }

    /// The surface over (x, y), m; `None` outside its border.
    #[must_use]
    pub fn sample(&self, x_m: f64, y_m: f64) -> Option<Sample> {
        let [sin, cos] = self.turn;
        let [u, v] = self.own(x_m, y_m);
        // A decimal border has no exact double: a few roundings off it is on it.
        let largest = [x_m, y_m, self.translate_m[0], self.translate_m[1]]
            .iter()
            .fold(0.0, |m: f64, c| m.max(c.abs()));
        let slack = BORDER_EPSILONS * f64::EPSILON * largest;
        let inside = |distance: f64, border: f64| distance.abs() <= border + slack;
        let (height, normal) = match self.primitive {
            Primitive::Flat { side_m, height_m } => {
                let half = side_m / 2.0;
                (inside(u, half) && inside(v, half)).then_some((height_m, [0.0, 0.0, 1.0]))?
            }
            Primitive::HalfSphere { radius_m, base_m } => {
                let distance = u.hypot(v);
                inside(distance, radius_m).then_some(())?;
                let rise = circle(radius_m, distance);
                let normal = [u, v, rise].map(|c| c / radius_m);
                (base_m + rise, normal)
            }
            Primitive::HalfCylinder {
                radius_m,
                length_m,
                base_m,
            } => {
                (inside(u, radius_m) && inside(v, length_m / 2.0)).then_some(())?;
                let rise = circle(radius_m, u);
                let normal = [u / radius_m, 0.0, rise / radius_m];
                (base_m + rise, normal)
            }
            Primitive::Wedge {
                side_m,
                low_m,
                high_m,
            } => {
                let half = side_m / 2.0;
                (inside(u, half) && inside(v, half)).then_some(())?;
                let (from_low, from_high) = (
                    ((u + half) / side_m).max(0.0),
                    ((half - u) / side_m).max(0.0),
                );
                let rise = high_m - low_m;
                let height = if from_low <= from_high {
                    low_m + from_low * rise
                } else {
                    high_m - from_high * rise
                };
                let length = side_m.hypot(rise);
                (height, [-rise / length, 0.0, side_m / length])
            }
        };
        let [a, b, c] = normal;
        Some(Sample {
            height_m: self.translate_m[2] + height,
            // Adding 0 turns -0 into 0.
            normal: [cos * a - sin * b + 0.0, sin * a + cos * b + 0.0, c],
        })
    }
}

/// Height of a circle's arc at a distance from its centre, 0 beyond its ends.
fn circle(radius: f64, distance: f64) -> f64 {
    let distance = distance.abs();
    ((radius - distance).max(0.0) * (radius + distance)).sqrt()
}

#[cfg(test)]
mod tests {
    use super::PlacedPrimitive;
    use crate::document::{Placement, Primitive};
    use fluxform_numerics::axis::Axis;

    const HALF_SPHERE: Primitive = Primitive::HalfSphere {
        radius_m: 0.05,
        base_m: 0.03,
    };
    const HALF_CYLINDER: Primitive = Primitive::HalfCylinder {
        radius_m: 0.05,
        length_m: 0.1,
        base_m: 0.03,
    };
    const WEDGE: Primitive = Primitive::Wedge {
        side_m: 0.1,
        low_m: 0.03,
        high_m: 0.08,
    };
    const FLAT: Primitive = Primitive::Flat {
        side_m: 0.1,
        height_m: 0.05,
    };

    fn placed(primitive: Primitive, translate_m: [f64; 3], about_z: f64) -> PlacedPrimitive {
        let placement = Placement {
            translate_m,
            rotate_deg: [0.0, 0.0, about_z],
            ..Placement::default()
        };
        PlacedPrimitive::new(primitive, &placement).unwrap()
    }

    /// Turned, a rectangle's box holds its corners; a sphere's is the same.
    #[test]
    fn a_box_is_moved_and_turned_with_its_shape() {
        let at = [0.01, -0.02, 0.004];
        let (sin, cos) = 30.0_f64.to_radians().sin_cos();
        let (across, along) = (0.05 * cos + 0.05 * sin, 0.05 * sin + 0.05 * cos);
        for (primitive, turned, [low, high]) in [
            (FLAT, [across, along], [0.05, 0.05]),
            (WEDGE, [across, along], [0.03, 0.08]),
            (HALF_CYLINDER, [across, along], [0.03, 0.08]),
            (HALF_SPHERE, [0.05; 2], [0.03, 0.08]),
        ] {
            let found = placed(primitive, at, 30.0).bounds();
            for axis in 0..2 {
                assert!((found.min_m[axis] - (at[axis] - turned[axis])).abs() < 1e-15);
                assert!((found.max_m[axis] - (at[axis] + turned[axis])).abs() < 1e-15);
            }
            assert!((found.min_m[2] - (at[2] + low)).abs() < 1e-15);
            assert!((found.max_m[2] - (at[2] + high)).abs() < 1e-15);
        }
    }

    /// Points of the seed's 61 x 61 grid, moved with the shape, that have surface.
    fn covered(primitive: Primitive, at: [f64; 3], turn: f64) -> usize {
        let shape = placed(primitive, at, turn);
        let axis = |c: f64| Axis {
            from: c - 0.05,
            to: c + 0.05,
            samples: 61,
        };
        let y = axis(at[1]).nodes();
        axis(at[0])
            .nodes()
            .iter()
            .flat_map(|x| y.iter().map(move |y| (*x, *y)))
            .filter(|(x, y)| shape.sample(*x, *y).is_some())
            .count()
    }

    #[test]
    fn borders_belong_to_the_shape() {
        for turn in [0.0, 90.0, 180.0, -90.0] {
            for at in [[0.0; 3], [0.0137, -0.0291, 0.011], [3.3, 7.7, 0.0]] {
                assert_eq!(covered(FLAT, at, turn), 3721);
                assert_eq!(covered(HALF_CYLINDER, at, turn), 3721);
                assert_eq!(covered(WEDGE, at, turn), 3721);
                // Integer points within a circle of radius 30 (Gauss): 2821, 12 of them on it.
                assert_eq!(covered(HALF_SPHERE, at, turn), 2821);
            }
        }
    }

    #[test]
    fn the_box_is_the_smallest_around_the_surface() {
        for (primitive, low_m, high_m) in [
            (FLAT, 0.05, 0.05),
            (HALF_SPHERE, 0.03, 0.08),
            (HALF_CYLINDER, 0.03, 0.08),
            (WEDGE, 0.03, 0.08),
        ] {
            let shape = placed(primitive, [0.3, -0.2, 0.011], 30.0);
            let bounds = shape.bounds();
            assert!(
                (bounds.min_m[2] - low_m - 0.011).abs() < 1e-15,
                "{primitive:?}"
            );
            assert!(
                (bounds.max_m[2] - high_m - 0.011).abs() < 1e-15,
                "{primitive:?}"
            );
            let reach = match primitive {
                Primitive::HalfSphere { .. } => 0.05,
                _ => 0.05 * (0.5 + 0.75_f64.sqrt()),
            };
            for (axis, middle) in [0.3, -0.2].into_iter().enumerate() {
                assert!(
                    (bounds.max_m[axis] - middle - reach).abs() < 1e-15,
                    "{primitive:?}"
                );
                assert!(
                    (middle - bounds.min_m[axis] - reach).abs() < 1e-15,
                    "{primitive:?}"
                );
            }
        }
    }

    #[test]
    fn heights_are_the_seeds() {
        let at = |p: Primitive, x: f64, y: f64| placed(p, [0.0; 3], 0.0).sample(x, y).unwrap();
        assert_eq!(at(FLAT, 0.013, -0.05).height_m, 0.05);
        assert_eq!(at(WEDGE, -0.05, 0.02).height_m, 0.03);
        assert_eq!(at(WEDGE, 0.05, 0.02).height_m, 0.08);
        assert!((at(WEDGE, 0.02, 0.0).height_m - 0.065).abs() < 1e-17);
        assert!((at(HALF_SPHERE, 0.014, 0.048).height_m - 0.03).abs() < 1e-9);
        assert!((at(HALF_SPHERE, 0.024, 0.018).height_m - 0.07).abs() < 1e-16);
        assert_eq!(at(HALF_CYLINDER, 0.05, 0.05).height_m, 0.03);
        assert!((at(HALF_CYLINDER, -0.03, 0.05).height_m - 0.07).abs() < 1e-16);
    }

    #[test]
    fn normals_are_the_heights_gradient() {
        for primitive in [FLAT, HALF_SPHERE, HALF_CYLINDER, WEDGE] {
            for turn in [0.0, 37.0, 90.0] {
                let shape = placed(primitive, [0.003, -0.004, 0.01], turn);
                let h = |x: f64, y: f64| shape.sample(x, y).unwrap().height_m;
                let (x, y, d) = (0.017, -0.011, 1e-6);
                let slope = [
                    (h(x + d, y) - h(x - d, y)) / (2.0 * d),
                    (h(x, y + d) - h(x, y - d)) / (2.0 * d),
                ];
                let n = shape.sample(x, y).unwrap().normal;
                assert!((n[0] * n[0] + n[1] * n[1] + n[2] * n[2] - 1.0).abs() < 1e-14);
                assert!(
                    (n[0] + slope[0] * n[2]).abs() < 1e-8,
                    "{primitive:?} {turn}"
                );
                assert!(
                    (n[1] + slope[1] * n[2]).abs() < 1e-8,
                    "{primitive:?} {turn}"
                );
            }
        }
    }

    #[test]
    fn a_turned_shape_is_the_shape_seen_from_a_turned_frame() {
        let (sin, cos) = 37f64.to_radians().sin_cos();
        let (still, turned) = (placed(WEDGE, [0.0; 3], 0.0), placed(WEDGE, [0.0; 3], 37.0));
        for (u, v) in [(0.013, -0.041), (-0.049, 0.0491), (0.049, 0.0033)] {
            let (x, y) = (cos * u - sin * v, sin * u + cos * v);
            let (a, b) = (still.sample(u, v).unwrap(), turned.sample(x, y).unwrap());
            assert!((a.height_m - b.height_m).abs() < 1e-16);
        }
        let bounds = turned.bounds();
        assert!((bounds.max_m[0] - 0.05 * (sin + cos)).abs() < 1e-16);
        assert!(turned.sample(0.049, 0.049).is_none());
    }

    #[test]
    fn other_turns_and_sizes_are_refused() {
        let tilt = Placement {
            translate_m: [0.0; 3],
            rotate_deg: [30.0, 0.0, 0.0],
            ..Placement::default()
        };
        let message = PlacedPrimitive::new(FLAT, &tilt).unwrap_err().to_string();
        assert!(
            message.contains("about z only") && message.contains("STL"),
            "{message}"
        );
        let flat = Primitive::Flat {
            side_m: -0.1,
            height_m: 0.05,
        };
        let message = PlacedPrimitive::new(flat, &Placement::default())
            .unwrap_err()
            .to_string();
        assert!(message.contains("side_mm is -100"), "{message}");
    }
}
