"""Sequential design: parameter error, design efficiency and estimates, stage by stage."""

import matplotlib.pyplot as plt
import numpy as np

from style import ASSUMED, BLACK, BLUE, GREEN, GREY, VERMILION, note, read_table, save

STRATEGIES = (("random", GREY, "random positions"), ("fixed", VERMILION, "designed for the wrong start"),
              ("sequential", BLUE, "sequential"), ("oracle", GREEN, "designed for the truth"))


def stages(rows, strategy, first):
    chosen = [row for row in rows if row["strategy"] == strategy and int(row["stage"]) >= first]
    return sorted(chosen, key=lambda row: int(row["stage"]))


def spread(axes, rows, strategy, colour, label, quantity, scale, first):
    chosen = stages(rows, strategy, first)
    experiments = [int(row["experiments"]) for row in chosen]
    axes.plot(experiments, [scale * float(row[quantity + "_median"]) for row in chosen], "o-", ms=3.5,
              color=colour, label=label)
    axes.fill_between(experiments,
                      [scale * float(row[quantity + "_lower_quartile"]) for row in chosen],
                      [scale * float(row[quantity + "_upper_quartile"]) for row in chosen],
                      color=colour, alpha=0.18, lw=0)


def root_mean_square(values):
    return float(np.sqrt(np.mean(np.square(values))))


def over_repetitions(rows, strategy, quantity, first):
    """(experiments, rms over repetitions, its 2.5 and 97.5 % by resampling them) of each stage. The rms is what a
    Cramér-Rao bound is for; the median of the same errors is smaller."""
    random = np.random.default_rng(1)
    stage_of = {}
    for row in rows:
        if row["strategy"] == strategy and int(row["stage"]) >= first:
            stage_of.setdefault(int(row["experiments"]), []).append(float(row[quantity]))
    result = []
    for experiments, values in sorted(stage_of.items()):
        drawn = [root_mean_square(random.choice(values, len(values))) for _ in range(2000)]
        result.append((experiments, root_mean_square(values), *np.percentile(drawn, (2.5, 97.5))))
    return np.array(result)


def error_panel(axes, summary, rows):
    for strategy, colour, label in STRATEGIES:
        spread(axes, summary, strategy, colour, label, "parameter_error", 100, 0)
    oracle = over_repetitions(rows, "oracle", "parameter_error", 1)
    middle = 100 * oracle[:, 1]
    axes.errorbar(oracle[:, 0], middle, yerr=[middle - 100 * oracle[:, 2], 100 * oracle[:, 3] - middle], fmt="D",
                  mfc="white", mec=GREEN, ecolor=GREEN, ms=4, lw=0.9, label="the same, rms of all repetitions")
    bound = over_repetitions(rows, "oracle", "expected_error", 1)
    axes.plot(bound[:, 0], 100 * bound[:, 1], "--", lw=1, color=BLACK,
              label="Cramér–Rao bound of that rms")
    axes.set_yscale("log")
    axes.yaxis.set_major_formatter(plt.FuncFormatter(lambda value, _: f"{value:g}"))
    axes.set_ylabel("rms error of all parameters (%); median, quartiles")
    axes.set_title("The error falls from 40 % to the bound …")
    axes.legend(fontsize=7)


def efficiency_panel(axes, rows):
    for strategy, colour, _ in STRATEGIES:
        spread(axes, rows, strategy, colour, None, "design_efficiency", 1, 1)
    axes.set_ylim(0, 1.03)
    axes.set_ylabel("D-efficiency at the truth, all experiments so far")
    axes.set_title("… because redesign makes experiments count")


def estimate_panel(axes, rows):
    """How far the estimates are off, stage by stage: quantiles of all stiffnesses of all repetitions."""
    names = [name for name in rows[0] if name.startswith("theta_")]
    stage_of = {}
    for row in rows:
        if row["strategy"] == "sequential":
            stage_of.setdefault(int(row["experiments"]), []).extend(100 * abs(float(row[name]) - 1) for name in names)
    experiments = sorted(stage_of)
    quantiles = np.array([np.percentile(stage_of[at], (5, 25, 50, 75, 95)) for at in experiments])
    axes.fill_between(experiments, quantiles[:, 0], quantiles[:, 4], color=BLUE, alpha=0.12, lw=0, label="5 to 95 %")
    axes.fill_between(experiments, quantiles[:, 1], quantiles[:, 3], color=BLUE, alpha=0.25, lw=0, label="25 to 75 %")
    axes.plot(experiments, quantiles[:, 2], "o-", ms=3.5, color=BLUE, label="median")
    axes.set_yscale("log")
    axes.yaxis.set_major_formatter(plt.FuncFormatter(lambda value, _: f"{value:g}"))
    axes.set_ylabel("|estimate − truth| of one stiffness (%)")
    axes.set_title("Single stiffnesses, sequential design")
    axes.legend(fontsize=7)


def draw(folder):
    summary = read_table(folder / "tables" / "sequential_summary.csv")
    rows = read_table(folder / "tables" / "sequential.csv")
    if not summary or not rows:
        return
    figure, panels = plt.subplots(1, 3, figsize=(13.5, 4.1))
    error_panel(panels[0], summary, rows)
    efficiency_panel(panels[1], summary)
    estimate_panel(panels[2], rows)
    for axes in panels:
        axes.set_xlabel("experiments")
    figure.tight_layout(w_pad=2)
    note(figure, ASSUMED + f" {len({row['repetition'] for row in rows})} simulated repetitions of 12 stiffnesses. "
         "A Cramér–Rao bound holds for the rms over repetitions (diamonds, 95 % by resampling); a median of errors may lie below.")
    save(folder, figure, "sequential_design")
