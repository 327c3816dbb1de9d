"""Plans and robust designs: plan, precision_curve, robust, concentrated."""
from . import _graybox
from ._designs import _information, _request
from ._plan_results import ConcentratedDesign, Plan, RobustDesign
from ._progress import Line, finished


def _texts(value):
    return [value] if isinstance(value, str) else list(value)


def _question(targets, detect, power, level, noise, at_most, time_limit, seed, threads, gap=1e-3):
    return {"targets": _texts(targets), "detect": _texts(detect), "power": power, "level": level,
            "noise": noise, "at_most": at_most, "time_limit": time_limit, "seed": seed,
            "threads": threads, "gap": gap}


def plan(H, targets=(), *, detect=(), power=0.9, level=0.05, noise=1.0, at_most=1000, gap=1e-3,
         time_limit=60.0, seed=1, threads=1, psd_tolerance=1e-6, factors=False, progress=None,
         **request):
    """The smallest number of experiments that reaches every target, which ones, and the proof.

    H: as for solve(); each matrix is the information of one experiment. targets: a text or several,
    "sd(k1) <= 0.02", "sd(2*k1 - k2) <= 0.1", "sd(all) <= 5 %". detect: changes that a test of that
    level is to see with that power, "k1 by 0.05". noise: standard deviation over the one that H
    assumes. request: prior, done, stock, require, forbid and constraints, as for solve(). With costs
    it is the cheapest campaign that is found: to the gap, or to the last unit where all costs are
    multiples of one. A budget limits it.
    """
    request = _request(request)
    information = _information(H, request, psd_tolerance, factors)
    asked = _question(targets, detect, power, level, noise, at_most, time_limit, seed, threads, gap)
    with Line(progress) as show:
        fields = _graybox.plan(information, asked, request, show)
    interrupted = fields.pop("interrupted")
    return finished(Plan(at_most, fields), interrupted)


def precision_curve(H, experiments, targets=(), *, detect=(), power=0.9, level=0.05, noise=1.0,
                    time_limit=60.0, seed=1, threads=1, psd_tolerance=1e-6, factors=False,
                    progress=None, **request):
    """What each number of experiments reaches: a list of dicts.

    experiments: numbers. Each dict has experiments, ratio (the worst target's standard error over
    its limit, of the best whole numbers found), least_ratio (no design has less: proven) and
    targets. The further arguments are those of plan().
    """
    request = _request(request)
    information = _information(H, request, psd_tolerance, factors)
    asked = _question(targets, detect, power, level, noise, 1000, time_limit, seed, threads)
    with Line(progress) as show:
        return _graybox.plan_curve(information, [int(each) for each in experiments], asked, request,
                                   show)


def robust(sets, *, objective="worst_case", reference="optimum", gap=1e-6, time_limit=None,
           threads=1, psd_tolerance=1e-6, factors=False, progress=None):
    """One design for several sets over the same candidates, one for each thing that may be so.

    objective: "worst_case", the smallest D-efficiency is as large as can be, or "average", the mean
    log det. reference: of the worst case, "optimum", or "none" for the smallest log det itself.
    """
    information = [_information(each, {}, psd_tolerance, factors) for each in sets]
    asked = {"objective": objective, "reference": reference}
    with Line(progress) as show:
        fields = _graybox.robust(information, {**asked, "gap": gap, "time_limit": time_limit,
                                               "threads": threads}, show)
    interrupted = fields.pop("interrupted")
    return finished(RobustDesign(information, asked, fields), interrupted)


def concentrated(H, largest_share, of_candidates, *, gap=1e-6, time_limit=None, threads=1,
                 psd_tolerance=1e-6, factors=False, progress=None):
    """The D-optimal design with at most `largest_share` of the weight on any of the candidates that
    are the fraction `of_candidates` of all."""
    information = _information(H, {}, psd_tolerance, factors)
    with Line(progress) as show:
        fields = _graybox.concentrated(information, largest_share, of_candidates,
                                       {"gap": gap, "time_limit": time_limit, "threads": threads},
                                       show)
    interrupted = fields.pop("interrupted")
    return finished(ConcentratedDesign(information, fields), interrupted)
