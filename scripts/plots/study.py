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
        self.environment = {}
        with open(self.folder / "rows.jsonl", encoding="utf-8") as lines:
            for line in lines:
                try:
                    row = json.loads(line)
                except json.JSONDecodeError:
                    continue  # torn by a kill
                if row.get("kind") == "run":
                    self.runs.append(row)
                elif row.get("kind") == "environment":
                    self.environment = row
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


def legend_below(axes, y, columns=2):
    axes.legend(fontsize=7, loc="upper left", bbox_to_anchor=(-0.03, y), ncol=columns, columnspacing=1.0,
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


# The curves of the overview: the paper's two forms, the slowest, an exchange method of 1972, and the default.
CHOSEN = ("column_generation", "fedorov_wynn", "dual_interior_point", "primal_interior_point", "ipopt_primal")


def processor(study):
    return f"one thread of {study.environment['processor']}" if "processor" in study.environment else "one thread"


def medians(study, experiment):
    """'medians of 1 to 9 runs', as many as there were."""
    counts = sorted({int(row["repetitions"]) for row in study.points_of(experiment)})
    if not counts:
        return "medians"
    return f"medians of {counts[0]} to {counts[-1]} runs" if counts[0] < counts[-1] else f"medians of {counts[0]} runs"


def passes_note(study):
    """Why the curve of column generation falls: it reads the set less often once it draws samples of it."""
    x, y = study.curve("column_generation", "passes")
    falls = [(y[i + 1] / y[i], i) for i in range(len(x) - 1)]
    if not falls or min(falls)[0] > 0.6:
        return ""
    i = min(falls)[1]
    return (f"\nColumn generation starts on a sample where the set is large: {y[i]:.1f} passes over it at Q = {x[i]}, "
            f"{y[i + 1]:.1f} at Q = {x[i + 1]}.")


def draw_times(axes, study, solver, **extra):
    """The curve of a solver; where it ends, or None if it solved nothing."""
    x, y = study.curve(solver, "median_seconds")
    if not x:
        return None
    plot_curve(axes, x, y, solver, **extra)
    if solver in HIGHLIGHTS:
        axes.fill_between(x, study.curve(solver, "lower_quartile_seconds")[1],
                          study.curve(solver, "upper_quartile_seconds")[1], color=style_of(solver)[0], alpha=0.12, lw=0)
    return x[-1], y[-1]


def figure_3(study):
    sizes = study.sizes()
    if not sizes:
        return
    present = study.solvers("scaling")
    chosen = [name for name in CHOSEN if name in present]
    others = [name for name in present if name not in CHOSEN]
    chosen += others[:3] if len(chosen) < 2 else [name for name in others if name not in STYLES][:3]  # brought
    figure, axes = plt.subplots(figsize=(8.6, 5.4))
    axes.set_yscale("log")
    candidate_axis(axes, sizes)
    labels = []
    for solver in chosen:
        end = draw_times(axes, study, solver)
        if end is None:
            continue
        stopped = "" if end[0] == sizes[-1] else f" (to {end[0]})"
        weight = "bold" if solver in HIGHLIGHTS else "normal"
        labels.append((end, readable(solver) + stopped + exponent_text(study, solver), style_of(solver)[0], weight))
    axes.set_xlim(sizes[0] * 0.9, sizes[-1] * 1.1)
    axes.set_ylabel(f"time to a duality gap of {scientific(study.gap())}")
    seconds_axis(axes)
    axes.set_title(exponent_message(study), pad=12)
    figure.canvas.draw()
    spread_labels(axes, labels, 1.06, minimum=0.045)
    axes.text(0, -0.14, f"Robot set, nested subsets; {medians(study, 'scaling')}, bands: quartiles; {processor(study)}; gaps as the "
              "checker finds them.\nExponents: least squares over Q ≥ 500 with 95 % confidence. "
              f"{len(chosen)} of {len(present)} solvers." + passes_note(study),
              transform=axes.transAxes, fontsize=7.5, color="#555555", va="top")
    save(study.folder, figure, "figure_3")


def figure_3_all(study):
    """All solvers, in panels of at most eight curves."""
    sizes, panels = study.sizes(), group_panels(study, "scaling")
    if not sizes or len(study.solvers("scaling")) <= len(CHOSEN):
        return
    figure, all_axes = plt.subplots(1, len(panels), figsize=(4.1 * len(panels), 4.9), sharey=True, squeeze=False)
    for axes, (title, names) in zip(all_axes[0], panels):
        axes.set_yscale("log")
        candidate_axis(axes, sizes)
        axes.tick_params(axis="x", rotation=60)
        for solver in names[:7] + ["column_generation"]:
            draw_times(axes, study, solver, label=readable(solver) + exponent_text(study, solver))
        seconds_axis(axes)
        axes.set_title(title)
        legend_below(axes, -0.26, columns=1)
    all_axes[0][0].set_ylabel(f"time to a duality gap of {scientific(study.gap())}")
    figure.suptitle(all_message(study), x=0.06, ha="left", fontsize=10.5)
    figure.text(0.06, -0.25, f"Robot set, nested subsets; {medians(study, 'scaling')}, bands: quartiles; {processor(study)}. "
                "Exponents: least squares over Q ≥ 500 with 95 % confidence." + passes_note(study),
                fontsize=7.5, color="#555555", va="top")
    figure.subplots_adjust(left=0.06, right=0.99, bottom=0.26, top=0.86, wspace=0.10)
    save(study.folder, figure, "figure_3_all")


def all_message(study):
    """How far the solvers are apart on the largest set."""
    sizes = study.sizes()
    ends = {}
    for solver in study.solvers("scaling"):
        x, y = study.curve(solver, "median_seconds")
        if x and x[-1] == sizes[-1]:
            ends[solver] = y[-1]
    if len(ends) < 2:
        return "Time against the candidates"
    fast, slow = min(ends, key=ends.get), max(ends, key=ends.get)
    return (f"At Q = {sizes[-1]}: {readable(fast)} takes {short_seconds(ends[fast])}, "
            f"{readable(slow)} {short_seconds(ends[slow])}, to the same gap")


def group_panels(study, experiment):
    """Groups of solvers that have points, without column_generation (drawn in every panel)."""
    present = set(study.solvers(experiment))
    panels = [(title, [name for name in group if name in present]) for title, group in GROUPS]
    known = {name for _, names in panels for name in names} | {"column_generation"}
    others = sorted(present - known)
    if others:
        panels.append(("others", others))
    return [(title, names) for title, names in panels if names]


def trace_of(study, family, solver):
    for row in study.runs:
        if (row["experiment"] == "families" and row["family"] == family and row["solver"] == solver
                and row["repetition"] == 0):
            points = [(p[0], p[1], p[2]) for p in row["trace"] if p[2] is not None and p[2] > 0]
            return points, row
    return [], None


def steps_message(study, families):
    counts = [len(trace_of(study, family, "column_generation")[0]) for family in families]
    if not all(counts):
        return ""
    return f"Column generation is done after at most {max(counts)} designs: "


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
                          lw=2.2 if solver in HIGHLIGHTS else 1.1)
                axes.plot([], [], color=colour, ls=line, marker=marker, ms=5, label=readable(solver))
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
    figure.suptitle(f"{steps_message(study, families)}gap against time, Q = {full}",
                    x=0.06, ha="left", fontsize=10.5, y=0.95)
    figure.text(0.06, -0.075, "The best gap so far. A mark: where the run ended, hollow if short of $10^{-9}$. Rows: the robot, "
                f"Wishart matrices (wis), a smooth curve (smo). One run each, {processor(study)}.",
                fontsize=7.5, color="#555555", va="top")
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
    ends = {}
    present = study.solvers("scaling")
    chosen = [name for name in present if name in CHOSEN + ("dual_interior_point_sparse", "nlopt_lbfgs")]
    chosen = chosen or present[:7]
    for solver in chosen:
        x, y = study.curve(solver, "added_memory_bytes")
        y = [value / 1e6 for value in y]
        if not x:
            continue
        plot_curve(axes, x, [max(value, floor) for value in y], solver)
        ends[solver] = y[-1]
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
    axes.set_ylabel("memory that the solve adds (MB)")
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    heavy = max(ends, key=ends.get, default="")
    light = "column_generation" if "column_generation" in ends else min(ends, key=ends.get, default="")
    axes.set_title(f"{readable(heavy)} adds {ends[heavy]:.0f} MB to the set, {readable(light)} {ends[light]:.1f} MB"
                   if len(ends) > 1 else "Memory against candidates", pad=12)
    figure.canvas.draw()
    spread_labels(axes, labels, 1.06, minimum=0.036)
    axes.text(0, -0.13, "Peak resident memory of the process less what program, libraries and set took before "
              "the solve; one process a run. 0.1 MB is the least shown. "
              f"\n{len(chosen)} of {len(present)} solvers; {medians(study, 'scaling')}.",
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
                dark = passes is not None and norm(passes) > 0.45
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
    bar.set_label("passes over the set", fontsize=8)
    largest = max(int(row["candidates"]) for row in study.points_of("families"))
    figure.suptitle("Column generation reads the set fewer than five times, whatever the family and the gap"
                    if is_least(value, solvers, families) else "Passes over the set that each method needs",
                    x=0.01, ha="left", fontsize=10.5)
    figure.text(0.01, -0.02, f"Passes over the set, Q up to {largest}. –: not reached in the time given; empty: not run. Families: robot; "
                "rob, log-normal Wishart; wis, Wishart; flat, nearly equal; smo and smr6, smooth curves (full rank, rank 6);\n"
                "r1g, rank one, Gaussian; cube3, a quadratic on a grid, many ties; dup, with copies.",
                fontsize=7.5, color="#555555", va="top")
    save(study.folder, figure, "passes_per_family")


def is_least(value, solvers, families):
    """Does column generation need the fewest passes in every cell, and less than five?"""
    shown = {key: passes for key, passes in value.items()
             if key[0] in solvers and key[1] in families and key[2] in ("1e-3", "1e-6", "1e-9")}
    first = {key[1:]: passes for key, passes in shown.items() if key[0] == "column_generation"}
    return bool(first) and max(first.values()) < 5 and all(
        passes >= first.get(key[1:], 0) for key, passes in shown.items())


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


def profile_area(rows, solver, largest):
    """Steps (tau, share) of a profile and the area below it over log tau: more is better."""
    steps = [(float(row["tau"]), float(row["share"])) for row in rows if row["solver"] == solver]
    if not steps:
        return None
    x = [1.0] + [tau for tau, _ in steps] + [largest]
    y = [0.0] + [share for _, share in steps] + [steps[-1][1]]
    return sum((math.log(b) - math.log(a)) * share for a, b, share in zip(x, x[1:], y[1:])), x, y


def performance_profile(study):
    rows = study.table("performance_profile")
    instances, solvers, _ = profile_table(study)
    if not rows:
        return
    largest = max(float(row["tau"]) for row in rows) * 1.5
    profiles = {solver: profile_area(rows, solver, largest) for solver in solvers}
    ranked = sorted((name for name in solvers if profiles[name]), key=lambda name: -profiles[name][0])
    papers = [name for name in ranked if name in HIGHLIGHTS]
    chosen = sorted(papers + [name for name in ranked if name not in papers][:8 - len(papers)], key=ranked.index)
    figure, axes = plt.subplots(figsize=(7.6, 4.6))
    axes.set_xscale("log")
    for solver in chosen:
        colour, _, line = style_of(solver)
        heavy = solver in HIGHLIGHTS
        _, x, y = profiles[solver]
        axes.step(x, y, where="post", color=colour, ls=line, lw=2.4 if heavy else 1.4, zorder=5 if heavy else 3,
                  label=readable(solver))
    axes.set_xlim(1, largest)
    axes.set_ylim(0, 1.02)
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{100 * value:.0f} %"))
    axes.set_xlabel("factor by which the method may be slower than the fastest on the instance")
    axes.set_ylabel("share of instances solved to $10^{-6}$")
    axes.legend(fontsize=8, loc="center left", bbox_to_anchor=(1.0, 0.5), title="best first", title_fontsize=8)
    share = {row["solver"]: float(row["share"]) for row in rows if float(row["tau"]) == 1.0}
    fastest = max(share, key=share.get) if share else ranked[0]
    axes.set_title(f"{readable(fastest)} is fastest on {100 * share.get(fastest, 0):.0f} % of {len(instances)} instances", pad=12)
    nested = sum(1 for instance in instances if str(instance).startswith("robot/"))
    text = f"{len(chosen)} of {len(ranked)} solvers: the paper's forms, and the best of the others; {processor(study)}."
    if nested > 1:
        text += f"\nNot independent: {nested} of the instances are nested subsets of one robot's positions."
    axes.text(0, -0.16, text, transform=axes.transAxes, fontsize=7.5, color="#555555", va="top")
    save(study.folder, figure, "performance_profile")


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


def draw(folder):
    if not (folder / "rows.jsonl").exists():
        return
    study = Study(folder)
    for figure in (figure_3, figure_3_all, gap_against_time, memory_against_candidates, passes_per_family,
                   performance_profile, own_sets):
        figure(study)
