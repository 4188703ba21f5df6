//! A sweep as a cluster runs it: GNU parallel and a Slurm of its own, each killed half way and
//! begun again. Skips what is not installed, and says so.
#![cfg(unix)]
#![allow(clippy::print_stderr)] // what was skipped, and why

use std::path::Path;
use std::process::Command;

fn run(with: &str, tool: &str) {
    // Slurm's tools tell their version only where Slurm is configured.
    let look = format!("command -v {tool}");
    let there = Command::new("sh").args(["-c", &look]).output();
    if !there.is_ok_and(|output| output.status.success()) {
        eprintln!("skipped: no {tool}");
        return;
    }
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

#[test]
fn shards_under_gnu_parallel() {
    run("parallel", "parallel");
}

#[test]
fn a_job_array_under_slurm() {
    run("slurm", "sbatch");
}
