//! The area of convex polygons together: where they lie over each other it counts once.

use super::piece::Polygon;

/// Strips that the polygons are cut into at most.
const MOST_STRIPS: usize = 256;

/// How far corners that touch may be apart, as a share of the polygons' height together.
const ROUNDING: f64 = 1e-12;

/// The area of the union, m^2: strips between the heights of corners, each as long as the polygons are
/// together along its middle. Exact where no two sides cross on the union's border; elsewhere, and where
/// corners give more than `MOST_STRIPS`, the midpoint rule, whose error goes with the square of a strip.
pub(super) fn area_m2(polygons: &[Polygon]) -> f64 {
    let corners = polygons.iter().flat_map(Polygon::corners);
    let mut levels: Vec<f64> = corners.map(|corner| corner[1]).collect();
    levels.sort_unstable_by(f64::total_cmp);
    levels.dedup();
    let Some(last) = levels.len().checked_sub(1) else {
        return 0.0;
    };
    let step = last.div_ceil(MOST_STRIPS).max(1);
    let rounding = ROUNDING * (levels[last] - levels[0]);
    let strips = (0..last).step_by(step).map(|low| {
        let (low, high) = (levels[low], levels[(low + step).min(last)]);
        (high - low) * length_at(polygons, 0.5 * (low + high), rounding)
    });
    strips.sum()
}

/// How long the polygons are together along the line at `y`, m.
fn length_at(polygons: &[Polygon], y: f64, rounding: f64) -> f64 {
    let mut chords: Vec<[f64; 2]> = (polygons.iter())
        .filter_map(|polygon| chord(polygon, y, rounding))
        .collect();
    chords.sort_unstable_by(|p, q| p[0].total_cmp(&q[0]));
    let (mut sum, mut end) = (0.0, f64::NEG_INFINITY);
    for [from, to] in chords {
        sum += (to - from.max(end)).max(0.0);
        end = end.max(to);
    }
    sum
}

/// Where the line at `y` enters and leaves a polygon; a line within `rounding` of its lowest or highest
/// corner is moved into it, lest it pass between neighbours that touch.
fn chord(polygon: &Polygon, y: f64, rounding: f64) -> Option<[f64; 2]> {
    let heights = || polygon.corners().iter().map(|corner| corner[1]);
    let low = heights().fold(f64::INFINITY, f64::min);
    let high = heights().fold(f64::NEG_INFINITY, f64::max);
    if y < low - rounding || high + rounding < y {
        return None;
    }
    let y = y.max(low + rounding).min(high - rounding);
    let mut ends: Option<[f64; 2]> = None;
    for (a, b) in polygon.sides() {
        if (a[1] < y) == (b[1] < y) {
            continue;
        }
        let x = a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0]);
        ends = Some(ends.map_or([x, x], |[from, to]| [from.min(x), to.max(x)]));
    }
    ends
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_lies_over_each_other_counts_once() {
        let triangle = Polygon::of(&[[0.3, 0.2], [2.3, 0.2], [0.3, 1.7]]);
        let inside = Polygon::of(&[[0.5, 0.4], [0.9, 0.5], [0.6, 0.8]]);
        let apart = Polygon::of(&[[3.0, 0.7], [3.7, 0.7], [3.7, 2.0], [3.0, 2.0]]);
        let close =
            |found: f64, expected: f64| assert!((found - expected).abs() < 1e-14, "{found}");
        close(area_m2(&[]), 0.0);
        close(area_m2(&[triangle]), 1.5);
        close(area_m2(&[triangle, inside, triangle]), 1.5);
        close(area_m2(&[inside, triangle, apart]), 1.5 + 0.91);
        // Two squares that share a quarter of each.
        let square = |at: f64| {
            let low = Polygon::of(&[
                [at, at],
                [at + 2.0, at],
                [at + 2.0, at + 2.0],
                [at, at + 2.0],
            ]);
            area_m2(&[
                low,
                Polygon::of(&[[1.0, 1.0], [3.0, 1.0], [3.0, 3.0], [1.0, 3.0]]),
            ])
        };
        close(square(0.0), 7.0);
        close(square(1.0), 4.0);
    }

    /// Corners at more heights than there are strips.
    #[test]
    fn a_polygon_of_many_corners_keeps_its_area() {
        let slivers: Vec<Polygon> = (0..400)
            .map(|k| {
                let y = f64::from(k) / 400.0;
                Polygon::of(&[[0.0, y], [1.3, y], [1.3, y + 0.0025], [0.0, y + 0.0025]])
            })
            .collect();
        let found = area_m2(&slivers);
        assert!((found - 1.3).abs() < 1e-12, "{found}");
    }
}
