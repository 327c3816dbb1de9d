"""Designs: solve, certify, exact."""
import os

from . import _graybox
from ._progress import Line, finished
from ._results import Certificate, Design, ExactCertificate, ExactDesign

_PRIOR = ("prior", "done")
_REQUEST = ("experiments", "budget", "prior", "done", "costs", "stock", "require", "forbid",
            "block_sizes", "constraints", "A_ub", "b_ub", "A_eq", "b_eq")


def _request(given):
    if not given:
        return given
    unknown = sorted(set(given) - set(_REQUEST))
    if unknown:
        raise TypeError(f"unknown argument '{unknown[0]}'; what the next experiments have to obey: "
                        + ", ".join(_REQUEST))
    return {name: value for name, value in given.items() if value is not None}


def _information(H, request, psd_tolerance=1e-6, factors=False):
    """The set itself where it was made before, so that it is checked once."""
    if isinstance(H, _graybox.InformationSet):
        if factors and H.factors is None:
            raise _graybox.InputError("factors: the InformationSet holds matrices; make it with "
                                      "factors=True")
        return H
    return _graybox.InformationSet(H, psd_tolerance=psd_tolerance, factors=factors,
                                   singular=any(name in request for name in _PRIOR))


def solve(H, criterion="D", *, gap=1e-6, solver="column_generation", W=None, interest=None,
          region=None, p=None, start=None, time_limit=None, iteration_limit=0, seed=1, threads=1,
          psd_tolerance=1e-6, factors=False, progress=None, **request):
    """The best design, certified: the share of the experiments that each candidate gets.

    H: matrices [Q, d, d], packed ones [Q, p] (float64: not copied), a file, or an InformationSet.
    factors: H holds factors F of F'F instead, vectors [Q, d] or [Q, k, d]. No matrices are made of
    them for criterion D by column_generation.
    criterion: a dict of several and their shares, as {"D": 0.5, "A": 0.5}, or one: "D", "A", "E", "L" with W (a matrix, or the vector c of one combination), "Ds" with
    interest (names or indices of parameters), "c" with W (a vector, or rows of them), "I" or "G" with
    region (rows of regressors; None: the candidates), or "phi_p" with p.
    start: a Design, or Q weights, to begin from.
    request: experiments, budget, prior, done, costs, stock, require, forbid, block_sizes,
    constraints, and rows A_ub x <= b_ub, A_eq x = b_eq of the numbers of experiments x.
    """
    request = _request(request)
    information = _information(H, request, psd_tolerance, factors)
    asked = {"criterion": criterion, "W": W, "interest": interest, "region": region, "p": p,
             "gap": gap}
    run = {"solver": solver, "time_limit": time_limit, "iteration_limit": iteration_limit,
           "seed": seed, "threads": threads,
           "start": start.weights if isinstance(start, Design) else start}
    with Line(progress) as show:
        fields = _graybox.solve(information, {**asked, **run}, request, show)
    interrupted = fields.pop("interrupted")
    return finished(Design(information, {**asked, **request}, fields), interrupted)


def certify(H, weights, criterion="D", *, gap=1e-9, W=None, interest=None, region=None, p=None,
            dual_matrix=None, psd_tolerance=1e-6, factors=False, **request):
    """What the checker proves of a design, from set and weights alone, whoever made it.

    weights: Q numbers, or a Design. Under a request they are numbers of experiments.
    """
    request = _request(request)
    if isinstance(weights, Design):
        dual_matrix = weights.dual_matrix if dual_matrix is None else dual_matrix
        weights = weights.efforts if request else weights.weights
        if weights is None:
            raise _graybox.InputError("weights: there is no design to certify")
    information = _information(H, request, psd_tolerance, factors)
    return Certificate(**_graybox.certify(
        information, weights, {"criterion": criterion, "W": W, "interest": interest, "region": region,
                               "p": p, "gap": gap, "dual_matrix": dual_matrix}, request))


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
    asked = {"criterion": criterion, "W": W, "interest": interest, "region": region, "p": p,
             "gap": gap}
    run = {"method": method, "time_limit": time_limit, "seed": seed, "threads": threads, "top": top}
    with Line(progress) as show:
        fields = _graybox.exact(information, {**asked, **run}, request, show)
    interrupted = fields.pop("interrupted")
    return finished(ExactDesign(information, {**asked, **request}, fields), interrupted)


def certify_exact(H, counts, *, bound=float("inf"), psd_tolerance=1e-6, factors=False):
    """What the checker proves of whole numbers of experiments (criterion D).

    bound: of log det, proven elsewhere; without it that of the relaxed problem.
    """
    counts = counts.counts if isinstance(counts, ExactDesign) else counts
    information = _information(H, {}, psd_tolerance, factors)
    return ExactCertificate(**_graybox.certify_exact(information, counts, bound))


def solvers():
    """The back-ends: a list of dicts with name, description, criteria, whether it is there, and
    whether it takes a start."""
    return _graybox.solver_list()


def save(design, path):
    """A graybox-design/1 file, which `graybox check` reads."""
    if any(name in design._asked for name in _REQUEST):
        raise _graybox.InputError("save: designs under constraints are written by 'graybox solve -o'")
    if design.weights is None:
        raise _graybox.InputError("save: there is no design to write")
    certificate = design.certificate
    _graybox.save_design(
        design._information,
        {**design._asked, "dual_matrix": [] if design.dual_matrix is None else design.dual_matrix, "solver": design.solver,
         "status": design.status, "seconds": design.seconds, "passes": design.passes,
         "iterations": design.iterations}, design.weights, os.fspath(path))
    return certificate
