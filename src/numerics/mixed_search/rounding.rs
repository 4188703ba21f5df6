//! Whole variables: branching below the relaxed optimum.

use super::descent::{Ended, Judged, climb};
use super::variable::{Region, Values, Variable, WHOLE};

/// Local searches that one climb may take.
const MOST: usize = 48;

/// The best place of a box, whole variables whole; `None` where the box holds no whole value.
///
/// The relaxed optimum is branched on its fractional variable with the longest step, the coarsest
/// decision first; a branch that promises less than a whole result is left.
pub fn climb_whole(
    variables: &[Variable],
    of: &dyn Fn(&[f64]) -> Judged,
    from: &[f64],
    region: &Region,
) -> Option<Ended> {
    let mut open = vec![(region.clone(), from.to_vec())];
    let mut best: Option<Ended> = None;
    for _ in 0..MOST {
        let Some((region, from)) = open.pop() else {
            break;
        };
        let ended = climb(of, &from, &region.0, &region.1);
        if best
            .as_ref()
            .is_some_and(|best| best.judged.merit() >= ended.judged.merit())
        {
            continue;
        }
        let Some((index, [below, above])) = fractional(variables, &ended.u) else {
            best = Some(ended);
            continue;
        };
        let nearer_last = ended.u[index] - below < above - ended.u[index];
        let mut branches = [
            (index, region.0[index], below),
            (index, above, region.1[index]),
        ];
        if nearer_last {
            branches.reverse();
        }
        for (index, low, high) in branches {
            if low <= high + 1e-12 {
                let mut part = region.clone();
                (part.0[index], part.1[index]) = (low.min(high), high);
                let mut from = ended.u.clone();
                from[index] = from[index].clamp(low.min(high), high);
                open.push((part, from));
            }
        }
    }
    best
}

/// The fractional variable whose allowed values lie farthest apart, and those about its value, in
/// units.
fn fractional(variables: &[Variable], u: &[f64]) -> Option<(usize, [f64; 2])> {
    let about = variables
        .iter()
        .zip(u)
        .enumerate()
        .filter_map(|(index, (variable, u))| {
            if variable.values == Values::Continuous {
                return None;
            }
            let [below, above] = variable
                .neighbours(variable.value(*u))
                .map(|x| variable.unit(x));
            (above - below > WHOLE).then_some((index, [below, above]))
        });
    about.reduce(|a, b| {
        let wide = |ends: [f64; 2]| ends[1] - ends[0];
        if wide(b.1) > wide(a.1) { b } else { a }
    })
}
