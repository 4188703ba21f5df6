//! Quarter turns and mirrors that map an array of identical coils to itself.

/// A motion of the plane that maps the array to itself: a mirror theta -> -theta first, if
/// `mirrored`, then quarter turns, both about the array's centre.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Motion {
    /// Where each coil goes.
    pub coil: Vec<usize>,
    mirrored: bool,
    quarters: usize,
}

impl Motion {
    /// Where the k-th of `angles` (a multiple of four) regular angles about a coil's axis goes.
    #[must_use]
    pub fn angle(&self, k: usize, angles: usize) -> usize {
        let k = if self.mirrored { angles - k } else { k };
        (k + self.quarters * (angles / 4)) % angles
    }
}

/// All motions of the array; the identity is the first.
#[must_use]
pub fn motions(positions_m: &[[f64; 2]]) -> Vec<Motion> {
    let count = positions_m.len() as f64;
    let centre = positions_m.iter().fold([0.0, 0.0], |c, p| {
        [c[0] + p[0] / count, c[1] + p[1] / count]
    });
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
            let image = |p: &[f64; 2]| {
                let [x, mut y] = *p;
                if mirrored {
                    y = -y;
                }
                match quarters {
                    0 => [x, y],
                    1 => [-y, x],
                    2 => [-x, -y],
                    _ => [y, -x],
                }
            };
            let coil: Option<Vec<usize>> = centred
                .iter()
                .map(|p| centred.iter().position(|q| same(&image(p), q)))
                .collect();
            if let Some(coil) = coil {
                found.push(Motion {
                    coil,
                    mirrored,
                    quarters,
                });
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

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
}
