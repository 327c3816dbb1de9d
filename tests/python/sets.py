"""Sets and recordings for the tests, and the command beside which the module is held."""
import json
import os
import subprocess

import numpy as np

GRAYBOX = os.environ["GRAYBOX_COMMAND"]
SOURCE = os.environ["GRAYBOX_SOURCE"]
DRIVE = os.path.join(SOURCE, "docs/examples/fit/drive")


def cubic(points=101):
    """A cubic polynomial, measured at points of [-1, 1]: [Q, 4, 4]."""
    t = np.linspace(-1, 1, points)
    f = np.stack([t**k for k in range(4)], axis=1)
    return f[:, :, None] * f[:, None, :]


def packed(matrices):
    """[Q, d, d] to [Q, p]."""
    rows, columns = np.tril_indices(matrices.shape[1])
    return np.ascontiguousarray(matrices[:, rows, columns])


def random_set(count=300, dimension=6, seed=3):
    f = np.random.default_rng(seed).normal(size=(count, 2, dimension))
    return np.einsum("qri,qrj->qij", f, f)


def command(*arguments, code=0):
    """What the command prints with --json, as an object."""
    done = subprocess.run([GRAYBOX, *map(str, arguments), "--json"], capture_output=True, text=True)
    assert done.returncode == code, done.stderr
    return json.loads(done.stdout)


def refusal(*arguments):
    """The line with which the command refuses, without its name."""
    done = subprocess.run([GRAYBOX, *map(str, arguments)], capture_output=True, text=True)
    assert done.returncode == 2, done.stdout + done.stderr
    return done.stderr.strip().removeprefix("graybox: ")
