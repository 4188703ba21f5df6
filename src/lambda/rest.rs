//! Where a path comes to rest: the breakpoint beyond which no change of the currents is worth anything.
//!
//! As lambda grows the minimiser goes to the face of `C = {lower <= I <= upper, sum I <= I_t}` on
//! which `(G'h)'I` is largest, and to the point of that face where `|G I|` is least. Without a limit
//! on the sum the face is almost always a vertex, with one it is a vertex of a knapsack; where coils
//! tie (a symmetric array under a symmetric object, the sum shared among them) it is larger, and
//! currents do not move in its interior. Forces are known to their rounding: what it leaves of a tie
//! would move currents at a lambda of one over that rounding. So the path ends at the first
//! breakpoint whose currents `I_k` are as good as the minimiser from there on,
//!
//! ```text
//! e(lambda, I_k) - e*(lambda) <= COST (lambda^2 mean(h^2) + mean(offset^2))   for all lambda >= lambda_k,
//! ```
//!
//! a comparison of quadratics on every piece, exact up to double-double rounding. Currents that a
//! relative change `d` of the forces would move beyond `lambda_k` cost about `d^2`: ties are those to
//! about 3e-8.

use fluxform_numerics::double_double::DoubleDouble as Num;
use fluxform_numerics::real::Real;

use super::homotopy::{Piece, Trace};

/// Errors up to this share of `lambda^2 mean(h^2)` are rounding: a few roundings of e* in doubles.
pub(super) const COST: f64 = 1e-15;

/// Ends the path where it comes to rest; whether that left out any piece.
pub(super) fn bring_to_rest(trace: &mut Trace, offset: Option<&[Num]>, slope: &[Num]) -> bool {
    let square = |v: &[Num]| Num::dot(v, v);
    let requested = [offset.map_or(Num::ZERO, square), square(slope)];
    let pieces = &mut trace.pieces;
    // From the end back, as far as rest costs nothing: at most as many turns as pieces.
    let mut rest = None;
    for k in (0..pieces.len()).rev() {
        if !(k..pieces.len()).all(|later| is_free(pieces, k, later, slope, &requested)) {
            break;
        }
        rest = Some(k);
    }
    // Without an offset nothing flows at zero: a path that rests there is one that never moves.
    let Some(k) = rest.filter(|&k| k > 0 || offset.is_some()) else {
        return false;
    };
    let left_out = k + 1 < pieces.len();
    pieces.truncate(k + 1);
    let last = &mut pieces[k];
    last.x_rate.fill(Num::ZERO);
    last.residual_rate = slope.to_vec();
    left_out
}

/// Whether the currents at the start of piece `k` cost nothing on all of piece `later`.
fn is_free(pieces: &[Piece], k: usize, later: usize, slope: &[Num], requested: &[Num; 2]) -> bool {
    fluxform_base::progress::poll();
    let (here, there) = (&pieces[k], &pieces[later]);
    let start = there.start;
    let mut still = here.residual.clone();
    Num::add_scaled(&mut still, start - here.start, slope);
    let (best, rate) = (&there.residual, &there.residual_rate);
    let allowed = Num::of(COST);
    // The cost less what is allowed, at `start + step`: c + b step + a step^2.
    let c = Num::dot(&still, &still)
        - Num::dot(best, best)
        - allowed * (requested[0] + start * start * requested[1]);
    let b = Num::of(2.0)
        * (Num::dot(&still, slope) - Num::dot(best, rate) - allowed * start * requested[1]);
    let a = Num::dot(slope, slope) - Num::dot(rate, rate) - allowed * requested[1];
    let length = pieces.get(later + 1).map(|next| next.start - start);
    never_positive(a, b, c, length)
}

/// Whether `c + b step + a step^2 <= 0` from 0 to `length`, or for ever.
fn never_positive(a: Num, b: Num, c: Num, length: Option<Num>) -> bool {
    if c > Num::ZERO {
        return false;
    }
    match length {
        Some(length) if c + length * (b + length * a) > Num::ZERO => return false,
        None if a > Num::ZERO || (a == Num::ZERO && b > Num::ZERO) => return false,
        _ => {}
    }
    // A summit between the ends.
    if a >= Num::ZERO || b <= Num::ZERO {
        return true;
    }
    let summit = -b / (Num::of(2.0) * a);
    length.is_some_and(|length| summit >= length) || c + Num::of(0.5) * b * summit <= Num::ZERO
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_parabola_is_judged_at_its_ends_and_at_its_summit() {
        let never = |a: f64, b: f64, c: f64, length: Option<f64>| {
            never_positive(Num::of(a), Num::of(b), Num::of(c), length.map(Num::of))
        };
        // -(s - 0.7)^2 + 0.01 is above zero from 0.6 to 0.8.
        for (length, requested) in [
            (Some(0.5), true),
            (Some(0.65), false),
            (Some(1.3), false),
            (None, false),
        ] {
            assert_eq!(never(-1.0, 1.4, -0.48, length), requested, "{length:?}");
        }
        assert!(never(-1.0, 1.4, -0.5, None) && never(0.0, -0.3, 0.0, None));
        assert!(!never(0.0, 0.3, -7.0, None) && !never(1e-9, -0.3, -7.0, None));
        assert!(!never(-1.0, -0.3, 0.1, Some(0.7)));
        // (s - 0.3)(s - 1.3) turns positive at either end.
        assert!(never(1.0, -1.6, -0.01, Some(1.3)) && !never(1.0, -1.6, -0.01, Some(1.7)));
    }
}
