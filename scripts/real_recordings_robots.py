#!/usr/bin/env python3
"""Rigid robots on real recordings: fits the ladder of models of each machine with `graybox fit` and
writes what is left of the torques beside the figures measured by hand or published.

    GRAYBOX_RECORDINGS=folder scripts/real_recordings_robots.py GRAYBOX SCRATCH > table.csv

`ratio` is ours over the reference: 1 equal, below 1 better.
"""
import pathlib
import sys

import recordings_table
from recordings_table import campaigns, root

graybox, scratch = sys.argv[1], pathlib.Path(sys.argv[2])
rigid = root / "docs/examples/rigid"


def fit(name, campaign, physics, *options):
    return recordings_table.fit(graybox, rigid / f"{name}.yaml", campaign,
                                [rigid / f"{each}.yaml" for each in physics], *options)


def total(answer, role):
    """|error| / |torque| in percent over the records of a role."""
    (record,) = (r for r in answer["details"]["records"] if r["role"] == role)
    return record["total"]["relative_error"]


def nrmse(record, joint):
    return record["joints"][joint]["nrmse"]


def value(answer, name):
    return next(p["value"] for p in answer["parameters"] if p["name"] == name)


def emps():
    """Dry friction jumps: columns and force go through one filter instead of being decimated apart."""
    campaign = campaigns / "emps_all_samples.yaml"
    ladder = [("mass", [], 69.3, 67.1),
              ("+ viscous", ["emps_viscous"], 17.8, 17.7),
              ("+ Coulomb", ["emps_coulomb"], 7.11, 8.26),
              ("+ offset", ["emps_offset"], 4.04, 6.09),
              ("+ asymmetric viscous", ["emps_asymmetric"], 3.06, 5.49)]
    physics = []
    for model, added, train, pulses in ladder:
        physics += added
        used = physics if model != "+ asymmetric viscous" else physics[1:]
        answer = fit("emps", campaign, used, "--decimate", "10")
        yield "EMPS", model, "train", "relative error [%]", total(answer, "estimation"), train
        yield "EMPS", model, "pulses", "relative error [%]", total(answer, "validation"), pulses
        if model != "+ offset":
            continue
        for name, published in (("M1", 95.1089), ("viscous.damping", 203.5034),
                                ("coulomb.level", 20.3935), ("offset.value", -3.1648)):
            yield "EMPS", model, "train", name, value(answer, name), published


def tx40():
    ladder = [("rigid, rotors", [], 80.4),
              ("+ viscous", ["viscous"], 21.4),
              ("+ Coulomb", ["coulomb"], 15.9),
              ("+ offset", ["offset"], 15.5),
              ("+ wrist coupling", ["tx40_coupling"], 8.0),
              ("+ root-speed friction", ["sublinear"], 6.3)]
    physics = []
    for model, added, test in ladder:
        physics += added
        answer = fit("tx40", campaigns / "tx40.yaml", physics)
        yield "TX40", model, "test", "relative error, total [%]", total(answer, "validation"), test
        if model != "+ wrist coupling":
            continue
        yield from tx40_wrist(answer, physics)


def tx40_wrist(answer, physics):
    """The wrist's own figures; its parameters from the first part and from the whole trajectory, whose
    motion tells the rotor's inertia better."""
    model = "+ wrist coupling"
    record = answer["details"]["records"][-1]
    for joint, reached in ((4, 18.2), (5, 16.2)):
        yield ("TX40", model, "test", f"relative error, axis {joint + 1} [%]",
               record["joints"][joint]["relative_error"], reached)
    everything = scratch / "tx40_all.yaml"
    everything.write_text((campaigns / "tx40.yaml").read_text().replace("    role: validation\n", ""))
    for split, fitted in (("train", answer), ("train and test", fit("tx40", everything, physics))):
        for name, published in (("coupled_inertia.inertia", 0.00964),
                                ("coupled_viscous.damping", 0.616), ("coupled_coulomb.level", 1.95)):
            yield "TX40", model, split, name, value(fitted, name), published


def kr300():
    """The first two rows fit the payload to all three trajectories, as their references do. The last takes
    the encoders' noise from the accelerations and refines the velocities at which dry friction sets in."""
    everything = scratch / "kr300_all.yaml"
    everything.write_text((campaigns / "kr300.yaml").read_text().replace(", role: validation", ""))
    low_passed = scratch / "kr300_low_passed.yaml"
    low_passed.write_text((campaigns / "kr300.yaml").read_text().replace(
        "experiments:", "preprocess: [{kind: low_pass, frequency: 20}]\nexperiments:"))
    friction = [f"--refine=coulomb_{joint}.transition_velocity" for joint in range(1, 7)]
    ladder = [("rigid, payload fitted to A, B, C", everything, ["payload"], (142, 100.5, 99.5)),
              ("+ friction", everything, ["payload", "viscous", "coulomb"], (126, 81, 73)),
              ("+ offset, fitted to A", campaigns / "kr300.yaml",
               ["payload", "viscous", "coulomb", "offset"], (65, 132, 159)),
              ("+ counterbalance, fitted to A", campaigns / "kr300.yaml",
               ["payload", "viscous", "coulomb", "kr300_balancer"], (28, 33, 52)),
              ("+ low-pass, onset of friction refined", low_passed,
               ["payload", "viscous", "coulomb", "kr300_balancer"], (28, 33, 52))]
    for model, campaign, physics, references in ladder:
        refine = friction if campaign == low_passed else []
        answer = fit("kr300", campaign, physics, "--equal-noise", *refine)
        for record, split, reference in zip(answer["details"]["records"], "ABC", references):
            yield "KR300", model, split, "NRMSE, axis 2 [%]", nrmse(record, 1), reference


recordings_table.write((emps(), tx40(), kr300()))
