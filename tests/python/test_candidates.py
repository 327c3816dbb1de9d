"""Python callables as candidate generators."""
import unittest

import numpy as np

import graybox


def decay(point):
    """Jacobian of exp(-a t) + b t, with respect to a and b, at a = 1."""
    t = float(point[0])
    return [[-t * np.exp(-t), t]]


class Candidates(unittest.TestCase):
    def test_jacobians(self):
        points = np.linspace(0.1, 3, 30)
        information = graybox.candidates(decay, points, noise=[0.5], names=["t"])
        J = np.array([decay([t])[0] for t in points])
        design = graybox.solve(information)
        by_hand = graybox.solve(J[:, :, None] * J[:, None, :] / 0.25)
        np.testing.assert_allclose(design.log_det, by_hand.log_det, rtol=1e-12)
        kept = graybox.solve(information, forbid="t > 2.5")
        self.assertEqual(kept.weights[points > 2.5].max(), 0)
        self.assertLess(kept.log_det, design.log_det)

    def test_covariances_and_matrices(self):
        R = np.array([[2.0, 0.5], [0.5, 1.0]])
        J = np.random.default_rng(2).normal(size=(12, 2, 3))
        H = np.einsum("qri,rs,qsj->qij", J, np.linalg.inv(R), J)
        by_noise = graybox.candidates(lambda x: J[int(x[0])], np.arange(12), noise=R)
        by_matrix = graybox.candidates(lambda x: H[int(x[0])], np.arange(12))
        np.testing.assert_allclose(by_noise.packed, by_matrix.packed, rtol=1e-12)

    def test_between_the_points_of_a_grid(self):
        # A cubic polynomial on [-1, 1]: the ends and +-1/sqrt(5), a quarter each.
        design = graybox.continuous(lambda x: [x[0] ** np.arange(4)], -1, 1,
                                    np.linspace(-1, 1, 8), noise=[1.0], gap=1e-6)
        order = np.argsort(design.points[:, 0])
        np.testing.assert_allclose(design.points[order, 0], [-1, -5**-0.5, 5**-0.5, 1], atol=1e-3)
        np.testing.assert_allclose(design.weights[order], 0.25, atol=1e-3)
        self.assertGreater(design.log_det, design.grid_log_det)
        self.assertEqual(design.certificate.status, "certified")

    def test_what_a_callable_throws_comes_through(self):
        calls = []

        def fails(x):
            calls.append(x)
            if len(calls) > 20:
                raise ZeroDivisionError("in the model")
            return [x[0] ** np.arange(4)]
        with self.assertRaisesRegex(ZeroDivisionError, "in the model"):
            graybox.continuous(fails, -1, 1, np.linspace(-1, 1, 8), noise=[1.0])
        with self.assertRaisesRegex(graybox.InputError, "expected a matrix 4 x 4"):
            graybox.continuous(lambda x: np.eye(3), -1, 1, graybox.candidates(
                lambda x: [x[0] ** np.arange(4)], np.linspace(-1, 1, 8), noise=[1.0]))


if __name__ == "__main__":
    unittest.main()
