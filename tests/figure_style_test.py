#!/usr/bin/env python3
"""What every figure of scripts/plots must keep, and that the figure of the real recordings says what the docs say.

    python3 tests/figure_style_test.py SOURCE_FOLDER
"""
import csv
import pathlib
import re
import sys
import unittest

ROOT = pathlib.Path(sys.argv.pop()).resolve() if len(sys.argv) > 1 else pathlib.Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "scripts" / "plots"))
try:
    import matplotlib.pyplot as plt
    import style
except ModuleNotFoundError as missing:
    print(f"skipped: {missing}")
    sys.exit(77)


def figure_with(draw):
    figure, axes = plt.subplots()
    draw(axes)
    return figure


class Figures(unittest.TestCase):
    # Finding B5.
    def test_refuse_bars_on_axes_without_zero(self):
        def bars(axes, scale):
            axes.set_xscale(scale)
            axes.barh([0, 1], [1.0, 20.0])

        with self.assertRaises(ValueError):
            style.refuse_bars_without_zero(figure_with(lambda axes: bars(axes, "log")))
        style.refuse_bars_without_zero(figure_with(lambda axes: bars(axes, "linear")))

        def upright(axes):
            axes.bar([0, 1], [1.0, 20.0])
            axes.set_yscale("log")

        with self.assertRaises(ValueError):
            style.refuse_bars_without_zero(figure_with(upright))

    def test_may_show_dots_on_any_axis(self):
        def dotted(axes):
            axes.set_xscale("log")
            style.dots(axes, [0, 1], [1.0, 20.0], style.BLUE)

        style.refuse_bars_without_zero(figure_with(dotted))

    # Finding B4.
    def test_claim_an_exponent_in_a_title_only_with_a_narrow_interval(self):
        self.assertIsNone(style.growth("column generation", 0.24, 0.56))
        self.assertIsNone(style.growth("one run", 1.0, float("nan")))
        known = style.growth("the dual form", 0.99, 0.16)
        style.refuse_unbounded_exponents(figure_with(lambda axes: axes.set_title(known)))
        for claim in ("time as $Q^{0.24}$", "time as $Q^{0.24}$ (±0.56)"):
            with self.assertRaises(ValueError):
                style.refuse_unbounded_exponents(figure_with(lambda axes, text=claim: axes.set_title(text)))

    # Finding B3.
    def test_mark_what_was_reached_by_hand_as_the_docs_state_it(self):
        docs = {}
        for line in (ROOT / "docs/explanation/real_machines.md").read_text(encoding="utf-8").splitlines():
            cells = [cell.strip() for cell in line.split("|")]
            if len(cells) >= 8 and re.fullmatch(r"[0-9.]+", cells[2]):
                docs[cells[1]] = cells[4]
        with open(ROOT / "results/reference/tables/real_diagnosis.csv", encoding="utf-8", newline="") as stream:
            rows = list(csv.DictReader(stream))
        self.assertTrue(rows)
        for row in rows:
            stated = docs[row["set"]]
            numbers = [float(number) for number in re.findall(r"\d+(?:\.\d+)?", stated)]
            if row["literature"]:
                self.assertEqual(float(row["literature"]), min(numbers), f"{row['set']}: {stated}")
            else:
                self.assertTrue(row["literature_note"], row["set"])
                for number in re.findall(r"\d+(?:\.\d+)?", row["literature_note"].replace("axis 2", "axis")):
                    self.assertIn(float(number), numbers, f"{row['set']}: {stated}")


if __name__ == "__main__":
    unittest.main()
