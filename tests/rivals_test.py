#!/usr/bin/env python3
"""rivals_test.py GRAYBOX SOURCE: how scripts/rivals hand over sets and designs.

What is not installed stands in as tests/fake_modules; what is there runs in earnest.
"""
import importlib.util
import json
import os
import shutil
import subprocess
import sys
import tempfile
import unittest

if importlib.util.find_spec("numpy") is None:
    print("not here: NumPy")
    sys.exit(77)
GRAYBOX, SOURCE = map(os.path.abspath, sys.argv[1:3])
RIVALS = os.path.join(SOURCE, "scripts/rivals")
FAKES = os.path.join(SOURCE, "tests/fake_modules")


class Rival(unittest.TestCase):
    family = "wis"

    def setUp(self):
        self._folder = tempfile.TemporaryDirectory()
        self.addCleanup(self._folder.cleanup)
        self.set = self.made("set.h5", self.family)

    def made(self, name, family):
        file = os.path.join(self._folder.name, name)
        subprocess.run([GRAYBOX, "problem", "random", "--family", family, "--candidates", "60",
                        "--dimension", "4", "-o", file], check=True, stdout=subprocess.DEVNULL)
        return file

    def solve_by(self, command, gap, **variables):
        done = subprocess.run([GRAYBOX, "solve", self.set, "--solver", f"external:{command}", "--gap", str(gap),
                               "--json"], capture_output=True, text=True, env={**os.environ, **variables}, check=False)
        return json.loads(done.stdout)

    def assert_optimal(self, said, gap):
        self.assertEqual(said["status"], "solved", said)
        own = json.loads(subprocess.run([GRAYBOX, "solve", self.set, "--json"], capture_output=True,
                                        text=True, check=True).stdout)
        self.assertLess(abs(said["log_det"] - own["log_det"]), 4 * gap)


class Sdpt3(Rival):
    COMMAND = (f"octave-cli --eval \"addpath {RIVALS}; "
               "sdpt3_solver('{csv}', '{design}', {gap}, {seconds})\"")

    def setUp(self):
        if not shutil.which("octave-cli"):
            self.skipTest("not here: Octave")
        super().setUp()

    def test_set_and_design_are_handed_over(self):
        said = self.solve_by(self.COMMAND, 1e-4, OCTAVE_PATH=os.path.join(FAKES, "octave"))
        self.assert_optimal(said, 1e-4)

    def test_missing_it_says_so(self):
        said = self.solve_by(self.COMMAND, 1e-4, OCTAVE_PATH="")
        self.assertIn("SDPT3 is not here", said["message"])


class Rex(Rival):
    family = "r1g"
    COMMAND = f"Rscript {RIVALS}/rex_solver.R {{csv}}"

    def setUp(self):
        if not shutil.which("Rscript"):
            self.skipTest("not here: R")
        super().setUp()

    def test_set_and_design_are_handed_over_and_higher_ranks_refused(self):
        library = os.path.join(self._folder.name, "library")
        os.mkdir(library)
        subprocess.run(["R", "CMD", "INSTALL", "--no-docs", f"--library={library}",
                        os.path.join(FAKES, "OptimalDesign")], check=True, capture_output=True)
        self.assert_optimal(self.solve_by(self.COMMAND, 1e-4, R_LIBS=library), 1e-4)
        self.set = self.made("higher.h5", "wis")
        said = self.solve_by(self.COMMAND, 1e-4, R_LIBS=library)
        self.assertIn("REX takes rank one alone: candidate 0", said["message"])

    def test_missing_it_says_so(self):
        said = self.solve_by(self.COMMAND, 1e-4, R_LIBS="", R_LIBS_USER="", R_LIBS_SITE="/nowhere")
        self.assertIn("OptimalDesign is not here", said["message"])


class List(unittest.TestCase):
    def test_every_rival_is_here_or_absent(self):
        said = subprocess.run([os.path.join(RIVALS, "list")], capture_output=True, text=True, check=True).stdout
        rows = {line.split("\t")[0]: line.split("\t")[1:] for line in said.splitlines()}
        self.assertEqual(set(rows), {"cvxopt", "clarabel", "scs", "mosek", "sdpt3", "rex"})
        here = subprocess.run([os.path.join(RIVALS, "list"), "--here"], capture_output=True, text=True,
                              check=True).stdout.splitlines()
        self.assertEqual(here, [f"{name}={row[1]}" for name, row in rows.items() if row[0] == "here"])
        self.assertTrue(all(row[0] in ("here", "absent") and row[1] for row in rows.values()), rows)


class Cvxpy(Rival):
    def solve(self, name, gap, modules=None):
        return self.solve_by(f"{sys.executable} {RIVALS}/cvxpy_solver.py {{npy}} {name}", gap,
                             **({"PYTHONPATH": modules} if modules else {}))

    def test_set_and_design_are_handed_over(self):
        self.assert_optimal(self.solve("scs", 1e-4, FAKES), 1e-4)

    def test_a_solver_that_is_not_there_says_so(self):
        said = self.solve("mosek", 1e-4, FAKES)
        self.assertEqual(said["status"], "numerical_failure")
        self.assertIn("MOSEK is not here; CVXPY has SCS", said["message"])
        with tempfile.TemporaryDirectory() as empty:
            with open(os.path.join(empty, "cvxpy.py"), "w") as file:
                file.write("raise ImportError\n")
            self.assertIn("CVXPY is not here", self.solve("scs", 1e-4, empty)["message"])

    def test_in_earnest(self):
        if importlib.util.find_spec("cvxpy") is None:
            self.skipTest("not here: CVXPY")
        import cvxpy
        for name in {"CLARABEL", "SCS"} & set(cvxpy.installed_solvers()):
            self.assertEqual(self.solve(name, 1e-4)["status"], "solved", name)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
