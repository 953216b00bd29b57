#!/usr/bin/env bash
# An ensemble as a job array of Slurm: sbatch examples/cluster/array.sh SCENARIO OUT.h5
# Each task does its share; the one that ends last writes the file. Send it again after a time limit: what is done stays.
#SBATCH --job-name=pendula
#SBATCH --array=1-16
#SBATCH --cpus-per-task=8
#SBATCH --time=01:00:00
#SBATCH --signal=TERM@60
set -euo pipefail
exec pendula ensemble "$1" -o "$2" --threads "$SLURM_CPUS_PER_TASK" \
  --shard "$SLURM_ARRAY_TASK_ID/$SLURM_ARRAY_TASK_COUNT"
