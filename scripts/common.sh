# Shared by the scripts of this folder: where things are, what is said, how they fail.
# shellcheck shell=bash
# shellcheck disable=SC2034  # root and jobs are for the scripts that source this file
root="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)"
command_name="scripts/$(basename "$0")"

say() { printf '== %s\n' "$*"; }

fail() {
  printf '%s: %s\n' "$command_name" "$*" >&2
  exit 1
}

# step "what it is" command...: says what is done and, if it fails, what failed in one last line.
step() {
  local what="$1"
  shift
  say "$what"
  local status=0
  "$@" || status=$?
  if ((status != 0)); then
    printf '%s: failed (exit %d): %s\n' "$command_name" "$status" "$what" >&2
    exit "$status"
  fi
}

# build PRESET [targets...]: configures and compiles, with the compiler's output on the terminal.
build() {
  local preset="$1"
  shift
  local targets=()
  if (($# > 0)); then targets=(--target "$@"); fi
  step "configure ($preset)" cmake --preset "$preset" --log-level=WARNING
  step "build ($preset) in build/$preset" cmake --build --preset "$preset" -j "$jobs" "${targets[@]}"
}

jobs="${GRAYBOX_JOBS:-$(nproc)}"
# BLAS threads of tests and solvers are chosen by graybox itself; see README, "how it is fair".
export OPENBLAS_NUM_THREADS="${OPENBLAS_NUM_THREADS:-1}"
export OMP_NUM_THREADS="${OMP_NUM_THREADS:-1}"
