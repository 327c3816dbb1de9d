#!/usr/bin/python3
"""Clarabel, SCS, MOSEK and whatever else CVXPY reaches, as rivals of the back-ends.

    graybox solve set.h5 --solver "external:scripts/rivals/cvxpy_solver.py {npy} CLARABEL" --gap 1e-6

The design problem as CVXPY writes it down: maximise log det sum_i w_i H_i over the simplex. CVXPY
makes a semidefinite cone of 2 d rows and d exponential cones of it. The set is whitened by its mean,
in which all of these solvers do better. Tolerances are tightened until the gap is met, the solver
gives up or half the time is over. The last argument but those of graybox is the solver's name.
"""
import json
import sys
import time

import numpy as np

from whitened_set import whitened

try:
    import cvxpy
except ImportError:
    sys.exit("CVXPY is not here: pip install cvxpy")

problem, name, design = sys.argv[1], sys.argv[2].upper(), sys.argv[3]
gap, seconds = float(sys.argv[4]), float(sys.argv[5])
if name not in cvxpy.installed_solvers():
    sys.exit(f"{name} is not here; CVXPY has {', '.join(cvxpy.installed_solvers())}")
# What each calls the accuracy that it is asked for; the others keep their own.
TOLERANCES = {"CLARABEL": ("tol_gap_abs", "tol_gap_rel", "tol_feas"), "SCS": ("eps_abs", "eps_rel")}

packed = np.load(problem)
start = time.monotonic()
full = whitened(packed)[0]
count, d = full.shape[:2]

weights = cvxpy.Variable(count, nonneg=True)
information = cvxpy.reshape(full.reshape(count, d * d).T @ weights, (d, d), order="C")
task = cvxpy.Problem(cvxpy.Maximize(cvxpy.log_det(information)), [cvxpy.sum(weights) == 1])


def gap_of(found):
    M = np.einsum("q,qij->ij", found, full)
    return np.einsum("ij,qij->q", np.linalg.inv(M), full).max() / d - 1


best, reached, trace, tolerance = np.full(count, 1.0 / count), np.inf, [], 0.1 * gap
while reached > gap and tolerance > 1e-14 and time.monotonic() - start < 0.5 * seconds:
    try:
        task.solve(solver=name, **{each: tolerance for each in TOLERANCES.get(name, ())})
        found = np.maximum(np.asarray(weights.value, dtype=float), 0.0)
        found /= found.sum()
        now = gap_of(found)
    except (cvxpy.error.SolverError, TypeError, ValueError, np.linalg.LinAlgError):
        break  # it can't go on: what it had stands
    if now < reached:
        best, reached = found, now
    trace.append([time.monotonic() - start, float(reached)])
    if name not in TOLERANCES:
        break  # the next time would be like this one
    tolerance *= 0.01

late = time.monotonic() - start >= 0.5 * seconds
status = "solved" if reached <= gap else "time_limit" if late else "numerical_failure"
with open(design, "w") as file:
    json.dump({"format": "graybox-design/1", "solver": name.lower(),
               "seconds": time.monotonic() - start, "trace": trace, "status": status,
               "message": "" if reached <= gap else f"{name} ended at a gap of {reached:.2g}",
               "support": [{"index": int(i), "weight": float(best[i])} for i in np.flatnonzero(best)]},
              file)
