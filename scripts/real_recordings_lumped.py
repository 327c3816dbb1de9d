#!/usr/bin/env python3
"""Single axes on real recordings: fits the ladder of models of each system with `graybox fit` and
writes the error that is left beside the figures measured by hand or published.

    GRAYBOX_RECORDINGS=folder scripts/real_recordings_lumped.py GRAYBOX SCRATCH > table.csv

`ratio` is ours over the reference: 1 equal, below 1 better.
"""
import pathlib
import sys

import recordings_table
from recordings_table import campaigns, root

graybox, scratch = sys.argv[1], pathlib.Path(sys.argv[2])
models = root / "diagnosis/models"
physics = root / "docs/examples/fit/physics"


def fit(model, campaign, extra, *options):
    return recordings_table.fit(graybox, models / f"{model}.yaml", campaign, [extra] if extra else [],
                                "--starts", "3", "--threads", "2", *options)


def scores(answer):
    """(rms, nrmse) of each recording, in the order of the campaign's files."""
    return [(run["score"]["rms"][0], run["score"]["nrmse"][0])
            for run in answer["details"]["recordings"]]


def silverbox():
    ladder = [("linear", "silverbox_offset", 7.18, 14.5),
              ("+ cubic spring", "silverbox_cubic", 0.32, 0.38),
              ("+ growing damping", "silverbox_damping", 0.26, 0.38)]
    for model, name, multisine, arrow in ladder:
        answer = fit("silverbox", campaigns / "silverbox.yaml", physics / f"{name}.yaml")
        (_, (test, _), (beyond, _)) = scores(answer)
        yield "Silverbox", model, "test", "rms error [mV]", 1e3 * test, multisine
        yield "Silverbox", model, "arrow", "rms error [mV]", 1e3 * beyond, arrow
    for hold, reference in (("zero", 13.2), ("first", 0.90)):
        campaign = scratch / f"silverbox_{hold}.yaml"
        text = (campaigns / "silverbox.yaml").read_text()
        campaign.write_text(text.replace("hold: band_limited", f"hold: {hold}"))
        answer = fit("silverbox", campaign, physics / "silverbox_cubic.yaml")
        yield ("Silverbox", f"+ cubic spring, {hold}-order hold", "test", "rms error [mV]",
               1e3 * scores(answer)[1][0], reference)


def equation_error(answer):
    """The estimate after a filter of 50 Hz."""
    (start,) = (s for s in answer["details"]["equation_error"] if s["origin"].endswith(" 50 Hz"))
    return start


def emps():
    """Parameters of the equation error, simulated unfitted; then the offset, then all, in free run."""
    ladder = [("mass", None, 4414, 4435), ("+ viscous", "emps_viscous", 95, 96),
              ("+ Coulomb", "emps_coulomb", 170, 184)]
    campaign = campaigns / "emps_free_run.yaml"
    for model, name, train, pulses in ladder:
        answer = fit("emps", campaign, name and physics / f"{name}.yaml", "--initial-state", "rest")
        start = equation_error(answer)
        yield ("EMPS free run", model, "train", "rms error [mm]",
               1e3 * start["estimation"]["rms"][0], train)
        yield ("EMPS free run", model, "pulses", "rms error [mm]",
               1e3 * start["validation"]["rms"][0], pulses)
    answer = fit("emps", campaign, physics / "emps_offset.yaml", "--initial-state", "rest")
    (train, _), (pulses, _) = scores(answer)
    yield "EMPS free run", "+ offset, all refitted", "train", "rms error [mm]", 1e3 * train, 2.7
    yield "EMPS free run", "+ offset, all refitted", "pulses", "rms error [mm]", 1e3 * pulses, 4.6


def friction_damper():
    ladder = [("linear", "damper_offset", 47.8, 97.0), ("+ Coulomb", "damper_coulomb", 45.6, 78.5),
              ("+ Bouc-Wen", "damper_bouc_wen", 21.5, 29.0),
              ("+ play and slip", "damper_play", 11.6, 22.3)]
    for model, name, train, test in ladder:
        answer = fit("friction_damper", campaigns / "friction_damper.yaml", physics / f"{name}.yaml")
        (_, ours), (_, held_out) = scores(answer)
        yield "Friction damper", model, "train", "NRMSE [%]", ours, train
        yield "Friction damper", model, "test", "NRMSE [%]", held_out, test


def friction_damper_set_3():
    ladder = [("linear", "damper_offset", 58.5), ("+ play and slip", "damper_play", 17.1)]
    for model, name, test in ladder:
        answer = fit("friction_damper", campaigns / "friction_damper_set_3.yaml",
                     physics / f"{name}.yaml")
        yield ("Friction damper, set 3", model, "test", "NRMSE [%]", scores(answer)[1][1],
               test)


def kr300_encoders():
    """Errors of the angle behind the gear, over the deviation of what the two encoders differ by. Their
    zeros differ from recording to recording, so errors are counted from their mean."""
    ladder = [("+ time skew", "encoder_skew"), ("+ compliance", "encoder_compliance")]
    references = {3: [(15.7, 25, 12), (7.5, 9.2, 10.2)], 1: [(), ()]}

    def deviations(answer):
        return [run["score"]["deviation"][0] for run in answer["details"]["recordings"]]

    for axis, rows in references.items():
        campaign = campaigns / f"kr300_axis_{axis}.yaml"
        twist = deviations(fit("two_encoders", campaign, None))
        for (model, name), reached in zip(ladder, rows):
            answer = fit("two_encoders", campaign, physics / f"{name}.yaml")
            values = {each["name"]: each["value"] for each in answer["parameters"]}
            for k, split in enumerate("ABC"):
                yield (f"KR300 encoders, axis {axis}", model, split, "NRMSE of the twist [%]",
                       100 * deviations(answer)[k] / twist[k], reached[k] if reached else None)
            if axis == 3 and model == "+ time skew":
                yield ("KR300 encoders, axis 3", model, "A", "time skew [ms]",
                       1e3 * values["skew.time"], 3.0)
            if axis == 3 and model == "+ compliance":
                yield ("KR300 encoders, axis 3", model, "A", "stiffness [N m/rad]",
                       -1 / values["compliance.gain"], 7.6e6)


def cogging_motor():
    ladder = [("constant", None, 100.0), ("+ 4 harmonics", "motor_4_harmonics", 30.0),
              ("+ 10 harmonics", "motor_10_harmonics", 18.6)]
    for model, name, test in ladder:
        answer = fit("cogging_motor", campaigns / "cogging_motor.yaml",
                     name and physics / f"{name}.yaml")
        yield "Cogging motor", model, "test", "NRMSE [%]", scores(answer)[1][1], test


recordings_table.write((silverbox(), emps(), friction_damper(), friction_damper_set_3(), kr300_encoders(),
                        cogging_motor()))
