//! Surfaces in files that need something of this machine: real ones, in the folder that
//! `FLUXFORM_CORPUS` names, and those that a script makes.
#![allow(clippy::print_stderr)]

mod heights;
mod index;
#[cfg(feature = "step")]
mod step;
mod stl;

use std::process::{Command, ExitCode};

use fluxform_testing::{needs, root, trials};

fn main() -> ExitCode {
    let mut all = trials! { needs::python() => [the_committed_shapes_are_what_the_script_makes] };
    all.extend(
        [heights::trials(), index::trials(), stl::trials()]
            .into_iter()
            .flatten(),
    );
    #[cfg(feature = "step")]
    all.extend(step::trials());
    needs::run(all)
}

fn the_committed_shapes_are_what_the_script_makes() {
    let folder = tempfile::tempdir().unwrap();
    let script = root().join("scripts/make_shapes.py");
    let mut python = Command::new("python3");
    let run = python.arg(script).arg(folder.path()).output().unwrap();
    let errors = String::from_utf8_lossy(&run.stderr);
    assert!(run.status.success(), "{errors}");
    for name in ["flat", "half_sphere", "half_cylinder", "wedge"] {
        for file in [
            format!("{name}.stl"),
            format!("{name}.toml"),
            format!("primitives/{name}.toml"),
        ] {
            let made = std::fs::read(folder.path().join(&file)).unwrap();
            let committed = std::fs::read(root().join("shapes").join(&file)).unwrap();
            assert!(
                made == committed,
                "shapes/{file} is not what scripts/make_shapes.py makes"
            );
        }
    }
}
