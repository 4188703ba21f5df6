//! `sweep`: a grid of designs, in three steps.

use super::{merge_command, plan_command, run_command};
use clap::{Args, Subcommand};

use crate::cli::failure::Failure;
use crate::cli::help::{Codes, page};
use crate::cli::printer::Printer;

/// Compute a grid of designs: plan it, run it in parts, merge the rows
///
/// `plan` writes down which values which keys of a design take. `run` computes the points of the
/// plan, all of them or one shard, each into a small file of its own: a run that was killed goes
/// on where it stopped, and shards may run on many machines that share a folder. `merge` joins the
/// points into one table, whatever computed them, and draws force against resistance, mass and
/// settling time.
#[derive(Debug, Args)]
#[command(
    subcommand_required = true,
    arg_required_else_help = true,
    after_long_help = page(Codes::Writing, &[
        ("fluxform sweep plan designs/seed_air.toml --set coil.turns=700:1300:300 --out plan.json",
         "three designs"),
        ("fluxform sweep run plan.json --out points", "compute them"),
        ("fluxform sweep merge plan.json points --out sweep.csv", "one table and one plot"),
    ])
)]
pub struct Sweep {
    #[command(subcommand)]
    step: Step,
}

#[derive(Debug, Subcommand)]
enum Step {
    Plan(plan_command::Plan),
    Run(run_command::Run),
    Merge(merge_command::Merge),
}

impl Sweep {
    /// Runs the command.
    ///
    /// # Errors
    /// See [`Failure`].
    pub fn run(&self, printer: &Printer) -> Result<(), Failure> {
        match &self.step {
            Step::Plan(step) => step.run(printer),
            Step::Run(step) => step.run(printer),
            Step::Merge(step) => step.run(printer),
        }
    }
}
