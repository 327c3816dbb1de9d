"""Real recordings: what each model leaves unexplained, beside the figures of others."""

import matplotlib.pyplot as plt
from matplotlib.ticker import LogLocator

from style import BLACK, BLUE, GREEN, ORANGE, VERMILION, dots, read_table, save

# A panel of a figure shows the errors of one set; parameter values stay in the table.
SPLITS = ("train", "test", "pulses", "arrow", "A", "B", "C")
COLOURS = {"train": BLUE, "test": ORANGE, "pulses": VERMILION, "arrow": GREEN, "A": BLUE, "B": ORANGE, "C": GREEN}
MARKERS = {BLUE: "o", ORANGE: "s", VERMILION: "D", GREEN: "^"}


def panel(axes, rows, name):
    rows = [row for row in rows if row["set"] == name and row["split"] in COLOURS and "[" in row["figure"]]
    unit = rows[0]["figure"]
    rows = [row for row in rows if row["figure"] == unit]
    models = list(dict.fromkeys(row["model"] for row in rows))
    splits = [split for split in SPLITS if any(row["split"] == split for row in rows)]
    height = 0.8 / len(splits)
    errors = [float(row["ours"]) for row in rows]
    is_wide = max(errors) > 15 * min(errors)
    if is_wide:
        axes.set_xscale("log")
        axes.xaxis.set_major_formatter(plt.FuncFormatter(lambda value, _: f"{value:g}"))
        axes.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5) if max(errors) < 100 * min(errors) else (1,)))
        axes.xaxis.set_minor_formatter(plt.FuncFormatter(lambda *_: ""))
    for number, split in enumerate(splits):
        for row in (row for row in rows if row["split"] == split):
            y = models.index(row["model"]) + (number - (len(splits) - 1) / 2) * height
            dots(axes, [y], [float(row["ours"])], COLOURS[split], marker=MARKERS[COLOURS[split]])
            if not row["reference"]:
                continue
            axes.plot([float(row["reference"])] * 2, [y - 0.5 * height, y + 0.5 * height], color=BLACK, lw=1.8)
    axes.set_yticks(range(len(models)), models)
    axes.invert_yaxis()
    if not is_wide:
        axes.set_xlim(left=0)
    axes.set_xlabel(unit.replace("[", "(").replace("]", ")"))
    axes.set_title(name)
    axes.grid(axis="y", visible=False)


def legend(figure, splits):
    """One legend for all panels: a mark for each role of a recording."""
    names = {}
    for split in (split for split in SPLITS if split in splits):
        names.setdefault(COLOURS[split], []).append(split)
    handles = [plt.Line2D([], [], ls="", marker=MARKERS[colour], color=colour, label="graybox on " + ", ".join(of))
               for colour, of in names.items()]
    handles.append(plt.Line2D([], [], color=BLACK, lw=1.8, label="by hand or published"))
    figure.legend(handles=handles, fontsize=8, loc="lower left", ncols=len(handles))


def draw(folder):
    for file in sorted((folder / "tables").glob("real_recordings_*.csv")):
        rows = read_table(file)
        names = list(dict.fromkeys(row["set"] for row in rows))
        if not names:
            continue
        columns = min(2, len(names))
        lines = -(-len(names) // columns)
        figure, axes = plt.subplots(lines, columns, figsize=(6.4 * columns, 2.9 * lines), squeeze=False)
        for each in axes.flat[len(names):]:
            each.set_visible(False)
        for each, name in zip(axes.flat, names):
            panel(each, rows, name)
        figure.suptitle("Model by model, the error is about that which others reached by hand", x=0.01, ha="left", fontsize=11)
        figure.tight_layout(rect=(0, 0.03, 1, 0.99))
        legend(figure, {row["split"] for row in rows})
        save(folder, figure, file.stem)
