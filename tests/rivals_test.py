#!/usr/bin/env python3
"""rivals_test.py GRAYBOX SOURCE: how scripts/rivals hand over sets and designs.

What is not installed stands in as tests/fake_modules; what is there runs in earnest.
"""
import importlib.util
import json
import os
import subprocess
import sys
import tempfile
import unittest

if importlib.util.find_spec("numpy") is None:
    print("not here: NumPy")
    sys.exit(77)
GRAYBOX, SOURCE = sys.argv[1:3]
RIVALS = os.path.join(SOURCE, "scripts/rivals")
FAKES = os.path.join(SOURCE, "tests/fake_modules")


class Cvxpy(unittest.TestCase):
    def setUp(self):
        self._folder = tempfile.TemporaryDirectory()
        self.addCleanup(self._folder.cleanup)
        self.set = os.path.join(self._folder.name, "set.h5")
        subprocess.run([GRAYBOX, "problem", "random", "--family", "wis", "--candidates", "60",
                        "--dimension", "4", "-o", self.set], check=True, stdout=subprocess.DEVNULL)

    def solve(self, name, gap, modules=None):
        solver = f"external:{sys.executable} {RIVALS}/cvxpy_solver.py {{npy}} {name}"
        environment = {**os.environ, **({"PYTHONPATH": modules} if modules else {})}
        done = subprocess.run([GRAYBOX, "solve", self.set, "--solver", solver, "--gap", str(gap),
                               "--json"], capture_output=True, text=True, env=environment)
        return json.loads(done.stdout)

    def test_set_and_design_are_handed_over(self):
        said = self.solve("scs", 1e-4, FAKES)
        self.assertEqual(said["status"], "solved", said)
        own = json.loads(subprocess.run([GRAYBOX, "solve", self.set, "--json"], capture_output=True,
                                        text=True, check=True).stdout)
        self.assertLess(abs(said["log_det"] - own["log_det"]), 4 * 1e-4)

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
