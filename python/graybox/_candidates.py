"""Candidates from a callable of one's own."""
import numpy as np

from . import _graybox
from ._progress import Line, finished
from ._results import Certificate, _Plain


def _information(function, point, noise):
    value = np.asarray(function(point), dtype=float)
    if noise is None:
        return value
    jacobian = np.atleast_2d(value)
    packed = _graybox.information_of_jacobians(jacobian[None], noise)[0]
    d = jacobian.shape[1]
    full = np.empty((d, d))
    rows, columns = np.tril_indices(d)
    full[rows, columns] = full[columns, rows] = packed
    return full


def candidates(function, points, *, noise=None, parameters=None, names=None):
    """An InformationSet of experiments that a callable describes.

    points: [Q, n], what may be chosen; function(point) gives the information matrix [d, d]. With
    noise (standard deviations of the r outputs, or their covariance) it gives the Jacobian [r, d]
    of the outputs with respect to the parameters. names: of the coordinates, for forbid="x1 > 2".
    """
    points = np.asarray(points, dtype=float)
    if points.ndim == 1:
        points = points[:, None]
    values = np.stack([np.asarray(function(point), dtype=float) for point in points])
    if noise is not None:
        if values.ndim == 2:
            values = values[:, None, :]
        values = _graybox.information_of_jacobians(values, noise)
    return _graybox.InformationSet(values, coordinates=points, coordinate_names=names,
                                   parameters=parameters)


class ContinuousDesign(_Plain):
    """A design between the points of a grid: points [n_support, n], weights, log_det, status,
    found_gap (the largest that the searches found), grid_log_det (the best on the grid alone),
    certificate (over the grid and the points: a proof there, evidence for the box)."""

    def __init__(self, fields):
        self.certificate = Certificate(**fields.pop("certificate"))
        self.__dict__.update(fields)

    def _heading(self):
        return f"continuous design: {self.status}"

    def _rows(self):
        return [*((np.array2string(point, precision=6), f"{weight:.6f}")
                  for point, weight in zip(self.points, self.weights)),
                ("log det M", f"{self.log_det:.10g}, on the grid {self.grid_log_det:.10g}"),
                ("gap", f"{self.found_gap:.2e} found by searches in the box")]


def continuous(function, lower, upper, grid, *, noise=None, gap=1e-3, random_points=2000, seed=1,
               progress=None):
    """The D-optimal design over all points between lower and upper, not those of a grid alone.

    function, noise: as for candidates(); called some thousand times. grid: points [Q, n] to begin
    with, or an InformationSet of candidates().
    """
    lower, upper = np.atleast_1d(lower), np.atleast_1d(upper)
    if not isinstance(grid, _graybox.InformationSet):
        grid = candidates(function, grid, noise=noise)
    with Line(progress) as show:
        fields = _graybox.continuous(lambda point: _information(function, point, noise), lower,
                                     upper, grid, {"gap": gap, "seed": seed,
                                                   "random_points": random_points}, show)
    interrupted = fields.pop("interrupted")
    return finished(ContinuousDesign(fields), interrupted)
