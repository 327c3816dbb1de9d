#!/usr/bin/env python3
"""The headers of an installation are the public ones, with what they include, and no others.

    tests/installed_headers_test.py INSTALLED SOURCE
"""
import re
import sys
from pathlib import Path

INSIDE = re.compile(r'^#include "((?:graybox/)?(?:problems|solvers|diagnosis)/[^"]+)"', re.MULTILINE)
HEAVY = re.compile(r"#include <(ceres|H5|hdf5|matio|kdl|CLI|arkode|fftw3|tinyxml|kainjow|Eigen/Eigenvalues)")


def main():
    installed, source = Path(sys.argv[1]) / "include" / "graybox", Path(sys.argv[2])
    there = {path.relative_to(installed).as_posix() for path in installed.rglob("*.hpp")}
    folders = {name.partition("/")[0] for name in there}
    public = [line for line in (source / "cmake/public_headers.txt").read_text().splitlines()
              if not line.startswith("#")]
    with_mpi = any("/distributed/" in name for name in there)
    entered = {name for name in public
               if name.partition("/")[0] in folders and (with_mpi or "/distributed/" not in name)}

    expected, waiting = set(), list(entered)
    while waiting:
        name = waiting.pop()
        if name not in expected:
            expected.add(name)
            waiting += INSIDE.findall((source / name).read_text())
    complaints = [f"{name}: is not installed" for name in sorted(expected - there)]
    complaints += [f"{name}: is installed, and no public header includes it" for name in sorted(there - expected)]

    for name in sorted(there):
        text = (installed / name).read_text()
        complaints += [f"{name}: includes {inside} from the repository's root"
                       for inside in INSIDE.findall(text) if not inside.startswith("graybox/")]
        complaints += [f"{name}: includes <{heavy}...>, which its users would need"
                       for heavy in HEAVY.findall(text)]

    page = (source / "docs/reference/stability.md").read_text()
    named = set(re.findall(r"`((?:problems|solvers|diagnosis)/[\w/]+\.hpp)`", page))
    complaints += [f"{name}: docs/reference/stability.md does not list it" for name in sorted(set(public) - named)]
    complaints += [f"{name}: is listed in docs/reference/stability.md, and is not public"
                   for name in sorted(named - set(public))]
    cpp = set(re.findall(r"`graybox/([\w/]+\.hpp)`", (source / "docs/reference/cpp.md").read_text()))
    complaints += [f"{name}: is named in docs/reference/cpp.md, and is not public" for name in sorted(cpp - set(public))]
    print("\n".join(complaints) if complaints else f"{len(there)} headers, {len(entered)} of them to begin with")
    return 1 if complaints or len(there) < 30 else 0


if __name__ == "__main__":
    sys.exit(main())
