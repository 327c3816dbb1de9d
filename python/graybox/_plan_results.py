"""What plans and robust designs hand back."""
import numpy as np

from . import _figures, _graybox
from ._results import Certificate, _Answer, _Plain


def _heaviest(weights):
    return np.argsort(-weights, kind="stable")[:np.count_nonzero(weights > 0)]


class Plan(_Plain):
    """How many experiments reach the targets, and which.

    status ("proven", "reached", "out_of_reach", "not_found"), experiments, least (no smaller number
    does: proven), with costs in its place cost and least_cost (no design that reaches the targets
    costs less: proven), counts (None where none were found), targets (dicts: target, asked, reached,
    effect, power), worst_ratio (out of reach: the worst error over its limit is at least this),
    message.
    """

    def __init__(self, at_most, fields):
        self.at_most = at_most
        self.__dict__.update(fields)

    proven = property(lambda self: self.status == "proven")

    @property
    def support(self):
        return np.array([], dtype=int) if self.counts is None else np.flatnonzero(self.counts)

    def _heading(self):
        if self.least_cost is not None:
            said = "none" if self.counts is None else f"{self.experiments} experiments for {self.cost:g}"
            said += f"; at least {self.least_cost:g} is needed"
        elif self.counts is None:
            said = f"none up to {self.at_most}; at least {self.least} are needed"
        else:
            said = f"{self.experiments} experiments, at least {self.least} are needed"
        return f"plan: {self.status}: {said}{' (' + self.message + ')' if self.message else ''}"

    def _rows(self):
        def reached(row):
            if row["reached"] is None:
                return f"asked {row['asked']:.4g}"
            power = "" if row["power"] is None else f", power {row['power']:.4g}"
            return f"{row['reached']:.4g}, asked {row['asked']:.4g}{power}"
        rows = [(f"sd({row['target']})", reached(row)) for row in self.targets]
        if self.counts is None:
            return rows
        shown = ", ".join(f"{i}: {self.counts[i]}" for i in self.support[:15])
        more = f", and {len(self.support) - 15} more" if len(self.support) > 15 else ""
        return [*rows, ("counts", shown + more)]

    def _figures(self):
        return [] if self.counts is None else [_figures.stems(
            self.counts, "experiments", "Plan")]


class _Weighted(_Plain):
    """A design of weights with its certificate; those of the further kinds say what they add."""

    def __init__(self, fields):
        self.certificate = Certificate(**fields.pop("certificate"))
        self.__dict__.update(fields)

    gap = property(lambda self: self.certificate.gap)
    efficiency = property(lambda self: self.certificate.efficiency)
    solved = property(lambda self: self.status == "solved")

    @property
    def support(self):
        return np.array([], dtype=int) if self.weights is None else _heaviest(self.weights)

    def _heading(self):
        return f"{self.solver}: {self.status}{' (' + self.message + ')' if self.message else ''}"

    def _of_its_kind(self):
        return []

    def _rows(self):
        if self.weights is None:
            return []
        shown = ", ".join(f"{i}: {self.weights[i]:.6f}" for i in self.support[:10])
        more = f", and {len(self.support) - 10} more" if len(self.support) > 10 else ""
        rows = [row for row in self.certificate._rows() if row[0] != "log det M"]
        return [*rows, *self._of_its_kind(), ("weights", shown + more)]

    def _figures(self):
        return [] if self.weights is None else [_figures.stems(
            self.weights, "weight", f"Design of {self.solver}")]


class RobustDesign(_Weighted):
    """One design for several sets.

    weights, support, status, certificate, gap and efficiency (of the objective), value (of the
    objective); for each set log_dets, optima (the log det that it reaches alone), efficiencies
    (D-efficiency against that) and prices (how much it decides).
    """

    def __init__(self, information, asked, fields):
        self._information = information
        self._asked = asked
        super().__init__(fields)

    def certify(self):
        """Certifies the weights anew, by the checker alone, from the sets, prices and optima."""
        relative = self.objective == "worst_case" and self._asked["reference"] == "optimum"
        return Certificate(**_graybox.certify_robust(
            self._information, self.weights, self.prices, self.optima if relative else None,
            {"objective": self.objective}))

    def _of_its_kind(self):
        return [("objective", f"{self.objective}: {self.value:.10g}"),
                ("efficiencies", f"smallest {min(self.efficiencies):.4f}, "
                                 f"median {np.median(self.efficiencies):.4f}")]


class ConcentratedDesign(_Weighted):
    """A design under a limit on its concentration.

    weights, support, status, certificate, gap and efficiency (among the designs that obey the
    limit), concentration (what the `of` heaviest candidates hold), largest_share, price (what log det M
    gains for each unit of the share).
    """

    log_det = property(lambda self: self.certificate.log_det)

    def __init__(self, information, fields):
        self._information = information
        super().__init__(fields)

    def certify(self):
        """Certifies the weights anew, by the checker alone."""
        return Certificate(**_graybox.certify_concentrated(self._information, self.weights,
                                                           self.largest_share, self.of))

    def _of_its_kind(self):
        return [("log det M", f"{self.log_det:.10g}"),
                ("limit", f"at most {self.largest_share:g} on any {self.of} candidates; they hold "
                          f"{self.concentration:.6f}")]


class SpectrumDesign(_Weighted):
    """Positions of a robot with the spectrum in each.

    weights (one a line of the spectrum and position), shares (of the time in each position),
    covariance ((det M^-1)^(1/d)), coordinates (of each weight: joint angles, frequency, axis, named
    by coordinate_names), information (the InformationSet), lines (a position), status, certificate.
    """

    solver = "spectrum"
    log_det = property(lambda self: self.certificate.log_det)

    @property
    def positions(self):
        """Those that are used, the one with the largest share first."""
        return _heaviest(self.shares)

    def _of_its_kind(self):
        return [("covariance", f"{self.covariance:.6g} in {len(self.positions)} positions")]


class SequentialStudy(_Answer):
    """Repetitions of measuring, estimating and designing again.

    summary: medians for each strategy ("sequential", "fixed", "oracle", "random") and stage, of
    parameter_error, expected_error, design_efficiency; records: of each repetition; parameters.
    """

    def _heading(self):
        done, asked = self.data["repetitions"], self.data["asked_repetitions"]
        return f"sequential: {done} of {asked} repetitions"

    def _rows(self):
        def said(row):
            error = 100 * row["parameter_error"]
            return f"error {error:.3g} % after {row['experiments']} experiments"
        return [(f"{row['strategy']} {row['stage']}", said(row)) for row in self.data["summary"]]
