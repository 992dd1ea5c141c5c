#!/bin/sh
# SPDX-License-Identifier: GPL-3.0-or-later
# Slurm: one task of an array makes a chunk of the shots of an Octo Motion job.
#
#   SHOTS=1000 CHUNK=10
#   sbatch --array=1-$(( (SHOTS + CHUNK - 1) / CHUNK ))%50 --export=ALL,CHUNK=$CHUNK slurm.sh /shared/job.toml
#   sbatch --dependency=afterany:ID --wrap "blender --background --command octo_motion bake /shared/job.toml --gather"
#
# BLENDER is the Blender of the nodes, with the extension. A task that was stopped, crashed, or failed
# for a reason that may pass is put back into the queue, TRIES times at most.
#SBATCH --job-name=octo_motion
#SBATCH --requeue
#SBATCH --open-mode=append
#SBATCH --signal=B:TERM@30
set -u
chunk=${CHUNK:-10}
first=$(( (SLURM_ARRAY_TASK_ID - 1) * chunk + 1 ))
last=$(( first + chunk - 1 ))

"${BLENDER:-blender}" --background --command octo_motion bake "$1" --index "$first-$last" --here &
baking=$!
# Shortly before the time is over, Blender is asked to end; what is done by then stays done.
trap 'kill -TERM "$baking" 2>/dev/null' TERM
wait "$baking"
status=$?
while kill -0 "$baking" 2>/dev/null; do
    wait "$baking"
    status=$?
done

case $status in
    1 | 4 | 130 | 13[0-9] | 14[0-9])
        if [ "${SLURM_RESTART_COUNT:-0}" -lt "${TRIES:-3}" ]; then
            scontrol requeue "${SLURM_ARRAY_JOB_ID}_$SLURM_ARRAY_TASK_ID"
        fi ;;
esac
exit $status
