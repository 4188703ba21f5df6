//! Which columns depend on others: a QR factorisation that takes the most independent one first.

use fluxform_numerics::double_double::DoubleDouble as Num;
use fluxform_numerics::real::Real;
use rayon::prelude::*;

use super::model::{Reflection, least_share};

/// Columns taken by the part that lies outside the span of those taken before, the largest share of a column
/// first.
pub(super) struct Pivoted {
    /// Those that were taken, in order.
    pub members: Vec<usize>,
    /// Every column times Q'; below its place one that was taken has nothing left.
    pub turned: Vec<Vec<Num>>,
}

impl Pivoted {
    /// Takes of the first `candidates` columns those whose share is above `share`; the others are turned alone.
    pub fn new(columns: Vec<Vec<Num>>, candidates: usize, share: f64) -> Self {
        let length = |v: &[Num]| Num::dot(v, v).sqrt();
        let norm: Vec<Num> = columns.iter().map(|column| length(column)).collect();
        let mut open: Vec<usize> = (0..candidates).filter(|&i| norm[i] > Num::ZERO).collect();
        let mut taken = Self {
            members: Vec::with_capacity(open.len()),
            turned: columns,
        };
        let mut independence = 1.0_f64;
        loop {
            fluxform_base::progress::poll();
            let rank = taken.members.len();
            let outside = |&i: &usize| (length(&taken.turned[i][rank..]) / norm[i]).to_f64();
            let shares: Vec<f64> = open.par_iter().map(outside).collect();
            let of = |place: &usize| shares[*place];
            let Some(best) = (0..open.len()).reduce(|a, b| if of(&b) > of(&a) { b } else { a })
            else {
                break;
            };
            if shares[best] <= share.max(least_share(independence)) {
                break;
            }
            independence = independence.min(shares[best]);
            taken.take(open.remove(best));
        }
        taken
    }

    fn take(&mut self, i: usize) {
        let rank = self.members.len();
        let rows = self.turned[i].len();
        let (reflection, diagonal) = Reflection::onto_first(self.turned[i].split_off(rank));
        self.members.push(i);
        let is_member: Vec<bool> = (0..self.turned.len()).map(|j| self.contains(j)).collect();
        (self.turned.par_iter_mut().zip(is_member))
            .filter(|(_, is_member)| !is_member)
            .for_each(|(column, _)| reflection.apply(&mut column[rank..]));
        self.turned[i].push(diagonal);
        self.turned[i].resize(rows, Num::ZERO);
    }

    pub fn contains(&self, column: usize) -> bool {
        self.members.contains(&column)
    }

    /// Shares of the members, in their order, in the part of a column that lies in their span.
    pub fn shares(&self, column: usize) -> Vec<Num> {
        let rank = self.members.len();
        let mut shares = self.turned[column][..rank].to_vec();
        for (k, &i) in self.members.iter().enumerate().rev() {
            let triangle = &self.turned[i];
            shares[k] = shares[k] / triangle[k];
            let share = shares[k];
            Num::add_scaled(&mut shares[..k], -share, &triangle[..k]);
        }
        shares
    }
}
