//! Smooth functions of three variables, expensive to know, tabulated where they are requested.
//!
//! Space is cut into equal cells; a cell's tensor of Gauss nodes is filled when the first point
//! falls into it. Values and slopes are those of the interpolating polynomial. Across a cell's
//! border the value jumps by the interpolation's error.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use rayon::prelude::*;

use fluxform_numerics::gauss;
use fluxform_numerics::lagrange_basis::Basis;

/// Functions tabulated together.
pub(crate) const COUNT: usize = 3;
/// Their values at one place.
pub type Values = [f64; COUNT];
/// Values along the third variable's nodes; `None` where they are not defined.
pub type Line = Option<Vec<Values>>;

/// The cells' shape.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lattice {
    /// A cell's lower corner.
    pub origin: [f64; 3],
    /// A cell's widths.
    pub width: [f64; 3],
    /// Nodes along each axis.
    pub order: [usize; 3],
}

/// A value with its slopes by the three variables.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Interpolated {
    /// Value.
    pub value: f64,
    /// Slopes.
    pub slope: [f64; 3],
}

/// A cell's values at its nodes, first axis slowest, and the errors met off them.
struct Filled {
    values: Vec<Values>,
    errors: OnceLock<Values>,
}

/// `None` where the cell cannot be filled.
type Cell = Option<Filled>;

/// Places off the nodes where a cell's polynomial is compared with the functions, on -1..1. Along the
/// first two axes next to the corners, where the polynomial of the nodes is largest.
const CORNER: f64 = 0.98;

/// The table.
pub struct Cells {
    lattice: Lattice,
    frame: OnceLock<Frame>,
    axes: [Axis; 3],
    cells: Mutex<BTreeMap<[i64; 3], Arc<OnceLock<Cell>>>>,
}

/// Where the cells lie.
#[derive(Clone, Copy)]
struct Frame {
    origin: [f64; 3],
    width: [f64; 3],
}

struct Axis {
    nodes: Vec<f64>,
    basis: Basis,
    /// Row i: derivatives of the basis at node i.
    derivative: Vec<Vec<f64>>,
}

impl Axis {
    fn new(order: usize) -> Self {
        let rule = gauss::rule(order);
        let basis = Basis::new(rule);
        Self {
            nodes: rule.nodes.clone(),
            derivative: basis.derivative(),
            basis,
        }
    }

    /// The polynomial that vanishes at the nodes, over its value at the edge, no less than its
    /// highest arch inside.
    fn height(&self, x: f64) -> f64 {
        let product = |x: f64| {
            self.nodes
                .iter()
                .map(|node| x - node)
                .product::<f64>()
                .abs()
        };
        let arches = self.nodes.windows(2).map(|pair| 0.5 * (pair[0] + pair[1]));
        arches.map(product).fold(product(x), f64::max) / product(CORNER)
    }

    /// Weights of value and derivative at `x` of -1..1.
    fn weights(&self, x: f64) -> [Vec<f64>; 2] {
        let mut value = vec![0.0; self.nodes.len()];
        self.basis.weights(x, &mut value);
        let mut slope = vec![0.0; self.nodes.len()];
        for (weight, row) in value.iter().zip(&self.derivative) {
            for (sum, entry) in slope.iter_mut().zip(row) {
                *sum += weight * entry;
            }
        }
        [value, slope]
    }
}

impl Cells {
    /// An empty table.
    #[must_use]
    pub fn new(lattice: Lattice) -> Self {
        Self {
            axes: lattice.order.map(Axis::new),
            lattice,
            frame: OnceLock::new(),
            cells: Mutex::new(BTreeMap::new()),
        }
    }

    /// Moves the cells so that no border is near `at`: along the first two axes to have it in the middle of one; along
    /// the third, whose origin is a border of the functions' domain, by narrower cells where it is not well within the
    /// first. Without effect once a point has been requested. Not for use within a parallel loop.
    pub(crate) fn focus(&self, at: [f64; 3]) {
        let Lattice {
            mut origin,
            mut width,
            ..
        } = self.lattice;
        for i in 0..2 {
            origin[i] = at[i] - 0.5 * width[i];
        }
        let along = at[2] - origin[2];
        if along > 0.75 * width[2] {
            let below = (along / width[2] - 0.5).ceil().max(1.0);
            width[2] = along / (below + 0.5);
        }
        // Later points find the cells where the first one did.
        let _ = self.frame.set(Frame { origin, width });
    }

    /// Whether no border of the cells, that of the domain apart, is near `at`.
    pub(crate) fn is_clear(&self, at: [f64; 3]) -> bool {
        const NEAR: f64 = 0.15;
        let Frame { origin, width } = self.frame();
        (0..3).all(|i| {
            let place = (at[i] - origin[i]) / width[i];
            let part = place - place.floor();
            part <= 1.0 - NEAR && (part >= NEAR || (i == 2 && place < NEAR))
        })
    }

    fn frame(&self) -> Frame {
        let Lattice { origin, width, .. } = self.lattice;
        *self.frame.get_or_init(|| Frame { origin, width })
    }

    /// How many cells have been requested.
    #[must_use]
    pub fn count(&self) -> usize {
        self.lock().len()
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, BTreeMap<[i64; 3], Arc<OnceLock<Cell>>>> {
        // A panic elsewhere leaves the map whole: entries are only added.
        self.cells.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn key(&self, at: [f64; 3]) -> [i64; 3] {
        let Frame { origin, width } = self.frame();
        std::array::from_fn(|i| ((at[i] - origin[i]) / width[i]).floor() as i64)
    }

    /// Fills the cell of `at` on all threads, `line` giving the values for two variables at
    /// given thirds. Not for use within a parallel loop.
    pub fn fill(&self, at: [f64; 3], line: impl Fn(f64, f64, &[f64]) -> Line + Sync) {
        let key = self.key(at);
        let slot = self.slot(key);
        if slot.get().is_none() {
            let thirds = self.nodes(2, key[2]);
            let lines: Vec<Line> = self
                .pairs(key)
                .into_par_iter()
                .map(|(x, y)| line(x, y, &thirds))
                .collect();
            // Another thread cannot have filled it with anything else.
            let _ = slot.set(joined(lines));
        }
    }

    fn slot(&self, key: [i64; 3]) -> Arc<OnceLock<Cell>> {
        Arc::clone(self.lock().entry(key).or_default())
    }

    fn nodes(&self, axis: usize, key: i64) -> Vec<f64> {
        let Frame { origin, width } = self.frame();
        let (origin, width) = (origin[axis], width[axis]);
        let place = |x: &f64| origin + width * (key as f64 + 0.5 * (1.0 + x));
        self.axes[axis].nodes.iter().map(place).collect()
    }

    fn pairs(&self, key: [i64; 3]) -> Vec<(f64, f64)> {
        let seconds = self.nodes(1, key[1]);
        let firsts = self.nodes(0, key[0]);
        let pair = |x: f64| seconds.iter().map(move |&y| (x, y)).collect::<Vec<_>>();
        firsts.into_iter().flat_map(pair).collect()
    }

    /// The functions at `at`; `None` where they are not defined throughout its cell.
    pub fn at(
        &self,
        at: [f64; 3],
        line: impl Fn(f64, f64, &[f64]) -> Line,
    ) -> Option<[Interpolated; COUNT]> {
        if at.iter().any(|x| !x.is_finite()) {
            return None;
        }
        let key = self.key(at);
        let slot = self.slot(key);
        // One thread fills, alone: `line` must not hand work to other threads, one of which may
        // come to wait for this very cell.
        let cell = slot.get_or_init(|| {
            let thirds = self.nodes(2, key[2]);
            let pairs = self.pairs(key).into_iter();
            joined(pairs.map(|(x, y)| line(x, y, &thirds)).collect())
        });
        Some(self.interpolate(&cell.as_ref()?.values, key, at))
    }

    /// Error of the functions at `at`: the largest errors met in its cell, in terms of
    /// `error` of a value and an exact one, next to the edges along the third axis and between the nodes
    /// there; less off the edges, as the polynomial of the nodes is. `None` where the cell is
    /// not filled, infinite where the functions are not defined beside its nodes.
    pub fn errors(
        &self,
        at: [f64; 3],
        line: impl Fn(f64, f64, &[f64]) -> Line,
        error: impl Fn(&Values, &Values) -> Values,
    ) -> Option<Values> {
        let key = self.key(at);
        let slot = self.slot(key);
        let filled = slot.get()?.as_ref()?;
        let Frame { origin, width } = self.frame();
        let errors = filled.errors.get_or_init(|| {
            let [first, second, third] = [0, 1, 2].map(|axis| {
                let low = origin[axis] + width[axis] * key[axis] as f64;
                move |x: f64| low + 0.5 * width[axis] * (1.0 + x)
            });
            let nodes = &self.axes[2].nodes;
            let between = nodes.windows(2).map(|pair| 0.5 * (pair[0] + pair[1]));
            let thirds: Vec<f64> = between.chain([-CORNER, CORNER]).map(third).collect();
            let mut errors = [0.0_f64; COUNT];
            for (x, y) in [(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)] {
                let (x, y) = (first(CORNER * x), second(CORNER * y));
                let Some(exact) = line(x, y, &thirds) else {
                    return [f64::INFINITY; COUNT];
                };
                for (z, exact) in thirds.iter().zip(exact) {
                    let values = self.interpolate(&filled.values, key, [x, y, *z]);
                    let met = error(&values.map(|value| value.value), &exact);
                    for (largest, met) in errors.iter_mut().zip(met) {
                        *largest = largest.max(met);
                    }
                }
            }
            errors
        });
        let share = (0..3).fold(0.0_f64, |share, i| {
            let place = (at[i] - origin[i]) / width[i] - key[i] as f64;
            share.max(self.axes[i].height(2.0 * place - 1.0))
        });
        Some(errors.map(|error| error * share))
    }

    fn interpolate(&self, values: &[Values], key: [i64; 3], at: [f64; 3]) -> [Interpolated; COUNT] {
        let Frame { origin, width } = self.frame();
        let [x, y, z]: [[Vec<f64>; 2]; 3] = std::array::from_fn(|i| {
            let low = origin[i] + width[i] * key[i] as f64;
            self.axes[i].weights(2.0 * (at[i] - low) / width[i] - 1.0)
        });
        let [nx, ny, nz] = self.lattice.order;
        // By axes in which the derivative is taken: none, first, second, third.
        let mut sums = [[0.0; COUNT]; 4];
        for i in 0..nx {
            let mut plane = [[0.0; COUNT]; 3];
            for j in 0..ny {
                let mut row = [[0.0; COUNT]; 2];
                for k in 0..nz {
                    let value = &values[(i * ny + j) * nz + k];
                    for f in 0..COUNT {
                        row[0][f] += z[0][k] * value[f];
                        row[1][f] += z[1][k] * value[f];
                    }
                }
                for f in 0..COUNT {
                    plane[0][f] += y[0][j] * row[0][f];
                    plane[1][f] += y[1][j] * row[0][f];
                    plane[2][f] += y[0][j] * row[1][f];
                }
            }
            for f in 0..COUNT {
                sums[0][f] += x[0][i] * plane[0][f];
                sums[1][f] += x[1][i] * plane[0][f];
                sums[2][f] += x[0][i] * plane[1][f];
                sums[3][f] += x[0][i] * plane[2][f];
            }
        }
        std::array::from_fn(|f| Interpolated {
            value: sums[0][f],
            slope: std::array::from_fn(|i| sums[i + 1][f] * 2.0 / width[i]),
        })
    }
}

fn joined(lines: Vec<Line>) -> Cell {
    let mut values = Vec::new();
    for line in lines {
        values.extend(line?);
    }
    Some(Filled {
        values,
        errors: OnceLock::new(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(x: f64, y: f64, thirds: &[f64]) -> Line {
        let value = |&z: &f64| {
            [
                (0.7 * x - y).sin() * (1.3 * z).exp(),
                1.0 / (3.0 + x + y * z),
                0.7 * x,
            ]
        };
        (x < 2.0).then(|| thirds.iter().map(value).collect())
    }

    fn cells() -> Cells {
        Cells::new(Lattice {
            origin: [0.1, -0.3, 0.2],
            width: [0.7, 0.8, 0.6],
            order: [9, 9, 9],
        })
    }

    #[test]
    fn values_and_slopes_are_the_functions() {
        let cells = cells();
        for [x, y, z] in [[0.3, 0.7, 0.25], [1.1, -0.9, 0.81], [-0.5, 0.2, -0.1]] {
            let [f, g, h] = cells.at([x, y, z], line).expect("defined");
            let (s, c) = (0.7 * x - y).sin_cos();
            let e = (1.3 * z).exp();
            let requested = [s * e, 0.7 * c * e, -c * e, 1.3 * s * e];
            let got = [f.value, f.slope[0], f.slope[1], f.slope[2]];
            for (a, b) in got.iter().zip(requested) {
                assert!((a - b).abs() < 2e-9, "{got:?} {requested:?}");
            }
            assert!((g.value - 1.0 / (3.0 + x + y * z)).abs() < 1e-9);
            assert!((h.value - 0.7 * x).abs() < 1e-12 && (h.slope[0] - 0.7).abs() < 1e-11);
        }
        assert_eq!(cells.count(), 3);
    }

    #[test]
    fn a_focus_is_in_the_middle_of_its_cell_and_stays() {
        let cells = cells();
        let at = [0.45, -0.29, 0.5];
        cells.focus(at);
        // Along the third axis the cells are where they were: 0.2 to 0.8.
        let half = [0.35, 0.4, 0.3];
        for side in [-0.99, 0.99] {
            let beside = std::array::from_fn(|i| at[i] + side * half[i]);
            assert!(cells.at(beside, line).is_some());
        }
        assert_eq!(cells.count(), 1);
        cells.focus([7.0, -1.3, 0.1]);
        assert!(cells.at(at, line).is_some());
        assert_eq!(cells.count(), 1);
    }

    /// With fewer nodes, so that there are errors: those stated cover what is met elsewhere.
    #[test]
    fn errors_met_beside_the_nodes_cover_those_throughout_the_cell() {
        let cells = Cells::new(Lattice {
            order: [4, 4, 4],
            ..cells().lattice
        });
        let error = |value: &Values, exact: &Values| -> Values {
            std::array::from_fn(|f| (value[f] - exact[f]).abs())
        };
        let mut stated = [0.0; COUNT];
        for step in 0..343 {
            let place = |i: i32, axis: usize| {
                let width = cells.lattice.width[axis];
                cells.lattice.origin[axis] + width * (0.02 + 0.16 * f64::from(i))
            };
            let at = [
                place(step % 7, 0),
                place(step / 7 % 7, 1),
                place(step / 49, 2),
            ];
            let values = cells.at(at, line).expect("defined");
            let exact = line(at[0], at[1], &at[2..]).expect("defined")[0];
            stated = cells.errors(at, line, error).expect("filled");
            let met = error(&values.map(|value| value.value), &exact);
            for (met, stated) in met.into_iter().zip(stated) {
                assert!(met <= 1.3 * stated + 1e-14, "{at:?}: {met:e} {stated:e}");
            }
        }
        assert!(stated[0] > 1e-6 && stated[0] < 0.1, "{stated:?}");
    }

    #[test]
    fn a_filled_cell_is_the_one_made_on_demand() {
        let (early, late) = (cells(), cells());
        let at = [0.5, 0.1, 0.4];
        early.fill(at, line);
        assert_eq!(early.at(at, line), late.at(at, line));
        assert_eq!(late.at([2.5, 0.1, 0.4], line), None);
        assert_eq!(late.at([f64::NAN, 0.1, 0.4], line), None);
    }
}
