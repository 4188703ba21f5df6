//! Polynomials in a mapped coordinate: nodal bases on one axis of a box.
//!
//! The nodes are Gauss-Lobatto-Legendre points in t from -1 to 1. Where the singularities of a
//! function lie at a distance beside the interval, t = sin(b x) / sin b spreads the nodes evenly
//! (Kosloff and Tal-Ezer, J. Comput. Phys. 104, 457, 1993); where they lie beyond its lower end,
//! a Moebius map places the interval in the middle of the disc of analyticity.

use std::f64::consts::FRAC_PI_2;

/// Interpolation by n nodes is taken to leave c n^p rho^(-n) of the function's size: this c,
/// and these p across the strip and along the rise, are what gradients above small sources need.
const CONSTANT: f64 = 4.0;
const GROWTH: [f64; 2] = [1.0, 3.5];
/// Two ends and a node between them.
const LEAST: f64 = 3.0;
/// Power of the distance by which functions fall along [`Spectral::rising`]: gradients above
/// small sources fall so.
const FALL: i32 = 4;

/// A nodal basis on an interval: phi_j(x) = s(x) / s(x_j) l_j(t(x)) with the Lagrange
/// polynomials l_j.
#[derive(Debug, Clone)]
pub struct Spectral {
    /// Nodes, ascending; both ends included. One node for an interval without length.
    pub nodes: Vec<f64>,
    map: Map,
    /// Nodes in t, their weights, and P_(n-1) there.
    t: Vec<f64>,
    weights: Vec<f64>,
    last: Vec<f64>,
}

#[derive(Debug, Clone, Copy)]
enum Map {
    Point,
    /// t = sin(angle u) / sin(angle), u = (x - middle) / half.
    Strip {
        middle: f64,
        half: f64,
        angle: f64,
    },
    /// w = (d - mean) / (d + mean), d = x - origin, t = w / reach.
    Rising {
        origin: f64,
        mean: f64,
        reach: f64,
    },
}

/// Number of nodes for `tolerance` where the Bernstein ellipse has ln rho = `rate`.
fn count(rate: f64, growth: f64, tolerance: f64) -> usize {
    const STEPS: usize = 8;
    let nodes = (0..STEPS).fold(LEAST, |n, _| {
        ((growth * n.ln() + (CONSTANT / tolerance).ln()) / rate).max(LEAST)
    });
    // Beyond any use.
    nodes.ceil().min(1e6) as usize
}

impl Spectral {
    /// Angle and number of nodes over `from..to` for a function with singularities no closer than
    /// `distance` beside the interval, to about `tolerance` of its size.
    #[must_use]
    pub fn strip_nodes(from: f64, to: f64, distance: f64, tolerance: f64) -> (f64, usize) {
        const STEPS: i32 = 200;
        if to <= from {
            return (0.0, 1);
        }
        let ratio = 2.0 * distance / (to - from);
        // The nearer of the function's singularities and the map's own decides.
        let rate = |angle: f64| {
            let own = (1.0 / (0.5 * angle).tan()).ln();
            own.min(((angle * ratio).sinh() / angle.sin()).asinh())
        };
        let (best, angle) = (1..STEPS)
            .map(|k| FRAC_PI_2 * f64::from(k) / f64::from(STEPS))
            .map(|angle| (rate(angle), angle))
            .fold((0.0, 0.0), |a, b| if b.0 > a.0 { b } else { a });
        (angle, count(best, GROWTH[0], tolerance))
    }

    /// A basis with the result of [`Spectral::strip_nodes`].
    #[must_use]
    pub fn strip(from: f64, to: f64, (angle, nodes): (f64, usize)) -> Self {
        if nodes == 1 {
            return Self::point(from);
        }
        let map = Map::Strip {
            middle: 0.5 * (from + to),
            half: 0.5 * (to - from),
            angle,
        };
        Self::new(from, to, map, nodes)
    }

    /// Number of nodes over `from..to` for a function that is singular at and below `origin`
    /// only, to about `tolerance` of its size at each place.
    #[must_use]
    pub fn rising_nodes(from: f64, to: f64, origin: f64, tolerance: f64) -> usize {
        if to <= from {
            return 1;
        }
        let (near, far) = (from - origin, to - origin);
        let mean = (near * far).sqrt();
        let size = (far + mean) / (far - mean);
        let rate = (size + (size * size - 1.0).sqrt()).ln();
        count(rate, GROWTH[1], tolerance)
    }

    /// A basis with the result of [`Spectral::rising_nodes`].
    #[must_use]
    pub fn rising(from: f64, to: f64, origin: f64, nodes: usize) -> Self {
        if nodes == 1 {
            return Self::point(from);
        }
        let (near, far) = (from - origin, to - origin);
        let mean = (near * far).sqrt();
        let map = Map::Rising {
            origin,
            mean,
            reach: (far - mean) / (far + mean),
        };
        Self::new(from, to, map, nodes)
    }

    fn point(at: f64) -> Self {
        Self {
            nodes: vec![at],
            map: Map::Point,
            t: vec![0.0],
            weights: vec![1.0],
            last: vec![1.0],
        }
    }

    fn new(from: f64, to: f64, map: Map, count: usize) -> Self {
        let (t, weights, last) = lobatto(count);
        let mut nodes: Vec<f64> = t.iter().map(|t| map.place(*t)).collect();
        (nodes[0], nodes[count - 1]) = (from, to);
        Self {
            nodes,
            map,
            t,
            weights,
            last,
        }
    }

    /// Number of nodes.
    #[must_use]
    pub fn len(&self) -> usize {
        self.nodes.len()
    }

    /// Never: an interval has at least one node.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.nodes.is_empty()
    }

    /// The diagonal of the mass matrix, int phi_i phi_i dx by the nodes' own quadrature.
    #[must_use]
    pub fn mass(&self) -> Vec<f64> {
        let stretch = self.t.iter().map(|t| self.map.stretch(*t));
        self.weights
            .iter()
            .zip(stretch)
            .map(|(w, s)| w * s)
            .collect()
    }

    /// The stiffness matrix int phi_i' phi_j' dx, row-major, by the nodes' own quadrature.
    #[must_use]
    pub fn stiffness(&self) -> Vec<f64> {
        let n = self.len();
        let order = (n - 1) as f64;
        let scales: Vec<f64> = self.t.iter().map(|t| self.map.scale(*t)).collect();
        // [node][basis function], d/dt.
        let slopes: Vec<f64> = (0..n * n)
            .map(|place| {
                let (q, j) = (place / n, place % n);
                if q != j {
                    let along = self.last[q] / (self.last[j] * (self.t[q] - self.t[j]));
                    return along * scales[q] / scales[j];
                }
                let end = 0.25 * order * (order + 1.0);
                let own = match q {
                    0 => -end,
                    q if q + 1 == n => end,
                    _ => 0.0,
                };
                own + self.map.scale_slope(self.t[q])
            })
            .collect();
        let mut out = vec![0.0; n * n];
        for (q, slope) in slopes.chunks_exact(n).enumerate() {
            let weight = self.weights[q] / self.map.stretch(self.t[q]);
            for (row, left) in out.chunks_exact_mut(n).zip(slope) {
                for (value, right) in row.iter_mut().zip(slope) {
                    *value += weight * left * right;
                }
            }
        }
        out
    }

    /// Values of the basis functions at `x`: what a function's values at the nodes weigh there.
    #[must_use]
    pub fn cardinal(&self, x: f64) -> Vec<f64> {
        if let Some(hit) = self.nodes.iter().position(|node| *node == x) {
            return (0..self.len())
                .map(|j| f64::from(u8::from(j == hit)))
                .collect();
        }
        let t = self.map.coordinate(x);
        if let Some(hit) = self.t.iter().position(|node| *node == t) {
            return (0..self.len())
                .map(|j| f64::from(u8::from(j == hit)))
                .collect();
        }
        let n = self.len();
        // Barycentric weights of these nodes: alternating, sqrt(w_j); the ends as any other.
        let terms: Vec<f64> = (0..n)
            .map(|j| {
                let sign = if j % 2 == 0 { 1.0 } else { -1.0 };
                sign * self.weights[j].sqrt() / (t - self.t[j])
            })
            .collect();
        let total: f64 = terms.iter().sum();
        let scale = self.map.scale(t);
        terms
            .iter()
            .zip(&self.t)
            .map(|(term, node)| term / total * scale / self.map.scale(*node))
            .collect()
    }
}

impl Map {
    fn place(self, t: f64) -> f64 {
        match self {
            Self::Point => 0.0,
            Self::Strip {
                middle,
                half,
                angle,
            } => middle + half * (t * angle.sin()).asin() / angle,
            Self::Rising {
                origin,
                mean,
                reach,
            } => origin + mean * (1.0 + reach * t) / (1.0 - reach * t),
        }
    }

    fn coordinate(self, x: f64) -> f64 {
        match self {
            Self::Point => 0.0,
            Self::Strip {
                middle,
                half,
                angle,
            } => (angle * (x - middle) / half).sin() / angle.sin(),
            Self::Rising {
                origin,
                mean,
                reach,
            } => {
                let d = x - origin;
                (d - mean) / (d + mean) / reach
            }
        }
    }

    /// dx / dt.
    fn stretch(self, t: f64) -> f64 {
        match self {
            Self::Point => 1.0,
            Self::Strip { half, angle, .. } => {
                let sine = angle.sin();
                half * sine / (angle * (1.0 - (sine * t).powi(2)).sqrt())
            }
            Self::Rising { mean, reach, .. } => 2.0 * mean * reach / (1.0 - reach * t).powi(2),
        }
    }

    /// s, up to a factor.
    fn scale(self, t: f64) -> f64 {
        match self {
            Self::Point | Self::Strip { .. } => 1.0,
            Self::Rising { reach, .. } => (1.0 - reach * t).powi(FALL),
        }
    }

    /// (ds / dt) / s.
    fn scale_slope(self, t: f64) -> f64 {
        match self {
            Self::Point | Self::Strip { .. } => 0.0,
            Self::Rising { reach, .. } => -f64::from(FALL) * reach / (1.0 - reach * t),
        }
    }
}

/// P_0(t), P_1(t), ...
fn legendre(t: f64, out: &mut [f64]) {
    let (mut older, mut newer) = (0.0, 1.0);
    for (k, value) in out.iter_mut().enumerate() {
        *value = newer;
        let k = k as f64;
        (older, newer) = (newer, ((2.0 * k + 1.0) * t * newer - k * older) / (k + 1.0));
    }
}

/// Gauss-Lobatto-Legendre points, weights and P_(n-1) there, n >= 2: the zeros of
/// (1 - t^2) P_(n-1)'(t) by Newton's method, weights 2 / (n (n - 1) P_(n-1)^2).
fn lobatto(n: usize) -> (Vec<f64>, Vec<f64>, Vec<f64>) {
    const NEWTON_STEPS: usize = 50;
    let order = (n - 1) as f64;
    let mut p = vec![0.0; n];
    let (mut t, mut weights, mut last) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
    for k in 0..n.div_ceil(2) {
        let mut x = -(std::f64::consts::PI * k as f64 / order).cos();
        if 2 * k + 1 == n {
            x = 0.0;
        } else if k > 0 {
            for _ in 0..NEWTON_STEPS {
                legendre(x, &mut p);
                let step = (x * p[n - 1] - p[n - 2]) / (order * p[n - 1] + p[n - 1]);
                x -= step;
                if step.abs() <= f64::EPSILON {
                    break;
                }
            }
        }
        legendre(x, &mut p);
        let mirror = n - 1 - k;
        let sign = if n % 2 == 1 { 1.0 } else { -1.0 };
        // Mirrored exactly, so that a symmetric box has symmetric nodes.
        (t[mirror], last[mirror]) = (-x, sign * p[n - 1]);
        (t[k], last[k]) = (x, p[n - 1]);
        let weight = 2.0 / (order * (order + 1.0) * p[n - 1] * p[n - 1]);
        (weights[k], weights[mirror]) = (weight, weight);
    }
    (t, weights, last)
}
