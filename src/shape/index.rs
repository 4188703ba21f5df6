//! Which triangles may touch a point of the plan: a grid of buckets.

use std::ops::RangeInclusive;

use rayon::prelude::*;

use crate::file_mesh::Triangle;
use crate::mesh::Mesh;
use crate::vertical_hit::Seen;

/// Buckets a side, at most.
const MOST_A_SIDE: usize = 2048;
/// So many entries a triangle, on average, are kept at most: what is long, or lies over much
/// else, gets wider buckets,
const MOST_EACH: usize = 64;
/// unless they are so few altogether.
const FEW: usize = 1 << 20;

/// Numbers sorted into buckets, in each of them in the order given.
pub(super) struct Buckets {
    starts: Vec<usize>,
    members: Vec<u32>,
}

impl Buckets {
    /// `pairs`: a bucket, below `count`, and what belongs to it.
    pub(super) fn new(count: usize, pairs: &[(u32, u32)]) -> Self {
        let mut starts = vec![0; count + 1];
        for (bucket, _) in pairs {
            starts[*bucket as usize + 1] += 1;
        }
        for bucket in 1..starts.len() {
            starts[bucket] += starts[bucket - 1];
        }
        let mut next = starts.clone();
        let mut members = vec![0; pairs.len()];
        for (bucket, member) in pairs {
            members[next[*bucket as usize]] = *member;
            next[*bucket as usize] += 1;
        }
        Self { starts, members }
    }

    /// Members of a bucket.
    pub(super) fn of(&self, bucket: usize) -> &[u32] {
        &self.members[self.starts[bucket]..self.starts[bucket + 1]]
    }
}

/// Triangles by the buckets of the plan that they touch.
pub(super) struct Index {
    raster: Raster,
    buckets: Buckets,
}

impl Index {
    /// `reach_m`: how far outside an edge a point still touches it.
    pub(super) fn new(mesh: &Mesh, reach_m: f64) -> Self {
        let triangles = mesh.triangles();
        let plan = mesh.facts().bounds.plan();
        let finest = ((triangles.len() as f64).sqrt().ceil() as usize).clamp(1, MOST_A_SIDE);
        let mut raster = Raster::new(plan, finest, reach_m);
        let most = FEW.max(MOST_EACH * triangles.len());
        while raster.side > 1 && raster.entries(triangles) > most {
            raster = Raster::new(plan, raster.side / 2, reach_m);
        }
        let pairs: Vec<(u32, u32)> = (0..triangles.len())
            .into_par_iter()
            .with_min_len(fluxform_base::progress::items_a_task(triangles.len()))
            .flat_map_iter(|k| {
                let mut found = Vec::new();
                raster.touched(&triangles[k], &mut |row, columns| {
                    let bucket = |column| (row * raster.side + column) as u32;
                    found.extend(columns.map(|column| (bucket(column), k as u32)));
                });
                found
            })
            .collect();
        let buckets = Buckets::new(raster.side * raster.side, &pairs);
        Self { raster, buckets }
    }

    /// Every triangle that may touch the vertical line through `p`, ascending.
    pub(super) fn at(&self, p: [f64; 2]) -> &[u32] {
        let [column, row] = [0, 1].map(|axis| self.raster.place(axis, p[axis]));
        self.buckets.of(row * self.raster.side + column)
    }
}

/// How the plan is cut into buckets.
struct Raster {
    low_m: [f64; 2],
    per_m: [f64; 2],
    side: usize,
    reach_m: f64,
}

impl Raster {
    fn new(plan: [[f64; 2]; 2], side: usize, reach_m: f64) -> Self {
        let per_m = plan.map(|[low, high]| {
            let width = high - low;
            if width > 0.0 {
                side as f64 / width
            } else {
                0.0
            }
        });
        Self {
            low_m: plan.map(|[low, _]| low),
            per_m,
            side,
            reach_m,
        }
    }

    /// How many buckets all triangles touch together.
    fn entries(&self, triangles: &[Triangle]) -> usize {
        let touched = |triangle: &Triangle| {
            let mut count = 0;
            self.touched(triangle, &mut |_, columns| {
                count += (columns.end() + 1).saturating_sub(*columns.start());
            });
            count
        };
        (triangles.par_iter())
            .with_min_len(fluxform_base::progress::items_a_task(triangles.len()))
            .map(touched)
            .sum()
    }

    /// Gives the buckets that a triangle touches, row by row.
    fn touched(&self, triangle: &Triangle, give: &mut dyn FnMut(usize, RangeInclusive<usize>)) {
        let seen = Seen::new(triangle, self.reach_m);
        let ends = |axis: usize| {
            let values = triangle.map(|v| v[axis]);
            let low = values.iter().copied().fold(f64::INFINITY, f64::min);
            let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            [low - self.reach_m, high + self.reach_m]
        };
        let (x, y) = (ends(0), ends(1));
        for row in self.place(1, y[0])..=self.place(1, y[1]) {
            let [from, to] = self.columns(&seen, row, x);
            give(row, self.place(0, from)..=self.place(0, to));
        }
    }

    /// The bucket along one axis; what lies outside belongs to the outermost.
    fn place(&self, axis: usize, value: f64) -> usize {
        // The cast saturates.
        (((value - self.low_m[axis]) * self.per_m[axis]) as usize).min(self.side - 1)
    }

    /// A range of x that holds what the triangle touches in a row of buckets.
    fn columns(&self, seen: &Seen, row: usize, all: [f64; 2]) -> [f64; 2] {
        if self.per_m[1] == 0.0 {
            return all;
        }
        // A bucket's border rounds: one part in a million more on either side.
        let at = |r: f64| self.low_m[1] + r / self.per_m[1];
        let [from, to] = seen.columns_between(at(row as f64 - 1e-6), at(row as f64 + 1.0 + 1e-6));
        if from > to {
            all
        } else {
            [from.max(all[0]), to.min(all[1])]
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::document::Placement;
    use crate::file_mesh::FileMesh;
    use crate::placement::Transform;
    use crate::vertical_hit::Contact;

    fn index(triangles: Vec<Triangle>) -> (Mesh, Index) {
        let file = FileMesh {
            triangles,
            ..FileMesh::default()
        };
        let still = Transform::new(1.0, &Placement::default());
        let mesh = Mesh::place(file, &still).unwrap();
        let index = Index::new(&mesh, 1e-9);
        (mesh, index)
    }

    fn finds_what_touches(mesh: &Mesh, index: &Index) {
        for k in 0..40 {
            let p = [0.7, 1.3].map(|c| (c * f64::from(k)).fract());
            let found = index.at(p);
            assert!(found.is_sorted());
            for (k, triangle) in mesh.triangles().iter().enumerate() {
                if Seen::new(triangle, 1e-9).contact(p) != Contact::None {
                    assert!(found.contains(&(k as u32)), "{k}");
                }
            }
        }
    }

    /// Each touches a bucket of every row: a million of them would have taken 20 GB.
    #[test]
    fn slivers_across_the_whole_plan_get_wider_buckets() {
        let n = 30_000;
        let at = |k: usize| k as f64 / n as f64;
        let sliver = |k: usize| {
            [
                [at(k), 0.0, 0.2],
                [at(k + 1), 0.0, 0.2],
                [at(n - k), 1.0, 0.7],
            ]
        };
        let (mesh, index) = index((0..n).map(sliver).collect());
        assert!(index.buckets.members.len() <= MOST_EACH * n);
        assert!(index.raster.side > 8, "{}", index.raster.side);
        finds_what_touches(&mesh, &index);
    }

    #[test]
    fn small_triangles_get_a_bucket_each() {
        let at = |k: usize| [(k % 90) as f64 / 90.0, (k / 90) as f64 / 90.0];
        let small = |k: usize| {
            let [x, y] = at(k);
            [[x, y, 0.2], [x + 0.013, y, 0.3], [x, y + 0.007, 0.1]]
        };
        let (mesh, index) = index((0..8100).map(small).collect());
        assert_eq!(index.raster.side, 90);
        finds_what_touches(&mesh, &index);
    }
}
