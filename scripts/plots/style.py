"""What all figures share: colours, type, number formats, and how they are saved."""

import csv
import math

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402
from matplotlib.ticker import FuncFormatter  # noqa: E402

# Colours that colour-blind readers can tell apart (Okabe and Ito 2008).
BLACK, ORANGE, SKY, GREEN, BLUE, VERMILION, PURPLE, GREY = (
    "#000000", "#D98E00", "#3A9BD9", "#009E73", "#0072B2", "#D55E00", "#CC79A7", "#777777")

plt.rcParams.update({
    "font.size": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.titlelocation": "left",
    "axes.titlesize": 10.5,
    "axes.grid": True,
    "grid.color": "#e4e4e4",
    "grid.linewidth": 0.6,
    "legend.frameon": False,
    "svg.hashsalt": "graybox",
})


def read_table(file):
    """The rows of a CSV file as dictionaries; none if there is no such file."""
    if not file.exists():
        return []
    with open(file, encoding="utf-8", newline="") as stream:
        return list(csv.DictReader(stream))


def save(folder, figure, name):
    """Writes FOLDER/figures/NAME.svg and .png; the same data give the same bytes."""
    target = folder / "figures"
    target.mkdir(exist_ok=True)
    for suffix, options in (("svg", {"metadata": {"Date": None}}), ("png", {"dpi": 150})):
        figure.savefig(target / f"{name}.{suffix}", bbox_inches="tight", **options)
    plt.close(figure)
    print(f"wrote {target / name}.svg and .png")


def power_of_ten(exponent):
    return f"$10^{{{exponent}}}$"


def scientific(value):
    if value <= 0 or not math.isfinite(value):
        return "-"
    exponent = math.floor(math.log10(value) + 1e-9)
    mantissa = value / 10**exponent
    return power_of_ten(exponent) if abs(mantissa - 1) < 0.05 else f"{mantissa:.1f}·" + power_of_ten(exponent)


def seconds_axis(axes, which="y"):
    axis = axes.yaxis if which == "y" else axes.xaxis
    names = {1e-6: "1 µs", 1e-5: "10 µs", 1e-4: "0.1 ms", 1e-3: "1 ms", 1e-2: "10 ms", 1e-1: "0.1 s",
             1.0: "1 s", 10.0: "10 s", 100.0: "100 s", 1e3: "1000 s", 1e4: "10 000 s"}
    axis.set_major_formatter(FuncFormatter(
        lambda value, _: next((text for at, text in names.items() if math.isclose(at, value)), "")))
    axis.set_minor_formatter(FuncFormatter(lambda *_: ""))


def spread_labels(axes, labels, x, minimum=0.030, fontsize=8):
    """Writes labels [(y, text, colour, weight)] in a column at x (axes fraction), pushed apart so
    that none overlap, each joined to its y by a thin line from the last data point."""
    transform = axes.transData
    to_axes = axes.transAxes.inverted()
    items = []
    for (data_x, data_y), text, colour, weight in labels:
        at = to_axes.transform(transform.transform((data_x, data_y)))
        items.append([at[1], at[0], at[1], text, colour, weight])
    items.sort(key=lambda item: round(item[0], 6))
    for _ in range(400):  # push neighbours apart, a little at a time
        moved = False
        for low, high in zip(items, items[1:]):
            lack = minimum - (high[0] - low[0])
            if lack > 1e-6:
                low[0] -= lack / 2
                high[0] += lack / 2
                moved = True
        if not moved:
            break
    # Keep the column inside the axes where it fits.
    if items and items[-1][0] - items[0][0] <= 1.0:
        shift = max(0.0, items[-1][0] - 1.0) - max(0.0, -items[0][0])
        for item in items:
            item[0] -= shift
    for y, point_x, point_y, text, colour, weight in items:
        axes.annotate(text, xy=(point_x, point_y), xycoords="axes fraction", xytext=(x, y),
                      textcoords="axes fraction", color=colour, fontsize=fontsize, fontweight=weight,
                      va="center", annotation_clip=False,
                      arrowprops={"arrowstyle": "-", "color": colour, "lw": 0.5, "alpha": 0.6,
                                  "relpos": (0, 0.5), "shrinkA": 1, "shrinkB": 3})
