#!/usr/bin/env bash
# The drives of one array of many coupled cored coils as a Slurm job array: one task a part.
#
#   first=$(sbatch --parsable --array=1 scripts/calibrate_slurm.sh 4 display.toml face.toml --out results)
#   sbatch --array=2-4 --dependency=afterok:"$first" scripts/calibrate_slurm.sh 4 display.toml face.toml --out results
#   fluxform calibrate display.toml face.toml --out results
#
# The first argument is the number of parts. Part 1 decides how finely all are solved; one that begins
# without it decides that again, with the same result. A task that was killed is submitted again with the
# same line: blocks that are there are kept. OUT must be a folder that all nodes see, and the nodes'
# processors of one kind. FLUXFORM names the program where it is not on the PATH.
#SBATCH --job-name=fluxform-drives
#SBATCH --nodes=1
#SBATCH --ntasks=1
#SBATCH --output=drives-%A_%a.log
set -euo pipefail

parts=${1:?usage: sbatch --array=1-N calibrate_slurm.sh N DESIGN SHAPE... [--out OUT]}
shift
: "${SLURM_ARRAY_TASK_ID:?submit it as an array: sbatch --array=1-N}"

exec "${FLUXFORM:-fluxform}" calibrate "$@" --shard "$SLURM_ARRAY_TASK_ID/$parts" \
    --threads "${SLURM_CPUS_PER_TASK:-1}"
