"""As much of CVXPY as scripts/rivals/cvxpy_solver.py asks for, for rivals_test.py: one solver, which
runs the multiplicative algorithm."""
import types

import numpy as np

error = types.SimpleNamespace(SolverError=RuntimeError)


def installed_solvers():
    return ["SCS"]


class Variable:
    __array_ufunc__ = None  # `lines @ variable` comes here

    def __init__(self, count, nonneg):
        assert nonneg
        self.count, self.value = count, None

    def __rmatmul__(self, lines):
        return lines, self


class _Sum:
    def __eq__(self, other):
        return "sum", other


def sum(_):
    return _Sum()


def reshape(product, shape, order):
    assert order == "C"
    return product, shape


def log_det(matrix):
    return "log det", matrix


def Maximize(objective):
    return objective


class Problem:
    def __init__(self, objective, constraints):
        assert objective[0] == "log det" and constraints == [("sum", 1)]
        (self.lines, self.variable), self.shape = objective[1]

    def solve(self, solver, eps_abs, eps_rel):
        assert solver == "SCS" and eps_abs == eps_rel
        weights = np.full(self.variable.count, 1.0 / self.variable.count)
        for _ in range(100000):
            information = (self.lines @ weights).reshape(self.shape)
            ratio = np.linalg.inv(information).ravel() @ self.lines / self.shape[0]
            if ratio.max() - 1.0 <= eps_abs:
                break
            weights *= ratio
        self.variable.value = weights
