#!/usr/bin/python3
"""A solver for graybox in Python, with NumPy alone: the multiplicative algorithm.

    graybox solve set.h5 --solver "external:scripts/examples/external_solver.py {npy}" --gap 1e-3
"""
import json
import sys
import time

import numpy as np

problem, design, gap, seconds = sys.argv[1], sys.argv[2], float(sys.argv[3]), float(sys.argv[4])

packed = np.load(problem)  # Q x p: lower triangles, row by row
d = int(np.sqrt(2 * packed.shape[1]))
rows, columns = np.tril_indices(d)
twice = np.where(rows == columns, 1.0, 2.0)  # tr(W H) = sum of twice * W * H over the triangle

start = time.monotonic()  # the file is read: what follows is the solve
weights = np.full(len(packed), 1 / len(packed))
trace = []
while True:
    matrix = np.zeros((d, d))
    matrix[rows, columns] = matrix[columns, rows] = weights @ packed
    sensitivity = packed @ (twice * np.linalg.inv(matrix)[rows, columns])
    reached = sensitivity.max() / d - 1
    trace.append([time.monotonic() - start, float(reached)])
    solved = reached <= gap
    if solved or time.monotonic() - start > 0.9 * seconds:
        break
    weights *= sensitivity / d
    weights /= weights.sum()

with open(design, "w") as file:
    json.dump({"format": "graybox-design/1", "solver": "external_solver.py",
               "status": "solved" if solved else "time_limit",
               "seconds": time.monotonic() - start, "trace": trace,  # these two may be left out
               "support": [{"index": int(i), "weight": float(weights[i])}
                           for i in np.flatnonzero(weights)]}, file)
