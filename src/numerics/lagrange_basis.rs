//! Lagrange polynomials on Gauss nodes: values anywhere, derivatives and integrals at the nodes.

use serde::{Deserialize, Serialize};

use super::gauss::Rule;

/// The Lagrange basis on the nodes of a rule over [-1, 1].
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Basis {
    nodes: Vec<f64>,
    /// Barycentric weights.
    barycentric: Vec<f64>,
}

impl Basis {
    /// Number of nodes.
    #[must_use]
    pub fn size(&self) -> usize {
        self.nodes.len()
    }

    /// The basis on the nodes of `rule`.
    #[must_use]
    pub fn new(rule: &Rule) -> Self {
        let nodes = rule.nodes.clone();
        // Twice the capacity of [-1, 1] keeps the products near one.
        let barycentric = (0..nodes.len())
            .map(|i| {
                let product: f64 = (0..nodes.len())
                    .filter(|j| *j != i)
                    .map(|j| 2.0 * (nodes[i] - nodes[j]))
                    .product();
                1.0 / product
            })
            .collect();
        Self { nodes, barycentric }
    }

    /// Values of all basis polynomials at `x`.
    pub fn weights(&self, x: f64, out: &mut [f64]) {
        let mut sum = 0.0;
        for (place, (node, b)) in self.nodes.iter().zip(&self.barycentric).enumerate() {
            let difference = x - node;
            if difference == 0.0 {
                out.fill(0.0);
                out[place] = 1.0;
                return;
            }
            out[place] = b / difference;
            sum += out[place];
        }
        for value in out {
            *value /= sum;
        }
    }

    /// Row i: derivatives of the basis polynomials at node i.
    #[must_use]
    pub fn derivative(&self) -> Vec<Vec<f64>> {
        let n = self.nodes.len();
        (0..n)
            .map(|i| {
                let mut row: Vec<f64> = (0..n)
                    .map(|j| {
                        if i == j {
                            0.0
                        } else {
                            self.barycentric[j]
                                / self.barycentric[i]
                                / (self.nodes[i] - self.nodes[j])
                        }
                    })
                    .collect();
                row[i] = -row.iter().sum::<f64>();
                row
            })
            .collect()
    }

    /// Row i: integrals of the basis polynomials from -1 to node i; the last row, from -1 to 1.
    #[must_use]
    pub fn integral(&self) -> Vec<Vec<f64>> {
        let n = self.nodes.len();
        let rule = super::gauss::rule(n.div_ceil(2).max(1));
        let mut values = vec![0.0; n];
        self.nodes
            .iter()
            .copied()
            .chain([1.0])
            .map(|end| {
                let half = 0.5 * (end + 1.0);
                let mut row = vec![0.0; n];
                for (x, weight) in rule.nodes.iter().zip(&rule.weights) {
                    self.weights(half * (x + 1.0) - 1.0, &mut values);
                    for (sum, value) in row.iter_mut().zip(&values) {
                        *sum += half * weight * value;
                    }
                }
                row
            })
            .collect()
    }
}
