//! From a file's coordinates to metres: unit, rotation (what is up; about x, then y, then z), the
//! seat by the surface's own box, translation.

use nalgebra::{Matrix3, Vector3};

use crate::document::{Fit, Placement};
use crate::file_mesh::{Bounds, Triangle, has_area};
use fluxform_numerics::vec3::norm;

/// Unit and placement as one map of points; right angles rotate exactly.
#[derive(Debug, Clone, PartialEq)]
pub struct Transform {
    /// A coordinate is multiplied by the first, divided by the second; one of them is 1.
    unit: [f64; 2],
    /// Factors along the file's axes.
    scale: [f64; 3],
    /// `None` for the identity.
    rotation: Option<Matrix3<f64>>,
    /// Factor of what was rotated.
    growth: f64,
    translate_m: [f64; 3],
}

impl Transform {
    /// `unit_m`: metres per unit of the file's coordinates.
    #[must_use]
    pub fn new(unit_m: f64, placement: &Placement) -> Self {
        // Dividing by 1000 rounds correctly (38 mm is the double nearest 0.038), times 0.001 not.
        let per_metre = (1.0 / unit_m).round();
        let unit = if per_metre > 1.0 && 1.0 / per_metre == unit_m {
            [1.0, per_metre]
        } else {
            [unit_m, 1.0]
        };
        let rotation = rotation(placement.rotate_deg) * rotation(placement.seat.up.turn_deg());
        Self {
            unit,
            scale: [1.0; 3],
            rotation: (rotation != Matrix3::identity()).then_some(rotation),
            growth: 1.0,
            translate_m: placement.translate_m,
        }
    }

    /// The same for a surface of these triangles, seated as `placement` says; where it hangs over
    /// the box that it is moved into, the second value says so.
    #[must_use]
    pub fn seated(self, placement: &Placement, triangles: &[Triangle]) -> (Self, Option<String>) {
        let seat = &placement.seat;
        if !seat.uses_box() {
            return (self, None);
        }
        let bare = Self {
            translate_m: [0.0; 3],
            ..self.clone()
        };
        // Triangles without area are no surface and are left out: they must not decide where it goes.
        let corners = triangles.iter().filter(|t| has_area(t)).flatten();
        let mut bounds = Bounds::of(corners.map(|v| bare.apply(*v)));
        if bounds.min_m[0] > bounds.max_m[0] {
            return (self, None);
        }
        let (mut growth, mut warning) = (1.0, None);
        if let Some(fit) = &seat.fit {
            (growth, warning) = growth_into(fit, &bounds);
            bounds.min_m = bounds.min_m.map(|c| c * growth);
            bounds.max_m = bounds.max_m.map(|c| c * growth);
        }
        let middle = |k: usize| 0.5 * (bounds.min_m[k] + bounds.max_m[k]);
        let mut shift_m = [0.0; 3];
        if let Some(fit) = &seat.fit {
            let [x, y, z] = fit.box_m;
            shift_m = [
                0.5 * (x[0] + x[1]) - middle(0),
                0.5 * (y[0] + y[1]) - middle(1),
                z[0] - bounds.min_m[2],
            ];
        }
        if seat.center {
            (shift_m[0], shift_m[1]) = (-middle(0), -middle(1));
        }
        if let Some(rest_on_m) = seat.rest_on_m {
            shift_m[2] = rest_on_m - bounds.min_m[2];
        }
        let seated = Self {
            growth,
            translate_m: [0, 1, 2].map(|k| self.translate_m[k] + shift_m[k]),
            ..self
        };
        (seated, warning)
    }

    /// The same with factors along the file's axes, before anything else.
    #[must_use]
    pub fn scaled(self, scale: [f64; 3]) -> Self {
        Self { scale, ..self }
    }

    /// The placed point, m.
    #[must_use]
    pub fn apply(&self, point: [f64; 3]) -> [f64; 3] {
        let mut p = [0, 1, 2].map(|k| self.metres(point[k] * self.scale[k]));
        if let Some(rotation) = &self.rotation {
            p = (rotation * Vector3::from(p)).into();
        }
        [0, 1, 2].map(|k| p[k] * self.growth + self.translate_m[k])
    }

    /// A length of the file, m; the longest it may become in any direction.
    #[must_use]
    pub fn length_m(&self, length: f64) -> f64 {
        let [x, y, z] = self.scale;
        self.metres(length * x.max(y).max(z)) * self.growth
    }

    /// Roundings along the file's axes, m along those of the placed surface: apart, so that coarse
    /// heights do not blur the plan. Where axes mix they add up by squares, as independent errors do.
    #[must_use]
    pub fn roundings_m(&self, roundings: [f64; 3]) -> [f64; 3] {
        let own = [0, 1, 2].map(|k| self.metres(roundings[k] * self.scale[k]) * self.growth);
        match &self.rotation {
            Some(rotation) if own[0] != own[1] || own[1] != own[2] => [0, 1, 2].map(|i| {
                let parts = [0, 1, 2].map(|k| rotation[(i, k)] * own[k]);
                norm(parts)
            }),
            _ => own,
        }
    }

    fn metres(&self, length: f64) -> f64 {
        length * self.unit[0] / self.unit[1]
    }
}

/// The factor that a surface of these bounds takes into a box, and a warning where it hangs over.
fn growth_into(fit: &Fit, bounds: &Bounds) -> (f64, Option<String>) {
    let size: [f64; 3] = [0, 1, 2].map(|k| bounds.max_m[k] - bounds.min_m[k]);
    let room = fit.box_m.map(|[from, to]| to - from);
    let share = (0..3)
        .map(|k| room[k] / size[k])
        .fold(f64::INFINITY, f64::min);
    if fit.scale && share.is_finite() && share > 0.0 {
        return (share, None);
    }
    let text = |sides: [f64; 3]| sides.map(|s| format!("{:.4}", s * 1e3)).join(" x ");
    let over = share < 1.0 - 1e-9;
    let warning = over.then(|| {
        format!(
            "the surface is {} mm, the box that it is moved into {} mm: it hangs over; \
             --scale-to-fit (scale_to_fit = true) shrinks it to {share:.4} of its size",
            text(size),
            text(room)
        )
    });
    (1.0, warning)
}

/// Sine and cosine of an angle in degrees, exact at multiples of 90.
#[must_use]
pub fn sin_cos_deg(angle_deg: f64) -> (f64, f64) {
    // Whole turns leave without rounding, however many.
    let angle_deg = angle_deg % 360.0;
    let quarter = (angle_deg / 90.0).round();
    let (sin, cos) = (angle_deg - quarter * 90.0).to_radians().sin_cos();
    match quarter.rem_euclid(4.0) as u8 {
        0 => (sin, cos),
        1 => (cos, -sin),
        2 => (-sin, -cos),
        _ => (-cos, sin),
    }
}

/// Rz Ry Rx: the fixed axes, x first.
fn rotation(rotate_deg: [f64; 3]) -> Matrix3<f64> {
    let [(sx, cx), (sy, cy), (sz, cz)] = rotate_deg.map(sin_cos_deg);
    let about_x = Matrix3::new(1.0, 0.0, 0.0, 0.0, cx, -sx, 0.0, sx, cx);
    let about_y = Matrix3::new(cy, 0.0, sy, 0.0, 1.0, 0.0, -sy, 0.0, cy);
    let about_z = Matrix3::new(cz, -sz, 0.0, sz, cz, 0.0, 0.0, 0.0, 1.0);
    about_z * about_y * about_x
}

#[cfg(test)]
mod tests {
    use super::{Transform, sin_cos_deg};
    use crate::document::Placement;
    use crate::file_mesh::Triangle;

    fn turned(rotate_deg: [f64; 3]) -> Transform {
        Transform::new(
            1.0,
            &Placement {
                rotate_deg,
                ..Placement::default()
            },
        )
    }

    #[test]
    fn millimetres_are_divided_and_inches_multiplied() {
        let mm = Transform::new(0.001, &Placement::default());
        let inch = Transform::new(0.0254, &Placement::default());
        for value in [38.0, 0.7, 61.3, 1e6 + 0.3] {
            assert_eq!(mm.apply([value; 3]), [value / 1000.0; 3]);
            assert_eq!(inch.apply([value; 3]), [value * 0.0254; 3]);
        }
    }

    #[test]
    fn quarter_turns_are_exact_and_in_order() {
        let p = [0.7, 1.3, -2.9];
        assert_eq!(turned([90.0, 0.0, 0.0]).apply(p), [0.7, 2.9, 1.3]);
        assert_eq!(turned([0.0, 90.0, 0.0]).apply(p), [-2.9, 1.3, -0.7]);
        assert_eq!(turned([0.0, 0.0, 90.0]).apply(p), [-1.3, 0.7, -2.9]);
        assert_eq!(turned([0.0, 0.0, -270.0]).apply(p), [-1.3, 0.7, -2.9]);
        assert_eq!(turned([720.0, -360.0, 360.0]), turned([0.0; 3]));
        // x first: y -> z; then z: the new z stays.
        assert_eq!(
            turned([90.0, 0.0, 90.0]).apply([0.0, 1.3, 0.0]),
            [0.0, 0.0, 1.3]
        );
    }

    #[test]
    fn any_rotation_keeps_lengths_and_composes() {
        let p = [0.7, 1.3, -2.9];
        let by_steps = turned([0.0, 0.0, 71.0])
            .apply(turned([0.0, -23.0, 0.0]).apply(turned([37.0, 0.0, 0.0]).apply(p)));
        let at_once = turned([37.0, -23.0, 71.0]).apply(p);
        for k in 0..3 {
            assert!(
                (by_steps[k] - at_once[k]).abs() < 1e-15,
                "{by_steps:?} {at_once:?}"
            );
        }
    }

    #[test]
    fn roundings_follow_their_axes() {
        let scaled = |rotate_deg| turned(rotate_deg).scaled([0.2, 0.3, 25.0]);
        let own = [1e-9, 2e-9, 2e-3];
        let flat = [1e-9 * 0.2, 2e-9 * 0.3, 2e-3 * 25.0];
        assert_eq!(scaled([0.0; 3]).roundings_m(own), flat);
        let [x, y, z] = flat;
        assert_eq!(scaled([0.0, 90.0, 0.0]).roundings_m(own), [z, y, x]);
        let [_, y, z] = scaled([30.0, 0.0, 0.0]).roundings_m(own);
        assert!((y - 0.025).abs() < 1e-9 && (z - 0.05 * 0.75f64.sqrt()).abs() < 1e-9);
        // Equal ones stay as they are, to the bit.
        assert_eq!(turned([37.0, -23.0, 71.0]).roundings_m([0.7; 3]), [0.7; 3]);
    }

    /// A point far below the part was what `rest_on_mm` brought to its height.
    #[test]
    fn what_has_no_area_decides_no_place() {
        let low = [[9.0, 9.0, -110.0]; 3];
        let part = [[0.7, 0.3, 1.3], [10.7, 0.3, 1.3], [0.7, 8.3, 2.9]];
        let mut placement = Placement::default();
        placement.seat.rest_on_m = Some(0.02);
        placement.seat.center = true;
        let seated = |triangles: &[Triangle]| {
            let (seated, _) = Transform::new(1e-3, &placement).seated(&placement, triangles);
            seated
        };
        assert_eq!(seated(&[part, low]), seated(&[part]));
        assert!((seated(&[part, low]).apply([0.0, 0.0, 1.3])[2] - 0.02).abs() < 1e-15);
        let [x, y, _] = seated(&[part]).apply([5.7, 4.3, 0.0]);
        assert!(x.abs() < 1e-15 && y.abs() < 1e-15, "{x} {y}");
        // Without any area there is nothing to seat.
        assert_eq!(seated(&[low]), Transform::new(1e-3, &placement));
    }

    #[test]
    fn very_many_turns_are_no_turn() {
        for turns in [1e15, -1e15, 2f64.powi(300)] {
            assert_eq!(sin_cos_deg(turns * 360.0), (0.0, 1.0), "{turns}");
        }
        // 1e17 degrees are 280 more than whole turns.
        assert_eq!(sin_cos_deg(1e17), sin_cos_deg(280.0));
    }

    #[test]
    fn sines_are_sines() {
        for angle in [
            -400.3, -91.0, -44.9, 0.3, 44.9, 45.1, 133.0, 200.0, 300.7, 1e4,
        ] {
            let (sin, cos) = sin_cos_deg(angle);
            let radians = angle.to_radians();
            assert!((sin - radians.sin()).abs() < 1e-13 && (cos - radians.cos()).abs() < 1e-13);
        }
    }
}
