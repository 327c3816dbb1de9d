#!/usr/bin/env bash
# distributed_command_test.sh MPIEXEC GRAYBOX_MPI GRAYBOX: from a file to a certified design.
set -euo pipefail
mpiexec="$1" graybox_mpi="$2" graybox="$3"
folder="$(mktemp -d)"
trap 'rm -rf "$folder"' EXIT
fail() { echo "$*" >&2; exit 1; }

"$graybox" problem random --family wis --candidates 4000 --dimension 5 --seed 3 -o "$folder/set.h5"
"$mpiexec" -n 2 --oversubscribe "$graybox_mpi" "$folder/set.h5" --gap 1e-9 -o "$folder/design.json"
"$graybox" check "$folder/set.h5" "$folder/design.json" || fail "the checker refuses the design"

code=0
"$mpiexec" -n 2 --oversubscribe "$graybox_mpi" "$folder/none.h5" 2> "$folder/errors" || code=$?
[[ "$code" == 2 ]] || fail "a missing file gave exit code $code, not 2"
[[ "$(grep -c 'graybox_mpi: .*none.h5' "$folder/errors")" == 1 ]] || fail "not one clear line"
