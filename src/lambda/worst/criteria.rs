//! The worst-point force constants on two followed paths, in scaled units.

use super::program::Piece;
use crate::criteria::{Overlap, overlaps};
use fluxform_numerics::double_double::DoubleDouble as Num;
use fluxform_numerics::real::Real;

/// Above this share of lambda max h and of the error without currents (or above what rounding may hide) t* has left t_0.
const VISIBLE: f64 = 1e-12;

/// t* and the error t_0 without upper limits, both as functions of lambda.
pub(super) struct Comparison<'a> {
    pub limited: &'a [Piece],
    pub unlimited: &'a [Piece],
    /// Scaled max h.
    pub top: Num,
    /// Share of lambda max h that rounding may hide.
    pub doubt: f64,
}

/// `t* - t_0` on one stretch between turns of either path.
struct Stretch {
    start: Num,
    end: Option<Num>,
    excess: Num,
    rate: Num,
}

fn last(z: &[Num]) -> Num {
    z[z.len() - 1]
}

/// Error of a path's piece at `lambda`.
fn error_at(piece: &Piece, lambda: Num) -> Num {
    last(&piece.z) + (lambda - piece.start) * last(&piece.rate)
}

impl Comparison<'_> {
    fn stretches(&self) -> Vec<Stretch> {
        let (a, b) = (self.limited, self.unlimited);
        let stretch = |overlap: Overlap| {
            let ([i, k], start) = (overlap.pieces, overlap.start);
            Stretch {
                start,
                end: overlap.end,
                excess: error_at(&a[i], start) - error_at(&b[k], start),
                rate: last(&a[i].rate) - last(&b[k].rate),
            }
        };
        let all = overlaps(a, b, |piece: &Piece| piece.start);
        all.into_iter().map(stretch).collect()
    }

    /// Where t* leaves t_0.
    pub fn linear(&self) -> Option<Num> {
        let share = Num::of(VISIBLE.max(4.0 * self.doubt));
        // Where a force without currents is there, errors are small against that too.
        let without = error_at(&self.limited[0], Num::ZERO);
        let visible = |lambda: Num| share * (self.top * lambda + without);
        self.stretches().iter().find_map(|stretch| {
            let leaves = match stretch.end {
                Some(end) => stretch.excess + (end - stretch.start) * stretch.rate > visible(end),
                None => stretch.rate > share * self.top || stretch.excess > visible(stretch.start),
            };
            leaves.then_some(stretch.start)
        })
    }

    /// The largest lambda with `t* - t_0 <= weight lambda max h`; `None`: all of them.
    pub fn jnd(&self, weight: f64) -> Option<Num> {
        let share = Num::of(weight) * self.top;
        for stretch in self.stretches().iter().rev() {
            let rate = stretch.rate - share;
            let above = stretch.excess - share * stretch.start;
            if stretch.end.is_none() && rate <= Num::ZERO {
                return None;
            }
            if above <= Num::ZERO {
                let crossing = stretch.start - above / rate;
                // The signs at both ends decide; the root may miss an end by rounding.
                return Some(match stretch.end {
                    Some(end) if rate <= Num::ZERO => end,
                    Some(end) => crossing.smaller(end),
                    None => crossing,
                });
            }
            if let Some(end) = stretch.end
                && rate < Num::ZERO
                && above + (end - stretch.start) * rate <= Num::ZERO
            {
                return Some(end);
            }
        }
        Some(Num::ZERO)
    }
}
