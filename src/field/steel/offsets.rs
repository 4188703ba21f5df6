//! The different offsets between the cores of an array: those of many pairs are one, or its images under
//! quarter turns and mirrors, so that what passes at one in the first eighth of the plane decides them all.

use super::symmetry::{Motion, motions};

/// Difference of lengths that are one but for rounding, in units of the array's extent.
pub(super) const ROUNDING: f64 = 1e-10;

/// Offsets of one core from another of which no two are images of each other.
#[derive(Debug)]
pub(super) struct Offsets {
    /// Between the first axis and the diagonal, ascending, m.
    pub(super) first_m: Vec<[f64; 2]>,
    /// All motions of a single coil.
    pub(super) motions: Vec<Motion>,
}

impl Offsets {
    /// Those of all pairs of places.
    pub(super) fn of_pairs(positions_m: &[[f64; 2]]) -> Self {
        let of = |i: usize| {
            let [x, y] = positions_m[i];
            (positions_m[..i].iter()).map(move |b| [x - b[0], y - b[1]])
        };
        Self::among((0..positions_m.len()).flat_map(of), extent_m(positions_m))
    }

    /// Those of all pairs of cells of a lattice.
    pub(super) fn on_lattice(cells: &[[usize; 2]], step_m: [f64; 2]) -> Self {
        let apart = |a: [usize; 2], b: [usize; 2]| [0, 1].map(|axis| a[axis].abs_diff(b[axis]));
        let mut steps: Vec<[usize; 2]> = (cells.iter())
            .flat_map(|a| cells.iter().map(|b| apart(*a, *b)))
            .collect();
        steps.sort_unstable();
        steps.dedup();
        let offset_m = |s: &[usize; 2]| [0, 1].map(|axis| s[axis] as f64 * step_m[axis]);
        let offsets_m: Vec<[f64; 2]> = steps.iter().map(offset_m).collect();
        let extent_m = (offsets_m.iter()).fold(0.0_f64, |most, [x, y]| most.max(x.hypot(*y)));
        Self::among(offsets_m.into_iter(), extent_m)
    }

    fn among(offsets_m: impl Iterator<Item = [f64; 2]>, extent_m: f64) -> Self {
        let rounding_m = ROUNDING * extent_m;
        let mut offsets_m: Vec<[f64; 2]> = offsets_m.map(first_eighth).collect();
        offsets_m.retain(|[x, _]| *x > rounding_m);
        offsets_m.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
        let same = |a: &[f64; 2], b: &[f64; 2]| (0..2).all(|k| (a[k] - b[k]).abs() <= rounding_m);
        // Those that differ by rounding only may not lie side by side.
        let mut first_m: Vec<[f64; 2]> = Vec::with_capacity(offsets_m.len());
        for offset in offsets_m {
            let near = first_m.iter().rev();
            let mut near = near.take_while(|known| offset[0] - known[0] <= rounding_m);
            if !near.any(|known| same(known, &offset)) {
                first_m.push(offset);
            }
        }
        Self {
            first_m,
            motions: motions(&[[0.0; 2]]),
        }
    }

    /// How many there are.
    pub(super) fn count(&self) -> usize {
        self.first_m.len()
    }

    /// The number of the offset that stands for `offset_m`, and that of the motion that takes it there.
    pub(super) fn of(&self, offset_m: [f64; 2]) -> Option<(usize, usize)> {
        let [x, y] = first_eighth(offset_m);
        let near = |[a, b]: [f64; 2]| (a - x).abs() + (b - y).abs();
        let at = (self.first_m).partition_point(|known| known[0] < x * (1.0 - 1e-8));
        let reach = self.first_m[at..]
            .iter()
            .take_while(|known| known[0] <= x * (1.0 + 1e-8));
        let (place, known) = reach
            .enumerate()
            .min_by(|(_, a), (_, b)| near(**a).total_cmp(&near(**b)))?;
        let size = offset_m[0].hypot(offset_m[1]);
        (near(*known) <= 1e-8 * size).then_some(())?;
        let off = |motion: &usize| {
            let image = self.motions[*motion].image(*known);
            (image[0] - offset_m[0]).abs() + (image[1] - offset_m[1]).abs()
        };
        let motion = (0..self.motions.len()).min_by(|a, b| off(a).total_cmp(&off(b)))?;
        Some((at + place, motion))
    }
}

/// The image of an offset between the first axis and the diagonal.
fn first_eighth([x, y]: [f64; 2]) -> [f64; 2] {
    [x.abs().max(y.abs()), x.abs().min(y.abs())]
}

/// Length of the diagonal of the places' bounding box, m.
pub(super) fn extent_m(positions_m: &[[f64; 2]]) -> f64 {
    let span = |axis: usize| {
        let values = positions_m.iter().map(|p| p[axis]);
        let [lo, hi] = values.fold([f64::INFINITY, f64::NEG_INFINITY], |[lo, hi], v| {
            [lo.min(v), hi.max(v)]
        });
        hi - lo
    };
    span(0).hypot(span(1))
}

#[cfg(test)]
mod tests {
    use super::Offsets;

    #[test]
    fn pairs_share_offsets_and_their_images() {
        let of = |positions_m: &[[f64; 2]]| Offsets::of_pairs(positions_m).count();
        assert_eq!(of(&[[0.7, 1.3]]), 0);
        // One apart and two apart, to either side; the last within rounding.
        assert_eq!(of(&[[0.1, 0.0], [0.2, 0.0], [0.1 + 0.2, 0.0]]), 2);
        let square = [[0.0, 0.0], [1.3, 0.0], [0.0, 1.3], [1.3, 1.3]];
        assert_eq!(of(&square), 2);
        let oblong = [[0.0, 0.0], [1.3, 0.0], [0.0, 1.7], [1.3, 1.7]];
        assert_eq!(of(&oblong), 3);
    }

    #[test]
    fn the_motion_of_an_offset_takes_its_image_there() {
        let positions_m = [[0.0, 0.0], [0.05, 0.01], [-0.03, 0.06], [0.1, 0.02]];
        let offsets = Offsets::of_pairs(&positions_m);
        for [ax, ay] in positions_m {
            for [bx, by] in positions_m.into_iter().filter(|b| *b != [ax, ay]) {
                let offset_m = [ax - bx, ay - by];
                let (number, motion) = offsets.of(offset_m).expect("of a pair");
                let image = offsets.motions[motion].image(offsets.first_m[number]);
                let off = (image[0] - offset_m[0]).hypot(image[1] - offset_m[1]);
                assert!(off < 1e-15, "{offset_m:?}: {image:?}");
            }
        }
        assert!(offsets.of([0.02, 0.02]).is_none());
    }
}
