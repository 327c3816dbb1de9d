"""Designs as files: whatever solve() and exact() find is proven by the command and read again."""
import json
import unittest

import numpy as np

import graybox
from sets import command, random_set, refusal
from test_designs import InFolder


class DesignFiles(InFolder):
    def setUp(self):
        super().setUp()
        self.H = random_set(40, 4, 11)
        self.set = self.saved(self.H)
        self.file = self.path("design.json")
        group = (np.arange(40) < 15).astype(float)
        done = np.zeros(40)
        done[[2, 30]] = 2
        self.request = {"experiments": 9, "stock": np.full(40, 2.0), "prior": 0.3 * np.eye(4),
                        "done": done, "require": "7", "forbid": "20-24", "A_ub": group[None],
                        "b_ub": [3.0], "A_eq": (np.arange(40) >= 30).astype(float), "b_eq": [4.0]}

    def again(self, design):
        """Saves, and reads it again with the matrices in memory."""
        design.save(self.file)
        return graybox.load_design(self.H, self.file)

    def test_requests_in_numbers_are_in_the_file(self):
        for criterion in ("D", "A", "E", {"D": 0.5, "E": 0.5}):
            design = graybox.solve(self.H, criterion, gap=1e-5, **self.request)
            self.assertTrue(design.solved, repr(design))
            read = self.again(design)
            said = command("check", self.set, self.file)
            self.assertEqual(said["status"], "solved")
            self.assertAlmostEqual(said["duality_gap"], design.gap, 10)
            self.assertEqual(read.status, "solved")
            self.assertAlmostEqual(read.gap, design.gap, 10)
            np.testing.assert_allclose(read.efforts, design.efforts, rtol=1e-12, atol=1e-12)
            self.assertAlmostEqual(read.certify(gap=1e-3).gap, design.gap, 10)
        with open(self.file) as file:
            numbers = json.load(file)["request"]["numbers"]
        self.assertEqual(set(numbers), {"prior", "done", "stock", "rows"})

    def test_a_changed_row_is_told(self):
        graybox.solve(self.H, gap=1e-5, **self.request).save(self.file)
        with open(self.file) as file:
            root = json.load(file)
        root["request"]["numbers"]["rows"][0]["upper"] = 2.0
        with open(self.file, "w") as file:
            json.dump(root, file)
        self.assertIn("have changed", refusal("check", self.set, self.file))
        with self.assertRaisesRegex(graybox.InputError, "have changed"):
            graybox.load_design(self.H, self.file)

    def test_numbers_that_are_none_are_refused(self):
        graybox.solve(self.H, gap=1e-5, **self.request).save(self.file)
        with open(self.file) as file:
            root = json.load(file)
        for key, value in (("stock", 3), ("rows", {}), ("rows", [1]), ("done", ["x"])):
            broken = json.loads(json.dumps(root))
            broken["request"]["numbers"][key] = value
            with open(self.file, "w") as file:
                json.dump(broken, file)
            line = refusal("check", self.set, self.file)
            self.assertIn("request.numbers", line)
            with self.assertRaises(graybox.InputError) as caught:
                graybox.load_design(self.H, self.file)
            self.assertEqual(str(caught.exception), line)

    def test_whole_numbers(self):
        for criterion, more in (("D", {}), ("E", {}), ("G", {"region": np.eye(4)}),
                                ("phi_p", {"p": 2.0})):
            design = graybox.exact(self.H, criterion=criterion, **more, gap=1e-3, top=2,
                                   **self.request)
            self.assertTrue(design.optimal, repr(design))
            read = self.again(design)
            said = command("check", self.set, self.file)
            np.testing.assert_array_equal(read.counts, design.counts)
            self.assertEqual(len(read.designs), 2)
            np.testing.assert_array_equal(read.designs[1], design.designs[1])
            self.assertEqual(read.stated_efficiency, design.efficiency)
            self.assertAlmostEqual(read.efficiency, said["efficiency"], 9)
            self.assertAlmostEqual(read.certify().efficiency, said["efficiency"], 9)
            self.assertAlmostEqual(design.certify().efficiency, said["efficiency"], 6)
            self.assertAlmostEqual(read.criterion_value, design.criterion_value, 9)

    def test_whole_numbers_without_a_request(self):
        design = graybox.exact(self.H, 8, gap=1e-3)
        read = self.again(design)
        said = command("check", self.set, self.file)
        np.testing.assert_array_equal(read.counts, design.counts)
        self.assertAlmostEqual(read.efficiency, said["efficiency"], 12)
        self.assertAlmostEqual(read.log_det, design.log_det, 12)

    def test_floors(self):
        floor = {"A": 0.97, "E": 0.93}
        design = graybox.solve(self.H, gap=1e-6, floor=floor)
        self.assertTrue(design.solved, repr(design))
        best = graybox.solve(self.H, "A", gap=1e-9).certificate.criterion_value
        M = np.einsum("q,qij->ij", design.weights, self.H)
        kept = best / np.trace(np.linalg.inv(M))
        self.assertGreaterEqual(kept, 0.97 - 1e-9)
        stated = {each["criterion"]: each["efficiency"] for each in design.floors}
        self.assertAlmostEqual(stated["A"], kept, 5)
        self.assertGreaterEqual(stated["E"], 0.93)
        # The design of D alone keeps less of one of them.
        plain = graybox.certify(self.H, graybox.solve(self.H).weights, floor=floor)
        self.assertEqual(plain.status, "not_a_design")
        self.assertAlmostEqual(graybox.certify(self.H, design, floor=floor).gap, design.gap, 9)
        self.assertAlmostEqual(design.certify().gap, design.gap, 9)
        read = self.again(design)
        said = command("check", self.set, self.file)
        self.assertEqual((said["status"], read.status), ("solved", "solved"))
        self.assertEqual(said["floors"][0]["efficiency"], read.floors[0]["efficiency"])
        self.assertAlmostEqual(said["duality_gap"], read.gap, 12)

    def test_refusals_are_the_commands(self):
        with self.assertRaisesRegex(graybox.InputError, "floor can't be combined"):
            graybox.solve(self.H, floor={"A": 0.9}, stock=2, experiments=5)
        with self.assertRaises(graybox.InputError) as caught:
            graybox.solve(self.set, floor={"A": 0.999, "E": 0.999})
        self.assertEqual(str(caught.exception),
                         refusal("solve", self.set, "--floor", "A=0.999,E=0.999"))
        limits = self.path("limits.yaml")
        with open(limits, "w") as file:
            file.write("constraints:\n  - {name: few, candidates: 0-9, at_least: 5}\n"
                       "  - {name: fewer, candidates: 0-9, at_most: 3}\n")
        for call, name in ((graybox.solve, "solve"), (graybox.exact, "exact")):
            with self.assertRaises(graybox.InputError) as caught:
                call(self.set, experiments=12, constraints=limits)
            self.assertEqual(str(caught.exception),
                             refusal(name, self.set, "--experiments", 12, "--constraints", limits))
        with self.assertRaises(graybox.InputError) as caught:
            graybox.load_design(self.set, self.path("none.json"))
        self.assertEqual(str(caught.exception), refusal("check", self.set, self.path("none.json")))

    def test_a_request_file(self):
        request = self.path("request.yaml")
        with open(request, "w") as file:
            file.write("format: graybox-request/1\nexperiments: 9\nstock: 2\nforbid: 20-24\n")
        design = graybox.solve(self.H, request=request, gap=1e-7)
        named = graybox.solve(self.H, experiments=9, stock=2, forbid="20-24", gap=1e-7)
        np.testing.assert_allclose(design.efforts, named.efforts, atol=1e-12)
        more = graybox.solve(self.H, request=request, stock=np.full(40, 1.5), gap=1e-7)
        self.assertLessEqual(more.efforts.max(), 1.5 + 1e-9)
        self.assertAlmostEqual(more.efforts.sum(), 9, 9)

    def test_the_next_after_an_exact_design(self):
        first = graybox.exact(self.H, 8, gap=1e-2)
        following = graybox.exact(self.H, 4, done=first, gap=1e-2)
        self.assertAlmostEqual(following.log_det, np.linalg.slogdet(
            np.einsum("q,qij->ij", (first.counts + following.counts).astype(float), self.H))[1], 8)


if __name__ == "__main__":
    unittest.main()
