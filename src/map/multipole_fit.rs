//! A field as point multipoles: where the sources are, their coefficients by least squares, and
//! how far the model is off elsewhere.
//!
//! Sources lie on the coils' axes below the top face, at depths that are multiples of the
//! windings' outer radius. Alone, a coil is axisymmetric and needs upright sources on its own axis.
//! Among coupled cores the neighbours answer without that symmetry, so every axis carries upright
//! sources of high order and tilted ones, whose directions share a cone: harmonics about the axis
//! up to (directions - 1) / 2 are within their reach.

use rayon::prelude::*;

use super::multipole::{PARTS, Source, magnitudes};
use fluxform_numerics::qr::{Triangle, triangular_factor};

/// Sources of one kind on every axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Kind {
    /// One: upright. More: on a cone about the upright direction.
    pub directions: usize,
    /// Orders 1 to this one.
    pub orders: usize,
    /// Depths below the top face, in outer radii of the windings.
    pub depths: &'static [f64],
}

const fn upright(orders: usize, depths: &'static [f64]) -> Kind {
    Kind {
        directions: 1,
        orders,
        depths,
    }
}

const fn tilted(directions: usize, orders: usize) -> Kind {
    Kind {
        directions,
        orders,
        depths: &[0.7],
    }
}

/// Half the cone's opening, degrees: neither 0 nor 90, where half of the harmonics vanish.
const TILT_DEG: f64 = 60.0;
/// The first direction's angle from x, rad: off the array's own symmetries.
const FROM_X: f64 = 0.3;

/// Layouts for a coil that is axisymmetric, from few sources to many.
pub const ALONE: [&[Kind]; 4] = [
    &[upright(6, &[1.05])],
    &[upright(6, &[1.05, 3.15])],
    &[upright(10, &[1.05, 3.15])],
    &[upright(10, &[1.05, 1.5, 2.2, 3.15])],
];

/// Layouts for every axis of an array of coupled cores, from few sources to many.
pub const COUPLED: [&[Kind]; 4] = [
    &[upright(6, &[0.7]), tilted(3, 3)],
    &[upright(10, &[0.7]), tilted(3, 6)],
    &[upright(14, &[0.7]), tilted(5, 9)],
    &[upright(18, &[0.7]), tilted(7, 12)],
];

/// Columns are scaled to length 1; this much of every coefficient is weighed against the errors.
/// Terms of one order in several directions depend on each other, and this settles which is used.
const RIDGE: f64 = 1e-10;

/// The sources of `kinds` on the axes at `axes_m`, whose top face is at `top_m`.
#[must_use]
pub fn sources(kinds: &[Kind], axes_m: &[[f64; 2]], top_m: f64, radius_m: f64) -> Vec<Source> {
    let mut out = Vec::new();
    for [x, y] in axes_m {
        for kind in kinds {
            for depth in kind.depths {
                for k in 0..kind.directions {
                    let (sine, cosine) = TILT_DEG.to_radians().sin_cos();
                    let turn = std::f64::consts::TAU * k as f64 / kind.directions as f64 + FROM_X;
                    out.push(Source {
                        position_m: [*x, *y, top_m - depth * radius_m],
                        direction: if kind.directions == 1 {
                            [0.0, 0.0, 1.0]
                        } else {
                            [sine * turn.cos(), sine * turn.sin(), cosine]
                        },
                        orders: kind.orders,
                    });
                }
            }
        }
    }
    out
}

/// Number of terms of `sources`.
#[must_use]
pub fn terms(sources: &[Source]) -> usize {
    sources.iter().map(|source| source.orders).sum()
}

/// A field per ampere at points.
#[derive(Debug, Clone, Default)]
pub struct Samples {
    /// m.
    pub points_m: Vec<[f64; 3]>,
    /// Parts per coil, then per point.
    pub parts: Vec<Vec<[f64; PARTS]>>,
    /// Reference of the error of field and gradient at each point, T/A and T/m/A.
    pub sizes: Vec<[f64; 2]>,
}

/// Coefficients of a layout's sources for some coils.
#[derive(Debug, Clone)]
pub struct Model {
    /// The sources, common to the coils.
    pub sources: Vec<Source>,
    /// Terms per coil, source by source.
    pub coefficients: Vec<Vec<f64>>,
    /// Largest over least diagonal entry of the triangular factor that was solved with.
    pub condition: f64,
}

impl Model {
    /// Least squares over the samples, each error relative to its size.
    #[must_use]
    pub fn fit(sources: Vec<Source>, samples: &Samples, coils: &[usize]) -> Self {
        let count = terms(&sources);
        let (rows, width) = (PARTS * samples.points_m.len(), count + coils.len());
        let mut matrix = vec![0.0; rows * width];
        matrix
            .par_chunks_exact_mut(PARTS * width)
            .enumerate()
            .for_each(|(point, block)| {
                let weights = samples.sizes[point].map(|size| 1.0 / size);
                let mut column = 0;
                let mut put = |column: usize, parts: [f64; PARTS]| {
                    for (part, value) in parts.into_iter().enumerate() {
                        block[part * width + column] = value * weights[usize::from(part >= 3)];
                    }
                };
                for source in &sources {
                    source.terms(samples.points_m[point], |term, parts| {
                        put(column + term, parts);
                    });
                    column += source.orders;
                }
                for coil in coils {
                    put(column, samples.parts[*coil][point]);
                    column += 1;
                }
            });
        let mut norms = vec![0.0; width];
        for row in matrix.chunks_exact(width) {
            for (norm, value) in norms.iter_mut().zip(row) {
                *norm += value * value;
            }
        }
        let scale: Vec<f64> = norms
            .into_iter()
            .map(|square: f64| if square > 0.0 { square.sqrt() } else { 1.0 })
            .collect();
        let factor = triangular_factor::<f64>(rows, width, |range, block, stride| {
            let first = range.start;
            for row in range {
                let values = &matrix[row * width..(row + 1) * width];
                for (j, (value, scale)) in values.iter().zip(&scale).enumerate() {
                    block[j * stride + row - first] = value / scale;
                }
            }
        });
        let factor = triangular_factor::<f64>(2 * count, width, |range, block, stride| {
            let first = range.start;
            for row in range {
                for j in 0..width {
                    block[j * stride + row - first] = if row < count {
                        factor.column(j)[row]
                    } else if row - count == j {
                        RIDGE
                    } else {
                        0.0
                    };
                }
            }
        });
        let diagonal = (0..count).map(|j| factor.column(j)[j].abs());
        let (least, most) = diagonal.fold((f64::INFINITY, 0.0_f64), |(least, most), entry| {
            (least.min(entry), most.max(entry))
        });
        let coefficients = (0..coils.len())
            .map(|coil| {
                let column = count + coil;
                let mut x = back_substituted(&factor, count, factor.column(column));
                for (x, own) in x.iter_mut().zip(&scale) {
                    *x *= scale[column] / own;
                }
                x
            })
            .collect();
        Self {
            sources,
            coefficients,
            condition: most / least,
        }
    }

    /// Field and gradient of every coil at a point, per ampere.
    #[must_use]
    pub fn parts(&self, point_m: [f64; 3]) -> Vec<[f64; PARTS]> {
        let mut out = vec![[0.0; PARTS]; self.coefficients.len()];
        let mut first = 0;
        for source in &self.sources {
            source.terms(point_m, |term, parts| {
                for (sums, coefficients) in out.iter_mut().zip(&self.coefficients) {
                    let factor = coefficients[first + term];
                    for (sum, part) in sums.iter_mut().zip(parts) {
                        *sum += factor * part;
                    }
                }
            });
            first += source.orders;
        }
        out
    }

    /// Largest errors of field and gradient over the samples, each relative to its size.
    #[must_use]
    pub fn largest_errors(&self, samples: &Samples, coils: &[usize]) -> [f64; 2] {
        (samples.points_m.par_iter().enumerate())
            .map(|(point, at)| {
                let mut worst = [0.0_f64; 2];
                for (parts, coil) in self.parts(*at).iter().zip(coils) {
                    let direct = &samples.parts[*coil][point];
                    let off = std::array::from_fn(|part| parts[part] - direct[part]);
                    let errors = magnitudes(&off);
                    for k in 0..2 {
                        worst[k] = worst[k].max(errors[k] / samples.sizes[point][k]);
                    }
                }
                worst
            })
            .reduce(|| [0.0; 2], |a, b| std::array::from_fn(|k| a[k].max(b[k])))
    }
}

fn back_substituted(factor: &Triangle<f64>, count: usize, right: &[f64]) -> Vec<f64> {
    let mut x = right[..count].to_vec();
    for j in (0..count).rev() {
        let column = factor.column(j);
        x[j] /= column[j];
        let solved = x[j];
        for (value, entry) in x[..j].iter_mut().zip(column) {
            *value -= entry * solved;
        }
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The field of sources that the layout holds comes back, whatever the dependent columns.
    #[test]
    fn what_the_layout_holds_is_found() {
        let axes = [[0.0, 0.0], [0.05, 0.01]];
        let radius = 0.019;
        let placed = sources(COUPLED[0], &axes, 0.002, radius);
        let count = terms(&placed);
        let truth = Model {
            coefficients: vec![
                (0..count)
                    .scan(0, |order, k| {
                        let n = *order;
                        *order = (*order + 1) % 3;
                        Some((0.7 + (k as f64).sin()) * 0.02_f64.powi(n))
                    })
                    .collect(),
            ],
            sources: placed.clone(),
            condition: 1.0,
        };
        let points_m: Vec<[f64; 3]> = (0..600)
            .map(|k| {
                let part = |step: f64| (0.37 + step * k as f64).fract();
                [
                    0.1 * part(0.754_877) - 0.05,
                    0.1 * part(0.569_840) - 0.05,
                    0.012 + 0.05 * part(0.430_160),
                ]
            })
            .collect();
        let values: Vec<[f64; PARTS]> = points_m.iter().map(|p| truth.parts(*p)[0]).collect();
        let samples = Samples {
            sizes: values.iter().map(magnitudes).collect(),
            parts: vec![values],
            points_m,
        };
        let model = Model::fit(placed, &samples, &[0]);
        let errors = model.largest_errors(&samples, &[0]);
        assert!(errors[0] < 1e-7 && errors[1] < 1e-7, "{errors:?}");
        assert!(model.condition > 1e6, "dependent terms show");
    }
}
