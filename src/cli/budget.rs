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
                "{} will not reach the tolerance {tolerance:.0e}: the error that can be stated is {error:.0e} at \
                 least; {}",
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

/// What the system says of the memory of control groups, of both of its versions: their folder, how
/// the line of this process's group in `/proc/self/cgroup` begins behind its number, the files of the
/// limit and of what is used, and the key of what is a mere copy of files.
const GROUPS: [[&str; 5]; 2] = [
    [
        "/sys/fs/cgroup",
        ":",
        "memory.max",
        "memory.current",
        "inactive_file",
    ],
    [
        "/sys/fs/cgroup/memory",
        "memory:",
        "memory.limit_in_bytes",
        "memory.usage_in_bytes",
        "total_inactive_file",
    ],
];

/// Bytes that the control groups leave, this process's own and those around it; copies of files in
/// memory go where it is needed. In a container the own group's path may be the machine's, not there.
fn left_in_groups(read: impl Fn(&Path) -> Option<String>) -> Option<f64> {
    let memberships = read(Path::new("/proc/self/cgroup")).unwrap_or_default();
    let of = |[folder, line, limit, used, copies]: [&str; 5]| {
        let own = memberships.lines().find_map(|membership| {
            let (_, group) = membership.split_once(':')?;
            group.strip_prefix(line)?.strip_prefix('/')
        });
        let own = Path::new(folder).join(own.unwrap_or_default());
        let inside = own
            .ancestors()
            .take_while(|group| group.starts_with(folder));
        let left = inside.filter_map(|group| {
            let number = |file: &str| read(&group.join(file))?.trim().parse::<f64>().ok();
            let (limit, used) = (number(limit)?, number(used)?);
            let stat = read(&group.join("memory.stat")).unwrap_or_default();
            let copied = stat.lines().find_map(|line| {
                let (key, bytes) = line.split_once(' ')?;
                (key == copies).then(|| bytes.parse::<f64>().ok())?
            });
            Some((limit - used + copied.unwrap_or(0.0)).clamp(0.0, limit))
        });
        left.reduce(f64::min)
    };
    GROUPS.into_iter().filter_map(of).reduce(f64::min)
}

/// Bytes that this process may still take: the least of the machine's free memory, the limits of its
/// control groups and that of the process.
fn available_bytes() -> f64 {
    let machine = || {
        let text = read(Path::new("/proc/meminfo"))?;
        let line = text.lines().find_map(|l| l.strip_prefix("MemAvailable:"))?;
        let kibibytes: f64 = line.split_whitespace().next()?.parse().ok()?;
        Some(1024.0 * kibibytes)
    };
    let process = || {
        let text = read(Path::new("/proc/self/limits"))?;
        let line = text
            .lines()
            .find_map(|l| l.strip_prefix("Max address space"))?;
        line.split_whitespace().next()?.parse::<f64>().ok()
    };
    let found = [machine(), process(), left_in_groups(read)];
    let least = found.into_iter().flatten().fold(f64::INFINITY, f64::min);
    if least.is_finite() {
        least
    } else {
        UNKNOWN_BYTES
    }
}

fn read(path: &Path) -> Option<String> {
    std::fs::read_to_string(path).ok()
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

    /// Broke: copies of files counted as used, and only the outermost group's limit was known.
    #[test]
    fn control_groups_leave_what_their_limits_and_files_say() {
        let files = [
            ("memory.max", "8000\n"),
            ("memory.current", "7999\n"),
            ("memory.stat", "anon 300\nfile 7600\ninactive_file 7500\n"),
            ("job/memory.max", "6000\n"),
            ("job/memory.current", "500\n"),
            ("job/own/memory.max", "max\n"),
            ("job/own/memory.current", "400\n"),
            ("memory/old/memory.limit_in_bytes", "900\n"),
            ("memory/old/memory.usage_in_bytes", "200\n"),
        ];
        let left = |memberships: &str| {
            left_in_groups(|path| {
                let Ok(file) = path.strip_prefix("/sys/fs/cgroup") else {
                    return Some(memberships.to_owned());
                };
                let found = files.iter().find(|(name, _)| Path::new(name) == file);
                found.map(|(_, text)| (*text).to_owned())
            })
        };
        assert_eq!(left("0::/\n"), Some(7501.0));
        assert_eq!(left("0::/job/own\n"), Some(5500.0));
        assert_eq!(left("0::/of/the/machine\n"), Some(7501.0));
        assert_eq!(left("7:cpu:/\n4:memory:/old\n"), Some(700.0));
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn some_memory_is_free_and_no_more_than_there_is() {
        let free = available_bytes();
        assert!(free > 1e6 && free < 1e15, "{free}");
    }
}
