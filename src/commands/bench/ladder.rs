//! The settings of every knob, from coarse to fine, and what measuring them will take.

use super::clock::Effort;
use super::{BenchRequest, Estimate};
use crate::bundle::bench::{Knob, KnobName, Setting};
use crate::design::Design;
use crate::numerics::axis::Axis;
use crate::scene::sources::ShapeSource;
use crate::shape::document::AxisRequest;
use crate::shape::points::ConstraintPoints;

/// Shares of the present number of intervals; the last ones are finer than requested now.
const FACTORS: [f64; 6] = [0.125, 0.25, 0.5, 1.0, 2.0, 4.0];
/// How many of them are of maps, whose nodes grow with the third power.
const OF_MAPS: usize = 5;
/// How many are quick: none that is finer than now.
const QUICK: usize = 4;
/// Shares of points from which on they are the first to be dropped.
const MANY: f64 = 10.0;
/// How much coarser than requested now deviations are.
const DEVIATIONS: [f64; 5] = [16.0, 8.0, 4.0, 2.0, 1.0];
/// Fewest samples along an axis: the map's interpolation takes four nodes.
const FEWEST: usize = 4;
/// The loosest tolerance.
const LOOSEST: f64 = 0.1;
/// Tolerances.
const TOLERANCES: usize = 4;
/// Processor time to which ladders are shortened, s.
const QUICK_S: f64 = 60.0;
const FULL_S: f64 = 600.0;
/// A refined solution of steel against the present one, beside which it is held.
const REFINED_STEEL: f64 = 8.0 + 1.0;
/// Places along an axis within the cells of one map at which the felt force is compared, at most about.
pub(super) const PLACES_OF_MAP: usize = 32;
/// Forces in the refined field, in the present one beside it, and force constants.
const REFINED_FORCES: f64 = 3.0;

/// Processor time of the stages of one run, s.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Seconds {
    /// Solving the steel.
    pub steel_s: f64,
    /// Sampling the surface.
    pub points_s: f64,
    /// Forces and force constants, and the largest |B| of steel.
    pub lambda_s: f64,
    /// Of that the forces.
    pub forces_s: f64,
    /// The map.
    pub map_s: f64,
}

/// One object at the present settings: what it takes, and its points.
pub struct Present {
    /// Processor time.
    pub seconds: Seconds,
    /// The grid's points.
    pub grid: ConstraintPoints,
}

/// A tolerance of the field.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ToleranceRung {
    /// Its value.
    pub value: f64,
    /// Arguments passed on: none where the default is in force.
    pub asked: Option<f64>,
    /// Whether it is in force now.
    pub present: bool,
}

/// How constraint points are chosen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Points {
    /// Samples along x and y.
    Grid([usize; 2]),
    /// Patches within a deviation.
    Graded {
        /// The deviation, m.
        max_deviation_m: f64,
        /// The lowest height, m, from which the widest patch follows.
        lowest_m: f64,
        /// The widest patch, m, where it does not.
        widest_m: Option<f64>,
    },
}

impl Points {
    /// Those of a graded deviation twice as large.
    pub fn coarser(self) -> Option<Self> {
        match self {
            Self::Grid(_) => None,
            Self::Graded {
                max_deviation_m,
                lowest_m,
                widest_m,
            } => Some(Self::Graded {
                max_deviation_m: 2.0 * max_deviation_m,
                lowest_m,
                widest_m: widest_m.map(|widest_m| 2.0 * widest_m),
            }),
        }
    }
}

/// Points of one setting.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PointsRung {
    /// How they are chosen.
    pub points: Points,
    /// Their number against the present ones, about.
    share: f64,
    /// Whether they are chosen so now.
    pub present: bool,
}

/// Nodes of the map.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NodesRung {
    /// Samples along x, y and z.
    pub samples: [usize; 3],
    /// Their number against the present ones.
    share: f64,
    /// Whether the design asks for them now.
    pub present: bool,
}

/// Every knob's settings for one object.
pub struct Ladders {
    /// Tolerances, from loose to tight.
    pub tolerance: Vec<ToleranceRung>,
    /// Points, from few to many.
    pub points: Vec<PointsRung>,
    /// Nodes, from few to many.
    pub nodes: Vec<NodesRung>,
    /// The points of the present grid.
    pub points_present: ConstraintPoints,
    seconds: Seconds,
}

impl Ladders {
    /// Processor time within which a run stays where ladders can be shortened, s.
    pub fn bound_s(quick: bool) -> f64 {
        if quick { QUICK_S } else { FULL_S }
    }

    /// The settings around those that are in force now.
    pub fn new(
        request: &BenchRequest,
        present_tolerance: f64,
        shape: &ShapeSource,
        present: Present,
    ) -> Self {
        let most = most_factors(request);
        let asked = request.lambda.tolerance;
        let tolerance = tolerances(present_tolerance, asked);
        let heights = present.grid.height_m.iter();
        let lowest_m = heights.copied().fold(f64::INFINITY, f64::min);
        let points = match request.max_deviation_m {
            Some(deviation_m) => graded(deviation_m, lowest_m, request.quick),
            None => grids(shape, &FACTORS[..most]),
        };
        Self {
            tolerance,
            points,
            nodes: map_nodes(request),
            points_present: present.grid,
            seconds: present.seconds,
        }
    }

    /// The points of the refined run: on a grid twice as fine as the finest of the ladder where that has points enough to
    /// interpolate, else its own.
    pub fn refined_points(&self) -> Points {
        match self.points[self.points.len() - 1].points {
            Points::Grid(samples) => Points::Grid(samples.map(|n| scaled(n, 2.0))),
            Points::Graded {
                max_deviation_m,
                lowest_m,
                ..
            } => Points::Graded {
                max_deviation_m: 0.125 * max_deviation_m,
                lowest_m,
                widest_m: (lowest_m > 0.0).then_some(lowest_m / 40.0),
            },
        }
    }

    /// Drops settings until the estimate is within `bound_s`; what is in force now stays.
    pub fn shorten(&mut self, bound_s: f64, effort: &Effort) -> Estimate {
        loop {
            let estimate = self.estimate(effort);
            if estimate.cpu_s <= bound_s || !self.drop_one() {
                return estimate;
            }
        }
    }

    /// Drops the most expensive setting that can be spared: first what is finer than now, then
    /// tolerances between, then points and nodes between.
    fn drop_one(&mut self) -> bool {
        if self
            .points
            .last()
            .is_some_and(|rung| !rung.present && rung.share > MANY)
        {
            self.points.pop();
        } else if self.nodes.last().is_some_and(|rung| !rung.present) {
            self.nodes.pop();
        } else if self.points.last().is_some_and(|rung| !rung.present) {
            self.points.pop();
        } else if self.tolerance.len() > 2 {
            self.tolerance.remove(self.tolerance.len() - 2);
        } else if self.nodes.len() > 3 {
            self.nodes.remove(0);
        } else if self.points.len() > 3 {
            self.points.remove(0);
        } else {
            return false;
        }
        true
    }

    fn estimate(&self, effort: &Effort) -> Estimate {
        let one = |own_s: f64| own_s + (own_s * effort.samples as f64).min(effort.enough_s);
        let of_points = |own_s: f64| -> f64 {
            let rungs = self.points.iter();
            rungs.map(|rung| one(own_s * rung.share)).sum()
        };
        let nodes = self.nodes.iter();
        let maps: f64 = nodes.map(|rung| one(self.seconds.map_s * rung.share)).sum();
        let tolerances = self.tolerance.len();
        let finest = 4.0 * self.points.last().map_or(1.0, |rung| rung.share);
        let places = (PLACES_OF_MAP * self.nodes.len()).pow(2) as f64
            / self.points_present.len().max(1) as f64;
        let per_tolerance = one(self.seconds.steel_s) + of_points(self.seconds.lambda_s) + maps;
        let reference = REFINED_STEEL * self.seconds.steel_s
            + finest * (self.seconds.points_s + REFINED_FORCES * self.seconds.forces_s)
            + REFINED_FORCES * places * self.seconds.forces_s
            + self.seconds.lambda_s;
        let cpu_s =
            reference + of_points(self.seconds.points_s) + tolerances as f64 * per_tolerance;
        let computations =
            1 + self.points.len() + tolerances * (1 + self.points.len() + self.nodes.len());
        Estimate {
            cpu_s,
            bound_s: 0.0,
            runs: tolerances * self.points.len() * self.nodes.len(),
            computations,
        }
    }

    /// The knobs as the result states them.
    pub fn knobs(&self, shape: &ShapeSource, design: &Design) -> Vec<Knob> {
        let tolerance = self.tolerance.iter().map(|rung| Setting {
            value: rung.value,
            paste: vec![format!("--tolerance {:e}", rung.value)],
            present: rung.present,
        });
        let points = self.points.iter().map(|rung| match rung.points {
            Points::Grid(samples) => Setting {
                value: samples[0] as f64,
                paste: paste_points(shape, samples),
                present: rung.present,
            },
            Points::Graded {
                max_deviation_m, ..
            } => Setting {
                value: max_deviation_m,
                paste: vec![format!("--max-deviation {}mm", mm(max_deviation_m))],
                present: rung.present,
            },
        });
        let workspace = &design.workspace;
        let axes = [workspace.x_m, workspace.y_m, workspace.z_m];
        let nodes = self.nodes.iter().map(|rung| Setting {
            value: rung.samples[0] as f64,
            paste: (["x", "y", "z"].iter().zip(axes).zip(rung.samples))
                .map(|((name, axis), samples)| key("workspace", name, axis, samples))
                .collect(),
            present: rung.present,
        });
        let graded = matches!(self.points[0].points, Points::Graded { .. });
        let of_points = if graded {
            KnobName::MaxDeviation
        } else {
            KnobName::Points
        };
        vec![
            Knob {
                name: KnobName::Tolerance,
                settings: tolerance.collect(),
            },
            Knob {
                name: of_points,
                settings: points.collect(),
            },
            Knob {
                name: KnobName::Nodes,
                settings: nodes.collect(),
            },
        ]
    }
}

fn paste_points(shape: &ShapeSource, samples: [usize; 2]) -> Vec<String> {
    let document = &shape.document;
    let axes = ["x", "y"].iter().zip([document.grid.x, document.grid.y]);
    let keys = axes.zip(samples).map(|((name, axis), samples)| match axis {
        AxisRequest::Given(axis) => Some(key("points", name, axis, samples)),
        AxisRequest::Extent(_) => None,
    });
    let keys: Option<Vec<String>> = keys.collect();
    // A surface given directly has no document to write them into.
    match keys.filter(|_| shape.input.is_some()) {
        Some(keys) => keys,
        None => vec![format!("--grid {}x{}", samples[0], samples[1])],
    }
}

fn key(section: &str, name: &str, axis: Axis, samples: usize) -> String {
    let (from, to) = (mm(axis.from), mm(axis.to));
    format!("{section}.{name}_mm = [{from:?}, {to:?}, {samples}]")
}

/// Millimetres without the rounding of the factor.
fn mm(length_m: f64) -> f64 {
    (length_m * 1e12).round() / 1e9
}

/// Samples of the design's own workspace.
pub fn present_samples(design: &Design) -> [usize; 3] {
    let workspace = &design.workspace;
    [workspace.x_m, workspace.y_m, workspace.z_m].map(|axis| axis.samples)
}

/// So many times the intervals, with the fewest samples that interpolate.
fn scaled(samples: usize, factor: f64) -> usize {
    if samples < FEWEST {
        return samples;
    }
    let intervals = (samples - 1) as f64 * factor;
    (intervals.round() as usize + 1).max(FEWEST)
}

fn tolerances(present: f64, asked: Option<f64>) -> Vec<ToleranceRung> {
    let (from, to) = (LOOSEST.log10(), present.log10());
    let mut rungs: Vec<ToleranceRung> = (0..TOLERANCES - 1)
        .map(|k| {
            let part = k as f64 / (TOLERANCES - 1) as f64;
            let value: f64 = format!("1e{}", (from + part * (to - from)).round())
                .parse()
                .unwrap_or(LOOSEST);
            ToleranceRung {
                value,
                asked: Some(value),
                present: false,
            }
        })
        .filter(|rung| rung.value > 1.5 * present)
        .collect();
    rungs.dedup_by(|a, b| a.value == b.value);
    rungs.push(ToleranceRung {
        value: present,
        asked,
        present: true,
    });
    rungs
}

fn grids(shape: &ShapeSource, factors: &[f64]) -> Vec<PointsRung> {
    let grid = &shape.document.grid;
    let present = [grid.x, grid.y].map(AxisRequest::samples);
    let mut rungs: Vec<PointsRung> = Vec::new();
    for factor in factors {
        let samples = present.map(|n| scaled(n, *factor));
        let rung = PointsRung {
            points: Points::Grid(samples),
            share: factor * factor,
            present: samples == present,
        };
        if rungs.last().is_none_or(|last| last.points != rung.points) {
            rungs.push(rung);
        }
    }
    rungs
}

fn graded(deviation_m: f64, lowest_m: f64, quick: bool) -> Vec<PointsRung> {
    let deviations = if quick { &DEVIATIONS[2..] } else { &DEVIATIONS };
    let rung = |factor: &f64| PointsRung {
        points: Points::Graded {
            max_deviation_m: factor * deviation_m,
            lowest_m,
            widest_m: None,
        },
        share: 1.0 / factor,
        present: *factor == 1.0,
    };
    deviations.iter().map(rung).collect()
}

fn most_factors(request: &BenchRequest) -> usize {
    if request.quick { QUICK } else { FACTORS.len() }
}

/// The nodes of all maps, from few to many, before any is left out.
pub fn map_nodes(request: &BenchRequest) -> Vec<NodesRung> {
    let design = request.design;
    let factors = &FACTORS[..most_factors(request).min(OF_MAPS)];
    let present = present_samples(design);
    let count = |samples: [usize; 3]| samples.iter().map(|n| *n as f64).product::<f64>();
    let mut rungs: Vec<NodesRung> = Vec::new();
    for factor in factors {
        let samples = present.map(|n| scaled(n, *factor));
        if rungs.last().is_none_or(|last| last.samples != samples) {
            rungs.push(NodesRung {
                samples,
                share: count(samples) / count(present),
                present: samples == present,
            });
        }
    }
    rungs
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tolerances_fall_from_loose_to_the_present_one() {
        let values = |present: f64| -> Vec<f64> {
            let rungs = tolerances(present, None);
            assert!(rungs.last().unwrap().present && rungs.last().unwrap().asked.is_none());
            rungs.iter().map(|rung| rung.value).collect()
        };
        assert_eq!(values(1e-4), [1e-1, 1e-2, 1e-3, 1e-4]);
        assert_eq!(values(1e-6), [1e-1, 1e-3, 1e-4, 1e-6]);
        assert_eq!(values(0.06), [1e-1, 0.06]);
        assert_eq!(values(0.07), [0.07]);
        assert_eq!(values(0.1), [0.1]);
    }

    #[test]
    fn samples_scale_by_their_intervals() {
        assert_eq!(scaled(61, 0.5), 31);
        assert_eq!(scaled(61, 2.0), 121);
        assert_eq!(scaled(7, 0.125), FEWEST);
        assert_eq!(scaled(1, 2.0), 1);
    }
}
