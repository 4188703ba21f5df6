#!/usr/bin/env bash
# A sweep as a Slurm job array: one task a shard, as many shards as the array has tasks.
#
#   fluxform sweep plan design.toml --set wire.diameter_mm=0.5:1.0:0.05 --out plan.json
#   sbatch --array=1-16 scripts/sweep_slurm.sh plan.json points
#   fluxform sweep merge plan.json points --out sweep.csv
#
# A task that was killed or ran out of time is submitted again with the same line: points that are
# there are kept. Designs that cannot be computed are rows that say so, not failed tasks. The folder
# must be one that all nodes see. FLUXFORM names the program where it is not on the PATH.
#SBATCH --job-name=fluxform-sweep
#SBATCH --nodes=1
#SBATCH --ntasks=1
#SBATCH --output=sweep-%A_%a.log
set -euo pipefail

plan=${1:?usage: sbatch --array=1-N sweep_slurm.sh PLAN FOLDER}
folder=${2:?usage: sbatch --array=1-N sweep_slurm.sh PLAN FOLDER}
: "${SLURM_ARRAY_TASK_ID:?submit it as an array: sbatch --array=1-N}"

# Counted from the array's first task, so that --array=0-15 is as good as --array=1-16.
first=${SLURM_ARRAY_TASK_MIN:-1}
count=${SLURM_ARRAY_TASK_COUNT:?}
shard=$((SLURM_ARRAY_TASK_ID - first + 1))

exec "${FLUXFORM:-fluxform}" sweep run "$plan" --out "$folder" \
    --shard "$shard/$count" --threads "${SLURM_CPUS_PER_TASK:-1}" --allow-failed
