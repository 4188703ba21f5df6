//! The arguments that commands share, and the command line as a whole.

use clap::builder::NonEmptyStringValueParser;
use clap::{Args, ValueEnum};

use std::path::PathBuf;

use super::values;
use crate::force_direction::{ForceDirection, ForceOverride, NormalForce};
use crate::point_weights::Weights;
use crate::scene::sources::Sampling;
use crate::scene::tolerances::ErrorTarget;
use crate::shape::document::Up;
use crate::shape::step::STEP_SECONDS;
use crate::uncertainty::UncertaintyOverride;

/// Options of every command.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Common options")]
pub struct Common {
    /// How results are printed: a summary for people, or one JSON object in SI units
    #[arg(long, global = true, hide_short_help = true, value_enum, default_value_t = Format::Human)]
    pub format: Format,
    /// Say nothing but errors and the requested data (JSON, CSV, `--out -`)
    #[arg(short, long, global = true, hide_short_help = true)]
    pub quiet: bool,
    /// Threads to compute with [default: all cores]; results do not depend on it
    #[arg(long, global = true, hide_short_help = true, value_name = "N", value_parser = values::threads, allow_hyphen_values = true)]
    pub threads: Option<usize>,
    /// Memory that the data of a stage may take, like 20GB [default: three quarters of what is free];
    /// more is refused before anything is computed. The program itself takes some 50 MB, and data of
    /// earlier stages up to half as much again
    #[arg(long, global = true, hide_short_help = true, value_name = "SIZE", value_parser = values::memory)]
    pub memory: Option<u64>,
    /// Python that has OpenCASCADE (`pip install cadquery-ocp`), which reads STEP files [default:
    /// python3]
    #[arg(
        long,
        global = true,
        hide_short_help = true,
        value_name = "FILE",
        env = "FLUXFORM_PYTHON",
        hide_env_values = true
    )]
    pub python: Option<PathBuf>,
    /// Processor time that reading a STEP file may take, in seconds
    #[arg(long, global = true, hide_short_help = true, value_name = "N", default_value_t = STEP_SECONDS,
          value_parser = clap::value_parser!(u64).range(1..=1_000_000))]
    pub step_seconds: u64,
    /// Refuse a design that leaves a physical number to its default, naming every such key
    #[arg(long, global = true, hide_short_help = true)]
    pub strict_inputs: bool,
    /// Colours in messages; `auto` means on terminals, unless NO_COLOR is set
    #[arg(long, global = true, hide_short_help = true, value_enum, default_value_t = Colour::Auto, value_name = "WHEN")]
    pub color: Colour,
}

/// How results are printed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Format {
    /// A summary for people
    Human,
    /// One JSON object
    Json,
}

/// When messages are coloured.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Colour {
    /// On terminals, unless NO_COLOR is set
    Auto,
    /// Always
    Always,
    /// Never
    Never,
}

/// The allowed error.
#[derive(Debug, Clone, Copy, Args)]
pub struct Tolerance {
    /// Allowed error relative to |grad B| at the point (maps and steel: to the largest |grad B| at
    /// that height), 1e-15 to 1e-1 [default: in air 1e-12, its maps 1e-9, inductances between coils 1e-4; one
    /// coil with a steel core 1e-6, along its B-H curve 1e-4; arrays with coupled cores 1e-4, with
    /// other steel 1e-2]
    #[arg(long, hide_short_help = true, value_name = "T", value_parser = values::tolerance, allow_hyphen_values = true)]
    pub tolerance: Option<f64>,
}

/// How the points of a grid count.
#[derive(Debug, Clone, Copy, Args)]
pub struct WeightsFlag {
    /// How the points of a grid count in the mean over the object [default: as the shape file says,
    /// else equal]
    #[arg(long, hide_short_help = true, value_name = "RULE", value_parser = values::named::<Weights>())]
    pub weights: Option<Weights>,
}

/// The largest error that the computation may add.
#[derive(Debug, Clone, Copy, Args)]
pub struct ErrorFlags {
    /// Largest error of force and lambda, like 1%
    ///
    /// Largest error that the computation may add to the force, relative to the requested force, and to lambda:
    /// points, nodes and tolerances are chosen for it, points count by area; grids that documents or
    /// flags give are obeyed, and what they cause is reported. `lambda` and `calibrate` take 1 % for a shape
    /// whose points nobody gives.
    #[arg(long, value_name = "PART", value_parser = values::error, allow_hyphen_values = true)]
    error: Option<f64>,
    /// With --error: choose the samples also where documents give them; extents stay
    #[arg(long, hide_short_help = true, requires = "error")]
    refine: bool,
}

impl ErrorFlags {
    /// The requested error, if there is one.
    #[must_use]
    pub fn target(self) -> Option<ErrorTarget> {
        let refine = self.refine;
        self.error.map(|error| ErrorTarget {
            error,
            refine,
            by_default: false,
        })
    }
}

/// Where what is written may replace what is there.
#[derive(Debug, Clone, Copy, Args)]
pub struct Writing {
    /// Replace existing files too
    ///
    /// Also those that are not known to be output of the same inputs and options, unchanged since;
    /// never what is read.
    #[arg(long)]
    pub force: bool,
}

/// How a surface that is given directly, without a shape file, is to be taken.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Surfaces given directly (shape files say it themselves)")]
pub struct SurfaceFlags {
    /// mm, cm, m, in, ft, um; required for STL, OBJ, PLY, OFF, PNG
    #[arg(long, value_name = "UNIT", value_parser = values::unit)]
    pub unit: Option<f64>,
    /// Enlarge by a factor, or by factors along x, y and z, before anything else
    #[arg(long, hide_short_help = true, value_name = "S|X,Y,Z", value_parser = values::scale)]
    pub scale: Option<values::Scale>,
    /// Allow factors that differ, which change the surface's form
    #[arg(long, hide_short_help = true, requires = "scale")]
    pub stretch: bool,
    /// Rotate about x, then y, then z, in degrees, before translating
    #[arg(long, hide_short_help = true, value_name = "X,Y,Z", value_parser = values::rotation, allow_hyphen_values = true)]
    pub rotate: Option<values::Rotation>,
    /// Move by so much, in millimetres or with units (0,0,3cm)
    #[arg(long, hide_short_help = true, value_name = "X,Y,Z", value_parser = values::translation, allow_hyphen_values = true)]
    pub translate: Option<values::Translation>,
    /// The file's direction that points up: x, y, z, -x, -y or -z [default: z; the y of a GLB, which is up, is its z]
    #[arg(long, hide_short_help = true, value_name = "AXIS", value_parser = values::named::<Up>(), allow_hyphen_values = true)]
    pub up: Option<Up>,
    /// Bring the middle of the surface's box to x = y = 0
    #[arg(long, hide_short_help = true, conflicts_with = "fit")]
    pub center: bool,
    /// Put the lowest point of the surface at this height above the windings, like 20mm
    #[arg(long, hide_short_help = true, value_name = "LENGTH", value_parser = values::height, allow_hyphen_values = true,
          conflicts_with = "fit")]
    pub rest_on: Option<f64>,
    /// Move the surface into a box: to its middle in x and y, onto its lower end in z; a design
    /// (TOML) for its workspace, or X0,X1,Y0,Y1,Z0,Z1
    #[arg(
        long,
        hide_short_help = true,
        value_name = "DESIGN|BOX",
        allow_hyphen_values = true
    )]
    pub fit: Option<String>,
    /// Also scale it to fill that box
    #[arg(
        long,
        hide_short_help = true,
        requires = "fit",
        conflicts_with_all = ["center", "rest_on"]
    )]
    pub scale_to_fit: bool,
    /// STEP: farthest that a facet may lie from its face, like 0.01mm [default: a 4000th of the
    /// diagonal of the bodies' box]
    #[arg(long, hide_short_help = true, value_name = "LENGTH", value_parser = values::length_with_unit)]
    pub chord: Option<f64>,
    /// STEP: the one body or assembly to read, by name or number (see --inspect)
    #[arg(long, hide_short_help = true, value_name = "N|NAME", value_parser = NonEmptyStringValueParser::new())]
    pub body: Option<String>,
    /// Constraint points along x and y [default: 61x61; `lambda` and `calibrate`: as many as --error needs]
    #[arg(long, hide_short_help = true, value_name = "NxM", value_parser = values::grid_size)]
    pub grid: Option<values::GridSize>,
    /// Extent of the points along x, like -50,50 or -5cm,5cm [default: the surface's own]
    #[arg(long, hide_short_help = true, value_name = "FROM,TO", value_parser = values::ends, allow_hyphen_values = true)]
    pub x: Option<values::Ends>,
    /// Extent of the points along y [default: the surface's own]
    #[arg(long, hide_short_help = true, value_name = "FROM,TO", value_parser = values::ends, allow_hyphen_values = true)]
    pub y: Option<values::Ends>,
}

/// The force that is requested over a surface, in place of what its shape file states.
#[derive(Debug, Clone, Copy, Args)]
pub struct ForceFlags {
    /// Where the requested force points [default: the shape file's `force`, or vertical]
    #[arg(long, hide_short_help = true, value_name = "NAME", value_parser = values::named::<ForceDirection>())]
    pub force_direction: Option<ForceDirection>,
    /// How large a force along the normal is [default: the shape file's `normal_force`, or magnitude]
    #[arg(long, hide_short_help = true, value_name = "NAME", value_parser = values::named::<NormalForce>())]
    pub normal_force: Option<NormalForce>,
}

impl From<ForceFlags> for ForceOverride {
    fn from(flags: ForceFlags) -> Self {
        Self {
            direction: flags.force_direction,
            normal_force: flags.normal_force,
        }
    }
}

/// Uncertainties of the display in use, in place of those that its design states.
#[derive(Debug, Clone, Copy, Args)]
pub struct UncertaintyFlags {
    /// How far the magnet may be from where it is measured, along each axis, like 4mm [default: the
    /// design's `[uncertainty]`, as the next three]
    #[arg(long, hide_short_help = true, value_name = "LENGTH", value_parser = values::sensor_error, allow_hyphen_values = true)]
    sensor_error: Option<f64>,
    /// How far the finger may tilt the magnet, like 10deg
    #[arg(long, hide_short_help = true, value_name = "ANGLE", value_parser = values::tilt, allow_hyphen_values = true)]
    tilt: Option<f64>,
    /// How much warmer the magnet may become, like 20C
    #[arg(long, hide_short_help = true, value_name = "DEGREES", value_parser = values::heat, allow_hyphen_values = true)]
    heat: Option<f64>,
    /// By how much each driver's current may be off, like 2%
    #[arg(long, hide_short_help = true, value_name = "PART", value_parser = values::driver_error, allow_hyphen_values = true)]
    driver_error: Option<f64>,
    /// Mean power that currents chosen for the uncertainties may take, in watts [default: the least with
    /// which the error is within 5 % of the least]
    #[arg(long, hide_short_help = true, value_name = "WATTS", value_parser = values::power, allow_hyphen_values = true)]
    power_cap: Option<f64>,
}

impl From<UncertaintyFlags> for UncertaintyOverride {
    fn from(flags: UncertaintyFlags) -> Self {
        Self {
            sensor_m: flags.sensor_error,
            tilt_deg: flags.tilt,
            heat_c: flags.heat,
            driver: flags.driver_error,
            power_cap_w: flags.power_cap,
        }
    }
}

/// Flags of a grid's points, which points on no grid leave without effect.
const OF_A_GRID: [&str; 4] = ["weights", "error", "refine", "grid"];

/// Points on no grid.
///
/// What a flag requires may exclude others. clap drops the requirement where one of those is given, so
/// the flag itself excludes them too.
#[derive(Debug, Clone, Copy, Args)]
pub struct SamplingFlags {
    /// Choose points until bilinear patches between them lie this near to the surface (0.1mm)
    #[arg(
        long,
        hide_short_help = true,
        value_name = "LENGTH",
        value_parser = values::length_with_unit,
        conflicts_with_all = OF_A_GRID
    )]
    max_deviation: Option<f64>,
    /// No patch wider than this [default: for `discretize` no limit, for `lambda` a sixteenth of the
    /// lowest height, over which forces change little]
    #[arg(
        long,
        hide_short_help = true,
        value_name = "LENGTH",
        value_parser = values::length_with_unit,
        requires = "max_deviation",
        conflicts_with_all = OF_A_GRID
    )]
    max_width: Option<f64>,
    /// Choose points at random, none nearer to another than this (2mm)
    #[arg(
        long,
        hide_short_help = true,
        value_name = "SPACING",
        value_parser = values::length_with_unit,
        conflicts_with_all = ["max_deviation", "max_width"],
        conflicts_with_all = OF_A_GRID
    )]
    poisson: Option<f64>,
    /// Which random points
    #[arg(
        long,
        hide_short_help = true,
        value_name = "N",
        default_value_t = 0,
        requires = "poisson",
        conflicts_with_all = ["max_deviation", "max_width"],
        conflicts_with_all = OF_A_GRID
    )]
    seed: u64,
}

impl SamplingFlags {
    /// Requested places, if they are not the grid's points.
    #[must_use]
    pub fn sampling(self) -> Option<Sampling> {
        let graded = self
            .max_deviation
            .map(|max_deviation_m| Sampling::Adaptive {
                max_deviation_m,
                widest_m: self.max_width,
            });
        let seed = self.seed;
        graded.or(self
            .poisson
            .map(|spacing_m| Sampling::Poisson { spacing_m, seed }))
    }
}

impl SurfaceFlags {
    /// The flags that were given.
    #[must_use]
    pub fn given(&self) -> Vec<&'static str> {
        let flags = [
            (self.unit.is_some(), "--unit"),
            (self.scale.is_some(), "--scale"),
            (self.rotate.is_some(), "--rotate"),
            (self.translate.is_some(), "--translate"),
            (self.up.is_some(), "--up"),
            (self.center, "--center"),
            (self.rest_on.is_some(), "--rest-on"),
            (self.fit.is_some(), "--fit"),
            (self.chord.is_some(), "--chord"),
            (self.body.is_some(), "--body"),
            (self.grid.is_some(), "--grid"),
            (self.x.is_some(), "--x"),
            (self.y.is_some(), "--y"),
        ];
        flags
            .into_iter()
            .filter_map(|(given, name)| given.then_some(name))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::Tolerance;
    use crate::field::winding::KERNEL_ERROR;
    use crate::scene::tolerances::{
        CORED_TOLERANCE, COUPLED_TOLERANCE, IRON_TOLERANCE, MAP_TOLERANCE, SATURATED_TOLERANCE,
    };

    #[derive(clap::Parser)]
    struct Flags {
        #[command(flatten)]
        _tolerance: Tolerance,
    }

    #[test]
    fn regression_the_help_stated_another_tolerance_along_bh_curves() {
        let help = Flags::command().render_long_help().to_string();
        let help = help.split_whitespace().collect::<Vec<_>>().join(" ");
        for (of, default) in [
            ("in air", KERNEL_ERROR),
            ("its maps", MAP_TOLERANCE),
            ("one coil with a steel core", CORED_TOLERANCE),
            ("along its B-H curve", SATURATED_TOLERANCE),
            ("arrays with coupled cores", COUPLED_TOLERANCE),
            ("with other steel", IRON_TOLERANCE),
        ] {
            assert!(help.contains(&format!("{of} {default:e}")), "{of}: {help}");
        }
    }
}
