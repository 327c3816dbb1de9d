"""Frequency responses with their regions of 95 % beside the truth, noise and distortion, coverage."""

import math

import matplotlib.pyplot as plt

from style import ASSUMED, BLACK, BLUE, GREEN, GREY, ORANGE, PURPLE, VERMILION, note, read_table, save

OUTPUT = "y_1"


def of_output(rows, output=OUTPUT):
    return sorted((row for row in rows if row["output"] == output),
                  key=lambda row: float(row["frequency_hz"]))


def column(rows, name):
    return [float(row[name]) if row[name] else math.nan for row in rows]


def magnitude(rows):
    return [math.hypot(float(row["real"]), float(row["imaginary"])) for row in rows]


def hertz_axis(axes):
    axes.set_xscale("log")
    axes.set_xticks([1, 2, 5, 10, 20, 50])
    axes.xaxis.set_major_formatter(plt.FuncFormatter(lambda value, _: f"{value:g}"))
    axes.xaxis.set_minor_formatter(plt.FuncFormatter(lambda *_: ""))
    axes.set_xlabel("frequency (Hz)")


def response_panel(axes, single, truth):
    first = [row for row in single if row["realisation"] == "1"]
    frequency = column(of_output(first), "frequency_hz")
    for output, colour in (("y_1", BLUE), ("y_3", VERMILION), ("y_6", GREEN)):
        rows, true = of_output(first, output), of_output(truth, output)
        estimate, radius = magnitude(rows), column(rows, "radius_95")
        axes.fill_between(frequency, [max(g - r, 1e-12) for g, r in zip(estimate, radius)],
                          [g + r for g, r in zip(estimate, radius)], color=colour, alpha=0.25, lw=0)
        axes.plot(frequency, estimate, "o", ms=2.5, color=colour, label=f"joint {output[2]}, estimate")
        axes.plot(frequency, magnitude(true), "-", lw=0.8, color=colour)
    axes.plot([], [], "-", lw=0.8, color=GREY, label="lines: the truth, in the colour of its joint")
    axes.set_yscale("log")
    axes.set_ylabel("|G|, torque to velocity of one motor (rad/s per N m)")
    axes.set_title("Six recordings of 8 s: regions of 95 % are smaller than the dots")
    axes.legend(fontsize=7.5)


def error_panel(axes, single, truth):
    first = of_output([row for row in single if row["realisation"] == "1"])
    frequency, true = column(first, "frequency_hz"), of_output(truth)
    relative = []
    for row, exact in zip(first, true):
        g = complex(float(exact["real"]), float(exact["imaginary"]))
        relative.append(abs(complex(float(row["real"]), float(row["imaginary"])) - g) / abs(g))
    radius = [r / m for r, m in zip(column(first, "radius_95"), magnitude(true))]
    axes.plot(frequency, [100 * r for r in radius], "-", lw=1, color=BLACK, label="radius of the 95 % region")
    axes.plot(frequency, [100 * r for r in relative], "o", ms=3, color=BLUE, label="error")
    axes.set_yscale("log")
    axes.yaxis.set_major_formatter(plt.FuncFormatter(lambda value, _: f"{value:g}"))
    axes.set_ylabel("relative to |G| of joint 1 (%)")
    inside = sum(error <= r for error, r in zip(relative, radius))
    axes.set_title(f"Joint 1: the error lies inside its region at {inside} of {len(radius)} frequencies")
    axes.legend(fontsize=7.5)


def level_panel(axes, friction):
    rows = of_output(friction)
    frequency = column(rows, "frequency_hz")
    for name, colour, marker, label in (("output_level", BLACK, "-", "output"),
                                        ("total_level", ORANGE, "-", "noise and distortion (realisations)"),
                                        ("odd_level", VERMILION, "o", "silent odd lines, beyond the noise"),
                                        ("even_level", PURPLE, "^", "silent even lines, beyond the noise"),
                                        ("noise_level", GREY, "-", "noise (periods)")):
        axes.plot(frequency, column(rows, name), marker, ms=3, lw=1.2, color=colour, label=label)
    axes.set_yscale("log")
    axes.set_ylabel("velocity of motor 1, rms of one DFT line (rad/s)")
    axes.set_title("Hidden friction shows as distortion")
    axes.legend(fontsize=7.5)


def coverage_panel(axes, coverage):
    rows = [row for row in coverage if row["frequency_hz"] != "all"]
    total = next(row for row in coverage if row["frequency_hz"] == "all")
    axes.errorbar(column(rows, "frequency_hz"), [100 * x for x in column(rows, "share_inside")],
                  yerr=[200 * x for x in column(rows, "deviation")], fmt="o", ms=3, lw=0.8, color=BLUE,
                  label="share inside, ± 2 standard deviations")
    axes.axhline(95, color=BLACK, lw=0.8)
    axes.set_ylim(92, 98)
    axes.set_ylabel("regions that hold the truth (%)")
    axes.set_title(f"Nominal 95 %: {100 * float(total['share_inside']):.1f} % of "
                   f"{int(total['entries']):,} regions".replace(",", " "))
    axes.legend(fontsize=7.5, loc="lower right")


def draw(folder):
    tables = {name: read_table(folder / "tables" / f"responses_{name}.csv")
              for name in ("truth", "single", "friction", "coverage")}
    if not all(tables.values()):
        return
    figure, panels = plt.subplots(2, 2, figsize=(11.5, 8))
    response_panel(panels[0, 0], tables["single"], tables["truth"])
    error_panel(panels[0, 1], tables["single"], tables["truth"])
    level_panel(panels[1, 0], tables["friction"])
    coverage_panel(panels[1, 1], tables["coverage"])
    for axes in panels.flat:
        hertz_axis(axes)
    figure.tight_layout(h_pad=2, w_pad=2)
    note(figure, ASSUMED + " Simulated recordings.")
    save(folder, figure, "frequency_responses")
