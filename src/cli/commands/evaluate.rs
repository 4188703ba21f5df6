//! `evaluate`: one coil as given.

use clap::Args;

use super::{accuracy_check, begin, describe};
use crate::cli::args::Tolerance;
use crate::cli::documents;
use crate::cli::failure::Failure;
use crate::cli::help::{Codes, page};
use crate::cli::layout::{Sheet, Side, table};
use crate::cli::printer::{Place, Printer};
use crate::cli::quantity::{force, mass, mm, number, percent, si};
use crate::cli::values::FileArgument;
use crate::design::{Design, Need};
use crate::job::evaluate::{Evaluation, evaluate};

/// Evaluate one coil as given: circuit, field and force at the target, limits
///
/// Evaluates the coil of a design as it is given: turns, resistance, inductance, time constant,
/// wire and heat, the field and the force on the magnet at the target height, and which of the
/// design's [limits] it meets. Of an array the inductance matrix is told besides. Limits that are
/// not met are part of the result; with --strict they end with exit code 4.
#[derive(Debug, Args)]
#[command(after_help = page(Codes::Reading, &[
    ("fluxform evaluate designs/seed_air.toml", "the seed's coil without steel"),
    ("fluxform evaluate designs/seed_air.toml --format json", "the same for a program"),
    ("fluxform evaluate - --strict < designs/seed_air.toml || echo \"limits are not met\"",
     "from standard input, refusing limits that are not met"),
]))]
pub struct Evaluate {
    /// Design file (TOML), `-` for standard input
    #[arg(value_name = "DESIGN")]
    design: FileArgument,
    /// End with exit code 4 when a limit is not met
    #[arg(long)]
    strict: bool,
    #[command(flatten)]
    tolerance: Tolerance,
}

impl Evaluate {
    /// Runs the command.
    ///
    /// # Errors
    /// See [`Failure`].
    pub fn run(&self, printer: &Printer) -> Result<(), Failure> {
        let document = documents::design(&self.design, Need::EVALUATE, printer)?;
        let bar = begin(printer);
        let design = &document.design;
        let result = evaluate(design, vec![document.input], self.tolerance.tolerance)?;
        drop(bar);
        let json = printer.with_warnings(&result);
        printer.summary(Place::Output, &json, || summary(design, &result))?;
        accuracy_check(result.accuracy_reached)?;
        if self.strict && !result.limits_met() {
            let unmet: Vec<String> = result
                .limits
                .iter()
                .filter(|(_, check)| !check.met)
                .map(|(name, _)| limit_name(name).0.to_owned())
                .collect();
            let message = format!("limits that are not met: {}", unmet.join(", "));
            return Err(Failure::Unmet(message));
        }
        Ok(())
    }
}

fn summary(design: &Design, result: &Evaluation) -> String {
    let (coil, target) = (&result.coil, &result.target);
    let mut sheet = Sheet::new(&format!("{}: one coil as given", result.design));
    sheet.line(
        "coil",
        &format!(
            "{} turns of {} wire; {} to {} diameter, {} long",
            number(coil.turns),
            mm(design.wire.diameter_m),
            mm(coil.inner_diameter_m),
            mm(coil.outer_diameter_m),
            mm(coil.length_m)
        ),
    );
    sheet.line(
        "circuit",
        &format!(
            "{}, {}; time constant {}, settled after {}",
            si(coil.resistance_ohm, "ohm"),
            si(coil.inductance_h, "H"),
            si(coil.time_constant_s, "s"),
            si(coil.settling_s, "s")
        ),
    );
    sheet.line(
        "wire",
        &format!(
            "{} long, {}; {} of heat at {}",
            si(coil.wire_length_m, "m"),
            mass(coil.mass_kg),
            si(coil.power_w, "W"),
            si(target.current_a, "A")
        ),
    );
    let way = match target.force_n {
        f if f > 0.0 => " up",
        f if f < 0.0 => " down",
        _ => "",
    };
    sheet.line(
        "target",
        &format!(
            "{}{way} on the magnet, {} above the coil at {}\nfield {}, gradient {}",
            force(target.force_n.abs()),
            mm(target.height_m),
            si(target.current_a, "A"),
            si(target.field_t_per_a, "T/A"),
            si(target.gradient_t_per_m_per_a, "T/m/A")
        ),
    );
    if let Some(array) = &result.array {
        let matrix = &array.mutual_inductance_h;
        let others = matrix.iter().enumerate().flat_map(|(i, row)| {
            let other = move |(j, value): (usize, &f64)| (i != j).then_some(value.abs());
            row.iter().enumerate().filter_map(other)
        });
        let largest = others.fold(0.0, f64::max);
        sheet.line(
            "array",
            &format!(
                "{}; largest mutual inductance {} ({} of a coil's own)",
                describe::array(design),
                si(largest, "H"),
                percent(largest / coil.inductance_h)
            ),
        );
    }
    let stages = result.accuracy.iter().map(|(name, stage)| (*name, stage));
    sheet.line("accuracy", &describe::accuracy(stages));
    sheet.gap();
    sheet.raw(&limits(result));
    sheet.finish()
}

fn limits(result: &Evaluation) -> String {
    let head = ["limit", "value", "allowed", ""]
        .map(str::to_owned)
        .to_vec();
    let row = |(name, check): (&&str, &crate::coil::limits::LimitCheck)| {
        let (label, unit) = limit_name(name);
        let told = |value: f64| match unit {
            "mm" => mm(value),
            "g" => mass(value),
            "" => number(value),
            unit => si(value, unit),
        };
        let sign = if *name == "inner_diameter_m" {
            ">="
        } else {
            "<="
        };
        vec![
            label.to_owned(),
            told(check.value),
            format!("{sign} {}", told(check.limit)),
            if check.met { "met" } else { "NOT met" }.to_owned(),
        ]
    };
    let rows: Vec<Vec<String>> = std::iter::once(head)
        .chain(result.limits.iter().map(row))
        .collect();
    table(&[Side::Left, Side::Right, Side::Right, Side::Left], &rows)
}

/// A limit's name on screen and its unit.
fn limit_name(key: &str) -> (&str, &'static str) {
    match key {
        "resistance_ohm" => ("resistance", "ohm"),
        "settling_s" => ("settling", "s"),
        "outer_diameter_m" => ("outer diameter", "mm"),
        "inner_diameter_m" => ("inner diameter", "mm"),
        "length_m" => ("length", "mm"),
        "power_w" => ("heat", "W"),
        "mass_kg" => ("mass", "g"),
        "wire_length_m" => ("wire length", "m"),
        "core_field_t" => ("core field", "T"),
        "winding_fill" => ("winding fill", ""),
        other => (other, ""),
    }
}
