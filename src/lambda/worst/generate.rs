//! Few points decide: a program over them is followed, the points it misses are added, and so
//! on until none is missed at any turn of the path.
//!
//! Along a piece the currents are linear in lambda and the largest error is convex, so a path
//! that is right at the turns, and in the direction of its last piece, is right everywhere.

use std::collections::BTreeSet;

use super::points::{Miss, Points, Probe, misses};
use super::program::{End, Piece, Program};
use super::scaled::{Form, Scaled};
use crate::lambda::reduce::times_power;
use crate::numerics::real::Real;

/// Points tried first: with more, the rest are only looked at to confirm.
const POOL: usize = 4096;
/// Rounding of a force summed in doubles, in units of the terms' sizes.
const ROUNDINGS: f64 = 8.0;
/// A force that is none, in scaled units: what rounding leaves at lambda = 0.
const NOTHING: f64 = 1e-25;
/// More rounds than any problem needs.
const ROUNDS: usize = 200;

/// The followed path over all points.
pub(super) struct Followed {
    pub pieces: Vec<Piece>,
    /// Points and signs of the rows of `pieces[..].active`; `None` for limits.
    pub rows: Vec<Option<(usize, bool)>>,
    pub end: End,
    /// Largest error that may hide at a point, relative to lambda max h plus the offset.
    pub doubt: f64,
}

/// A few points, copied side by side.
struct Pool {
    index: Vec<usize>,
    forces: Vec<f64>,
    heights: Vec<f64>,
    offsets: Option<Vec<f64>>,
}

impl Pool {
    fn new(all: Points, index: Vec<usize>) -> Self {
        let mut pool = Self {
            index: Vec::new(),
            forces: Vec::new(),
            heights: Vec::new(),
            offsets: all.offset_n.map(|_| Vec::new()),
        };
        for j in index {
            pool.add(all, j);
        }
        pool
    }

    fn add(&mut self, all: Points, j: usize) {
        self.index.push(j);
        self.forces
            .extend_from_slice(&all.forces_n_per_a[j * all.coils..(j + 1) * all.coils]);
        self.heights.push(all.height_m[j]);
        if let (Some(offsets), Some(offset)) = (&mut self.offsets, all.offset_n) {
            offsets.push(offset[j]);
        }
    }

    fn points(&self, coils: usize) -> Points<'_> {
        Points {
            coils,
            forces_n_per_a: &self.forces,
            height_m: &self.heights,
            offset_n: self.offsets.as_deref(),
        }
    }
}

/// Follows the program of all points.
pub(super) fn follow(scaled: &Scaled, form: Form) -> Followed {
    let problem = scaled.problem;
    let all = Points {
        coils: problem.coils(),
        forces_n_per_a: problem.forces_n_per_a,
        height_m: problem.height_m,
        offset_n: problem.offset_n,
    };
    let count = problem.points();
    let mut pool = (count > 2 * POOL).then(|| {
        let mut index: BTreeSet<usize> = (0..POOL).map(|k| k * count / POOL).collect();
        index.insert(scaled.highest);
        Pool::new(all, index.into_iter().collect())
    });
    let mut working: Vec<(usize, bool)> = vec![(scaled.highest, true)];
    if form == Form::Worst {
        working.push((scaled.highest, false));
    }
    let fixed = working.len();
    for _ in 0..ROUNDS {
        let (mut followed, first_row) = solve(scaled, form, &working);
        if followed.end != End::Whole {
            return followed;
        }
        let probes = probes(scaled, form, &mut followed);
        let missed = match &pool {
            Some(pool) => {
                let mut missed = misses(pool.points(all.coils), &probes, form);
                for miss in &mut missed {
                    miss.point = pool.index[miss.point];
                }
                missed
            }
            None => misses(all, &probes, form),
        };
        let mut added = worst_of_each(&missed, probes.len());
        if let (true, Some(pool)) = (added.is_empty(), &mut pool) {
            let missed = misses(all, &probes, form);
            added = worst_of_each(&missed, probes.len());
            let fresh: BTreeSet<usize> = missed.iter().map(|miss| miss.point).collect();
            for point in fresh {
                pool.add(all, point);
            }
        }
        if added.is_empty() {
            return followed;
        }
        // Rows that no piece rests on decide nothing; the path cannot fall back without them.
        if working.len() > 8 * (scaled.live.len() + 8) {
            let used: BTreeSet<usize> = followed
                .pieces
                .iter()
                .flat_map(|piece| piece.active.iter().map(|&(row, _)| row))
                .collect();
            let mut at = 0;
            working.retain(|_| {
                at += 1;
                at <= fixed || used.contains(&(first_row + at - 1))
            });
        }
        let before = working.len();
        for row in added {
            if !working.contains(&row) {
                working.push(row);
            }
        }
        if working.len() == before {
            // What is missed is in the program: rounding that the tolerance does not cover.
            return followed;
        }
    }
    let (mut followed, _) = solve(scaled, form, &working);
    followed.end = End::Stalled;
    followed
}

fn solve(scaled: &Scaled, form: Form, working: &[(usize, bool)]) -> (Followed, usize) {
    let mut program: Program = scaled.bounds();
    let first_row = program.rows();
    let mut rows = vec![None; first_row];
    for &(j, up) in working {
        scaled.add_point(&mut program, form, j, up);
        rows.push(Some((j, up)));
    }
    let down = (form == Form::Worst).then_some(first_row + 1);
    let basis = scaled.first_basis(form, first_row, down);
    let (pieces, end) = program.follow(&basis);
    let followed = Followed {
        pieces,
        rows,
        end,
        doubt: 0.0,
    };
    (followed, first_row)
}

/// What the points are asked at every turn, and in the direction of the last piece.
fn probes(scaled: &Scaled, form: Form, followed: &mut Followed) -> Vec<Probe> {
    let (lambda_unit, force_unit) = (scaled.lambda_unit(), scaled.force_unit());
    let coils = scaled.problem.coils();
    let mut doubt = 0.0_f64;
    let mut probe = |lambda: f64, offset_share: f64, bound: f64, currents_a: Vec<f64>| {
        let lambda_n_per_m = times_power(lambda, lambda_unit);
        let wanted = lambda_n_per_m.abs() * scaled.height_m() + offset_share * scaled.offset_n();
        let pushed: f64 = (0..coils)
            .map(|i| scaled.largest[i] * currents_a[i].abs())
            .sum();
        let rounding = ROUNDINGS * f64::EPSILON * (wanted + pushed);
        if wanted > 0.0 {
            doubt = doubt.max(rounding / wanted);
        }
        Probe {
            lambda_n_per_m,
            offset_share,
            currents_a,
            limit_n: times_power(bound + NOTHING, force_unit) + rounding,
        }
    };
    let mut all: Vec<Probe> = Vec::new();
    for piece in &followed.pieces {
        let last = piece.z[piece.z.len() - 1].to_f64();
        let (lambda, bound) = match form {
            Form::Worst => (piece.start.to_f64(), last),
            Form::Least => (-last, 0.0),
        };
        all.push(probe(lambda, 1.0, bound, scaled.currents_a(&piece.z)));
    }
    if let (Form::Worst, Some(last)) = (form, followed.pieces.last()) {
        let bound = last.rate[last.rate.len() - 1].to_f64();
        all.push(probe(1.0, 0.0, bound, scaled.amperes(&last.rate)));
    }
    followed.doubt = doubt;
    all
}

/// For every probe its worst miss, as rows of the program.
fn worst_of_each(missed: &[Miss], probes: usize) -> BTreeSet<(usize, bool)> {
    let mut worst: Vec<Option<&Miss>> = vec![None; probes];
    for miss in missed {
        let best = &mut worst[miss.probe];
        if best.is_none_or(|other| miss.excess_n > other.excess_n) {
            *best = Some(miss);
        }
    }
    let found = worst.into_iter().flatten();
    found.map(|miss| (miss.point, miss.up)).collect()
}
