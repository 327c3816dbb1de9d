"""solve, certify and exact on arrays: against the command, closed forms and brute force."""
import itertools
import json
import os
import tempfile
import unittest

import numpy as np

import graybox
from sets import command, cubic, packed, random_set, refusal


class InFolder(unittest.TestCase):
    def setUp(self):
        self._folder = tempfile.TemporaryDirectory()
        self.addCleanup(self._folder.cleanup)

    def path(self, name):
        return os.path.join(self._folder.name, name)

    def saved(self, array, name="set.npy"):
        np.save(self.path(name), array)
        return self.path(name)


class Factors(InFolder):
    """Factors F of H = F'F: the same designs as of the matrices, which are not made."""

    def setUp(self):
        super().setUp()
        self.F = np.random.default_rng(7).normal(size=(400, 2, 5))
        self.H = np.einsum("qri,qrj->qij", self.F, self.F)

    def test_solve_and_certify_are_those_of_the_matrices(self):
        for F in (self.F, self.F[:, 0], self.F[:, ::-1], self.F.astype(np.float32)):
            rows = F if F.ndim == 3 else F[:, None]
            H = np.einsum("qri,qrj->qij", rows.astype(float), rows.astype(float))
            information = graybox.InformationSet(F, factors=True)
            self.assertEqual(information.factors.shape, rows.shape)
            design, other = graybox.solve(information, gap=1e-12), graybox.solve(H, gap=1e-12)
            self.assertLess(abs(design.log_det - other.log_det), 1e-9)
            self.assertLess(abs(design.weights - other.weights).max(), 1e-6)
            self.assertLess(abs(design.log_det - np.linalg.slogdet(
                np.einsum("q,qij->ij", design.weights, H))[1]), 1e-9)
            proof = graybox.certify(F, design, gap=1e-9, factors=True)
            self.assertTrue(proof.proves(1e-9))
            self.assertLess(abs(proof.gap - graybox.certify(H, design, gap=1e-9).gap), 1e-12)
            self.assertTrue(design.certify(gap=1e-9).proves(1e-9))
            self.assertFalse(information.has_matrices)
        self.assertTrue(graybox.solve(self.F, factors=True).solved)

    def test_memory_is_used_where_it_is(self):
        information = graybox.InformationSet(self.F, factors=True)
        self.assertTrue(np.shares_memory(information.factors, self.F))
        self.assertFalse(information.factors.flags.writeable)
        self.assertFalse(np.shares_memory(
            graybox.InformationSet(self.F[::2], factors=True).factors, self.F))
        self.assertIsNone(graybox.InformationSet(self.H).factors)

    def test_what_needs_matrices_makes_them(self):
        information = graybox.InformationSet(self.F, factors=True)
        self.assertEqual(graybox.exact(information, 8, gap=1e-3).log_det,
                         graybox.exact(information.packed, 8, gap=1e-3).log_det)
        self.assertTrue(information.has_matrices)
        np.testing.assert_allclose(information.packed, packed(self.H), rtol=1e-14, atol=1e-14)
        self.assertAlmostEqual(graybox.solve(self.F, "A", factors=True).certificate.criterion_value,
                               graybox.solve(self.H, "A").certificate.criterion_value, 4)
        counts = np.zeros(400)
        counts[:8] = 1
        self.assertAlmostEqual(graybox.certify_exact(self.F, counts, factors=True).log_det,
                               np.linalg.slogdet(self.H[:8].sum(axis=0))[1], 9)

    def test_files(self):
        information = graybox.InformationSet(self.F, factors=True)
        information.save(self.path("set.h5"))
        read = graybox.InformationSet(self.path("set.h5"))
        np.testing.assert_array_equal(read.factors, self.F)
        self.assertEqual(read.content_hash, information.content_hash)
        file = self.saved(self.F)
        said = command("solve", file, "--factors", "--gap", "1e-6")
        self.assertEqual(graybox.solve(file, factors=True).log_det, said["log_det"])

    def test_what_is_no_factor_is_refused(self):
        for wrong in (np.zeros((3, 0)), np.zeros(3), np.zeros((1, 2, 2, 2)), self.F.astype(int),
                      np.full((4, 2), np.nan)):
            with self.assertRaises(graybox.InputError):
                graybox.solve(wrong, factors=True)
        with self.assertRaisesRegex(graybox.InputError, "holds matrices"):
            graybox.solve(graybox.InformationSet(self.H), factors=True)


class Solve(InFolder):
    def test_cubic_has_the_known_optimum(self):
        # Four points of equal weight: the ends and the roots of the derivative of Legendre's P_3.
        H = cubic(1001)
        design = graybox.solve(H, gap=1e-6)
        t = np.linspace(-1, 1, 1001)[design.support]
        for root in (-1.0, -1 / np.sqrt(5), 1 / np.sqrt(5), 1.0):
            self.assertAlmostEqual(design.weights[design.support[abs(t - root) < 0.01]].sum(), 0.25, 3)
        self.assertTrue(design.solved)
        M = np.einsum("q,qij->ij", design.weights, H)
        self.assertAlmostEqual(design.log_det, np.linalg.slogdet(M)[1], 9)
        self.assertGreaterEqual(design.bound, design.log_det)

    def test_further_criteria(self):
        H = cubic(101)
        points = np.vander(np.linspace(-1, 1, 101), 4, increasing=True)
        for asked, value in (({"criterion": "c", "W": points[-1]}, 1.0),
                             ({"criterion": "G"}, 4.0),
                             ({"criterion": "G", "region": points}, 4.0),
                             ({"criterion": "I", "region": points[-1:]}, 1.0)):
            design = graybox.solve(H, gap=1e-5, **asked)
            self.assertTrue(design.solved, asked)
            self.assertAlmostEqual(design.certificate.criterion_value, value, 3)
            self.assertTrue(design.certify(gap=1e-4).status == "certified")
        variances = [4 * graybox.solve(H, "phi_p", p=1).certificate.criterion_value,
                     graybox.solve(H, "A").certificate.criterion_value]
        self.assertAlmostEqual(variances[0] / variances[1], 1.0, 5)
        for wrong in ({"criterion": "phi_p"}, {"criterion": "c"}, {"criterion": "A", "p": 1},
                      {"criterion": "D", "region": points}):
            with self.assertRaises(graybox.InputError):
                graybox.solve(H, **wrong)

    def test_certificate_is_that_of_the_command(self):
        H = random_set()
        file = self.saved(H)
        for solver in ("column_generation", "multiplicative"):
            said = command("solve", file, "--solver", solver, "--gap", "1e-6")
            design = graybox.solve(H, solver=solver)
            self.assertEqual(design.status, said["status"])
            for name in ("log_det", "rounding_bound", "efficiency", "log_det_gap", "support_size"):
                self.assertEqual(getattr(design.certificate, name), said[name], (solver, name))
            self.assertEqual(design.gap, said["duality_gap"])
            self.assertEqual(design.passes, said["passes"])

    def test_the_checker_is_that_of_the_command_for_every_back_end(self):
        H = random_set()
        file, made = self.saved(H), self.path("design.json")
        for solver in graybox.solvers():
            if not solver["available"]:
                continue
            said = command("solve", file, "--solver", solver["name"], "--gap", "1e-3",
                           "--time-limit", 20, "-o", made)
            self.assertEqual(said["status"], "solved", solver)
            with open(made) as stream:
                support = json.load(stream)["support"]
            weights = np.zeros(len(H))
            weights[[each["index"] for each in support]] = [each["weight"] for each in support]
            checked = command("check", file, made)
            proof = graybox.certify(H, weights, gap=1e-3)
            self.assertEqual((proof.gap, proof.rounding_bound, proof.log_det, proof.efficiency),
                             tuple(checked[name] for name in ("duality_gap", "rounding_bound",
                                                              "log_det", "efficiency")), solver)
            # A threaded BLAS that another library brings may round otherwise on the way.
            design = graybox.solve(H, solver=solver["name"], gap=1e-3, time_limit=20)
            self.assertTrue(design.solved, solver)
            self.assertLess(abs(design.log_det - said["log_det"]), 6.1e-3)

    def test_certifying_does_not_need_the_solver(self):
        H = random_set()
        design = graybox.solve(H, gap=1e-7)
        weights = design.weights.tolist()
        self.assertEqual(graybox.certify(H, weights, gap=1e-7).gap, design.gap)
        self.assertTrue(design.certify().proves(1e-7))
        uniform = graybox.certify(H, np.full(len(H), 1 / len(H)))
        M = H.mean(axis=0)
        gap = np.einsum("ij,qji->q", np.linalg.inv(M), H).max() / 6 - 1
        self.assertAlmostEqual(uniform.gap, gap, 10)
        self.assertFalse(uniform.proves(0.9 * gap))
        self.assertTrue(uniform.proves(1.1 * gap))
        wrong = graybox.certify(H, np.full(len(H), 2 / len(H)))
        self.assertEqual(wrong.status, "not_a_design")

    def test_where_an_array_lies_changes_nothing(self):
        P = packed(random_set())
        first = graybox.solve(P)
        for offset in range(1, 9):
            room = np.empty(P.size + 16)
            elsewhere = room[offset:offset + P.size].reshape(P.shape)
            elsewhere[:] = P
            np.testing.assert_array_equal(graybox.solve(elsewhere).weights, first.weights)
        for other in (np.asfortranarray(P), np.repeat(P, 2, axis=0)[::2], random_set()):
            np.testing.assert_array_equal(graybox.solve(other).weights, first.weights)

    def test_packed_arrays_are_not_copied_and_kept_alive(self):
        P = packed(random_set())
        information = graybox.InformationSet(P)
        self.assertEqual(information.packed.ctypes.data, P.ctypes.data)
        self.assertFalse(information.packed.flags.writeable)
        first = graybox.solve(information).weights
        del P
        np.testing.assert_array_equal(graybox.solve(information).weights, first)
        self.assertNotEqual(graybox.InformationSet(random_set()).packed.ctypes.data, 0)

    def test_single_precision_is_taken_as_files_are(self):
        H = random_set().astype(np.float32)
        said = command("solve", self.saved(H))
        self.assertEqual(graybox.solve(H).log_det, said["log_det"])

    def test_criteria(self):
        H = random_set()
        file = self.saved(H)
        W = np.diag([1.0, 0, 2, 0, 0, 3])
        cases = [(["A"], {"criterion": "A"}), (["E"], {"criterion": "E"}),
                 (["L", "--weights", "0=1,2=2,5=3"], {"criterion": "L", "W": W}),
                 (["Ds", "--interest", "0,1"], {"criterion": "Ds", "interest": [0, 1]})]
        for words, keywords in cases:
            said = command("solve", file, "--criterion", *words)
            design = graybox.solve(H, **keywords)
            self.assertEqual(design.certificate.criterion_value, said["criterion_value"])
            self.assertEqual(design.gap, said["duality_gap"])
            self.assertTrue(design.certify().proves(1e-6), words)
        M = np.einsum("q,qij->ij", graybox.solve(H, "A").weights, H)
        self.assertAlmostEqual(graybox.solve(H, "A").certificate.criterion_value,
                               np.trace(np.linalg.inv(M)), 9)

    def test_constraints_in_words_and_in_numbers(self):
        H = random_set(60)
        file = self.saved(H)
        said = command("solve", file, "--experiments", 20, "--stock", 2, "--forbid", "3-9",
                       "--require", "12:1")
        design = graybox.solve(H, experiments=20, stock=2, forbid="3-9", require="12:1")
        self.assertEqual(design.log_det, said["log_det"])
        self.assertEqual(design.gap, said["duality_gap"])
        limits = np.full(60, 2.0)
        limits[3:10] = 0.0
        by_array = graybox.solve(H, experiments=20, stock=limits, require="12:1")
        self.assertAlmostEqual(by_array.log_det, design.log_det, 5)
        self.assertAlmostEqual(by_array.efforts.sum(), 20, 6)
        self.assertGreaterEqual(by_array.efforts[12], 1 - 1e-9)
        self.assertEqual(graybox.certify(H, by_array, experiments=20, stock=limits, require="12:1",
                                         gap=1e-6).gap, by_array.gap)

    def test_blocks_have_the_sizes_asked_for(self):
        # A quadratic on two days, each with an offset of its own: what is left is the scatter about
        # each day's mean.
        t = np.linspace(-1, 1, 5)
        z = np.column_stack([t, t**2])
        rows = np.concatenate([np.column_stack([z, *(np.full(5, float(day == other))
                                                     for other in range(2))]) for day in range(2)])
        days = graybox.InformationSet(rows[:, :, None] * rows[:, None, :],
                                      coordinates=np.repeat([1.0, 2.0], 5)[:, None],
                                      coordinate_names=["block"])

        def scatter(counts):
            centred = z - counts @ z / counts.sum()
            return centred.T @ (counts[:, None] * centred)

        def of_size(size):
            return [np.array(each) for each in itertools.product(range(size + 1), repeat=5)
                    if sum(each) == size]
        best = max(np.linalg.det(scatter(a) + scatter(b)) for a in of_size(3) for b in of_size(2))
        asked = {"criterion": "Ds", "interest": [0, 1]}
        relaxed = graybox.solve(days, **asked, block_sizes=[3, 2])
        self.assertTrue(relaxed.solved)
        np.testing.assert_allclose(relaxed.efforts.reshape(2, 5).sum(axis=1), [3, 2], rtol=1e-9)
        self.assertGreaterEqual(relaxed.certificate.bound, np.log(best))
        counts = graybox.exact(days, **asked, block_sizes="3, 2").counts.reshape(2, 5)
        self.assertEqual(counts.sum(axis=1).tolist(), [3, 2])
        self.assertAlmostEqual(np.linalg.det(scatter(counts[0]) + scatter(counts[1])), best, 9)
        with self.assertRaisesRegex(graybox.InputError, "block"):
            graybox.solve(days, **asked, block_sizes=[3, 1, 1])

    def test_several_criteria_at_once(self):
        H = random_set(60, 3, 2)
        both = graybox.solve(H, {"D": 0.25, "A": 0.75})
        self.assertTrue(both.solved)

        def value(weights):
            M = np.einsum("q,qij->ij", weights, H)
            return 0.25 * np.linalg.slogdet(M)[1] / 3 - 0.75 * np.log(np.trace(np.linalg.inv(M)))
        self.assertAlmostEqual(both.certificate.criterion_value, value(both.weights), 9)
        random = np.random.default_rng(0)
        for _ in range(200):
            other = random.dirichlet(np.full(60, 0.1))
            self.assertLessEqual(value(other), both.certificate.criterion_value + 1e-6)
        for wrong in ({"D": 0.5, "Z": 0.5}, {"D": -1.0, "A": 1.0}, {}):
            with self.assertRaises(graybox.InputError, msg=wrong):
                graybox.solve(H, wrong)

    def test_rows_costs_and_what_is_known(self):
        H = random_set(60)
        A = np.vstack([np.arange(60) < 30, np.arange(60) % 2 == 0]).astype(float)
        design = graybox.solve(H, experiments=20, A_ub=A, b_ub=[6, 8])
        self.assertTrue((A @ design.efforts <= np.array([6, 8]) + 1e-6).all())
        self.assertLess(design.log_det, graybox.solve(H, experiments=20).log_det)
        even = graybox.solve(H, experiments=20, A_eq=A[1:], b_eq=[5])
        self.assertAlmostEqual(A[1] @ even.efforts, 5, 5)
        costs = 1 + np.arange(60) / 60
        cheap = graybox.solve(H, costs=costs, budget=30)
        self.assertLessEqual(costs @ cheap.efforts, 30 + 1e-6)
        prior = 3 * np.eye(6)
        known = graybox.solve(H, experiments=5, prior=prior)
        M = prior + np.einsum("q,qij->ij", known.efforts, H)
        self.assertAlmostEqual(known.log_det, np.linalg.slogdet(M)[1], 8)
        done = np.zeros(60)
        done[[1, 5]] = 2
        after = graybox.solve(H, experiments=5, done=done)
        M = 2 * H[1] + 2 * H[5] + np.einsum("q,qij->ij", after.efforts, H)
        self.assertAlmostEqual(after.log_det, np.linalg.slogdet(M)[1], 8)
        # Alone these candidates inform about one parameter combination too few.
        f = np.random.default_rng(1).normal(size=(20, 5))
        lame = np.zeros((20, 6, 6))
        lame[:, :5, :5] = f[:, :, None] * f[:, None, :]
        with self.assertRaisesRegex(graybox.InputError, "singular"):
            graybox.solve(lame)
        self.assertTrue(graybox.solve(lame, experiments=10, prior=prior).solved)
        with self.assertRaisesRegex(graybox.InputError, "singular"):
            graybox.solve(graybox.InformationSet(lame, singular=True))

    def test_a_saved_design_is_proven_by_the_command(self):
        file = self.saved(random_set())
        design = graybox.solve(file, "A", gap=1e-7)
        design.save(self.path("design.json"))
        said = command("check", file, self.path("design.json"))
        self.assertEqual((said["status"], said["duality_gap"]), ("solved", design.gap))

    def test_goes_on_from_a_design(self):
        H = random_set(2000, 8)
        cold = graybox.solve(H, gap=1e-9)
        for start in (cold, cold.weights, list(cold.weights)):
            warm = graybox.solve(H, gap=1e-9, start=start)
            self.assertLess(warm.passes, 1.2)
            self.assertAlmostEqual(warm.certificate.log_det, cold.certificate.log_det, delta=8e-9)
        for start, text in ((cold.weights[:5], "5 weights"), (np.zeros(2000), "all weights are zero")):
            with self.assertRaisesRegex(ValueError, text):
                graybox.solve(H, start=start)
        with self.assertRaisesRegex(ValueError, "can't begin from a design"):
            graybox.solve(H, start=cold, solver="dual_interior_point")
        with self.assertRaisesRegex(ValueError, "can't be combined"):
            graybox.solve(H, start=cold, experiments=20)

    def test_limits_of_time_and_iterations(self):
        H = random_set(2000, 8)
        few = graybox.solve(H, solver="multiplicative", iteration_limit=3, gap=1e-9)
        self.assertEqual((few.status, len(few.trace) > 0), ("iteration_limit", True))
        self.assertFalse(few.certify().proves(1e-9))
        with self.assertRaisesRegex(ValueError, "time limit"):
            graybox.solve(H, time_limit=-1)

    def test_lists_and_shows(self):
        names = {each["name"] for each in graybox.solvers()}
        self.assertEqual(names, {each["name"] for each in command("solvers")})
        design = graybox.solve(cubic())
        self.assertIn("duality gap", repr(design))
        page = design._repr_html_()
        self.assertIn("<svg", page)
        self.assertIn("column_generation: solved", page)


class Refusals(InFolder):
    """The same line as the command's, for each kind of wrong array."""

    def held(self, array, **keywords):
        line = refusal("solve", self.saved(array))
        with self.assertRaises(ValueError) as refused:
            graybox.solve(array, **keywords)
        self.assertIsInstance(refused.exception, graybox.InputError)
        self.assertEqual(str(refused.exception),
                         line.replace(self.path("set.npy"), "information set"))
        return str(refused.exception)

    def test_types_and_shapes(self):
        H = random_set(20)
        self.assertIn("dtype", self.held(H.astype(int)))
        self.held(H.astype(complex))
        self.held(H.astype(">f8"))
        self.held(H[0])
        self.held(H[:, :, :4])
        self.held(H[:, None])
        self.held(np.ones((4, 5)))

    def test_values(self):
        H = random_set(20)
        for value in (np.nan, np.inf):
            broken = H.copy()
            broken[7, 2, 3] = broken[7, 3, 2] = value
            self.held(broken)
            self.held(packed(broken))
        skew = H.copy()
        skew[3, 1, 0] += 1
        self.held(skew)
        indefinite = H.copy()
        indefinite[5] -= 100 * np.eye(6)
        self.held(indefinite)
        self.held(packed(indefinite))
        self.held(H[:1])

    def test_options(self):
        H = random_set(20)
        file = self.saved(H)
        for words, keywords in [(["--solver", "nothing"], {"solver": "nothing"}),
                                (["--criterion", "Q"], {"criterion": "Q"}),
                                (["--experiments", 20, "--forbid", "99"],
                                 {"experiments": 20, "forbid": "99"}),
                                (["--stock", 2], {"stock": 2}),
                                (["--budget", 9], {"budget": 9})]:
            with self.assertRaises(ValueError) as refused:
                graybox.solve(H, **keywords)
            self.assertEqual(str(refused.exception),
                             refusal("solve", file, *words).replace(file, "information set"))
        with self.assertRaisesRegex(ValueError, "gap"):
            graybox.solve(H, gap=0)
        with self.assertRaisesRegex(TypeError, "unknown argument 'stok'"):
            graybox.solve(H, stok=2)
        for wrong in ({"A_ub": np.ones((1, 20))}, {"done": np.ones(3), "experiments": 2},
                      {"prior": np.eye(3), "experiments": 2},
                      {"costs": np.ones(3), "budget": 2}):
            with self.assertRaises(ValueError):
                graybox.solve(H, **wrong)


class Exact(InFolder):
    def test_is_the_best_of_all(self):
        H = random_set(9, 3, seed=5)
        best = max(itertools.combinations_with_replacement(range(9), 5),
                   key=lambda runs: np.linalg.slogdet(H[list(runs)].sum(axis=0))[1])
        design = graybox.exact(H, 5)
        self.assertTrue(design.optimal)
        np.testing.assert_array_equal(design.counts, np.bincount(best, minlength=9))
        proof = design.certify()
        self.assertAlmostEqual(proof.log_det, np.linalg.slogdet(H[list(best)].sum(axis=0))[1], 9)
        self.assertGreaterEqual(proof.bound, proof.log_det)

    def test_is_that_of_the_command(self):
        H = random_set(40)
        file = self.saved(H)
        for method in ("rounding", "exchange", "branch_and_bound"):
            said = command("exact", file, "-M", 11, "--method", method)
            design = graybox.exact(H, 11, method=method)
            self.assertEqual((design.status, design.log_det, design.efficiency),
                             (said["status"], said["log_det"], said["efficiency"]))
        said = command("exact", file, "-M", 9, "--stock", 1, "--criterion", "A", "--top", 3)
        design = graybox.exact(H, 9, "A", stock=1, top=3)
        self.assertEqual(design.efficiency, said["efficiency"])
        self.assertEqual((len(design.designs), design.counts.max()), (3, 1))

    def test_refusals(self):
        H = random_set(20)
        for wrong in ({}, {"experiments": 2.5}, {"experiments": 0},
                      {"experiments": 9, "method": "nothing"},
                      {"experiments": 9, "top": 2, "method": "rounding"}):
            with self.assertRaises(ValueError):
                graybox.exact(H, **wrong)
        self.assertEqual(graybox.certify_exact(H, np.zeros(20)).status, "not_a_design")


if __name__ == "__main__":
    unittest.main()
