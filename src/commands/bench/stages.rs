//! The stages of a run, each measured on its own.

use super::BenchRequest;
use super::clock::{Effort, measure};
use super::ladder::{Ladders, Points, Present, Seconds, map_nodes, present_samples};
use crate::RunError;
use crate::bundle::lambda_file::LambdaFile;
use crate::commands::calibrate::DEFAULT_REACH_M;
use crate::commands::calibrate::needed_coils;
use crate::commands::calibrate::needed_nodes;
use crate::commands::discretize::scattered;
use crate::commands::discretize::{self, PointsReport};
use crate::commands::lambda::{ForcePoints, LambdaOptions, resolving, solve_at};
use crate::map::Components;
use crate::progress::Progress;
use crate::scene::cached_field::ShapeField;
use crate::scene::maps::{MagnetMean, SceneMap, check_nodes};
use crate::scene::sources::Sampling;
use crate::scene::sources::ShapeSource;
use crate::scene::steel::{self, Solved};
use crate::scene::{MAGNET_SHARE, Scene};
use crate::shape::ShapeError;
use crate::shape::document::ShapeDocument;
use crate::shape::points::ConstraintPoints;

/// Steel as forces and as maps ask for it.
pub struct BothSolved {
    /// For forces at points.
    pub forces: Solved,
    /// For maps.
    pub map: Solved,
}

/// Passes on a request to stop, and nothing else: the bar shows the whole, not a stage of it.
struct Within<'a>(&'a dyn Progress);

impl Progress for Within<'_> {
    fn interrupted(&self) -> bool {
        self.0.interrupted()
    }
}

/// Common inputs of the stages.
pub struct Bench<'a> {
    /// The scene.
    pub scene: &'a Scene<'a>,
    /// The request.
    pub request: &'a BenchRequest<'a>,
    effort: Effort,
    progress: &'a dyn Progress,
}

impl<'a> Bench<'a> {
    /// For one scene.
    pub fn new(
        scene: &'a Scene<'a>,
        request: &'a BenchRequest<'a>,
        effort: Effort,
        progress: &'a dyn Progress,
    ) -> Self {
        Self {
            scene,
            request,
            effort,
            progress,
        }
    }

    /// Runs `work` as often as the effort says; its last result and the processor time of one call.
    fn timed<T>(
        &self,
        work: impl Fn(&dyn Progress) -> Result<T, RunError>,
    ) -> Result<(T, f64), RunError> {
        self.progress.check()?;
        let within = Within(self.progress);
        let (result, timing) = measure(&self.effort, || work(&within))?;
        self.progress.advance(1);
        Ok((result, timing.seconds))
    }

    /// Whether the user asked to stop.
    ///
    /// # Errors
    /// Where so.
    pub fn check(&self) -> Result<(), RunError> {
        Ok(self.progress.check()?)
    }

    /// One more computation is done.
    pub fn advance(&self) {
        self.progress.advance(1);
    }

    /// For computations inside this one.
    pub fn within(&self) -> impl Progress {
        Within(self.progress)
    }

    /// The steel, if there is any, to the accuracy that was `requested`, if any was.
    pub fn steel(&self, requested: Option<f64>) -> Result<(BothSolved, f64), RunError> {
        let scene = &self.scene.to_tolerance(requested);
        let lowest_m = scene.design.workspace.z_m.from;
        self.timed(|_| {
            let map = steel::solve(scene, scene.tolerances.map, lowest_m)?;
            let forces = map.for_forces(scene, lowest_m)?;
            Ok(BothSolved { forces, map })
        })
    }

    /// The points of one setting.
    pub fn points(
        &self,
        document: &ShapeDocument,
        points: Points,
        progress: &dyn Progress,
    ) -> Result<ForcePoints, RunError> {
        match points {
            Points::Grid(samples) => {
                let document = document.with_samples(samples);
                let report = discretize::run(&document, Vec::new(), progress)?;
                Ok(ForcePoints::of_object(
                    &report,
                    self.request.lambda.weights_of(&report),
                    &self.scene.design.workspace,
                ))
            }
            Points::Graded {
                max_deviation_m,
                lowest_m,
                widest_m,
            } => {
                let asked = Sampling::Adaptive {
                    max_deviation_m,
                    widest_m,
                };
                let how = resolving(asked, lowest_m);
                let report = scattered::run(document, Vec::new(), how, progress)?;
                ForcePoints::of_scattered(&report)
            }
        }
    }

    /// The points of every setting; one that meets none of the surface is dropped, unless it is in force now.
    pub fn all_points(
        &self,
        shape: &ShapeSource,
        ladders: &mut Ladders,
    ) -> Result<Vec<(ForcePoints, f64)>, RunError> {
        let mut all = Vec::new();
        let mut kept = Vec::new();
        for rung in &ladders.points {
            let found = self.timed(|within| self.points(&shape.document, rung.points, within));
            match found {
                Ok(points) => {
                    all.push(points);
                    kept.push(*rung);
                }
                Err(RunError::Shape {
                    source: ShapeError::NoPoint { .. },
                    ..
                }) if !rung.present => {}
                Err(error) => return Err(error),
            }
        }
        ladders.points = kept;
        Ok(all)
    }

    /// Forces at the points, and the force constants.
    pub fn lambda(
        &self,
        solved: &BothSolved,
        points: &ForcePoints,
    ) -> Result<(LambdaFile, f64), RunError> {
        let options = LambdaOptions {
            tolerance: Some(solved.forces.tolerance),
            ..self.request.lambda.clone()
        };
        let (scene, none) = (self.scene, ShapeField::default());
        self.timed(|within| {
            let report = solve_at(scene, &solved.forces, none, points, &options, within)?;
            Ok(report.file)
        })
    }

    /// The map of the coils that carry current, as far as the object's points need it.
    pub fn map(
        &self,
        solved: &BothSolved,
        points: &ConstraintPoints,
        samples: [usize; 3],
    ) -> Result<(SceneMap, f64), RunError> {
        let design = self.scene.design.with_nodes(samples);
        let grid = needed_nodes(&design, points, DEFAULT_REACH_M);
        let coils = needed_coils(self.scene);
        let components = if self.scene.tilted() {
            Components::Gradient
        } else {
            Components::Gz
        };
        self.timed(|within| {
            let solved = &solved.map;
            let share = MAGNET_SHARE * solved.tolerance;
            let felt = MagnetMean::by_magnet(self.scene, &grid.z_m, share)?;
            SceneMap::new(self.scene, solved, &coils, &grid, components, &felt, within)
        })
    }

    /// The present points of one object, and how long they take, s.
    ///
    /// # Errors
    /// Points outside the workspace; those whose maps have nodes too close to steel.
    pub fn present_points(&self, shape: &ShapeSource) -> Result<(PointsReport, f64), RunError> {
        let timed = self.timed(|within| discretize::run(&shape.document, Vec::new(), within))?;
        let points = &timed.0.discretized.points;
        self.inside(&shape.document.name, points)?;
        self.off_steel(&shape.document.name, points)?;
        Ok(timed)
    }

    /// One object at the present settings.
    ///
    /// # Errors
    /// Those of the stages.
    pub fn present(&self, (report, points_s): (PointsReport, f64)) -> Result<Present, RunError> {
        let grid = report.discretized.points.clone();
        let (solved, steel_s) = self.steel(self.request.lambda.tolerance)?;
        let points = ForcePoints::of_object(
            &report,
            self.request.lambda.weights_of(&report),
            &self.scene.design.workspace,
        );
        let (_, lambda_s) = self.lambda(&solved, &points)?;
        let at_points =
            || (self.scene).forces_n_per_a(&solved.forces, &points.positions_m, &self.within());
        let (_, forces) = measure(&self.effort, at_points)?;
        let samples = present_samples(self.scene.design);
        let (_, map_s) = self.map(&solved, &grid, samples)?;
        Ok(Present {
            seconds: Seconds {
                steel_s,
                points_s,
                lambda_s,
                forces_s: forces.seconds,
                map_s,
            },
            grid,
        })
    }

    /// Refuses maps with nodes at which the field of steel is not resolved.
    fn off_steel(&self, shape: &str, points: &ConstraintPoints) -> Result<(), RunError> {
        let share = MAGNET_SHARE * self.scene.tolerances.map;
        for rung in map_nodes(self.request) {
            let design = self.request.design.with_nodes(rung.samples);
            let grid = needed_nodes(&design, points, DEFAULT_REACH_M);
            let magnet = MagnetMean::by_magnet(self.scene, &grid.z_m, share)?;
            check_nodes(self.scene, &grid, &magnet).map_err(|error| {
                let [x, y, z] = rung.samples;
                RunError::Input(format!(
                    "shape {shape:?}: its map with {x} x {y} x {z} nodes in [workspace]: {error}; let z_mm of \
                     [workspace] begin higher"
                ))
            })?;
        }
        Ok(())
    }

    /// Refuses points where a runtime has no map.
    fn inside(&self, shape: &str, points: &ConstraintPoints) -> Result<(), RunError> {
        let workspace = &self.scene.design.workspace;
        let axes = [workspace.x_m, workspace.y_m, workspace.z_m];
        for k in 0..points.len() {
            let place = [points.x_m[k], points.y_m[k], points.height_m[k]];
            let within = axes.iter().zip(place);
            if !within
                .into_iter()
                .all(|(axis, v)| axis.from <= v && v <= axis.to)
            {
                let [x, y, z] = place.map(|v| (v * 1e9).round() / 1e6);
                return Err(RunError::Input(format!(
                    "shape {shape:?}: the point x = {x} mm, y = {y} mm, z = {z} mm lies outside the \
                     design's [workspace], where there is no map to compare with; enlarge \
                     [workspace] or move the object"
                )));
            }
        }
        Ok(())
    }
}
