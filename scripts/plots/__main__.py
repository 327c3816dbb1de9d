"""Draws every figure that a folder of results has data for.

    python3 scripts/plots results/latest
"""

import pathlib
import sys

import challenge
import continuous
import criteria
import exact_designs
import paper
import real_diagnosis
import real_recordings
import responses
import robust
import sequential
import spectrum
import study
import verify

# One module for each group of figures: draw(folder) reads its tables and draws what they allow.
GROUPS = [study, paper, exact_designs, criteria, robust, spectrum, continuous, sequential, responses,
          verify, real_recordings, real_diagnosis, challenge]


def main():
    if len(sys.argv) != 2:
        sys.exit("usage: python3 scripts/plots RESULTS_FOLDER")
    for group in GROUPS:
        group.draw(pathlib.Path(sys.argv[1]))


if __name__ == "__main__":
    main()
