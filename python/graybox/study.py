"""Your own solvers beside the back-ends, under the same checker.

    def mine(problem):
        return weights                 # Q numbers, from problem.packed or problem.matrices

    print(graybox.study.run({"mine": mine}, sets=[H]))
"""
import multiprocessing
import random
import time

import numpy as np

from . import _graybox
from ._designs import solve
from ._results import Certificate, _Plain


class Problem:
    """What a solver gets: packed [Q, p] (read only), dimension d, gap asked, time_limit (s), seed."""

    def __init__(self, information, gap, time_limit, seed):
        self.packed = information.packed
        self.dimension = information.dimension
        self.gap, self.time_limit, self.seed = gap, time_limit, seed

    @property
    def matrices(self):
        """The matrices in full, [Q, d, d]; a copy."""
        rows, columns = np.tril_indices(self.dimension)
        full = np.empty((len(self.packed), self.dimension, self.dimension))
        full[:, rows, columns] = full[:, columns, rows] = self.packed
        return full


class Row(_Plain):
    """One run: solver, set, status, gap (checked), seconds, certificate, message."""

    def __init__(self, **fields):
        self.__dict__.update(fields)

    def _heading(self):
        return f"{self.solver} on {self.set}: {self.status}"

    def _rows(self):
        return [("gap", f"{self.gap:.3e}"), ("seconds", f"{self.seconds:.4g}"),
                ("message", self.message)]


class Study(_Plain):
    """The rows of a study; `best` has the fastest solved run of each solver on each set."""

    _title = "study: what the checker proved"

    def __init__(self, rows):
        self.rows = rows

    @property
    def best(self):
        fastest = {}
        for row in self.rows:
            key = (row.set, row.solver)
            known = fastest.get(key)
            if known is None or ((row.status != "solved", row.seconds)
                                 < (known.status != "solved", known.seconds)):
                fastest[key] = row
        return list(fastest.values())

    def _rows(self):
        return [(f"{row.set}, {row.solver}",
                 f"{row.status}, gap {row.gap:.2e}, {1e3 * row.seconds:.3g} ms"
                 + (f" ({row.message})" if row.message else "")) for row in self.best]


def _answer(channel, solver, information, gap, time_limit, seed):
    """In a process of its own: the weights, and the seconds of the call alone."""
    try:
        problem = Problem(information, gap, time_limit, seed)
        start = time.perf_counter()
        if callable(solver):
            weights, claim = solver(problem), "solved"
            weights = np.array(weights, dtype=float)
        else:
            design = solve(information, gap=gap, solver=solver, time_limit=time_limit, seed=seed,
                           progress=False)
            weights, claim = design.weights, design.status
        seconds = time.perf_counter() - start
        channel.send((weights, claim, seconds, ""))
    except BaseException as error:  # whatever a user's solver throws ends its run, and no other
        channel.send((None, "crashed", 0.0, f"{type(error).__name__}: {error}".split("\n")[0]))
    finally:
        channel.close()


def _run(solver, information, gap, time_limit, seed):
    """(weights, claim, seconds, message) from a process that is ended when its time is over."""
    context = multiprocessing.get_context("fork")
    here, there = context.Pipe(duplex=False)
    process = context.Process(target=_answer,
                              args=(there, solver, information, gap, time_limit, seed))
    process.start()
    there.close()
    try:
        if not here.poll(1.02 * time_limit + 0.5):
            return None, "time_limit", time_limit, "was ended: its time was over"
        return here.recv()
    except EOFError:
        process.join()
        return None, "crashed", 0.0, f"its process ended with code {process.exitcode}"
    finally:
        if process.is_alive():
            process.kill()
        process.join()
        here.close()


def _judged(name, label, information, gap, answer):
    """The row. What counts as solved is the checker's word, whatever the solver claims."""
    weights, claim, seconds, message = answer
    if weights is None:
        return Row(solver=name, set=label, status=claim, gap=float("inf"), seconds=seconds,
                   certificate=None, message=message)
    fields = _graybox.judge(information, weights, claim, gap)
    certificate = Certificate(**fields.pop("certificate"))
    return Row(solver=name, set=label, gap=certificate.gap, seconds=seconds,
               certificate=certificate, status=fields["status"],
               message=message or fields["message"])


def run(solvers, sets, against=("column_generation",), *, gap=1e-6, time_limit=10.0,
        repetitions=3, seed=1):
    """Runs solvers on sets; each run in a process of its own, judged by the checker alone.

    solvers: callables by name; each gets a Problem and returns Q weights. sets: arrays, files or
    InformationSets, in a list or a dict by name. against: back-ends to run beside them. A run that
    has not ended half a second and 2 % after its time is ended. Order: random within a repetition.
    """
    labels = list(sets) if isinstance(sets, dict) else [f"set {k}" for k in range(len(sets))]
    values = list(sets.values()) if isinstance(sets, dict) else list(sets)
    informations = [each if isinstance(each, _graybox.InformationSet)
                    else _graybox.InformationSet(each) for each in values]
    taken = [name for name in solvers if name in against]
    if taken:
        raise _graybox.InputError(f"solvers: {taken[0]}: is taken; choose another label")
    everybody = [*solvers.items(), *((name, name) for name in against)]
    order = random.Random(seed)
    rows = []
    for _ in range(repetitions):
        for label, information in zip(labels, informations):
            for name, solver in order.sample(everybody, len(everybody)):
                rows.append(_judged(name, label, information, gap,
                                    _run(solver, information, gap, time_limit, seed)))
    return Study(rows)
