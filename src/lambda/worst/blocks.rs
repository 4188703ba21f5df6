//! Neighbouring points looked at together, so that most of them need not be looked at alone.
//!
//! A point is its row of forces, height and offset; what a probe leaves of its error is linear in
//! that row. The rows of a block lie near the segment between the first and the last one, so that
//! errors at both ends and the distances from the segment bound them all. Between two probes of a
//! path currents lie near the mixture of theirs, so that errors at both bound those in between.

use rayon::prelude::*;

use super::points::{Points, Probe};
use super::scaled::Form;
use fluxform_numerics::dispatch::{self, Kernel, LANES, Lanes, mul_add};

/// Points of a block: fewer bound tighter, more need less memory.
const BLOCK: usize = 32;
/// Blocks of one parallel task: fixed, so that results do not depend on the number of threads.
const TASK: usize = 256;
/// Rounding of a bound, in units of the terms' sizes.
const ROUNDINGS: f64 = 64.0;
/// Points missed by at least this part of the most that their neighbours are missed by join too.
const PART: f64 = 0.5;

/// Bounds of all blocks: a start, a step to the end, distances from the segment, and largest
/// absolute entries, each of one entry a dimension.
pub(super) struct Blocks {
    dimensions: usize,
    bounds: Vec<f64>,
}

/// Entry `d` of a point's row: forces, height, offset.
#[inline(always)]
fn entry(points: &Points, j: usize, d: usize) -> f64 {
    match d.checked_sub(points.coils) {
        None => points.forces_n_per_a[j * points.coils + d],
        Some(0) => points.height_m[j],
        _ => points.offset_n.map_or(0.0, |offset| offset[j]),
    }
}

impl Blocks {
    /// One pass over the points; `largest` has the size of every entry of a row.
    pub fn new(points: Points, largest: &[f64]) -> Self {
        let dimensions = points.coils + 1 + usize::from(points.offset_n.is_some());
        let count = points.height_m.len().div_ceil(BLOCK);
        let mut bounds = vec![0.0; count * 4 * dimensions];
        bounds
            .par_chunks_mut(TASK * 4 * dimensions)
            .enumerate()
            .for_each(|(task, bounds)| {
                dispatch::run(Enclose {
                    points,
                    first: task * TASK * BLOCK,
                    bounds,
                    largest,
                });
            });
        Self { dimensions, bounds }
    }
}

/// Fills in the bounds of consecutive blocks.
struct Enclose<'a> {
    points: Points<'a>,
    first: usize,
    bounds: &'a mut [f64],
    largest: &'a [f64],
}

impl Kernel for Enclose<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FMA: bool>(self) {
        let points = self.points;
        let n = points.coils + 1 + usize::from(points.offset_n.is_some());
        let size = |d: usize| {
            let inverse = 1.0 / self.largest[d];
            if inverse.is_finite() { inverse } else { 0.0 }
        };
        let mut row = vec![0.0; n];
        let mut towards = vec![0.0; n];
        for (k, bounds) in self.bounds.chunks_exact_mut(4 * n).enumerate() {
            fluxform_base::progress::poll();
            let first = self.first + k * BLOCK;
            let last = (first + BLOCK).min(points.height_m.len()) - 1;
            let (start, rest) = bounds.split_at_mut(n);
            let (step, rest) = rest.split_at_mut(n);
            let (aside, most) = rest.split_at_mut(n);
            let mut length = 0.0;
            for d in 0..n {
                start[d] = entry(&points, first, d);
                step[d] = entry(&points, last, d) - start[d];
                let scale = size(d);
                towards[d] = step[d] * scale * scale;
                length += step[d] * towards[d];
            }
            let unit = if length > 0.0 { 1.0 / length } else { 0.0 };
            for j in first..=last {
                row[..points.coils].copy_from_slice(
                    &points.forces_n_per_a[j * points.coils..(j + 1) * points.coils],
                );
                for (d, value) in row.iter_mut().enumerate().skip(points.coils) {
                    *value = entry(&points, j, d);
                }
                let mut along = 0.0;
                for d in 0..n {
                    along = mul_add::<FMA>(row[d] - start[d], towards[d], along);
                }
                let along = (along * unit).clamp(0.0, 1.0);
                for d in 0..n {
                    let off = (row[d] - start[d] - along * step[d]).abs();
                    aside[d] = aside[d].max(off);
                    most[d] = most[d].max(row[d].abs());
                }
            }
        }
    }
}

/// The condition at a few consecutive probes, or between.
struct Node {
    /// First and last probe.
    from: usize,
    to: usize,
    /// Largest absolute entries of the probes' vectors.
    most: Vec<f64>,
    /// Largest distances of the vectors from the mixture of the first and the last one.
    drift: Vec<f64>,
    /// Largest distance of the limit from the same mixture.
    limit: f64,
    /// Nodes of the two halves, or the probes side by side.
    below: Below,
}

enum Below {
    Halves(usize, usize),
    Probes(Packed),
}

/// Up to as many probes as there are lanes.
struct Packed {
    limit: Lanes,
    /// One entry a dimension.
    vector: Vec<Lanes>,
}

/// Probes in the order of a path, as a tree of halves.
struct Tree {
    /// `-currents, lambda, -share of the offset` of every probe.
    vectors: Vec<Vec<f64>>,
    limits: Vec<f64>,
    nodes: Vec<Node>,
}

impl Tree {
    fn new(dimensions: usize, coils: usize, probes: &[Probe]) -> Self {
        let vector = |probe: &Probe| -> Vec<f64> {
            let mut vector: Vec<f64> = probe.currents_a.iter().map(|i| -i).collect();
            vector.extend([probe.lambda_n_per_m, -probe.offset_share]);
            vector.truncate(dimensions);
            vector
        };
        let mut tree = Self {
            vectors: probes.iter().map(vector).collect(),
            limits: probes.iter().map(|probe| probe.limit_n).collect(),
            nodes: Vec::new(),
        };
        if !probes.is_empty() {
            tree.grow(coils, 0, probes.len() - 1);
        }
        tree
    }

    /// Adds the node of probes `from..=to` and those below it; its number.
    fn grow(&mut self, coils: usize, from: usize, to: usize) -> usize {
        let below = if to - from < LANES {
            let of = |value: &dyn Fn(usize) -> f64| {
                let values: Vec<f64> = (from..=to).map(value).collect();
                Lanes::load(&values)
            };
            Below::Probes(Packed {
                limit: of(&|k| self.limits[k]),
                vector: (0..self.vectors[from].len())
                    .map(|d| of(&|k| self.vectors[k][d]))
                    .collect(),
            })
        } else {
            let middle = usize::midpoint(from, to);
            Below::Halves(self.grow(coils, from, middle), self.grow(coils, middle, to))
        };
        let n = self.vectors[from].len();
        let (a, b) = (&self.vectors[from], &self.vectors[to]);
        let (mut most, mut drift, mut limit) = (vec![0.0_f64; n], vec![0.0_f64; n], 0.0_f64);
        let way = b[coils] - a[coils];
        for k in from..=to {
            let vector = &self.vectors[k];
            let share = if way > 0.0 {
                ((vector[coils] - a[coils]) / way).clamp(0.0, 1.0)
            } else {
                0.0
            };
            for d in 0..n {
                most[d] = most[d].max(vector[d].abs());
                let mixture = (1.0 - share) * a[d] + share * b[d];
                drift[d] = drift[d].max((vector[d] - mixture).abs());
            }
            let mixture = (1.0 - share) * self.limits[from] + share * self.limits[to];
            limit = limit.max(mixture - self.limits[k]);
        }
        // Rounding residue in a bound, in the same terms.
        for d in 0..n {
            drift[d] += ROUNDINGS * f64::EPSILON * most[d];
        }
        self.nodes.push(Node {
            from,
            to,
            most,
            drift,
            limit,
            below,
        });
        self.nodes.len() - 1
    }
}

/// Points above the limit of any of the `probes`, which follow a path: of neighbours those
/// furthest above. None only if there are none. With `Form::Least` only points where the force is
/// too weak count.
pub(super) fn misses(points: Points, blocks: &Blocks, probes: &[Probe], form: Form) -> Vec<usize> {
    let tree = Tree::new(blocks.dimensions, points.coils, probes);
    if tree.nodes.is_empty() {
        return Vec::new();
    }
    let found: Vec<Vec<usize>> = blocks
        .bounds
        .par_chunks(TASK * 4 * blocks.dimensions)
        .enumerate()
        .map(|(task, bounds)| {
            dispatch::run(Search {
                points,
                bounds,
                first: task * TASK * BLOCK,
                tree: &tree,
                both: form == Form::Worst,
            })
        })
        .collect();
    found.concat()
}

/// Searches consecutive blocks.
struct Search<'a> {
    points: Points<'a>,
    bounds: &'a [f64],
    first: usize,
    tree: &'a Tree,
    both: bool,
}

/// The sum of products, in one order.
#[inline(always)]
fn dot<const FMA: bool>(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 4];
    let (a4, a_rest) = a.as_chunks::<4>();
    let (b4, b_rest) = b.as_chunks::<4>();
    for (a, b) in a4.iter().zip(b4) {
        for k in 0..4 {
            sums[k] = mul_add::<FMA>(a[k], b[k], sums[k]);
        }
    }
    for (a, b) in a_rest.iter().zip(b_rest) {
        sums[0] = mul_add::<FMA>(*a, *b, sums[0]);
    }
    (sums[0] + sums[1]) + (sums[2] + sums[3])
}

impl Kernel for Search<'_> {
    type Output = Vec<usize>;

    #[inline(always)]
    fn run<const FMA: bool>(self) -> Vec<usize> {
        let (points, tree) = (self.points, self.tree);
        let n = tree.vectors[0].len();
        let size = |rest: f64| if self.both { rest.abs() } else { rest };
        // How far the block's ends are above the limit of a probe.
        let above = |bounds: &[f64], k: usize| {
            let vector = &tree.vectors[k];
            let start = dot::<FMA>(&bounds[..n], vector);
            let end = start + dot::<FMA>(&bounds[n..2 * n], vector);
            size(start).max(size(end)) - tree.limits[k]
        };
        // The bar rises with every point found, so that few of a neighbourhood are returned.
        let mut bar = tree.limits.clone();
        let mut found: Vec<usize> = Vec::new();
        let mut stack: Vec<(usize, f64, f64)> = Vec::new();
        for (k, bounds) in self.bounds.chunks_exact(4 * n).enumerate() {
            fluxform_base::progress::poll();
            let first = self.first + k * BLOCK;
            let last = (first + BLOCK).min(points.height_m.len());
            let root = tree.nodes.len() - 1;
            let node = &tree.nodes[root];
            stack.push((root, above(bounds, node.from), above(bounds, node.to)));
            while let Some((number, at_from, at_to)) = stack.pop() {
                let node = &tree.nodes[number];
                let aside = dot::<FMA>(&bounds[2 * n..3 * n], &node.most);
                let drift = dot::<FMA>(&bounds[3 * n..], &node.drift);
                if at_from.max(at_to) + aside + drift + node.limit <= 0.0 {
                    continue;
                }
                let packed = match &node.below {
                    Below::Halves(left, right) => {
                        let at_middle = above(bounds, tree.nodes[*left].to);
                        stack.push((*right, at_middle, at_to));
                        stack.push((*left, at_from, at_middle));
                        continue;
                    }
                    Below::Probes(packed) => packed,
                };
                let filled = node.to - node.from + 1;
                for j in first..last {
                    let row = &points.forces_n_per_a[j * points.coils..(j + 1) * points.coils];
                    let mut rest = packed.vector[points.coils] * points.height_m[j];
                    if let (Some(offset), Some(share)) =
                        (points.offset_n, packed.vector.get(points.coils + 1))
                    {
                        rest = share.mul_add::<FMA>(Lanes::splat(offset[j]), rest);
                    }
                    for (vector, &force) in packed.vector.iter().zip(row) {
                        rest = vector.mul_add::<FMA>(Lanes::splat(force), rest);
                    }
                    let mut any = false;
                    for (rest, limit) in rest.0.iter().zip(&packed.limit.0) {
                        any |= size(*rest) > *limit;
                    }
                    if !any {
                        continue;
                    }
                    for (k, &rest) in rest.0.iter().enumerate().take(filled) {
                        let probe = node.from + k;
                        let size = size(rest);
                        if size > bar[probe] {
                            let limit = tree.limits[probe];
                            bar[probe] = bar[probe].max(limit + PART * (size - limit));
                            if found.last() != Some(&j) {
                                found.push(j);
                            }
                        }
                    }
                }
            }
        }
        found.sort_unstable();
        found.dedup();
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of the points above each probe's limit the furthest is returned, and none below all limits.
    #[test]
    fn the_point_furthest_above_each_limit_is_found() {
        let mut random = fluxform_numerics::random::Random::new(3);
        let mut next = || random.between(-1.0, 1.0);
        let count = 700;
        // A curve of points and a little of chance, as neighbours on a surface have it.
        let place = |j: usize| 0.011 * j as f64;
        let forces: Vec<f64> = (0..count)
            .flat_map(|j| [place(j).sin(), (1.7 * place(j)).cos()])
            .map(|force| force + 0.02 * next())
            .collect();
        // It rises, so that those little above a limit come before those far above.
        let rise = |j: usize| 1.3 - 0.7 * (0.4 * place(j)).cos();
        let heights: Vec<f64> = (0..count).map(rise).collect();
        let offsets: Vec<f64> = (0..count).map(|_| 0.1 * next()).collect();
        let points = Points {
            coils: 2,
            forces_n_per_a: &forces,
            height_m: &heights,
            offset_n: Some(&offsets),
        };
        let blocks = Blocks::new(points, &[1.02, 1.02, 2.0, 0.1]);
        let probes: Vec<Probe> = (0..23)
            .map(|k| {
                let lambda = 0.1 * f64::from(k);
                Probe {
                    lambda_n_per_m: lambda,
                    offset_share: 1.0,
                    currents_a: vec![0.7 * lambda + 0.1 * next(), 0.3 * lambda],
                    limit_n: 0.3 + 0.9 * lambda,
                }
            })
            .collect();
        for form in [Form::Worst, Form::Least] {
            let over = |probe: &Probe, j: usize| {
                let pushed =
                    forces[2 * j] * probe.currents_a[0] + forces[2 * j + 1] * probe.currents_a[1];
                let rest = probe.lambda_n_per_m * heights[j] - offsets[j] - pushed;
                let size = if form == Form::Worst {
                    rest.abs()
                } else {
                    rest
                };
                size - probe.limit_n
            };
            let found = misses(points, &blocks, &probes, form);
            let mut missed = 0;
            for probe in &probes {
                let furthest =
                    (0..count).max_by(|&i, &j| over(probe, i).total_cmp(&over(probe, j)));
                let furthest = furthest.unwrap();
                if over(probe, furthest) > 1e-12 {
                    missed += 1;
                    assert!(
                        found.contains(&furthest),
                        "{form:?}: {}",
                        probe.lambda_n_per_m
                    );
                }
            }
            assert!(missed > 5 && missed < probes.len(), "{form:?}: {missed}");
            let above = |j: &usize| probes.iter().any(|probe| over(probe, *j) > -1e-12);
            assert!(found.iter().all(above));
            assert!(found.windows(2).all(|pair| pair[0] < pair[1]));
        }
    }
}
