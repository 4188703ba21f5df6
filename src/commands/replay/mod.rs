//! `replay`: what a runtime does along a trajectory, from a bundle alone.
//!
//! A position is held until the next one is measured. Its row states the end of that time: with
//! `dynamics` the currents are then as far as their circuit has let them come, without it they are
//! the commanded ones. The summary is of all that time.

pub(crate) mod command;
mod felt;
mod follow;
pub mod output;
pub(crate) mod page;
mod plausible;
pub mod renderer;
pub mod summary;
pub mod synthesize;
mod text;

use std::path::{Path, PathBuf};

use crate::RunError;
use crate::bundle::artefact::Input;
use crate::bundle::load::Bundle;
use crate::bundle::replay::ReplayRows;
use crate::bundle::trajectory::Trajectory;
use crate::coil::drive::Drive;
use crate::commands::calibrate::DESIGN_FILE;
use crate::design::{Design, Driver, MagnetModel, Need};
use crate::lambda::two_fingers::FingerMagnet;
use crate::progress::Progress;
use crate::scene::finger_magnet;
use crate::scene::steel::SMALLER_CURRENTS;
use crate::scene::working_point::SUPERPOSITION_WARNING;
use felt::Felt;
use follow::{Follower, Steps};
use page::Below;
use renderer::{Renderer, RendererError};
use summary::{DynamicsSummary, ReplaySummary, TrajectorySource};
use synthesize::Synthesis;

/// Of a lone coil in the drawing of a bundle that holds no design.
const UNKNOWN_RADIUS_M: f64 = 0.01;
/// Positions between two looks at the interruption flag.
const PORTION: usize = 4096;

/// A bundle made ready.
#[derive(Debug, Clone)]
pub struct Opened {
    /// The bundle, its checksums checked.
    pub bundle: Bundle,
    /// Its manifest's entry among the inputs.
    pub input: Input,
    /// One step of the runtime.
    pub renderer: Renderer,
}

impl Opened {
    /// Opens the bundle at `path` and checks everything in it.
    ///
    /// # Errors
    /// A bundle that was changed, damaged or written by a newer program; one without a force
    /// constant.
    pub fn new(path: &Path) -> Result<Self, RunError> {
        let bundle = Bundle::open(path)?;
        let renderer = Renderer::new(&bundle).map_err(|error| {
            let message = format!("{}: {error}", bundle.folder.display());
            match error {
                RendererError::NoForceConstant => RunError::NoForceConstant(format!(
                    "{message}; see lambda.json there, and calibrate with other limits or another \
                     shape"
                )),
                RendererError::Circuit(_)
                | RendererError::Points
                | RendererError::NoUncertainty => RunError::Input(message),
            }
        })?;
        let input = Input {
            path: bundle.folder.join("manifest.json").display().to_string(),
            sha256: bundle.manifest_sha256.clone(),
        };
        Ok(Self {
            bundle,
            input,
            renderer,
        })
    }

    /// With currents chosen for the uncertainties that the bundle was made with.
    ///
    /// # Errors
    /// A bundle made without any.
    pub fn robust(mut self) -> Result<Self, RunError> {
        self.renderer = Renderer::robust(&self.bundle).map_err(|error| {
            RunError::Input(format!(
                "{}: {error}; calibrate again with [uncertainty] in the design, or with --sensor-error 4mm",
                self.bundle.folder.display()
            ))
        })?;
        Ok(self)
    }

    /// For two fingers.
    ///
    /// # Errors
    /// A bundle without a copy of its design, which has the magnets; one whose currents are chosen for
    /// uncertainties.
    fn for_two_fingers(&self) -> Result<(Renderer, FingerMagnet, MagnetModel), RunError> {
        let name = self.bundle.folder.display();
        if self.renderer.setting().is_some() {
            return Err(RunError::Input(
                "currents chosen for uncertainties are those of one finger; leave --robust out with two".to_owned(),
            ));
        }
        let (design, _) = Design::read(&self.bundle.folder.join(DESIGN_FILE), Need::SWEEP)
            .map_err(|error| RunError::Input(format!(
                "{name}: two fingers push each other as their magnets do, which the bundle's design must say: {error}"
            )))?;
        let magnet = finger_magnet(&design);
        let renderer = Renderer::two_fingers(&self.bundle, magnet.moment_a_m2)
            .map_err(|error| RunError::Input(format!("{name}: {error}")))?;
        Ok((renderer, magnet, design.magnet.model))
    }

    /// The bundle's files, its seconds, which no manifest lists, among them.
    #[must_use]
    pub fn files(&self) -> Vec<PathBuf> {
        let listed = self.bundle.manifest.files.iter();
        let listed = listed.map(|file| file.path.as_str());
        let all = ["manifest.json", "timing.json"].into_iter().chain(listed);
        all.map(|name| self.bundle.folder.join(name)).collect()
    }

    /// A made-up trajectory over the bundle's object.
    #[must_use]
    pub fn synthesize(&self, synthesis: &Synthesis) -> Trajectory {
        synthesis.trajectory(self.renderer.heights(), self.renderer.map())
    }

    /// The array, as far as the bundle states it.
    fn below(&self) -> Below<'_> {
        let positions_m = &self.bundle.manifest.array.positions_m[..];
        let design = Design::read(&self.bundle.folder.join(DESIGN_FILE), Need::SWEEP);
        let apart = |[a, b]: [&[f64; 2]; 2]| (a[0] - b[0]).hypot(a[1] - b[1]);
        let halves = positions_m.iter().flat_map(|a| {
            let others = positions_m.iter().filter(move |b| *b != a);
            others.map(move |b| 0.5 * apart([a, b]))
        });
        let known = design
            .ok()
            .and_then(|(design, _)| Some(0.5 * design.coil?.outer_diameter_m));
        Below {
            positions_m,
            outer_radius_m: known
                .unwrap_or_else(|| halves.reduce(f64::min).unwrap_or(UNKNOWN_RADIUS_M)),
        }
    }

    /// Bandwidth of the current loop that the bundle's design has, Hz.
    fn bandwidth_hz(&self) -> Option<f64> {
        let path = self.bundle.folder.join(DESIGN_FILE);
        let (design, _) = Design::read(&path, Need::SWEEP).ok()?;
        match design.supply.driver {
            Driver::Voltage => None,
            Driver::Current => Some(design.supply.bandwidth_hz),
        }
    }

    /// The sums of the felt error along so many positions, where currents are chosen for uncertainties.
    fn felt(&self, positions: usize) -> Option<Felt> {
        self.renderer.setting()?;
        let study = self.bundle.lambda.uncertainty.as_ref()?;
        let ohm = &self.bundle.map.runtime.resistance_ohm;
        Some(Felt::new(study.given, ohm, positions))
    }

    /// A sentence where smaller currents give another force per ampere than the bundle's.
    fn of_smaller_currents(&self) -> Option<String> {
        let stage = self.bundle.manifest.accuracy.get(SMALLER_CURRENTS)?;
        (stage.estimate >= SUPERPOSITION_WARNING).then(|| {
            format!(
                "the forces per ampere are those of cores at the largest currents: of smaller ones they are up to {:.2} % \
                 off, which the stated error of the forces allows for; set supply.current_max_a near the currents used \
                 and calibrate again",
                100.0 * stage.estimate
            )
        })
    }

    /// The circuit of the bundle's coils, without current.
    fn drive(&self) -> Result<Drive, RunError> {
        let name = self.bundle.folder.display();
        let Some(rendering) = &self.bundle.map.runtime.rendering else {
            return Err(RunError::Input(format!(
                "{name}: holds no inductances (schema {}, they came with 1.2.0), which --dynamics \
                 needs; calibrate again",
                self.bundle.manifest.schema_version
            )));
        };
        Drive::new(
            &rendering.inductance_h,
            &self.bundle.map.runtime.resistance_ohm,
            rendering.voltage_v,
        )
        .map_err(|error| RunError::Input(format!("{name}: {error}")))
    }
}

/// The result of a replay.
#[derive(Debug, Clone)]
pub struct ReplayReport {
    /// The table.
    pub rows: ReplayRows,
    /// Its summary: the JSON result.
    pub summary: ReplaySummary,
    /// Mean seconds of a step of the loop; `None` where nobody measures.
    pub step_s: Option<f64>,
    /// Seconds of every stage.
    pub seconds: Vec<(String, f64)>,
}

/// Replays `trajectory`, which is from `source`.
///
/// # Errors
/// Positions that must be millimetres; two fingers whose magnets would overlap; `dynamics` on a bundle without
/// inductances; interruption.
pub fn run(
    opened: &Opened,
    trajectory: &Trajectory,
    source: TrajectorySource,
    dynamics: bool,
    progress: &dyn Progress,
) -> Result<ReplayReport, RunError> {
    let two = !trajectory.second_m.is_empty();
    let mut renderer = opened.renderer.clone();
    let ends_m = renderer.map().ends_m();
    if plausible::in_millimetres(trajectory, &ends_m) {
        return Err(RunError::Input(format!(
            "{}: no position lies inside the map, but a thousandth of them would: they are in \
             millimetres; x_m, y_m and z_m must be in metres",
            source.source
        )));
    }
    let mut cylinders = None;
    if two {
        let (for_two, magnet, model) = opened.for_two_fingers()?;
        if let Some(touching) = plausible::touching(trajectory, &magnet) {
            return Err(RunError::Input(format!("{}: {touching}", source.source)));
        }
        renderer = for_two;
        cylinders = (model == MagnetModel::Cylinder).then_some(magnet);
    }
    let mut drive = dynamics.then(|| opened.drive()).transpose()?;
    let bandwidth_hz = opened.bandwidth_hz();
    let warnings = plausible::warnings(trajectory, &ends_m)
        .into_iter()
        .chain(opened.of_smaller_currents())
        .collect();
    progress.take_seconds();
    let coils = renderer.coils();
    let mut steps: Vec<Steps> = Vec::with_capacity(trajectory.len());
    let mut commanded_a = vec![0.0; trajectory.len() * coils];
    // The loop that is timed: what a runtime does, and nothing else.
    progress.begin("replay", trajectory.len() as u64);
    for portion in 0..trajectory.len().div_ceil(PORTION) {
        progress.check()?;
        let rows = portion * PORTION..((portion + 1) * PORTION).min(trajectory.len());
        for row in rows {
            let currents = &mut commanded_a[row * coils..(row + 1) * coils];
            steps.push(Steps::take(&mut renderer, trajectory, row, currents));
        }
    }
    progress.end();
    let seconds = progress.take_seconds();
    let step_s = seconds
        .iter()
        .find(|(stage, _)| stage == "replay")
        .map(|(_, seconds)| seconds / trajectory.len().max(1) as f64);
    let dynamics = drive
        .as_ref()
        .map(|drive| DynamicsSummary::of(drive, &opened.bundle, bandwidth_hz));
    let mut follower = Follower::new(opened, renderer, bandwidth_hz, &steps);
    follower.cylinders = cylinders;
    let followed = follower.rows(trajectory, &steps, commanded_a, drive.as_mut(), progress)?;
    let pushed_n = follower.pushed_n;
    let felt = follower.felt.as_ref().and_then(Felt::summary);
    let mut summary = ReplaySummary::new(
        opened,
        source,
        &followed,
        dynamics,
        &follower.bounds,
        warnings,
    );
    summary.force.felt = felt;
    summary.warn_of_forces(follower.bounds.off_dipoles_n);
    if let Some(two) = &mut summary.two_fingers {
        two.magnets_force_n = pushed_n;
    }
    Ok(ReplayReport {
        rows: followed.rows,
        summary,
        step_s,
        seconds,
    })
}
