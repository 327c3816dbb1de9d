#!/usr/bin/env python3
"""How many of the starts of `graybox fit --all-starts` ended in the optimum, with Wilson's interval of 95 %:

    scripts/fit_starts.py FOLDER > table.csv      (FOLDER holds NOISE.json of each level of noise)

The first start of each is the file's own values, the truth of a simulated campaign: it is not counted."""
import csv
import json
import math
import pathlib
import sys

Z = 1.959964


def wilson(found, tries):
    centre = (found + Z * Z / 2) / (tries + Z * Z)
    half = Z / (tries + Z * Z) * math.sqrt(found * (tries - found) / tries + Z * Z / 4)
    return centre - half, centre + half


writer = csv.writer(sys.stdout, lineterminator="\n")
writer.writerow(["noise", "starts", "in_the_optimum", "share_low", "share_high", "chi_square_per_dof"])
for file in sorted(pathlib.Path(sys.argv[1]).glob("*.json"), key=lambda path: float(path.stem)):
    answer = json.loads(file.read_text())
    starts = answer["starts"][1:]
    found = sum(bool(start["best"]) for start in starts)
    low, high = wilson(found, len(starts))
    writer.writerow([file.stem, len(starts), found, f"{low:.3f}", f"{high:.3f}",
                     f"{answer['chi_square_per_dof']:.4f}"])
