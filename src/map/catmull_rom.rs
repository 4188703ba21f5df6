//! Catmull-Rom interpolation on equally spaced nodes, as runtimes other than ours do it: cubic
//! Hermite pieces whose slopes at the nodes are central differences, one-sided at the two ends.

/// A place on an axis: a cell and how far into it, 0 to 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AxisPosition {
    /// The node before it.
    pub cell: usize,
    /// Part of the step beyond that node.
    pub part: f64,
}

/// Weights of the nodes about a place, for the value and for its derivative in steps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stencil {
    /// First node that counts.
    pub start: usize,
    /// Weights of the value.
    pub values: [f64; 4],
    /// Weights of the derivative, one per step.
    pub slopes: [f64; 4],
}

/// The stencil of a place on an axis of at least four nodes.
#[must_use]
pub fn stencil(nodes: usize, place: AxisPosition) -> Stencil {
    let start = place.cell.saturating_sub(1).min(nodes.saturating_sub(4));
    let t = place.part;
    // Hermite: value at either node, slope at either node; then their derivatives.
    let values = [
        (1.0 + 2.0 * t) * (1.0 - t) * (1.0 - t),
        t * t * (3.0 - 2.0 * t),
        t * (1.0 - t) * (1.0 - t),
        t * t * (t - 1.0),
    ];
    let slopes = [
        6.0 * t * (t - 1.0),
        6.0 * t * (1.0 - t),
        (1.0 - t) * (1.0 - 3.0 * t),
        t * (3.0 * t - 2.0),
    ];
    let weights = |[before, after, slope_before, slope_after]: [f64; 4]| {
        let mut out = [0.0; 4];
        let mut add = |node: usize, weight: f64| out[node - start] += weight;
        add(place.cell, before);
        add(place.cell + 1, after);
        for (node, weight) in [(place.cell, slope_before), (place.cell + 1, slope_after)] {
            let (below, above) = (node.saturating_sub(1), (node + 1).min(nodes - 1));
            let weight = weight / (above - below) as f64;
            add(above, weight);
            add(below, -weight);
        }
        out
    };
    Stencil {
        start,
        values: weights(values),
        slopes: weights(slopes),
    }
}

/// A vector field on equally spaced nodes: values [z, y, x, 3], as many nodes along each axis.
#[derive(Debug, Clone, Copy)]
pub struct Nodes<'a> {
    /// Nodes along each axis, at least four.
    pub count: usize,
    /// Steps along x, y and z, m.
    pub steps_m: [f64; 3],
    /// The values.
    pub values: &'a [f64],
}

impl Nodes<'_> {
    /// The vector and its derivatives along x, y and z (per metre) at a place, given by its
    /// stencils along x, y and z.
    #[must_use]
    pub fn at(&self, stencils: [&Stencil; 3]) -> [[f64; 3]; 4] {
        let [sx, sy, sz] = stencils;
        let mut out = [[0.0; 3]; 4];
        for k in 0..4 {
            for j in 0..4 {
                let row = ((sz.start + k) * self.count + sy.start + j) * self.count + sx.start;
                for i in 0..4 {
                    let weights = [
                        sx.values[i] * sy.values[j] * sz.values[k],
                        sx.slopes[i] * sy.values[j] * sz.values[k] / self.steps_m[0],
                        sx.values[i] * sy.slopes[j] * sz.values[k] / self.steps_m[1],
                        sx.values[i] * sy.values[j] * sz.slopes[k] / self.steps_m[2],
                    ];
                    let vector = &self.values[3 * (row + i)..3 * (row + i) + 3];
                    for (sums, weight) in out.iter_mut().zip(weights) {
                        for (sum, value) in sums.iter_mut().zip(vector) {
                            *sum += weight * value;
                        }
                    }
                }
            }
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn along(nodes: usize, place: AxisPosition, f: impl Fn(f64) -> f64) -> [f64; 2] {
        let stencil = stencil(nodes, place);
        let sum = |weights: [f64; 4]| -> f64 {
            (0..4)
                .map(|k| weights[k] * f((stencil.start + k) as f64))
                .sum()
        };
        [sum(stencil.values), sum(stencil.slopes)]
    }

    #[test]
    fn parabolas_are_exact_inside_and_lines_at_the_ends() {
        let parabola = |x: f64| 0.7 * x * x - 1.3 * x + 0.4;
        let line = |x: f64| 0.7 - 1.3 * x;
        for part in [0.0, 0.3, 0.5, 0.8] {
            let [value, slope] = along(7, AxisPosition { cell: 3, part }, parabola);
            let x = 3.0 + part;
            assert!((value - parabola(x)).abs() < 1e-13);
            assert!((slope - (1.4 * x - 1.3)).abs() < 1e-13);
            for cell in [0, 5] {
                let [value, slope] = along(7, AxisPosition { cell, part }, line);
                assert!((value - line(cell as f64 + part)).abs() < 1e-13);
                assert!((slope + 1.3).abs() < 1e-13);
            }
        }
    }

    /// Values that mag_manip 3.0.0 gives for x^2 and x^3 on the nodes 0 to 6.
    #[test]
    fn as_mag_manip_does_it() {
        for (x, square, cube) in [
            (0.25, 0.20312, 0.10938),
            (2.75, 7.5625, 20.70312),
            (5.75, 33.20312, 192.54688),
        ] {
            let place = AxisPosition {
                cell: x as usize,
                part: f64::fract(x),
            };
            assert!((along(7, place, |x| x * x)[0] - square).abs() < 1e-5);
            assert!((along(7, place, |x| x * x * x)[0] - cube).abs() < 1e-5);
        }
    }
}
