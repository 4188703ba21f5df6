//! `discretize --inspect`: what a surface's file holds.

use std::path::Path;

use super::command::Discretize;
use super::inspect::{Inspected, Inspection, Placed, inspect};
use crate::bundle::artefact::Input;
use crate::cli::documents;
use crate::cli::failure::Failure;
use crate::cli::layout::Sheet;
use crate::cli::pictures::Picture;
use crate::cli::printer::{Printer, Stream};
use crate::cli::quantity::{count, extents, mm, number};
use crate::cli::start::begin;
use crate::cli::values::FileArgument;
use crate::design::Need;
use crate::shape::MeshReport;
use crate::shape::bodies::NamedBody;
use crate::shape::document::{SurfaceSource, unit_name};

impl Discretize {
    pub(crate) fn inspected(&self, printer: &Printer) -> Result<(), Failure> {
        let (inspected, inputs) = self.looked_at(printer)?;
        let bar = begin(printer);
        let (inspection, drawn) = inspect(&inspected, inputs, self.plot.is_some(), &bar)?;
        for warning in &inspection.surface.warnings {
            printer.warning(warning);
        }
        let mut place = Stream::Output;
        if let (Some(file), Some(drawn)) = (&self.plot, drawn) {
            let surface = inspection.inputs.last().map(|input| Path::new(&input.path));
            let plot = Picture::new(file, self.writing.force, surface);
            plot.check(&inspection.inputs)?;
            place = plot.draw(&inspection.inputs, &drawn.drawing(), printer)?;
        }
        printer.summary(place, &inspection, || self.report(&inspection))
    }

    /// The surface to inspect: the file as it is, unless flags place it.
    fn looked_at(&self, printer: &Printer) -> Result<(Inspected, Vec<Input>), Failure> {
        // These say what the file is, and place nothing.
        const OF_THE_FILE: [&str; 3] = ["--unit", "--chord", "--body"];
        const OF_THE_GRID: [&str; 3] = ["--grid", "--x", "--y"];
        let given = self.surface.given();
        let points: Vec<&str> = given
            .iter()
            .copied()
            .filter(|f| OF_THE_GRID.contains(f))
            .collect();
        if !points.is_empty() {
            return Err(Failure::Usage(format!(
                "{} cannot be used with --inspect, which makes no points",
                points.join(" ")
            )));
        }
        let over = self
            .over
            .as_ref()
            .map(|file| documents::design(file, Need::MAP, printer));
        let over = over.transpose()?.map(|document| Box::new(document.design));
        let placed = over.is_some() || given.iter().any(|flag| !OF_THE_FILE.contains(flag));
        if let FileArgument::Path(path) = &self.shape
            && !documents::is_document(&self.shape)
            && !placed
        {
            let bodies = documents::bodies(&self.surface);
            return Ok((Inspected::bare(path, self.surface.unit, bodies), Vec::new()));
        }
        let shapes = documents::shapes(std::slice::from_ref(&self.shape), &self.surface, printer)?;
        let Some(shape) = shapes.into_iter().next() else {
            return Err(Failure::Usage("there is nothing to inspect".to_owned()));
        };
        let SurfaceSource::File { path, unit_m } = shape.document.source.clone() else {
            return Err(Failure::Usage(format!(
                "{}: this shape is a formula: there is no file to inspect",
                self.shape.as_given().display()
            )));
        };
        let inputs = shape.input.into_iter().collect();
        if !placed {
            let bodies = shape.document.bodies;
            return Ok((Inspected::bare(&path, unit_m, bodies), inputs));
        }
        let inspected = Inspected {
            document: shape.document,
            stated_m: unit_m,
            placed,
            over,
        };
        Ok((inspected, inputs))
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
        if let Some(hidden) = &inspection.hidden {
            let of_upward = hidden.of_upward.map_or_else(
                || {
                    "an unknown share (facets of an open surface look to different sides)"
                        .to_owned()
                },
                |share| format!("{} %", number((1000.0 * share).round() / 10.0)),
            );
            sheet.line(
                "hidden",
                &format!(
                    "{} % of the area from above, {of_upward} of what faces up (undercuts, hollows)",
                    number((100.0 * hidden.of_area).round())
                ),
            );
        }
        for (k, body) in found.named_bodies.iter().take(MOST_LISTED).enumerate() {
            sheet.line(&format!("body {}", k + 1), &described(body));
        }
        if found.named_bodies.len() > MOST_LISTED {
            let more = found.named_bodies.len() - MOST_LISTED;
            sheet.line("bodies", &format!("{more} more, all in --format json"));
        }
        if let Some(reader) = &found.read_by {
            sheet.line("read by", reader);
        }
        if let Some(placed) = &inspection.placed {
            sheet.line("placed", &lies(placed));
        }
        if let Some(FileArgument::Path(path)) = &self.plot {
            sheet.line("drawn in", &path.display().to_string());
        }
        sheet.finish()
    }
}

/// Bodies that are listed on the screen.
const MOST_LISTED: usize = 12;

/// A body's name, assembly, colour and triangles.
fn described(body: &NamedBody) -> String {
    let mut text = vec![body.name.clone()];
    if !body.within.is_empty() {
        text.push(format!("in {}", body.within.join(" / ")));
    }
    if let Some(color) = body.color {
        let hex = color.map(|c| format!("{:02x}", (255.0 * c.clamp(0.0, 1.0)).round() as u8));
        text.push(format!("#{}", hex.concat()));
    }
    text.push(count(body.triangles, "triangle"));
    text.join(", ")
}

/// Where a placed surface lies.
fn lies(placed: &Placed) -> String {
    let corner = |c: &[f64; 3]| c.map(|v| number(v * 1e3)).join(", ");
    let mut text = format!(
        "from ({}) to ({}) mm",
        corner(&placed.bounds_min_m),
        corner(&placed.bounds_max_m)
    );
    if let (Some(min), Some(max)) = (&placed.workspace_min_m, &placed.workspace_max_m) {
        text += &format!(
            "; the workspace is ({}) to ({}) mm: {}",
            corner(min),
            corner(max),
            match placed.inside {
                Some(true) => "wholly inside",
                _ => "it reaches beyond (--fit DESIGN moves it in)",
            }
        );
    }
    text
}

/// The unit, as far as it is known.
fn unit(found: &MeshReport) -> String {
    if let Some(unit_m) = found.unit_m {
        return format!(
            "{}, as the file says or its format has it",
            unit_name(unit_m)
        );
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
    let bodies = count(found.bodies, "connected part");
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
