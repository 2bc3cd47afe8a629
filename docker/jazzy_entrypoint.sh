#!/usr/bin/env bash
# Runs a command of the cell, or `exec -- COMMAND`, inside the workspace built by Dockerfile.jazzy.
set -e
source /emd/ros_ws/install/local_setup.bash
if [[ ${1:-} == exec ]]; then
    shift
    [[ ${1:-} == -- ]] && shift
    exec "$@"
fi
exec python -m emd_cell.cli "$@"
