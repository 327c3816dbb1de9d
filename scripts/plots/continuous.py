"""Designs off the grid: what the grid loses, how the search went, what the optimum depends on."""

import matplotlib.pyplot as plt

from style import BLUE, GREY, VERMILION, read_table, save

COVARIANCE = r"covariance $(\det M)^{-1/d}$"


def plain(value, _):
    return f"{value:g}"


def refinement_panel(axes, rows):
    grids = [row for row in rows if row["candidates"] != "continuous"]
    best = next(row for row in rows if row["candidates"] == "continuous")
    axes.semilogx([int(row["candidates"]) for row in grids],
                  [float(row["covariance"]) for row in grids], "o-", color=BLUE, ms=4,
                  label="optimum on a grid (proven)")
    axes.axhline(float(best["covariance"]), color=VERMILION, label="continuous joint angles, best found")
    paper = next(row for row in grids if row["candidates"] == "7920")
    axes.annotate("the paper's grid", xy=(7920, float(paper["covariance"])), xytext=(8, 14),
                  textcoords="offset points", fontsize=8, color=GREY,
                  arrowprops={"arrowstyle": "-", "color": GREY, "lw": 0.6})
    axes.set_xlabel("positions on the grid")
    axes.set_ylabel(COVARIANCE)
    axes.set_ylim(bottom=0)
    axes.set_title("Grids fall short of continuous angles")
    axes.legend(fontsize=8, loc="lower left")


def search_panel(axes, rows):
    """Gaps found round by round; quiet rounds fall to the asked gap and later ones find more."""
    rounds = [int(row["round"]) for row in rows]
    axes.semilogy(rounds, [float(row["found_gap"]) for row in rows], "o-", color=GREY, ms=3, lw=0.8,
                  label=r"largest sensitivity found$/d-1$")
    axes.semilogy(rounds, [float(row["covariance"]) for row in rows], color=VERMILION,
                  label=COVARIANCE + " so far")
    axes.set_xlabel("round of searches")
    axes.set_ylabel("gap found; covariance")
    axes.set_title("Each new maximum is met by chance")
    axes.legend(fontsize=8)


def sensitivity_panel(axes, rows):
    error = [100 * float(row["stiffness_error"]) for row in rows]
    for key, colour, label in (("grid_covariance", BLUE, "optimum on the paper's grid"),
                               ("continuous_covariance", VERMILION, "continuous optimum")):
        axes.loglog(error, [float(row[key]) for row in rows], "o-", color=colour, ms=4, label=label)
    axes.set_xlabel("every stiffness off by up to [%]")
    axes.set_ylabel(COVARIANCE + ", median of 200 robots")
    axes.set_title("The gain needs a well-known stiffness")
    axes.xaxis.set_major_formatter(plt.FuncFormatter(plain))
    axes.yaxis.set_major_formatter(plt.FuncFormatter(plain))
    axes.legend(fontsize=8)


def draw(folder):
    tables = [read_table(folder / "tables" / f"continuous_{name}.csv")
              for name in ("refinement", "rounds", "sensitivity")]
    if not all(tables):
        return
    figure, panels = plt.subplots(1, 3, figsize=(13.5, 4.1))
    for panel, axes, rows in zip((refinement_panel, search_panel, sensitivity_panel), panels, tables):
        panel(axes, rows)
    figure.tight_layout(w_pad=2.5)
    save(folder, figure, "continuous_design")
