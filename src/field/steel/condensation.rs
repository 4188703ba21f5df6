//! Elimination of a mesh's inner unknowns, front by front, onto its boundary.
//!
//! Elements are merged in a given tree. Each merge adds the matrices of its parts and eliminates
//! by Cholesky's method the unknowns that no part outside it shares and that are not to be kept:
//! with A = [A11 A12; A21 A22], A11 = L L', X = L^-1 A12, what is passed on is A22 - X'X. The last
//! front holds the kept unknowns alone: the Schur complement. Flops and storage are those of a
//! nested elimination; nothing sparse is stored but the fronts' index lists.

use nalgebra::{DMatrix, DVector};

/// A front's matrix that is not positive definite: the coefficient was not positive or not finite.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("the core's stiffness is not positive definite")]
pub struct NotPositive;

/// Which unknowns meet in which front.
#[derive(Debug, Default)]
pub struct Plan {
    fronts: Vec<FrontPlan>,
    unknowns: usize,
    leaves: usize,
}

#[derive(Debug)]
struct FrontPlan {
    /// Fronts merged here; none for an element.
    parts: Vec<usize>,
    /// Unknowns: first those eliminated here, then those passed on.
    unknowns: Vec<usize>,
    eliminated: usize,
    /// For an element: place in `unknowns` of each of its own unknowns, in its own order.
    /// Otherwise, for each part: place of the unknowns that the part passes on.
    places: Vec<Vec<usize>>,
}

/// An element's matrix and right-hand side, in the order of its own unknowns.
#[derive(Debug)]
pub struct Element {
    /// Symmetric matrix.
    pub matrix: DMatrix<f64>,
    /// Right-hand side.
    pub load: DVector<f64>,
}

/// The system on the kept unknowns, and what is needed to come back to all of them.
#[derive(Debug, Default)]
pub struct Condensed {
    /// Schur complement, in the order in which the kept unknowns were given.
    pub matrix: DMatrix<f64>,
    /// Right-hand side that belongs to it.
    pub load: DVector<f64>,
    factors: Vec<Factor>,
}

/// L, X and L^-1 b1 of one front.
#[derive(Debug)]
struct Factor {
    lower: DMatrix<f64>,
    across: DMatrix<f64>,
    load: DVector<f64>,
}

/// How many elements share each unknown; more than there are where it is kept.
fn sharers(elements: &[Vec<usize>], kept: &[usize], unknowns: usize) -> Vec<usize> {
    let mut sharers = vec![0_usize; unknowns];
    for &unknown in elements.iter().flatten() {
        sharers[unknown] += 1;
    }
    for &unknown in kept {
        sharers[unknown] = usize::MAX;
    }
    sharers
}

impl Plan {
    /// A plan for elements with the given unknowns, each `0..unknowns`. `merges` lists the fronts
    /// that each merge joins: elements by their index, then merges in the order of this list.
    /// The last merge must join all; `kept` are the unknowns that remain, in the order wanted.
    #[must_use]
    pub fn new(
        elements: &[Vec<usize>],
        merges: &[Vec<usize>],
        kept: &[usize],
        unknowns: usize,
    ) -> Self {
        let sharers = sharers(elements, kept, unknowns);
        // Sharers met so far in the subtree of a front; a front's unknowns are in no other
        // pending front's subtree unless shared, so counts travel with the unknowns.
        let mut pending: Vec<Vec<(usize, usize)>> = Vec::new();
        let mut fronts: Vec<FrontPlan> = Vec::new();
        let mut place = vec![0_usize; unknowns];
        let mut met = vec![0_usize; unknowns];
        let last = elements.len() + merges.len() - 1;
        for front in 0..=last {
            let parts: &[usize] = match front.checked_sub(elements.len()) {
                Some(merge) => &merges[merge],
                None => &[],
            };
            let own: Vec<(usize, usize)> = match elements.get(front) {
                Some(element) => element.iter().map(|&unknown| (unknown, 1)).collect(),
                None => parts
                    .iter()
                    .flat_map(|&part| pending[part].clone())
                    .collect(),
            };
            let mut present = Vec::new();
            for &(unknown, count) in &own {
                if met[unknown] == 0 {
                    present.push(unknown);
                }
                met[unknown] += count;
            }
            let (done, mut open): (Vec<usize>, Vec<usize>) = present
                .iter()
                .partition(|&&unknown| met[unknown] == sharers[unknown]);
            if front == last {
                open = kept.to_vec();
            }
            let eliminated = done.len();
            let all: Vec<usize> = done.into_iter().chain(open.iter().copied()).collect();
            for (k, &unknown) in all.iter().enumerate() {
                place[unknown] = k;
            }
            let places_of = |unknowns: &mut dyn Iterator<Item = usize>| -> Vec<usize> {
                unknowns.map(|unknown| place[unknown]).collect()
            };
            let places = match elements.get(front) {
                Some(element) => vec![places_of(&mut element.iter().copied())],
                None => (parts.iter())
                    .map(|&part| places_of(&mut pending[part].iter().map(|&(unknown, _)| unknown)))
                    .collect(),
            };
            pending.push(
                open.iter()
                    .map(|&unknown| (unknown, met[unknown]))
                    .collect(),
            );
            for unknown in present {
                met[unknown] = 0;
            }
            fronts.push(FrontPlan {
                parts: parts.to_vec(),
                unknowns: all,
                eliminated,
                places,
            });
        }
        Self {
            fronts,
            unknowns,
            leaves: elements.len(),
        }
    }

    /// Eliminates the inner unknowns of the sum of the elements that `element` makes, asked for
    /// once each in ascending order.
    ///
    /// # Errors
    /// [`NotPositive`] when a pivot is not positive.
    pub fn condense(
        &self,
        mut element: impl FnMut(usize) -> Element,
    ) -> Result<Condensed, NotPositive> {
        let mut factors = Vec::with_capacity(self.fronts.len());
        let mut pending: Vec<Option<Element>> = Vec::with_capacity(self.fronts.len());
        for (index, front) in self.fronts.iter().enumerate() {
            fluxform_base::progress::poll();
            let size = front.unknowns.len();
            let mut sum = Element {
                matrix: DMatrix::zeros(size, size),
                load: DVector::zeros(size),
            };
            if index < self.leaves {
                add(&mut sum, &element(index), &front.places[0]);
            }
            for (&part, places) in front.parts.iter().zip(&front.places) {
                if let Some(part) = pending[part].take() {
                    add(&mut sum, &part, places);
                }
            }
            let (factor, rest) = eliminate(&sum, front.eliminated)?;
            factors.push(factor);
            pending.push(Some(rest));
        }
        let rest = pending.pop().flatten().ok_or(NotPositive)?;
        Ok(Condensed {
            matrix: rest.matrix,
            load: rest.load,
            factors,
        })
    }

    /// All unknowns from the kept ones: the inner equations are satisfied.
    #[must_use]
    pub fn expand(&self, condensed: &Condensed, kept: &DVector<f64>) -> DVector<f64> {
        let mut all = DVector::zeros(self.unknowns);
        for (index, front) in self.fronts.iter().enumerate().rev() {
            let factor = &condensed.factors[index];
            let (inner, outer) = front.unknowns.split_at(front.eliminated);
            if index + 1 == self.fronts.len() {
                for (&unknown, &value) in outer.iter().zip(kept) {
                    all[unknown] = value;
                }
            }
            let values = DVector::from_iterator(outer.len(), outer.iter().map(|&k| all[k]));
            let mut right = factor.load.clone();
            right.gemv(-1.0, &factor.across, &values, 1.0);
            factor
                .lower
                .tr_solve_lower_triangular_unchecked_mut(&mut right);
            for (&unknown, &value) in inner.iter().zip(&right) {
                all[unknown] = value;
            }
        }
        all
    }
}

fn add(sum: &mut Element, part: &Element, places: &[usize]) {
    for (column, &to) in places.iter().enumerate() {
        for (row, &at) in places.iter().enumerate() {
            sum.matrix[(at, to)] += part.matrix[(row, column)];
        }
        sum.load[to] += part.load[column];
    }
}

/// Eliminates the first `count` unknowns.
fn eliminate(sum: &Element, count: usize) -> Result<(Factor, Element), NotPositive> {
    let rest = sum.load.len() - count;
    let lower = sum.matrix.view((0, 0), (count, count)).into_owned();
    let lower = lower.cholesky().ok_or(NotPositive)?.unpack();
    let mut across = sum.matrix.view((0, count), (count, rest)).into_owned();
    lower.solve_lower_triangular_unchecked_mut(&mut across);
    let mut inner = sum.load.rows(0, count).into_owned();
    lower.solve_lower_triangular_unchecked_mut(&mut inner);
    let mut matrix = sum.matrix.view((count, count), (rest, rest)).into_owned();
    let mut load = sum.load.rows(count, rest).into_owned();
    if count > 0 {
        matrix.gemm_tr(-1.0, &across, &across, 1.0);
        load.gemv_tr(-1.0, &across, &inner, 1.0);
    }
    Ok((
        Factor {
            lower,
            across,
            load: inner,
        },
        Element { matrix, load },
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Springs in a ring of squares with a diagonal each: a small mesh with shared unknowns.
    fn mesh() -> (Vec<Vec<usize>>, usize) {
        // 3 x 4 nodes, six elements of four nodes.
        let elements = (0..3)
            .flat_map(|j| (0..2).map(move |i| [0, 1, 3, 4].map(|k| k + i + 3 * j).to_vec()))
            .collect();
        (elements, 12)
    }

    fn element(index: usize) -> Element {
        let entry = |k: usize| 0.3 + 0.7 * ((index * 7 + k * 3) % 5) as f64;
        let half = DMatrix::from_fn(4, 4, |i, j| {
            entry(i + 2 * j) - if i == j { 4.0 } else { 0.0 }
        });
        Element {
            matrix: &half * half.transpose(),
            load: DVector::from_fn(4, |i, _| entry(i)),
        }
    }

    #[test]
    fn agrees_with_the_whole_matrix() {
        let (elements, size) = mesh();
        let kept = [11, 0, 2, 5];
        let merges = [vec![0, 1], vec![2, 3], vec![4, 5], vec![6, 7], vec![9, 8]];
        let plan = Plan::new(&elements, &merges, &kept, size);
        let mut whole = DMatrix::zeros(size, size);
        let mut load = DVector::zeros(size);
        for (index, own) in elements.iter().enumerate() {
            let part = element(index);
            for (i, &row) in own.iter().enumerate() {
                load[row] += part.load[i];
                for (j, &column) in own.iter().enumerate() {
                    whole[(row, column)] += part.matrix[(i, j)];
                }
            }
        }
        let condensed = plan.condense(element).expect("sums of squares");
        let rest = condensed.matrix.clone().cholesky().expect("positive");
        let all = plan.expand(&condensed, &rest.solve(&condensed.load));
        assert!((&whole * &all - load).amax() < 1e-12);
        // Schur complement: the inverse's block, inverted.
        let inverse = whole.try_inverse().expect("positive");
        let block = DMatrix::from_fn(4, 4, |i, j| inverse[(kept[i], kept[j])]);
        let schur = block.try_inverse().expect("positive");
        assert!((schur - &condensed.matrix).amax() < 1e-11);
        assert!(
            plan.condense(|k| Element {
                matrix: -element(k).matrix,
                ..element(k)
            })
            .is_err()
        );
    }
}
