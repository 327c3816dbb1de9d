"""The diagnosis on concealed data: what is named for each true law, and how often an effect is
detected and named, by its size; a figure for each set of cases."""

import math

import matplotlib.pyplot as plt
import numpy as np

from style import BLACK, BLUE, GREY, ORANGE, note, read_table, save

# Columns that are no laws, last in the confusion matrix.
OTHER = ["unknown", "none", "no_answer"]
# Laws that the catalogue lacks: the right answer is no law.
OUTSIDE = {"impact_stop", "magnetic_spring", "position_friction", "load_friction", "drifting_stiffness"}


def words(name):
    return name.replace("_", " ")


def confusion(axes, rows):
    inside = sorted({row["true_law"] for row in rows} - OUTSIDE)
    true_laws = inside + sorted({row["true_law"] for row in rows} & OUTSIDE)
    columns = inside + sorted({row["named"] for row in rows} - set(OTHER) - set(inside))
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
    for position in (len(inside),):
        axes.axhline(position - 0.5, color=GREY, lw=0.8)
        axes.axvline(position - 0.5, color=GREY, lw=0.8)
    if len(inside) < len(true_laws):
        axes.text(len(inside) - 1, len(inside) + 0.1, "not in the catalogue: no law is right", ha="right", va="center",
                  fontsize=7, color=GREY)
    diagonal = sum(counts[i, i] for i in range(len(inside)))
    cases = counts[:len(inside)].sum()
    axes.set_title(f"The first law named is the true one in {int(diagonal)} of {int(cases)} cases", fontsize=9.5)


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
        axes.text(position, 41.5, f"n = {row['cases']}", ha="center", fontsize=7, color=GREY)
    axes.axhline(target, color=GREY, lw=0.8, ls="--")
    axes.text(1.01, target, f"target\n{target} %", transform=axes.get_yaxis_transform(), ha="left", va="center",
              fontsize=7, color=GREY)
    axes.set_xscale("log")
    axes.set_xticks([1, 2, 5, 10, 20], ["1", "2", "5", "10", "20"])
    axes.minorticks_off()
    axes.set_xlim(1, 21)
    axes.set_ylim(40, 103)
    axes.set_xlabel("size of the effect over the smallest detectable one")
    axes.set_ylabel("cases with one detectable effect (%)")
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.13), ncol=2, fontsize=8, frameon=False)
    axes.set_title(title_of_rates(rows), fontsize=9.5)


def title_of_rates(rows):
    """How many of the effects that can be seen were detected, and named."""
    cases = sum(int(row["cases"]) for row in rows)
    detected, named = (round(sum(int(row["cases"]) * float(row[name]) for row in rows)) for name in ("detected", "named"))
    return f"Of {cases} effects that can be seen, {detected} are detected and {named} named"


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
    note(figure, "Left: cases with one effect of any size, by the law named first; in brackets, of these at a wrong place; shade: share of "
         "the row. Right: effects above the smallest detectable size;\nnamed: law and place in a class of at most three names; no answer "
         "counts as neither; bars: Wilson's 95 % intervals.", y=-0.02)
    save(folder, figure, name)


def draw(folder):
    draw_set(folder, "challenge", 95)
    draw_set(folder, "challenge_any_motion", 90)
