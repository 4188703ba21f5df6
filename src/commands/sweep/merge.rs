//! `sweep merge`: the points of a plan as one table, and what is best among them.

use std::collections::BTreeSet;
use std::io::{self, Write};
use std::ops::Range;
use std::path::{Path, PathBuf};

use rayon::prelude::*;
use serde::Serialize;

use crate::RunError;
use crate::bundle::artefact::{FLUXFORM_VERSION, FileEntry, Input, SCHEMA_VERSION};
use crate::bundle::atomic::{FileSet, Overwrite, WriteError, Written};
use crate::bundle::read_bounded::read_plain;
use crate::bundle::seal::to_record;
use crate::bundle::sweep::{
    ArrayMerit, ArrayRow, MergeSummary, Mode, PlanFile, PointFile, PointStore, StoredPoint,
    TableWriter, columns, value_text,
};
use crate::design::message_text::shown_path;
use crate::design::template::Template;
use crate::numerics::front::front;
use crate::plot::landscape::Landscape;
use crate::plot::pareto::{Panel, ParetoPlot};
use crate::progress::Progress;

mod landscape;
mod page;

pub(crate) use landscape::check_drawable;

/// Points read at a time.
const PORTION: u64 = 4096;
/// The largest sidecar, bytes.
const SIDECAR_MAX_BYTES: u64 = 1 << 20;
/// Ranges of missing points that are named.
const NAMED: usize = 10;
/// The costs that the ranking quantity is compared with: name, unit, column of the front's table.
const COSTS: [(&str, &str, &str); 3] = [
    ("resistance", "ohm", "front_resistance"),
    ("mass", "kg", "front_mass"),
    ("settling time", "s", "front_settling"),
];

/// The options of a merge.
#[derive(Debug, Clone)]
pub struct MergeRequest {
    /// Folders that `sweep run` wrote to; each point is taken from the first that has it.
    pub folders: Vec<PathBuf>,
    /// Merge what there is, even if points are missing.
    pub partial: bool,
    /// Whether a page is requested.
    pub page: bool,
    /// Whether a drawing over the keys is requested.
    pub landscape: bool,
}

/// Where the files go.
#[derive(Debug, Clone)]
pub struct MergeFiles {
    /// The table; plot, front and sidecar are beside it under its name.
    pub table: PathBuf,
    /// Replace what is there.
    pub force: bool,
}

impl MergeFiles {
    /// Table, plot, front and sidecar.
    #[must_use]
    pub fn paths(&self) -> [PathBuf; 4] {
        let stem = self.table.file_stem().unwrap_or_default().to_string_lossy();
        let beside = |suffix: &str| self.table.with_file_name(format!("{stem}{suffix}"));
        let table = self.table.clone();
        [
            table,
            beside(".svg"),
            beside("_pareto.csv"),
            beside("_merge.json"),
        ]
    }
}

/// A merged sweep.
#[derive(Debug, Clone, PartialEq)]
pub struct MergeReport {
    /// The content of the sidecar.
    pub summary: MergeSummary,
    /// Which points are missing, as text; empty where none is.
    pub missing: String,
    /// The page, if one was requested.
    pub page: Option<String>,
    /// The ranking quantity over the keys, if its drawing was requested.
    pub landscape: Option<Landscape>,
    /// The best design, of those that meet their limits where there are any.
    pub best: Option<SweepBest>,
}

/// The best design of a sweep: the strongest, or where arrays are searched the one of the largest mean force constant.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SweepBest {
    /// Its index in the plan.
    pub index: u64,
    /// The swept keys and their values.
    pub values: Vec<(String, String)>,
    /// Force constants of the best array; absent where no array is searched.
    #[serde(flatten)]
    pub array: Option<ArrayMerit>,
    /// |force|, N.
    pub force_n: f64,
    /// Resistance, ohm, mass, kg, and settling time, s.
    pub costs: [f64; 3],
    /// Whether it meets its limits.
    pub limits_met: bool,
}

impl SweepBest {
    fn of(plan: &PlanFile, briefs: &[Brief]) -> Option<Self> {
        // Of equal ones the first.
        let better = |a: &&Brief, b: &&Brief| {
            let merit = a.merit().total_cmp(&b.merit());
            a.met.cmp(&b.met).then(merit).then(b.index.cmp(&a.index))
        };
        let best = briefs.iter().max_by(better)?;
        let keys = plan.axes.iter().map(|axis| axis.key.clone());
        let values = plan.values_at(best.index).into_iter().map(value_text);
        Some(Self {
            index: best.index,
            values: keys.zip(values).collect(),
            array: best.array,
            force_n: best.force_n,
            costs: best.costs,
            limits_met: best.met,
        })
    }
}

/// The few numbers of a point that are held: index, force constants of its array, force, costs, whether limits
/// are met.
struct Brief {
    index: u64,
    array: Option<ArrayMerit>,
    force_n: f64,
    costs: [f64; 3],
    met: bool,
}

impl Brief {
    /// What ranks it, as [`ranked_by`] names it. A gain ranks nothing: each is over its own given array.
    fn merit(&self) -> f64 {
        self.array
            .map_or(self.force_n, |array| array.mean_lambda_n_per_m)
    }
}

/// Name and unit of what ranks a plan's designs.
fn ranked_by(plan: &PlanFile) -> [&'static str; 2] {
    match plan.mode {
        Mode::OptimizeFor => ["mean force constant", "N/m"],
        Mode::Evaluate | Mode::Optimize | Mode::OptimizeWound => ["force on the magnet", "N"],
    }
}

#[derive(Default)]
struct Gathered {
    briefs: Vec<Brief>,
    rows: u64,
    failed: u64,
    inaccurate: u64,
    missing: Vec<Range<u64>>,
}

/// Why the table was not written.
enum Stop {
    Output(io::Error),
    Job(RunError),
}

impl From<io::Error> for Stop {
    fn from(error: io::Error) -> Self {
        Self::Output(error)
    }
}

/// Merges into files: the table, the plot, the designs on the fronts, and the sidecar.
///
/// # Errors
/// Points that are missing, unless a partial merge is requested; points of another plan; files that are
/// not ours; interruption.
pub fn merge(
    plan: &PlanFile,
    plan_input: Input,
    request: &MergeRequest,
    files: &MergeFiles,
    progress: &dyn Progress,
) -> Result<MergeReport, RunError> {
    check_plans(plan, request)?;
    let name = |suffix: &str| {
        let stem = files.table.file_stem().unwrap_or_default();
        format!("{}{suffix}", stem.to_string_lossy())
    };
    let folder = files.table.parent().unwrap_or(Path::new(""));
    let mut summary = summary(plan, plan_input);
    let overwrite = Overwrite::new(
        files.force,
        folder.join(name("_merge.json")),
        &summary.inputs,
    )
    // Reads the output of `sweep run`.
    .protecting(request.folders.iter().map(|folder| folder.join("points")))
    .protecting(
        request
            .folders
            .iter()
            .map(|folder| folder.join("plan.json")),
    );
    for path in files.paths() {
        overwrite.check(&path)?;
    }
    let mut set = FileSet::begin(folder, overwrite);
    let table = files.table.file_name().unwrap_or_default();
    let table = table.to_string_lossy().into_owned();
    let (mut gathered, mut refused) = (Gathered::default(), None);
    let written = set.write(&table, |out| {
        match gather(plan, request, out, progress) {
            Ok(all) => gathered = all,
            Err(Stop::Output(error)) => return Err(error),
            Err(Stop::Job(error)) => {
                refused = Some(error);
                return Err(io::Error::other("refused"));
            }
        }
        Ok(())
    });
    if let Some(error) = refused {
        return Err(error);
    }
    let [.., sidecar] = files.paths();
    if request.partial && !files.force {
        refuse_fuller(&files.table, &sidecar, gathered.missing_count())?;
    }
    let mut listed = vec![FileEntry::new(table, written?)];
    let (fronts, among_met) = fronts(&gathered.briefs);
    let plot = plot(plan, &gathered.briefs, &fronts, among_met);
    let plot_name = name(".svg");
    let written = set.write(&plot_name, |out| {
        out.write_all(plot.drawing().svg().as_bytes())
    })?;
    listed.push(FileEntry::new(plot_name, written));
    let best = rows_on(&gathered.briefs, &fronts);
    let front_name = name("_pareto.csv");
    let written = write_front(&mut set, &front_name, plan, request, &best)?;
    listed.push(FileEntry::new(front_name, written));
    count(&mut summary, &gathered, best.len() as u64, among_met);
    summary.files = listed;
    set.write(&name("_merge.json"), |out| {
        let bytes = to_record(&summary)
            .map_err(|error| io::Error::new(io::ErrorKind::InvalidData, error))?;
        out.write_all(&bytes)
    })?;
    set.commit()?;
    let page = request
        .page
        .then(|| page::html(plan, &summary, &plot, &gathered.briefs, &best));
    Ok(report(plan, request, summary, &gathered, page))
}

/// Refuses to replace the merged sweep of `sidecar`, the same plan's, where it misses fewer points than `missing`.
fn refuse_fuller(table: &Path, sidecar: &Path, missing: u64) -> Result<(), RunError> {
    let bytes = read_plain(sidecar, SIDECAR_MAX_BYTES).ok();
    let there = bytes.and_then(|bytes| serde_json::from_slice::<MergeSummary>(&bytes).ok());
    match there {
        Some(there) if there.missing < missing => Err(WriteError::OutputExists {
            path: table.to_path_buf(),
            reason: format!(
                "and is fuller: of {} points it misses {}, and {missing} are missing now",
                there.points, there.missing
            ),
        }
        .into()),
        Some(_) | None => Ok(()),
    }
}

/// Writes the table of the designs on a front.
fn write_front(
    set: &mut FileSet,
    name: &str,
    plan: &PlanFile,
    request: &MergeRequest,
    best: &[(u64, [bool; 3])],
) -> Result<Written, RunError> {
    let points = best
        .iter()
        .map(|(index, _)| found(plan, request, *index))
        .collect::<Result<Vec<_>, _>>()?;
    let variables = variables(plan, request)?;
    let columns = columns(plan.mode, has_iron(plan)?);
    let written = set.write(name, |out| {
        let keys = plan.axes.iter().map(|axis| axis.key.as_str());
        let fronts = COSTS.map(|(_, _, column)| column);
        let mut table = TableWriter::begin(out, columns.clone(), keys, &variables, &fronts)?;
        for ((index, flags), point) in best.iter().zip(&points) {
            // A file that existed a moment ago may be gone.
            let point = point.as_ref().ok_or(io::ErrorKind::NotFound)?;
            table.row(&plan.values_at(*index), point, flags)?;
        }
        Ok(())
    })?;
    Ok(written)
}

/// Merges into a table alone; the summary lists no files.
///
/// # Errors
/// As [`merge`].
pub fn merge_table(
    plan: &PlanFile,
    plan_input: Input,
    request: &MergeRequest,
    progress: &dyn Progress,
) -> Result<(Vec<u8>, MergeReport), RunError> {
    let mut table = Vec::new();
    let gathered = gather(plan, request, &mut table, progress).map_err(|stop| match stop {
        Stop::Job(error) => error,
        Stop::Output(error) => WriteError::from_io("write", Path::new("-"), error).into(),
    })?;
    let (fronts, among_met) = fronts(&gathered.briefs);
    let best = rows_on(&gathered.briefs, &fronts);
    let mut summary = summary(plan, plan_input);
    count(&mut summary, &gathered, best.len() as u64, among_met);
    let page = request.page.then(|| {
        let plot = plot(plan, &gathered.briefs, &fronts, among_met);
        page::html(plan, &summary, &plot, &gathered.briefs, &best)
    });
    let report = report(plan, request, summary, &gathered, page);
    Ok((table, report))
}

/// Writes the table's rows in the points' order and collects what the fronts need.
fn gather(
    plan: &PlanFile,
    request: &MergeRequest,
    out: &mut dyn Write,
    progress: &dyn Progress,
) -> Result<Gathered, Stop> {
    if let Some(absent) = request.folders.iter().find(|folder| !folder.is_dir()) {
        let message = format!("{}: no such folder of `sweep run`", shown_path(absent));
        return Err(Stop::Job(RunError::Sweep(message)));
    }
    let mut gathered = Gathered::default();
    let keys = plan.axes.iter().map(|axis| axis.key.as_str());
    let variables = variables(plan, request).map_err(Stop::Job)?;
    let columns = columns(plan.mode, has_iron(plan).map_err(Stop::Job)?);
    let mut table = TableWriter::begin(out, columns, keys, &variables, &[])?;
    progress.begin("merge", plan.points);
    for start in (0..plan.points).step_by(PORTION as usize) {
        progress.check().map_err(|error| Stop::Job(error.into()))?;
        let end = plan.points.min(start + PORTION);
        let points: Vec<Option<PointFile>> = (start..end)
            .into_par_iter()
            .map(|index| found(plan, request, index))
            .collect::<Result<_, _>>()
            .map_err(Stop::Job)?;
        for (index, point) in (start..).zip(points) {
            let Some(point) = point else {
                match gathered.missing.last_mut() {
                    Some(range) if range.end == index => range.end += 1,
                    _ => gathered.missing.push(index..index + 1),
                }
                continue;
            };
            table.row(&plan.values_at(index), &point, &[])?;
            gathered.add(&point);
        }
        progress.advance(end - start);
    }
    progress.end();
    if !gathered.missing.is_empty() && !request.partial {
        return Err(Stop::Job(RunError::Sweep(format!(
            "{} of {} points are missing: {}; compute them with `fluxform sweep run`, or merge \
             what there is with --partial",
            gathered.missing_count(),
            plan.points,
            named(&gathered.missing)
        ))));
    }
    Ok(gathered)
}

/// Whether its designs have steel beyond the cores.
fn has_iron(plan: &PlanFile) -> Result<bool, RunError> {
    const SECTIONS: [&str; 2] = ["plate", "iron"];
    let template = Template::new(&plan.design_text, Path::new(""))
        .map_err(|error| RunError::Input(error.to_string()))?;
    let swept = |section: &str| {
        let keys = plan.axes.iter().map(|axis| axis.key.split('.').next());
        keys.flatten().any(|first| first == section)
    };
    Ok(SECTIONS
        .iter()
        .any(|section| template.get(section).is_some() || swept(section)))
}

/// The variables of all arrays that were found, in order; swept keys decide which there are.
fn variables(plan: &PlanFile, request: &MergeRequest) -> Result<Vec<String>, RunError> {
    let mut all = BTreeSet::new();
    if plan.mode == Mode::OptimizeFor {
        for index in 0..plan.points {
            let row = found(plan, request, index)?.and_then(|point| point.row);
            all.extend(
                row.and_then(|row| row.array)
                    .into_iter()
                    .flat_map(|array| array.values.into_keys()),
            );
        }
    }
    Ok(all.into_iter().collect())
}

impl Gathered {
    fn add(&mut self, point: &PointFile) {
        use crate::bundle::sweep::Status;
        self.rows += 1;
        match point.status {
            Status::Done => {}
            Status::AccuracyNotReached => self.inaccurate += 1,
            Status::Infeasible | Status::Unbounded | Status::Failed => self.failed += 1,
        }
        if let Some(row) = &point.row {
            self.briefs.push(Brief {
                index: point.index,
                array: row.array.as_ref().map(ArrayRow::merit),
                force_n: row.force_n.abs(),
                costs: [row.resistance_ohm, row.mass_kg, row.settling_s],
                met: row.limits_met,
            });
        }
    }

    fn missing_count(&self) -> u64 {
        self.missing
            .iter()
            .map(|range| range.end - range.start)
            .sum()
    }
}

/// Point `index` from the first folder that has it.
fn found(
    plan: &PlanFile,
    request: &MergeRequest,
    index: u64,
) -> Result<Option<PointFile>, RunError> {
    for folder in &request.folders {
        let store = PointStore::new(folder);
        match store.find(&plan.plan_sha256, index)? {
            StoredPoint::Point(point) => return Ok(Some(*point)),
            StoredPoint::Nothing => {}
            StoredPoint::Foreign(reason) => {
                return Err(foreign(&store.path(index), &reason));
            }
        }
    }
    Ok(None)
}

/// Refuses folders of other plans.
fn check_plans(plan: &PlanFile, request: &MergeRequest) -> Result<(), RunError> {
    for folder in &request.folders {
        match PointStore::new(folder).check_plan(plan) {
            Err(WriteError::OutputExists { path, reason }) => return Err(foreign(&path, &reason)),
            checked => checked?,
        }
    }
    Ok(())
}

/// A file of another plan, and why it is one.
fn foreign(path: &Path, reason: &str) -> RunError {
    RunError::Sweep(format!(
        "{} exists {reason}; merge the folder with the plan that it was run with, or run this plan into another folder",
        path.display()
    ))
}

/// The first ranges: `3, 17-25, ...`.
fn named(missing: &[Range<u64>]) -> String {
    let mut parts: Vec<String> = missing
        .iter()
        .take(NAMED)
        .map(|range| match range.end - range.start {
            1 => range.start.to_string(),
            _ => format!("{}-{}", range.start, range.end - 1),
        })
        .collect();
    if missing.len() > NAMED {
        parts.push("...".to_owned());
    }
    parts.join(", ")
}

/// Positions of the briefs on each front, and whether only those that meet their limits compete.
fn fronts(briefs: &[Brief]) -> ([Vec<usize>; 3], bool) {
    let among_met = briefs.iter().any(|brief| brief.met);
    let competing: Vec<usize> = (0..briefs.len())
        .filter(|at| briefs[*at].met || !among_met)
        .collect();
    let fronts = std::array::from_fn(|cost| {
        let points: Vec<[f64; 2]> = competing
            .iter()
            .map(|at| [briefs[*at].costs[cost], briefs[*at].merit()])
            .collect();
        front(&points).into_iter().map(|at| competing[at]).collect()
    });
    (fronts, among_met)
}

/// Indices of the points on any front, ascending, and on which ones they are.
fn rows_on(briefs: &[Brief], fronts: &[Vec<usize>; 3]) -> Vec<(u64, [bool; 3])> {
    let mut rows = std::collections::BTreeMap::new();
    for (cost, front) in fronts.iter().enumerate() {
        for at in front {
            rows.entry(briefs[*at].index).or_insert([false; 3])[cost] = true;
        }
    }
    rows.into_iter().collect()
}

fn plot(
    plan: &PlanFile,
    briefs: &[Brief],
    fronts: &[Vec<usize>; 3],
    among_met: bool,
) -> ParetoPlot {
    let panel = |cost: usize| {
        let (name, unit, _) = COSTS[cost];
        Panel {
            name,
            unit,
            values: briefs.iter().map(|brief| brief.costs[cost]).collect(),
            front: fronts[cost].clone(),
        }
    };
    let [gain, gain_unit] = ranked_by(plan);
    ParetoPlot {
        title: format!("{}: {} designs", plan.design, briefs.len()),
        gain,
        gain_unit,
        gains: briefs.iter().map(Brief::merit).collect(),
        limits_met: briefs.iter().map(|brief| brief.met).collect(),
        front: if among_met {
            "best of those that meet them"
        } else {
            "best of all"
        },
        panels: [panel(0), panel(1), panel(2)],
    }
}

fn summary(plan: &PlanFile, plan_input: Input) -> MergeSummary {
    let mut inputs = vec![plan_input];
    inputs.extend(plan.inputs.iter().cloned());
    MergeSummary {
        schema_version: SCHEMA_VERSION.to_owned(),
        fluxform_version: FLUXFORM_VERSION.to_owned(),
        design: plan.design.clone(),
        inputs,
        plan_sha256: plan.plan_sha256.clone(),
        points: plan.points,
        rows: 0,
        missing: 0,
        failed: 0,
        inaccurate: 0,
        limits_met: 0,
        front_meets_limits: false,
        front: 0,
        largest_force_n: None,
        files: Vec::new(),
    }
}

/// Fills in what was gathered.
fn count(summary: &mut MergeSummary, gathered: &Gathered, front: u64, among_met: bool) {
    summary.rows = gathered.rows;
    summary.missing = gathered.missing_count();
    summary.failed = gathered.failed;
    summary.inaccurate = gathered.inaccurate;
    summary.limits_met = gathered.briefs.iter().filter(|brief| brief.met).count() as u64;
    summary.front_meets_limits = among_met;
    summary.front = front;
    summary.largest_force_n = gathered.briefs.iter().map(|b| b.force_n).reduce(f64::max);
}

fn report(
    plan: &PlanFile,
    request: &MergeRequest,
    summary: MergeSummary,
    gathered: &Gathered,
    page: Option<String>,
) -> MergeReport {
    let best = SweepBest::of(plan, &gathered.briefs);
    let landscape = || landscape::landscape(plan, &gathered.briefs, best.as_ref());
    MergeReport {
        summary,
        page,
        landscape: request.landscape.then(landscape),
        best,
        missing: named(&gathered.missing),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn missing_points_are_named_in_ranges() {
        assert_eq!(named(&[3..4, 17..26]), "3, 17-25");
        let many: Vec<Range<u64>> = (0..13).map(|i| 2 * i..2 * i + 1).collect();
        assert!(named(&many).ends_with("18, ..."));
    }
}
