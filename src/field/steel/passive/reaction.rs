//! One core's answer to point sources close by: its layer, its field back at them, their energy.
//!
//! The sources' potential and its normal derivative are sampled on the outline's nodes at regular
//! angles; mode by mode the layer follows. With the sources' potential phi and the layer v it
//! causes, the energy of the pair is
//!
//! ```text
//! W = -(mu_0/2) int v d(phi)/dn dS,   of dipoles  -(1/2) sum m_k . B_induced(p_k).
//! ```

use nalgebra::{DMatrix, DVector};
use std::f64::consts::{PI, TAU};

use crate::steel::CoreShape;
use crate::steel::double_layer::{MAX_MODES, operators};
use crate::steel::generatrix::{Generatrix, Resolution};
use crate::steel::response::{mean, system};
use fluxform_base::units::MU_0_T_M_PER_A;
use fluxform_numerics::dispatch::{self, Kernel, LANES, Lanes};
use fluxform_numerics::vec3::{dot, minus};

/// A point dipole in the frame of a core, whose axis is z.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Dipole {
    /// Position, m.
    pub at_m: [f64; 3],
    /// Moment, A m^2.
    pub moment_a_m2: [f64; 3],
}

/// A dipole and a charge at one place in the frame of a core, whose axis is z.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct PointSource {
    /// Position, m.
    pub at_m: [f64; 3],
    /// Moment, A m^2.
    pub moment_a_m2: [f64; 3],
    /// Charge, A m.
    pub charge_a_m: f64,
}

impl PointSource {
    /// The potential at `place_m`, times 4 pi, A.
    #[must_use]
    pub fn potential(&self, place_m: [f64; 3]) -> f64 {
        let d = minus(place_m, self.at_m);
        let square = dot(d, d);
        (self.charge_a_m + dot(self.moment_a_m2, d) / square) / square.sqrt()
    }

    /// The force of a field on it, N: (m . grad) B + q B.
    #[must_use]
    pub fn force_n(&self, field: &Induced) -> [f64; 3] {
        std::array::from_fn(|i| {
            // The gradient is symmetric.
            dot(field.gradient_t_per_m[i], self.moment_a_m2) + self.charge_a_m * field.field_t[i]
        })
    }
}

/// The steel's reaction at a point.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Induced {
    /// B, T.
    pub field_t: [f64; 3],
    /// `[i][j]` = dB_i/dx_j, T/m.
    pub gradient_t_per_m: [[f64; 3]; 3],
}

impl Induced {
    /// Adds `strength` (n / d^3 - 3 (n.d) d / d^5) and its gradient, `away_m` being the vector d from an element of
    /// a layer to the point, n along its normal.
    pub(crate) fn add_element(&mut self, away_m: [f64; 3], normal: [f64; 3], strength: f64) {
        let (d, n) = (away_m, normal);
        let inverse_square = 1.0 / dot(d, d);
        let strength = strength * inverse_square * inverse_square.sqrt();
        let along = dot(n, d);
        for i in 0..3 {
            self.field_t[i] += strength * (n[i] - 3.0 * along * d[i] * inverse_square);
            for j in 0..3 {
                let diagonal = if i == j { along } else { 0.0 };
                let pair = n[i] * d[j] + n[j] * d[i] + diagonal
                    - 5.0 * along * d[i] * d[j] * inverse_square;
                self.gradient_t_per_m[i][j] -= 3.0 * strength * inverse_square * pair;
            }
        }
    }
}

/// How finely one core is solved.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReactionResolution {
    /// The outline.
    pub outline: Resolution,
    /// Azimuthal modes.
    pub modes: usize,
}

impl ReactionResolution {
    /// The resolution for a relative error of about `tolerance` in energies, the closest dipole
    /// being `gap_m` above the core.
    ///
    /// Mode m of a dipole at a height d over a ring of radius R decays like exp(-m eta),
    /// cosh(eta) = 1 + d^2/(2 R^2), its energy twice as fast.
    #[must_use]
    pub fn for_tolerance(tolerance: f64, shape: CoreShape, gap_m: f64) -> Self {
        let tolerance = tolerance.clamp(1e-9, 0.1);
        let near = gap_m / shape.radius_m;
        let eta = (1.0 + 0.5 * near * near).acosh();
        let modes = 3.0 + (-tolerance.ln() / (2.0 * eta)).ceil();
        let mut outline = Resolution::for_tolerance(tolerance);
        // The longest panel of the top face, 0.8 R, seen from the dipole.
        let reach = 2.5 * near;
        let radius = reach + (1.0 + reach * reach).sqrt();
        let order = (-0.5 * tolerance.ln() / radius.ln()).ceil() + 2.0;
        outline.order = outline.order.max(order.min(MOST_ORDER) as usize);
        Self {
            outline,
            modes: modes.min(MAX_MODES as f64) as usize,
        }
    }

    /// The next finer resolution.
    #[must_use]
    pub fn finer(&self) -> Self {
        Self {
            outline: Resolution {
                order: self.outline.order + 2,
                tip: self.outline.tip * self.outline.ratio,
                quadrature: 0.1 * self.outline.quadrature,
                ..self.outline
            },
            modes: (self.modes + self.modes / 4 + 1).min(MAX_MODES),
        }
    }
}

/// Most nodes a panel.
const MOST_ORDER: f64 = 24.0;

/// One core, ready to answer.
#[derive(Debug, Clone)]
pub struct Reaction {
    /// Points and outer normals, index = angle * nodes + node.
    points: Vec<([f64; 3], [f64; 3])>,
    /// Area of a point's share of the surface, m^2, one per node.
    areas_m2: Vec<f64>,
    /// Layer for a potential, one matrix a mode.
    inverses: Vec<DMatrix<f64>>,
    /// [angle, column]: column 0 for mode 0, then cosine and sine of every mode.
    to_modes: DMatrix<f64>,
    /// [column, angle].
    from_modes: DMatrix<f64>,
}

impl Reaction {
    /// Prepares a core of permeability `relative_permeability` > 0.
    #[must_use]
    pub fn new(
        shape: CoreShape,
        relative_permeability: f64,
        resolution: &ReactionResolution,
    ) -> Self {
        let outline = Generatrix::new(shape, &[], &resolution.outline);
        let modes = resolution.modes;
        let share = (relative_permeability - 1.0) / relative_permeability;
        let count = outline.nodes.len();
        let inverses = operators(&outline, modes, resolution.outline.quadrature)
            .into_iter()
            .enumerate()
            .map(|(mode, w)| {
                let mut rhs = DMatrix::identity(count, count) * share;
                if mode == 0 {
                    // A constant in the potential is no field.
                    let total: f64 = outline.areas_m2().sum();
                    for (mut column, area) in rhs.column_iter_mut().zip(outline.areas_m2()) {
                        column.add_scalar_mut(-share * area / total);
                    }
                }
                let mut inverse = system(&outline, w, relative_permeability, mode)
                    .lu()
                    .solve(&rhs)
                    .expect("eigenvalues of W lie in [0, 1], so those of the matrix are positive");
                if mode == 0 {
                    for mut column in inverse.column_iter_mut() {
                        let shift = mean(&outline, column.iter());
                        column.add_scalar_mut(-shift);
                    }
                }
                inverse
            })
            .collect();
        let angles = 2 * modes + 2;
        let turn = TAU / angles as f64;
        let columns = 2 * modes - 1;
        let phase = |k: usize, column: usize| {
            let mode = column.div_ceil(2);
            let (s, c) = (turn * ((mode * k) % angles) as f64).sin_cos();
            if column > 0 && column.is_multiple_of(2) {
                s
            } else {
                c
            }
        };
        let to_modes = DMatrix::from_fn(angles, columns, |k, column| {
            let factor = if column == 0 { 1.0 } else { 2.0 };
            factor / angles as f64 * phase(k, column)
        });
        let from_modes = DMatrix::from_fn(columns, angles, |column, k| phase(k, column));
        let points = (0..angles)
            .flat_map(|k| {
                let (s, c) = (turn * k as f64).sin_cos();
                outline.nodes.iter().map(move |node| {
                    let [n_r, n_z] = node.normal;
                    (
                        [node.r_m * c, node.r_m * s, node.z_m],
                        [n_r * c, n_r * s, n_z],
                    )
                })
            })
            .collect();
        let areas_m2 = outline.areas_m2().map(|a| a / angles as f64).collect();
        Self {
            points,
            areas_m2,
            inverses,
            to_modes,
            from_modes,
        }
    }

    /// Unknowns on the outline.
    #[must_use]
    pub fn nodes(&self) -> usize {
        self.areas_m2.len()
    }

    /// The energy of `sources` and the layer they cause, J.
    #[must_use]
    pub(crate) fn energy_j(&self, sources: &[PointSource]) -> f64 {
        fluxform_base::progress::poll();
        let (mut potential, mut normal) = (self.zeros(), self.zeros());
        dispatch::run(Potentials {
            points: &self.points,
            sources: &sources.chunks(LANES).map(abreast).collect::<Vec<_>>(),
            potential: potential.as_mut_slice(),
            normal: normal.as_mut_slice(),
        });
        let layer = self.layer_of(&potential);
        let sum: f64 = layer
            .column_iter()
            .zip(normal.column_iter())
            .map(|(v, g)| {
                v.iter()
                    .zip(g.iter())
                    .zip(&self.areas_m2)
                    .map(|((v, g), area)| area * v * g)
                    .sum::<f64>()
            })
            .sum();
        -0.5 * MU_0_T_M_PER_A * sum / (16.0 * PI * PI)
    }

    /// The field that the steel sends back to each of `sources`, all of them acting together.
    #[must_use]
    pub fn induced(&self, sources: &[PointSource]) -> Vec<Induced> {
        fluxform_base::progress::poll();
        let mut potential = self.zeros();
        for ((x, _), phi) in self.points.iter().zip(potential.as_mut_slice()) {
            *phi = sources.iter().map(|source| source.potential(*x)).sum();
        }
        let layer = self.layer_of(&potential);
        let scale = MU_0_T_M_PER_A / (16.0 * PI * PI);
        sources
            .iter()
            .map(|source| {
                let mut sum = Induced::default();
                let areas = self.areas_m2.iter().cycle();
                for (((x, n), v), area) in self.points.iter().zip(layer.as_slice()).zip(areas) {
                    sum.add_element(minus(source.at_m, *x), *n, scale * v * area);
                }
                sum
            })
            .collect()
    }

    fn zeros(&self) -> DMatrix<f64> {
        DMatrix::zeros(self.nodes(), self.to_modes.nrows())
    }

    /// Layer on the points for a potential there, [node, angle].
    fn layer_of(&self, potential: &DMatrix<f64>) -> DMatrix<f64> {
        let modes = potential * &self.to_modes;
        let mut layers = DMatrix::zeros(modes.nrows(), modes.ncols());
        for column in 0..modes.ncols() {
            let layer: DVector<f64> = &self.inverses[column.div_ceil(2)] * modes.column(column);
            layers.set_column(column, &layer);
        }
        layers * &self.from_modes
    }
}

/// Sources side by side: their places, moments and charges. Missing ones have neither moment nor charge.
fn abreast(sources: &[PointSource]) -> [Lanes; 7] {
    let mut all = [[0.0; LANES]; 7];
    for lane in 0..LANES {
        let last = sources[sources.len() - 1].at_m;
        let none = PointSource {
            at_m: last,
            ..PointSource::default()
        };
        let PointSource {
            at_m: [x, y, z],
            moment_a_m2: [mx, my, mz],
            charge_a_m,
        } = *sources.get(lane).unwrap_or(&none);
        for (values, value) in all.iter_mut().zip([x, y, z, mx, my, mz, charge_a_m]) {
            values[lane] = value;
        }
    }
    all.map(Lanes)
}

/// The potential of sources at points of a surface, and its slope along the normals there, times 4 pi.
struct Potentials<'a> {
    points: &'a [([f64; 3], [f64; 3])],
    sources: &'a [[Lanes; 7]],
    potential: &'a mut [f64],
    normal: &'a mut [f64],
}

impl Kernel for Potentials<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FMA: bool>(self) {
        let outputs = self.potential.iter_mut().zip(self.normal);
        for ((x, n), (phi, slope)) in self.points.iter().zip(outputs) {
            let scalar = |a: [Lanes; 3], b: [f64; 3]| {
                let [bx, by, bz] = b.map(Lanes::splat);
                a[0].mul_add::<FMA>(bx, a[1].mul_add::<FMA>(by, a[2] * bz))
            };
            let (mut phis, mut slopes) = (Lanes::splat(0.0), Lanes::splat(0.0));
            for [px, py, pz, mx, my, mz, charge] in self.sources {
                let d = [(x[0], px), (x[1], py), (x[2], pz)].map(|(x, p)| Lanes::splat(x) - *p);
                let square = d[0].mul_add::<FMA>(d[0], d[1].mul_add::<FMA>(d[1], d[2] * d[2]));
                let inverse_square = Lanes::splat(1.0) / square;
                let inverse = inverse_square.sqrt();
                let moment = mx.mul_add::<FMA>(d[0], my.mul_add::<FMA>(d[1], *mz * d[2]));
                let along = moment * inverse_square;
                phis = (*charge + along).mul_add::<FMA>(inverse, phis);
                let by_place = (along * 3.0 + *charge) * scalar(d, *n);
                let by_moment = scalar([*mx, *my, *mz], *n);
                slopes = (by_moment - by_place).mul_add::<FMA>(inverse * inverse_square, slopes);
            }
            *phi = phis.0.iter().sum();
            *slope = slopes.0.iter().sum();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fluxform_numerics::vec3::plus;

    const SEED: CoreShape = CoreShape {
        radius_m: 0.012,
        bottom_m: -0.11,
        top_m: 0.0,
    };

    #[test]
    fn the_force_is_minus_the_gradient_of_the_energy() {
        let resolution = ReactionResolution::for_tolerance(1e-5, SEED, 0.01);
        let core = Reaction::new(SEED, 1000.0, &resolution);
        let pair = |shift: [f64; 3]| {
            [
                PointSource {
                    at_m: [0.007 + shift[0], -0.003 + shift[1], 0.013 + shift[2]],
                    moment_a_m2: [0.13, -0.21, 0.7],
                    charge_a_m: 0.0,
                },
                PointSource {
                    at_m: [0.011 + shift[0], 0.002 + shift[1], 0.019 + shift[2]],
                    moment_a_m2: [-0.08, 0.11, 0.3],
                    charge_a_m: 17.0,
                },
            ]
        };
        let fields = core.induced(&pair([0.0; 3]));
        let mut force = [0.0; 3];
        for (source, field) in pair([0.0; 3]).iter().zip(&fields) {
            force = plus(force, source.force_n(field));
        }
        let size = force.iter().fold(0.0_f64, |s, f| s.max(f.abs()));
        for (axis, f) in force.iter().enumerate() {
            let step = 2e-5;
            let at = |h: f64| {
                let mut shift = [0.0; 3];
                shift[axis] = h;
                core.energy_j(&pair(shift))
            };
            let slope = (at(step) - at(-step)) / (2.0 * step);
            // The discrete operator is symmetric only up to its own error.
            assert!((f + slope).abs() < 1e-4 * size, "{axis}: {f} {slope}");
        }
    }
}
