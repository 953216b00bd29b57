#!/usr/bin/env bash
# An ensemble on many nodes of Slurm at once: sbatch examples/cluster/mpi.sh SCENARIO OUT.h5
# Ranks take what is left, so that none waits for another. A minute before the time is over they write what they have, and
# the job puts itself into the queue again.
#SBATCH --job-name=pendula
#SBATCH --nodes=4
#SBATCH --ntasks-per-node=1
#SBATCH --cpus-per-task=32
#SBATCH --time=04:00:00
#SBATCH --signal=TERM@60
#SBATCH --requeue
set -uo pipefail
begun=()
if [ -d "$2.parts" ]; then begun=(--resume); fi
srun --kill-on-bad-exit=0 pendula ensemble "$1" -o "$2" --threads "$SLURM_CPUS_PER_TASK" "${begun[@]}"
status=$?
if [ "$status" -eq 3 ]; then scontrol requeue "$SLURM_JOB_ID"; fi
exit "$status"
