//! `init`: its arguments, its questions and its text.

use crate::choice::Choice;
use std::path::PathBuf;

use clap::Args;
use serde::Serialize;
use toml::Value;

use super::{Documents, Object, Refusal, Request, Start, documents};
use crate::RunError;
use crate::bundle::atomic::{FileSet, Overwrite};
use crate::cli::args::Writing;
use crate::cli::failure::Failure;
use crate::cli::help::{Codes, page};
use crate::cli::pictures::Picture;
use crate::cli::printer::{Printer, Stream, ask, can_ask};
use crate::cli::start::folder;
use crate::cli::values::{self, FileArgument, setting};
use crate::design::values::check_name;

/// Write a design and a shape to begin with
///
/// Writes NAME.toml, a design, and NAME_OBJECT.toml, a shape inside its workspace. Without --set both
/// calibrate as they are. The design has every key of a design (`fluxform keys design`), the shape those
/// of its primitive: keys that are set, and the others as comments, with unit, range, default and
/// meaning. At a terminal, without TEMPLATE, what to begin with is asked. Files that differ are replaced
/// only with --force.
#[derive(Debug, Args)]
#[command(after_long_help = page(Codes::Documents, &[
    ("fluxform init desk", "a small array in air, and a plate"),
    ("fluxform init seed --name mine --object wedge --out mine",
     "the reference array and a wedge, in a folder"),
    ("fluxform init desk --set array.pitch_mm=25 --set supply.current_max_a=1.5 --name wide",
     "with another pitch, which the workspace follows, and other drivers"),
]))]
pub struct Init {
    /// Design to begin with [default: prompted for at a terminal, else seed]
    #[arg(value_name = "TEMPLATE", value_parser = values::named::<Start>())]
    template: Option<Start>,
    /// The object
    #[arg(long, value_name = "OBJECT", value_parser = values::named::<Object>())]
    object: Option<Object>,
    /// Name of the design [default: that of the template]
    #[arg(long, value_name = "NAME")]
    name: Option<String>,
    /// Set a key of the design, like array.pitch_mm=40; may be repeated (`fluxform keys design`)
    #[arg(long, value_name = "KEY=VALUE", value_parser = setting)]
    set: Vec<(String, Value)>,
    /// Folder to write to
    #[arg(long, value_name = "DIR", default_value = ".")]
    out: FileArgument,
    /// Draw the array to scale, from above and cut along a row (.svg, .png or .pdf); `-` for standard
    /// output
    #[arg(long, value_name = "FILE", value_parser = values::picture)]
    plot: Option<FileArgument>,
    #[command(flatten)]
    writing: Writing,
}

/// The files that were written.
#[derive(Debug, Serialize)]
struct Written {
    design: PathBuf,
    shape: PathBuf,
}

impl Init {
    /// Runs the command.
    ///
    /// # Errors
    /// Settings that make no design; a file that is there already.
    pub fn run(&self, printer: &Printer) -> Result<(), Failure> {
        let folder = folder(&self.out)?;
        let asks = self.template.is_none() && !printer.json() && !printer.quiet();
        let request = if asks && can_ask() {
            self.asked()?
        } else {
            self.request(Start::Seed, Object::Flat)
        };
        let plot = (self.plot.as_ref())
            .map(|file| Picture::new(file, self.writing.force, None::<PathBuf>));
        if let Some(plot) = &plot {
            plot.check(&[])?;
        }
        let Documents {
            design,
            shape,
            array,
            named_files,
        } = documents(&request).map_err(|refusal| match refusal {
            Refusal::Setting(message) => Failure::Usage(message),
            Refusal::Design(fault) => Failure::Documents(vec![fault]),
        })?;
        let mut set = FileSet::begin(&folder, Overwrite::same_bytes(self.writing.force, &[]));
        for (name, text) in [&design, &shape] {
            set.write(name, |out| out.write_all(text.as_bytes()))
                .map_err(RunError::from)?;
        }
        set.commit().map_err(RunError::from)?;
        for file in named_files {
            let path = folder.join(&file.path);
            if !path.exists() {
                printer.warning(&format!(
                    "{}: {} does not exist: put it there before the design is used",
                    file.key(),
                    path.display()
                ));
            }
        }
        let beside = |name: &str| match folder.as_os_str() == "." {
            true => PathBuf::from(name),
            false => folder.join(name),
        };
        let written = Written {
            design: beside(&design.0),
            shape: beside(&shape.0),
        };
        let place = match (&plot, array) {
            (Some(plot), Some(array)) => plot.draw(&[], &array.drawing(), printer)?,
            _ => Stream::Output,
        };
        let json = printer.with_warnings(&written);
        printer.summary(place, &json, || text(&written))
    }

    fn request(&self, start: Start, object: Object) -> Request {
        Request {
            start: self.template.unwrap_or(start),
            object: self.object.unwrap_or(object),
            name: self.name.clone(),
            settings: self.set.clone(),
        }
    }

    /// Prompts for missing values; an empty answer takes the one in brackets.
    fn asked(&self) -> Result<Request, Failure> {
        let starts: Vec<String> = Start::ALL
            .iter()
            .map(|one| format!("  {:6}{}", one.name(), one.meaning()))
            .collect();
        let question = format!("What to begin with?\n{}\n", starts.join("\n"));
        let start = chosen(&question)?;
        let object = match self.object {
            Some(object) => object,
            None => {
                let names: Vec<_> = Object::ALL.iter().map(|one| one.name()).collect();
                chosen(&format!("The object: {}? ", names.join(", ")))?
            }
        };
        let mut request = self.request(start, object);
        if request.name.is_none() && !request.sets("name") {
            let name = |answer: &str| check_name(answer).map(|()| answer.to_owned());
            request.name = Some(answered("Name of the design? ", start.name(), name)?);
        }
        for (key, question) in [
            ("array.pitch_mm", "Distance of neighbouring coils, mm? "),
            ("supply.current_max_a", "Largest current of a coil, A? "),
        ] {
            if request.sets(key) || (key.starts_with("array") && start == Start::Coil) {
                continue;
            }
            let as_there = "as in the template";
            let number = |answer: &str| match answer.parse::<f64>() {
                _ if answer == as_there => Ok(None),
                Ok(value) if value > 0.0 && value.is_finite() => Ok(Some(value)),
                _ => Err(format!("{answer:?} is not a number above 0")),
            };
            if let Some(value) = answered(question, as_there, number)? {
                let given = setting(&format!("{key}={value}"));
                request.settings.push(given.map_err(Failure::Usage)?);
            }
        }
        Ok(request)
    }
}

/// A variant by its name, the first where the answer is empty.
fn chosen<T: Choice>(question: &str) -> Result<T, Failure> {
    let named = |answer: &str| {
        answer
            .parse()
            .map_err(|_| format!("{answer:?} is none of them"))
    };
    answered(question, T::VARIANTS[0].into(), named)
}

/// What `read` makes of an answer; where it says why it cannot, that and the question again.
fn answered<T>(
    question: &str,
    default: &str,
    read: impl Fn(&str) -> Result<T, String>,
) -> Result<T, Failure> {
    let mut asked = question.to_owned();
    loop {
        match read(&ask(&asked, default)?) {
            Ok(one) => return Ok(one),
            Err(why) => asked = format!("{why}\n{question}"),
        }
    }
}

fn text(written: &Written) -> String {
    let (design, shape) = (written.design.display(), written.shape.display());
    format!(
        "wrote {design} and {shape}\nnext: fluxform evaluate {design}\n      fluxform calibrate {design} {shape}\n"
    )
}
