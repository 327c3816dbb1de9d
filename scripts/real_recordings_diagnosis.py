#!/usr/bin/env python3
"""Missing physics in real recordings: `graybox diagnose` with a naive model of each machine, with the whole
catalogue and with the laws taken out that belong to the machine.

    GRAYBOX_RECORDINGS=folder scripts/real_recordings_diagnosis.py GRAYBOX [SET ...] > table.csv

Errors are NRMSE in percent; `literature` is the error that others reached by hand on data kept out of the
fit, in their own measure (docs/explanation/real_machines_laws.md), and never used here. Seconds are of two threads.
"""
import csv
import json
import subprocess
import sys
import time

from recordings_table import campaigns, root

FRICTION = ["coulomb", "asymmetric_coulomb", "stribeck", "sublinear_friction", "viscous",
            "asymmetric_viscous", "quadratic_drag"]
MEMORY = ["dahl", "lugre", "bouc_wen", "play_and_slip"]
RIGID, LUMPED = root / "docs/examples/rigid", root / "diagnosis/models"
# set, model, campaign, laws taken out in the second run (none: no second run), the least error reached by hand, or
# what was measured by hand otherwise (docs/explanation/real_machines_laws.md has both)
SETS = [("EMPS", RIGID / "emps.yaml", "emps", FRICTION + MEMORY, 5.5),
        ("EMPS, any motion", LUMPED / "emps.yaml", "emps_free_run", FRICTION + MEMORY + ["load_dependent_friction"],
         "4.6 mm in free run"),
        ("Friction damper", RIGID / "friction_damper.yaml", "friction_damper", MEMORY, 22.3),
        ("Friction damper, any motion", LUMPED / "friction_damper.yaml", "friction_damper", MEMORY, 22.3),
        ("Cogging motor", RIGID / "cogging_motor.yaml", "cogging_motor", ["ripple"], 18.6),
        ("Cogging motor, current in time", RIGID / "cogging_motor.yaml", "cogging_motor_in_time",
         ["ripple"], "12.5 with ten harmonics"),
        ("TX40", RIGID / "tx40.yaml", "tx40", FRICTION + MEMORY, 6.3),
        ("KR300", RIGID / "kr300.yaml", "kr300", ["balancer"], "of axis 2 alone 33 and 52 %"),
        ("Silverbox", RIGID / "silverbox.yaml", "silverbox_force_balance", ["cubic_spring"],
         "0.26 to 0.38 mV in simulation, another measure"),
        ("Silverbox, any motion", LUMPED / "silverbox.yaml", "silverbox", ["cubic_spring"],
         "0.26 to 0.38 mV in simulation"),
        ("Two-mass bench", LUMPED / "two_masses.yaml", "two_masses", [], "34 % 0.1 s ahead"),
        ("UR10e", RIGID / "ur10e.yaml", "ur10e", FRICTION + MEMORY, "of joint 1 alone 3.5 %"),
        ("TIAGo", RIGID / "tiago.yaml", "tiago", FRICTION + MEMORY, "of arm joint 1 alone 21.6 %")]


def diagnose(graybox, model, campaign, without):
    command = [graybox, "diagnose", str(model), str(campaigns / f"{campaign}.yaml"), "--json",
               "--threads", "2"]
    if without:
        command += [f"--without={law}" for law in without]
    start = time.monotonic()
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode == 2:
        sys.exit(done.stderr)
    return json.loads(done.stdout), time.monotonic() - start


def number(value):
    return "" if value is None else f"{value:.4g}"


def words(law):
    parameters = ", ".join(
        f"{name} {number(each['value'])} +- {number(each.get('conditional_error', each['standard_error'])) or '?'} {each['unit']}"
        for name, each in law["parameters"].items())
    return f"{law['law']} at {law['place']}: {parameters}"


def error(fit, role):
    return number((fit.get(role) or {}).get("nrmse"))


def main():
    graybox, chosen = sys.argv[1], sys.argv[2:]
    writer = csv.writer(sys.stdout, lineterminator="\n")
    writer.writerow(["set", "method", "catalogue", "verdict", "laws", "fit_before", "fit_after", "held_out_before",
                     "held_out_after", "literature", "literature_note", "remaining_structure", "seconds", "found"])
    for name, model, campaign, law, literature in SETS:
        if chosen and name not in chosen:
            continue
        for without in [[], law] if law else [[]]:
            answer, seconds = diagnose(graybox, model, campaign, without)
            before, after = answer["fit"]["before"], answer["fit"]["after"]
            writer.writerow([name, answer["method"], f"without {' '.join(without)}" if without else "whole",
                             answer["verdict"], len(answer["physics"]),
                             error(before, "estimation"), error(after, "estimation"),
                             error(before, "validation"), error(after, "validation"),
                             "" if isinstance(literature, str) else literature,
                             literature if isinstance(literature, str) else "",
                             number(answer["remaining_structure"]), f"{seconds:.1f}",
                             "; ".join(map(words, answer["physics"]))])
            sys.stdout.flush()


if __name__ == "__main__":
    main()
