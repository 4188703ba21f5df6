//! The points that a program is made of where there are many: a sample of all, and those that it missed.

use std::collections::BTreeSet;

use super::blocks::{Blocks, misses};
use super::points::{Points, Probe};
use super::scaled::{Form, Scaled};

/// Points of the sample: of up to twice as many all are looked at.
const SAMPLE: usize = 4096;

/// All points of one problem, and a few of them copied side by side where they are many.
pub(super) struct Pool<'a> {
    all: Points<'a>,
    few: Option<Few>,
}

struct Few {
    index: Vec<usize>,
    known: BTreeSet<usize>,
    forces: Vec<f64>,
    heights: Vec<f64>,
    offsets: Option<Vec<f64>>,
    /// Bounds of all points, once they are looked at.
    blocks: Option<Blocks>,
}

impl Few {
    fn add(&mut self, all: Points, j: usize) {
        self.index.push(j);
        self.known.insert(j);
        self.forces
            .extend_from_slice(&all.forces_n_per_a[j * all.coils..(j + 1) * all.coils]);
        self.heights.push(all.height_m[j]);
        if let (Some(offsets), Some(offset)) = (&mut self.offsets, all.offset_n) {
            offsets.push(offset[j]);
        }
    }
}

impl<'a> Pool<'a> {
    /// The sample of the points of `scaled`; the highest is in it.
    pub fn new(scaled: &Scaled<'a>) -> Self {
        let problem = scaled.problem;
        let all = Points {
            coils: problem.coils(),
            forces_n_per_a: problem.forces_n_per_a,
            height_m: problem.height_m,
            offset_n: problem.offset_n,
        };
        let count = problem.points();
        let few = (count > 2 * SAMPLE).then(|| {
            let mut sample: BTreeSet<usize> = (0..SAMPLE).map(|k| k * count / SAMPLE).collect();
            sample.insert(scaled.highest);
            let mut few = Few {
                index: Vec::new(),
                known: BTreeSet::new(),
                forces: Vec::new(),
                heights: Vec::new(),
                offsets: all.offset_n.map(|_| Vec::new()),
                blocks: None,
            };
            for j in sample {
                few.add(all, j);
            }
            few
        });
        Self { all, few }
    }

    /// The points that programs are made of.
    pub fn points(&self) -> Points<'_> {
        match &self.few {
            None => self.all,
            Some(few) => Points {
                coils: self.all.coils,
                forces_n_per_a: &few.forces,
                height_m: &few.heights,
                offset_n: few.offsets.as_deref(),
            },
        }
    }

    /// How many these are.
    pub fn count(&self) -> usize {
        self.points().height_m.len()
    }

    /// The number among all points of the one in this place.
    pub fn point(&self, place: usize) -> usize {
        self.few.as_ref().map_or(place, |few| few.index[place])
    }

    /// The place of a point that is in the pool.
    pub fn place(&self, point: usize) -> Option<usize> {
        match &self.few {
            None => Some(point),
            Some(few) => few.index.iter().position(|&j| j == point),
        }
    }

    /// Takes in the points that the probes, which follow a path, miss; of neighbours those missed most.
    /// How many came.
    pub fn take_missed(&mut self, scaled: &Scaled, probes: &[Probe], form: Form) -> usize {
        let all = self.all;
        let Some(few) = &mut self.few else {
            return 0;
        };
        let blocks = few
            .blocks
            .get_or_insert_with(|| Blocks::new(all, scaled.largest));
        let missed: BTreeSet<usize> = misses(all, blocks, probes, form).into_iter().collect();
        let before = few.index.len();
        for j in missed {
            if !few.known.contains(&j) {
                few.add(all, j);
            }
        }
        few.index.len() - before
    }
}
