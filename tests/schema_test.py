#!/usr/bin/env python3
"""What --json prints and what files of results hold keep to docs/reference/schemas.

    tests/schema_test.py GRAYBOX SOURCE

Runs the command in a folder of its own. Each schema is also held against output from which something
was taken, or to which something was added: it must refuse that. Ends with 77 without jsonschema.
"""
import copy
import json
import re
import subprocess
import sys
import tempfile
from pathlib import Path

try:
    from jsonschema import Draft202012Validator
except ImportError:
    print("skipped: python3-jsonschema is not there (scripts/setup installs it)")
    sys.exit(77)

GRAYBOX, SOURCE = sys.argv[1], Path(sys.argv[2])
EXAMPLES = SOURCE / "docs/examples"
DRIVE = EXAMPLES / "fit/drive"

# Each schema, and the commands whose output keeps to it; {file}: what the command writes does, too.
CASES = [
    ("report", "solve set.h5 --json -o {file}", "design"),
    ("report", "solve set.h5 --criterion L --weights 0=1,2=3 --json -o {file}", "design"),
    ("report", "solve robot.h5 --criterion Ds --interest 0,1 --json -o {file}", "design"),
    ("report", "solve set.h5 --criterion phi_p --p 2 --json -o {file}", "design"),
    ("report", "solve set.h5 --criterion G --region set.h5 --json -o {file}", "design"),
    ("report", "solve set.h5 --criterion D=0.5,A=0.5 --json -o {file}", "design"),
    ("report", "solve set.h5 --floor A=0.9,I=0.8 --json -o {file}", "design"),
    ("report", "design discriminate truth.csv rival.csv other.csv --relative --json -o {file} "
     "--set {file}.h5", "design"),
    ("report", "solve set.h5 --stock 2 --experiments 20 --criterion A --json -o {file}", "design"),
    ("report", "solve set.h5 --solver multiplicative --iteration-limit 2 --json", None),
    ("report", "solve set.h5 --start first.json --json -o {file}", "design"),
    ("report", "check set.h5 first.json --json", None),
    ("exact", "exact set.h5 -M 7 --json -o {file}", "design"),
    ("exact", "exact set.h5 -M 7 --method rounding --json -o {file}", "design"),
    ("exact", "exact set.h5 -M 7 --stock 2 --criterion A --top 2 --json -o {file}", "design"),
    ("solvers", "solvers --json", None),
    ("ellipsoid", f"ellipsoid {EXAMPLES}/ellipsoid/motors.csv --json -o {{file}}", "ellipsoid"),
    ("fit", f"fit {DRIVE}/motor.yaml {DRIVE} --json -o {{file}}", "fit"),
    ("prediction", f"predict {DRIVE}/motor.yaml {DRIVE} --json", None),
    ("recordings", f"recordings {DRIVE} --json", None),
    ("recordings", f"recordings {EXAMPLES}/recordings --json", None),
    ("verdict", f"diagnose {DRIVE}/motor.yaml {DRIVE} --json -o motor_report", None),
    ("verdict", f"diagnose {DRIVE}/motor.yaml {DRIVE} --without coulomb --json", None),
    ("verdict", f"diagnose {DRIVE}/motor.yaml {DRIVE} --time-limit 0.02 --json", None),
    ("verdict", f"diagnose {EXAMPLES}/diagnose/rotor.yaml rotor --json --time-limit 6 -o r", None),
    ("criteria", "design criteria set.h5 --json", None),
    ("plan", "design plan set.h5 --target sd(all)<=0.3 --json -o {file}", "plan"),
    ("plan", "design plan set.h5 --target sd(0)<=0.3 --costs 2 --json -o {file}", "plan"),
    ("report", "design robust set.h5 --largest-share 0.5 --of-positions 0.1 --json -o {file}",
     "design"),
    ("report", "design robust --grid 40 --samples 3 --json", None),
    ("report", "design spectrum --grid 8 --json", None),
    ("report", "design continuous --grid 60 --rounds 1 --starts 2 --random-points 50 "
     "--refined 50 --json -o {file} --set {file}.h5", "design"),
    ("sequential", "design sequential --grid 30 --stages 2 --repetitions 1 --json", None),
    ("efficiency", "design efficiency robot_design.json --grid 60 --samples 3 --json", None),
    ("verify", "design verify --grid 60 --recordings 0 --repetitions 70 --json -o verified", None),
    ("simulation", f"simulate {EXAMPLES}/diagnose/rotor.yaml "
     f"{EXAMPLES}/diagnose/rotor_short_plan.yaml --json -o again", None),
    ("laws", "simulate --laws --json", None),
    ("units", "recordings --units --json", None),
    ("responses", "responses rotor --json", None),
    ("study", "study --quick --solvers column_generation --max-candidates 50 --no-families "
     "-o rows --json", None),
    ("study_verify", "study verify rows --json", None),
    ("challenge", "challenge make --cases 1 --family one_mass --seed 1 -o cases --truth truth "
     "--json", None),
    ("challenge", "challenge run cases -o answers --time-limit 2 --json", None),
    ("challenge", "challenge score cases answers --truth truth --json", None),
    ("verdict", f"diagnose axis.yaml {DRIVE} --json -o axis_report", None),
]

# The motor of the examples as a rigid robot, for a force balance.
AXIS = """format: graybox-rigid-robot/1
gravity: [0, 0, -9.81]
denavit_hartenberg: modified
joints: [{name: motor, alpha: 0, a: 0, d: 0, gear_ratio: 1, rotor_inertia: unknown}]
channels: {torque: [torque], torque_of: motors, velocity: [speed], position_of: motors}
"""

failures = []


def fail(text):
    failures.append(text)
    print("FAILED:", text)


def load_schemas():
    schemas = {}
    for path in sorted((SOURCE / "docs/reference/schemas").glob("*.json")):
        schema = json.loads(path.read_text())
        Draft202012Validator.check_schema(schema)
        schemas[path.stem] = schema
    return schemas


def errors_of(schema, instance):
    return [f"{'/'.join(map(str, e.absolute_path))}: {e.message[:200]}"
            for e in Draft202012Validator(schema).iter_errors(instance)]


def hold(schemas, name, instance, origin):
    """The instance keeps to the schema; with a key less, or of another type, it does not."""
    for line in errors_of(schemas[name], instance):
        fail(f"{origin}: {name}: {line}")
    first = instance[0] if isinstance(instance, list) else instance
    required = schemas[name].get("required") or schemas[name].get("items", {}).get("required")
    if "oneOf" in schemas[name]:  # any of them less its first key is none of them
        required = [next(iter(instance))]
    for key in required:
        for change in (lambda item: item.pop(key), lambda item: item.update({key: object})):
            broken = copy.deepcopy(instance)
            change(broken[0] if isinstance(broken, list) else broken)
            if not errors_of(schemas[name], broken):
                fail(f"{name}: takes an instance without a proper '{key}'")
    if not first:
        fail(f"{origin}: is empty")


def run(arguments, folder):
    done = subprocess.run([GRAYBOX, *arguments.split()], cwd=folder, capture_output=True, text=True,
                          timeout=300, check=False)
    if done.returncode not in (0, 1):
        fail(f"graybox {arguments}: {done.stderr.strip()}")
        return None
    return done.stdout


def commands_with_json(folder):
    """By the script that completes command lines, which knows every command's options."""
    script = run("completion bash", folder)
    return re.findall(r'^    " ([^"]+)"\) subcommands=.* switches=\'[^\']*--json[ \']', script, re.M)


def main():
    schemas = load_schemas()
    used = set()
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "axis.yaml").write_text(AXIS)
        for name, text in (("truth", "y\n1\n0\n1\n4\n"), ("rival", "a\n1\n1\n1\n1\n"),
                           ("other", "b,prediction\n-1,0\n0,1\n1,0\n2,1\n")):
            (Path(folder) / f"{name}.csv").write_text(text)
        run("problem random --family wis --candidates 300 --dimension 4 -o set.h5", folder)
        run("problem robot --grid 60 -o robot.h5", folder)
        run("solve set.h5 -o first.json", folder)
        run("solve robot.h5 -o robot_design.json", folder)
        run(f"simulate {EXAMPLES}/diagnose/rotor.yaml {EXAMPLES}/diagnose/rotor_short_plan.yaml "
            f"--hidden {EXAMPLES}/diagnose/hidden_magnet.yaml -o rotor", folder)
        for number, (name, arguments, file_schema) in enumerate(CASES):
            file = f"file_{number}.json"
            printed = run(arguments.format(file=file), folder)
            if printed is None:
                continue
            hold(schemas, name, json.loads(printed), f"graybox {arguments}")
            used.add(name)
            if file_schema:
                hold(schemas, file_schema, json.loads((Path(folder) / file).read_text()), file)
                used.add(file_schema)
        for report in ("motor_report", "axis_report", "r"):
            verdict = json.loads((Path(folder) / report / "verdict.json").read_text())
            hold(schemas, "verdict", verdict, f"{report}/verdict.json")
        for rows in (Path(folder) / "rows/rows.jsonl", SOURCE / "results/reference/rows.jsonl"):
            lines = rows.read_text().splitlines()
            for line in lines[:3] + lines[3::50]:
                hold(schemas, "study_row", json.loads(line), rows.name)
        used.add("study_row")
        for command in commands_with_json(folder):
            if not any(arguments.startswith(command + " ") for _, arguments, _ in CASES):
                fail(f"graybox {command} --json: held against no schema")
    for name in sorted(set(schemas) - used):
        fail(f"{name}: no output is held against it")
    print(f"{len(schemas)} schemas, {len(CASES)} commands, {len(failures)} failures")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
