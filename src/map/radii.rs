//! Distances of grid points from the coils' axes, each distinct one once.

/// Distances closer than this multiple of the rounding of the largest squared distance are one:
/// they differ by the rounding of the positions only.
const SAME: f64 = 8.0 * f64::EPSILON;

/// The distinct distances between a horizontal grid and a set of axes.
#[derive(Debug, Clone)]
pub struct Radii {
    /// Distinct distances, m, ascending.
    pub distinct_m: Vec<f64>,
    /// Index into `distinct_m`, [coil, y, x].
    pub index: Vec<u32>,
}

impl Radii {
    /// Distances of every grid point (`x_m`, `y_m`) from every axis.
    #[must_use]
    pub fn new(x_m: &[f64], y_m: &[f64], axes_m: &[[f64; 2]]) -> Self {
        let mut squares = Vec::with_capacity(axes_m.len() * y_m.len() * x_m.len());
        for [ax, ay] in axes_m {
            for y in y_m {
                let dy = y - ay;
                squares.extend(x_m.iter().map(|x| (x - ax) * (x - ax) + dy * dy));
            }
        }
        let mut order: Vec<(f64, u32)> = squares.iter().copied().zip(0..).collect();
        order.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let same = SAME * order.last().map_or(0.0, |last| last.0);
        let mut index = vec![0; squares.len()];
        let mut distinct_m: Vec<f64> = Vec::new();
        let mut current = f64::NEG_INFINITY;
        for (square, place) in order {
            if square - current > same {
                current = square;
                distinct_m.push(square.sqrt());
            }
            index[place as usize] = (distinct_m.len() - 1) as u32;
        }
        Self { distinct_m, index }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fluxform_numerics::axis::Axis;

    #[test]
    fn the_seed_grid_repeats_its_radii() {
        let axis = Axis {
            from: -0.05,
            to: 0.05,
            samples: 61,
        }
        .nodes();
        let axes: Vec<[f64; 2]> = (0..9)
            .map(|i| [0.05 * f64::from(i % 3 - 1), 0.05 * f64::from(i / 3 - 1)])
            .collect();
        let radii = Radii::new(&axis, &axis, &axes);
        assert_eq!(radii.index.len(), 33_489);
        assert_eq!(radii.distinct_m.len(), 1446);
        for (place, index) in radii.index.iter().enumerate() {
            let (coil, y, x) = (place / 3721, place / 61 % 61, place % 61);
            let exact = (axis[x] - axes[coil][0]).hypot(axis[y] - axes[coil][1]);
            assert!(
                (radii.distinct_m[*index as usize] - exact).abs() < 1e-15 + 1e-16 / (exact + 1e-9)
            );
        }
    }
}
