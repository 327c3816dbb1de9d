"""What all figures share: colours, type, number formats, and how they are saved."""

import csv
import math
import re

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402
from matplotlib.container import BarContainer  # noqa: E402
from matplotlib.ticker import FuncFormatter  # noqa: E402

# Colours near those of Okabe and Ito (2008), moved until any two are 21 or more apart (CIE76) in normal, deuteranope
# and protanope sight, and each has a contrast of 3 or more on white (tests/figure_style_test.py).
BLACK, ORANGE, SKY, GREEN, BLUE, VERMILION, PURPLE, GREY = (
    "#000000", "#D57F01", "#3498DA", "#24A36B", "#2358A5", "#B34000", "#CE78A6", "#646464")
COLOURS = (BLACK, ORANGE, SKY, GREEN, BLUE, VERMILION, PURPLE, GREY)

ASSUMED = "IRB 6600-like robot; its stiffness, damping, motors and controller are assumed."

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


def refuse_bars_without_zero(figure):
    """The length of a bar says something only from zero on, which a logarithmic axis has not: use dots()."""
    for axes in figure.axes:
        for container in axes.containers:
            if not isinstance(container, BarContainer) or not container.patches:
                continue
            scale = axes.get_xscale() if container.orientation == "horizontal" else axes.get_yscale()
            if scale not in ("linear", "symlog"):
                raise ValueError(f"bars on a {scale} axis, which has no zero: draw dots")


# Half of the 95 % interval of an exponent that a title may state.
LARGEST_HALF_INTERVAL = 0.3


def growth(name, exponent, half, symbol="Q"):
    """'NAME as Q^0.98' for a title, or None where the exponent is not known well enough to be claimed."""
    if not half <= LARGEST_HALF_INTERVAL:  # NaN is no interval
        return None
    return f"{name} as ${symbol}^{{{exponent:.2f}}}$ (±{half:.2f})"


def refuse_unbounded_exponents(figure):
    """A power of Q in a title stands beside its interval, as growth() writes it."""
    titles = [axes.get_title(loc) for axes in figure.axes for loc in ("left", "center", "right")]
    titles += [text.get_text() for text in figure.texts]  # the title of all among them
    for title in titles:
        for power in re.finditer(r"\$[A-Za-z]\^\{-?[0-9.]+\}\$", title):
            bound = re.match(r" \(±([0-9.]+)\)", title[power.end():])
            if bound is None or float(bound[1]) > LARGEST_HALF_INTERVAL:
                raise ValueError(f"'{title}' claims an exponent without an interval of ±{LARGEST_HALF_INTERVAL} or less")


# Curves of one panel that a reader can tell apart.
MOST_CURVES = 8


def refuse_crowds(figure):
    """At most MOST_CURVES looks (colour, line, mark) among the curves of a panel."""
    for axes in figure.axes:
        looks = {(line.get_color(), line.get_linestyle(), line.get_marker())
                 for line in axes.get_lines() if len(line.get_xdata()) > 2}
        if len(looks) > MOST_CURVES:
            raise ValueError(f"{len(looks)} kinds of curves in a panel; {MOST_CURVES} can be told apart")


def refuse_brackets(figure):
    """Units stand in round brackets on every axis, as in 'frequency (Hz)'."""
    for axes in figure.axes:
        for label in (axes.get_xlabel(), axes.get_ylabel()):
            if "[" in label.replace("$[", ""):
                raise ValueError(f"'{label}': write the unit in round brackets")


def note(figure, text, y=0.0, x=0.01):
    """What was measured, on what and how often, below the figure."""
    figure.text(x, y, text, fontsize=7.5, color="#555555", va="top")


def dots(axes, places, values, colour, label=None, marker="o"):
    """What bars would show, on an axis without zero; each dot hangs on a thin line across the axes."""
    for place in places:
        axes.axhline(place, color="#e4e4e4", lw=0.8, zorder=0)
    axes.plot(values, places, marker, color=colour, ms=5.5, mec="white", mew=0.5, label=label, zorder=4)


def save(folder, figure, name):
    """Writes FOLDER/figures/NAME.svg and .png; the same data give the same bytes."""
    refuse_bars_without_zero(figure)
    refuse_unbounded_exponents(figure)
    refuse_crowds(figure)
    refuse_brackets(figure)
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
