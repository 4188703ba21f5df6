//! The result of `map` for people.

use super::mag_manip::{MultipolesSummary, VectorFieldSummary};
use super::{CompactSteel, MapReport};
use crate::bundle::manifest::MapSummary;
use crate::cli::describe;
use crate::cli::layout::Sheet;
use crate::cli::quantity::{bytes, count, error, mm, percent};
use crate::design::Design;

/// The result for people.
pub(super) fn summary(design: &Design, report: &MapReport) -> String {
    let map = &report.sidecar.map;
    let mut sheet = Sheet::new(&format!(
        "{}: maps of {} over the workspace",
        report.sidecar.design,
        count(map.coil.len(), "coil")
    ));
    let components = report.components.meaning();
    sheet.line("components", &format!("{components}, per ampere"));
    let axes = [("x", &map.x_m), ("y", &map.y_m), ("z", &map.z_m)];
    let axes = axes.map(|(name, axis)| describe::axis(name, axis));
    sheet.line("grid", &axes.join(", "));
    sheet.line(
        "work",
        &format!(
            "{} of nodes and coils, {} from the axes{}",
            count(report.point_coils, "pair"),
            count(report.distinct_radii, "distinct distance"),
            if report.tabulated {
                ", through radial tables"
            } else {
                ""
            }
        ),
    );
    if let Some(table) = &report.table {
        sheet.line("steel", &compact_steel(table));
    }
    if let Some(point) = &map.working_point {
        let peak_t = point.peak_field_t.iter().copied().fold(0.0, f64::max);
        sheet.line(
            "together",
            &format!(
                "up to {} of the largest off the sum of the coils' maps, cores up to {peak_t:.3} T",
                percent(point.deviation_from_linear)
            ),
        );
        sheet.line("at", &describe::currents(design, &point.currents_a));
    }
    if let Some(made) = &report.vector_field {
        sheet.line("vfield", &vector_field(made));
    }
    if let Some(made) = &report.multipoles {
        sheet.line("mpem", &multipoles(made));
    }
    if let Some(requested) = &report.requested {
        sheet.line(
            "error",
            &format!(
                "{}{} {} the requested {}",
                percent(requested.of_map),
                (requested.of_pull).map_or_else(String::new, |off| format!(
                    ", {} of the pull,",
                    percent(off)
                )),
                if requested.met { "holds" } else { "exceeds" },
                percent(requested.error)
            ),
        );
    }
    let stages = report.sidecar.accuracy.iter();
    let stages = stages.map(|(name, stage)| (name.as_str(), stage));
    sheet.line("accuracy", &describe::accuracy(stages));
    sheet.line("between", &between_nodes(map));
    let files = report.sidecar.files.iter();
    let files: Vec<String> = files
        .map(|file| format!("{} ({})", file.path, bytes(file.bytes)))
        .chain(std::iter::once("map.json".to_owned()))
        .collect();
    sheet.line(
        "written to",
        &format!("{}: {}", report.folder.display(), files.join(", ")),
    );
    sheet.finish()
}

fn between_nodes(map: &MapSummary) -> String {
    let pull = map.passive_force.as_ref().map_or_else(String::new, |pull| {
        let off = error(pull.interpolation.largest_error);
        format!("\nand {off} of the unpowered steel's largest pull there")
    });
    format!(
        "nodes {} of the largest |dBz/dz| at that height, with {}{pull}",
        error(map.interpolation.largest_error),
        map.interpolation.name
    )
}

fn compact_steel(table: &CompactSteel) -> String {
    let Some(from_m) = table.report.from_m else {
        return "sampled at every node".to_owned();
    };
    format!(
        "from {} up by a harmonic function, {} from {}\n\
         within {} of the largest gradient at each height, compared at {}",
        mm(from_m),
        bytes(table.bytes),
        count(table.report.samples, "sample"),
        error(table.report.certificate),
        count(table.report.checks, "place")
    )
}

fn vector_field(made: &VectorFieldSummary) -> String {
    let steps = made.step_m.map(mm).join(", ");
    format!(
        "{}: {n} x {n} x {n} nodes {steps} apart, one step beyond the workspace where no coil is in the way",
        made.file,
        n = made.nodes,
    )
}

fn multipoles(made: &MultipolesSummary) -> String {
    let met = if made.tolerance_met {
        "within"
    } else {
        "NOT within"
    };
    format!(
        "{}: {} with {} a coil, fitted at {} (condition {:.0e}), {met} {}",
        made.file,
        count(made.sources, "source"),
        count(made.coefficients, "coefficient"),
        count(made.points, "point"),
        made.condition,
        error(made.tolerance)
    )
}
