"""How much whole numbers of experiments lose, method by method: figure exact_efficiency.

Loss is 1 - D-efficiency against the best exact design, whose value is proven (tables
exact_designs.csv for the robot, exact_families_*.csv for random families).
"""

import matplotlib.pyplot as plt

import style

# Name, label, and style; the last are drawn over the first.
METHODS = [
    ("exchange", "exchange", {"color": style.BLUE, "marker": "^", "ms": 6.5, "mfc": "none"}),
    ("branch_and_bound", "branch and bound", {"color": style.GREEN, "marker": "D", "ms": 3}),
    ("efficient_rounding", "efficient rounding", {"color": style.ORANGE, "marker": "s", "ms": 3}),
    ("rounding", "paper's rounding", {"color": style.VERMILION, "marker": "o", "ms": 3}),
]
FLOOR = 1e-9  # what the runs were asked to prove


def number(row, column):
    return float(row[column]) if row[column] else float("nan")


def draw_losses(axes, rows):
    runs = [number(row, "experiments") for row in rows]
    relaxed = [max(1 - number(row, "relaxed_efficiency"), FLOOR) for row in rows]
    axes.plot(runs, relaxed, color=style.BLACK, lw=1.2, ls="--",
              label="best exact design\nagainst the relaxed bound")
    for name, label, look in METHODS:
        losses = [number(row, f"{name}_efficiency") for row in rows]
        losses = [max(1 - value, FLOOR) for value in losses]
        axes.plot(runs, losses, ls="", mew=0.8, label=label, **look)
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_ylim(FLOOR / 3, 1.2)
    axes.set_xlabel("number of experiments M")
    axes.set_ylabel("loss of D-efficiency, 1 - efficiency")
    axes.axhline(FLOOR, color=style.GREY, lw=0.6)
    axes.text(runs[-1], FLOOR * 1.9, "proven optimal (to a gap of $10^{-9}$)", ha="right",
              va="bottom", fontsize=7.5, color=style.GREY)


def draw_work(axes, rows):
    runs = [number(row, "experiments") for row in rows]
    axes.plot(runs, [number(row, "survivors") for row in rows], "o", ms=3, color=style.PURPLE,
              label="candidates left by screening")
    axes.plot(runs, [number(row, "nodes") for row in rows], "s", ms=3, color=style.SKY,
              label="nodes of the tree")
    axes.axhline(7920, color=style.GREY, lw=0.8, ls=":")
    axes.text(runs[-1], 7920 * 1.12, "all 7920 candidates", ha="right", va="bottom", fontsize=7.5,
              color=style.GREY)
    axes.set_ylim(8, 16000)
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlabel("number of experiments M")
    axes.set_ylabel("candidates, nodes")
    axes.legend(loc="upper right", bbox_to_anchor=(1.0, 0.9), fontsize=8)


def draw(folder):
    rows = style.read_table(folder / "tables" / "exact_designs.csv")
    if not rows:
        return
    figure, (losses, work) = plt.subplots(1, 2, figsize=(10.2, 4.1), width_ratios=[1.35, 1])
    draw_losses(losses, rows)
    losses.legend(loc="center left", bbox_to_anchor=(0.0, 0.33), fontsize=8)
    losses.set_title(f"Robot, 7920 positions: {proven_text(rows)}")
    draw_work(work, rows)
    work.set_title("What is left to search")
    figure.tight_layout()
    style.save(folder, figure, "exact_efficiency")


def proven_text(rows):
    proven = sum(row["proven_optimal"] == "yes" for row in rows)
    if proven == len(rows):
        return "the best exact design is proven for every M"
    return f"the best exact design is proven for {proven} of {len(rows)} M"
