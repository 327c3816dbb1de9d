"""Robust designs: efficiency under other stiffness, and the concentration limit."""

import math

import numpy as np
from matplotlib.ticker import FuncFormatter, NullFormatter

from style import (ASSUMED, BLACK, BLUE, GREEN, GREY, ORANGE, PURPLE, VERMILION, growth, note, plt, read_table, save,
                   scientific, seconds_axis)

DESIGNS = {  # name in the table: label, colour, line style
    "worst_case": ("worst case over 100 samples", BLUE, "-"),
    "average": ("average over 100 samples", GREEN, "-"),
    "concentrated": ("nominal, at most 50 % in 1 % of the positions", PURPLE, "--"),
    "nominal": ("nominal", VERMILION, "-"),
    "best_single_position": ("nominal, best single position", GREY, ":"),
}

SOLVERS = {
    "concentration_interior_point": ("with the limit, low rank", BLUE, "o", "-"),
    "primal_interior_point_low_rank": ("without the limit, low rank", ORANGE, "D", "-"),
    "primal_interior_point": ("without the limit, dense", VERMILION, "s", "--"),
}


def percent(value, _=None):
    return f"{100 * value:g} %"


def efficiency(folder):
    rows = read_table(folder / "tables" / "robust_efficiency.csv")
    if not rows:
        return
    values = {name: np.sort([float(row[name]) for row in rows]) for name in DESIGNS if name in rows[0]}
    figure, axes = plt.subplots(figsize=(7.6, 4.4))
    for name, x in values.items():
        label, colour, line = DESIGNS[name]
        share = (np.arange(len(x)) + 0.5) / len(x)
        axes.plot(x, share, color=colour, ls=line, lw=2.0,
                  label=f"{label}: median {np.median(x):.3f}, smallest {x[0]:.3f}")
    axes.set_xlim(0, None)
    axes.set_ylim(0, 1)
    axes.yaxis.set_major_formatter(FuncFormatter(percent))
    axes.set_xlabel("D-efficiency, against the optimal design for the true stiffness")
    axes.set_ylabel(f"share of {len(rows)} random stiffness vectors\nwith at most this efficiency")
    axes.legend(fontsize=8, loc="upper left", bbox_to_anchor=(0, -0.15))
    note(figure, ASSUMED, y=-0.22, x=0.12)
    if "nominal" in values and "worst_case" in values:
        better = np.mean([float(row["worst_case"]) > float(row["nominal"]) for row in rows])
        axes.set_title(f"Designs over samples beat the nominal design for {100 * better:.0f} % of "
                       f"robots\nwhose stiffness is off by up to 50 %", pad=10)
    save(folder, figure, "robust_efficiency")


def student_quantile(freedom):
    """97.5 % quantile of Student's t (Cornish-Fisher expansion; error below 1 % from 3 degrees)."""
    z = 1.959964
    return (z + (z**3 + z) / (4 * freedom) + (5 * z**5 + 16 * z**3 + 3 * z) / (96 * freedom**2)
            + (3 * z**7 + 19 * z**5 + 17 * z**3 - 15 * z) / (384 * freedom**3))


def exponent(x, y):
    """Slope of log y on log x by least squares, and half of its 95 % interval."""
    x, y = np.log(x), np.log(y)
    slope, level = np.polyfit(x, y, 1)
    freedom = len(x) - 2
    if freedom < 1:
        return slope, math.nan
    residual = y - slope * x - level
    error = math.sqrt(np.sum(residual**2) / freedom / np.sum((x - x.mean())**2))
    return slope, student_quantile(freedom) * error


def scaling(folder):
    rows = read_table(folder / "tables" / "concentration_scaling.csv")
    if not rows:
        return
    figure, both = plt.subplots(1, 2, figsize=(10.4, 4.3))
    message = {}
    for axes, name in zip(both, ("seconds", "seconds an iteration")):
        axes.set_xscale("log")
        axes.set_yscale("log")
        for solver, (label, colour, marker, line) in SOLVERS.items():
            runs = [(int(row["candidates"]), float(row["seconds"]), int(row["iterations"]))
                    for row in rows if row["solver"] == solver]
            if not runs:
                continue
            x = np.array(sorted({run[0] for run in runs}), dtype=float)
            y = np.array([np.median([s if name == "seconds" else s / n for q, s, n in runs if q == size]) for size in x])
            fitted = x >= 500
            slope, half = exponent(x[fitted], y[fitted])
            message[solver, name] = slope, half
            axes.plot(x, y, color=colour, marker=marker, ls=line, ms=5,
                      label=f"{label}: $Q^{{{slope:.2f}}}$ ±{half:.2f}")
        axes.set_xlabel("candidates Q")
        seconds_axis(axes)
        sizes = sorted({int(row["candidates"]) for row in rows})
        axes.set_xticks(sizes)
        axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:.0f}"))
        axes.xaxis.set_minor_formatter(NullFormatter())
        axes.tick_params(axis="x", labelsize=8, rotation=50)
        axes.legend(fontsize=8, loc="lower right")
    gap = float(rows[0]["gap"])
    both[0].set_ylabel(f"time to a duality gap of {scientific(gap)}, one thread")
    both[1].set_ylabel("time for an iteration, one thread")
    parts = [growth(name, *message[solver, "seconds an iteration"])
             for solver, name in (("concentration_interior_point", "under the concentration limit"),
                                  ("primal_interior_point_low_rank", "without it"),
                                  ("primal_interior_point", "by dense Newton"))
             if (solver, "seconds an iteration") in message]
    known = [part for part in parts if part]
    figure.suptitle("An iteration grows " + ", ".join(known) if known else "Time against the candidates",
                    x=0.06, ha="left", fontsize=10.5)
    repeats = sorted({sum(1 for other in rows if (other["solver"], other["candidates"]) == (row["solver"], row["candidates"]))
                      for row in rows})
    note(figure, ASSUMED + " At most half of the experiments in 1 % of the positions.\n"
         f"Medians of {repeats[0]} to {repeats[-1]} runs. Exponents: least squares over Q ≥ 500 with 95 % intervals.", x=0.06, y=-0.03)
    figure.subplots_adjust(left=0.07, right=0.99, top=0.90, bottom=0.17, wspace=0.24)
    save(folder, figure, "concentration_scaling")


def cost(folder):
    rows = read_table(folder / "tables" / "concentration_cost.csv")
    if not rows:
        return
    figure, axes = plt.subplots(figsize=(6.8, 4.0))
    fractions = sorted({float(row["of_positions"]) for row in rows})
    for fraction, colour, marker in zip(fractions, (BLACK, BLUE, GREEN, VERMILION), "osD^"):
        chosen = sorted((float(row["largest_share"]), float(row["covariance"]), int(row["positions"]))
                        for row in rows if float(row["of_positions"]) == fraction)
        axes.plot([share for share, _, _ in chosen], [value for _, value, _ in chosen], color=colour,
                  marker=marker, ms=4, label=f"{100 * fraction:g} % of the positions ({chosen[0][2]})")
    axes.set_yscale("log")
    axes.set_yticks([1, 2, 5, 10])
    axes.set_ylim(0.93, 6)
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.xaxis.set_major_formatter(FuncFormatter(percent))
    axes.set_xlabel("largest share of the experiments in the limited positions")
    axes.set_ylabel("covariance $(\\det M)^{-1/d}$ over the optimum's")
    axes.legend(fontsize=8, title="limited positions", title_fontsize=8)
    note(figure, ASSUMED, y=-0.06, x=0.08)
    half = [row for row in rows if float(row["largest_share"]) == 0.5 and float(row["of_positions"]) == 0.01]
    if half:
        axes.set_title("With at most half of the experiments in 1 % of the positions\n"
                       f"the covariance is {100 * (float(half[0]['covariance']) - 1):.0f} % larger", pad=10)
    save(folder, figure, "concentration_cost")


def uncertainty(folder):
    rows = read_table(folder / "tables" / "uncertainty.csv")
    if not rows:
        return
    points = {name: [(float(row["uncertainty"]), float(row["percentile_5"]), float(row["median"]),
                      float(row["percentile_95"])) for row in rows if row["design"] == name]
              for name in ("worst_case", "nominal")}
    for name, known in points.items():  # the largest uncertainty has a table of its own
        values = [float(row[name]) for row in read_table(folder / "tables" / "robust_efficiency.csv")]
        if values:
            known.append((0.5, *np.percentile(values, (5, 50, 95))))
    figure, axes = plt.subplots(figsize=(6.8, 4.0))
    for name, marker, shift in (("worst_case", "o", -0.06), ("nominal", "s", 0.06)):
        known = sorted(points[name])
        _, colour, _ = DESIGNS[name]
        middle = np.array([row[2] for row in known])
        axes.errorbar(np.arange(len(known)) + shift, middle,
                      yerr=[middle - [row[1] for row in known], [row[3] for row in known] - middle],
                      fmt=marker, ms=5, lw=1.4, capsize=3, color=colour,
                      label={"worst_case": "worst case over samples", "nominal": "nominal"}[name])
    known = sorted(points["nominal"])
    axes.set_xticks(range(len(known)), [f"±{percent(row[0])}\n{1000 if row[0] == 0.5 else 40} robots" for row in known])
    axes.set_ylim(0, 1)
    axes.grid(axis="x", visible=False)
    axes.set_xlabel("stiffness known to within")
    axes.set_ylabel("D-efficiency, median and 5 to 95 %")
    note(figure, ASSUMED, y=-0.06, x=0.08)
    axes.set_title("The nominal design needs the stiffness to within a few per cent;\n"
                   "a design over samples varies far less from robot to robot", pad=10)
    axes.legend(fontsize=8)
    save(folder, figure, "robust_uncertainty")


def draw(folder):
    efficiency(folder)
    uncertainty(folder)
    scaling(folder)
    cost(folder)
