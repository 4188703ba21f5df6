//! A sweep and a coupled array as a cluster runs them: GNU parallel and a Slurm of its own, each killed half
//! way and begun again, and Snakemake.

use std::process::Command;

use fluxform_testing::needs::Trial;
use fluxform_testing::run::program;
use fluxform_testing::{needs, root, trials};

pub fn trials() -> Vec<Trial> {
    trials! {
        needs::tool("parallel") => [shards_under_gnu_parallel],
        needs::tool("sbatch") => [a_job_array_under_slurm],
        needs::tool("snakemake") => [workflows_under_snakemake],
    }
}

fn run(with: &str) {
    let script = root().join("tests/programs/cluster/run_local.sh");
    let output = Command::new("bash")
        .arg(script)
        .args([program().to_str().unwrap(), with])
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

fn workflows_under_snakemake() {
    run("snakemake");
}
