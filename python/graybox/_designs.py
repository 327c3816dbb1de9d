"""Designs: solve, certify, exact, and their files."""
import json
import os

import numpy as np

from . import _graybox
from ._progress import Line, finished
from ._results import Certificate, Design, ExactCertificate, ExactDesign

_PRIOR = ("prior", "done")
_REQUEST = ("request", "experiments", "budget", "prior", "done", "costs", "stock", "require", "forbid",
            "block_sizes", "constraints", "A_ub", "b_ub", "A_eq", "b_eq")


def _request(given):
    if not given:
        return given
    unknown = sorted(set(given) - set(_REQUEST))
    if unknown:
        raise TypeError(f"unknown argument '{unknown[0]}'; what the next experiments have to obey: "
                        + ", ".join(_REQUEST))
    given = {name: value for name, value in given.items() if value is not None}
    if isinstance(given.get("done"), ExactDesign):
        given["done"] = given["done"].counts
    return given


def _asked(criterion, W, interest, region, p, gap):
    return {"criterion": criterion, "W": W, "interest": interest, "region": region, "p": p,
            "gap": gap}


def _information(H, request, psd_tolerance=1e-6, factors=False):
    """The set itself where it was made before, so that it is checked once."""
    if isinstance(H, _graybox.InformationSet):
        if factors and H.factors is None:
            raise _graybox.InputError("factors: the InformationSet holds matrices; make it with "
                                      "factors=True")
        return H
    return _graybox.InformationSet(H, psd_tolerance=psd_tolerance, factors=factors,
                                   singular=any(name in request for name in (*_PRIOR, "request")))


def solve(H, criterion="D", *, gap=1e-6, solver="column_generation", W=None, interest=None,
          region=None, p=None, floor=None, start=None, time_limit=None, iteration_limit=0, seed=1,
          threads=1, psd_tolerance=1e-6, factors=False, progress=None, **request):
    """The best design, certified: the share of the experiments that each candidate gets.

    H: matrices [Q, d, d], packed ones [Q, p] (float64: not copied), a file, or an InformationSet.
    factors: H holds factors F of F'F instead, vectors [Q, d] or [Q, k, d]. No matrices are made of
    them for criterion D by column_generation.
    criterion: a dict of several and their shares, as {"D": 0.5, "A": 0.5}, or one: "D", "A", "E", "L" with W (a matrix, or the vector c of one combination), "Ds" with
    interest (names or indices of parameters), "c" with W (a vector, or rows of them), "I" or "G" with
    region (rows of regressors; None: the candidates), or "phi_p" with p.
    floor: what other criteria keep of what is possible, as {"A": 0.9, "E": 0.8}. It does not go
    with a request.
    start: a Design, or Q weights, to begin from.
    request: experiments, budget, prior, done, costs, stock, require, forbid, block_sizes,
    constraints, and rows A_ub x <= b_ub, A_eq x = b_eq of the numbers of experiments x. All of
    these may be in a file, request="request.yaml", whose entries give way to those named here.
    """
    request = _request(request)
    information = _information(H, request, psd_tolerance, factors)
    asked = {**_asked(criterion, W, interest, region, p, gap), "floor": floor}
    run = {"solver": solver, "time_limit": time_limit, "iteration_limit": iteration_limit,
           "seed": seed, "threads": threads,
           "start": start.weights if isinstance(start, Design) else start}
    with Line(progress) as show:
        fields = _graybox.solve(information, {**asked, **run}, request, show)
    interrupted = fields.pop("interrupted")
    return finished(Design(information, {**asked, **request}, fields), interrupted)


def certify(H, weights, criterion="D", *, gap=1e-9, W=None, interest=None, region=None, p=None,
            floor=None, floor_multipliers=None, dual_matrix=None, psd_tolerance=1e-6, factors=False,
            **request):
    """What the checker proves of a design, from set and weights alone, whoever made it.

    weights: Q numbers, or a Design. Under a request they are numbers of experiments.
    floor: as in solve(). What is kept of each is proven from the weights alone (`floors`). The gap
    needs the floors' multipliers, which a Design brings along; without them it is loose.
    """
    request = _request(request)
    if isinstance(weights, Design):
        if floor is not None and floor_multipliers is None:
            floor_multipliers = {each["criterion"]: each["multiplier"] for each in weights.floors}
        dual_matrix = weights.dual_matrix if dual_matrix is None else dual_matrix
        weights = weights.efforts if request else weights.weights
        if weights is None:
            raise _graybox.InputError("weights: there is no design to certify")
    information = _information(H, request, psd_tolerance, factors)
    return Certificate(**_graybox.certify(
        information, weights, {**_asked(criterion, W, interest, region, p, gap), "floor": floor,
                               "floor_multipliers": floor_multipliers,
                               "dual_matrix": dual_matrix}, request))


def exact(H, experiments=None, criterion="D", *, method="branch_and_bound", gap=1e-6, W=None,
          interest=None, region=None, p=None, top=1, time_limit=None, seed=1, threads=1,
          psd_tolerance=1e-6, factors=False, progress=None, **request):
    """How often to run each candidate, in whole numbers, with a proven efficiency.

    The further arguments are those of solve(); top: how many of the best designs to list.
    """
    if experiments is not None:
        request["experiments"] = experiments
    request = _request(request)
    information = _information(H, request, psd_tolerance, factors)
    asked = _asked(criterion, W, interest, region, p, gap)
    run = {"method": method, "time_limit": time_limit, "seed": seed, "threads": threads, "top": top}
    with Line(progress) as show:
        fields = _graybox.exact(information, {**asked, **run}, request, show)
    interrupted = fields.pop("interrupted")
    return finished(ExactDesign(information, {**asked, **request}, fields), interrupted)


def certify_exact(H, counts, criterion="D", *, bound=float("inf"), W=None, interest=None,
                  region=None, p=None, psd_tolerance=1e-6, factors=False, **request):
    """What the checker proves of whole numbers of experiments.

    bound: of log det, proven elsewhere (D without a request); without it that of the relaxed
    problem. The further arguments are those of solve(); without experiments and budget the counts
    are compared with all others of their sum.
    """
    request = _request(request)
    counts = counts.counts if isinstance(counts, ExactDesign) else counts
    information = _information(H, request, psd_tolerance, factors)
    return ExactCertificate(**_graybox.certify_exact(
        information, counts, bound, _asked(criterion, W, interest, region, p, None), request))


def solvers():
    """The back-ends: a list of dicts with name, description, criteria, whether it is there, and
    whether it takes a start."""
    return _graybox.solver_list()


def save(design, path):
    """A graybox-design/1 file, which `graybox check` and load_design() read."""
    if "file" in design._asked:
        raise _graybox.InputError(f"save: the design was read from {design._asked['file']}; copy that")
    if design._writer is not None:
        design._writer.write(os.fspath(path))
        return
    if isinstance(design, ExactDesign) or design.weights is None:
        raise _graybox.InputError("save: there is no design to write")
    _graybox.save_design(
        design._information,
        {**design._asked, "dual_matrix": [] if design.dual_matrix is None else design.dual_matrix, "solver": design.solver,
         "status": design.status, "seconds": design.seconds, "passes": design.passes,
         "iterations": design.iterations}, design.weights, os.fspath(path))


def load_design(H, path, *, gap=None, psd_tolerance=1e-6, factors=False):
    """The design of a graybox-design/1 file, certified anew: a Design, or an ExactDesign.

    What the file states is its own account; the certificate is the checker's, under the file's
    criterion, request and floors. The efficiency of an ExactDesign is what the relaxed problem
    proves, and `stated_efficiency` what the file says.
    gap: to hold it to, in place of the file's.
    """
    path = os.fspath(path)
    try:
        with open(path, encoding="utf-8") as file:
            said = json.load(file)
    except (OSError, ValueError):
        said = None  # what is wrong is the library's to say
    said = said if isinstance(said, dict) else {}
    request = said.get("request", {})
    prior = [*request, *request.get("numbers", {})] if isinstance(request, dict) else []
    information = _information(H, [name for name in prior if name in _PRIOR], psd_tolerance, factors)
    fields = _graybox.load_design(information, path, gap)
    report, exact = fields.pop("report"), fields.pop("exact", None)
    asked = {"file": path}
    if exact is None:
        return Design(information, asked, {**report, **fields, "trace": np.zeros((0, 4))})
    designs = []
    for each in said.get("designs", []):
        counts = np.zeros(len(information), dtype=np.int64)
        for run in each["counts"]:
            counts[run["index"]] = run["count"]
        designs.append(counts)
    return ExactDesign(information, asked, {
        "counts": fields["counts"], "designs": designs, "status": said.get("status", ""),
        "message": said.get("message", ""), "log_det": exact["log_det"],
        "criterion_value": exact.get("criterion_value", exact["log_det"]), "bound": exact["bound"],
        "efficiency": exact["efficiency"], "stated_efficiency": said.get("proven_efficiency"),
        "nodes": said.get("nodes", 0), "seconds": report["seconds"], "_proof": exact})
