"""The paper's Table I and Figures 2, 4 and 5, from tables/table_1.csv, figure_2.csv, figure_4.csv,
figure_5.csv and exact_designs.csv (graybox paper, graybox exact)."""

import math
import pathlib

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.ticker import FixedLocator, FuncFormatter, NullFormatter

from style import ASSUMED, BLACK, BLUE, GREY, SKY, VERMILION, note, read_table, save

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
JOINTS = [f"q{joint}_deg" for joint in range(1, 6)]


def table_1(folder):
    """tables/table_1.md: ours beside the paper's, and the features that can be compared."""
    ours = read_table(folder / "tables" / "table_1.csv")
    theirs = read_table(ROOT / "results" / "paper_table_1.csv")
    curve = read_table(folder / "tables" / "figure_4.csv")
    if not ours:
        return
    lines = ["| | q1 | q2 | q3 | q4 | q5 | cov | λ | | paper: q1 | q2 | q3 | q4 | q5 | cov | λ |",
             "|" + "---|" * 16]
    for name in dict.fromkeys([row["row"] for row in ours] + [row["row"] for row in theirs]):
        mine = next((row for row in ours if row["row"] == name), None)
        paper = next((row for row in theirs if row["row"] == name), None)
        lines.append(f"| {name} | " + " | ".join(cells(mine)) + " | | " + " | ".join(cells(paper)) + " |")
    lines += ["", "| feature | graybox | paper |", "|---|---|---|"]
    lines += [f"| {what} | {mine} | {paper} |" for what, mine, paper in features(ours, theirs, curve)]
    (folder / "tables" / "table_1.md").write_text("\n".join(lines) + "\n", encoding="utf-8")
    print(f"wrote {folder / 'tables' / 'table_1.md'}")


def cells(row):
    if row is None:
        return [""] * 7
    extreme = row["row"] in ("Min", "Med", "Max")
    weight = "" if extreme else f"{float(row['weight']):.4f}"
    return [f"{float(row[joint]):g}" for joint in JOINTS] + [f"{float(row['covariance']):.1f}", weight]


def features(ours, theirs, curve):
    """(what, ours, the paper's) for everything that does not depend on which positions they are."""
    def of(rows, name):
        return f"{float(next(row for row in rows if row['row'] == name)['covariance']):.1f}"

    def weights(rows):
        return [float(row["weight"]) for row in rows if row["row"].isdigit()]

    def span(rows):
        return f"{min(weights(rows)):.4f} to {max(weights(rows)):.4f}"

    result = [("support positions", len(weights(ours)), len(weights(theirs))),
              ("best single position over the optimal mix", of(ours, "Min"), of(theirs, "Min")),
              ("median position", of(ours, "Med"), of(theirs, "Med")),
              ("worst position", of(ours, "Max"), of(theirs, "Max")),
              ("weights", span(ours), span(theirs))]
    if curve:
        at = {int(row["experiments"]): row for row in curve}
        best = float(at[1]["best_single"])
        result += [
            (f"{m} rounded experiments equal … in the best single position",
             f"{best / float(at[m]['rounded']):.1f}", paper) for m, paper in ((10, "almost 60"), (3, "10"))]
        if 100 in at:
            row = {name: float(value) for name, value in at[100].items() if value}
            result += [("100 experiments: one random position over 100 random ones",
                        f"{row['random_one_mean'] / row['random_mean']:.1f}", "10"),
                       ("100 experiments: 100 random positions over the best single one",
                        f"{row['random_mean'] / row['best_single']:.1f}", "3")]
    return result


def plain_log_axis(axis, ticks):
    axis.set_major_locator(FixedLocator(ticks))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


def columns(rows, prefix):
    names = [name for name in rows[0] if name.startswith(prefix)]
    return [[float(row[name]) for row in rows] for name in names]


def figure_2(folder):
    rows = read_table(folder / "tables" / "figure_2.csv")
    if not rows:
        return
    frequency = [float(row["frequency_hz"]) for row in rows]
    figure, axes = plt.subplots(figsize=(7.2, 4.4))
    for values in columns(rows, "response_"):
        axes.loglog(frequency, values, color=BLUE, lw=1.2)
    for values in columns(rows, "inverse_controller_"):
        axes.loglog(frequency, values, color=VERMILION, lw=1.2, ls="--")
    axes.plot([], [], color=BLUE, label="robot, $G$")
    axes.plot([], [], color=VERMILION, ls="--", label="inverse controller, $F^{-1}$")
    axes.set_xlim(frequency[0], frequency[-1])
    plain_log_axis(axes.xaxis, [1, 2, 5, 10, 20, 50])
    axes.set_xlabel("frequency (Hz)")
    axes.set_ylabel("singular values, motor side (rad/s per N m)")
    axes.legend(loc="lower left", fontsize=8)
    axes.set_title("Figure 2: the loop is closed where the inverse controller lies below the robot ($q_m = 0$)")
    note(figure, ASSUMED, y=-0.01)
    save(folder, figure, "figure_2")


def known(rows, name):
    """(M, value) where the column holds a number."""
    pairs = [(int(row["experiments"]), float(row[name])) for row in rows if row.get(name)]
    return [m for m, _ in pairs], [value for _, value in pairs]


def figure_4(folder):
    rows = read_table(folder / "tables" / "figure_4.csv")
    if not rows:
        return
    last = int(rows[-1]["experiments"])
    exact = [row for row in read_table(folder / "tables" / "exact_designs.csv") if int(row["experiments"]) <= last]
    figure, (axes, close) = plt.subplots(1, 2, figsize=(11.5, 5.0), width_ratios=[1.5, 1])
    covariances(axes, rows, exact)
    efficiencies(close, rows, exact)
    figure.suptitle("Figure 4: " + figure_4_message(rows), x=0.01, ha="left", fontsize=11)
    figure.tight_layout(w_pad=2.5)
    note(figure, ASSUMED + " 7920 positions; random positions: 1000 draws.")
    save(folder, figure, "figure_4")


def covariances(axes, rows, exact):
    axes.set_xscale("log")
    axes.set_yscale("log")
    m, low = known(rows, "random_low")
    _, high = known(rows, "random_high")
    axes.fill_between(m, low, high, color=GREY, alpha=0.18, lw=0)
    axes.plot(*known(rows, "random_one_mean"), color=GREY, lw=1.2, ls=(0, (1, 1.5)),
              label="one random position, mean over all positions")
    axes.plot(*known(rows, "random_mean"), color=GREY, lw=1.4, ls="-.",
              label="M random positions, mean (band: 5 % to 95 %)")
    axes.plot(*known(rows, "best_single"), color=VERMILION, lw=1.4, ls="--",
              label="best single position")
    axes.plot(*known(rows, "relaxed"), color=BLUE, lw=1.2, label=r"relaxed, $M\lambda^*$: lower bound")
    axes.plot(*known(rows, "rounded"), color=SKY, lw=0, marker="o", ms=4.4, mfc="white",
              label=r"rounded, $\tilde{m}$ (the paper's footnote 3)")
    if exact:
        draw_exact(axes, exact)
    axes.set_xlim(1, m[-1])
    plain_log_axis(axes.xaxis, [tick for tick in (1, 2, 5, 10, 20, 50, 100, 200, 500) if tick <= m[-1]])
    plain_log_axis(axes.yaxis, [0.01, 0.1, 1, 10, 100])
    axes.set_xlabel("number of experiments M")
    axes.set_ylabel("covariance, det($H$)$^{-1/d}$ (1: relaxed optimum, one experiment)")
    axes.legend(fontsize=8, loc="upper right")


def efficiencies(axes, rows, exact):
    """Where the designs of whole numbers lie below the relaxed bound: the first 20 experiments, on a plain axis."""
    of = {int(row["experiments"]): row for row in rows}
    rounded = [(m, float(row["relaxed"]) / float(row["rounded"])) for m, row in of.items()
               if m <= 20 and row["rounded"] and row["relaxed"]]
    axes.plot(*zip(*rounded), color=SKY, lw=0, marker="o", ms=6, mfc="white", label=r"rounded, $\tilde{m}$")
    best = [(int(row["experiments"]), float(row["relaxed"]) / float(row["branch_and_bound"]))
            for row in exact if int(row["experiments"]) <= 20]
    if best:
        axes.plot(*zip(*best), color=BLACK, lw=0, marker=".", ms=5, label="best integer design, $m^*$")
    axes.axhline(1, color=BLUE, lw=1.2)
    axes.set_xlim(0.5, 20.5)
    axes.set_xticks([1, 5, 10, 15, 20])
    axes.set_ylim(0, 1.05)
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{100 * value:.0f} %"))
    axes.set_xlabel("number of experiments M")
    axes.set_ylabel("D-efficiency against the relaxed bound")
    axes.legend(fontsize=8, loc="lower right")


def draw_exact(axes, exact):
    """The best integer designs, in the unit of the other curves: the relaxed optimum's for M = 1."""
    m = [int(row["experiments"]) for row in exact]
    value = [float(row["branch_and_bound"]) / (count * float(row["relaxed"]))
             for count, row in zip(m, exact)]
    proven = sum(row["proven_optimal"] == "yes" for row in exact)
    share = "all" if proven == len(exact) else f"{proven} of {len(exact)}"
    axes.plot(m, value, color=BLACK, lw=0, marker=".", ms=4,
              label=f"best integer design, $m^*$ ({share} proven optimal)")


def figure_4_message(rows):
    """How many experiments in the best single position equal ten rounded ones."""
    best = float(rows[0]["best_single"])
    ten = [float(row["rounded"]) for row in rows if row["experiments"] == "10" and row["rounded"]]
    if not ten:
        return "covariance against the number of experiments"
    return f"ten chosen positions are worth {best / ten[0]:.0f} experiments in the best single one"


def poses_of(rows):
    poses = {}
    for row in rows:
        poses.setdefault(row["pose"], []).append(row)
    return [(float(points[0]["weight"]),
             np.array([[float(point[axis]) for axis in ("x_m", "y_m", "z_m")] for point in points]))
            for points in poses.values()]


def draw_arm(axes, places, width, project):
    line = [project(place) for place in places]
    axes.plot(*zip(*line), color=BLUE, lw=width, solid_capstyle="round", zorder=2)
    axes.plot(*zip(*line[:-1]), ls="", marker="o", color=BLACK, ms=2.2, zorder=3)
    axes.plot(*zip(line[-1]), ls="", marker="o", mfc="white", mec=VERMILION, mew=1.4, ms=6, zorder=4, clip_on=False)


def side_panels(figure, grid, poses):
    """One panel a pose, seen from the side: along the plane in which the arm bends."""
    across = math.ceil(len(poses) / 3)
    panels = grid.subgridspec(3, across, wspace=0.08, hspace=0.28)
    points = np.vstack([places for _, places in poses])
    radius = np.hypot(points[:, 0], points[:, 1]).max() + 0.15
    for k, (weight, places) in enumerate(poses):
        axes = figure.add_subplot(panels[k // across, k % across])
        turn = np.arctan2(places[2][1], places[2][0])  # joint 1, seen at the shoulder
        forward = np.array([math.cos(turn), math.sin(turn)])
        draw_arm(axes, places, 2.0, lambda place, f=forward: (place[:2] @ f, place[2]))
        axes.set_xlim(-radius, radius)
        axes.set_ylim(min(points[:, 2].min(), 0) - 0.2, points[:, 2].max() + 0.2)
        axes.set_aspect("equal")
        axes.set_xticks([])
        axes.set_yticks([])
        axes.axhline(0, color="#bbbbbb", lw=0.8)
        for side in axes.spines.values():
            side.set_visible(False)
        axes.set_title(f"{k + 1}:  {100 * weight:.1f} %", fontsize=8, pad=2)
        if k == 0:
            scale_bar(axes, -radius, points[:, 2].max())


def scale_bar(axes, x, y, length=1.0):
    axes.plot([x, x + length], [y, y], color=BLACK, lw=1.6, solid_capstyle="butt", clip_on=False)
    axes.text(x + length / 2, y - 0.08, f"{length:g} m", ha="center", va="top", fontsize=7)


def distance(places, points):
    """From each place to the nearest of the points."""
    return np.hypot(*(np.asarray(points)[:, None] - places).transpose(2, 0, 1)).min(axis=0)


def places_of_numbers(arms, away=0.14, directions=24):
    """A place beside each arm's payload for its number, off all arms and away from the other numbers."""
    along = np.linspace(0, 1, 40)[:, None]
    drawn = np.vstack([start + along * (end - start) for arm in arms for start, end in zip(arm, arm[1:])])
    taken, places = [arm[-1] for arm in arms], []
    for k, arm in enumerate(arms):
        angles = 2 * math.pi * np.arange(directions) / directions
        around = arm[-1] + away * np.column_stack([np.cos(angles), np.sin(angles)])
        others = [place for j, place in enumerate(taken) if j != k]
        room = np.minimum(distance(around, drawn) / 0.1, 1) + np.minimum(distance(around, others) / 0.2, 1)
        places.append(around[int(np.argmax(np.round(room, 9)))])
        taken.append(places[-1])
    return places


def top_panel(axes, poses):
    """All payloads and arms from above: how the positions turn about the first axis."""
    for weight, places in poses:
        line = places[:, :2]
        axes.plot(*line.T, color=BLUE, lw=0.8 + 14 * weight, alpha=0.55, solid_capstyle="round", zorder=2)
        axes.plot(*line[-1], ls="", marker="o", mfc="white", mec=VERMILION, mew=1.2, ms=6, zorder=4)
    arms = [places[:, :2] for _, places in poses]
    for k, (arm, place) in enumerate(zip(arms, places_of_numbers(arms))):
        axes.plot(*zip(arm[-1], place), color=GREY, lw=0.6, zorder=3)
        axes.text(*place, str(k + 1), ha="center", va="center", fontsize=7, zorder=5,
                  bbox={"fc": "white", "ec": "none", "pad": 0.5})
    axes.plot(0, 0, "+", color=BLACK, ms=10, zorder=3)
    axes.set_aspect("equal")
    axes.set_xlabel("x (m)")
    axes.set_ylabel("y (m)")
    axes.set_title("From above")


def figure_5(folder):
    rows = read_table(folder / "tables" / "figure_5.csv")
    if not rows:
        return
    poses = poses_of(rows)
    figure = plt.figure(figsize=(11.5, 5.2))
    grid = figure.add_gridspec(1, 2, width_ratios=(1.35, 1), wspace=0.14)
    side_panels(figure, grid[0], poses)
    top_panel(figure.add_subplot(grid[1]), poses)
    figure.suptitle(f"Figure 5: the {len(poses)} optimal positions, with their share of the experiments",
                    x=0.12, ha="left", fontsize=11, y=0.97)
    figure.text(0.12, 0.0, "Left: each from the side, in the vertical plane through its shoulder, with its "
                "number in Table I. Right: all from above, line width by share. "
                "\nDots: joints; circle: payload (centre of mass of the last link with its load). "
                "Geometry from the URDF.", fontsize=7.5, color="#555555", va="top")
    save(folder, figure, "figure_5")


def draw(folder):
    table_1(folder)
    figure_2(folder)
    figure_4(folder)
    figure_5(folder)
