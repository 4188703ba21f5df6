//! How much memory a run may take: a share of what the machine has free, or what `--memory` grants.

use std::path::Path;
use std::sync::OnceLock;

use super::failure::Failure;
use super::printer::Printer;
use super::quantity::bytes;
use crate::RunError;
use crate::design::Design;
use crate::scene::cost::{Cost, of_force_constants, of_points, of_pull, of_steel};
use crate::scene::passive::PASSIVE_TOLERANCE;
use crate::scene::sources::ShapeSource;

/// Share of the free memory that a run takes unasked.
const SHARE: f64 = 0.75;
/// Where the system does not say what is free: the memory of a small machine.
const UNKNOWN_BYTES: f64 = 4e9;
/// Computations that are expected to take longer are announced, s.
const LONG_S: f64 = 60.0;

static GRANTED: OnceLock<u64> = OnceLock::new();

/// Grants `--memory`, and surfaces the same budget: their readers know the number of triangles first.
pub fn grant(memory: Option<u64>) {
    if let Some(memory) = memory {
        let _ = GRANTED.set(memory);
    }
    crate::shape::memory::grant(budget() as u64);
}

/// Bytes that a run may take.
fn budget() -> f64 {
    let granted = GRANTED.get();
    granted.map_or_else(|| SHARE * available_bytes(), |granted| *granted as f64)
}

/// The origin of an amount of work.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CostOrigin {
    /// A design or shape file.
    Document,
    /// A flag.
    Flag,
}

/// The origin of the points of `shapes`: the flags of a surface given directly, or a file.
#[must_use]
pub fn cost_origin(shapes: &[ShapeSource]) -> CostOrigin {
    if shapes.iter().any(|shape| shape.input.is_none()) {
        CostOrigin::Flag
    } else {
        CostOrigin::Document
    }
}

/// The costs of the forces of `design` at the points of `shapes`.
#[must_use]
pub fn costs(design: &Design, shapes: &[ShapeSource], tolerance: Option<f64>) -> Vec<Cost> {
    let coils = design.array.positions_m.len();
    let points = shapes.iter().map(|s| of_points(&s.document, coils));
    let steel = of_steel(design, tolerance);
    let pull = of_pull(design, PASSIVE_TOLERANCE);
    let constants = shapes
        .iter()
        .flat_map(|shape| of_force_constants(design, &shape.document, tolerance));
    points.chain(steel).chain(pull).chain(constants).collect()
}

/// Refuses costs that exceed the budget, and announces long computations and those that end with less
/// accuracy than requested.
///
/// # Errors
/// More memory than allowed: a bad input where a document asks for it, wrong usage where a flag does.
pub fn allow(
    costs: impl IntoIterator<Item = Cost>,
    origin: CostOrigin,
    printer: &Printer,
) -> Result<(), Failure> {
    let costs: Vec<Cost> = costs.into_iter().collect();
    announce(&costs, printer).map_err(|message| match origin {
        CostOrigin::Flag => Failure::Usage(message),
        CostOrigin::Document => RunError::Input(message).into(),
    })
}

/// As [`allow`], wherever the costs come from.
///
/// # Errors
/// What would take more memory than allowed, and what helps.
pub fn announce(costs: &[Cost], printer: &Printer) -> Result<(), String> {
    for cost in costs {
        within(cost)?;
        if let Some((error, tolerance)) = cost.misses {
            printer.notice(&format!(
                "{} cannot be solved to the tolerance {tolerance:.0e}: its error will be {error:.0e} at \
                 least, however long it takes; {}",
                cost.what, cost.reduce
            ));
        }
    }
    if let Some(message) = duration(costs, rayon::current_num_threads()) {
        printer.notice(&message);
    }
    Ok(())
}

/// How long computations of `costs` take, if that is long, and what takes longest.
fn duration(costs: &[Cost], threads: usize) -> Option<String> {
    let seconds = |cost: &Cost| cost.cpu_seconds / threads as f64;
    let minutes = |seconds: f64| format!("{:.0} min", (seconds / 60.0).ceil());
    let total: f64 = costs.iter().map(seconds).sum();
    let longest = costs
        .iter()
        .max_by(|a, b| a.cpu_seconds.total_cmp(&b.cpu_seconds))
        .filter(|_| total > LONG_S)?;
    let memory = if longest.bytes > 0.0 {
        format!(" and {}", bytes(longest.bytes as u64))
    } else {
        String::new()
    };
    Some(format!(
        "this will take about {}, most of it {} ({}{memory}); {}; Ctrl-C stops it",
        minutes(total),
        longest.what,
        minutes(seconds(longest)),
        longest.reduce
    ))
}

/// Whether `cost` is within the budget.
///
/// # Errors
/// The memory it would take, the memory there is, and what helps.
fn within(cost: &Cost) -> Result<(), String> {
    let granted = GRANTED.get().copied();
    let budget = budget();
    if cost.bytes <= budget {
        return Ok(());
    }
    let limit = match granted {
        Some(_) => "--memory grants",
        None => "three quarters of what this machine has free are",
    };
    Err(format!(
        "{} would take about {} of memory, and {limit} {}; {}, or grant more with --memory {}",
        cost.what,
        bytes(cost.bytes as u64),
        bytes(budget as u64),
        cost.reduce,
        bytes((1.1 * cost.bytes) as u64).replace(' ', ""),
    ))
}

/// Bytes that this process may still take: the least of the machine's free memory, the limit of its
/// control group and that of the process.
fn available_bytes() -> f64 {
    let machine = || {
        let text = read("/proc/meminfo")?;
        let line = text.lines().find_map(|l| l.strip_prefix("MemAvailable:"))?;
        let kibibytes: f64 = line.split_whitespace().next()?.parse().ok()?;
        Some(1024.0 * kibibytes)
    };
    let process = || {
        let text = read("/proc/self/limits")?;
        let line = text
            .lines()
            .find_map(|l| l.strip_prefix("Max address space"))?;
        line.split_whitespace().next()?.parse::<f64>().ok()
    };
    let group = |limit: &str, used: &str| {
        let limit: f64 = read(limit)?.trim().parse().ok()?;
        let used: f64 = read(used)?.trim().parse().ok()?;
        Some((limit - used).max(0.0))
    };
    let found = [
        machine(),
        process(),
        group("/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory.current"),
        group(
            "/sys/fs/cgroup/memory/memory.limit_in_bytes",
            "/sys/fs/cgroup/memory/memory.usage_in_bytes",
        ),
    ];
    let least = found.into_iter().flatten().fold(f64::INFINITY, f64::min);
    if least.is_finite() {
        least
    } else {
        UNKNOWN_BYTES
    }
}

fn read(path: &str) -> Option<String> {
    std::fs::read_to_string(Path::new(path)).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Stages that are short each may be long together.
    #[test]
    fn more_than_a_minute_is_announced_with_what_takes_longest() {
        let cost = |what: &str, cpu_seconds: f64, bytes: f64| Cost {
            what: what.to_owned(),
            bytes,
            cpu_seconds,
            reduce: "use less",
            misses: None,
        };
        let costs = [cost("one", 50.0, 0.0), cost("other", 75.0, 3e9)];
        assert_eq!(duration(&costs, 3), None);
        let message = duration(&costs, 2).unwrap();
        assert_eq!(
            message,
            "this will take about 2 min, most of it other (1 min and 3 GB); use less; Ctrl-C stops it"
        );
        assert_eq!(duration(&[], 1), None);
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn some_memory_is_free_and_no_more_than_there_is() {
        let free = available_bytes();
        assert!(free > 1e6 && free < 1e15, "{free}");
    }
}
