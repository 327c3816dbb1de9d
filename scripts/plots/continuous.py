"""Designs off the grid: what the grid loses, and what the continuous optimum depends on."""

import matplotlib.pyplot as plt

from style import BLUE, GREY, VERMILION, read_table, save


def refinement_panel(axes, tables):
    rows = read_table(tables / "continuous_refinement.csv")
    grids = [row for row in rows if row["candidates"] != "continuous"]
    best = float(next(row for row in rows if row["candidates"] == "continuous")["covariance"])
    bound = max(max(float(row["largest_searched_gap"]), 0.0)
                for row in read_table(tables / "continuous_bound.csv"))
    axes.semilogx([int(row["candidates"]) for row in grids],
                  [float(row["covariance"]) for row in grids], "o-", color=BLUE, ms=4,
                  label="optimum on a grid")
    axes.axhline(best, color=VERMILION, label="continuous joint angles")
    axes.axhspan(best / (1 + bound), best, color=VERMILION, alpha=0.15, lw=0,
                 label=f"still possible by the gap found ({100 * bound:.1f} %)")
    axes.annotate("the paper's grid", xy=(7920, float(next(
        row["covariance"] for row in grids if row["candidates"] == "7920"))), xytext=(8, 14),
        textcoords="offset points", fontsize=8, color=GREY,
        arrowprops={"arrowstyle": "-", "color": GREY, "lw": 0.6})
    axes.set_xlabel("positions on the grid")
    axes.set_ylabel(r"covariance $(\det M)^{-1/d}$, paper's grid = 0.99")
    axes.set_ylim(bottom=0)
    axes.set_title("Finer grids still fall short of continuous angles")
    axes.legend(fontsize=8, loc="lower left")


def sensitivity_panel(axes, tables):
    rows = read_table(tables / "continuous_sensitivity.csv")
    error = [100 * float(row["stiffness_error"]) for row in rows]
    for key, colour, label in (("grid_covariance", BLUE, "optimum on the paper's grid"),
                               ("continuous_covariance", VERMILION, "continuous optimum")):
        axes.loglog(error, [float(row[key]) for row in rows], "o-", color=colour, ms=4, label=label)
    axes.set_xlabel("every stiffness off by up to [%]")
    axes.set_ylabel(r"covariance $(\det M)^{-1/d}$, median of 200 robots")
    axes.set_title("The gain is a fine tuning that a wrong stiffness undoes")
    axes.xaxis.set_major_formatter(plt.FuncFormatter(lambda value, _: f"{value:g}"))
    axes.yaxis.set_major_formatter(plt.FuncFormatter(lambda value, _: f"{value:g}"))
    axes.legend(fontsize=8)


def draw(folder):
    tables = folder / "tables"
    if not (tables / "continuous_refinement.csv").exists():
        return
    figure, (left, right) = plt.subplots(1, 2, figsize=(10.5, 4.0))
    refinement_panel(left, tables)
    sensitivity_panel(right, tables)
    figure.tight_layout(w_pad=3)
    save(folder, figure, "continuous_design")
