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

COLUMNS=80 "$mpiexec" -n 1 "$graybox_mpi" --help > "$folder/help"
[[ "$(awk 'length > 80' "$folder/help" | wc -l)" == 0 ]] || fail "the help is wider than 80 columns"
[[ "$(wc -l < "$folder/help")" -le 50 ]] || fail "the help is longer than 50 rows"

code=0
"$mpiexec" -n 2 --oversubscribe "$graybox_mpi" "$folder/none.h5" 2> "$folder/errors" || code=$?
[[ "$code" == 2 ]] || fail "a missing file gave exit code $code, not 2"
[[ "$(grep -c 'graybox_mpi: .*none.h5' "$folder/errors")" == 1 ]] || fail "not one clear line"

# Finding S8: every format, the checker's figures, and no matrix that is none.
"$graybox" problem convert "$folder/set.h5" -o "$folder/set.npy"
"$mpiexec" -n 3 --oversubscribe "$graybox_mpi" "$folder/set.npy" --gap 1e-9 --json > "$folder/line"
grep -q '"status":"solved"' "$folder/line" || fail "not solved: $(cat "$folder/line")"
grep -q '"rounding_bound"' "$folder/line" || fail "no word of the checker"
printf -- '1,0,1\n1,0,2\n-1,0,-1\n' > "$folder/negative.csv"
code=0
"$mpiexec" -n 2 --oversubscribe "$graybox_mpi" "$folder/negative.csv" 2> "$folder/errors" || code=$?
[[ "$code" == 2 ]] || fail "an indefinite matrix gave exit code $code, not 2"
grep -q 'candidate 2' "$folder/errors" || fail "the candidate is not named: $(cat "$folder/errors")"

# Factors: the same design as of one process, and the same set by its hash; no matrices are made.
"$graybox" problem random --family r1g --candidates 3000 --dimension 6 --seed 4 --factors \
  -o "$folder/factors.h5"
"$graybox" solve "$folder/factors.h5" --gap 1e-13 --json -o "$folder/one.json" > "$folder/one" || true
for processes in 1 2; do
  "$mpiexec" -n "$processes" --oversubscribe "$graybox_mpi" "$folder/factors.h5" --gap 1e-13 --json \
    -o "$folder/shared.json" > "$folder/line" || true
  python3 - "$folder" "$processes" << 'EOF' || fail "factors: $processes processes differ from one"
import json, sys
folder, processes = sys.argv[1], int(sys.argv[2])
one, shared = (json.load(open(f"{folder}/{name}.json")) for name in ("one", "shared"))
lines = [json.load(open(f"{folder}/{name}")) for name in ("one", "line")]
assert lines[0]["problem_hash"] == lines[1]["problem_hash"] and lines[1]["processes"] == processes
assert abs(lines[0]["log_det"] - lines[1]["log_det"]) < 1e-9, lines
weights = [{row["index"]: row["weight"] for row in design["support"]} for design in (one, shared)]
for index in weights[0].keys() | weights[1].keys():
    assert abs(weights[0].get(index, 0.0) - weights[1].get(index, 0.0)) < 1e-9, (index, weights)
EOF
done
for i in 0 1 2 3 4 5 6 7 8; do echo "1,$i,$((i * i))"; done > "$folder/vectors.csv"
"$mpiexec" -n 2 --oversubscribe "$graybox_mpi" "$folder/vectors.csv" --factors --json > "$folder/line"
grep -q '"status":"solved".*"support_size":3' "$folder/line" || fail "vectors: $(cat "$folder/line")"
code=0
"$mpiexec" -n 2 --oversubscribe "$graybox_mpi" "$folder/set.h5" --factors 2> "$folder/errors" || code=$?
[[ "$code" == 2 ]] && grep -q 'leave it out' "$folder/errors" || fail "--factors of an HDF5 file"

# Large matrices take the memory of the set and of a few candidates beside it.
"$graybox" problem random --family wis --candidates 300 --dimension 150 -o "$folder/large.h5"
"$mpiexec" -n 2 --oversubscribe "$graybox_mpi" "$folder/large.h5" --gap 0.1 --json > "$folder/line"
bytes="$(sed -n 's/.*"peak_memory_bytes":\([0-9]*\).*/\1/p' "$folder/line")"
((bytes > 0 && bytes < 1000000000)) || fail "a set of 27 MB took $bytes bytes"

# As the other commands: the version with its commit, and a word where standard output fails.
"$graybox_mpi" --version | grep -q '^graybox [0-9.]* (commit ' || fail "no version"
[[ "$("$graybox_mpi" --version)" == "$("$graybox" --version)" ]] || fail "another version"
for flag in "" --json; do
  code=0
  # shellcheck disable=SC2086  # no word where there is no flag
  "$graybox_mpi" "$folder/set.h5" $flag > /dev/full 2> "$folder/errors" || code=$?
  [[ "$code" == 1 ]] || fail "a full standard output gave exit code $code, not 1"
  [[ "$(cat "$folder/errors")" == "graybox_mpi: standard output can't be written: "* ]] ||
    fail "no word of standard output: $(cat "$folder/errors")"
done
code=0
"$graybox_mpi" "$folder/set.h5" -o "$folder/set.h5" > /dev/null 2> "$folder/errors" || code=$?
[[ "$code" == 2 ]] || fail "an input was written over: exit code $code, not 2"
"$graybox" check "$folder/set.h5" "$folder/design.json" || fail "an input was written over"
