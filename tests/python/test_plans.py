"""Plans and robust designs on arrays, designs of a robot: against closed forms and the command."""
import os
import shutil
import subprocess
import unittest

import numpy as np

import graybox
from sets import GRAYBOX, SOURCE, command, random_set
from test_designs import InFolder


class Plan(InFolder):
    def test_separate_parameters_have_a_closed_form(self):
        # Each candidate tells of one parameter: ceil(variance / allowed variance) times of it.
        deviations = np.array([0.5, 1.0, 2.0])
        H = np.eye(3)[:, :, None] * np.eye(3)[:, None, :] / deviations[:, None, None]**2
        plan = graybox.plan(H, "sd(all) <= 0.41")
        self.assertTrue(plan.proven)
        np.testing.assert_array_equal(plan.counts, np.ceil((deviations / 0.41)**2))
        self.assertEqual(plan.experiments, plan.counts.sum())
        self.assertEqual(plan.least, plan.experiments)
        for row, deviation, count in zip(plan.targets, deviations, plan.counts):
            self.assertAlmostEqual(row["reached"], deviation / np.sqrt(count), 9)
        self.assertIn("proven", repr(plan))
        # Twice the noise takes four times as many, as far as they are whole.
        twice = graybox.plan(H, "sd(all) <= 0.41", noise=2.0)
        np.testing.assert_array_equal(twice.counts, np.ceil((2 * deviations / 0.41)**2))
        # What was done counts, and stock may be too little.
        done = graybox.plan(H, "sd(all) <= 0.41", done=plan.counts - [0, 0, 3])
        np.testing.assert_array_equal(done.counts, [0, 0, 3])
        short = graybox.plan(H, "sd(all) <= 0.41", stock=[9, 9, 20], at_most=100)
        self.assertEqual(short.status, "out_of_reach")
        self.assertIsNone(short.counts)
        self.assertGreater(short.worst_ratio, 1.0)
        self.assertLessEqual(short.worst_ratio, 2 / np.sqrt(20) / 0.41 + 1e-9)
        self.assertIn("at least", repr(short))

    def test_the_cheapest_has_a_closed_form(self):
        # Two ways to learn each parameter: the better one for its money is taken, as often as needed.
        deviations = np.array([0.5, 1.0, 0.6, 0.8])
        H = np.zeros((4, 2, 2))
        H[[0, 1], 0, 0] = 1 / deviations[:2]**2
        H[[2, 3], 1, 1] = 1 / deviations[2:]**2
        costs = [3, 1, 2, 1]
        plan = graybox.plan(H, "sd(all) <= 0.2", costs=costs)
        self.assertTrue(plan.proven)
        # 25 units of information are needed: 4 a run for 3 or 1 for 1; 2.78 for 2 or 1.5625 for 1.
        pairs = [(a, b) for a in range(8) for b in range(26)]
        first = min(3 * a + b for a, b in pairs if 4 * a + b >= 25 - 1e-9)
        second = min(2 * a + b for a, b in pairs if a / 0.36 + b / 0.64 >= 25 - 1e-9)
        self.assertEqual(plan.cost, first + second)
        self.assertEqual(plan.least_cost, plan.cost)
        self.assertEqual(plan.cost, plan.counts @ costs)
        self.assertIn("experiments for", repr(plan))
        poor = graybox.plan(H, "sd(all) <= 0.2", costs=costs, budget=20)
        self.assertEqual(poor.status, "out_of_reach")
        with self.assertRaisesRegex(graybox.InputError, "costs: the curve counts"):
            graybox.precision_curve(H, [4], "sd(all) <= 0.2", costs=costs)

    def test_it_is_the_plan_of_the_command(self):
        H = random_set(40, 3, 5)
        file = self.saved(H)
        said = command("design", "plan", file, "--target", "sd(all) <= 0.3", "--detect", "0 by 0.5")
        plan = graybox.plan(H, ["sd(all) <= 0.3"], detect="0 by 0.5")
        self.assertEqual((plan.status, plan.experiments), (said["status"], said["experiments"]))
        for row, other in zip(plan.targets, said["targets"], strict=True):
            self.assertEqual(row["reached"], other["standard_error"])
            self.assertEqual(row["power"], other.get("power"))
        M = np.einsum("q,qij->ij", plan.counts, H)
        np.testing.assert_allclose([row["reached"] for row in plan.targets[:3]],
                                   np.sqrt(np.diag(np.linalg.inv(M))))
        curve = graybox.precision_curve(H, [plan.experiments - 1, plan.experiments],
                                        ["sd(all) <= 0.3"], detect="0 by 0.5")
        self.assertGreater(curve[0]["ratio"], 1.0)
        self.assertLessEqual(curve[1]["ratio"], 1.0)
        for row in curve:
            self.assertLessEqual(row["least_ratio"], row["ratio"] + 1e-9)

    def test_what_is_no_plan_is_refused(self):
        H = random_set(20, 3)
        for wrong in ({}, {"targets": "k1"}, {"targets": "sd(9) <= 1"},
                      {"targets": "sd(0) <= 1", "noise": 0.0},
                      {"targets": "sd(0) <= 1", "experiments": 5},
                      {"targets": "sd(0) <= 1", "budget": 5},
                      {"targets": "sd(0) <= 1", "block_sizes": [4, 4]},
                      {"targets": "sd(0) <= 1", "at_most": 0}):
            with self.assertRaises(graybox.InputError, msg=wrong):
                graybox.plan(H, **wrong)


class Robust(InFolder):
    def test_mirrored_samples_share_the_weight(self):
        a, b = (np.array(values).reshape(2, 1, 1) for values in ([1.0, 0.25], [0.25, 1.0]))
        design = graybox.robust([a, b], gap=1e-9)
        self.assertTrue(design.solved)
        np.testing.assert_allclose(design.weights, [0.5, 0.5], atol=1e-6)
        np.testing.assert_allclose(design.efficiencies, [0.625, 0.625], atol=1e-6)
        np.testing.assert_allclose(design.optima, [0, 0], atol=1e-9)
        self.assertTrue(design.certify().proves(1e-8))
        self.assertIn("worst_case", repr(design))

    def test_it_is_the_design_of_the_command(self):
        sets = [random_set(100, 4, seed) for seed in (1, 2, 3)]
        files = [self.saved(each, f"{k}.npy") for k, each in enumerate(sets)]
        for objective in ("worst_case", "average"):
            said = command("design", "robust", *files, "--objective", objective)
            design = graybox.robust(sets, objective=objective)
            self.assertEqual(design.status, "solved")
            self.assertEqual(design.value, said["objective"]["value"])
            np.testing.assert_array_equal(
                design.efficiencies, [each["efficiency"] for each in said["objective"]["samples"]])
            own = [np.linalg.slogdet(np.einsum("q,qij->ij", design.weights, each))[1] for each in sets]
            np.testing.assert_allclose(design.log_dets, own, atol=1e-9)
            self.assertTrue(design.certify().proves(1e-6))
        with self.assertRaisesRegex(graybox.InputError, "candidates"):
            graybox.robust([sets[0], sets[1][:50]])
        with self.assertRaises(graybox.InputError):
            graybox.robust([])

    def test_a_limit_on_the_heaviest_is_obeyed(self):
        H = random_set(100, 4)
        file = self.saved(H)
        said = command("design", "robust", file, "--largest-share", 0.3, "--of-positions", 0.05)
        design = graybox.concentrated(H, 0.3, 0.05)
        self.assertTrue(design.solved)
        self.assertAlmostEqual(design.log_det, said["log_det"], 10)
        self.assertLessEqual(np.sort(design.weights)[-5:].sum(), 0.3 + 1e-9)
        self.assertLess(design.log_det, graybox.solve(H).log_det)
        self.assertTrue(design.certify().proves(1e-6))
        with self.assertRaises(graybox.InputError):
            graybox.concentrated(H, 0.01, 0.05)


class Robot(InFolder):
    def test_a_set_of_the_robot(self):
        file = self.path("robot.h5")
        subprocess.run([GRAYBOX, "problem", "robot", "--grid", "30", "-o", file], check=True,
                       stdout=subprocess.DEVNULL)
        made = graybox.robot_set(grid=30)
        self.assertEqual(made.content_hash, graybox.InformationSet(file).content_hash)
        softer = graybox.robot_set(grid=30, stiffness=np.full(made.dimension, 0.5))
        self.assertNotEqual(softer.content_hash, made.content_hash)
        self.assertTrue(graybox.robust([made, softer]).solved)
        one = graybox.robot_set(grid=np.zeros((3, 6)))
        np.testing.assert_array_equal(one.packed[0], one.packed[2])
        for wrong in ({"grid": np.zeros((3, 5))}, {"grid": 0}, {"stiffness": [1.0], "grid": 5},
                      {"stiffness": -np.ones(made.dimension), "grid": 5}):
            with self.assertRaises(graybox.InputError):
                graybox.robot_set(**wrong)

    def test_spectrum_is_that_of_the_command(self):
        for limit in (1.0, 0.2):
            said = command("design", "spectrum", "--grid", 15, "--position-limit", limit,
                           "--threads", 1)
            design = graybox.spectrum(grid=15, position_limit=limit)
            self.assertEqual(design.status, "solved")
            self.assertEqual(design.covariance, said["covariance"])
            self.assertEqual(len(design.positions), said["positions"])
            self.assertLessEqual(design.shares.max(), limit + 1e-9)
            self.assertAlmostEqual(design.shares.sum(), 1.0, 9)
            self.assertEqual(design.coordinates.shape, (15 * design.lines, 8))
            proof = graybox.certify(design.information, design.weights)
            self.assertAlmostEqual(proof.log_det, design.log_det, 9)
            self.assertEqual(proof.proves(1e-6), limit == 1.0)

    def test_sequential_is_that_of_the_command(self):
        # The robot with 6 frequencies instead of 50: quick.
        source = os.path.join(SOURCE, "problems/robot/irb6600_like")
        with open(source + ".yaml") as file, open(self.path("quick.yaml"), "w") as quick:
            quick.write(file.read().replace("count: 50", "count: 6"))
        shutil.copy(source + ".urdf", self.path("irb6600_like.urdf"))
        said = command("design", "sequential", "--model", self.path("quick.yaml"), "--grid", 100,
                       "--repetitions", 1, "--stages", 1, "--experiments-per-stage", 14,
                       "--start-error", 0.1, "--noise", 1e-6)
        study = graybox.sequential(self.path("quick.yaml"), 100, repetitions=1, stages=1,
                                   experiments_per_stage=14, start_error=0.1, noise=1e-6,
                                   progress=False)
        self.assertEqual(study.repetitions, 1)
        self.assertEqual([(row["strategy"], row["stage"], row["parameter_error"])
                          for row in study.summary],
                         [(row["strategy"], row["stage"], row["parameter_error"])
                          for row in said["summary"]])
        self.assertEqual(len(study.records), 4 * 2)
        self.assertEqual(len(study.records[0]["theta"]), len(study.parameters))
        self.assertIn("oracle", repr(study))


if __name__ == "__main__":
    unittest.main()
