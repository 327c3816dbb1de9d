#!/usr/bin/python3
"""A conic solver for graybox: reads the problem as CBF and solves it with CVXOPT.

    graybox solve set.h5 --solver "external:scripts/examples/conic_solver.py {cbf}" --gap 1e-6

It knows nothing of experiment design but that the first variables, those of the cone L+, are the
weights. Meant to show the format; it carries every weight as a variable and is for small sets.
"""
import json
import sys

import numpy as np

try:
    from cvxopt import matrix, solvers, sparse, spmatrix
except ImportError:
    sys.exit("CVXOPT is not here: apt-get install python3-cvxopt")

KEYWORDS = {"VER", "OBJSENSE", "VAR", "PSDCON", "CON", "OBJACOORD", "ACOORD", "BCOORD", "HCOORD"}


def sections(path):
    """{keyword: [[word, ...], ...]}, the lines below each keyword."""
    found, name = {}, None
    for line in open(path):
        words = line.split()
        if not words or words[0].startswith("#"):
            continue
        if words[0] in KEYWORDS:
            name = words[0]
            found[name] = []
        else:
            found[name].append(words)
    return found


problem, design, gap = sys.argv[1], sys.argv[2], float(sys.argv[3])
cbf = sections(problem)
variables = int(cbf["VAR"][0][0])
weights = next(int(size) for cone, size in cbf["VAR"][1:] if cone == "L+")
constraints = int(cbf["CON"][0][0])

A, b = np.zeros((constraints, variables)), np.zeros(constraints)  # A x + b in the cones of CON
for row, column, value in cbf["ACOORD"][1:]:
    A[int(row), int(column)] = float(value)
for row, value in cbf["BCOORD"][1:]:
    b[int(row)] = float(value)
objective = np.zeros(variables)
for column, value in cbf["OBJACOORD"][1:]:
    objective[int(column)] = float(value)
if cbf["OBJSENSE"][0][0] == "MAX":
    objective = -objective

equal, exponential, place = [], [], 0
for cone, size in cbf["CON"][1:]:
    (equal if cone == "L=" else exponential).append(list(range(place, place + int(size))))
    place += int(size)
equal = [row for rows in equal for row in rows]
top, middle, power = (np.array([rows[k] for rows in exponential]) for k in range(3))
assert not A[middle].any() and (b[middle] == 1.0).all(), "only x1 >= exp(x3)"

size = int(cbf["PSDCON"][1][0])
entries = {}  # of G = -(the matrix of each variable), column-major, symmetric
for _, variable, i, j, value in cbf["HCOORD"][1:]:
    for place in {(int(i), int(j)), (int(j), int(i))}:
        entries[place[0] + size * place[1], int(variable)] = -float(value)
rows, columns = zip(*entries)
semidefinite = spmatrix(list(entries.values()), rows, columns, (size * size, variables))
positive = spmatrix(-1.0, range(weights), range(weights), (weights, variables))


def exponential_cones(x=None, z=None):
    """x3 - log x1 <= 0 of every cone, with derivatives, as CVXOPT asks for them."""
    if x is None:
        start = np.zeros(variables)
        start[:weights] = 1.0 / weights
        start += np.linalg.lstsq(A[top], 1.0 - b[top] - A[top] @ start, rcond=None)[0]
        return len(top), matrix(start)
    x = np.array(x).ravel()
    first = A[top] @ x + b[top]
    if first.min() <= 0.0:
        return None, None
    value = A[power] @ x + b[power] - np.log(first)
    slope = A[power] - A[top] / first[:, None]
    if z is None:
        return matrix(value), matrix(slope)
    scaled = A[top] / first[:, None]
    return matrix(value), matrix(slope), matrix(scaled.T @ (np.array(z) * scaled))


solvers.options.update(show_progress=False, abstol=0.001 * gap, reltol=0.001 * gap, feastol=0.001 * gap)
answer = solvers.cpl(matrix(objective), exponential_cones, sparse([positive, semidefinite]),
                     matrix(0.0, (weights + size * size, 1)), {"l": weights, "q": [], "s": [size]},
                     matrix(A[equal]), matrix(-b[equal]))
best = np.maximum(np.array(answer["x"]).ravel()[:weights], 0.0)
best /= best.sum()

with open(design, "w") as file:
    json.dump({"format": "graybox-design/1", "solver": "conic_solver.py",
               "status": "solved" if answer["status"] == "optimal" else "iteration_limit",
               "message": f"the optimal value is {-answer['primal objective']:.9g}",
               "support": [{"index": int(i), "weight": float(best[i])} for i in np.flatnonzero(best)]},
              file)
