#!/usr/bin/env python3
"""What every figure of scripts/plots must keep, and that the figure of the real recordings says what the docs say.

    python3 tests/figure_style_test.py SOURCE_FOLDER
"""
import csv
import math
import pathlib
import re
import sys
import unittest

ROOT = pathlib.Path(sys.argv.pop()).resolve() if len(sys.argv) > 1 else pathlib.Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "scripts" / "plots"))
try:
    import matplotlib.pyplot as plt
    import style
    import style_colours
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

    def test_have_colours_that_every_reader_can_tell_apart(self):
        seen = [style_colours.as_seen(colour) for colour in style.COLOURS]
        for sight in range(3):
            for i, one in enumerate(seen):
                for j, other in enumerate(seen[:i]):
                    self.assertGreater(math.dist(one[sight], other[sight]), 20,
                                       f"{style.COLOURS[i]} and {style.COLOURS[j]}, {style_colours.SIGHTS[sight]}")
        for colour in style.COLOURS:
            self.assertGreaterEqual(style_colours.contrast_on_white(colour), 3, colour)

    def test_measure_colours_as_the_standards_do(self):
        # Lab of sRGB red by the CIE's definition (53.24, 80.09, 67.20); contrast of #777777 on white, 4.48, by WCAG.
        self.assertLess(math.dist(style_colours.as_seen("#FF0000")[0], (53.24, 80.09, 67.20)), 0.05)
        self.assertAlmostEqual(style_colours.contrast_on_white("#777777"), 4.48, delta=0.01)
        # Red and green of one lightness are nearly one colour to deuteranopes.
        red, green = style_colours.as_seen("#A86A00"), style_colours.as_seen("#6F8200")
        self.assertLess(math.dist(red[1], green[1]), 0.5 * math.dist(red[0], green[0]))

    def test_hold_at_most_eight_kinds_of_curves(self):
        def curves(axes, number):
            for k in range(number):
                axes.plot([0, 1, 2], [k, k, k], color=style.COLOURS[k % 8], ls="-" if k < 8 else "--")

        style.refuse_crowds(figure_with(lambda axes: curves(axes, 8)))
        with self.assertRaises(ValueError):
            style.refuse_crowds(figure_with(lambda axes: curves(axes, 9)))

    def test_write_units_in_one_way(self):
        style.refuse_brackets(figure_with(lambda axes: axes.set_xlabel("frequency (Hz)")))
        with self.assertRaises(ValueError):
            style.refuse_brackets(figure_with(lambda axes: axes.set_ylabel("error [%]")))

    # Pages show every figure of the reference, so that none is drawn for nobody.
    def test_of_the_reference_stand_on_a_page(self):
        pages = "".join(page.read_text(encoding="utf-8") for page in [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")])
        for figure in sorted((ROOT / "results/reference/figures").glob("*.png")):
            self.assertIn(f"figures/{figure.stem}.", pages, figure.name)
            self.assertTrue(figure.with_suffix(".svg").exists(), figure.name)

    # Finding B3.
    def test_mark_what_was_reached_by_hand_as_the_docs_state_it(self):
        docs = {}
        for line in (ROOT / "docs/explanation/real_machines_laws.md").read_text(encoding="utf-8").splitlines():
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
