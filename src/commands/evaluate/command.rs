//! `evaluate`: one coil as given.

use clap::Args;

use super::{Evaluation, LimitedBy, Transient, evaluate};
use crate::accuracy::StageAccuracy;
use crate::cli::args::{Tolerance, Writing};
use crate::cli::budget::{CostOrigin, allow};
use crate::cli::describe;
use crate::cli::documents;
use crate::cli::failure::{Failure, Wish};
use crate::cli::help::{Codes, page};
use crate::cli::layout::{Sheet, table};
use crate::cli::limits::limit_row;
use crate::cli::pictures;
use crate::cli::printer::{Printer, Stream};
use crate::cli::quantity::{force, mass, mm, number, number_to, percent, si, si_with_error};
use crate::cli::start::accuracy_check;
use crate::cli::start::begin;
use crate::cli::values::{self, FileArgument};
use crate::coil::limits::unchecked;
use crate::design::{Design, Driver, Need};
use crate::report::limits::label;
use crate::scene::core_material::MOST_PERMEABLE;
use crate::scene::cost::of_steel;
use crate::scene::field_slice;
use crate::scene::neighbours::{ArraySummary, IronSummary, WorkingPointSummary};
use crate::scene::single::{CoreSummary, MaterialKind, TargetSummary};

/// Evaluate one coil as given: circuit, field and force at the target, limits
///
/// Evaluates the coil of a design as it is given: turns, resistance, inductance, time constant,
/// wire and heat, the field and the force on the magnet at the target height, and which of the
/// design's [limits] it meets. With a steel core also the flux density in it at the rated current,
/// and when current and force settle after a voltage step, eddy currents in the steel included. Of
/// an array the inductance matrix is reported too, and the flux density in every core with all
/// coils at their rated currents and the largest with the currents whose fluxes add up in a core. A
/// core above its steel's knee is warned of. Limits that are not met are part of the result; with
/// --strict they end with exit code 4.
#[derive(Debug, Args)]
#[command(after_long_help = page(Codes::Reading, &[
    ("fluxform evaluate designs/seed.toml", "the seed's coil"),
    ("fluxform evaluate designs/seed_1010.toml --format json",
     "its steel by a magnetisation curve, for a program"),
    ("fluxform evaluate - --strict < designs/seed.toml || echo \"limits are not met\"",
     "from standard input, refusing limits that are not met"),
]))]
pub struct Evaluate {
    /// Design file (TOML), `-` for standard input
    #[arg(value_name = "DESIGN")]
    design: FileArgument,
    /// End with exit code 4 when a limit is not met
    #[arg(long)]
    strict: bool,
    /// Draw the array to scale, from above and cut along a row (.svg, .png or .pdf); `-` for standard
    /// output
    #[arg(long, value_name = "FILE", value_parser = values::picture)]
    plot: Option<FileArgument>,
    /// Draw the field in that section, with field lines
    ///
    /// With every coil at its rated current, along the B-H curve where there is one: |B| by its
    /// logarithm around the array, grey in and close to the surface of steel, and B_z over the workspace.
    #[arg(long, value_name = "FILE", value_parser = values::picture)]
    plot_field: Option<FileArgument>,
    #[command(flatten)]
    writing: Writing,
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
        let design = &document.design;
        let files = [&self.plot, &self.plot_field].map(Option::as_ref);
        let [plot, plot_field] = pictures::checked(files, self.writing.force, &document)?;
        let steel = of_steel(design, self.tolerance.tolerance);
        allow(steel, CostOrigin::Document, printer)?;
        let bar = begin(printer);
        let result = evaluate(design, vec![document.input], self.tolerance.tolerance)?;
        let field = match &plot_field {
            Some(_) => field_slice::picture(design, &bar)?,
            None => None,
        };
        drop(bar);
        for warning in &result.warnings {
            printer.warning(warning);
        }
        for warning in unchecked(&design.limits) {
            printer.warning(&warning);
        }
        let json = printer.with_warnings(&result);
        let mut place = Stream::Output;
        if let (Some(plot), Some(drawn)) = (&plot, &result.drawing) {
            place = plot.draw(&result.inputs, &drawn.drawing(), printer)?;
        }
        if let (Some(plot), Some(drawn)) = (&plot_field, field) {
            place = place.or(plot.draw(&result.inputs, &drawn.drawing(), printer)?);
        }
        printer.summary(place, &json, || summary(design, &result))?;
        accuracy_check(&result.accuracy_missed)?;
        if self.strict && !result.limits_met() {
            let unmet: Vec<String> = result
                .limits
                .iter()
                .filter(|(_, check)| !check.met)
                .map(|(name, _)| label(name))
                .collect();
            let message = format!("limits that are not met: {}", unmet.join(", "));
            return Err(Failure::Unmet(Wish::Limits, message));
        }
        Ok(())
    }
}

fn summary(design: &Design, result: &Evaluation) -> String {
    let (coil, target) = (&result.coil, &result.target);
    let circuit = &coil.circuit;
    let mut sheet = Sheet::new(&format!("{}: one coil as given", result.design));
    sheet.line(
        "coil",
        &format!(
            "{} turns of {} wire; {} to {} diameter, {} long",
            number(coil.turns),
            mm(design.wire.diameter_m),
            mm(coil.size.inner_diameter_m),
            mm(coil.size.outer_diameter_m),
            mm(coil.size.length_m)
        ),
    );
    let held = by_voltage(design);
    let flux = circuit.flux_linkage_wb.map_or_else(String::new, |flux| {
        format!("; flux linkage {}", si(flux, "Wb"))
    });
    sheet.line(
        "circuit",
        &format!(
            "{}, {}{flux}; time constant {}, settled after {}{held}",
            si(circuit.resistance_ohm, "ohm"),
            si(circuit.inductance_h, "H"),
            si(circuit.time_constant_s, "s"),
            si(circuit.settling_s, "s")
        ),
    );
    let steel_kg = result.core.as_ref().map_or(0.0, |core| core.mass_kg);
    let steel = result.core.as_ref().map_or_else(String::new, |core| {
        format!(" and {} of steel", mass(core.mass_kg))
    });
    sheet.line(
        "wire",
        &format!(
            "{} long, {}{steel}; {} of heat at {}",
            si(circuit.wire_length_m, "m"),
            mass(circuit.mass_kg - steel_kg),
            si(circuit.power_w, "W"),
            si(target.current_a, "A")
        ),
    );
    sheet.line("heat", &describe::heating(&result.heat));
    if let Some(core) = &result.core {
        sheet.line("core", &steel_core(core, target));
    }
    if let Some(transient) = &result.transient {
        let stage = result.accuracy.get("transient");
        sheet.line("step", &step(transient, stage));
    }
    sheet.line("target", &at_target(target));
    if let Some(array) = &result.array {
        add_array(&mut sheet, design, array, circuit.inductance_h);
    }
    let stages = result.accuracy.iter().map(|(name, stage)| (*name, stage));
    sheet.line("accuracy", &describe::accuracy(stages));
    sheet.gap();
    sheet.raw(&limits(result));
    sheet.finish()
}

/// Beside five time constants, where a current loop takes another time.
fn by_voltage(design: &Design) -> &'static str {
    match design.supply.driver {
        Driver::Current => " at a constant voltage",
        Driver::Voltage => "",
    }
}

/// The coils beside each other; `inductance_h` is that of one alone.
fn add_array(sheet: &mut Sheet, design: &Design, array: &ArraySummary, inductance_h: f64) {
    let matrix = &array.mutual_inductance_h;
    let others = matrix.iter().enumerate().flat_map(|(i, row)| {
        let other = move |(j, value): (usize, &f64)| (i != j).then_some(value.abs());
        row.iter().enumerate().filter_map(other)
    });
    let largest = others.fold(0.0, f64::max);
    let held = by_voltage(design);
    sheet.line(
        "array",
        &format!(
            "{}; largest mutual inductance {} ({} of a coil's own)\n\
             the slowest pattern of currents settles after {}{held}",
            describe::array(design),
            si(largest, "H"),
            percent(largest / inductance_h),
            si(array.settling_s, "s")
        ),
    );
    if let Some(point) = &array.working_point {
        sheet.line("", &all_at_once(array, point));
    }
    cores(sheet, design, array);
    if let Some(iron) = &array.iron {
        sheet.line("bodies", &bodies(iron));
    }
}

/// The steel of the coil alone.
fn steel_core(core: &CoreSummary, target: &TargetSummary) -> String {
    let permeability = number(core.relative_permeability);
    let material = match core.material {
        MaterialKind::Curve if core.relative_permeability >= MOST_PERMEABLE => {
            format!(
                "a B-H curve that starts level (infinite permeability, computed with {permeability})"
            )
        }
        MaterialKind::Curve => {
            format!("a B-H curve, relative permeability {permeability} at its origin")
        }
        MaterialKind::Linear => format!("relative permeability {permeability}"),
    };
    let mut text = format!(
        "{} diameter, {} long; {material}\n\
         |B| up to {} T, {} T on average at {}; the knee is at {} T",
        mm(2.0 * core.radius_m),
        mm(core.length_m),
        number_to(core.peak_field_t, 4),
        number_to(core.mean_field_t, 4),
        si(target.current_a, "A"),
        number_to(core.knee_t, 4)
    );
    if let Some(deviation) = core.deviation_from_linear {
        text.push_str(&format!(
            "\nforce {} {} than with the steel's permeability at low fields",
            percent(deviation.abs()),
            if deviation < 0.0 { "less" } else { "more" }
        ));
    }
    text
}

/// After a voltage step.
fn step(transient: &Transient, stage: Option<&StageAccuracy>) -> String {
    let relative = stage.map_or(0.0, |stage| stage.estimate);
    if let Some(eddies_s) = transient.eddies_95_s {
        return format!(
            "by the current loop 95 % of the current after {}, of the force {} later; limited by {}",
            si(transient.current_95_s, "s"),
            si_with_error(eddies_s, relative, "s"),
            match transient.limited_by {
                LimitedBy::TimeConstant => "the coil's time constant",
                LimitedBy::Voltage => "the supply's voltage",
                LimitedBy::Bandwidth => "the loop's bandwidth",
                LimitedBy::Eddies => "eddy currents in the core",
            }
        );
    }
    format!(
        "with eddy currents in the steel 95 % of the current after {}, of the force after {}",
        si_with_error(transient.current_95_s, relative, "s"),
        si_with_error(transient.force_95_s, relative, "s")
    )
}

fn way(force_n: f64) -> &'static str {
    match force_n {
        f if f > 0.0 => " up",
        f if f < 0.0 => " down",
        _ => "",
    }
}

/// Force and field at the target.
fn at_target(target: &TargetSummary) -> String {
    let mut text = format!(
        "{}{} on the magnet, {} above the coil at {}",
        force(target.force_n.abs()),
        way(target.force_n),
        mm(target.height_m),
        si(target.current_a, "A")
    );
    if let Some(pull) = target.passive_force_n {
        text.push_str(&format!(
            "\nof it {}{} by the unpowered steel",
            force(pull.abs()),
            way(pull)
        ));
    }
    let [x, y, _] = target.force_vector_n;
    if x != 0.0 || y != 0.0 {
        let vector = |values: [f64; 3], unit: &str| {
            // The rounding residue of a zero is printed as zero.
            let largest = values.iter().fold(0.0_f64, |most, v| most.max(v.abs()));
            let rounded = |v: f64| if v.abs() < 1e-12 * largest { 0.0 } else { v };
            values.map(|v| si(rounded(v), unit)).join(", ")
        };
        let of = target
            .passive_force_n
            .map_or("", |_| ", of the current alone");
        text.push_str(&format!(
            "\nforce along x, y, z {}\ntorque about x, y, z {}{of}",
            vector(target.force_vector_n, "N"),
            vector(target.torque_n_m, "N m")
        ));
    }
    text.push_str(&format!(
        "\nfield {}, gradient {}",
        si(target.field_t_per_a, "T/A"),
        si(target.gradient_t_per_m_per_a, "T/m/A")
    ));
    text
}

/// All coils at their rated currents, along the B-H curve.
fn all_at_once(array: &ArraySummary, point: &WorkingPointSummary) -> String {
    let linear = array
        .relative_permeability
        .map_or_else(String::new, |mu_r| {
            format!("linear with relative permeability {}; ", number(mu_r))
        });
    let flux = |start, pick: fn(f64, f64) -> f64| {
        si(
            point.flux_linkage_wb.iter().copied().fold(start, pick),
            "Wb",
        )
    };
    format!(
        "{linear}all coils at once {} off that along the B-H curve\n\
         flux linkage then from {} to {}",
        percent(point.deviation_from_linear),
        flux(f64::INFINITY, f64::min),
        flux(f64::NEG_INFINITY, f64::max)
    )
}

/// Flux density in the cores of an array, where they are coupled.
fn cores(sheet: &mut Sheet, design: &Design, array: &ArraySummary) {
    let peak: Option<Vec<f64>> = array.coils.iter().map(|coil| coil.peak_field_t).collect();
    let mean: Option<Vec<f64>> = array.coils.iter().map(|coil| coil.mean_field_t).collect();
    for (label, values) in [("core peak", peak), ("core mean", mean)] {
        if let Some(values) = values {
            let listed = describe::per_coil(design, "T", &values, 3);
            let (unit, rest) = listed.split_once('\n').unwrap_or((&listed, ""));
            let head = format!("|B| with all coils at their rated currents, {unit}");
            sheet.line(label, format!("{head}\n{rest}").trim_end());
        }
    }
    if let Some(most) = &array.largest_core_field {
        sheet.line(
            "core most",
            &format!(
                "up to {} T in core {} with currents whose fluxes add up, {}",
                number_to(most.peak_field_t, 4),
                most.coil,
                describe::currents(design, &most.currents_a)
            ),
        );
    }
}

/// The plate and other bodies of steel.
fn bodies(iron: &IronSummary) -> String {
    let tenths = |m: f64| number((1e4 * m).round() / 10.0 + 0.0);
    let mut text = match iron.peak_field_t.zip(iron.peak_at_m) {
        Some((peak_t, at_m)) => format!(
            "|B| up to {} T with all coils at their rated currents, at x, y, z = {} mm\nthe knee is at {} T",
            number_to(peak_t, 4),
            at_m.map(tenths).join(", "),
            number_to(iron.knee_t, 4)
        ),
        None => "not magnetised: relative_permeability = 1".to_owned(),
    };
    if let Some(pull) = iron.passive_force_n {
        text.push_str(&format!(
            "\n{}{} by all unpowered steel, at the target's height over the middle coil",
            force(pull.abs()),
            way(pull)
        ));
    }
    text
}

fn limits(result: &Evaluation) -> String {
    let head = ["limit", "value", "allowed", ""]
        .map(str::to_owned)
        .to_vec();
    let row = |(name, check): (&&str, &crate::coil::limits::LimitCheck)| {
        let state = if check.met { "met" } else { "NOT met" };
        limit_row(name, check.value, check.limit, state)
    };
    let rows: Vec<Vec<String>> = std::iter::once(head)
        .chain(result.limits.iter().map(row))
        .collect();
    table("lrrl", &rows)
}
