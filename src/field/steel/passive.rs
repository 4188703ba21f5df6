//! The pull of the unpowered steel on the magnet.
//!
//! The magnet magnetises the cores; their field at the magnet pulls it towards them. In linear
//! steel the energy at a place p is W(p) = -(1/2) sum_k m_k . B_induced(p + o_k) and the force
//! F = -grad W, which is sum_k (m_k . grad) B_induced with the induced field held fixed.
//!
//! Every core alone is a table over distance and height (`isolated`); what the cores' magnetising
//! each other changes is a quadratic form in a few numbers a core (`neighbours`). It is no small
//! correction: of nine cores 24 mm wide and 110 mm long, 50 mm apart, a sixth of the pull at
//! 50 mm over the middle one, and more than a third in places.

pub mod isolated;
pub mod magnet;
pub mod neighbours;
pub mod reaction;
pub mod table;

use rayon::prelude::*;
use thiserror::Error;

use super::CoreShape;
use super::array::MOST_WHOLE;
use crate::magnet::{Cylinder, NoRule};
use isolated::{Isolated, placed};
use magnet::PassiveMagnet;
use neighbours::Neighbours;
use reaction::{Reaction, ReactionResolution};
use table::Grid;

use fluxform_numerics::vec3::{minus, norm, plus};

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
    #[error("it may be {:.3} mm below the top of the highest steel, above which alone the pull is known", gap_m.abs() * 1e3)]
    TouchesSteel {
        /// Height above the steel, m.
        gap_m: f64,
    },
    /// Two cores overlap or touch.
    #[error("two cores are {distance_m:e} m apart, less than their diameter")]
    CoresOverlap {
        /// Distance of their axes, m.
        distance_m: f64,
    },
    /// The magnet's cylinder touches the steel, or nearly.
    #[error(transparent)]
    Magnet(#[from] NoRule),
}

/// Arguments of [`PassivePull::new`].
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
    neighbours: Option<Neighbours>,
    /// Estimated error of a force, relative to its length: the largest difference from finer
    /// solutions at places spread over the region, plus the bound of the magnet's dipoles.
    pub relative_error: f64,
    /// Largest share of the cores' coupling in the force at those places, relative to its length;
    /// zero when it is left out.
    pub coupling_share: f64,
}

/// Places at which the error is looked for.
const CHECKS: usize = 12;
/// Refinements of the table, each by `GROWTH`.
const MOST_REFINEMENTS: usize = 7;
const GROWTH: f64 = 1.35;
/// Tolerance of what the coupling adds over that of the force.
const COARSER: f64 = 10.0;
/// Every solution of the coupling is to be better than the last by this factor.
const FINER: f64 = 0.2;
/// Refinements of the coupling.
const MOST_COUPLINGS: usize = 3;
/// Points a portion of work.
const CHUNK: usize = 16;

/// The table of one core alone with its error: made finer until that is within `2 aim`, or the
/// best of those tried. `None` if the core does not answer.
fn tabulated(
    reaction: &Reaction,
    magnet: &PassiveMagnet,
    mut grid: Grid,
    checks: &Checks,
    aim: f64,
) -> Option<(f64, Isolated)> {
    let mut best: Option<(f64, Isolated)> = None;
    for _ in 0..=MOST_REFINEMENTS {
        let isolated = Isolated::new(reaction, magnet, grid)?;
        let error = checks.error_of(&isolated);
        let [across, up] = isolated.tails();
        if best.as_ref().is_none_or(|(e, _)| error < *e) {
            best = Some((error, isolated));
        }
        if error <= 2.0 * aim {
            break;
        }
        for (tail, nodes) in [across, up].iter().zip(&mut grid.nodes) {
            if *tail >= 0.3 * across.max(up) {
                *nodes = (GROWTH * *nodes as f64).ceil() as usize;
            }
        }
    }
    best
}

/// The force that the cores' coupling adds at some places, N, and its error.
struct Added {
    force_n: Vec<[f64; 3]>,
    error_n: Vec<f64>,
}

impl Added {
    fn nothing(places: usize) -> Self {
        Self {
            force_n: vec![[0.0; 3]; places],
            error_n: vec![0.0; places],
        }
    }

    /// The coupling that `solve` gives to a tolerance, tightened until two in a row agree to their
    /// share of `tolerance`. The first two of `few` cores are solved side by side; those of many take much memory.
    fn refined(
        (solve, few): (impl Fn(f64) -> Neighbours + Sync, bool),
        places_m: &[[f64; 3]],
        alone: &[[f64; 3]],
        tolerance: f64,
    ) -> (Neighbours, Self) {
        let of = |n: &Neighbours| -> Vec<[f64; 3]> {
            places_m.par_iter().map(|at| n.force_n(*at)).collect()
        };
        let solved = |aim: f64| {
            let neighbours = solve(aim);
            let force_n = of(&neighbours);
            (neighbours, force_n)
        };
        let first = first_coupling(tolerance);
        let mut aim = FINER * first;
        let ((mut coarse, force_n), mut next) =
            rayon::join(|| solved(first), || few.then(|| solved(aim)));
        let mut added = Self {
            force_n,
            error_n: vec![0.0; places_m.len()],
        };
        for _ in 0..MOST_COUPLINGS {
            let (fine, finer) = next.take().unwrap_or_else(|| solved(aim));
            aim *= FINER;
            let mut worst = 0.0_f64;
            for (k, error) in added.error_n.iter_mut().enumerate() {
                *error = norm(minus(added.force_n[k], finer[k]));
                let total: [f64; 3] = std::array::from_fn(|i| alone[k][i] + finer[k][i]);
                worst = worst.max(*error / norm(total));
            }
            if worst <= aim_share(tolerance) {
                break;
            }
            // The difference bounds the finer one's error from here, on the safe side.
            (coarse, added.force_n) = (fine, finer);
        }
        (coarse, added)
    }
}

impl PassivePull {
    /// Prepares the pull to an estimated error of `tolerance`, or as near to it as its tables
    /// get: [`PassivePull::relative_error`] says what was reached.
    ///
    /// Domain: the whole magnet above the highest steel. Closer to it than half a core's radius
    /// the work grows and a tolerance of 1e-3 may not be reached.
    ///
    /// # Errors
    /// [`NoPull`].
    pub fn new(pulled: &Pulled, tolerance: f64) -> Result<Self, NoPull> {
        let closest_m = check(pulled, tolerance)?;
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
        let (reaction, checks) = rayon::join(
            || Reaction::new(shape, pulled.relative_permeability, &resolution),
            || Checks::new(pulled, &magnet, &resolution, &grid),
        );
        let Some((table_error, isolated)) = tabulated(&reaction, &magnet, grid, &checks, aim)
        else {
            return Ok(Self {
                positions_m: Vec::new(),
                isolated: None,
                neighbours: None,
                relative_error: 0.0,
                coupling_share: 0.0,
            });
        };
        let mut pull = Self {
            positions_m: pulled.positions_m.to_vec(),
            isolated: Some(isolated),
            neighbours: None,
            relative_error: 0.0,
            coupling_share: 0.0,
        };
        let places_m = spread(pulled.positions_m, pulled.region, shape.top_m);
        let alone: Vec<_> = places_m.iter().map(|at| pull.force_n(*at)).collect();
        let coupled = pulled.coupled && pulled.positions_m.len() > 1;
        let added = if coupled {
            let solve = |aim| couple(pulled, &magnet, closest_m, aim);
            let few = pulled.positions_m.len() <= MOST_WHOLE;
            let (neighbours, added) = Added::refined((solve, few), &places_m, &alone, tolerance);
            pull.neighbours = Some(neighbours);
            added
        } else {
            Added::nothing(places_m.len())
        };
        let rule_error = magnet.rule_error(region.z_m[0]);
        for (k, at) in places_m.iter().enumerate() {
            let total: [f64; 3] = std::array::from_fn(|i| alone[k][i] + added.force_n[k][i]);
            let size = norm(total);
            let of_tables: f64 =
                pull.each_n(*at).map(norm).sum::<f64>() * (table_error + rule_error);
            pull.relative_error = pull
                .relative_error
                .max((of_tables + added.error_n[k]) / size);
            pull.coupling_share = pull.coupling_share.max(norm(added.force_n[k]) / size);
        }
        Ok(pull)
    }

    /// Forces of every core alone, N.
    fn each_n(&self, at_m: [f64; 3]) -> impl Iterator<Item = [f64; 3]> + '_ {
        self.isolated.iter().flat_map(move |isolated| {
            self.positions_m
                .iter()
                .map(move |[x, y]| isolated.force_n([at_m[0] - x, at_m[1] - y, at_m[2]]))
        })
    }

    /// Force on the magnet with its centre at `at_m` in the region, N.
    #[must_use]
    pub fn force_n(&self, at_m: [f64; 3]) -> [f64; 3] {
        let added = self.neighbours.as_ref().map(|n| n.force_n(at_m));
        self.each_n(at_m).chain(added).fold([0.0; 3], |sum, force| {
            std::array::from_fn(|i| sum[i] + force[i])
        })
    }

    /// Vertical forces at many places, N.
    #[must_use]
    pub fn forces_z_n(&self, at_m: &[[f64; 3]]) -> Vec<f64> {
        let of_chunk = |places_m: &[[f64; 3]]| -> Vec<f64> {
            let added = self.neighbours.as_ref().map(|n| n.forces_z_n(places_m));
            let place = |(k, at): (usize, &[f64; 3])| {
                let added = added.as_ref().map(|added| added[k]);
                self.each_n(*at).map(|f| f[2]).chain(added).sum()
            };
            places_m.iter().enumerate().map(place).collect()
        };
        let chunks: Vec<Vec<f64>> = at_m.par_chunks(CHUNK).map(of_chunk).collect();
        chunks.concat()
    }
}

/// Smallest distance of two axes, m; infinite for one.
fn check(pulled: &Pulled, tolerance: f64) -> Result<f64, NoPull> {
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
    let mut closest_m = f64::INFINITY;
    for (i, a) in pulled.positions_m.iter().enumerate() {
        for b in &pulled.positions_m[..i] {
            closest_m = closest_m.min((a[0] - b[0]).hypot(a[1] - b[1]));
        }
    }
    if closest_m <= 2.0 * radius_m {
        return Err(NoPull::CoresOverlap {
            distance_m: closest_m,
        });
    }
    Ok(closest_m)
}

/// Tolerance of the coupling where the force is requested to `tolerance`: the
/// first solution and one that judges it.
#[must_use]
pub fn coupling_tolerance(tolerance: f64) -> f64 {
    FINER * first_coupling(tolerance)
}

fn first_coupling(tolerance: f64) -> f64 {
    (COARSER * tolerance).clamp(1e-6, 0.1)
}

/// The part of the tolerance that the coupling may take.
fn aim_share(tolerance: f64) -> f64 {
    0.5 * tolerance
}

fn couple(pulled: &Pulled, magnet: &PassiveMagnet, closest_m: f64, tolerance: f64) -> Neighbours {
    let dipoles = magnet.few_dipoles(tolerance);
    Neighbours::new(
        pulled.shape,
        pulled.relative_permeability,
        pulled.positions_m,
        closest_m,
        magnet.gap_of_m(dipoles.iter().map(|dipole| dipole.at_m)),
        tolerance,
        dipoles,
    )
}

/// Places of a region above steel that ends at `top_m`: over the first axes at the lowest height, then a
/// Kronecker sequence.
#[must_use]
pub fn spread(positions_m: &[[f64; 2]], region: Region, top_m: f64) -> Vec<[f64; 3]> {
    let Region { x_m, y_m, z_m } = region;
    let over = positions_m
        .iter()
        .take(CHECKS)
        .map(|[x, y]| [x.clamp(x_m[0], x_m[1]), y.clamp(y_m[0], y_m[1]), z_m[0]]);
    let within = (0..2 * CHECKS).map(|k| {
        let part = |step: f64| (0.5 + step * k as f64).fract();
        let at = |[from, to]: [f64; 2], part: f64| from + part * (to - from);
        let height = (z_m[1] - top_m) / (z_m[0] - top_m);
        let z = top_m + (z_m[0] - top_m) * height.powf(part(0.819_172_513));
        [
            at(x_m, part(0.671_043_607)),
            at(y_m, part(0.549_700_478)),
            z.clamp(z_m[0], z_m[1]),
        ]
    });
    over.chain(within).collect()
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
                let sources = placed(&magnet.sources(at[2]), *at);
                let fields = finer.induced(&sources);
                let forces = sources
                    .iter()
                    .zip(&fields)
                    .map(|(source, field)| source.force_n(field));
                forces.fold([0.0; 3], plus)
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
                norm(minus(found, *sure)) / norm(*sure)
            })
            .fold(0.0, f64::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_of_the_error_s_search_fill_the_region() {
        let region = Region {
            x_m: [-0.07, 0.013],
            y_m: [0.02, 0.05],
            z_m: [0.03, 0.09],
        };
        let positions_m = [[0.0, 0.0], [0.05, 0.03]];
        let places = spread(&positions_m, region, 0.002);
        // Over each axis, or as near as the region gets, and within.
        assert_eq!(places[..2], [[0.0, 0.02, 0.03], [0.013, 0.03, 0.03]]);
        assert_eq!(places.len(), 2 + 2 * CHECKS);
        for (i, [from, to]) in [region.x_m, region.y_m, region.z_m].into_iter().enumerate() {
            let mut along: Vec<f64> = places[2..].iter().map(|at| at[i]).collect();
            along.sort_by(f64::total_cmp);
            assert!(along[0] >= from && along[along.len() - 1] <= to);
            // No gap of much more than a quarter, heights by their logarithm above the steel.
            let part = |v: f64| match i {
                2 => ((v - 0.002) / 0.028).ln() / (0.088_f64 / 0.028).ln(),
                _ => (v - from) / (to - from),
            };
            let ends = [&[from], along.as_slice(), &[to]].concat();
            assert!(
                ends.windows(2).all(|v| part(v[1]) - part(v[0]) < 0.26),
                "{i}"
            );
        }
    }
}
