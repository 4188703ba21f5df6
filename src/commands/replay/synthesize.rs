//! Trajectories made up: scan lines, a circle, an exploring finger. They depend on the seed alone.

use std::f64::consts::TAU;
use strum::{EnumMessage, EnumString, IntoStaticStr, VariantArray};

use serde::Serialize;

use crate::bundle::artefact::Options;
use crate::bundle::force_map::ForceMap;
use crate::bundle::rendering::HeightGrid;
use crate::bundle::trajectory::Trajectory;
use crate::numerics::random::Random;

/// Largest distance of the exploring finger from the surface, m: the seed's trial.
const DEVIATION_M: f64 = 0.014;
/// Part of it that is the sensor's noise, m.
const NOISE_M: f64 = 0.0002;
/// How far beyond the map the exploring finger goes, m.
const BEYOND_M: f64 = 0.015;
/// Lines of a scan.
const LINES: f64 = 11.0;
/// Time of one turn of the circle, s.
const TURN_S: f64 = 4.0;
/// Positions are rounded to a micrometre.
const RESOLUTION_M: f64 = 1e-6;

/// Kinds of trajectories.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, EnumMessage, EnumString, IntoStaticStr, VariantArray,
)]
#[strum(serialize_all = "lowercase")]
pub enum Kind {
    /// Lines to and fro on the surface
    Scan,
    /// A circle on the surface
    Circle,
    /// Up to 14 mm off the surface, once outside the workspace
    Explore,
}

crate::choices!(Kind);

/// A trajectory to be made up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Synthesis {
    /// Which kind.
    pub kind: Kind,
    /// Decides what is random.
    pub seed: u64,
    /// s.
    pub duration_s: f64,
    /// Positions per second.
    pub rate_hz: f64,
}

impl Synthesis {
    /// Number of positions.
    #[must_use]
    pub fn positions(&self) -> usize {
        (self.duration_s * self.rate_hz).round() as usize + 1
    }

    /// The trajectory over a surface with a map.
    #[must_use]
    pub fn trajectory(&self, heights: &HeightGrid, map: &ForceMap) -> Trajectory {
        let t_s: Vec<f64> = (0..self.positions())
            .map(|k| k as f64 / self.rate_hz)
            .collect();
        let surface = Surface::new(heights);
        let position_m = match self.kind {
            Kind::Scan => self.scan(&t_s, &surface),
            Kind::Circle => circle(&t_s, &surface),
            Kind::Explore => self.explore(&t_s, &surface, map.ends_m()[0][1]),
        };
        let rounded = |v: f64| (v / RESOLUTION_M).round() / (1.0 / RESOLUTION_M);
        Trajectory {
            t_s,
            position_m: position_m.into_iter().map(|p| p.map(rounded)).collect(),
            second_m: Vec::new(),
        }
    }

    fn scan(&self, t_s: &[f64], surface: &Surface) -> Vec<[f64; 3]> {
        let whole = self.duration_s.max(1.0 / self.rate_hz);
        t_s.iter()
            .map(|t| {
                let place = (t / whole * LINES).min(LINES * (1.0 - 1e-12));
                let (line, along) = (place.floor(), place.fract());
                let forward = if line % 2.0 == 0.0 {
                    along
                } else {
                    1.0 - along
                };
                surface.on([2.0 * forward - 1.0, 2.0 * line / (LINES - 1.0) - 1.0])
            })
            .collect()
    }

    fn explore(&self, t_s: &[f64], surface: &Surface, border_m: f64) -> Vec<[f64; 3]> {
        let mut random = Random::new(self.seed);
        // A slow wave and a faster one along x and y, three along z.
        let mut waves = |speeds: &[f64]| -> Vec<[f64; 2]> {
            let wave = |hz: &f64| [hz * (0.8 + 0.4 * random.unit()), random.unit()];
            speeds.iter().map(wave).collect()
        };
        let (x, y) = (waves(&[0.31, 0.83]), waves(&[0.23, 0.71]));
        let z = waves(&[0.19, 0.47, 1.1]);
        let sum = |waves: &[[f64; 2]], t: f64, sizes: &[f64]| -> f64 {
            let terms = waves.iter().zip(sizes);
            terms
                .map(|([hz, phase], size)| size * (TAU * (hz * t + phase)).sin())
                .sum()
        };
        let away: Vec<f64> = t_s.iter().map(|t| sum(&z, *t, &[1.0, 0.7, 0.3])).collect();
        let most = away.iter().fold(1e-9_f64, |most, a| most.max(a.abs()));
        let noise = |random: &mut Random| NOISE_M * (2.0 * random.unit() - 1.0);
        t_s.iter()
            .zip(&away)
            .map(|(&t, away)| {
                let [mut px, py, _] =
                    surface.on([sum(&x, t, &[0.65, 0.3]), sum(&y, t, &[0.65, 0.3])]);
                // Around six tenths of the time the finger leaves to the right and comes back.
                let since = (t / self.duration_s.max(1e-9) - 0.6) / 0.08;
                let out = if since.abs() < 1.0 {
                    (0.5 * (1.0 + (0.5 * TAU * since).cos())).sqrt()
                } else {
                    0.0
                };
                px += out * (border_m + BEYOND_M - px);
                let (px, py) = (px + noise(&mut random), py + noise(&mut random));
                let height = surface.height(px, py);
                let deviation = (DEVIATION_M - NOISE_M) * away / most;
                [px, py, height + deviation + noise(&mut random)]
            })
            .collect()
    }
}

fn circle(t_s: &[f64], surface: &Surface) -> Vec<[f64; 3]> {
    let turn = |t: &f64| TAU * t / TURN_S;
    t_s.iter()
        .map(|t| surface.on([0.7 * turn(t).cos(), 0.7 * turn(t).sin()]))
        .collect()
}

/// The surface with a height everywhere: beyond it its mean.
struct Surface<'a> {
    heights: &'a HeightGrid,
    middle_m: [f64; 2],
    half_m: [f64; 2],
    mean_m: f64,
}

impl<'a> Surface<'a> {
    fn new(heights: &'a HeightGrid) -> Self {
        let ends = [&heights.x_m, &heights.y_m].map(|nodes| (nodes[0], nodes[nodes.len() - 1]));
        let count: f64 = heights.has_height.iter().sum();
        Self {
            heights,
            middle_m: ends.map(|(from, to)| 0.5 * (from + to)),
            half_m: ends.map(|(from, to)| 0.5 * (to - from)),
            mean_m: heights.height_m.iter().sum::<f64>() / count.max(1.0),
        }
    }

    fn height(&self, x_m: f64, y_m: f64) -> f64 {
        self.heights.height_m(x_m, y_m).unwrap_or(self.mean_m)
    }

    /// The point on the surface at a place from -1 to 1 along x and y.
    fn on(&self, place: [f64; 2]) -> [f64; 3] {
        let [x, y] = [0, 1].map(|k| self.middle_m[k] + self.half_m[k] * place[k]);
        [x, y, self.height(x, y)]
    }
}

/// The options of `replay` as its record states them.
#[must_use]
pub fn made_with(synthesis: Option<&Synthesis>, dynamics: bool, robust: bool) -> Options {
    #[derive(Serialize)]
    struct Recorded {
        dynamics: bool,
        #[serde(skip_serializing_if = "std::ops::Not::not")]
        robust: bool,
        synthesize: Option<&'static str>,
        seed: Option<u64>,
        duration_s: Option<f64>,
        rate_hz: Option<f64>,
    }
    let made_up = synthesis.map(|synthesis| {
        let Synthesis {
            kind,
            seed,
            duration_s,
            rate_hz,
        } = *synthesis;
        (kind.name(), seed, duration_s, rate_hz)
    });
    Options::of(&Recorded {
        dynamics,
        robust,
        synthesize: made_up.map(|(kind, ..)| kind),
        seed: made_up.map(|(_, seed, ..)| seed),
        duration_s: made_up.map(|(_, _, duration_s, _)| duration_s),
        rate_hz: made_up.map(|(.., rate_hz)| rate_hz),
    })
}
