"""Own callables as solvers: the checker decides, whatever they claim."""
import os
import time
import unittest

import numpy as np

import graybox
from sets import random_set


def multiplicative(problem):
    weights = np.full(len(problem.packed), 1 / len(problem.packed))
    H = problem.matrices
    for _ in range(20000):
        M = np.einsum("q,qij->ij", weights, H)
        sensitivity = np.einsum("ij,qij->q", np.linalg.inv(M), H)
        if sensitivity.max() / problem.dimension - 1 <= 0.9 * problem.gap:
            break
        weights *= sensitivity / problem.dimension
    return weights


def uniform(problem):
    return np.full(len(problem.packed), 1 / len(problem.packed))


def wrong_length(problem):
    return np.ones(3)


def throws(problem):
    raise RuntimeError("lost")


def dies(problem):
    os._exit(3)


def sleeps(problem):
    time.sleep(60)


def cheats(problem):
    problem.packed[:] = 1


class Study(unittest.TestCase):
    def test_the_checker_decides(self):
        H = random_set(40, 3)
        solvers = {each.__name__: each for each in (multiplicative, uniform, wrong_length, throws,
                                                    dies, sleeps, cheats)}
        study = graybox.study.run(solvers, {"small": H}, gap=1e-3, time_limit=2, repetitions=1)
        rows = {row.solver: row for row in study.rows}
        self.assertEqual(
            {name: row.status for name, row in rows.items()},
            {"multiplicative": "solved", "column_generation": "solved", "uniform": "claimed_but_wrong",
             "wrong_length": "claimed_but_wrong", "throws": "crashed", "dies": "crashed",
             "sleeps": "time_limit", "cheats": "crashed"})
        self.assertIn("lost", rows["throws"].message)
        self.assertIn("code 3", rows["dies"].message)
        self.assertLessEqual(rows["multiplicative"].gap, 1e-3)
        self.assertEqual(rows["uniform"].gap, graybox.certify(H, np.full(40, 1 / 40)).gap)
        self.assertIn("small, multiplicative", study._repr_html_())

    def test_repetitions_and_labels(self):
        study = graybox.study.run({"mine": multiplicative}, [random_set(20, 3), random_set(30, 3)],
                                  against=[], gap=1e-2, repetitions=2)
        self.assertEqual(len(study.rows), 4)
        self.assertEqual({(row.set, row.status) for row in study.best},
                         {("set 0", "solved"), ("set 1", "solved")})
        with self.assertRaisesRegex(graybox.InputError, "is taken"):
            graybox.study.run({"column_generation": uniform}, [random_set()])


if __name__ == "__main__":
    unittest.main()
