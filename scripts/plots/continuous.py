"""Designs off the grid: what the grid loses, and what the optimum depends on."""

import matplotlib.pyplot as plt
from matplotlib.ticker import FixedLocator, FuncFormatter, NullFormatter

from style import ASSUMED, BLUE, GREY, VERMILION, note, read_table, save

COVARIANCE = r"covariance $(\det M)^{-1/d}$"


def plain(value, _):
    return f"{value:g}"


def largest_gap(bounds):
    """The largest sensitivity that searches from the refined grids found, over d, minus 1."""
    return max(0.0, *(float(row["largest_searched_gap"]) for row in bounds))


def refinement_panel(axes, rows, bounds):
    grids = [row for row in rows if row["candidates"] != "continuous"]
    best = next(row for row in rows if row["candidates"] == "continuous")
    axes.semilogx([int(row["candidates"]) for row in grids],
                  [float(row["covariance"]) for row in grids], "o-", color=BLUE, ms=4,
                  label="optimum on a grid (proven)")
    covariance, gap = float(best["covariance"]), largest_gap(bounds)
    axes.axhline(covariance, color=VERMILION, label="continuous joint angles, best found")
    axes.axhspan(covariance / (1 + gap), covariance, color=VERMILION, alpha=0.25, lw=0,
                 label=f"may still be gained: largest gap that searches found ({100 * gap:.0f} %)")
    for paper in (row for row in grids if row["candidates"] == "7920"):
        axes.annotate("the paper's grid", xy=(7920, float(paper["covariance"])), xytext=(8, 14),
                      textcoords="offset points", fontsize=8, color=GREY,
                      arrowprops={"arrowstyle": "-", "color": GREY, "lw": 0.6})
    axes.set_xlabel("positions on the grid")
    axes.set_ylabel(COVARIANCE)
    axes.set_ylim(bottom=0)
    axes.set_title("Grids fall short of continuous angles")
    axes.legend(fontsize=8, loc="lower left")


def sensitivity_panel(axes, rows, _):
    error = [100 * float(row["stiffness_error"]) for row in rows]
    for key, colour, label in (("grid_covariance", BLUE, "optimum on the paper's grid"),
                               ("continuous_covariance", VERMILION, "continuous optimum")):
        axes.loglog(error, [float(row[key]) for row in rows], "o-", color=colour, ms=4, label=label)
    axes.set_xlabel("every stiffness off by up to (%)")
    axes.set_ylabel(COVARIANCE + ", median of 200 robots")
    axes.set_title("The gain needs a well-known stiffness")
    for axis, ticks in ((axes.xaxis, [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 40]), (axes.yaxis, [0.5, 1, 2, 5, 10])):
        axis.set_major_locator(FixedLocator(ticks))
        axis.set_major_formatter(FuncFormatter(plain))
        axis.set_minor_formatter(NullFormatter())
    axes.legend(fontsize=8)


def draw(folder):
    tables = [read_table(folder / "tables" / f"continuous_{name}.csv")
              for name in ("bound", "refinement", "sensitivity")]
    if not all(tables):
        return
    bounds, *tables = tables
    figure, panels = plt.subplots(1, 2, figsize=(10.2, 4.1))
    for panel, axes, rows in zip((refinement_panel, sensitivity_panel), panels, tables):
        panel(axes, rows, bounds)
    figure.tight_layout(w_pad=2.5)
    note(figure, ASSUMED)
    save(folder, figure, "continuous_design")
