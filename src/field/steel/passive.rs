//! The pull of the unpowered steel on the magnet.
//!
//! The magnet magnetises the cores; their field at the magnet pulls it towards them. In linear
//! steel the energy at a place p is W(p) = -(1/2) sum_k m_k . B_induced(p + o_k) and the force
//! F = -grad W, which is sum_k (m_k . grad) B_induced with the induced field held fixed.

pub mod isolated;
pub mod magnet;
pub mod reaction;
pub mod table;

use rayon::prelude::*;
use thiserror::Error;

use super::CoreShape;
use crate::field::magnet::{Cylinder, NoRule};
use isolated::{Isolated, placed};
use magnet::PassiveMagnet;
use reaction::{Reaction, ReactionResolution};
use table::Grid;

/// Where the magnet's centre may be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Region {
    /// From and to, m, along x, y and z.
    pub x_m: [f64; 2],
    /// See `x_m`.
    pub y_m: [f64; 2],
    /// See `x_m`.
    pub z_m: [f64; 2],
}

/// Why there is no pull.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum NoPull {
    /// A size, place or tolerance that is not a number in its range.
    #[error(
        "sizes, permeability and tolerance must be positive numbers, places finite and ordered"
    )]
    NotANumber,
    /// The region reaches down to the steel's top.
    #[error("the magnet may touch the steel (gap {gap_m:e} m): the pull is known above it only")]
    TouchesSteel {
        /// Height above the steel, m.
        gap_m: f64,
    },
    /// The magnet's cylinder touches the steel, or nearly.
    #[error(transparent)]
    Magnet(#[from] NoRule),
}

/// What [`PassivePull::new`] needs to know.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pulled<'a> {
    /// Every core, about its axis.
    pub shape: CoreShape,
    /// mu_r > 0 of the steel.
    pub relative_permeability: f64,
    /// Axes, m.
    pub positions_m: &'a [[f64; 2]],
    /// Whether the cores magnetise each other too.
    pub coupled: bool,
    /// Moment of the magnet, A m^2.
    pub moment_a_m2: [f64; 3],
    /// Size of the magnet; a point dipole without.
    pub size: Option<Cylinder>,
    /// Where the magnet's centre may be.
    pub region: Region,
}

/// The pull over a region.
#[derive(Debug, Clone)]
pub struct PassivePull {
    positions_m: Vec<[f64; 2]>,
    isolated: Option<Isolated>,
    /// Estimated error of a force, relative to its length: the largest difference from a finer
    /// solution without tables at places spread over the region.
    pub relative_error: f64,
}

/// Places at which the error is looked for.
const CHECKS: usize = 12;
/// Refinements of the table, each by `GROWTH`.
const MOST_REFINEMENTS: usize = 5;
const GROWTH: f64 = 1.35;
/// Points a portion of work.
const CHUNK: usize = 64;

impl PassivePull {
    /// Prepares the pull to an estimated error of `tolerance`, or as near to it as its tables
    /// get: [`PassivePull::relative_error`] says what was reached.
    ///
    /// Domain: the whole magnet above the highest steel.
    ///
    /// # Errors
    /// [`NoPull`].
    pub fn new(pulled: &Pulled, tolerance: f64) -> Result<Self, NoPull> {
        check(pulled, tolerance)?;
        let shape = pulled.shape;
        let region = pulled.region;
        let aim = 0.3 * tolerance;
        let magnet = PassiveMagnet::new(
            pulled.moment_a_m2,
            pulled.size,
            shape.top_m,
            region.z_m[0],
            0.5 * aim,
        )?;
        let gap_m = magnet.gap_m();
        let resolution = ReactionResolution::for_tolerance(aim, shape, gap_m);
        let reaction = Reaction::new(shape, pulled.relative_permeability, &resolution);
        let mut grid = Grid {
            scale_m: shape.radius_m + gap_m,
            far_m: farthest(pulled).max(1e-3 * (shape.radius_m + gap_m)),
            base_m: shape.top_m,
            heights_m: region.z_m,
            nodes: [12, 8],
        };
        // A single height still has a slope.
        let span = region.z_m[0] - shape.top_m;
        grid.heights_m[1] = grid.heights_m[1].max(region.z_m[0] + 0.05 * span);
        let checks = Checks::new(pulled, &magnet, &resolution, &grid);
        let mut best: Option<(f64, Isolated)> = None;
        for _ in 0..=MOST_REFINEMENTS {
            let Some(isolated) = Isolated::new(&reaction, &magnet, grid) else {
                return Ok(Self {
                    positions_m: pulled.positions_m.to_vec(),
                    isolated: None,
                    relative_error: 0.0,
                });
            };
            let error = checks.error_of(&isolated);
            let [across, up] = isolated.tails();
            if best.as_ref().is_none_or(|(e, _)| error < *e) {
                best = Some((error, isolated));
            }
            if error <= 2.0 * aim {
                break;
            }
            for (tail, nodes) in [across, up].iter().zip(&mut grid.nodes) {
                if *tail >= 0.1 * across.max(up) {
                    *nodes = (GROWTH * *nodes as f64).ceil() as usize;
                }
            }
        }
        let (relative_error, isolated) = best.expect("at least one table was made");
        Ok(Self {
            positions_m: pulled.positions_m.to_vec(),
            isolated: Some(isolated),
            relative_error,
        })
    }

    /// Force on the magnet with its centre at `at_m` in the region, N.
    #[must_use]
    pub fn force_n(&self, at_m: [f64; 3]) -> [f64; 3] {
        let mut sum = [0.0; 3];
        if let Some(isolated) = &self.isolated {
            for [x, y] in &self.positions_m {
                let force = isolated.force_n([at_m[0] - x, at_m[1] - y, at_m[2]]);
                for (s, f) in sum.iter_mut().zip(force) {
                    *s += f;
                }
            }
        }
        sum
    }

    /// Vertical forces at many places, N.
    #[must_use]
    pub fn forces_z_n(&self, at_m: &[[f64; 3]]) -> Vec<f64> {
        at_m.par_iter()
            .with_min_len(CHUNK)
            .map(|at| self.force_n(*at)[2])
            .collect()
    }
}

fn check(pulled: &Pulled, tolerance: f64) -> Result<(), NoPull> {
    let CoreShape {
        radius_m,
        bottom_m,
        top_m,
    } = pulled.shape;
    let Region { x_m, y_m, z_m } = pulled.region;
    let positive = [
        radius_m,
        top_m - bottom_m,
        pulled.relative_permeability,
        tolerance,
    ];
    let finite = [x_m, y_m, z_m]
        .iter()
        .chain(pulled.positions_m)
        .flatten()
        .all(|v| v.is_finite());
    let ordered = [x_m, y_m, z_m].iter().all(|[from, to]| from <= to);
    if !positive.iter().all(|v| v.is_finite() && *v > 0.0) || !finite || !ordered {
        return Err(NoPull::NotANumber);
    }
    Ok(())
}

/// Largest distance of the region from an axis, m.
fn farthest(pulled: &Pulled) -> f64 {
    let away = |[from, to]: [f64; 2], at: f64| (from - at).abs().max((to - at).abs());
    pulled.positions_m.iter().fold(0.0_f64, |far, [x, y]| {
        far.max(away(pulled.region.x_m, *x).hypot(away(pulled.region.y_m, *y)))
    })
}

/// Forces of one core by the finer solution, without tables.
struct Checks {
    places_m: Vec<[f64; 3]>,
    forces_n: Vec<[f64; 3]>,
}

impl Checks {
    fn new(
        pulled: &Pulled,
        magnet: &PassiveMagnet,
        resolution: &ReactionResolution,
        grid: &Grid,
    ) -> Self {
        let finer = Reaction::new(
            pulled.shape,
            pulled.relative_permeability,
            &resolution.finer(),
        );
        let places_m: Vec<[f64; 3]> = (0..CHECKS)
            .map(|k| {
                // Spread over the table: the corners, then a Kronecker sequence.
                let golden = |step: f64| (0.5 + step * k as f64).fract();
                let (u, v) = match k {
                    0..4 => ((k % 2) as f64, (k / 2) as f64),
                    _ => (golden(0.754_877_666), golden(0.569_840_291)),
                };
                let r_m = grid.scale_m * (u * (grid.far_m / grid.scale_m).asinh()).sinh();
                let [lo, hi] = grid.heights_m.map(|z| (z - grid.base_m).ln());
                let (s, c) = (2.399_963_23 * k as f64).sin_cos();
                let z_m = grid.base_m + (lo + v * (hi - lo)).exp();
                [
                    r_m * c,
                    r_m * s,
                    z_m.clamp(grid.heights_m[0], grid.heights_m[1]),
                ]
            })
            .collect();
        let forces_n = places_m
            .par_iter()
            .map(|at| {
                let rule = magnet.magnet_rule(at[2]);
                let fields = finer.induced(&placed(&magnet::dipoles(&rule), *at));
                let gradients: Vec<_> = fields.iter().map(|f| f.gradient_t_per_m).collect();
                rule.force_n(&gradients)
            })
            .collect();
        Self { places_m, forces_n }
    }

    /// Largest difference, relative to the force.
    fn error_of(&self, isolated: &Isolated) -> f64 {
        self.places_m
            .iter()
            .zip(&self.forces_n)
            .map(|(at, sure)| {
                let found = isolated.force_n(*at);
                let norm = |v: [f64; 3]| reaction::dot(v, v).sqrt();
                norm(reaction::minus(found, *sure)) / norm(*sure)
            })
            .fold(0.0, f64::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seed() {
        let shape = CoreShape {
            radius_m: 0.012,
            bottom_m: -0.11,
            top_m: 0.0,
        };
        let positions: Vec<[f64; 2]> = (0..9)
            .map(|i| [0.05 * ((i % 3) as f64 - 1.0), 0.05 * ((i / 3) as f64 - 1.0)])
            .collect();
        let m = 1.1579e6 * std::f64::consts::PI * 2.5e-5 * 0.01;
        for (tilt, size, zlo) in [
            (false, None, 0.01),
            (false, None, 0.006),
            (
                false,
                Some(Cylinder {
                    diameter_m: 0.01,
                    length_m: 0.01,
                }),
                0.02,
            ),
            (
                false,
                Some(Cylinder {
                    diameter_m: 0.01,
                    length_m: 0.01,
                }),
                0.01,
            ),
            (true, None, 0.01),
            (
                true,
                Some(Cylinder {
                    diameter_m: 0.01,
                    length_m: 0.01,
                }),
                0.02,
            ),
        ] {
            for tol in [1e-2, 1e-3, 1e-4] {
                let pulled = Pulled {
                    shape,
                    relative_permeability: 1000.0,
                    positions_m: &positions,
                    coupled: false,
                    moment_a_m2: if tilt {
                        [0.4 * m, -0.3 * m, 0.75f64.sqrt() * m]
                    } else {
                        [0.0, 0.0, m]
                    },
                    size,
                    region: Region {
                        x_m: [-0.05, 0.05],
                        y_m: [-0.05, 0.05],
                        z_m: [zlo, 0.08],
                    },
                };
                let t = std::time::Instant::now();
                let gap =
                    PassiveMagnet::new(pulled.moment_a_m2, size, 0.0, zlo, 0.15 * tol).unwrap();
                let res = ReactionResolution::for_tolerance(0.3 * tol, shape, gap.gap_m());
                let r = Reaction::new(shape, 1000.0, &res);
                let t0 = t.elapsed();
                let tt = std::time::Instant::now();
                r.energy_j(&gap.rule(0.03));
                let t1 = tt.elapsed();
                let t = std::time::Instant::now();
                let pull = PassivePull::new(&pulled, tol).unwrap();
                let dt = t.elapsed();
                let single = pull.isolated.as_ref().unwrap();
                println!(
                    "{tilt} {} {zlo} tol {tol:e}: modes {} nodes {} rule {} reaction {t0:?} energy {t1:?} new {dt:?} grid {:?} est {:.1e}",
                    size.is_some(),
                    res.modes,
                    r.nodes(),
                    gap.rule(zlo).len(),
                    single.tails(),
                    pull.relative_error
                );
                if size.is_some() && !tilt {
                    for (z, f) in [
                        (0.02, -0.16307555),
                        (0.03, -0.02723094928593556),
                        (0.04, -0.007041412308175571),
                        (0.05, -0.002355593866302607),
                        (0.08, -0.0002094899467399436),
                    ] {
                        println!("   {z} {:.2e}", single.force_n([0.0, 0.0, z])[2] / f - 1.0);
                    }
                }
                let points: Vec<[f64; 3]> = (0..3721)
                    .map(|i| {
                        [
                            -0.05 + 0.1 * (i % 61) as f64 / 60.0,
                            -0.05 + 0.1 * (i / 61) as f64 / 60.0,
                            0.05,
                        ]
                    })
                    .collect();
                let t = std::time::Instant::now();
                let f = pull.forces_z_n(&points);
                println!("   3721 points {:?} {}", t.elapsed(), f[1860]);
            }
        }
    }
}
