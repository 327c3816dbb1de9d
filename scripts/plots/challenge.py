"""The diagnosis on concealed data: what is named for each true law, and how often an effect is
detected and named, by its size; a figure for each set of cases."""

import math

import matplotlib.pyplot as plt
import numpy as np

from style import BLACK, BLUE, GREY, ORANGE, read_table, save

# Columns that are no laws, last in the confusion matrix.
OTHER = ["unknown", "none", "no_answer"]


def words(name):
    return name.replace("_", " ")


def confusion(axes, rows):
    true_laws = sorted({row["true_law"] for row in rows})
    named = sorted({row["named"] for row in rows} - set(OTHER) - set(true_laws))
    columns = [law for law in true_laws if any(row["named"] == law for row in rows)] + named
    columns += [other for other in OTHER if any(row["named"] == other for row in rows)]
    right = np.zeros((len(true_laws), len(columns)))
    wrong = np.zeros_like(right)
    for row in rows:
        at = true_laws.index(row["true_law"]), columns.index(row["named"])
        right[at] += int(row["right_place"])
        wrong[at] += int(row["wrong_place"])
    counts = right + wrong
    shares = counts / np.maximum(counts.sum(axis=1, keepdims=True), 1)
    axes.imshow(shares, cmap="Blues", vmin=0.0, vmax=1.15)
    for i, j in np.ndindex(counts.shape):
        if counts[i, j] == 0:
            continue
        is_law = columns[j] not in OTHER
        brackets = is_law and wrong[i, j]
        text = f"{int(counts[i, j])}" + (f"({int(wrong[i, j])})" if brackets else "")
        axes.text(j, i, text, ha="center", va="center", fontsize=4.0 if len(text) > 4 else 5.0 if brackets else 6.5,
                  color="white" if shares[i, j] > 0.65 else BLACK)
    axes.set_xticks(range(len(columns)), [words(name) for name in columns], rotation=60, ha="right",
                    fontsize=7)
    axes.set_yticks(range(len(true_laws)), [words(name) for name in true_laws], fontsize=7)
    axes.set_xlabel("law named first, or verdict")
    axes.set_ylabel("true law")
    axes.grid(False)
    axes.tick_params(length=0)
    for spine in axes.spines.values():
        spine.set_visible(False)
    named_rows = [i for i, law in enumerate(true_laws) if law in columns]
    diagonal = sum(counts[i, columns.index(true_laws[i])] for i in named_rows)
    axes.set_title(f"The true law is named first in {int(diagonal)} of {int(counts.sum())} cases with one effect of "
                   "any size\n(in brackets: of these at a wrong place; shade: share of the row). On the right:\n"
                   "classes of up to three names, of effects that can be seen", fontsize=9)


def rates(axes, rows, target):
    rows = [row for row in rows if int(row["cases"]) > 0]
    x = [math.sqrt(float(row["from"]) * min(float(row["to"]), 20.0)) for row in rows]
    for name, colour, label, shift in (("detected", BLUE, "detected", 0.985),
                                       ("named", ORANGE, "law and place named\n(class of at most 3)", 1.015)):
        y = np.array([float(row[name]) for row in rows])
        low = np.array([float(row[name + "_low"]) for row in rows])
        high = np.array([float(row[name + "_high"]) for row in rows])
        axes.errorbar(np.array(x) * shift, 100 * y, 100 * np.array([y - low, high - y]).clip(0),
                      fmt="o-", color=colour, ms=4.5, capsize=2.5, lw=1.2, label=label)
    for position, row in zip(x, rows):
        axes.text(position, -6, f"n = {row['cases']}", ha="center", fontsize=7, color=GREY)
    axes.axhline(target, color=GREY, lw=0.8, ls="--")
    axes.text(1.03, target + 0.8, f"target {target} %", ha="left", fontsize=7, color=GREY)
    axes.set_xscale("log")
    axes.set_xticks([1, 2, 5, 10, 20], ["1", "2", "5", "10", "20"])
    axes.minorticks_off()
    axes.set_xlim(1, 21)
    axes.set_ylim(-10, 104)
    axes.set_xlabel("size of the effect over the smallest detectable one")
    axes.set_ylabel("cases with one detectable effect, % (no answer: neither)")
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.13), ncol=2, fontsize=8, frameon=False)
    axes.set_title("Detection and naming by size (bars: Wilson's 95 % intervals)", fontsize=9.5)


def draw_set(folder, name, target):
    tables = folder / "tables"
    pairs = read_table(tables / f"{name}_confusion.csv")
    sizes = read_table(tables / f"{name}_sizes.csv")
    if not pairs or not sizes:
        return
    figure, (left, right) = plt.subplots(1, 2, figsize=(12.5, 6.2), width_ratios=[1.25, 1.0],
                                         layout="constrained")
    confusion(left, pairs)
    rates(right, sizes, target)
    save(folder, figure, name)


def draw(folder):
    draw_set(folder, "challenge", 95)
    draw_set(folder, "challenge_any_motion", 90)
