"""What the calls hand back: plain objects with names, a text, and HTML for notebooks."""
import html
import json

import numpy as np

from . import _figures, _graybox


class _Plain:
    """Named fields, shown as a table."""

    _title = ""

    def _rows(self):
        return []

    def _figures(self):
        return []

    def __repr__(self):
        rows = self._rows()
        width = max((len(name) for name, _ in rows), default=0)
        return "\n".join([self._heading(), *(f"  {name:<{width}}  {text}" for name, text in rows)])

    def _heading(self):
        return self._title

    def _repr_html_(self):
        rows = "".join(f"<tr><th style='text-align:left'>{html.escape(name)}</th>"
                       f"<td style='text-align:left'>{html.escape(text)}</td></tr>"
                       for name, text in self._rows())
        figures = "".join(f"<div style='max-width:46em'>{svg}</div>" for svg in self._figures())
        return f"<div><b>{html.escape(self._heading())}</b><table>{rows}</table>{figures}</div>"


class Certificate(_Plain):
    """What is proven of a design.

    status ("certified", "singular", "not_a_design"), gap, rounding_bound, log_det, criterion_value,
    log_det_gap, efficiency (at least), worst_candidate, support_size, clipped, renormalised,
    message; bound: no design has a larger log det (D) than this; violation: of a request's rows,
    relative; floors: dicts with criterion, share, multiplier and efficiency (kept, at least).
    """

    def __init__(self, violation=0.0, proves_gap=None, floors=(), **fields):
        self.__dict__.update(fields)
        self.floors = list(floors)
        self.violation = violation
        self.proves_gap = proves_gap

    @property
    def bound(self):
        return self.criterion_value + self.log_det_gap

    def proves(self, gap):
        """Whether the gap is at most this for certain, rounding included."""
        return _graybox.proves(self.status == "certified", self.gap, self.rounding_bound, gap)

    def __eq__(self, other):
        return isinstance(other, Certificate) and self.__dict__ == other.__dict__

    __hash__ = None

    def _heading(self):
        return f"{self.status}{': ' + self.message if self.message else ''}"

    def _rows(self):
        if self.status != "certified":
            return []
        return [("duality gap", f"{self.gap:.3e} (rounding at most {self.rounding_bound:.1e})"),
                ("log det M", f"{self.log_det:.10g}"),
                ("efficiency", f"at least {self.efficiency:.10f}"),
                ("support", f"{self.support_size} candidates"), *_floor_rows(self.floors)]


def _floor_rows(floors):
    return [("floor", f"{each['criterion']} {each['share']:g}, kept: "
             + ("unknown" if each["efficiency"] is None else f"at least {each['efficiency']:.6f}"))
            for each in floors]


class ExactCertificate(Certificate):
    """The same of whole numbers of experiments: experiments, log_det, criterion_value, efficiency
    (at least, of the best exact design), and bound: no exact design has a better value."""

    bound = criterion_value = None

    def _rows(self):
        value = [] if self.criterion_value is None else [
            ("criterion", f"{self.criterion_value:.10g}")]
        return [("experiments", str(self.experiments)), ("log det M", f"{self.log_det:.10g}"), *value,
                ("bound", f"{self.bound:.10g} of all designs that may be run"),
                ("efficiency", f"at least {self.efficiency:.8f}")]


class Design(_Plain):
    """A design and what the checker proved of it.

    weights (None where there is no answer), support (indices, heaviest first), efforts (numbers of
    experiments, under a request), certificate, status, solver, message, seconds, passes, iterations,
    trace (rows of seconds, passes, gap, iteration), floors (dicts with criterion, share, multiplier,
    efficiency); gap, log_det, bound and efficiency are the certificate's.
    """

    dual_matrix = efforts = multipliers = None

    def __init__(self, information, asked, fields):
        self._information = information
        self._asked = asked
        self._writer = fields.pop("writer", None)
        self.floors = fields.pop("floors", [])
        self.certificate = Certificate(**fields.pop("certificate"), floors=self.floors)
        self.__dict__.update(fields)
        if self.dual_matrix is not None and len(self.dual_matrix) == 0:
            self.dual_matrix = None

    gap = property(lambda self: self.certificate.gap)
    rounding_bound = property(lambda self: self.certificate.rounding_bound)
    log_det = property(lambda self: self.certificate.log_det)
    bound = property(lambda self: self.certificate.bound)
    efficiency = property(lambda self: self.certificate.efficiency)
    solved = property(lambda self: self.status == "solved")

    @property
    def support(self):
        if self.weights is None:
            return np.array([], dtype=int)
        heaviest_first = np.argsort(-self.weights, kind="stable")
        return heaviest_first[:np.count_nonzero(self.weights > 0)]

    def certify(self, **changes):
        """Certifies the weights anew, by the checker alone. Of a design that was read from a file
        only the gap can be changed."""
        from ._designs import certify, load_design
        if "file" in self._asked:
            return load_design(self._information, self._asked["file"], **changes).certificate
        asked = {**self._asked, **changes}
        return certify(self._information, self, asked.pop("criterion"),
                       **asked)

    def save(self, path):
        """Writes a graybox-design/1 file."""
        from ._designs import save
        save(self, path)

    def _heading(self):
        return f"{self.solver}: {self.status}{' (' + self.message + ')' if self.message else ''}"

    def _rows(self):
        if self.weights is None:
            return []
        support = self.support
        shown = ", ".join(f"{i}: {self.weights[i]:.6f}" for i in support[:10])
        more = f", and {len(support) - 10} more" if len(support) > 10 else ""
        work = (f"{self.iterations} iterations, {self.passes:.1f} passes, "
                f"{1e3 * self.seconds:.3g} ms")
        return [*self.certificate._rows(), ("weights", shown + more), ("work", work)]

    def _figures(self):
        return [] if self.weights is None else [_figures.stems(
            self.weights, "weight", f"Design of {self.solver}")]


class ExactDesign(_Plain):
    """Whole numbers of experiments.

    counts (None where there is none), log_det, criterion_value, bound (no exact design has a better
    value, proven), efficiency (proven, at least), status, message, nodes, seconds, designs (the best
    ones, with top).
    """

    stated_efficiency = None

    def __init__(self, information, asked, fields):
        self._information = information
        self._asked = asked
        self._writer = fields.pop("writer", None)
        self.__dict__.update(fields)

    optimal = property(lambda self: self.status == "optimal")

    @property
    def support(self):
        return np.array([], dtype=int) if self.counts is None else np.flatnonzero(self.counts)

    def certify(self):
        """Certifies the counts anew, against the bound of the relaxed problem alone."""
        from ._designs import certify_exact, load_design
        if "file" in self._asked:
            read = load_design(self._information, self._asked["file"])
            return ExactCertificate(**read._proof)
        asked = dict(self._asked)
        asked.pop("gap", None)
        return certify_exact(self._information, self, asked.pop("criterion"), **asked)

    def save(self, path):
        """Writes a graybox-design/1 file."""
        from ._designs import save
        save(self, path)

    def _heading(self):
        return f"exact design: {self.status}{' (' + self.message + ')' if self.message else ''}"

    def _rows(self):
        if self.counts is None:
            return []
        support = self.support
        shown = ", ".join(f"{i}: {self.counts[i]}" for i in support[:15])
        more = f", and {len(support) - 15} more" if len(support) > 15 else ""
        return [("experiments", str(int(self.counts.sum()))),
                ("criterion", f"{self.criterion_value:.10g}"),
                ("efficiency", f"at least {self.efficiency:.8f}, proven"),
                ("counts", shown + more), ("work", f"{self.nodes} nodes, {self.seconds:.3g} s")]

    def _figures(self):
        return [] if self.counts is None else [_figures.stems(
            self.counts, "experiments", "Exact design")]


class _Answer(_Plain):
    """An answer that the command writes as JSON: its entries are attributes; `data` holds all."""

    def __init__(self, data):
        self.data = data

    def __getattr__(self, name):
        if name == "data":  # not made yet: while an object is copied
            raise AttributeError(name)
        try:
            return self.data[name]
        except KeyError:
            raise AttributeError(f"{type(self).__name__} has no '{name}'; it has "
                                 + ", ".join(self.data)) from None

    def __dir__(self):
        return [*super().__dir__(), *self.data]

    def to_json(self):
        return json.dumps(self.data)


class Verdict(_Answer):
    """What physics the model lacks: the entries of verdict.json, figures (name: SVG), model (the
    extended model's text, or None)."""

    def __init__(self, data, figures, model):
        super().__init__(data)
        self.figures = figures
        self.model = model

    def _heading(self):
        return f"verdict: {self.data['verdict']}"

    def __repr__(self):
        return "\n".join([self._heading(), *self.data["words"]])

    def _repr_html_(self):
        words = "".join(f"<p>{html.escape(line)}</p>" for line in self.data["words"])
        figures = "".join(f"<div style='max-width:46em'>{svg}</div>"
                          for svg in self.figures.values())
        return f"<div><b>{html.escape(self._heading())}</b>{words}{figures}</div>"


class Fit(_Answer):
    """Fitted parameters: the entries of graybox-fit/1; `values` and `standard_errors` by name."""

    def __init__(self, data, text):
        super().__init__(data)
        self._text = text

    converged = property(lambda self: self.data["status"] == "converged")

    @property
    def values(self):
        return {each["name"]: each["value"] for each in self.data["parameters"]}

    @property
    def standard_errors(self):
        return {each["name"]: each["standard_error"] for each in self.data["parameters"]}

    def __repr__(self):
        return self._text.rstrip("\n")

    def _heading(self):
        return f"fit: {self.data['status']}"

    def _rows(self):
        def error(each):
            known = each["standard_error"]
            return "not determined" if known is None else f"± {known:.3g}"
        return [(each["name"], f"{each['value']:.6g} {error(each)} {each['unit']}")
                for each in self.data["parameters"]]


class Prediction(_Answer):
    """How well the model predicts as it stands: rows (recording, channel, seconds_ahead, nrmse, ...)
    and curves (recording, channel, unit, time, measured, predicted)."""

    def __init__(self, data, curves):
        super().__init__(data)
        self.curves = curves

    def _heading(self):
        return f"{self.data['predicted']} as the model stands: rms error in % of the signal's deviation"

    def _rows(self):
        def ahead(row):
            seconds = row["seconds_ahead"]
            return "free run" if seconds is None else f"{seconds:.3g} s ahead"

        def share(row):
            return "unknown" if row["nrmse"] is None else f"{row['nrmse']:.3g} %"
        is_motion = self.data["predicted"] == "outputs"
        return [(f"{row['recording']} {row['channel']}",
                 f"{share(row)} {ahead(row) if is_motion else 'at measured motion'}")
                for row in self.data["rows"]]

    def _figures(self):
        return [_figures.curves(curve) for curve in self.curves[:6]]


class Simulation(_Answer):
    """A simulated campaign: campaign (its folder), recordings, already_there, complete."""

    def _heading(self):
        return f"{self.data['recordings']} recordings in {self.data['campaign']}"


class MachineModel(_Answer):
    """A proposed model: model and campaign (files), guesses, notes, questions (open ones)."""

    def _heading(self):
        return f"proposed {self.data['model']} and {self.data['campaign']}"

    def _rows(self):
        return [*((each["what"], f"{each['value']} ({each['why']})")
                  for each in self.data["guesses"]),
                *(("note", each) for each in self.data["notes"]),
                *(("ANSWER", each) for each in self.data["questions"])]
