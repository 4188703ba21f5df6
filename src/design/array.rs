//! Where the coils of an array are, and whether they overlap.

use fluxform_base::units::m_from_mm;

/// Most coils of an array.
pub(crate) const COILS_MAX: usize = 10_000;

/// Relative slack within which two lengths are taken as equal: touching is not overlapping.
pub const TOUCHING: f64 = 1e-9;

/// Axes' positions, m, of `rows` x `columns` coils at `pitch_mm`, centred on the origin:
/// index = row * columns + column, x grows with the column, y with the row.
///
/// Mirrored coils have exactly mirrored positions.
#[must_use]
pub fn grid_positions_m(rows: usize, columns: usize, pitch_mm: f64) -> Vec<[f64; 2]> {
    let along = |index: usize, count: usize| {
        // An exact whole number of half pitches from the centre.
        let halves = 2.0 * index as f64 - (count as f64 - 1.0);
        m_from_mm(halves * (0.5 * pitch_mm))
    };
    let place = |index: usize| {
        [
            along(index % columns, columns),
            along(index / columns, rows),
        ]
    };
    (0..rows * columns).map(place).collect()
}

/// Two coils that are nearer than their diameter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Overlap {
    /// The lower index.
    pub first: usize,
    /// The higher index.
    pub second: usize,
    /// Distance of their axes, in the positions' unit.
    pub distance: f64,
}

/// For each coil that overlaps one of lower index, the nearest such; in coil order.
///
/// `positions` and `outer_diameter` share one unit.
#[must_use]
pub fn overlaps(positions: &[[f64; 2]], outer_diameter: f64) -> Vec<Overlap> {
    let reach = outer_diameter * (1.0 - TOUCHING);
    let mut by_x: Vec<usize> = (0..positions.len()).collect();
    by_x.sort_by(|&a, &b| positions[a][0].total_cmp(&positions[b][0]));
    let mut nearest: Vec<Option<Overlap>> = vec![None; positions.len()];
    for (rank, &a) in by_x.iter().enumerate() {
        let near = by_x[rank + 1..]
            .iter()
            .take_while(|&&b| positions[b][0] - positions[a][0] < reach);
        for &b in near {
            let [dx, dy] = [0, 1].map(|k| positions[b][k] - positions[a][k]);
            let found = Overlap {
                first: a.min(b),
                second: a.max(b),
                distance: dx.hypot(dy),
            };
            let known = nearest[found.second].map_or(reach, |o| o.distance);
            if found.distance < known {
                nearest[found.second] = Some(found);
            }
        }
    }
    nearest.into_iter().flatten().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_run_along_x_and_rows_along_y() {
        let places = grid_positions_m(2, 3, 40.0);
        assert_eq!(places[0], [-0.04, -0.02]);
        assert_eq!(places[2], [0.04, -0.02]);
        assert_eq!(places[3], [-0.04, 0.02]);
        assert_eq!(places[4], [0.0, 0.02]);
    }

    #[test]
    fn mirrored_coils_mirror_exactly() {
        for pitch_mm in [50.0, 0.7 * 53.0, 41.3, 1.0 / 3.0] {
            let places = grid_positions_m(5, 4, pitch_mm);
            for (a, b) in places.iter().zip(places.iter().rev()) {
                assert_eq!((a[0], a[1]), (-b[0], -b[1]));
            }
        }
    }

    #[test]
    fn touching_passes_and_overlap_names_the_nearest_pair() {
        let hexagonal = [[0.0, 0.0], [38.0, 0.0], [19.0, 19.0 * 3.0_f64.sqrt()]];
        assert_eq!(overlaps(&hexagonal, 38.0), []);
        let crowded = [[0.0, 0.0], [50.0, 1.3], [30.0, 0.0], [90.0, 0.0]];
        let found = overlaps(&crowded, 38.0);
        assert_eq!(found.len(), 1);
        assert_eq!((found[0].first, found[0].second), (1, 2));
        assert!((found[0].distance - 20.0422).abs() < 1e-4);
    }

    #[test]
    fn every_overlapping_pair_is_found_as_by_brute_force() {
        let positions: Vec<[f64; 2]> = (0..60)
            .map(|i| [f64::from(i * 37 % 101), f64::from(i * 53 % 89)])
            .collect();
        let found: Vec<usize> = overlaps(&positions, 9.7).iter().map(|o| o.second).collect();
        let apart = |a: &[f64; 2], b: &[f64; 2]| (a[0] - b[0]).hypot(a[1] - b[1]);
        let clashes = |i: &usize| {
            positions[..*i]
                .iter()
                .any(|p| apart(p, &positions[*i]) < 9.7)
        };
        let expected: Vec<usize> = (0..60).filter(clashes).collect();
        assert!(!expected.is_empty());
        assert_eq!(found, expected);
    }
}
