//! One core alone: its energy with the magnet, tabulated over distance, height and azimuth.
//!
//! The energy is negative (positive for mu_r < 1) everywhere, so its logarithm is tabulated: the
//! error is relative to the force at the place itself, near or far. With alpha the azimuth from
//! the magnet's horizontal moment to the place,
//!
//! ```text
//! W = +- exp(l(r, z)) (1 + sum_j r^p_j rho_j(r, z) cos(j alpha)),
//! ```
//!
//! p_j = 1 for odd j, 2 for even ones, which keeps the force regular on the axis. An upright
//! magnet needs no j, a tilted dipole two.

use rayon::prelude::*;
use std::f64::consts::PI;

use super::magnet::PassiveMagnet;
use super::reaction::{PointSource, Reaction};
use super::table::{Grid, Tables};
use fluxform_numerics::vec3::plus;

/// Harmonics of a tilted cylinder beyond a dipole's two.
const CYLINDER_HARMONICS: usize = 3;

/// The table of one core.
#[derive(Debug, Clone)]
pub struct Isolated {
    tables: Tables,
    harmonics: usize,
    /// Azimuth of the horizontal moment.
    azimuth: f64,
    /// The energy's sign times the factor taken out of its logarithm, J.
    scale_j: f64,
}

impl Isolated {
    /// Tabulates the energy; `None` where it is zero.
    #[must_use]
    pub fn new(reaction: &Reaction, magnet: &PassiveMagnet, grid: Grid) -> Option<Self> {
        let moment = magnet.moment_a_m2();
        let harmonics = match (magnet.is_upright(), magnet.is_dipole()) {
            (true, _) => 0,
            (false, true) => 2,
            (false, false) => 2 + CYLINDER_HARMONICS,
        };
        let azimuth = moment[1].atan2(moment[0]);
        let samples = if harmonics == 0 { 1 } else { harmonics + 2 };
        let [across, up] = grid.nodes;
        let sources: Vec<_> = (0..up).map(|j| magnet.sources(grid.height_m(j))).collect();
        let energies: Vec<f64> = (0..up * across * samples)
            .into_par_iter()
            .map(|index| {
                let (place, sample) = (index / samples, index % samples);
                let (j, k) = (place / across, place % across);
                let alpha = PI * (sample as f64 + 0.5) / samples as f64;
                let theta = azimuth + if harmonics == 0 { 0.0 } else { alpha };
                let (s, c) = theta.sin_cos();
                let r_m = grid.distance_m(k);
                let centre = [r_m * c, r_m * s, grid.height_m(j)];
                reaction.energy_j(&placed(&sources[j], centre))
            })
            .collect();
        let largest = energies.iter().fold(0.0_f64, |m, e| m.max(e.abs()));
        if largest == 0.0 {
            return None;
        }
        let scale_j = largest.copysign(energies[0]);
        let mut values = Vec::with_capacity(up * across * (1 + harmonics));
        for (place, energies) in energies.chunks(samples).enumerate() {
            let r_m = grid.distance_m(place % across);
            let wave = |j: usize| {
                energies
                    .iter()
                    .enumerate()
                    .map(|(sample, e)| {
                        let alpha = PI * (sample as f64 + 0.5) / samples as f64;
                        e / scale_j * (j as f64 * alpha).cos()
                    })
                    .sum::<f64>()
                    / samples as f64
            };
            let mean = wave(0);
            values.push(mean.ln());
            values.extend((1..=harmonics).map(|j| 2.0 * wave(j) / mean / r_m.powi(power(j))));
        }
        Some(Self {
            tables: Tables::new(grid, 1 + harmonics, &values),
            harmonics,
            azimuth,
            scale_j,
        })
    }

    /// Sizes of the tables' last coefficients.
    #[must_use]
    pub fn tails(&self) -> [f64; 2] {
        self.tables.tails()
    }

    /// Force on the magnet's centre at (x, y, z) m from the core's axis, N.
    #[must_use]
    pub fn force_n(&self, at_m: [f64; 3]) -> [f64; 3] {
        let [x, y, z_m] = at_m;
        let r_m = x.hypot(y);
        let found = self.tables.at(r_m, z_m);
        let energy = self.scale_j * found[0].value.exp();
        let (s, c) = if r_m > 0.0 {
            (y / r_m, x / r_m)
        } else {
            (0.0, 1.0)
        };
        let alpha = y.atan2(x) - self.azimuth;
        let (mut shape, mut shape_r, mut shape_z, mut shape_t) = (1.0, 0.0, 0.0, 0.0);
        for (j, rho) in found.iter().enumerate().skip(1) {
            let p = power(j);
            let (sin, cos) = (j as f64 * alpha).sin_cos();
            let (below, at) = (r_m.powi(p - 1), r_m.powi(p));
            shape += at * rho.value * cos;
            shape_r += (f64::from(p) * below * rho.value + at * r_m * rho.slope_over_r) * cos;
            shape_z += at * rho.slope_z * cos;
            shape_t -= j as f64 * below * rho.value * sin;
        }
        assert_eq!(found.len(), self.harmonics + 1);
        let radial = -energy * (r_m * found[0].slope_over_r * shape + shape_r);
        let around = -energy * shape_t;
        let up = -energy * (found[0].slope_z * shape + shape_z);
        [radial * c - around * s, radial * s + around * c, up]
    }
}

/// The sources that stand for a magnet, about a centre.
#[must_use]
pub fn placed(sources: &[PointSource], centre_m: [f64; 3]) -> Vec<PointSource> {
    let about = |source: &PointSource| PointSource {
        at_m: plus(source.at_m, centre_m),
        ..*source
    };
    sources.iter().map(about).collect()
}

fn power(harmonic: usize) -> i32 {
    if harmonic % 2 == 1 { 1 } else { 2 }
}
