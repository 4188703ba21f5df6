//! Equally spaced grid axes whose two ends are exact.

/// An axis from `from` to `to` with `samples` equally spaced nodes, both ends included exactly.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Axis {
    /// First node.
    pub from: f64,
    /// Last node.
    pub to: f64,
    /// Number of nodes, at least 1; with 1 the node is `from`.
    pub samples: usize,
}

impl Axis {
    /// The node `index`. Mirrored axes (`from == -to`) have exactly mirrored nodes.
    #[must_use]
    pub fn node(&self, index: usize) -> f64 {
        let last = self.samples.saturating_sub(1);
        // The ends are given back as they are: even (last * from) / last rounds.
        if index == 0 {
            return self.from;
        }
        if index == last {
            return self.to;
        }
        // Weights from the two ends: symmetric under reversal.
        let (a, b) = ((last - index) as f64, index as f64);
        (a * self.from + b * self.to) / last as f64
    }

    /// All nodes in order.
    #[must_use]
    #[inline]
    pub fn nodes(&self) -> Vec<f64> {
        (0..self.samples).map(|i| self.node(i)).collect()
    }

    /// Distance between neighbouring nodes; 0 for a single node.
    #[must_use]
    #[inline]
    pub fn step(&self) -> f64 {
        if self.samples < 2 {
            0.0
        } else {
            (self.to - self.from) / (self.samples - 1) as f64
        }
    }
}
