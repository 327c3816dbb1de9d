"""Draws points and the ellipsoid around them: every pair of coordinates, with the ellipsoid's projection.

    scripts/ellipsoid_plot points.csv ellipsoid.json ellipsoid.svg

The ellipsoid is that of 'graybox ellipsoid points.csv -o ellipsoid.json'. Points that hold it are circled, dropped
ones crossed out. The ending of the last name chooses the format.
"""

import itertools
import json
import pathlib
import sys

import matplotlib.pyplot as plt
import numpy as np

from style import BLUE, GREY, VERMILION

LARGEST_SCATTER = 20000  # points drawn
LARGEST_COORDINATES = 5


def read_points(file, dimension):
    if file.suffix == ".npy":
        return np.load(file)
    rows = []
    with open(file, encoding="utf-8-sig") as stream:
        for line in stream:
            line = line.strip()
            if not line or line.startswith("#"):
                continue
            separator = next((s for s in ";,\t" if s in line), None)
            try:
                rows.append([float(field.strip().strip('"')) for field in line.split(separator)])
            except ValueError:  # the header
                continue
    points = np.array(rows)
    if points.ndim != 2 or points.shape[1] != dimension:
        sys.exit(f"{file}: has not the {dimension} columns that the ellipsoid has")
    return points


def spread(ellipsoid):
    """E^-1, of which every block is the projection onto its coordinates."""
    return sum(axis["length"] ** 2 * np.outer(axis["direction"], axis["direction"])
               for axis in ellipsoid["semi_axes"])


def readable(name):
    """'current [A]' of a file's head as 'current (A)'."""
    return name.replace("[", "(").replace("]", ")")


def panel(axes, points, ellipsoid, matrix, pair):
    i, j = pair
    contact = [entry["index"] for entry in ellipsoid["contact"]]
    dropped = [entry["index"] for entry in ellipsoid.get("dropped", [])]
    step = max(1, len(points) // LARGEST_SCATTER)
    axes.plot(points[::step, i], points[::step, j], ".", color=GREY, ms=3, rasterized=len(points) > 2000)
    axes.plot(points[contact, i], points[contact, j], "o", mfc="none", mec=BLUE, ms=7, label="holds the ellipsoid")
    if dropped:
        axes.plot(points[dropped, i], points[dropped, j], "x", color=VERMILION, ms=7, label="dropped")
    angles = np.linspace(0.0, 2.0 * np.pi, 400)
    circle = np.array([np.cos(angles), np.sin(angles)])
    curve = np.linalg.cholesky(matrix[np.ix_(pair, pair)]) @ circle
    centre = np.array(ellipsoid["centre"])
    axes.plot(centre[i] + curve[0], centre[j] + curve[1], color=BLUE, lw=1.2)
    axes.set_xlabel(readable(ellipsoid["names"][i]))
    axes.set_ylabel(readable(ellipsoid["names"][j]))


def draw(points_file, ellipsoid_file, target):
    ellipsoid = json.loads(ellipsoid_file.read_text(encoding="utf-8"))
    if ellipsoid.get("format") != "graybox-ellipsoid/1":
        sys.exit(f"{ellipsoid_file}: is no graybox-ellipsoid/1")
    dimension = ellipsoid["dimension"]
    if dimension < 2:
        sys.exit(f"{ellipsoid_file}: one coordinate has no pairs to draw")
    points = read_points(points_file, dimension)
    pairs = list(itertools.combinations(range(min(dimension, LARGEST_COORDINATES)), 2))
    columns = min(3, len(pairs))
    rows = -(-len(pairs) // columns)
    figure, panels = plt.subplots(rows, columns, figsize=(4.3 * columns, 3.9 * rows), squeeze=False)
    matrix = spread(ellipsoid)
    for pair, axes in zip(pairs, panels.flat):
        panel(axes, points, ellipsoid, matrix, list(pair))
    for axes in panels.flat[len(pairs):]:
        axes.axis("off")
    figure.legend(*panels.flat[0].get_legend_handles_labels(), fontsize=8, loc="upper left", ncols=2)
    figure.tight_layout(rect=(0, 0, 1, 0.94))
    options = {"metadata": {"Date": None}} if target.suffix == ".svg" else {"dpi": 150}
    figure.savefig(target, bbox_inches="tight", **options)
    print(f"wrote {target}")


if __name__ == "__main__":
    if len(sys.argv) != 4:
        sys.exit("usage: scripts/ellipsoid_plot POINTS ELLIPSOID.json FIGURE.svg")
    draw(*map(pathlib.Path, sys.argv[1:]))
