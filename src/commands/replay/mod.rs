//! `replay`: what a runtime does along a trajectory, from a bundle alone.
//!
//! A position is held until the next one is measured. Its row states the end of that time: with
//! `dynamics` the currents are then as far as their circuit has let them come, without it they are
//! the commanded ones.

pub(crate) mod command;
mod felt;
pub mod output;
mod plausible;
pub mod renderer;
pub mod summary;
pub mod synthesize;
mod text;

use std::path::{Path, PathBuf};

use crate::RunError;
use crate::bundle::artefact::Input;
use crate::bundle::load::Bundle;
use crate::bundle::replay::{Answer, ReplayRows};
use crate::bundle::trajectory::Trajectory;
use crate::coil::drive::Drive;
use crate::commands::calibrate::DESIGN_FILE;
use crate::design::{Design, Driver, Need};
use crate::progress::Progress;
use felt::Felt;
use renderer::{Renderer, RendererError, Step};
use summary::{DynamicsSummary, ReplaySummary, TrajectorySource};
use synthesize::Synthesis;

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
/// Positions that must be millimetres; `dynamics` on a bundle without inductances; interruption.
pub fn run(
    opened: &Opened,
    trajectory: &Trajectory,
    source: TrajectorySource,
    dynamics: bool,
    progress: &dyn Progress,
) -> Result<ReplayReport, RunError> {
    let mut renderer = opened.renderer.clone();
    let ends_m = renderer.map().ends_m();
    if plausible::in_millimetres(trajectory, &ends_m) {
        return Err(RunError::Input(format!(
            "{}: no position lies inside the map, but a thousandth of them would: they are in \
             millimetres; x_m, y_m and z_m must be in metres",
            source.source
        )));
    }
    let mut drive = dynamics.then(|| opened.drive()).transpose()?;
    let bandwidth_hz = opened.bandwidth_hz();
    let warnings = plausible::warnings(trajectory, &ends_m);
    progress.take_seconds();
    let coils = renderer.coils();
    let mut steps: Vec<Step> = Vec::with_capacity(trajectory.len());
    let mut commanded_a = vec![0.0; trajectory.len() * coils];
    // The loop that is timed: what a runtime does, and nothing else.
    progress.begin("replay", trajectory.len() as u64);
    for portion in 0..trajectory.len().div_ceil(PORTION) {
        progress.check()?;
        let rows = portion * PORTION..((portion + 1) * PORTION).min(trajectory.len());
        for row in rows {
            let currents = &mut commanded_a[row * coils..(row + 1) * coils];
            steps.push(renderer.step(trajectory.position_m[row], currents));
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
    let mut follower = Follower {
        renderer,
        fixed_a: opened
            .bundle
            .currents
            .iter()
            .map(|row| row.current_a)
            .collect(),
        bounds: summary::Bounds::of(&opened.bundle),
        bandwidth_hz,
        felt: opened.felt(trajectory.len()),
    };
    let rows = follower.rows(trajectory, &steps, commanded_a, drive.as_mut(), progress)?;
    let felt = follower.felt.as_ref().and_then(Felt::summary);
    let mut summary =
        ReplaySummary::new(opened, source, &rows, dynamics, &follower.bounds, warnings);
    summary.force.felt = felt;
    Ok(ReplayReport {
        rows,
        summary,
        step_s,
        seconds,
    })
}

/// Goes through the positions again for the numbers that a runtime has no time for.
struct Follower {
    renderer: Renderer,
    /// The bundle's static currents.
    fixed_a: Vec<f64>,
    bounds: summary::Bounds,
    /// That of the current loop, Hz, where the drivers close one.
    bandwidth_hz: Option<f64>,
    /// Where currents are chosen for uncertainties.
    felt: Option<Felt>,
}

impl Follower {
    fn rows(
        &mut self,
        trajectory: &Trajectory,
        steps: &[Step],
        commanded_a: Vec<f64>,
        mut drive: Option<&mut Drive>,
        progress: &dyn Progress,
    ) -> Result<ReplayRows, RunError> {
        let coils = self.renderer.coils();
        let held_s = trajectory.held_s();
        let mut rows = ReplayRows {
            coils,
            t_s: trajectory.t_s.clone(),
            position_m: trajectory.position_m.clone(),
            ..ReplayRows::default()
        };
        let mut flowing = vec![0.0; coils];
        let mut again = vec![0.0; coils];
        for (row, step) in steps.iter().enumerate() {
            if row % PORTION == 0 {
                progress.check()?;
            }
            let position = trajectory.position_m[row];
            let command = &commanded_a[row * coils..(row + 1) * coils];
            self.renderer.step(position, &mut again);
            flowing.copy_from_slice(command);
            if let Some(drive) = &mut drive {
                if row == 0 {
                    drive.settle(command);
                }
                match self.bandwidth_hz {
                    None => drive.hold(command, held_s[row]),
                    Some(bandwidth_hz) => drive.track(command, held_s[row], bandwidth_hz),
                }
                drive.currents(&mut flowing);
            }
            let per_ampere = self.renderer.force_n_per_a();
            let inside = step.answer != Answer::Outside;
            let force = |currents: &[f64]| -> f64 {
                let terms = per_ampere.iter().zip(currents);
                let sum: f64 = terms.map(|(g, i)| g * i).sum();
                if inside { sum + step.passive_n } else { 0.0 }
            };
            rows.height_m.push(step.height_m);
            rows.wanted_force_n.push(step.wanted_n);
            rows.force_n.push(if drive.is_some() {
                force(&flowing)
            } else {
                step.force_n
            });
            if let Some(sideways) = step.sideways {
                rows.wanted_sideways_n.push(sideways.wanted_n);
                rows.sideways_n.push(if drive.is_some() && inside {
                    let vectors = self.renderer.force_vectors_n_per_a();
                    [0, 1].map(|axis| {
                        let terms = vectors.iter().zip(&flowing);
                        terms.map(|(g, i)| g[axis] * i).sum()
                    })
                } else {
                    sideways.force_n
                });
            }
            rows.static_force_n.push(force(&self.fixed_a));
            rows.answer.push(step.answer);
            rows.current_a.extend(&flowing);
            if inside {
                let certificate = self.renderer.certificate(step, command);
                let largest = self.renderer.map().largest_near_n_per_a(position[2]);
                self.bounds.add(certificate, largest, &flowing);
                if let Some(felt) = &mut self.felt {
                    felt.add(&self.renderer, position, step, command);
                }
            }
        }
        if drive.is_some() {
            rows.commanded_a = commanded_a;
        }
        Ok(rows)
    }
}
