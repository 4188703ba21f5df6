//! A sweep as a cluster runs it: GNU parallel and a Slurm of its own, each killed half way and
//! begun again.
#![allow(clippy::print_stderr)] // what the script reports

#[path = "support/needs.rs"]
mod needs;

use std::path::Path;
use std::process::{Command, ExitCode};

use needs::trials;

fn main() -> ExitCode {
    needs::run(trials! {
        missing("parallel") => [shards_under_gnu_parallel],
        missing("sbatch") => [a_job_array_under_slurm],
    })
}

/// `tool`, where there is none. Slurm's report their version only where Slurm is configured.
fn missing(tool: &str) -> Option<String> {
    let look = format!("command -v {tool}");
    let there = Command::new("sh").args(["-c", &look]).output();
    let there = there.is_ok_and(|output| output.status.success());
    (!there).then(|| tool.to_owned())
}

fn run(with: &str) {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/cluster/run_local.sh");
    let output = Command::new("bash")
        .arg(script)
        .args([env!("CARGO_BIN_EXE_fluxform"), with])
        .output()
        .unwrap();
    let out = String::from_utf8_lossy(&output.stdout);
    let err = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{out}{err}");
    let ran = out.contains("the same bytes");
    assert!(ran || out.contains("skipped: "), "{out}{err}");
    eprint!("{out}");
}

fn shards_under_gnu_parallel() {
    run("parallel");
}

fn a_job_array_under_slurm() {
    run("slurm");
}
