//! Tensor-product cubic Lagrange interpolation on a rectilinear grid ("tricubic-lagrange").
//!
//! Along each axis the polynomial runs through the four nodes nearest to the position: two on
//! either side, moved inward at the borders so that it extrapolates by roundings alone. An axis of two or three
//! nodes uses them all (linear, quadratic); an axis of one node has a value on that node alone.
//! At a node the node's value comes back exactly. For a function with bounded fourth derivatives
//! the error is at most `(h^4 / 43) max|f''''|` an axis inside and `h^4 / 24` in the border cells
//! (equal steps h; the products of the distances to four nodes are at most 9/16 h^4 and h^4),
//! times the other axes' Lebesgue constants (1.25 inside, 1.63 at the borders).

use std::ops::Range;

/// The most nodes that take part along one axis.
pub const ORDER_NODES: usize = 4;

/// The nodes of one axis that take part at a position, and their weights.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stencil {
    /// Index of the first node.
    pub start: usize,
    /// How many nodes take part: 1 to 4.
    pub count: usize,
    /// Their weights; the rest is zero. They sum to 1 up to rounding.
    pub weights: [f64; ORDER_NODES],
}

/// Share of a cell's width from a node within which a position is at the node: computed otherwise the same
/// coordinate has other last bits.
pub const AT_NODE: f64 = 1e-9;

/// Whether a position is within the range of strictly increasing `nodes`, or beyond an end by its last bits.
#[must_use]
pub fn holds(nodes: &[f64], position: f64) -> bool {
    match nodes {
        [] => false,
        [only] => position == *only,
        [first, second, ..] => {
            let [before, last] = [nodes[nodes.len() - 2], nodes[nodes.len() - 1]];
            (first - AT_NODE * (second - first)..=last + AT_NODE * (last - before))
                .contains(&position)
        }
    }
}

/// The nodes next to `position` on increasing `nodes`, by index: the one at or below it and the next; beyond an end
/// that end's.
#[must_use]
pub fn around(nodes: &[f64], position: f64) -> Range<usize> {
    let above = nodes.partition_point(|&node| node <= position);
    above.saturating_sub(1)..(above + 1).min(nodes.len())
}

/// The stencil at `position` on strictly increasing `nodes`; `None` where they do not hold it ([`holds`]).
#[must_use]
pub fn stencil(nodes: &[f64], position: f64) -> Option<Stencil> {
    if !holds(nodes, position) {
        return None;
    }
    let count = nodes.len().min(ORDER_NODES);
    // The cell [above - 1, above] holds the position; the last node belongs to the last cell.
    let above = nodes.partition_point(|&node| node <= position);
    let start = above.saturating_sub(2).min(nodes.len() - count);
    Some(through(nodes, start..start + count, position))
}

/// Stencils through nodes beside those of [`stencil`]. Where the grid resolves a function their values differ from its by
/// two to four times its error. Of more than four nodes they are moved by one to either side as far as there are nodes;
/// of fewer they are short of one end, and differ by more. At a node, which is exact, and of one node there are none.
///
/// The products of the distances to two such sets of four differ by `4 / (1 + t)` or `4 / (2 - t)` times the central
/// one's, at the part `t` of a cell, and by `4 / t` or more in the border cells.
#[must_use]
pub fn beside(nodes: &[f64], position: f64) -> Vec<Stencil> {
    let Some(Stencil { start, count, .. }) = stencil(nodes, position) else {
        return Vec::new();
    };
    if nodes[around(nodes, position)].contains(&position) {
        return Vec::new();
    }
    let end = start + count;
    let ranges = match nodes.len() {
        0 | 1 => Vec::new(),
        2..=ORDER_NODES => vec![start..end - 1, start + 1..end],
        most => {
            let before = start.checked_sub(1).map(|start| start..end - 1);
            let after = (end < most).then(|| start + 1..end + 1);
            before.into_iter().chain(after).collect()
        }
    };
    let stencils = ranges.into_iter();
    stencils
        .map(|range| through(nodes, range, position))
        .collect()
}

/// The stencil of a position through a range of at most four nodes.
fn through(nodes: &[f64], range: Range<usize>, position: f64) -> Stencil {
    let (start, count) = (range.start, range.len());
    let near = &nodes[range];
    let mut weights = [0.0; ORDER_NODES];
    for (k, weight) in weights.iter_mut().take(count).enumerate() {
        let (mut above, mut below) = (1.0, 1.0);
        for (j, &node) in near.iter().enumerate() {
            if j != k {
                above *= position - node;
                below *= near[k] - node;
            }
        }
        *weight = above / below;
    }
    Stencil {
        start,
        count,
        weights,
    }
}

/// The nodes of a grid `[z, y, x]` that take part at a position: found once, applied to as many
/// arrays as there are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cell {
    x: Stencil,
    y: Stencil,
    z: Stencil,
    /// Nodes along x and y.
    row: usize,
    rows: usize,
}

/// The cell at `position` (x, y, z) on the axes; `None` outside the grid.
#[must_use]
#[inline]
pub fn locate(axes: [&[f64]; 3], position: [f64; 3]) -> Option<Cell> {
    Some(Cell {
        x: stencil(axes[0], position[0])?,
        y: stencil(axes[1], position[1])?,
        z: stencil(axes[2], position[2])?,
        row: axes[0].len(),
        rows: axes[1].len(),
    })
}

impl Cell {
    /// The interpolated value of an array `[z, y, x]`.
    ///
    /// # Panics
    /// When `values` is shorter than the grid.
    #[must_use]
    #[inline]
    pub fn value(&self, values: &[f64]) -> f64 {
        self.component(values, 1, 0)
    }

    /// The interpolated value of component `index` of an array `[z, y, x, components]`.
    ///
    /// # Panics
    /// When `values` is shorter than the grid times `components`.
    #[must_use]
    pub fn component(&self, values: &[f64], components: usize, index: usize) -> f64 {
        let mut sum = 0.0;
        for (k, wz) in self.z.weights.iter().enumerate().take(self.z.count) {
            let mut plane = 0.0;
            for (j, wy) in self.y.weights.iter().enumerate().take(self.y.count) {
                let node =
                    ((self.z.start + k) * self.rows + self.y.start + j) * self.row + self.x.start;
                let line = &values[node * components + index..];
                let mut row = 0.0;
                for (i, wx) in self.x.weights.iter().enumerate().take(self.x.count) {
                    row += wx * line[i * components];
                }
                plane += wy * row;
            }
            sum += wz * plane;
        }
        sum
    }
}
