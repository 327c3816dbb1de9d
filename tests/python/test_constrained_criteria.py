"""Criteria without a factor under constraints: closed forms, SciPy's SLSQP, whole numbers by brute force."""
import itertools
import unittest

import numpy as np

import graybox
from sets import random_set
from test_designs import InFolder

try:
    from scipy.optimize import minimize
except ImportError:
    minimize = None


def log_phi(M, criterion, region=None, p=None):
    """The logarithm of the information function that graybox maximises."""
    values = np.linalg.eigvalsh(M)
    if values[0] <= 0:
        return -np.inf
    if criterion == "D":
        return np.log(values).mean()
    if criterion == "A":
        return -np.log((1 / values).sum())
    if criterion == "E":
        return np.log(values[0])
    if criterion == "phi_p":
        return np.log(values[0]) - np.log(((values[0] / values)**p).mean()) / p
    if criterion == "G":
        return -np.log(np.einsum("ki,ij,kj->k", region, np.linalg.inv(M), region).max())
    return sum(share * log_phi(M, name, region, p) for name, share in criterion.items())


class Instance:
    """A random set with a prior, stock and rows that can be obeyed."""

    def __init__(self, seed):
        random = np.random.default_rng(seed)
        self.H = random_set(10, 3, seed)
        self.experiments = 6.0
        self.stock = random.uniform(0.9, 4, 10)
        inside = np.minimum(self.stock, 0.6)
        inside *= self.experiments / inside.sum()
        self.A = random.normal(size=(2, 10))
        self.b = self.A @ inside + random.uniform(0.0, 0.5, 2)
        self.P = random.uniform(0, 1) * np.eye(3) if seed % 2 else np.zeros((3, 3))
        self.inside = inside
        self.region = random.normal(size=(5, 3))
        kind = seed % 6
        self.criterion = ("phi_p", "G", {"D": 0.5, "A": 0.3, "phi_p": 0.2}, "phi_p", "E",
                          {"D": 0.4, "E": 0.6})[kind]
        self.p = (0.5, None, 3.0, 20.0, None, None)[kind]
        self.request = {"experiments": self.experiments, "stock": self.stock, "A_ub": self.A,
                        "b_ub": self.b}
        if seed % 2:
            self.request["prior"] = self.P
        self.asked = {"criterion": self.criterion, "p": self.p,
                      "region": self.region if kind == 1 else None}

    def value(self, x):
        return log_phi(self.P + np.einsum("q,qij->ij", x, self.H), self.criterion, self.region,
                       self.p)

    def slsqp(self):
        # G as the least t above the logarithms of all variances, which is smooth.
        constraints = [{"type": "eq", "fun": lambda x: x[:10].sum() - self.experiments},
                       {"type": "ineq", "fun": lambda x: self.b - self.A @ x[:10]}]
        start, objective = self.inside, lambda x: -self.value(x)
        bounds = [(0, each) for each in self.stock]
        if self.criterion == "G":
            def variances(x):
                M = self.P + np.einsum("q,qij->ij", x, self.H)
                return np.einsum("ki,ij,kj->k", self.region, np.linalg.inv(M), self.region)
            constraints.append({"type": "ineq",
                                "fun": lambda x: x[10] - np.log(variances(x[:10]))})
            start, objective = np.append(start, -self.value(start)), lambda x: x[10]
            bounds.append((None, None))
        found = minimize(objective, start, method="SLSQP", bounds=bounds, constraints=constraints,
                         options={"maxiter": 300, "ftol": 1e-10}).x[:10]
        found = np.clip(found, 0, self.stock)
        found *= self.experiments / found.sum()
        return found


class ConstrainedCriteria(InFolder):
    def test_separate_parameters_have_a_closed_form(self):
        # M = diag(h x): phi_p has x proportional to h^(-p/(1 + p)), and E all h x alike, as G over the
        # axes.
        h = np.array([1.0, 2.0, 5.0])
        H = h[:, None, None] * np.eye(3)[:, :, None] * np.eye(3)[:, None, :]
        for p in (0.5, 1.0, 4.0):
            design = graybox.solve(H, "phi_p", p=p, experiments=12, gap=1e-9)
            self.assertTrue(design.solved, (p, repr(design)))
            expected = h**(-p / (1 + p))
            np.testing.assert_allclose(design.efforts, 12 * expected / expected.sum(), rtol=1e-4)
        for asked in ({"criterion": "G", "region": np.eye(3)}, {"criterion": "E"}):
            design = graybox.solve(H, **asked, experiments=12, gap=1e-6)
            self.assertTrue(design.solved, repr(design))
            np.testing.assert_allclose(design.efforts, 12 / h / (1 / h).sum(), rtol=1e-4)
        # With no more than one run of the first, its variance is the largest, whatever the others.
        limited = graybox.solve(H, "G", region=np.eye(3), experiments=12, gap=1e-6,
                                stock=[1, 12, 12])
        self.assertAlmostEqual(limited.certificate.criterion_value, 1.0, 6)

    @unittest.skipIf(minimize is None, "SciPy is not installed")
    def test_an_independent_solver_finds_nothing_better(self):
        unsolved = 0
        for seed in range(48):
            instance = Instance(seed)
            gap = 1e-6
            design = graybox.solve(instance.H, **instance.asked, **instance.request, gap=gap)
            unsolved += not design.solved
            x = design.efforts
            self.assertLessEqual((instance.A @ x - instance.b).max(), 1e-7, seed)
            best = instance.value(instance.slsqp())
            bound = instance.value(x) + np.log1p(design.gap + design.rounding_bound)
            self.assertLessEqual(best, bound + 1e-8, (seed, instance.criterion))
            self.assertGreaterEqual(instance.value(x), best - 2e-6, (seed, instance.criterion))
            again = graybox.certify(instance.H, x, **instance.asked, **instance.request, gap=gap)
            self.assertAlmostEqual(again.gap, design.gap, 12)
        self.assertEqual(unsolved, 0)

    def test_they_are_those_without_constraints(self):
        H = random_set(60, 4, 9)
        for asked in ({"criterion": "E"}, {"criterion": "phi_p", "p": 3.0}, {"criterion": {"D": 0.5, "A": 0.5}},
                      {"criterion": "G"}, {"criterion": "G", "region": np.eye(4)}):
            plain = graybox.solve(H, **asked, gap=1e-6)
            scaled = graybox.solve(H, **asked, gap=1e-6, experiments=7)
            self.assertTrue(plain.solved and scaled.solved, (asked, repr(scaled)))
            is_log = isinstance(asked["criterion"], dict)
            a, b = (each.certificate.criterion_value for each in (plain, scaled))
            if asked == {"criterion": "G"}:
                M = np.einsum("q,qij->ij", plain.weights, H)
                a = np.einsum("ij,qij->q", np.linalg.inv(M), H).max()
            ratio = np.exp(b - a) if is_log else b / a if asked == {"criterion": "E"} else a / b
            self.assertAlmostEqual(ratio / 7, 1.0, 5, asked)

    def test_whole_numbers_are_the_best_of_all(self):
        H, region = random_set(7, 3, 5), np.random.default_rng(2).normal(size=(4, 3))
        for criterion, more in (("E", {}), ("G", {"region": region}), ("phi_p", {"p": 3.0}),
                                ({"D": 0.5, "E": 0.5}, {})):
            found = graybox.exact(H, 4, criterion, **more, stock=2, gap=1e-7)
            self.assertTrue(found.optimal, criterion)

            def value(counts):
                return log_phi(np.einsum("q,qij->ij", np.array(counts, float), H), criterion, region,
                               more.get("p"))
            best = max(value(counts) for counts in itertools.product(range(3), repeat=7)
                       if sum(counts) == 4)
            self.assertAlmostEqual(value(found.counts), best, 6, criterion)
            proof = found.certify()
            self.assertAlmostEqual(proof.criterion_value, found.criterion_value, 12)
            self.assertLessEqual(proof.efficiency, np.exp(value(found.counts) - best) + 1e-9)
            self.assertGreater(proof.efficiency, 0.3)


if __name__ == "__main__":
    unittest.main()
