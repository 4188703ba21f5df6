//! From the files on the command line to validated documents; every fault in one run.

use std::cell::RefCell;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use super::args::SurfaceFlags;
use super::failure::Failure;
use super::printer::Printer;
use super::values::{self, FileArgument, GridSize};
use crate::bundle::artefact::Input;
use crate::bundle::read_table::{TABLE_MAX_BYTES, read_columns};
use crate::bundle::scan::Scan;
use crate::bundle::sweep::PlanFile;
use crate::bundle::trajectory::Trajectory;
use crate::design::keys::Assumed;
use crate::design::message_text::shown_path;
use crate::design::{Design, Fault, Faults, InvalidDocument, Need, source};
use crate::scene::sources::ShapeSource;
use crate::shape::bodies::BodyOptions;
use crate::shape::document::{
    Fit, Placement, RawSurface, RawSurfaceError, Seat, ShapeDocument, SurfaceFormat,
};

/// Samples of a surface that says nothing of its grid.
const SAMPLES: GridSize = GridSize([61, 61]);

/// A design, its text, and its entry among the inputs.
#[derive(Debug)]
pub struct DesignDocument {
    /// Validated.
    pub design: Design,
    /// As read.
    pub text: String,
    /// Path as given, digest.
    pub input: Input,
}

impl DesignDocument {
    /// The other files that it names, which are read when the design is computed.
    pub fn also_read(&self) -> impl Iterator<Item = PathBuf> {
        self.design.named_files().into_iter().map(|file| file.path)
    }
}

/// The design that a command needs.
///
/// # Errors
/// Every fault in it.
pub fn design(
    file: &FileArgument,
    need: Need,
    printer: &Printer,
) -> Result<DesignDocument, Failure> {
    in_order(Some(file), &[])?;
    let (document, warnings) =
        read_design(file, need).map_err(|fault| Failure::Documents(vec![fault]))?;
    taken(&document, &warnings, printer)?;
    Ok(document)
}

/// Reports what there is to say of a design that was read.
///
/// # Errors
/// With `--strict-inputs`, every default that decides a number.
fn taken(document: &DesignDocument, warnings: &Faults, printer: &Printer) -> Result<(), Failure> {
    let assumed = &document.design.assumed;
    printer.document_warnings(warnings);
    if !printer.strict_inputs() || assumed.is_empty() {
        printer.assumed(assumed);
        return Ok(());
    }
    let named = |one: &Assumed| format!("{} = {}", one.key, one.value);
    let message = format!(
        "expected every number to be written (--strict-inputs); not written, with their defaults: {}",
        assumed.iter().map(named).collect::<Vec<_>>().join(", ")
    );
    let help = "write these keys; `fluxform keys` explains each";
    let fault = Fault::error("", message).help(help);
    let faults = Faults::new(Path::new(&document.input.path), &document.text, vec![fault]);
    Err(Failure::Documents(vec![InvalidDocument { faults }]))
}

/// The kind of a file, judged by its name and its first keys.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum FileKind {
    Design,
    Shape,
    Unknown,
}

impl FileKind {
    /// A surface by its ending, a document by the keys that only one kind has.
    fn of(file: &FileArgument) -> Self {
        let FileArgument::Path(path) = file else {
            return Self::Unknown;
        };
        if SurfaceFormat::of(path).is_some() {
            return Self::Shape;
        }
        let text = text_of(file).ok();
        let Some(table) = text.and_then(|text| text.parse::<toml::Table>().ok()) else {
            return Self::Unknown;
        };
        let has = |keys: &[&str]| keys.iter().any(|key| table.contains_key(*key));
        match (
            has(&["coil", "wire", "magnet", "supply"]),
            has(&["surface", "primitive"]),
        ) {
            (true, false) => Self::Design,
            (false, true) => Self::Shape,
            _ => Self::Unknown,
        }
    }
}

/// Refuses a shape where a design was expected, and a design where a shape was.
fn in_order(design: Option<&FileArgument>, shapes: &[FileArgument]) -> Result<(), Failure> {
    let shown = |file: &FileArgument| shown_path(file.as_given());
    if let Some(design) = design.filter(|file| FileKind::of(file) == FileKind::Shape) {
        let order = if shapes.is_empty() {
            "expected a DESIGN"
        } else {
            "the order is DESIGN SHAPE"
        };
        return Err(Failure::Usage(format!(
            "{} is a shape: {order}",
            shown(design)
        )));
    }
    match shapes
        .iter()
        .find(|file| FileKind::of(file) == FileKind::Design)
    {
        Some(shape) => Err(Failure::Usage(format!(
            "{} is a design: expected a SHAPE{}",
            shown(shape),
            if design.is_some() {
                " here; the order is DESIGN SHAPE"
            } else {
                ""
            }
        ))),
        None => Ok(()),
    }
}

/// A design and shapes.
///
/// # Errors
/// Every fault in any of them; wrong usage, such as a surface without a unit.
pub fn design_and_shapes(
    design_file: &FileArgument,
    need: Need,
    shape_files: &[FileArgument],
    flags: &SurfaceFlags,
    printer: &Printer,
) -> Result<(DesignDocument, Vec<ShapeSource>), Failure> {
    one_standard_input(std::iter::once(design_file).chain(shape_files))?;
    in_order(Some(design_file), shape_files)?;
    let design = read_design(design_file, need);
    let shapes = read_shapes(shape_files, flags);
    match (design, shapes) {
        (Ok((design, warnings)), Ok(shapes)) => {
            taken(&design, &warnings, printer)?;
            Ok((design, with_warnings(shapes, printer)))
        }
        (Err(fault), Err(Failure::Documents(mut faults))) => {
            faults.insert(0, fault);
            Err(Failure::Documents(faults))
        }
        // Wrong usage first: it is the quickest to mend.
        (_, Err(failure)) => Err(failure),
        (Err(fault), Ok(_)) => Err(Failure::Documents(vec![fault])),
    }
}

/// Shapes alone.
///
/// # Errors
/// As [`design_and_shapes`].
pub fn shapes(
    files: &[FileArgument],
    flags: &SurfaceFlags,
    printer: &Printer,
) -> Result<Vec<ShapeSource>, Failure> {
    in_order(None, files)?;
    Ok(with_warnings(read_shapes(files, flags)?, printer))
}

/// The points of a CSV table with columns `x_m,y_m,z_m`, and its entry among the inputs.
///
/// # Errors
/// Every cell that is not a number; a file that cannot be read.
pub fn points(file: &FileArgument) -> Result<(Vec<[f64; 3]>, Input), Failure> {
    let name = file.as_given().display().to_string();
    let bytes = bytes_of(file, "a CSV table with columns x_m,y_m,z_m")?;
    let columns = read_columns(&name, bytes.as_slice(), &["x_m", "y_m", "z_m"])?;
    has_rows(&name, columns[0].len(), "a point")?;
    let points = (0..columns[0].len())
        .map(|row| [columns[0][row], columns[1][row], columns[2][row]])
        .collect();
    Ok((points, Input::of_bytes(name, &bytes)))
}

/// A gaussmeter's scan over an array of `coils`, and its entry among the inputs.
///
/// # Errors
/// Missing columns, cells that are no numbers, a file that cannot be read.
pub fn scan(file: &FileArgument, coils: usize) -> Result<(Scan, Input), Failure> {
    let name = file.as_given().display().to_string();
    let bytes = bytes_of(
        file,
        "a CSV table with columns x_m,y_m,z_m and what was measured",
    )?;
    let scan = Scan::read(&name, &bytes, coils)?;
    has_rows(&name, scan.rows(), "a measurement")?;
    Ok((scan, Input::of_bytes(name, &bytes)))
}

/// Refuses a table of no rows; `what` a row holds.
fn has_rows(name: &str, rows: usize, what: &str) -> Result<(), Failure> {
    if rows == 0 {
        let message =
            format!("{name}: the table has a header and no rows: expected {what} per row");
        return Err(Failure::Input(message));
    }
    Ok(())
}

/// A trajectory, and its entry among the inputs.
///
/// # Errors
/// Every cell that is not a number; time that runs backwards; a file that cannot be read.
pub fn trajectory(file: &FileArgument) -> Result<(Trajectory, Input), Failure> {
    let name = file.as_given().display().to_string();
    let bytes = bytes_of(file, "a CSV table with columns t_s,x_m,y_m,z_m")?;
    let trajectory = Trajectory::read(&name, bytes.as_slice())?;
    Ok((trajectory, Input::of_bytes(name, &bytes)))
}

/// The plan of a sweep, and its entry among the inputs.
///
/// # Errors
/// A file that cannot be read, that is not a plan, or a plan that was edited.
pub fn plan(file: &FileArgument) -> Result<(PlanFile, Input), Failure> {
    let name = file.as_given().display().to_string();
    let bytes = bytes_of(file, "the plan of a sweep")?;
    let plan = PlanFile::parse(&name, &bytes).map_err(Failure::Input)?;
    Ok((plan, Input::of_bytes(name, &bytes)))
}

/// The bytes of a file or of standard input; `what` was expected.
fn bytes_of(file: &FileArgument, what: &str) -> Result<Vec<u8>, Failure> {
    let path = file.as_given();
    let name = path.display();
    if file.is_standard() {
        let mut bytes = Vec::new();
        let stream = io::stdin().lock();
        let read = stream.take(TABLE_MAX_BYTES + 1).read_to_end(&mut bytes);
        read.map(|_| bytes)
    } else if path.is_dir() {
        let message = format!("{name}: expected {what}, found a directory");
        return Err(Failure::Input(message));
    } else {
        let mut bytes = Vec::new();
        let read = std::fs::File::open(path)
            .and_then(|file| file.take(TABLE_MAX_BYTES + 1).read_to_end(&mut bytes));
        read.map(|_| bytes)
    }
    .map_err(|error| Failure::Input(format!("{name}: cannot be read: {error}")))
}

/// At most one of `files` may be standard input.
///
/// # Errors
/// Wrong usage.
pub fn one_standard_input<'a>(
    files: impl IntoIterator<Item = &'a FileArgument>,
) -> Result<(), Failure> {
    let standard = files.into_iter().filter(|file| file.is_standard()).count();
    if standard > 1 {
        let message = format!("standard input (-) was named {standard} times: it is read once");
        return Err(Failure::Usage(message));
    }
    Ok(())
}

thread_local! {
    /// Documents in memory, with their names.
    static GIVEN: RefCell<Vec<(PathBuf, String)>> = const { RefCell::new(Vec::new()) };
}

/// From now on this thread reads `documents` in place of the files of their names.
pub fn give(documents: Vec<(PathBuf, String)>) {
    GIVEN.replace(documents);
}

fn text_of(file: &FileArgument) -> Result<String, InvalidDocument> {
    match file {
        FileArgument::Standard => source::text_from(io::stdin().lock(), Path::new("-")),
        FileArgument::Path(path) => {
            let given = GIVEN.with_borrow(|given| {
                let named = given.iter().find(|(name, _)| name == path);
                named.map(|(_, text)| text.clone())
            });
            given.map_or_else(|| source::text_of(path), Ok)
        }
    }
}

fn input_of(path: &Path, text: &str) -> Input {
    Input::of_bytes(path.display().to_string(), text.as_bytes())
}

fn read_design(
    file: &FileArgument,
    need: Need,
) -> Result<(DesignDocument, Faults), InvalidDocument> {
    let text = text_of(file)?;
    let path = file.as_given();
    let (design, warnings) = Design::from_toml(&text, path, need)?;
    let input = input_of(path, &text);
    let document = DesignDocument {
        design,
        text,
        input,
    };
    Ok((document, warnings))
}

/// A shape, and the warnings where a document describes it.
type ReadShape = (ShapeSource, Option<Faults>);

fn with_warnings(shapes: Vec<ReadShape>, printer: &Printer) -> Vec<ShapeSource> {
    let warn = |(shape, warnings): ReadShape| {
        if let Some(warnings) = warnings {
            printer.document_warnings(&warnings);
        }
        shape
    };
    shapes.into_iter().map(warn).collect()
}

/// Whether a shape is described by a document (as opposed to a surface given directly).
#[must_use]
pub fn is_document(file: &FileArgument) -> bool {
    file.is_standard()
        || file
            .as_given()
            .extension()
            .is_some_and(|ending| ending.eq_ignore_ascii_case("toml"))
}

fn read_shapes(files: &[FileArgument], flags: &SurfaceFlags) -> Result<Vec<ReadShape>, Failure> {
    let given = flags.given();
    if !given.is_empty() && files.iter().all(is_document) {
        return Err(Failure::Usage(format!(
            "{} cannot be used with a shape file ({}): the file itself says it, with unit, \
             translate_mm, rotate_deg and [points]; the flags are for a surface given directly",
            given.join(" "),
            files[0].as_given().display()
        )));
    }
    let mut shapes = Vec::new();
    let mut refused = Vec::new();
    for file in files {
        if !is_document(file) {
            shapes.push((raw_surface(file.as_given(), flags)?, None));
            continue;
        }
        let read = text_of(file).and_then(|text| {
            let path = file.as_given();
            let (document, warnings) = ShapeDocument::from_toml(&text, path)?;
            let input = Some(input_of(path, &text));
            Ok((ShapeSource { document, input }, Some(warnings)))
        });
        match read {
            Ok(shape) => shapes.push(shape),
            Err(fault) => refused.push(fault),
        }
    }
    if refused.is_empty() {
        Ok(shapes)
    } else {
        Err(Failure::Documents(refused))
    }
}

/// How the flags ask for the bodies of a STEP file.
#[must_use]
pub fn bodies(flags: &SurfaceFlags) -> BodyOptions {
    BodyOptions {
        chord_m: flags.chord,
        body: flags.body.clone(),
    }
}

/// Where the flags put a surface by its box.
fn seat(flags: &SurfaceFlags) -> Result<Seat, Failure> {
    let fit = flags.fit.as_deref().map(workspace).transpose()?;
    Ok(Seat {
        up: flags.up.unwrap_or_default(),
        center: flags.center,
        rest_on_m: flags.rest_on,
        fit: fit.map(|box_m| Fit {
            box_m,
            scale: flags.scale_to_fit,
        }),
    })
}

/// The box that `--fit` names: a design's workspace, or its ends.
fn workspace(text: &str) -> Result<[[f64; 2]; 3], Failure> {
    let path = PathBuf::from(text);
    let toml = path
        .extension()
        .is_some_and(|ending| ending.eq_ignore_ascii_case("toml"));
    if !toml {
        return values::box_of(text)
            .map_err(|what| Failure::Usage(format!("--fit {text}: {what}")));
    }
    let (document, _) = read_design(&FileArgument::Path(path), Need::MAP)
        .map_err(|fault| Failure::Documents(vec![fault]))?;
    let workspace = document.design.workspace;
    Ok([workspace.x_m, workspace.y_m, workspace.z_m].map(|axis| [axis.from, axis.to]))
}

fn raw_surface(path: &Path, flags: &SurfaceFlags) -> Result<ShapeSource, Failure> {
    if path.is_dir() {
        return Err(Failure::Input(format!(
            "{}: expected a shape file (.toml) or a surface, found a directory; name the file \
             inside it",
            path.display()
        )));
    }
    let scale = flags.scale.map_or([1.0; 3], |scale| scale.0);
    if !flags.stretch && scale.iter().any(|factor| *factor != scale[0]) {
        return Err(Failure::Usage(
            "--scale with different factors changes the surface's form; add --stretch if that is \
             meant"
                .to_owned(),
        ));
    }
    let surface = RawSurface {
        scale,
        path: path.to_owned(),
        unit_m: flags.unit,
        bodies: bodies(flags),
        placement: Placement {
            translate_m: flags.translate.map_or([0.0; 3], |t| t.0),
            rotate_deg: flags.rotate.map_or([0.0; 3], |r| r.0),
            seat: seat(flags)?,
        },
        samples: flags.grid.unwrap_or(SAMPLES).0,
        samples_are_given: flags.grid.is_some(),
        x_m: flags.x.map(|ends| ends.0),
        y_m: flags.y.map(|ends| ends.0),
    };
    let document = ShapeDocument::raw(&surface).map_err(|error| match error {
        RawSurfaceError::UnknownFormat { .. } => Failure::Input(error.to_string()),
        RawSurfaceError::UnitNeeded { .. } => Failure::SurfaceUnit(error.to_string()),
        _ => Failure::Usage(error.to_string()),
    })?;
    Ok(ShapeSource {
        document,
        input: None,
    })
}
