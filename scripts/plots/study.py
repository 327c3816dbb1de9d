"""Figures of the solver study, from its raw rows (rows.jsonl) and derived tables (tables/*.csv).

Every figure carries one message, its title; what a study did not measure is left out, and a figure
without data is not drawn.
"""

import csv
import json
import math
import pathlib
import sys

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import LogNorm
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from style import (BLACK, BLUE, GREEN, GREY, ORANGE, PURPLE, SKY, VERMILION, growth, save, scientific,
                   seconds_axis, spread_labels)

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent

HIGHLIGHTS = {
    "primal_interior_point": VERMILION,
    "dual_interior_point": BLUE,
    "column_generation": BLACK,
}

GROUPS = [
    ("interior point", {
        "primal_interior_point": (VERMILION, "s", "-"),
        "primal_interior_point_low_rank": (ORANGE, "D", "-"),
        "dual_interior_point": (BLUE, "o", "-"),
        "dual_interior_point_sparse": (SKY, "^", "-"),
        "dual_interior_point_unscaled": (PURPLE, "v", "--"),
    }),
    ("first order and exchange", {
        "multiplicative": (PURPLE, "v", "-"),
        "multiplicative_accelerated": (PURPLE, "P", "--"),
        "fedorov_wynn": (GREEN, "s", "-"),
        "vertex_exchange": (GREEN, "D", "--"),
        "randomized_exchange": (SKY, "^", "-"),
        "cocktail": (ORANGE, "X", "-"),
    }),
    ("general solvers", {
        "ipopt_primal": (VERMILION, "s", "--"),
        "ipopt_lifted": (ORANGE, "D", "--"),
        "ipopt_dual": (BLUE, "o", "--"),
        "nlopt_slsqp": (GREY, "v", "-"),
        "nlopt_mma": (GREY, "P", "--"),
        "nlopt_ccsa": (GREY, "X", "-."),
        "nlopt_lbfgs": (GREY, "^", ":"),
    }),
]
STYLES = {name: style for _, group in GROUPS for name, style in group.items()}
STYLES["column_generation"] = (BLACK, "*", "-")
BROUGHT_NAMES = set()


# Solvers that the reader brings, in the order in which they are first drawn.
BROUGHT = [(VERMILION, "p", ":"), (BLUE, "h", ":"), (GREEN, "<", ":"), (PURPLE, ">", ":"),
           (ORANGE, "d", ":"), (SKY, "8", ":")]


def style_of(solver):
    if solver not in STYLES:
        STYLES[solver] = BROUGHT[sum(name in BROUGHT_NAMES for name in STYLES) % len(BROUGHT)]
        BROUGHT_NAMES.add(solver)
    return STYLES[solver]


def readable(solver):
    return solver if solver in BROUGHT_NAMES else solver.replace("_", " ")


# ---- data -------------------------------------------------------------------------------------


def number(text):
    return float(text) if text != "" else math.inf


class Study:
    def __init__(self, folder):
        self.folder = pathlib.Path(folder)
        self.runs = []
        with open(self.folder / "rows.jsonl", encoding="utf-8") as lines:
            for line in lines:
                try:
                    row = json.loads(line)
                except json.JSONDecodeError:
                    continue  # torn by a kill
                if row.get("kind") == "run":
                    self.runs.append(row)
        self.points = self.table("points")
        self.laws = {row["solver"]: row for row in self.table("fitted_exponents")}

    def table(self, name):
        file = self.folder / "tables" / f"{name}.csv"
        if not file.exists():
            sys.exit(f"scripts/figures: {file} is missing; run graybox study --resume -o {self.folder}")
        with open(file, encoding="utf-8", newline="") as stream:
            return list(csv.DictReader(stream))

    def points_of(self, experiment):
        return [row for row in self.points if row["experiment"] == experiment]

    def solvers(self, experiment):
        names = {row["solver"] for row in self.points_of(experiment)}
        order = ["column_generation"] + [name for _, group in GROUPS for name in group]
        known = [name for name in order if name in names]
        return known + sorted(names - set(known))

    def curve(self, solver, column, solved=True, experiment="scaling"):
        """(Q, value) of one solver, Q ascending."""
        pairs = sorted((int(row["candidates"]), number(row[column]))
                       for row in self.points_of(experiment)
                       if row["solver"] == solver and (row["status"] == "solved") == solved)
        return [q for q, _ in pairs], [value for _, value in pairs]

    def sizes(self, experiment="scaling"):
        return sorted({int(row["candidates"]) for row in self.points_of(experiment)})

    def gap(self, experiment="scaling"):
        gaps = {number(row["gap_asked"]) for row in self.points_of(experiment)}
        return min(gaps) if gaps else math.nan


# ---- drawing ----------------------------------------------------------------------------------


def legend_below(axes, y):
    axes.legend(fontsize=7, loc="upper left", bbox_to_anchor=(-0.03, y), ncol=2, columnspacing=1.0,
                handlelength=2.4)


def candidate_axis(axes, sizes, label=True):
    axes.set_xscale("log")
    axes.xaxis.set_major_locator(FixedLocator(sizes))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:.0f}"))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.tick_params(axis="x", labelsize=8)
    if label:
        axes.set_xlabel("candidates Q")


def plot_curve(axes, x, y, solver, highlight=None, **extra):
    colour, marker, line = style_of(solver)
    heavy = solver in HIGHLIGHTS if highlight is None else highlight
    options = {"color": colour, "marker": marker, "linestyle": line,
               "lw": 2.4 if heavy else 1.1, "ms": (9 if marker == "*" else 5.5) if heavy else 4,
               "alpha": 1.0 if heavy else 0.75, "zorder": 5 if heavy else 3,
               "markeredgecolor": "white", "markeredgewidth": 0.4}
    options.update(extra)
    axes.plot(x, y, **options)


def exponent_text(study, solver):
    law = study.laws.get(solver)
    if law is None:
        return ""
    text = f"  $Q^{{{float(law['exponent']):.2f}}}$"
    if law["lower_95"]:
        text += f" ±{(float(law['upper_95']) - float(law['lower_95'])) / 2:.2f}"
    return text


def exponent_message(study):
    parts = []
    for solver, name in (("primal_interior_point", "the paper's primal form"),
                         ("dual_interior_point", "the dual form"),
                         ("column_generation", "column generation")):
        law = study.laws.get(solver)
        if law is None or not law["lower_95"]:
            continue
        lower, upper = float(law["lower_95"]), float(law["upper_95"])
        part = growth(name, float(law["exponent"]), (upper - lower) / 2)
        if part is None and lower <= 0 <= upper:
            part = f"of {name} no growth can be told"
        if part is not None:
            parts.append(part)
    if not parts:
        return "Time against Q"
    message = ", ".join(parts[:2]) + ("" if len(parts) < 3 else ",\n" + ", ".join(parts[2:]))
    return "Time grows with the candidates: " + message


def figure_3(study):
    sizes = study.sizes()
    if not sizes:
        return
    figure, axes = plt.subplots(figsize=(9.2, 6.6))
    axes.set_yscale("log")
    candidate_axis(axes, sizes)
    labels = []
    for solver in study.solvers("scaling"):
        x, y = study.curve(solver, "median_seconds")
        if not x:
            continue
        low = study.curve(solver, "lower_quartile_seconds")[1]
        high = study.curve(solver, "upper_quartile_seconds")[1]
        plot_curve(axes, x, y, solver)
        if solver in HIGHLIGHTS:
            axes.fill_between(x, low, high, color=style_of(solver)[0], alpha=0.12, lw=0)
        stopped = "" if x[-1] == sizes[-1] else f" (to {x[-1]})"
        weight = "bold" if solver in HIGHLIGHTS else "normal"
        labels.append(((x[-1], y[-1]), readable(solver) + stopped + exponent_text(study, solver),
                       style_of(solver)[0], weight))
    axes.set_xlim(sizes[0] * 0.9, sizes[-1] * 1.1)
    axes.set_ylabel(f"time to a duality gap of {scientific(study.gap())}, one thread")
    seconds_axis(axes)
    axes.set_title(exponent_message(study), pad=12)
    figure.canvas.draw()
    spread_labels(axes, labels, 1.06)
    axes.text(0, -0.12, "Medians (bands: quartiles, of the three heavy curves); robot set, nested subsets. Exponents: least squares over "
              "Q ≥ 500 with 95 % confidence.\nOnly answers whose gap the checker confirmed.",
              transform=axes.transAxes, fontsize=7.5, color="#555555", va="top")
    save(study.folder, figure, "figure_3")


def figure_3_peers(study):
    """Ours beside figures measured in another run with other programs (docs/explanation/peers.md)."""
    file = ROOT / "results" / "peers.csv"
    sizes = study.sizes()
    if not file.exists() or not sizes:
        return
    with open(file, encoding="utf-8", newline="") as stream:
        rows = [row for row in csv.DictReader(stream) if row["family"] == "rob"]
    sizes = sorted(set(sizes) | {int(row["candidates"]) for row in rows})
    figure, axes = plt.subplots(figsize=(9.2, 6.0))
    axes.set_yscale("log")
    candidate_axis(axes, sizes)
    labels = []
    for name in dict.fromkeys((row["program"], row["form"]) for row in rows):
        chosen = [row for row in rows if (row["program"], row["form"]) == name and row["seconds"]]
        x = [int(row["candidates"]) for row in chosen]
        y = [float(row["seconds"]) for row in chosen]
        axes.plot(x, y, color="#999999", lw=0.9, marker=".", ms=4)
        labels.append(((x[-1], y[-1]), f"{name[0]}, {name[1]}", "#777777", "normal"))
    for solver in HIGHLIGHTS:
        x, y = study.curve(solver, "median_seconds")
        if x:
            plot_curve(axes, x, y, solver)
            labels.append(((x[-1], y[-1]), readable(solver), style_of(solver)[0], "bold"))
    axes.set_xlim(sizes[0] * 0.9, sizes[-1] * 1.1)
    axes.set_ylabel("graybox: wall time; others: CPU time; one thread")
    seconds_axis(axes)
    axes.set_title("graybox beside other programs, on other problems and to other gaps:\norders of magnitude only", pad=12)
    figure.canvas.draw()
    spread_labels(axes, labels, 1.06)
    axes.text(0, -0.12, f"Coloured: this run, robot set, checked gap {scientific(study.gap())}. Grey: other run, "
              "other set of the same size (log-normal Wishart), CPU seconds,\ngaps of 1e-4 to 1e-11; see "
              "docs/explanation/peers.md. Ratios below 1.3 mean nothing.",
              transform=axes.transAxes, fontsize=7.5, color="#555555", va="top")
    save(study.folder, figure, "figure_3_peers")


def group_panels(study, experiment):
    """Groups of solvers that have points, without column_generation (drawn in every panel)."""
    present = set(study.solvers(experiment))
    panels = [(title, [name for name in group if name in present]) for title, group in GROUPS]
    known = {name for _, names in panels for name in names} | {"column_generation"}
    others = sorted(present - known)
    if others:
        panels.append(("others", others))
    return [(title, names) for title, names in panels if names]


def gap_against_candidates(study):
    sizes, panels = study.sizes(), group_panels(study, "scaling")
    if not sizes or not panels:
        return
    figure, all_axes = plt.subplots(1, len(panels), figsize=(4.1 * len(panels), 4.9), sharey=True,
                                    squeeze=False)
    floor = 1e-16
    for axes, (title, names) in zip(all_axes[0], panels):
        axes.set_yscale("log")
        candidate_axis(axes, sizes)
        axes.tick_params(axis="x", rotation=60)
        axes.axhline(study.gap(), color="#444444", lw=0.9, ls=(0, (4, 3)))
        for solver in names + ["column_generation"]:
            x, y = study.curve(solver, "checked_gap")
            plot_curve(axes, x, [max(value, floor) for value in y], solver, label=readable(solver))
            x, y = study.curve(solver, "checked_gap", solved=False)
            finite = [(q, value) for q, value in zip(x, y) if math.isfinite(value)]
            if finite:
                axes.plot(*zip(*finite), ls="", marker=style_of(solver)[1], mfc="white",
                          mec=style_of(solver)[0], ms=6, zorder=6)
        axes.set_title(title)
        legend_below(axes, -0.30)
    all_axes[0][0].set_ylabel("duality gap found by the checker")
    all_axes[0][0].annotate("asked", (sizes[0], study.gap()), textcoords="offset points", xytext=(0, 3),
                            fontsize=7, color="#444444")
    figure.suptitle("What was asked is what the checker finds; hollow marks are runs that fell short",
                    x=0.06, ha="left", fontsize=10.5)
    figure.subplots_adjust(left=0.06, right=0.99, bottom=0.26, top=0.86, wspace=0.10)
    save(study.folder, figure, "gap_against_candidates")


def trace_of(study, family, solver):
    for row in study.runs:
        if (row["experiment"] == "families" and row["family"] == family and row["solver"] == solver
                and row["repetition"] == 0):
            points = [(p[0], p[1], p[2]) for p in row["trace"] if p[2] is not None and p[2] > 0]
            return points, row
    return [], None


def gap_against_time(study):
    panels = group_panels(study, "families")
    present = {row["family"] for row in study.points_of("families")}
    families = [name for name in ("robot", "wis", "smo") if name in present]
    if not panels or not families:
        return
    figure, all_axes = plt.subplots(len(families), len(panels), squeeze=False, sharex=True, sharey=True,
                                    figsize=(4.1 * len(panels), 2.7 * len(families) + 0.7))
    for i, family in enumerate(families):
        for j, (title, names) in enumerate(panels):
            axes = all_axes[i][j]
            axes.set_xscale("log")
            axes.set_yscale("log")
            for solver in names + ["column_generation"]:
                points, row = trace_of(study, family, solver)
                if not points:
                    continue
                time = [max(p[0], 1e-6) for p in points]
                best = np.minimum.accumulate([p[2] for p in points])
                colour, marker, line = style_of(solver)
                axes.plot(time, np.maximum(best, 1e-12), color=colour, ls=line,
                          lw=2.2 if solver in HIGHLIGHTS else 1.1, label=readable(solver))
                axes.plot(time[-1], max(best[-1], 1e-12), marker=marker, color=colour, ms=6,
                          mfc=colour if row["status"] == "solved" else "white")
            seconds_axis(axes, "x")
            axes.tick_params(axis="x", rotation=35, labelsize=8)
            axes.set_ylim(3e-13, 1e3)
            if i == 0:
                axes.set_title(title)
            if j == 0:
                axes.set_ylabel(f"{family}: duality gap")
            if i + 1 == len(families):
                axes.set_xlabel("time, one thread")
                legend_below(axes, -0.42)
    full = next(int(row["candidates"]) for row in study.points_of("families")
                if row["family"] == families[0])
    figure.suptitle(f"Gap against time at Q = {full}, best so far; the mark is where a run ended, "
                    "hollow if short of $10^{-9}$", x=0.06, ha="left", fontsize=10.5)
    figure.subplots_adjust(left=0.06, right=0.99, wspace=0.10, hspace=0.14)
    save(study.folder, figure, "gap_against_time")


def memory_against_candidates(study):
    sizes = study.sizes()
    if not sizes:
        return
    figure, axes = plt.subplots(figsize=(8.8, 5.8))
    axes.set_yscale("log")
    candidate_axis(axes, sizes)
    floor = 0.1
    labels = []
    for solver in study.solvers("scaling"):
        x, y = study.curve(solver, "added_memory_bytes")
        y = [value / 1e6 for value in y]
        if not x:
            continue
        plot_curve(axes, x, [max(value, floor) for value in y], solver)
        weight = "bold" if solver in HIGHLIGHTS else "normal"
        amount = f"{y[-1]:.0f} MB" if y[-1] >= 10 else f"{y[-1]:.1f} MB"
        where = "" if x[-1] == sizes[-1] else f" at Q = {x[-1]}"
        labels.append(((x[-1], max(y[-1], floor)), f"{readable(solver)}  {amount}{where}",
                       style_of(solver)[0], weight))
    entries = 78  # packed 12 x 12
    axes.plot(sizes, [max(8e-6 * entries * q, floor) for q in sizes], color="#444444", lw=0.9,
              ls=(0, (4, 3)))
    labels.append(((sizes[-1], 8e-6 * entries * sizes[-1]), "size of the set itself", "#444444", "normal"))
    axes.set_xlim(sizes[0] * 0.9, sizes[-1] * 1.1)
    axes.set_ylabel("memory the solve adds, MB")
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    heaviest = max(labels, key=lambda label: label[0][1])
    axes.set_title(f"Memory against candidates: most is needed by {heaviest[1].split('  ')[0]}", pad=12)
    figure.canvas.draw()
    spread_labels(axes, labels, 1.06, minimum=0.036)
    axes.text(0, -0.13, "Peak resident memory of the process less what program, libraries and set took before "
              "the solve; one process a run. 0.1 MB is the least shown.",
              transform=axes.transAxes, fontsize=7.5, color="#555555", va="top")
    save(study.folder, figure, "memory_against_candidates")


def passes_per_family(study):
    rows = [row for row in study.table("time_to_gap") if row["experiment"] == "families"]
    families = list(dict.fromkeys(row["family"] for row in study.points_of("families")))
    solvers = study.solvers("families")
    if not rows:
        return
    run = {(row["solver"], row["family"]) for row in study.points_of("families")}
    solvers = [name for name in solvers if any((name, family) in run for family in families)]
    levels = [("1e-3", "$10^{-3}$"), ("1e-6", "$10^{-6}$"), ("1e-9", "$10^{-9}$")]
    value = {(row["solver"], row["family"], row["gap"]): float(row["passes"]) for row in rows}
    figure, all_axes = plt.subplots(1, 3, sharey=True, layout="constrained",
                                    figsize=(0.40 * 3 * len(families) + 2.8, 0.27 * len(solvers) + 1.5))
    norm = LogNorm(1, 1e5)
    image = None
    for axes, (level, text) in zip(all_axes, levels):
        grid = np.full((len(solvers), len(families)), np.nan)
        for i, solver in enumerate(solvers):
            for j, family in enumerate(families):
                passes = value.get((solver, family, level))
                tried = (solver, family) in run
                if passes is not None:
                    grid[i, j] = max(passes, 0.1)
                label = short_number(passes) if passes is not None else ("–" if tried else "")
                dark = passes is not None and passes > 300
                axes.text(j, i, label, ha="center", va="center", fontsize=6.5,
                          color="white" if dark else "#222222")
        image = axes.imshow(grid, norm=norm, cmap="cividis_r", aspect="auto")
        axes.grid(False)
        axes.set_xticks(range(len(families)), families, rotation=50, ha="right", fontsize=8)
        axes.set_yticks(range(len(solvers)), [readable(name) for name in solvers], fontsize=8)
        axes.tick_params(length=0)
        axes.set_title(f"to a gap of {text}")
        for side in axes.spines.values():
            side.set_visible(False)
    bar = figure.colorbar(image, ax=all_axes, pad=0.01, fraction=0.02)
    bar.ax.tick_params(labelsize=7)
    largest = max(int(row["candidates"]) for row in study.points_of("families"))
    figure.suptitle(f"Passes over the set that each method needs, Q up to {largest} "
                    "(– not reached in the time given; empty: not run)", x=0.01, ha="left", fontsize=10.5)
    save(study.folder, figure, "passes_per_family")


def short_number(value):
    if value < 99.5:
        return f"{value:.2g}" if value < 10 else f"{value:.0f}"
    if value < 1e4:
        return f"{value:.0f}"
    return f"{value / 1000:.0f}k"


def profile_table(study):
    rows = study.table("profile_instances")
    instances = list(dict.fromkeys(row["instance"] for row in rows))
    order = ["column_generation"] + [name for name in STYLES if name != "column_generation"]
    solvers = [name for name in order if any(row["solver"] == name for row in rows)]
    solvers += sorted({row["solver"] for row in rows} - set(solvers))
    times = {(row["solver"], row["instance"]): number(row["seconds"]) for row in rows}
    return instances, solvers, times


def performance_profile(study):
    rows = study.table("performance_profile")
    instances, solvers, _ = profile_table(study)
    if not rows:
        return
    figure, axes = plt.subplots(figsize=(8.8, 5.6))
    axes.set_xscale("log")
    largest = max(float(row["tau"]) for row in rows) * 1.5
    labels = []
    for solver in solvers:
        steps = [(float(row["tau"]), float(row["share"])) for row in rows if row["solver"] == solver]
        if not steps:
            continue
        colour, _, line = style_of(solver)
        x = [1.0] + [tau for tau, _ in steps] + [largest]
        y = [0.0] + [share for _, share in steps] + [steps[-1][1]]
        heavy = solver in HIGHLIGHTS
        axes.step(x, y, where="post", color=colour, ls=line, lw=2.4 if heavy else 1.2,
                  alpha=1 if heavy else 0.8, zorder=5 if heavy else 3)
        area = sum((math.log(b) - math.log(a)) * share for a, b, share in zip(x, x[1:], y[1:]))
        labels.append((area, ((largest, y[-1]), f"{readable(solver)}  {100 * y[-1]:.0f} %", colour,
                              "bold" if heavy else "normal")))
    axes.set_xlim(1, largest)
    axes.set_ylim(0, 1.02)
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{100 * value:.0f} %"))
    axes.set_xlabel("factor by which the method may be slower than the fastest on the instance")
    axes.set_ylabel("share of instances solved to $10^{-6}$")
    fastest = max(solvers, key=lambda name: max(
        [float(row["share"]) for row in rows if row["solver"] == name and float(row["tau"]) == 1.0],
        default=0))
    axes.set_title(f"Performance profiles over {len(instances)} instances: {readable(fastest)} "
                   "is fastest most often", pad=12)
    nested = sum(1 for instance in instances if str(instance).startswith("robot/"))
    if nested > 1:
        axes.text(0, -0.13, f"Not independent: {nested} of the instances are nested subsets of one robot's positions.",
                  transform=axes.transAxes, fontsize=7.5, color="#555555", va="top")
    figure.canvas.draw()
    labels.sort(key=lambda label: label[0])  # the better profile stands above where shares tie
    spread_labels(axes, [label for _, label in labels], 1.05, minimum=0.043)
    save(study.folder, figure, "performance_profile")


def pairwise_profile(study):
    """Profiles depend on who takes part; who beats whom does not."""
    instances, solvers, times = profile_table(study)
    if len(solvers) < 2:
        return
    size = len(solvers)
    grid = np.full((size, size), np.nan)
    for i, one in enumerate(solvers):
        for j, other in enumerate(solvers):
            pairs = [(times.get((one, name), math.inf), times.get((other, name), math.inf))
                     for name in instances]
            decided = [(a, b) for a, b in pairs if math.isfinite(min(a, b))]
            if i != j and decided:
                grid[i, j] = sum(a < b for a, b in decided) / len(decided)
    figure, axes = plt.subplots(figsize=(0.42 * size + 3.6, 0.36 * size + 2.4), layout="constrained")
    image = axes.imshow(grid, vmin=0, vmax=1, cmap="cividis_r", aspect="auto")
    for i in range(size):
        for j in range(size):
            if not math.isnan(grid[i, j]):
                axes.text(j, i, f"{100 * grid[i, j]:.0f}", ha="center", va="center", fontsize=7,
                          color="white" if grid[i, j] > 0.6 else "#222222")
    axes.grid(False)
    names = [readable(name) for name in solvers]
    axes.set_xticks(range(size), names, rotation=55, ha="right", fontsize=8)
    axes.set_yticks(range(size), names, fontsize=8)
    axes.tick_params(length=0)
    for side in axes.spines.values():
        side.set_visible(False)
    bar = figure.colorbar(image, ax=axes, fraction=0.04, pad=0.02)
    bar.ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{100 * value:.0f} %"))
    axes.set_title(f"Row beats column on this share (%) of {len(instances)} instances, gap $10^{{-6}}$")
    save(study.folder, figure, "pairwise_profile")


def short_seconds(value):
    for factor, unit in ((1e6, "µs"), (1e3, "ms")):
        if value * factor < 999.5:
            return f"{value * factor:.3g} {unit}"
    return f"{value:.3g} s"


def own_sets(study):
    """Every solver on every set that the reader brought: times, or why there is none."""
    points = {(row["solver"], row["family"]): row for row in study.points_of("own")}
    sets = list(dict.fromkeys(family for _, family in points))
    if not sets:
        return

    def score(solver):
        rows = [row for (name, _), row in points.items() if name == solver]
        return (-sum(row["status"] == "solved" for row in rows),
                sum(float(row["charged_seconds"]) for row in rows))

    solvers = sorted({solver for solver, _ in points}, key=score)
    grid = np.full((len(solvers), len(sets)), np.nan)
    figure, axes = plt.subplots(figsize=(1.25 * len(sets) + 3.4, 0.36 * len(solvers) + 2.0),
                                layout="constrained")
    known = [float(row["median_seconds"]) for row in points.values() if row["status"] == "solved"]
    norm = LogNorm(min(known, default=1e-6), max(max(known, default=1.0), 2 * min(known, default=1e-6)))
    for i, solver in enumerate(solvers):
        for j, family in enumerate(sets):
            row = points.get((solver, family))
            if row is None:
                continue
            seconds = float(row["median_seconds"])
            solved = row["status"] == "solved"
            if solved:
                grid[i, j] = seconds
            text = short_seconds(seconds) if solved else row["status"].replace("_", " ")
            if solved and row.get("stated_seconds"):
                text += f"\n({short_seconds(float(row['stated_seconds']))})"
            axes.text(j, i, text, ha="center", va="center", fontsize=6.5,
                      color="white" if solved and norm(seconds) > 0.6 else "#222222")
    axes.imshow(grid, norm=norm, cmap="cividis_r", aspect="auto")
    axes.grid(False)
    axes.set_xticks(range(len(sets)), [pathlib.Path(name).name for name in sets], rotation=40, ha="right",
                    fontsize=8)
    axes.set_yticks(range(len(solvers)), [readable(name) for name in solvers], fontsize=8)
    axes.tick_params(length=0)
    for side in axes.spines.values():
        side.set_visible(False)
    axes.set_title(f"{readable(solvers[0])} solves most sets in the least time, to a checked gap of "
                   f"{scientific(study.gap('own'))}\n(in brackets: by the program's own clock)", fontsize=9)
    save(study.folder, figure, "own_sets")


def normalisation(study):
    points = study.points_of("normalisation")
    families = list(dict.fromkeys(row["family"] for row in points))
    if not families:
        return
    sizes = study.sizes("normalisation")
    figure, all_axes = plt.subplots(1, len(families), sharey=True, squeeze=False,
                                    figsize=(4.6 * len(families), 3.9))
    titles = {"robot": "robot", "robot_units": "the same, parameters in units twelve decades apart"}
    for axes, family in zip(all_axes[0], families):
        axes.set_yscale("log")
        candidate_axis(axes, sizes)
        axes.tick_params(axis="x", rotation=60)
        axes.axhline(study.gap("normalisation"), color="#444444", lw=0.9, ls=(0, (4, 3)))
        for solver in study.solvers("normalisation"):
            rows = sorted((int(row["candidates"]), number(row["checked_gap"]), row["status"])
                          for row in points if row["solver"] == solver and row["family"] == family)
            text = "dual as written" if solver.endswith("unscaled") else "whitened, rows scaled"
            ceiling = 1e3  # stands for a gap that is infinite: no design, or a singular one
            x = [row[0] for row in rows]
            y = [min(max(row[1], 1e-16), ceiling) for row in rows]
            plot_curve(axes, x, y, solver, highlight=True, label=text)
            short = [(q, gap) for q, gap, row in zip(x, y, rows) if row[2] != "solved"]
            if short:
                axes.plot(*zip(*short), ls="", marker=style_of(solver)[1], mfc="white",
                          mec=style_of(solver)[0], ms=7, zorder=6)
        axes.set_title(titles.get(family, family), fontsize=9)
    all_axes[0][0].set_ylabel("duality gap found by the checker")
    all_axes[0][0].annotate("asked", (sizes[0], study.gap("normalisation")), xytext=(0, 3),
                            textcoords="offset points", fontsize=7, color="#444444")
    all_axes[0][-1].legend(fontsize=8, loc="center left", bbox_to_anchor=(1.0, 0.5))
    figure.suptitle("Scaling decides only where units differ: as written, the dual interior point then falls short (hollow)",
                    x=0.06, ha="left", fontsize=10.5)
    figure.subplots_adjust(left=0.06, right=0.99, top=0.84, wspace=0.08)
    save(study.folder, figure, "normalisation")


if __name__ == "__main__":
    main()


def draw(folder):
    if not (folder / "rows.jsonl").exists():
        return
    study = Study(folder)
    for figure in (figure_3, figure_3_peers, gap_against_candidates, gap_against_time,
                   memory_against_candidates, passes_per_family, performance_profile,
                   pairwise_profile, own_sets, normalisation):
        figure(study)
