"""Joint design of positions and excitation spectra: `graybox design spectrum`."""

import matplotlib.pyplot as plt
from matplotlib.ticker import FuncFormatter, NullFormatter

from style import (ASSUMED, BLACK, BLUE, GREEN, GREY, ORANGE, PURPLE, SKY, VERMILION, dots, note, read_table,
                   save)

AXIS_COLOURS = {1: BLUE, 2: ORANGE, 3: GREEN, 4: SKY, 5: PURPLE, 6: VERMILION}
NAMES = {"flat": "flat spectrum,\nbest positions",
         "blocks_first": "positions of the flat design,\nthen spectra",
         "two_step": "spectrum of each position,\nthen positions",
         "joint": "joint"}
COLOURS = {"flat": GREY, "blocks_first": GREEN, "two_step": ORANGE, "joint": BLUE}


def draw(folder):
    tables = folder / "tables"
    draw_spectra(folder, read_table(tables / "spectrum_optimal.csv"))
    draw_comparison(folder, read_table(tables / "spectrum_comparison.csv"),
                    read_table(tables / "spectrum_robustness.csv"))


def unlimited(row):
    return float(row["position_limit"]) >= 1.0


def plain_numbers(axis):
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


def draw_spectra(folder, rows):
    joint = [row for row in rows if row["design"] == "joint" and unlimited(row)]
    steps = [row for row in rows if row["design"] == "two_step"]
    if not joint or not steps:
        return
    figure, panels = plt.subplots(2, 1, figsize=(7.2, 5.4), sharex=True, sharey=True, layout="constrained")
    for axes, lines in zip(panels, (joint, steps)):
        draw_stems(axes, lines)
    for number in sorted({int(row["axis"]) for row in joint + steps}):
        panels[1].plot([], [], "o", color=AXIS_COLOURS[number], markersize=4, label=str(number))
    worst = max(abs(float(row["resonance"]) / float(row["frequency"]) - 1) for row in joint)
    panels[0].set_title(
        f"Joint design: {len(joint)} lines in {count_positions(joint)} positions, "
        f"each within {100 * worst:.1f} % of a resonance there")
    panels[1].set_title(f"Spectrum of each position first: {len(steps)} lines in "
                        f"{count_positions(steps)} positions")
    panels[1].legend(title="excited axis", ncol=2, loc="upper left", columnspacing=1.0,
                     handletextpad=0.3)
    panels[1].set_xlabel("frequency (Hz)")
    note(figure, ASSUMED + "\nEach stem stands at its frequency; stems of one frequency are stacked.", y=-0.02)
    save(folder, figure, "spectrum_optimal")


def count_positions(lines):
    return len({row["position"] for row in lines})


def draw_stems(axes, lines):
    """A stem for each line; those of one frequency stand on each other."""
    top = {}
    for row in sorted(lines, key=lambda row: (int(row["axis"]), -float(row["weight"]))):
        frequency = float(row["frequency"])
        foot = top.get(frequency, 0.0)
        top[frequency] = foot + 100 * float(row["weight"])
        colour = AXIS_COLOURS[int(row["axis"])]
        axes.plot([frequency] * 2, [foot, top[frequency]], color=colour, linewidth=1.2)
        axes.plot(frequency, top[frequency], "o", color=colour, markersize=3)
    axes.set_xscale("log")
    axes.set_xlim(0.95, 63)
    axes.set_xticks([1, 2, 5, 10, 20, 50])
    plain_numbers(axes.xaxis)
    axes.set_ylim(bottom=0)
    axes.set_ylabel("share of time ×\nshare of power (%)")


def draw_comparison(folder, comparison, robustness):
    if not comparison or not robustness:
        return
    figure, panels = plt.subplots(1, 3, figsize=(11.5, 3.9), layout="constrained",
                                  gridspec_kw={"width_ratios": [1.25, 1, 1.25]})
    draw_designs(panels[0], comparison)
    draw_limits(panels[1], comparison)
    draw_robustness(panels[2], robustness)
    note(figure, ASSUMED + " Equal time and reference power; 7920 positions.", y=-0.02)
    save(folder, figure, "spectrum_comparison")


def draw_designs(axes, rows):
    chosen = [row for row in rows if unlimited(row)]
    chosen.sort(key=lambda row: -float(row["covariance"]))
    flat = float(chosen[0]["covariance"])
    for k, row in enumerate(reversed(chosen)):
        value = float(row["covariance"])
        dots(axes, [k], [value], COLOURS[row["design"]])
        gain = "" if row["design"] == "flat" else f", {flat / value:.0f}× less"
        axes.annotate(f"{value:#.2g}{gain}", (value, k), xytext=(6, 5), textcoords="offset points", fontsize=8)
    axes.set_yticks(range(len(chosen)), [NAMES[row["design"]] for row in reversed(chosen)],
                    fontsize=8)
    axes.set_xscale("log")
    axes.set_xlim(0.004, 3)
    axes.grid(axis="y", visible=False)
    axes.set_xlabel(r"covariance $(\det H^{-1})^{1/d}$")
    axes.set_title("Choosing both saves most")


def draw_limits(axes, rows):
    joint = sorted((row for row in rows if row["design"] == "joint"),
                   key=lambda row: float(row["position_limit"]))
    best = float(joint[-1]["covariance"])
    axes.plot([100 * float(row["position_limit"]) for row in joint],
              [float(row["covariance"]) / best for row in joint], "o-", color=BLUE, markersize=4)
    axes.set_xscale("log")
    axes.set_xticks([0.5, 1, 2, 5, 10, 20, 100])
    plain_numbers(axes.xaxis)
    axes.set_xlabel("most time in any position (%)")
    axes.set_ylabel("covariance over that without limit")
    axes.set_title("Spreading the time costs little")


EXACT = 0.5  # where a deviation of zero is drawn, apart from the logarithmic axis


def draw_robustness(axes, rows):
    for name in ("flat", "two_step", "blocks_first", "joint"):
        mine = [row for row in rows if row["design"] == name and unlimited(row)]
        known = [row for row in mine if float(row["deviation"]) == 0]
        mine = [row for row in mine if float(row["deviation"]) > 0]
        x = [100 * float(row["deviation"]) for row in mine]
        axes.plot(x, [float(row["covariance_median"]) for row in mine], "o-", markersize=3,
                  color=COLOURS[name], label=NAMES[name].replace("\n", " "))
        axes.plot(x, [float(row["covariance_worst"]) for row in mine], ":", color=COLOURS[name])
        axes.plot([EXACT] * len(known), [float(row["covariance_median"]) for row in known], "D", ms=4, mfc="white",
                  color=COLOURS[name])
    axes.plot([], [], ":", color=BLACK, label=f"worst of {mine[-1]['samples']} draws")
    axes.set_xscale("log")
    axes.set_xticks([EXACT, 1, 3, 10, 30, 50], ["none", "1", "3", "10", "30", "50"])
    axes.minorticks_off()
    axes.axvline(0.7, ymax=0.68, color=GREY, lw=0.8, ls=(0, (1, 2)))
    axes.set_xlim(0.35, 60)
    axes.set_yscale("log")
    axes.set_ylim(top=3000)
    axes.set_xlabel("true stiffness differs by up to (%)")
    axes.set_ylabel(r"covariance $(\det H^{-1})^{1/d}$, median")
    axes.legend(fontsize=7.5, loc="upper left", ncol=1)
    axes.set_title("The gain presumes known resonances")
