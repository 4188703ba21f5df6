#!/usr/bin/env bash
# A small sweep as a cluster would run it, on this machine: with GNU parallel, as a Slurm job array
# under a Slurm of its own, started for this test and stopped at its end, and as Snakemake's workflow.
# The first two are killed half way and begun again; all are compared byte for byte with the sweep in one
# piece, and so are the drives of a coupled array in two parts.
#
#   tests/programs/cluster/run_local.sh path/to/fluxform [parallel|slurm|snakemake]
#
# Says "skipped: ..." for what cannot run here (Debian: apt-get install slurm-wlm parallel, the
# daemons need root; pip install snakemake). Ends with 0 when all that ran agreed.
set -euo pipefail

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
fluxform=$(realpath "${1:?usage: run_local.sh FLUXFORM [parallel|slurm|snakemake]}")
only=${2:-}
export FLUXFORM=$fluxform
work=$(mktemp -d)
daemons=()

finish() {
    for daemon in ${daemons[@]+"${daemons[@]}"}; do
        kill "$daemon" 2>/dev/null || true
        wait "$daemon" 2>/dev/null || true
    done
    rm -rf "$work"
}
trap finish EXIT

say() { echo "$*"; }

cd "$work"
cp "$root/designs/seed_air.toml" .
"$fluxform" -q sweep plan seed_air.toml --set target.height_mm=10:59.9:0.1 \
    --set coil.turns=700,1300,1429 --set coil.inner_diameter_mm=20,24 --out plan.json
points=3000
"$fluxform" -q sweep run plan.json --out whole --threads 1
"$fluxform" -q sweep merge plan.json whole --out whole.d/sweep.csv

# Waits until folder $1 holds $2 points.
wait_points() {
    for _ in $(seq 6000); do
        [ "$(find "$1/points" -name '[0-9]*.json' 2>/dev/null | wc -l)" -ge "$2" ] && return
        sleep 0.01
    done
    echo "failed: $1 never held $2 points" >&2
    exit 1
}

# Merges folder $1 and compares it with the whole.
compare() {
    "$fluxform" -q sweep merge plan.json "$1" --out "$1.d/sweep.csv"
    for file in sweep.csv sweep.svg sweep_pareto.csv; do
        cmp "whole.d/$file" "$1.d/$file"
    done
}

count() { find "$1/points" -name '[0-9]*.json' | wc -l; }

with_parallel() {
    if ! command -v parallel >/dev/null; then
        say "skipped: GNU parallel is not installed"
        return
    fi
    # In a group of its own, which is killed as one.
    setsid parallel -j 2 "$fluxform" -q sweep run plan.json --out by_parallel \
        --shard {}/7 --threads 1 ::: 1 2 3 4 5 6 7 >parallel.log 2>&1 &
    local group=$!
    wait_points by_parallel 500
    kill -KILL -- "-$group"
    wait "$group" 2>/dev/null || true
    local before
    before=$(count by_parallel)
    [ "$before" -lt "$points" ] || say "note: parallel was done before it was killed"
    parallel -j 2 "$fluxform" -q sweep run plan.json --out by_parallel \
        --shard {}/7 --threads 1 ::: 1 2 3 4 5 6 7
    compare by_parallel
    say "parallel: killed at $before of $points points, begun again, the same bytes"
}

write_slurm_conf() {
    local host port
    host=$(hostname -s)
    # Another of these may run beside it.
    port=$((20000 + 2 * ($$ % 10000)))
    mkdir -p slurm/state slurm/spool slurm/run
    cat >slurm/slurm.conf <<CONF
ClusterName=local
SlurmctldHost=$host(127.0.0.1)
SlurmUser=root
AuthType=auth/none
CredType=cred/none
MpiDefault=none
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
SchedulerType=sched/backfill
ReturnToService=2
SlurmctldPort=$port
SlurmdPort=$((port + 1))
StateSaveLocation=$work/slurm/state
SlurmdSpoolDir=$work/slurm/spool
SlurmctldPidFile=$work/slurm/run/slurmctld.pid
SlurmdPidFile=$work/slurm/run/slurmd.pid
SlurmctldLogFile=$work/slurm/slurmctld.log
SlurmdLogFile=$work/slurm/slurmd.log
KillWait=1
NodeName=$host NodeAddr=127.0.0.1 CPUs=$(nproc) State=UNKNOWN
PartitionName=all Nodes=$host Default=YES MaxTime=INFINITE State=UP
CONF
    # In a container Slurm's own choice of a cgroup plugin finds nothing to work with.
    echo "CgroupPlugin=cgroup/v1" >slurm/cgroup.conf
}

# Starts the daemons; says why where it cannot.
start_slurm() {
    local tool
    for tool in slurmctld slurmd sbatch scancel squeue sinfo; do
        if ! command -v "$tool" >/dev/null; then
            say "skipped: Slurm's $tool is not installed"
            return 1
        fi
    done
    if [ "$(id -u)" != 0 ]; then
        say "skipped: the Slurm daemons need root"
        return 1
    fi
    write_slurm_conf
    export SLURM_CONF=$work/slurm/slurm.conf
    slurmctld -D >slurm/slurmctld.out 2>&1 &
    daemons+=($!)
    slurmd -D >slurm/slurmd.out 2>&1 &
    daemons+=($!)
    for _ in $(seq 100); do
        if sinfo -h -o %t 2>/dev/null | grep -q '^idle'; then
            return 0
        fi
        sleep 0.2
    done
    say "skipped: the Slurm daemons do not come up here:"
    tail -n 3 slurm/*.log slurm/*.out 2>/dev/null || true
    return 1
}

drained() {
    for _ in $(seq 600); do
        [ -z "$(squeue -h)" ] && return
        sleep 0.2
    done
    echo "failed: jobs are still queued" >&2
    squeue >&2
    exit 1
}

with_slurm() {
    start_slurm || return 0
    local script=$root/scripts/sweep_slurm.sh job before
    job=$(sbatch --parsable --array=1-7 "$script" plan.json by_slurm)
    wait_points by_slurm 500
    scancel --signal=KILL "$job" || true
    scancel "$job"
    drained
    before=$(count by_slurm)
    [ "$before" -lt "$points" ] || say "note: Slurm was done before it was cancelled"
    sbatch --parsable --array=1-7 "$script" plan.json by_slurm >/dev/null
    drained
    compare by_slurm
    array_with_slurm
    say "slurm $(slurmctld -V | cut -d' ' -f2): cancelled at $before of $points points, submitted again, the same bytes"
}

# An array of 5 x 9 coupled cored coils, whose drives make two blocks.
write_array() {
    sed 's/rows = 3/rows = 5/; s/columns = 3/columns = 9/; s/, 61]/, 9]/; s/, 29]/, 5]/' \
        "$root/designs/seed.toml" >wide.toml
    printf 'name = "flat"\nprimitive = "flat"\n[points]\nx_mm = [-50.0, 50.0, 9]\ny_mm = [-50.0, 50.0, 9]\n' >flat.toml
    "$fluxform" -q calibrate wide.toml flat.toml --tolerance 1e-2 --threads 1 --out array_whole
}

# Calibrates in folder $1, whose blocks are there, and compares the bundles.
compare_array() {
    "$fluxform" -q calibrate wide.toml flat.toml --tolerance 1e-2 --threads 1 --out "$1"
    compare_bundles "$1"
}

compare_bundles() {
    local file
    for file in manifest.json map.npz lambda.json points.csv currents.csv; do
        cmp "array_whole/seed/flat/$file" "$1/seed/flat/$file"
    done
}

array_with_parallel() {
    command -v parallel >/dev/null || return 0
    local run=("$fluxform" -q calibrate wide.toml flat.toml --tolerance 1e-2 --threads 1 --out array_parallel)
    "${run[@]}" --shard 1/2
    parallel -j 2 "${run[@]}" --shard {}/2 ::: 1 2
    compare_array array_parallel
    say "parallel: the drives of an array in two parts, the same bytes"
}

array_with_slurm() {
    local script=$root/scripts/calibrate_slurm.sh first
    local of=(2 wide.toml flat.toml --tolerance 1e-2 --out array_slurm)
    first=$(sbatch --parsable --array=1 "$script" "${of[@]}")
    sbatch --parsable --array=2 --dependency=afterok:"$first" "$script" "${of[@]}" >/dev/null
    drained
    compare_array array_slurm
    say "slurm: the drives of an array in two parts, the same bytes"
}

with_snakemake() {
    if ! command -v snakemake >/dev/null; then
        say "skipped: Snakemake is not installed"
        return
    fi
    local set="target.height_mm=10:59.9:0.1 coil.turns=700,1300,1429 coil.inner_diameter_mm=20,24"
    snakemake -q all -s "$root/scripts/Snakefile" --cores 2 --config fluxform="$fluxform -q" \
        design=seed_air.toml shards=3 out=by_snakemake.d set="$set"
    cmp plan.json by_snakemake.d/plan.json
    for file in sweep.csv sweep.svg sweep_pareto.csv; do
        cmp "whole.d/$file" "by_snakemake.d/$file"
    done
    say "snakemake: the sweep in three parts, the same bytes"
    snakemake -q all -s "$root/scripts/Snakefile_calibrate" --cores 2 --config fluxform="$fluxform -q" \
        design=wide.toml shapes=flat.toml shards=2 out=array_snakemake options="--tolerance 1e-2"
    compare_bundles array_snakemake
    say "snakemake: the drives of an array in two parts, the same bytes"
}

write_array
case $only in
    "" | parallel) with_parallel && array_with_parallel ;;&
    "" | slurm) with_slurm ;;&
    "" | snakemake) with_snakemake ;;
esac
