#!/usr/bin/env bash
# What a package holds is enough: the component `program`, installed elsewhere, solves and completes.
#   tests/installed_program_test.sh BUILD_FOLDER EXAMPLES WITH_DIAGNOSIS
set -euo pipefail
build="$1" examples="$2" with_diagnosis="$3"
folder="$(mktemp -d)"
trap 'rm -rf "$folder"' EXIT
cmake --install "$build" --component program --prefix "$folder/usr" > /dev/null
cd "$folder"
for file in bin/graybox libexec/graybox/graybox_reader share/graybox/robot/irb6600_like.urdf \
  share/doc/graybox/copyright share/bash-completion/completions/graybox \
  share/zsh/site-functions/_graybox share/fish/vendor_completions.d/graybox.fish; do
  test -s "usr/$file" || { echo "missing: $file"; exit 1; }
done
if compgen -G "usr/lib/*.a" > /dev/null || test -e usr/include; then
  echo "the program's package holds libraries or headers"
  exit 1
fi
usr/bin/graybox problem random --family wis --candidates 50 --dimension 4 -o set.h5
usr/bin/graybox solve set.h5 --gap 1e-9
usr/bin/graybox problem robot --grid 20 -o robot.h5
[[ "$with_diagnosis" == 1 ]] || exit 0
usr/bin/graybox export "$examples/simulate/drive.yaml" --to c | grep -q drive_force
bash --norc -c 'source usr/share/bash-completion/completions/graybox
  COMP_WORDS=(graybox expo); COMP_CWORD=1; _graybox; test "${COMPREPLY[*]}" = export'
