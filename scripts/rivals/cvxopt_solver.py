#!/usr/bin/python3
"""CVXOPT as a rival of the back-ends, in the form that suits it best.

    graybox solve set.h5 --solver "external:scripts/rivals/cvxopt_solver.py {npy}" --gap 1e-6

Its solver `cp` on the dual problem: minimise -log det W subject to tr(W H_i) <= d. The variables
are the d(d+1)/2 entries of W. The Newton system is of that size, whatever Q is; the weights are the
multipliers. The set is whitened by its mean, each constraint divided by its norm, and the start
obeys all of them; without that it ends early on large sets. Tolerances are tightened until the gap
is met or it gives up.
"""
import json
import sys
import time

import numpy as np

from whitened_set import whitened

try:
    from cvxopt import matrix, solvers
except ImportError:
    sys.exit("CVXOPT is not here: apt-get install python3-cvxopt")

problem, design, gap, seconds = sys.argv[1], sys.argv[2], float(sys.argv[3]), float(sys.argv[4])
packed = np.load(problem)
start = time.monotonic()
full, rows, columns = whitened(packed)
count, d = full.shape[:2]

# svec: lower triangles with off-diagonals times sqrt 2, so that tr(A B) = svec(A)' svec(B).
weight = np.where(rows == columns, 1.0, np.sqrt(2.0))
spread = np.zeros((d * d, len(rows)))  # vec(A) = spread @ svec(A)
for k, (i, j) in enumerate(zip(rows, columns)):
    spread[i * d + j, k] = spread[j * d + i, k] = 1.0 / weight[k]
lines = full[:, rows, columns] * weight
norms = np.linalg.norm(lines, axis=1)
norms[norms == 0.0] = 1.0  # a candidate without any information
inside = 0.5 * d / np.trace(full, axis1=1, axis2=2).max()  # W = inside I obeys every constraint


def log_det(x=None, z=None):
    """-log det W, its gradient and, with z, its Hessian, as CVXOPT asks for them."""
    if x is None:
        return 0, matrix(inside * (rows == columns))
    W = (spread @ np.array(x).ravel()).reshape(d, d)
    sign, value = np.linalg.slogdet(W)
    if np.linalg.eigvalsh(W)[0] <= 0.0 or sign <= 0.0:
        return None, None
    inverse = np.linalg.inv(W)
    gradient = matrix(-(inverse[rows, columns] * weight)).T
    if z is None:
        return matrix(-value), gradient
    return matrix(-value), gradient, z[0] * matrix(spread.T @ np.kron(inverse, inverse) @ spread)


def gap_of(weights):
    information = np.einsum("q,qij->ij", weights, full)
    return np.einsum("ij,qij->q", np.linalg.inv(information), full).max() / d - 1


best, reached, trace, tolerance = np.full(count, 1.0 / count), np.inf, [], 0.1 * gap
solvers.options.update(show_progress=False, maxiters=200)
while reached > gap and tolerance > 1e-14 and time.monotonic() - start < 0.5 * seconds:
    solvers.options.update(abstol=tolerance, reltol=tolerance, feastol=tolerance)
    try:
        answer = solvers.cp(log_det, matrix(lines / norms[:, None]), matrix(d / norms))
        weights = np.maximum(np.array(answer["zl"]).ravel(), 0.0) / norms
        found = gap_of(weights / weights.sum())
    except (ArithmeticError, ValueError, np.linalg.LinAlgError):
        break  # it can't go on: what it had stands
    if found < reached:
        best, reached = weights / weights.sum(), found
    trace.append([time.monotonic() - start, float(reached)])
    tolerance *= 0.01

late = time.monotonic() - start >= 0.5 * seconds
status = "solved" if reached <= gap else "time_limit" if late else "numerical_failure"
with open(design, "w") as file:
    json.dump({"format": "graybox-design/1", "solver": "cvxopt", "seconds": time.monotonic() - start,
               "trace": trace, "status": status,
               "message": "" if reached <= gap else f"CVXOPT ended at a gap of {reached:.2g}",
               "support": [{"index": int(i), "weight": float(best[i])} for i in np.flatnonzero(best)]},
              file)
