"""What the criteria make of one set: efficiencies of each design under each criterion, and what each
design does to the parameters' standard deviations."""

import matplotlib.pyplot as plt
import numpy as np

from style import ASSUMED, BLACK, BLUE, GREEN, ORANGE, VERMILION, note, read_table, save

COLOURS = {"A": BLUE, "E": VERMILION, "L": ORANGE, "Ds": GREEN}
MARKERS = {"A": "o", "E": "s", "L": "^", "Ds": "D"}
MEANING = {"D": "volume", "A": "sum of variances", "E": "worst combination",
           "L": "gearboxes' variances", "Ds": "gearboxes' volume"}


def efficiency_map(axes, rows):
    names = [row["design"] for row in rows]
    values = np.array([[float(row[name]) for name in names] for row in rows])
    axes.imshow(values, cmap="Blues", vmin=0.0, vmax=1.15)
    for i, j in np.ndindex(values.shape):
        axes.text(j, i, f"{values[i, j]:.2f}", ha="center", va="center", fontsize=9,
                  color="white" if values[i, j] > 0.65 else BLACK)
    axes.set_xticks(range(len(names)), names)
    axes.set_yticks(range(len(names)), [f"{name}  ({MEANING[name]})" for name in names])
    axes.set_xlabel("efficiency under criterion")
    axes.set_ylabel("design optimal for")
    axes.grid(False)
    axes.tick_params(length=0)
    for spine in axes.spines.values():
        spine.set_visible(False)
    worst = {row["design"]: min(float(row[name]) for name in names) for row in rows}
    best = max(worst, key=worst.get)
    axes.set_title(f"The {best}-optimal design keeps {100 * worst[best]:.0f} % or more\n"
                   "of the optimum under every criterion", fontsize=10)


def deviation_dots(axes, rows):
    names = [name for name in COLOURS if name in rows[0]]
    y = np.arange(len(rows))[::-1]
    axes.axvline(1.0, color=BLACK, lw=1.2)
    for place, name in enumerate(names):
        ratio = [float(row[name]) / float(row["D"]) for row in rows]
        shift = 0.16 * (place - (len(names) - 1) / 2)  # so that none hides another
        axes.plot(ratio, y - shift, MARKERS[name], color=COLOURS[name], ms=5, label=name,
                  markeredgecolor="white", markeredgewidth=0.5)
    axes.set_yticks(y, [row["parameter"].replace(".", ", ").replace("_", " ") for row in rows],
                    fontsize=8)
    axes.set_xscale("log")
    ticks = [0.7, 0.8, 1.0, 1.5, 2.0, 3.0]
    axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    axes.minorticks_off()
    axes.set_xlabel("standard deviation, relative to the D-optimal design's")
    axes.grid(axis="y", visible=False)
    for below in y[1:]:
        axes.axhline(below + 0.5, color="#e4e4e4", lw=0.6, zorder=0)
    ratios = {name: max(float(row[name]) / float(row["D"]) for row in rows) for name in names}
    safest = min(ratios, key=ratios.get)
    axes.set_title(f"{safest} costs no parameter more than {100 * (ratios[safest] - 1):.0f} %", fontsize=10, pad=34)
    axes.legend(title="design optimal for", ncols=len(names), loc="lower center", fontsize=8,
                title_fontsize=8, bbox_to_anchor=(0.5, 1.0), columnspacing=1.2, handletextpad=0.3)


def draw(folder):
    tables = folder / "tables"
    efficiencies = read_table(tables / "criteria_efficiency.csv")
    deviations = read_table(tables / "criteria_deviations.csv")
    if not efficiencies or not deviations:
        return
    figure, (left, right) = plt.subplots(1, 2, figsize=(10.2, 4.6),
                                         gridspec_kw={"width_ratios": [1.0, 1.15], "wspace": 0.55})
    efficiency_map(left, efficiencies)
    deviation_dots(right, deviations)
    note(figure, ASSUMED + " 7920 positions; every optimum certified to a gap below $10^{-9}$.", y=-0.02)
    save(folder, figure, "criteria_efficiency")
