//! Quarter turns and mirrors that map an array of identical coils to itself.

use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use std::ops::Range;

use crate::components::Components;

/// A motion of the plane that maps the array to itself: a mirror theta -> -theta first, if
/// `mirrored`, then quarter turns, both about the array's centre.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Motion {
    /// Where each coil goes.
    pub coil: Vec<usize>,
    mirrored: bool,
    quarters: usize,
}

impl Motion {
    /// Where a place goes, from the array's centre.
    #[must_use]
    pub fn image(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let y = if self.mirrored { -y } else { y };
        match self.quarters {
            0 => [x, y],
            1 => [-y, x],
            2 => [-x, -y],
            _ => [y, -x],
        }
    }

    /// The inverse of [`Motion::image`].
    #[must_use]
    pub fn origin(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let [x, y] = match self.quarters {
            0 => [x, y],
            1 => [y, -x],
            2 => [-x, -y],
            _ => [-y, x],
        };
        [x, if self.mirrored { -y } else { y }]
    }

    /// Cosine and sine of azimuthal number `mode` in the image of its cosine, or of its sine.
    #[must_use]
    pub fn wave(&self, mode: usize, sine: bool) -> [f64; 2] {
        // Of the mode's phase after the quarter turns.
        let (cos, sin) = match (mode * self.quarters) % 4 {
            0 => (1.0, 0.0),
            1 => (0.0, 1.0),
            2 => (-1.0, 0.0),
            _ => (0.0, -1.0),
        };
        match (sine, self.mirrored) {
            (false, _) => [cos, sin],
            (true, false) => [-sin, cos],
            (true, true) => [sin, -cos],
        }
    }

    /// Where the k-th of `angles` (a multiple of four) regular angles about a coil's axis goes.
    #[must_use]
    pub fn angle(&self, k: usize, angles: usize) -> usize {
        let k = if self.mirrored { angles - k } else { k };
        (k + self.quarters * (angles / 4)) % angles
    }

    /// Values on a core's grid, as many side by side for every one of `angles`, after the motion.
    #[must_use]
    pub fn image_on_grid(&self, angles: usize, values: &[f64]) -> Vec<f64> {
        let mut image = vec![0.0; values.len()];
        for (before, after) in self.on_grid(angles, values.len()) {
            image[after].copy_from_slice(&values[before]);
        }
        image
    }

    /// The ranges of `size` values on a core's grid that belong to every angle, and their images.
    pub(super) fn on_grid(
        &self,
        angles: usize,
        size: usize,
    ) -> impl Iterator<Item = (Range<usize>, Range<usize>)> {
        let rings = size / angles;
        let range = move |k: usize| k * rings..(k + 1) * rings;
        (0..angles).map(move |k| (range(k), range(self.angle(k, angles))))
    }
}

/// The mean of the coils' places, m.
#[must_use]
pub fn centre_m(positions_m: &[[f64; 2]]) -> [f64; 2] {
    let count = positions_m.len() as f64;
    positions_m.iter().fold([0.0, 0.0], |c, p| {
        [c[0] + p[0] / count, c[1] + p[1] / count]
    })
}

/// All motions of the array; the identity is the first.
#[must_use]
pub fn motions(positions_m: &[[f64; 2]]) -> Vec<Motion> {
    let centre = centre_m(positions_m);
    let centred: Vec<[f64; 2]> = positions_m
        .iter()
        .map(|p| [p[0] - centre[0], p[1] - centre[1]])
        .collect();
    let extent = centred
        .iter()
        .flatten()
        .fold(0.0_f64, |e, x| e.max(x.abs()));
    let same = |a: &[f64; 2], b: &[f64; 2]| (a[0] - b[0]).hypot(a[1] - b[1]) <= 1e-11 * extent;
    let mut found = Vec::new();
    for mirrored in [false, true] {
        for quarters in 0..4 {
            let motion = Motion {
                coil: Vec::new(),
                mirrored,
                quarters,
            };
            let coil: Option<Vec<usize>> = centred
                .iter()
                .map(|p| centred.iter().position(|q| same(&motion.image(*p), q)))
                .collect();
            found.extend(coil.map(|coil| Motion { coil, ..motion }));
        }
    }
    found
}

/// Places closer than this to each other, in units of the farthest, are one.
const SAME_PLACE: f64 = 1e-13;

/// Places over a symmetric array as images of places in one sector of it, however many or few they are:
/// what is found at a place does not depend on the others.
pub(super) struct Images<'a> {
    motions: &'a [Motion],
    /// The different places in the sector, m.
    pub(super) sector_m: Vec<[f64; 3]>,
    /// Of every place the one in the sector, and by bits the motions that take it there: several where it lies on a
    /// mirror's plane or in the centre.
    origins: Vec<(usize, u8)>,
}

impl<'a> Images<'a> {
    /// Of `points_m` over an array about `centre_m` that `motions` map to itself.
    pub(super) fn new(motions: &'a [Motion], centre_m: [f64; 2], points_m: &[[f64; 3]]) -> Self {
        let farthest = (points_m.iter().flatten()).fold(0.0_f64, |most, v| most.max(v.abs()));
        let step = SAME_PLACE * farthest.max(f64::MIN_POSITIVE);
        let mut sector_m = Vec::new();
        let mut known = HashMap::new();
        let origins = points_m
            .iter()
            .map(|[x, y, z]| {
                let about = [x - centre_m[0], y - centre_m[1]];
                // The sector is where the first coordinate, then the second, is largest.
                let larger =
                    |a: [f64; 2], b: [f64; 2]| a[0] > b[0] || (a[0] == b[0] && a[1] > b[1]);
                let mut first = (1_u8, about);
                for (number, motion) in motions.iter().enumerate().skip(1) {
                    let image = motion.image(about);
                    if larger(image, first.1) {
                        first = (1 << number, image);
                    } else if image == first.1 {
                        first.0 |= 1 << number;
                    }
                }
                let (taking, [dx, dy]) = first;
                let place = [centre_m[0] + dx, centre_m[1] + dy, *z];
                let key = place.map(|v| (v / step).round() as i64);
                let index = *known.entry(key).or_insert_with(|| {
                    sector_m.push(place);
                    sector_m.len() - 1
                });
                (index, taking)
            })
            .collect();
        Self {
            motions,
            sector_m,
            origins,
        }
    }

    /// Values at all places from those in the sector, both [drive, component, place], every coil being
    /// a drive. Coils keep their sense of turning under a mirror, so that B maps as a polar vector. On a mirror's plane
    /// coils that mirror each other give the same but for the rounding of a mean.
    pub(super) fn spread(&self, parts: Components, sector: &[f64], out: &mut [f64]) {
        let (count, to_count) = (parts.count(), self.origins.len());
        for (drive, out) in out.chunks_exact_mut((count * to_count).max(1)).enumerate() {
            for (place, (index, taking)) in self.origins.iter().enumerate() {
                let motions = self.motions.iter().enumerate();
                let motions = motions.filter(|(number, _)| taking >> number & 1 == 1);
                let mut sums = [0.0; MOST_COMPONENTS];
                for (_, motion) in motions {
                    let values =
                        self.moved_back(parts, sector, (motion.coil[drive], *index), motion);
                    sums.iter_mut()
                        .zip(values)
                        .for_each(|(sum, value)| *sum += value);
                }
                let share = 1.0 / f64::from(taking.count_ones());
                for (component, sum) in sums[..count].iter().enumerate() {
                    out[component * to_count + place] = share * sum;
                }
            }
        }
    }

    /// The components of a drive at a place of the sector, as they are where `motion` came from.
    fn moved_back(
        &self,
        parts: Components,
        sector: &[f64],
        (drive, place): (usize, usize),
        motion: &Motion,
    ) -> [f64; MOST_COMPONENTS] {
        let (count, places) = (parts.count(), self.sector_m.len());
        let values = &sector[drive * count * places..];
        let mut moved = [0.0; MOST_COMPONENTS];
        for (component, value) in moved[..count].iter_mut().enumerate() {
            *value = values[component * places + place];
        }
        let turn = |moved: &mut [f64; MOST_COMPONENTS], [x, y]: [usize; 2]| {
            [moved[x], moved[y]] = motion.origin([moved[x], moved[y]]);
        };
        match parts {
            Components::Gz => {}
            Components::Force => turn(&mut moved, [0, 1]),
            Components::Gradient | Components::All => {
                // Rows, then columns, of the part across the axis.
                let (xx, xy, yy) = (moved[0], moved[1], -moved[0] - moved[4]);
                let [a, b] = [[xx, xy], [xy, yy]].map(|row| motion.origin(row));
                [moved[0], _] = motion.origin([a[0], b[0]]);
                [moved[1], _] = motion.origin([a[1], b[1]]);
                turn(&mut moved, [2, 3]);
                if parts == Components::All {
                    turn(&mut moved, [5, 6]);
                }
            }
        }
        moved
    }
}

/// Of [`Components::All`].
const MOST_COMPONENTS: usize = 8;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::steel::CoreShape;
    use crate::steel::array::CoupledArray;
    use crate::steel::clearance::Clearance;
    use crate::steel::equivalent_dipoles::ArraySources;
    use crate::winding::Winding;

    #[test]
    fn a_square_has_eight_a_rectangle_four_a_scatter_one() {
        let grid = |rows: usize, columns: usize, dx: f64, dy: f64| -> Vec<[f64; 2]> {
            (0..rows * columns)
                .map(|i| {
                    [
                        0.7 + dx * (i % columns) as f64,
                        -0.3 + dy * (i / columns) as f64,
                    ]
                })
                .collect()
        };
        assert_eq!(motions(&grid(3, 3, 0.05, 0.05)).len(), 8);
        assert_eq!(motions(&grid(3, 3, 0.05, 0.06)).len(), 4);
        assert_eq!(motions(&grid(2, 3, 0.05, 0.05)).len(), 4);
        let scatter = [[0.0, 0.0], [0.05, 0.01], [-0.03, 0.06]];
        let one = motions(&scatter);
        assert_eq!(one.len(), 1);
        assert_eq!(one[0].coil, vec![0, 1, 2]);
    }

    #[test]
    fn angles_go_where_the_plane_goes() {
        let square = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]];
        for motion in motions(&square) {
            // The direction from coil 0 to coil 1 is angle 0 of 12.
            let (from, to) = (square[motion.coil[0]], square[motion.coil[1]]);
            let direction = (to[1] - from[1]).atan2(to[0] - from[0]);
            let k = motion.angle(0, 12) as f64;
            let difference = (direction - k * std::f64::consts::TAU / 12.0).sin();
            assert!(difference.abs() < 1e-12, "{motion:?}");
        }
    }

    /// A square array's grid of points once cost eight times the points of its sector.
    #[test]
    fn places_of_one_sector_stand_for_all_of_a_symmetric_array() {
        let winding = Winding {
            inner_radius_m: 0.013,
            outer_radius_m: 0.019,
            length_m: 0.07,
            turns: 700.0,
        };
        let shape = CoreShape {
            radius_m: 0.011,
            bottom_m: -0.083,
            top_m: 0.003,
        };
        let grid = |pitch: [f64; 2]| -> Vec<[f64; 2]> {
            let at = |i: u32| {
                [
                    0.013 + pitch[0] * f64::from(i % 2),
                    -0.007 + pitch[1] * f64::from(i / 2),
                ]
            };
            (0..4).map(at).collect()
        };
        let (lowest_m, tolerance) = (0.023, 1e-4);
        for (pitch, sectors) in [([0.047, 0.047], 8), ([0.047, 0.053], 4)] {
            let positions_m = grid(pitch);
            let array =
                CoupledArray::new(&winding, shape, 470.0, &positions_m, 1e-3, lowest_m).unwrap();
            let sources = ArraySources::for_many_points(
                &array,
                Clearance::above(lowest_m, lowest_m - shape.top_m),
                tolerance,
            );
            let points: Vec<[f64; 3]> = (0..200)
                .map(|k| {
                    let part = |step: f64| (0.5 + step * f64::from(k)).fract();
                    let (x, y) = (part(0.754_877_666), part(0.569_840_291));
                    [
                        0.14 * x - 0.04,
                        0.13 * y - 0.05,
                        lowest_m * f64::from(1 + k % 3),
                    ]
                })
                .collect();
            for parts in Components::ALL {
                let mut values = vec![0.0; positions_m.len() * parts.count() * points.len()];
                let mut sure = values.clone();
                sources.sample(&points, *parts, &mut values);
                sources.sample_all(&points, *parts, &mut sure);
                // Fields are a few times the gradient over the metre.
                let size = winding.field(0.0, lowest_m).unwrap().gradient_norm();
                let worst = values
                    .iter()
                    .zip(&sure)
                    .fold(0.0_f64, |m, (a, b)| m.max((a - b).abs()));
                assert!(worst < tolerance * size, "{parts:?}: {:e}", worst / size);
            }
            let symmetries = motions(&positions_m);
            assert_eq!(symmetries.len(), sectors);
            let centre_m = [0.013 + 0.5 * pitch[0], -0.007 + 0.5 * pitch[1]];
            let nodes: Vec<[f64; 3]> = (0..41 * 41)
                .map(|i| {
                    let step = |k: i32| 0.002 * f64::from(k - 20);
                    [centre_m[0] + step(i % 41), centre_m[1] + step(i / 41), 0.03]
                })
                .collect();
            // On a mirror's plane, coils that mirror each other give the same.
            let plane: Vec<[f64; 3]> = nodes.iter().skip(20).step_by(41).copied().collect();
            let mut gz = vec![0.0; positions_m.len() * plane.len()];
            sources.sample(&plane, Components::Gz, &mut gz);
            let keeps = |motion: &&Motion| motion.image([0.0, 1.0]) == [0.0, 1.0];
            let mirror = symmetries.iter().skip(1).find(keeps).unwrap();
            let of = |coil: usize| &gz[coil * plane.len()..][..plane.len()];
            for (coil, other) in mirror.coil.iter().enumerate() {
                for (a, b) in of(coil).iter().zip(of(*other)) {
                    assert!((a - b).abs() <= 4.0 * f64::EPSILON * a.abs(), "{a:e} {b:e}");
                }
            }
            let different = Images::new(&symmetries, centre_m, &nodes).sector_m.len();
            assert_eq!(different, if sectors == 8 { 231 } else { 441 });
        }
    }
}
