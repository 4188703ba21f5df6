//! Which triangles may touch a point of the plan: a grid of buckets.

use rayon::prelude::*;

use crate::shape::mesh::Mesh;
use crate::shape::seen::Seen;

/// Buckets a side, at most.
const MOST_A_SIDE: usize = 2048;

/// Triangles by the buckets of the plan that they touch.
pub(super) struct Index {
    low_m: [f64; 2],
    per_m: [f64; 2],
    side: usize,
    starts: Vec<usize>,
    members: Vec<u32>,
}

impl Index {
    /// `reach_m`: how far outside an edge a point still touches it.
    pub(super) fn new(mesh: &Mesh, reach_m: f64) -> Self {
        let plan = mesh.facts().bounds.plan();
        let triangles = mesh.triangles();
        let side = ((triangles.len() as f64).sqrt().ceil() as usize).clamp(1, MOST_A_SIDE);
        let per_m = plan.map(|[low, high]| {
            let width = high - low;
            if width > 0.0 {
                side as f64 / width
            } else {
                0.0
            }
        });
        let mut index = Self {
            low_m: plan.map(|[low, _]| low),
            per_m,
            side,
            starts: vec![0; side * side + 1],
            members: Vec::new(),
        };
        let pairs: Vec<(u32, u32)> = (0..triangles.len())
            .into_par_iter()
            .flat_map_iter(|k| {
                let seen = Seen::new(&triangles[k], reach_m);
                let ends = |axis: usize| {
                    let values = triangles[k].map(|v| v[axis]);
                    let low = values.iter().copied().fold(f64::INFINITY, f64::min);
                    let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
                    [low - reach_m, high + reach_m]
                };
                let (x, y) = (ends(0), ends(1));
                let rows = index.place(1, y[0])..=index.place(1, y[1]);
                let mut found = Vec::new();
                for row in rows {
                    let [from, to] = index.columns(&seen, row, x);
                    for column in index.place(0, from)..=index.place(0, to) {
                        found.push(((row * side + column) as u32, k as u32));
                    }
                }
                found
            })
            .collect();
        for (bucket, _) in &pairs {
            index.starts[*bucket as usize + 1] += 1;
        }
        for bucket in 1..index.starts.len() {
            index.starts[bucket] += index.starts[bucket - 1];
        }
        let mut next = index.starts.clone();
        index.members = vec![0; pairs.len()];
        for (bucket, k) in pairs {
            index.members[next[bucket as usize]] = k;
            next[bucket as usize] += 1;
        }
        index
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

    /// Every triangle that may touch the vertical line through `p`, ascending.
    pub(super) fn at(&self, p: [f64; 2]) -> &[u32] {
        let bucket = self.place(1, p[1]) * self.side + self.place(0, p[0]);
        &self.members[self.starts[bucket]..self.starts[bucket + 1]]
    }
}
