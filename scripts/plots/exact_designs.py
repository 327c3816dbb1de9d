"""How much whole numbers of experiments lose, method by method: figure exact_efficiency.

Loss is 1 - D-efficiency against the relaxed bound, for every method (tables exact_designs.csv for the
robot, exact_families_*.csv for random families).
"""

import matplotlib.pyplot as plt

import style

# Name, label, and style of the methods that miss the best design; the last are drawn over the first.
METHODS = [
    ("efficient_rounding", "efficient rounding", {"color": style.ORANGE, "marker": "s", "ms": 3}),
    ("rounding", "paper's rounding", {"color": style.VERMILION, "marker": "o", "ms": 3}),
]
FLOOR = 1e-9  # what the runs were asked to prove


def number(row, column):
    return float(row[column]) if row[column] else float("nan")


def draw_losses(axes, rows):
    runs = [number(row, "experiments") for row in rows]
    relaxed = [number(row, "relaxed_efficiency") for row in rows]
    for name, label, look in METHODS:
        losses = [1 - number(row, f"{name}_efficiency") * best for row, best in zip(rows, relaxed)]
        axes.plot(runs, losses, ls="", mew=0.8, label=label, **look)
    axes.plot(runs, [1 - value for value in relaxed], color=style.BLACK, lw=1.2, marker=".", ms=3,
              label="best exact design: " + reached(rows))
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlabel("number of experiments M")
    axes.set_ylabel("loss of D-efficiency against the relaxed bound")
    axes.legend(loc="lower left", fontsize=8)


def reached(rows):
    """In how many cases exchange and branch and bound are the best design, to what was asked."""
    counts = {name: sum(number(row, f"{name}_efficiency") >= 1 - 2 * FLOOR for row in rows)
              for name in ("exchange", "branch_and_bound", "rounding")}
    return (f"branch and bound in {counts['branch_and_bound']},\nexchange in {counts['exchange']}, "
            f"the paper's rounding in {counts['rounding']} of {len(rows)} cases")


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
    axes.set_ylabel("number of candidates, of nodes")
    axes.legend(loc="upper right", bbox_to_anchor=(1.0, 0.9), fontsize=8)


def draw(folder):
    rows = style.read_table(folder / "tables" / "exact_designs.csv")
    if not rows:
        return
    figure, (losses, work) = plt.subplots(1, 2, figsize=(10.2, 4.1), width_ratios=[1.35, 1])
    draw_losses(losses, rows)
    losses.set_title(f"Robot, 7920 positions: {proven_text(rows)}")
    draw_work(work, rows)
    work.set_title("Screening leaves few candidates to search")
    figure.tight_layout()
    style.note(figure, style.ASSUMED + " Each best design is proven to a gap of $10^{-9}$.")
    style.save(folder, figure, "exact_efficiency")


def proven_text(rows):
    proven = sum(row["proven_optimal"] == "yes" for row in rows)
    if proven == len(rows):
        return "the best exact design is proven for every M"
    return f"the best exact design is proven for {proven} of {len(rows)} M"
