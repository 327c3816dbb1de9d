"""What `graybox design verify` found: is the estimator as precise as H^-1 says, and does the design pay?"""

import matplotlib.pyplot as plt

from style import ASSUMED, BLACK, BLUE, GREEN, GREY, ORANGE, VERMILION, note, read_table, save

DATA = (("responses", BLUE, "o"), ("recordings", ORANGE, "s"))


def readable(parameter):
    """joint_2.bearing_x -> joint 2 bearing x"""
    return parameter.replace("joint_", "joint ").replace(".", " ").replace("_", " ")


def interval(axes, y, row, names, colour, marker, label=None):
    value, low, high = (float(row[name]) for name in names)
    axes.errorbar(value, y, xerr=[[value - low], [high - value]], fmt=marker, ms=4, color=colour,
                  elinewidth=1.2, capsize=2, label=label)


def parameter_axis(axes, labels):
    axes.set_yticks(range(len(labels)))
    axes.set_yticklabels(labels)
    axes.set_ylim(len(labels) - 0.4, -0.6)
    axes.grid(axis="y", visible=False)


def counts(covariance, design):
    return {row["data"]: int(row["estimates"]) for row in covariance if row["design"] == design}


def efficiency_panel(axes, covariance, parameters, design):
    estimates = counts(covariance, design)
    labels = None
    for k, (data, colour, marker) in enumerate(DATA):
        whole = [row for row in covariance if row["data"] == data and row["design"] == design]
        single = [row for row in parameters if row["data"] == data and row["design"] == design]
        if not whole:
            continue
        labels = ["all: (det)$^{1/d}$"] + [readable(row["parameter"]) for row in single]
        shift = 0.15 * (2 * k - 1)
        kind = "fits of frequency responses" if data == "responses" else "simulated campaigns"
        interval(axes, shift, whole[0], ("determinant", "determinant_lower", "determinant_upper"),
                 colour, marker, f"{estimates[data]} {kind}")
        for p, row in enumerate(single):
            interval(axes, p + 1 + shift, row,
                     ("variance_ratio", "variance_ratio_lower", "variance_ratio_upper"), colour, marker)
    axes.axvline(1, color=BLACK, lw=1)
    axes.axhline(0.5, color=GREY, lw=0.6)
    parameter_axis(axes, labels)
    axes.set_xlabel("covariance of the estimates over the predicted one, 95 % intervals")
    axes.set_title("How the estimates scatter")
    axes.legend(fontsize=7.5, loc="upper right", bbox_to_anchor=(1.0, -0.12), ncols=2)


def gain_panel(axes, ratios, design):
    labels = None
    for k, (data, colour, marker) in enumerate(DATA):
        rows = [row for row in ratios if row["data"] == data and row["design"] == design]
        if not rows:
            continue
        labels = ["all: (det)$^{1/d}$"] + [readable(row["quantity"]) for row in rows[1:]]
        for p, row in enumerate(rows):
            shift = 0.15 * (2 * k - 1)
            predicted = float(row["predicted"])
            axes.plot([predicted, predicted], [p + shift - 0.14, p + shift + 0.14], color=BLACK, lw=2,
                      label="predicted" if k == 0 and p == 0 else None)
            kind = "frequency responses" if data == "responses" else "campaigns"
            interval(axes, p + shift, row, ("measured", "lower", "upper"), colour, marker,
                     f"measured, {kind}" if p == 0 else None)
    axes.axvline(1, color=GREY, lw=0.8)
    axes.axhline(0.5, color=GREY, lw=0.6)
    axes.set_xscale("log")
    axes.xaxis.set_major_formatter(plt.FuncFormatter(lambda value, _: f"{value:g}"))
    axes.set_xticks([0.5, 1, 2, 5, 10, 30, 100, 300, 1000, 3000])
    axes.minorticks_off()
    parameter_axis(axes, labels)
    axes.set_xlabel("covariance in the best single position over that of the design")
    axes.set_title("The design pays what it promises")
    axes.legend(fontsize=7.5, loc="upper right", bbox_to_anchor=(1.0, -0.12), ncols=3)


def scatter_panel(axes, estimates):
    names = [name for name in estimates[0] if name not in ("data", "design")]
    x, y = names[0], names[1]
    colours = {"best_single_position": VERMILION, "random_positions": GREY}
    designs = list(dict.fromkeys(row["design"] for row in estimates))
    of = {design: [row for row in estimates if row["design"] == design and row["data"] == "responses"] for design in designs}
    fewest = min(len(rows) for rows in of.values())
    for design in reversed(designs):  # the design itself on top
        colour = colours.get(design, GREEN)
        rows = of[design][:fewest]  # as many of each
        axes.plot([100 * (float(row[x]) - 1) for row in rows], [100 * (float(row[y]) - 1) for row in rows],
                  ".", ms=3.5, color=colour, alpha=0.7, label=design.replace("_", " "))
    axes.axhline(0, color=BLACK, lw=0.6)
    axes.axvline(0, color=BLACK, lw=0.6)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel(f"{readable(x)}: estimate − truth (%)")
    axes.set_ylabel(f"{readable(y)}: estimate − truth (%)")
    axes.set_title(f"Same number of experiments: {fewest} fits each")
    axes.legend(fontsize=7.5, markerscale=3)


def draw(folder):
    tables = folder / "tables"
    covariance = read_table(tables / "verify_covariance.csv")
    parameters = read_table(tables / "verify_parameters.csv")
    ratios = read_table(tables / "verify_ratios.csv")
    estimates = read_table(tables / "verify_estimates.csv")
    if not covariance or not ratios or not estimates:
        return
    figure, panels = plt.subplots(1, 3, figsize=(14.5, 4.6), width_ratios=[1.1, 1.1, 1])
    efficiency_panel(panels[0], covariance, parameters, covariance[0]["design"])
    gain_panel(panels[1], ratios, "best_single_position")
    scatter_panel(panels[2], estimates)
    figure.tight_layout(w_pad=2)
    note(figure, ASSUMED + " 95 % intervals.", y=0.02)
    save(folder, figure, "verified_design")
