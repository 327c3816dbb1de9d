"""Real recordings: the error on data kept out of the fit, before and after the diagnosis."""

import numpy

import matplotlib.pyplot as plt

from style import BLACK, BLUE, GREY, ORANGE, read_table, save


LONGEST = 180.0  # %; longer bars are cut, and say so


def title(whole):
    """The median of all sets, before and after."""
    before, after = (numpy.median([float(row[name]) for row in whole.values()])
                     for name in ("held_out_before", "held_out_after"))
    return f"The error on real recordings falls from {before:.0f} % to {after:.0f} % (median of {len(whole)} sets)"


def draw(folder):
    file = folder / "tables" / "real_diagnosis.csv"
    if not file.exists():
        return
    rows = read_table(file)
    names = list(dict.fromkeys(row["set"] for row in rows))
    whole = {row["set"]: row for row in rows if row["catalogue"] == "whole"}
    less = {row["set"]: row for row in rows if row["catalogue"] != "whole"}
    figure, axes = plt.subplots(figsize=(7.6, 0.62 * len(names) + 1.2))
    y = numpy.arange(len(names))
    for shift, label, colour, values in (
            (-0.27, "naive model", GREY, [whole[name]["held_out_before"] for name in names]),
            (0.0, "after diagnosis", BLUE, [whole[name]["held_out_after"] for name in names]),
            (0.27, "its laws taken out of the catalogue", ORANGE,
             [less[name]["held_out_after"] if name in less else "" for name in names])):
        known = [(place, float(value)) for place, value in zip(y, values) if value]
        axes.barh([place + shift for place, _ in known], [min(value, LONGEST) for _, value in known],
                  height=0.25, color=colour, label=label)
        for place, value in known:
            cut = value > LONGEST
            axes.annotate(f"{value:.0f} %, cut" if cut else f"{value:.3g}", (min(value, LONGEST), place + shift),
                          xytext=(-4 if cut else 3, 0), textcoords="offset points", ha="right" if cut else "left",
                          va="center", fontsize=6.5, color="white" if cut else BLACK, zorder=6,
                          bbox=None if cut else {"fc": "white", "ec": "none", "pad": 0.4})
    for place, name in zip(y, names):
        row = whole[name]
        if row["literature"]:
            axes.plot([float(row["literature"])] * 2, [place - 0.4, place + 0.4], color=BLACK, lw=1.8)
        elif row["literature_note"]:
            axes.annotate("by hand: " + row["literature_note"], (float(row["held_out_after"]), place),
                          xytext=(26, 0), textcoords="offset points", va="center", fontsize=7, color=BLACK,
                          bbox={"fc": "white", "ec": "none", "pad": 1})
    axes.plot([], [], color=BLACK, lw=1.8, label="best by hand")
    axes.set_yticks(y, [f"{name}\n{whole[name]['verdict']}, {whole[name]['laws']} law"
                        + ("" if whole[name]["laws"] == "1" else "s") for name in names])
    axes.set_xlim(0.0, LONGEST)
    axes.set_ylim(len(names) - 0.4, -0.6)
    axes.set_xlabel("error on data kept out of the fit, NRMSE (%)")
    axes.grid(axis="y", visible=False)
    axes.legend(fontsize=7, loc="upper center", bbox_to_anchor=(0.4, -0.06), ncols=4)
    axes.set_title(title(whole), loc="left")
    figure.tight_layout()
    save(folder, figure, "real_diagnosis")
