//! Bundles on disk: three loaders give the same forces, a bundle is whole or absent, and damaged
//! or hostile bundles are refused with words that help.
#![allow(clippy::disallowed_methods, clippy::print_stderr)]

mod archives;
mod every_value;
mod forgeries;
mod hostile;
mod loaders;
mod vtk;
mod whole;
mod written;

use std::process::ExitCode;

fn main() -> ExitCode {
    let rooms = [
        archives::trials(),
        every_value::trials(),
        forgeries::trials(),
        hostile::trials(),
        loaders::trials(),
        vtk::trials(),
        whole::trials(),
        written::trials(),
    ];
    fluxform_testing::needs::run(rooms.into_iter().flatten())
}
