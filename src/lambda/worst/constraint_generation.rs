//! Few points decide: a program over them is followed, and a point joins it when the path is
//! about to miss it. Of many points a sample is looked at on the way and the others afterwards;
//! those that are missed at a turn join the sample, and the path is followed again.
//!
//! Along a piece the currents are linear in lambda and the largest error is convex, so a path
//! that is right at the turns, and in the direction of its last piece, is right everywhere.

use std::collections::BTreeSet;

use super::points::{Course, Held, Probe, bit, first_missed};
use super::pool::Pool;
use super::program::{End, Piece, Program, Stand, Work};
use super::scaled::{Form, Scaled};
use crate::qr_reduction::times_power;
use fluxform_numerics::double_double::DoubleDouble as Num;
use fluxform_numerics::real::Real;

/// Rounding of a force summed in doubles, in units of the terms' sizes.
const ROUNDINGS: f64 = 8.0;
/// A force that is none, in scaled units: what rounding leaves at lambda = 0.
const NOTHING: f64 = 1e-25;
/// Forces of points that are looked at in the time that one entry of an inverse takes.
const FORCES: usize = 40;
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

/// The points of one problem, and what has been learnt of them.
pub(super) struct Search<'a> {
    form: Form,
    pool: Pool<'a>,
    /// Rows to begin with.
    working: Vec<(usize, bool)>,
}

impl<'a> Search<'a> {
    /// Nothing is learnt yet of the points of `scaled`.
    pub fn new(scaled: &Scaled<'a>, form: Form) -> Self {
        let mut working = vec![(scaled.highest, true)];
        if form == Form::Worst {
            working.push((scaled.highest, false));
        }
        Self {
            form,
            pool: Pool::new(scaled),
            working,
        }
    }

    /// Follows the program of all points under the limits of `scaled`.
    pub fn follow(&mut self, scaled: &Scaled, work: &mut Work) -> Followed {
        let form = self.form;
        let mut working = self.working.clone();
        for _ in 0..ROUNDS {
            fluxform_base::progress::poll();
            let mut followed = solve(scaled, form, &working, &self.pool, work);
            if followed.end != End::Whole {
                return followed;
            }
            // Two tests: the direction of the last piece is no place on the path.
            let (path, beyond) = probes(scaled, form, &mut followed);
            let of_path = self.pool.take_missed(scaled, &path, form);
            if of_path + self.pool.take_missed(scaled, &beyond, form) == 0 {
                self.remember(&followed);
                return followed;
            }
            // The rows that the path rests on are those to begin with.
            for row in rows_of(&followed, &followed.pieces) {
                if !working.contains(&row) {
                    working.push(row);
                }
            }
        }
        Followed {
            pieces: Vec::new(),
            rows: Vec::new(),
            end: End::Stalled,
            doubt: 0.0,
        }
    }

    /// Another path over the same points begins with the rows at the start of this one.
    fn remember(&mut self, followed: &Followed) {
        for row in rows_of(followed, &followed.pieces[..followed.pieces.len().min(1)]) {
            if !self.working.contains(&row) {
                self.working.push(row);
            }
        }
    }
}

/// Points and signs of the rows that pieces rest on.
fn rows_of(followed: &Followed, pieces: &[Piece]) -> Vec<(usize, bool)> {
    let used: BTreeSet<usize> = pieces
        .iter()
        .flat_map(|piece| piece.active.iter().map(|&(row, _)| row))
        .collect();
    used.into_iter()
        .filter_map(|row| followed.rows[row])
        .collect()
}

/// Follows the program of the `working` rows, and of those of the pool's points that it meets.
fn solve(
    scaled: &Scaled,
    form: Form,
    working: &[(usize, bool)],
    pool: &Pool,
    work: &mut Work,
) -> Followed {
    let mut program: Program = scaled.bounds();
    let first_row = program.rows();
    let mut rows = vec![None; first_row];
    for &(j, up) in working {
        scaled.add_point(&mut program, form, j, up);
        rows.push(Some((j, up)));
    }
    let near = pool.points();
    let known: BTreeSet<(usize, bool)> = working.iter().copied().collect();
    let mut held: Vec<Held> = vec![0; pool.count()];
    for (place, held) in held.iter_mut().enumerate() {
        for up in [true, false] {
            if known.contains(&(pool.point(place), up)) {
                *held |= bit(up);
            }
        }
    }
    let down = (form == Form::Worst).then_some(first_row + 1);
    let basis = scaled.first_basis(form, first_row, down);
    let ask = |program: &mut Program, stand: &Stand| {
        let course = course(scaled, form, stand);
        let Some((place, up)) = first_missed(near, &held, &course, form) else {
            return false;
        };
        held[place] |= bit(up);
        let row = (pool.point(place), up);
        scaled.add_point(program, form, row.0, row.1);
        rows.push(Some(row));
        true
    };
    let ask_work = near.forces_n_per_a.len() / FORCES;
    let (pieces, end) = program.follow(&basis, work, ask_work, ask);
    Followed {
        pieces,
        rows,
        end,
        doubt: 0.0,
    }
}

/// The state of the program, in SI units.
fn course(scaled: &Scaled, form: Form, stand: &Stand) -> Course {
    let (lambda_unit, force_unit) = (scaled.lambda_unit(), scaled.force_unit());
    let last = |z: &[Num]| z[z.len() - 1].to_f64();
    let (lambda, bound) = match form {
        Form::Worst => (stand.lambda.to_f64(), last(stand.z)),
        Form::Least => (-last(stand.z), 0.0),
    };
    let currents_a = scaled.amperes(stand.z);
    let lambda_n_per_m = times_power(lambda, lambda_unit);
    let pushed = scaled.pushed_n(&currents_a);
    let requested = lambda_n_per_m.abs() * scaled.height_m() + scaled.offset_n();
    let moves = form == Form::Worst;
    let rates_a: Vec<f64> = scaled
        .amperes(stand.rate)
        .iter()
        .map(|&rate| times_power(rate, -lambda_unit))
        .collect();
    let rounding = ROUNDINGS * f64::EPSILON;
    Course {
        rounding_n: times_power(NOTHING, force_unit)
            + rounding * (requested + pushed)
            + scaled.leeway * requested,
        rounding_m: rounding * (scaled.height_m() + scaled.pushed_n(&rates_a)),
        limit_rate_m: if moves {
            times_power(last(stand.rate), force_unit - lambda_unit)
        } else {
            0.0
        },
        lambda_rate: if moves { 1.0 } else { 0.0 },
        step: match stand.step {
            Some(step) if moves => times_power(step.to_f64(), lambda_unit),
            _ => f64::INFINITY,
        },
        rates_a,
        at: Probe {
            lambda_n_per_m,
            offset_share: 1.0,
            currents_a,
            limit_n: times_power(bound, force_unit),
        },
    }
}

/// The conditions on the points at every turn, and in the direction of the last piece.
fn probes(scaled: &Scaled, form: Form, followed: &mut Followed) -> (Vec<Probe>, Vec<Probe>) {
    let (lambda_unit, force_unit) = (scaled.lambda_unit(), scaled.force_unit());
    let mut doubt = 0.0_f64;
    let mut probe = |lambda: f64, offset_share: f64, bound: f64, currents_a: Vec<f64>| {
        let lambda_n_per_m = times_power(lambda, lambda_unit);
        let requested = lambda_n_per_m.abs() * scaled.height_m() + offset_share * scaled.offset_n();
        let pushed = scaled.pushed_n(&currents_a);
        let rounding =
            2.0 * (ROUNDINGS * f64::EPSILON * (requested + pushed) + scaled.leeway * requested);
        if requested > 0.0 {
            doubt = doubt.max(rounding / requested);
        }
        Probe {
            lambda_n_per_m,
            offset_share,
            currents_a,
            limit_n: times_power(bound + NOTHING, force_unit) + rounding,
        }
    };
    let (mut all, mut beyond) = (Vec::new(), Vec::new());
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
        beyond.push(probe(1.0, 0.0, bound, scaled.amperes(&last.rate)));
    }
    followed.doubt = doubt;
    (all, beyond)
}

#[cfg(test)]
mod tests {
    use super::super::scaled::Limits;
    use super::*;
    use crate::problem::ForceProblem;
    use crate::qr_reduction::largest_entries;

    /// Of a followed path no point is missed at any turn, at rest least of all.
    #[test]
    fn a_paths_own_probes_miss_no_point() {
        for offset in [None, Some(&[0.01, -0.02, 0.03, 0.0][..])] {
            let problem = ForceProblem {
                forces_n_per_a: &[0.7, 0.2, 0.3, 1.1, 0.4, 0.5, 0.9, -0.1],
                height_m: &[0.05, 0.03, 0.04, 0.02],
                offset_n: offset,
                weights: None,
                lower_a: &[0.0; 2],
                upper_a: &[1.3, 0.9],
                total_max_a: Some(1.9),
                resistance_ohm: &[6.0, 5.0],
            };
            let largest = largest_entries(&problem);
            for form in [Form::Worst, Form::Least] {
                let scaled = Scaled::new(&problem, &largest, form, Limits::All);
                let mut followed =
                    Search::new(&scaled, form).follow(&scaled, &mut Work(usize::MAX));
                assert_eq!(followed.end, End::Whole);
                let (turns, beyond) = probes(&scaled, form, &mut followed);
                assert_eq!(turns.len(), followed.pieces.len());
                for probe in turns.iter().chain(&beyond) {
                    for (j, row) in problem.forces_n_per_a.chunks_exact(2).enumerate() {
                        let offset_n = probe.offset_share * offset.map_or(0.0, |o| o[j]);
                        let pushed = row[0] * probe.currents_a[0] + row[1] * probe.currents_a[1];
                        let error = probe.lambda_n_per_m * problem.height_m[j] - offset_n - pushed;
                        let error = if form == Form::Worst {
                            error.abs()
                        } else {
                            error
                        };
                        assert!(error <= probe.limit_n, "{form:?} {j}: {error} {probe:?}");
                    }
                }
            }
        }
    }
}
