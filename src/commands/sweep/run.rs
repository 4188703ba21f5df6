//! `sweep run`: computes the points that are missing.

use std::ops::Range;
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

use rayon::prelude::*;

use super::plan::{shape_inputs, shapes};
use super::point::Sweep;
use crate::RunError;
use crate::bundle::atomic::WriteError;
use crate::bundle::read_bounded::digest_plain;
use crate::bundle::sweep::{PlanFile, PointFile, PointStore, Status, StoredPoint};
use crate::progress::{Progress, to_its_end};
use crate::scene::cost::Cost;
use crate::scene::sources::ShapeSource;

/// The largest file that a plan names, bytes.
const FILE_MAX_BYTES: u64 = 8 << 30;

/// The counts of a run.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RunReport {
    /// Requested points.
    pub points: u64,
    /// Points that were there.
    pub kept: u64,
    /// Points whose design cannot be computed, those that were there included.
    pub failed: u64,
    /// Points that miss the requested accuracy.
    pub inaccurate: u64,
    /// The first that failed, and why.
    pub first_failure: Option<(u64, String)>,
}

/// The time that the points `indices` of `plan` take, like the middle one of them.
///
/// # Errors
/// Documents that cannot be read.
pub fn cost(plan: &PlanFile, indices: &Range<u64>) -> Result<Option<Cost>, RunError> {
    let shapes = plan.array.as_ref().map_or(Ok(Vec::new()), shapes)?;
    let points = indices.end - indices.start;
    let middle = indices.start + points / 2;
    Ok(Sweep::new(plan, shapes)?.cost(middle, points))
}

/// Computes the points `indices` of `plan` into `folder`, in parallel, each into its own file.
/// Points that are there are kept, unless `force` requests them again.
///
/// # Errors
/// Inputs that have changed since the plan was made; a folder or file that belongs to something
/// else; a file that cannot be written; interruption, after which the same call goes on.
pub fn run(
    plan: &PlanFile,
    folder: &Path,
    indices: Range<u64>,
    force: bool,
    progress: &dyn Progress,
) -> Result<RunReport, RunError> {
    let shapes = plan.array.as_ref().map_or(Ok(Vec::new()), shapes)?;
    check_inputs(plan, &shapes)?;
    let sweep = Sweep::new(plan, shapes)?;
    let store = PointStore::new(folder);
    let _folders = store.claim(plan, force, indices.clone())?;
    let points = indices.end - indices.start;
    let (kept, failed, inaccurate) = (AtomicU64::new(0), AtomicU64::new(0), AtomicU64::new(0));
    let first_failure: Mutex<Option<(u64, String)>> = Mutex::new(None);
    progress.begin("points", points);
    indices
        .into_par_iter()
        .try_for_each(|index| -> Result<(), RunError> {
            progress.check()?;
            let there = if force {
                None
            } else {
                finished(&store, plan, index)?
            };
            let point = match there {
                Some(point) => {
                    kept.fetch_add(1, Ordering::Relaxed);
                    point
                }
                None => {
                    let point = sweep.point(index);
                    // Also after a stop: what was finished is kept.
                    to_its_end(|| store.write(&point, force))?;
                    point
                }
            };
            match point.status {
                Status::Done => {}
                Status::AccuracyNotReached => {
                    inaccurate.fetch_add(1, Ordering::Relaxed);
                }
                Status::Infeasible | Status::Unbounded | Status::Failed => {
                    failed.fetch_add(1, Ordering::Relaxed);
                    let message = point.message.unwrap_or_default();
                    // Nothing under the lock leaves the value half changed.
                    let mut first = first_failure
                        .lock()
                        .unwrap_or_else(std::sync::PoisonError::into_inner);
                    if first.as_ref().is_none_or(|(other, _)| index < *other) {
                        *first = Some((index, message));
                    }
                }
            }
            progress.advance(1);
            Ok(())
        })?;
    progress.end();
    Ok(RunReport {
        points,
        kept: kept.into_inner(),
        failed: failed.into_inner(),
        inaccurate: inaccurate.into_inner(),
        first_failure: first_failure
            .into_inner()
            .unwrap_or_else(std::sync::PoisonError::into_inner),
    })
}

fn finished(
    store: &PointStore,
    plan: &PlanFile,
    index: u64,
) -> Result<Option<PointFile>, RunError> {
    match store.find(&plan.plan_sha256, index)? {
        StoredPoint::Point(point) => Ok(Some(*point)),
        StoredPoint::Nothing => Ok(None),
        StoredPoint::Foreign(reason) => Err(WriteError::OutputExists {
            path: store.path(index),
            reason,
        }
        .into()),
    }
}

/// Tables, meshes, shapes and surfaces are those that the plan was made with.
fn check_inputs(plan: &PlanFile, shapes: &[ShapeSource]) -> Result<(), RunError> {
    let of_shapes = shape_inputs(shapes);
    for input in plan.inputs.iter().skip(1) {
        let known = of_shapes.iter().find(|now| now.path == input.path);
        let now = match known {
            Some(now) => now.sha256.clone(),
            None => digest_plain(Path::new(&input.path), FILE_MAX_BYTES)
                .map(|(_, sha256)| sha256)
                .map_err(|error| {
                    RunError::Input(format!("{}: cannot be read: {error}", input.path))
                })?,
        };
        if now != input.sha256 {
            return Err(RunError::Input(format!(
                "{}: the file has changed since the plan was made; make the plan again with \
                 `fluxform sweep plan`",
                input.path
            )));
        }
    }
    Ok(())
}
