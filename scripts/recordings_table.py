"""What the tables of fits to real recordings share: the command, the folders, the rows."""
import csv
import json
import pathlib
import subprocess
import sys

root = pathlib.Path(__file__).resolve().parent.parent
campaigns = root / "diagnosis/campaigns"


def fit(graybox, model, campaign, physics, *options):
    """The answer of `graybox fit`, converged or not."""
    command = [graybox, "fit", str(model), str(campaign), "--json", *options]
    command += [f"--physics={file}" for file in physics or ()]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode == 2:
        sys.exit(done.stderr)
    return json.loads(done.stdout)


def write(sets):
    """`sets`: iterables of (set, model, split, figure, ours, reference); the ratio is added. A reference
    of None: there is no number to compare with."""
    writer = csv.writer(sys.stdout, lineterminator="\n")
    writer.writerow(["set", "model", "split", "figure", "ours", "reference", "ratio"])
    for rows in sets:
        for *labels, ours, reference in rows:
            compared = ["", ""] if reference is None else [f"{reference:g}", f"{ours / reference:.3f}"]
            writer.writerow([*labels, f"{ours:.4g}", *compared])
