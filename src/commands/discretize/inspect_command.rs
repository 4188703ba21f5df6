//! `discretize --inspect`: what a surface's file holds.

use std::path::PathBuf;

use super::command::Discretize;
use super::inspect::{Inspection, drawn, inspect};
use crate::bundle::artefact::Input;
use crate::cli::documents;
use crate::cli::failure::Failure;
use crate::cli::layout::Sheet;
use crate::cli::pictures::Picture;
use crate::cli::printer::{Printer, Stream};
use crate::cli::quantity::{count, extents, mm, number};
use crate::cli::start::begin;
use crate::cli::values::FileArgument;
use crate::shape::MeshReport;
use crate::shape::document::{SurfaceSource, unit_name};

impl Discretize {
    pub(crate) fn inspected(&self, printer: &Printer) -> Result<(), Failure> {
        let given = self.surface.given();
        let placed: Vec<&str> = given.into_iter().filter(|flag| *flag != "--unit").collect();
        if !placed.is_empty() {
            return Err(Failure::Usage(format!(
                "{} cannot be used with --inspect, which looks at the file as it is",
                placed.join(" ")
            )));
        }
        let (path, unit_m, inputs) = self.file(printer)?;
        let bar = begin(printer);
        let inspection = inspect(&path, inputs)?;
        for warning in &inspection.surface.warnings {
            printer.warning(warning);
        }
        let mut place = Stream::Output;
        if let Some(file) = &self.plot {
            let plot = Picture::new(file, self.writing.force, [&path]);
            plot.check(&inspection.inputs)?;
            let svg = drawn(&path, unit_m, &bar)?.svg();
            place = plot.write(&inspection.inputs, &svg, printer)?;
        }
        printer.summary(place, &inspection, || self.report(&inspection))
    }

    /// The surface's file, its unit as stated, and the document that names it.
    fn file(&self, printer: &Printer) -> Result<(PathBuf, Option<f64>, Vec<Input>), Failure> {
        if let FileArgument::Path(path) = &self.shape
            && !documents::is_document(&self.shape)
        {
            return Ok((path.clone(), self.surface.unit, Vec::new()));
        }
        let shapes = documents::shapes(std::slice::from_ref(&self.shape), &self.surface, printer)?;
        let mut shapes = shapes.into_iter();
        match shapes
            .next()
            .map(|shape| (shape.document.source, shape.input))
        {
            Some((SurfaceSource::File { path, unit_m }, input)) => {
                Ok((path, unit_m, input.into_iter().collect()))
            }
            _ => Err(Failure::Usage(format!(
                "{}: this shape is a formula: there is no file to inspect",
                self.shape.as_given().display()
            ))),
        }
    }

    fn report(&self, inspection: &Inspection) -> String {
        let found = &inspection.surface;
        let name = inspection.inputs.last().map_or("", |input| &input.path);
        let mut sheet = Sheet::new(&format!(
            "{name}: {}, {}",
            found.format,
            count(found.triangles, "triangle")
        ));
        sheet.line(
            "box",
            &format!(
                "{} in the file's unit",
                extents(found.bounds_min, found.bounds_max)
            ),
        );
        sheet.line("unit", &unit(found));
        sheet.line("closed", &closed(found));
        sheet.line("faults", &faults(found));
        sheet.line(
            "layers",
            &match found.layers {
                Some(most) => format!("at most {most} over each other"),
                None => {
                    "not looked for: nothing in it has an area, or it lies too far out".to_owned()
                }
            },
        );
        let volume = found.volume.map_or(String::new(), |volume| {
            format!(", volume {}", number(volume.abs()))
        });
        sheet.line("area", &format!("{}{volume}", number(found.area)));
        if let Some(unit_m) = found.unit_m.filter(|_| found.deviation > 0.0) {
            sheet.line(
                "facets",
                &format!("about {} from the body", mm(found.deviation * unit_m)),
            );
        }
        if let Some(FileArgument::Path(path)) = &self.plot {
            sheet.line("drawn in", &path.display().to_string());
        }
        sheet.finish()
    }
}

/// The unit, as far as it is known.
fn unit(found: &MeshReport) -> String {
    if let Some(unit_m) = found.unit_m {
        return format!("{}, as the file says", unit_name(unit_m));
    }
    let guesses: Vec<String> = found
        .unit_guesses
        .iter()
        .map(|guess| format!("{} ({} long)", guess.unit, mm(guess.size_m)))
        .collect();
    if guesses.is_empty() {
        return "none in the file, and in no usual unit of a haptic display's size; say --unit"
            .to_owned();
    }
    format!(
        "none in the file; perhaps {}: say which with --unit",
        guesses.join(", or ")
    )
}

fn closed(found: &MeshReport) -> String {
    let bodies = count(found.bodies, "part");
    if found.watertight {
        let through = found.bodies as i64 - found.euler / 2;
        let through = usize::try_from(through).unwrap_or(0);
        let holes = match through {
            0 => String::new(),
            n => format!(", {} through", count(n, "hole")),
        };
        return format!("yes, {bodies}{holes}");
    }
    let mut what = vec![format!("no, {bodies}")];
    if found.open_edges > 0 {
        what.push(count(found.open_edges, "open edge"));
    }
    if found.crowded_edges > 0 {
        let edges = count(found.crowded_edges, "edge");
        what.push(format!("{edges} of more than two triangles"));
    }
    what.join(", ")
}

fn faults(found: &MeshReport) -> String {
    let mut what = Vec::new();
    let mut add = |number: usize, thing: &str, after: &str| {
        if number > 0 {
            what.push(format!("{}{after}", count(number, thing)));
        }
    };
    add(found.self_intersections, "self-intersection", "");
    add(found.degenerate, "triangle", " without area");
    add(found.duplicate, "duplicate", "");
    add(found.inconsistent_edges, "edge", " between opposite sides");
    if what.is_empty() {
        return "none".to_owned();
    }
    what.join(", ")
}
