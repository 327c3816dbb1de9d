#!/usr/bin/env python3
"""Report pages in headless Chromium: what a reader sees, clicks, prints, and gets on a phone.

    tests/report_page_test.py GRAYBOX SOURCE

Runs the command in a folder of its own. Ends with 77, and says so, without Chromium, its driver or
selenium (Debian: chromium, chromium-driver, python3-selenium).
"""
import json
import math
import shutil
import statistics
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path
from urllib.parse import unquote

CHROMIUM, DRIVER = shutil.which("chromium"), shutil.which("chromedriver")
try:
    from selenium import webdriver
    from selenium.webdriver.chrome.service import Service
    from selenium.webdriver.common.action_chains import ActionChains
    from selenium.webdriver.common.by import By
    from selenium.webdriver.common.keys import Keys
    from selenium.webdriver.support.ui import Select
except ImportError:
    DRIVER = None
if not CHROMIUM or not DRIVER:
    print("skipped: chromium, chromium-driver or python3-selenium is not there (scripts/setup installs them)")
    sys.exit(77)

GRAYBOX, SOURCE = str(Path(sys.argv[1]).resolve()), Path(sys.argv[2]).resolve()
DRIVE = SOURCE / "docs/examples/fit/drive"
LARGEST = 3_000_000  # bytes
WIDTHS = [360, 800, 1400]


def started_browser():
    options = webdriver.ChromeOptions()
    options.binary_location = CHROMIUM
    for argument in ["--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage",
                     "--no-first-run", "--disable-background-networking"]:
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    return webdriver.Chrome(service=Service(DRIVER), options=options)


class Page(unittest.TestCase):
    """One page; others say by which command it is written."""
    command = ["diagnose", str(DRIVE / "motor.yaml"), str(DRIVE), "-o", "report"]
    page = "report/report.html"

    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.prepare()
        done = subprocess.run([GRAYBOX, *cls.command], cwd=cls.folder.name, capture_output=True, text=True, check=False)
        if done.returncode not in (0, 1):
            raise RuntimeError(done.stderr)
        cls.file = Path(cls.folder.name) / cls.page
        cls.text = cls.file.read_text(encoding="utf-8")
        cls.browser = started_browser()

    @classmethod
    def prepare(cls):
        """Makes the files that the command reads."""

    @classmethod
    def tearDownClass(cls):
        cls.browser.quit()
        cls.folder.cleanup()

    def setUp(self):
        self.open(1000)

    def open(self, width, dark=False, media="screen", script=True):
        self.tell("Emulation.setScriptExecutionDisabled", {"value": not script})
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self.tell("Emulation.setEmulatedMedia", {"media": media, "features": [scheme]})
        self.tell("Emulation.setDeviceMetricsOverride",
                  {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": width < 500})
        self.browser.get(self.file.as_uri())

    def tell(self, command, values):
        return self.browser.execute_cdp_cmd(command, values)

    def ask(self, script, *values):
        return self.browser.execute_script("return " + script, *values)

    def ranges(self):
        return self.ask("report.charts().map(chart => chart.xAxisRange())")

    # What holds of every page.

    def test_is_small_and_loads_nothing(self):
        self.assertLess(self.file.stat().st_size, LARGEST)
        self.browser.get_log("performance")
        self.open(1000)
        requests = []
        for entry in self.browser.get_log("performance"):
            message = json.loads(entry["message"])["message"]
            if message["method"] == "Network.requestWillBeSent":
                requests.append(message["params"]["request"]["url"])
        self.assertIn(self.file.as_uri(), requests)
        self.assertEqual([url for url in requests if url != self.file.as_uri() and not url.startswith("data:")], [])

    def test_says_nothing_on_the_console(self):
        self.browser.get_log("browser")
        for width in WIDTHS:
            self.open(width)
        self.assertEqual(self.browser.get_log("browser"), [])

    def test_needs_no_sideways_scrolling(self):
        for width in WIDTHS:
            self.open(width)
            self.assertLessEqual(self.ask("document.documentElement.scrollWidth"), width)
            inside = self.ask("""[...document.querySelectorAll('main *, header *, footer *')].filter(each => {
                const box = each.getBoundingClientRect();
                return box.width > 0 && box.right > innerWidth + 1 && !each.closest('.scroll, pre, .plot, svg, .skip');
            }).map(each => each.outerHTML.slice(0, 100))""")
            self.assertEqual(inside, [], width)

    def test_is_dark_where_the_reader_is(self):
        shades = []
        for dark in (False, True):
            self.open(1000, dark=dark)
            shades.append(self.ask("""['backgroundColor', 'color'].map(name =>
                getComputedStyle(document.body)[name].match(/[0-9]+/g).slice(0, 3).map(Number))"""))
        (paper, ink), (dark_paper, light_ink) = shades
        self.assertGreater(min(paper), 200)
        self.assertLess(max(ink), 100)
        self.assertLess(max(dark_paper), 80)
        self.assertGreater(min(light_ink), 180)

    def test_has_words_for_pictures_and_tables(self):
        self.assertEqual(self.ask("[...document.querySelectorAll('svg')].filter(each => !each.getAttribute('aria-label')).length"), 0)
        self.assertEqual(self.ask("[...document.querySelectorAll('th')].filter(each => !each.scope).length"), 0)
        self.assertEqual(self.ask("document.documentElement.lang"), "en")
        self.assertEqual(self.ask("new Set([...document.querySelectorAll('[id]')].map(each => each.id)).size"),
                         self.ask("document.querySelectorAll('[id]').length"))

    def test_contents_lead_somewhere(self):
        for link in self.browser.find_elements(By.CSS_SELECTOR, "nav a"):
            self.assertEqual(self.ask("document.querySelectorAll(arguments[0]).length",
                                      link.get_dom_attribute("href")), 1)

    def test_prints(self):
        self.assertGreater(len(self.tell("Page.printToPDF", {"printBackground": False})["data"]), 20_000)
        self.open(1000, dark=True, media="print")
        paper = self.ask("getComputedStyle(document.documentElement).getPropertyValue('--paper')").strip()
        self.assertEqual(paper, "#ffffff")

    def test_states_how_it_came_about(self):
        footer = self.browser.find_element(By.TAG_NAME, "footer").text
        for text in ["graybox ", "commit", " s.", "graybox " + self.command[0]]:
            self.assertIn(text, footer)


class PageWithTraces(Page):
    """And of pages that show traces."""

    def test_traces_have_data(self):
        traces = self.ask("report.traces")
        self.assertGreaterEqual(len(traces), 1)
        for trace in traces:
            self.assertEqual(trace["names"][0], "measured")
            columns = list(zip(*trace["rows"]))
            self.assertEqual(len(columns), 1 + len(trace["names"]))
            self.assertTrue(all(a < b for a, b in zip(columns[0], columns[0][1:])))
            for column in columns[1:]:
                self.assertGreater(sum(value is not None for value in column), 100)
        # Ink on the canvases: of each, pixels that are not empty.
        inked = self.ask("""report.charts().map(chart => {
            const canvas = chart.hidden_, context = canvas.getContext('2d');
            const pixels = context.getImageData(0, 0, canvas.width, canvas.height).data;
            let count = 0;
            for (let i = 3; i < pixels.length; i += 4) count += pixels[i] > 0;
            return count;
        })""")
        self.assertTrue(all(count > 500 for count in inked), inked)

    def test_a_click_zooms_all_charts_and_back(self):
        whole = self.ranges()
        self.assertGreaterEqual(len(whole), 2)  # the signal and what is left of it
        self.browser.find_element(By.CSS_SELECTOR, "[data-do=in]").click()
        for before, after in zip(whole, self.ranges()):
            self.assertLess(after[1] - after[0], 0.7 * (before[1] - before[0]))
        zoomed = self.ranges()
        self.browser.find_element(By.CSS_SELECTOR, "[data-do=on]").click()
        for before, after in zip(zoomed, self.ranges()):
            self.assertGreater(after[0], before[0])
        self.browser.find_element(By.CSS_SELECTOR, "[data-do=reset]").click()
        for before, after in zip(whole, self.ranges()):
            self.assertAlmostEqual(before[1] - before[0], after[1] - after[0], delta=0.02 * (before[1] - before[0]))

    def test_ticks_are_told_apart(self):
        def labels():
            return self.ask("""['x', 'y'].map(axis => [...document.querySelectorAll('.plot')].map(plot =>
                [...plot.querySelectorAll('.dygraph-axis-label-' + axis)].map(each => each.textContent)))""")
        for width in (360, 1000):
            self.open(width)
            for plot in labels()[1]:
                self.assertGreaterEqual(len(plot), 2, (width, plot))
            for _ in range(7):
                for plot in sum(labels(), []):
                    self.assertEqual(len(set(plot)), len(plot), (width, plot))
                self.browser.find_element(By.CSS_SELECTOR, "[data-do=in]").click()

    def test_dragging_zooms_and_cursors_are_linked(self):
        plot = self.browser.find_elements(By.CSS_SELECTOR, ".plot canvas")[-1].find_element(By.XPATH, "..")
        self.ask("arguments[0].scrollIntoView({block: 'center', behavior: 'instant'})", plot)
        whole = self.ranges()
        ActionChains(self.browser).move_to_element(plot).click_and_hold().move_by_offset(100, 0).release().perform()
        for before, after in zip(whole, self.ranges()):
            self.assertLess(after[1] - after[0], 0.6 * (before[1] - before[0]))
        ActionChains(self.browser).move_to_element(plot).move_by_offset(20, 0).perform()
        selected = self.ask("report.charts().map(chart => chart.getSelection())")
        self.assertEqual(len(set(selected)), 1)
        self.assertGreaterEqual(selected[0], 0)
        legend = self.browser.find_element(By.CSS_SELECTOR, ".legend").text
        self.assertRegex(legend, r"measured -?[0-9]")

    def test_keys_reach_and_move_the_charts(self):
        body = self.browser.find_element(By.TAG_NAME, "body")
        reached = set()
        for _ in range(120):
            body.send_keys(Keys.TAB) if not reached else self.browser.switch_to.active_element.send_keys(Keys.TAB)
            name = self.ask("document.activeElement.id || document.activeElement.dataset.do || document.activeElement.className")
            reached.add(name)
            if name == "plot":
                break
        self.assertLessEqual({"recording", "in", "reset", "plot"}, reached)
        whole = self.ranges()
        self.browser.switch_to.active_element.send_keys("+")
        self.assertLess(self.ranges()[0][1] - self.ranges()[0][0], 0.7 * (whole[0][1] - whole[0][0]))

    def test_another_recording_is_shown_when_chosen(self):
        menu = Select(self.browser.find_element(By.ID, "recording"))
        if len(menu.options) < 2:
            self.skipTest("one recording")
        first = self.ask("report.charts()[0].rawData_.slice(0, 50)")
        menu.select_by_index(1)
        self.assertNotEqual(first, self.ask("report.charts()[0].rawData_.slice(0, 50)"))

    def test_pictures_stand_in_for_charts_on_paper_and_without_a_script(self):
        self.assertFalse(self.browser.find_element(By.ID, "stills").is_displayed())
        for settings in ({"media": "print"}, {"script": False}):
            self.open(1000, **settings)
            self.assertTrue(self.browser.find_element(By.ID, "stills").is_displayed())
            self.assertFalse(self.browser.find_element(By.ID, "viewer").is_displayed())
        self.open(1000)

    def test_colours_of_charts_follow_the_scheme(self):
        colours = []
        for dark in (False, True):
            self.open(1000, dark=dark)
            colours.append(self.ask("report.charts()[0].getColors()"))
        self.assertNotEqual(*colours)


class Diagnosis(PageWithTraces):
    def test_verdict_is_short_and_first(self):
        card = self.browser.find_element(By.CLASS_NAME, "card")
        self.assertIn("Verdict: explained", card.text)
        self.assertIn("coulomb at motor", card.text)
        self.assertLessEqual(len(card.find_elements(By.CSS_SELECTOR, "p:not(.verdict):not(.bars-title)")), 3)
        self.assertLess(card.location["y"], 500)

    def test_reasons_are_read_without_colour(self):
        verdict = json.loads((self.file.parent / "verdict.json").read_text(encoding="utf-8"))
        rows = self.browser.find_elements(By.CSS_SELECTOR, "#reasons tbody tr")
        self.assertEqual(len(rows), len(verdict["reasons"]))
        for row, reason in zip(rows, verdict["reasons"]):
            self.assertIn(reason["test"], row.text)
            self.assertIn("✓ passed" if reason["passed"] else "✗ failed", row.text)

    def test_prediction_errors_are_those_of_the_verdict(self):
        verdict = json.loads((self.file.parent / "verdict.json").read_text(encoding="utf-8"))
        for trace in self.ask("report.traces"):
            role = "validation" if trace["kept_out"] else "estimation"
            self.assertEqual(trace["samples"], len(trace["rows"]))  # nothing was thinned
            measured = [row[1] for row in trace["rows"]]
            mean = sum(measured) / len(measured)
            signal = math.sqrt(sum((value - mean) ** 2 for value in measured) / len(measured))
            for column, when in ((2, "before"), (3, "after")):
                left = [row[1] - row[column] for row in trace["rows"] if row[column] is not None]
                error = 100 * math.sqrt(sum(value ** 2 for value in left) / len(left)) / signal
                self.assertAlmostEqual(error, verdict["fit"][when][role]["nrmse"], delta=2e-3 * error)

    def test_what_is_saved_is_what_was_written(self):
        links = self.browser.find_elements(By.CSS_SELECTOR, "a[download]")
        self.assertIn("model_extended.yaml", [link.get_dom_attribute("download") for link in links])
        for link in links:
            text = unquote(link.get_dom_attribute("href").split(",", 1)[1])
            self.assertEqual(text, (self.file.parent / link.get_dom_attribute("download")).read_text(encoding="utf-8"))

    def test_a_cell_of_the_map_opens_its_time(self):
        cells = self.browser.find_elements(By.CSS_SELECTOR, "#misfit [data-from]")
        self.assertGreaterEqual(len(cells), 12)
        cell = cells[5]
        self.ask("arguments[0].scrollIntoView({block: 'center', behavior: 'instant'})", cell)
        cell.click()
        at = self.ranges()[0]
        self.assertAlmostEqual(at[0], float(cell.get_dom_attribute("data-from")), delta=0.01)
        self.assertAlmostEqual(at[1], float(cell.get_dom_attribute("data-to")), delta=0.01)


class Prediction(PageWithTraces):
    command = ["predict", str(DRIVE / "motor.yaml"), str(DRIVE), "-o", "page.html"]
    page = "page.html"


class Fit(PageWithTraces):
    command = ["fit", str(DRIVE / "motor.yaml"), str(DRIVE), "--physics", str(DRIVE / "friction.yaml"), "-o", "fit.json",
               "--report", "page.html"]
    page = "page.html"

    def test_parameters_are_those_of_the_fit(self):
        fit = json.loads((self.file.parent / "fit.json").read_text(encoding="utf-8"))
        rows = self.browser.find_elements(By.CSS_SELECTOR, "#parameters table:first-of-type tbody tr")
        for parameter in fit["parameters"]:
            row = [row for row in rows if row.text.startswith(parameter["name"])][0]
            self.assertIn(f"{parameter['value']:.5g}", row.text)
            self.assertIn(f"{parameter['standard_error']:.2g}", row.text)
            band = row.find_element(By.CSS_SELECTOR, ".band")
            share = parameter["standard_error"] / abs(parameter["value"])
            drawn = band.find_element(By.TAG_NAME, "span").size["width"] / band.size["width"]
            self.assertAlmostEqual(drawn, max(min(share, 1), 2 / band.size["width"]), delta=0.02)
            self.assertIn(f"{100 * share:.3g} %", band.get_attribute("aria-label"))
        self.assertFalse((self.file.parent / "page.html.model.yaml").exists())

    def test_predicts_better_after_than_before(self):
        for trace in self.ask("report.traces"):
            self.assertEqual(trace["names"], ["measured", "predicted before", "predicted after"])
            squares = [sum((row[1] - row[column]) ** 2 for row in trace["rows"] if row[column] is not None)
                       for column in (2, 3)]
            self.assertLess(squares[1], 0.5 * squares[0])


class Study(Page):
    """The page of the reference study, against its rows."""
    command = ["study", "page", str(SOURCE / "results/reference"), "-o", "index.html"]
    page = "index.html"

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        lines = (SOURCE / "results/reference/rows.jsonl").read_text(encoding="utf-8").splitlines()
        cls.runs = [row for row in map(json.loads, lines) if row["kind"] == "run"]

    def groups(self, *experiments):
        found = {}
        for row in self.runs:
            if not experiments or row["experiment"] in experiments:
                key = (row["experiment"], row["family"], row["candidates"], row["solver"], row["gap"])
                found.setdefault(key, []).append(row)
        return found

    def plot(self, name):
        return {series["name"]: dict(zip(series["x"], series["y"])) for plot in
                json.loads(self.ask("document.getElementById('data').textContent"))["plots"] if plot["id"] == name
                for series in plot["series"]}

    def rows_shown(self, table="#points"):
        return [row for row in self.browser.find_elements(By.CSS_SELECTOR, f"{table} tbody tr") if row.is_displayed()]

    def test_figure_3_shows_the_medians_of_the_rows(self):
        expected = {}
        for (_, _, candidates, solver, _), rows in self.groups("scaling").items():
            if all(row["status"] == "solved" for row in rows):
                expected.setdefault(solver, {})[candidates] = statistics.median(row["seconds"] for row in rows)
        shown = self.plot("figure-3")
        self.assertEqual({name: set(points) for name, points in shown.items()},
                         {name: set(points) for name, points in expected.items()})
        for solver, points in expected.items():
            for candidates, seconds in points.items():
                self.assertAlmostEqual(shown[solver][candidates], seconds, delta=1e-5 * seconds)
        marks = self.ask("document.querySelectorAll('svg[data-plot=figure-3] g[data-series] .mark').length")
        self.assertEqual(marks, sum(len(points) for points in expected.values()))

    def costs_to_a_millionth(self, cost):
        """Seconds (cost 0) or passes (cost 1) by solver and instance; nested subsets are no instances."""
        costs, instances = {}, set()
        for (_, family, candidates, solver, gap), rows in self.groups("families", "draws", "dimensions").items():
            instances.add((family, candidates))
            if all("1e-6" in row["reached"] for row in rows):
                found = statistics.median(row["reached"]["1e-6"][cost] for row in rows)
            elif gap <= 1e-6 and (all(row["status"] == "solved" for row in rows)
                                  or max(row["duality_gap"] or math.inf for row in rows) <= 1e-6):
                found = statistics.median(row[("seconds", "passes")[cost]] for row in rows)
            else:
                continue
            costs.setdefault(solver, {})[family, candidates] = found
        return costs, instances

    def test_profiles_are_those_of_the_rows(self):
        times, instances = self.costs_to_a_millionth(0)
        passes, _ = self.costs_to_a_millionth(1)
        best = {each: min(own[each] for own in times.values() if each in own) for each in instances}
        for name, costs, measure in (("data-profile", times, lambda own, each: own[each]),
                                     ("data-profile-passes", passes, lambda own, each: own[each]),
                                     ("performance-profile", times, lambda own, each: own[each] / best[each])):
            shown = self.plot(name)
            self.assertEqual(set(shown), set(costs))
            for solver, own in costs.items():
                values = [measure(own, each) for each in own]
                for x, share in shown[solver].items():
                    solved = sum(value <= x * (1 + 2e-5) for value in values)
                    self.assertAlmostEqual(share, solved / len(instances), delta=1e-5, msg=(name, solver, x))
                self.assertAlmostEqual(max(shown[solver].values()), len(own) / len(instances), delta=1e-5)

    def test_means_are_those_of_the_rows(self):
        times, instances = self.costs_to_a_millionth(0)
        charge = 10 * max(max(own.values()) for own in times.values())
        shown = {}
        for row in self.ask("""[...document.querySelector('#comparison table').tBodies[0].rows].map(row =>
                [...row.cells].map(cell => cell.dataset.value || cell.textContent))"""):
            if row[1] in ("1e-6", "1e-06"):
                shown[row[0]] = float(row[2])
        self.assertEqual(set(shown), {"virtual best"} | {key[3] for key in self.groups("families", "draws", "dimensions")})
        for solver, own in times.items():
            logs = [math.log(own.get(each, charge) + 1e-3) for each in instances]
            self.assertAlmostEqual(shown[solver] / (math.exp(statistics.fmean(logs)) - 1e-3), 1, delta=1e-4, msg=solver)

    def test_failures_and_slow_points_are_listed(self):
        points = {key: rows for key, rows in self.groups().items() if key[0] != "normalisation"}
        unsolved = [key for key, rows in points.items() if any(row["status"] != "solved" for row in rows)]
        tables = self.browser.find_elements(By.CSS_SELECTOR, "#failures table")
        count = [len(table.find_elements(By.CSS_SELECTOR, "tbody tr")) for table in tables]
        self.assertEqual(count[0], len(unsolved))
        medians = {key: statistics.median(row["seconds"] for row in points[key]) for key in points if key not in unsolved}
        slow = 0
        for key, seconds in medians.items():
            if key[3] == "column_generation":
                others = [medians[each] for each in medians if (*each[:3], each[4]) == (*key[:3], key[4])]
                slow += seconds > min(others)
        self.assertEqual(count[1:], [slow] if slow else [])

    def test_tables_sort(self):
        heads = self.browser.find_elements(By.CSS_SELECTOR, "#points thead th")
        column = [head.text.split(" ↕")[0] for head in heads].index("median time")
        button = heads[column].find_element(By.TAG_NAME, "button")
        read = """[...document.querySelectorAll('#points tbody tr')].map(row => Number(row.cells[arguments[0]].dataset.value))"""
        before = self.ask(read, column)
        for order, sign in (("ascending", 1), ("descending", -1)):
            self.ask("arguments[0].click()", button)
            after = self.ask(read, column)
            self.assertEqual(heads[column].get_dom_attribute("aria-sort"), order)
            self.assertEqual(after, sorted(before, key=lambda value: sign * value))
        self.assertNotEqual(before, after)

    def test_tables_filter_by_menu_and_words(self):
        whole = self.groups()
        self.assertEqual(len(self.rows_shown()), len(whole))
        menu = Select(self.browser.find_element(By.CSS_SELECTOR, "#points .tools select"))
        menu.select_by_visible_text("column_generation")
        own = [key for key in whole if key[3] == "column_generation"]
        self.assertEqual(len(self.rows_shown()), len(own))
        field = self.browser.find_element(By.CSS_SELECTOR, "#points .tools input")
        field.send_keys("families wis")
        expected = [key for key in own if key[0] == "families" and "wis" in key[1]]
        self.assertEqual(len(self.rows_shown()), len(expected))
        self.assertIn(f"{len(expected)} of {len(whole)} rows",
                      self.browser.find_element(By.CSS_SELECTOR, "#points .count").text)

    def test_a_name_hides_its_curve_and_a_click_reads_values(self):
        curve = self.browser.find_element(By.CSS_SELECTOR, "svg[data-plot=figure-3] [data-series=column_generation]")
        chart = self.browser.find_element(By.CSS_SELECTOR, "svg[data-plot=figure-3]")
        chart.send_keys(Keys.ARROW_LEFT)
        readout = self.browser.find_element(By.CSS_SELECTOR, "#pictures .readout")
        self.assertIn("7920", readout.text)
        self.assertIn("column_generation", readout.text)
        chart.send_keys(Keys.ARROW_LEFT)
        self.assertIn("4000", readout.text)
        button = self.browser.find_element(By.CSS_SELECTOR, "#pictures .key li[data-series=column_generation] button")
        self.ask("arguments[0].click()", button)
        self.assertFalse(curve.is_displayed())
        self.assertEqual(button.get_dom_attribute("aria-pressed"), "false")
        self.assertNotIn("column_generation", readout.text)
        self.ask("arguments[0].click()", button)
        self.assertTrue(curve.is_displayed())

    def test_every_curve_of_a_chart_looks_different_without_colour(self):
        looks = self.ask("""[...document.querySelectorAll('svg[data-plot=figure-3] g[data-series]')].map(curve =>
            [curve.querySelector('.line').getAttribute('stroke-dasharray'),
             curve.querySelector('.mark').getAttribute('d').replace(/^M[-0-9. ]*/, '')].join())""")
        self.assertGreater(len(looks), 10)
        self.assertEqual(len(looks), len(set(looks)))

    def test_every_solver_has_a_section_with_statuses_and_worst_instance(self):
        points = self.groups()
        for solver in {key[3] for key in points}:
            section = self.ask("""[...document.querySelectorAll('section[id^=solver-]')].filter(each =>
                each.querySelector('h2').textContent === arguments[0]).map(each => each.textContent)""", solver)
            self.assertEqual(len(section), 1, solver)
            solved = sum(all(row["status"] == "solved" for row in rows) for key, rows in points.items() if key[3] == solver)
            if solved:
                self.assertIn(f"solved {solved}", section[0])
            self.assertIn("Worst instance", section[0])
        slowest = max((key for key in points if key[3] == "primal_interior_point"),
                      key=lambda key: (any(row["status"] != "solved" for row in points[key]), key[2]))
        text = self.ask("""[...document.querySelectorAll('section[id^=solver-]')].find(each =>
            each.querySelector('h2').textContent === 'primal_interior_point').textContent""")
        self.assertIn(f"Worst instance: {slowest[1]}, Q = {slowest[2]}", text)


class Design(Page):
    """The page of a design against design.json; the robot's poses turn."""
    command = ["solve", "robot.h5", "--gap", "1e-9", "-o", "design.json", "--report", "page.html", "--model", "default"]
    page = "page.html"

    @classmethod
    def prepare(cls):
        subprocess.run([GRAYBOX, "problem", "robot", "--grid", "300", "-o", "robot.h5"], cwd=cls.folder.name,
                       capture_output=True, check=True)

    def setUp(self):
        super().setUp()
        self.design = json.loads((self.file.parent / "design.json").read_text(encoding="utf-8"))
        self.data = json.loads(self.ask("document.getElementById('data').textContent"))

    def test_table_is_the_design(self):
        support = {entry["index"]: entry for entry in self.design["support"]}
        rows = self.ask("""[...document.querySelectorAll('#design tbody tr')].map(row =>
            [...row.cells].map(cell => Number(cell.dataset.value)))""")
        self.assertEqual({row[1] for row in rows}, set(support))
        self.assertEqual([row[0] for row in rows], list(range(1, len(support) + 1)))
        for row in rows:
            entry = support[row[1]]
            self.assertEqual(row[2:8], list(entry["candidate"].values()))
            self.assertAlmostEqual(row[8], entry["weight"], delta=1e-8)
        heads = self.browser.find_element(By.CSS_SELECTOR, "#design thead").text
        self.assertIn("q2 [deg]", heads)
        link = self.browser.find_element(By.CSS_SELECTOR, "a[download='design.csv']")
        lines = unquote(link.get_dom_attribute("href").split(",", 1)[1]).splitlines()
        self.assertEqual(len(lines), len(rows) + 1)

    def test_certificate_touches_the_bound_and_nothing_exceeds_it(self):
        plot = self.data["plots"][0]
        series = {each["name"]: each for each in plot["series"]}
        everyone, chosen = series["candidates"], series["in the design"]
        self.assertEqual(len(everyone["x"]), self.design["candidates"])
        self.assertLessEqual(max(everyone["y"]), 1 + self.design["certificate"]["duality_gap"] + 1e-5)
        self.assertEqual(chosen["x"], sorted(entry["index"] for entry in self.design["support"]))
        for value, entry in zip(chosen["y"], sorted(self.design["support"], key=lambda entry: entry["index"])):
            self.assertAlmostEqual(value, 1, delta=1e-5 / entry["weight"])
        # Weighted by the design, sensitivities are one in the mean: tr(G M) = 1.
        mean = sum(everyone["y"][entry["index"]] * entry["weight"] for entry in self.design["support"])
        self.assertAlmostEqual(mean, 1, delta=1e-5)

    def test_numbers_are_those_of_the_file(self):
        text = self.browser.find_element(By.ID, "numbers").text
        self.assertIn(f"{self.design['log_det']:.8g}", text)
        self.assertIn(f"{self.design['certificate']['duality_gap']:.2e}", text)

    def test_poses_turn_by_button_key_and_drag(self):
        line = "document.querySelector('[data-pose] polyline').getAttribute('points')"
        self.assertEqual(len(self.data["poses"][0]["poses"]), len(self.design["support"]))
        seen = [self.ask(line)]
        scene = self.browser.find_element(By.CSS_SELECTOR, "svg[data-poses]")
        self.ask("arguments[0].scrollIntoView({block: 'center', behavior: 'instant'})", scene)
        self.browser.find_element(By.XPATH, "//button[text()='Turn left']").click()
        seen.append(self.ask(line))
        scene.send_keys(Keys.ARROW_UP)
        seen.append(self.ask(line))
        ActionChains(self.browser).move_to_element(scene).click_and_hold().move_by_offset(60, 20).release().perform()
        seen.append(self.ask(line))
        self.assertEqual(len(set(seen)), 4)
        self.browser.find_element(By.XPATH, "//button[text()='Back']").click()
        self.assertEqual(self.ask(line), seen[0])  # the script draws what the program drew

    def test_a_pose_can_be_hidden(self):
        pose = self.browser.find_element(By.CSS_SELECTOR, "[data-pose='0']")
        button = self.browser.find_element(By.CSS_SELECTOR, "#robot .key button")
        self.ask("arguments[0].click()", button)
        self.assertFalse(pose.is_displayed())
        self.ask("arguments[0].click()", button)
        self.assertTrue(pose.is_displayed())


class ExactDesign(Design):
    command = ["exact", "robot.h5", "--experiments", "8", "--gap", "0.02", "-o", "design.json", "--report", "page.html",
               "--model", "default"]

    def test_table_is_the_design(self):
        counts = {entry["index"]: entry["count"] for entry in self.design["counts"]}
        rows = self.ask("""[...document.querySelectorAll('#design tbody tr')].map(row =>
            [...row.cells].map(cell => Number(cell.dataset.value)))""")
        self.assertEqual({row[1]: row[8] for row in rows}, counts)

    def test_certificate_touches_the_bound_and_nothing_exceeds_it(self):
        everyone = self.data["plots"][0]["series"][0]
        mean = sum(everyone["y"][entry["index"]] * entry["weight"] for entry in self.design["support"])
        self.assertAlmostEqual(mean, 1, delta=1e-5)
        self.assertGreater(max(everyone["y"]), 1)  # whole numbers do not keep the bound of fractions

    def test_numbers_are_those_of_the_file(self):
        self.assertIn(f"{self.design['log_det']:.8g}", self.browser.find_element(By.ID, "numbers").text)


class RobustDesign(Page):
    command = ["design", "robust", "--samples", "3", "--grid", "100", "--uncertainty", "0.3", "-o", "design.json",
               "--report", "page.html"]
    page = "page.html"

    def test_prices_prove_the_design(self):
        plot = json.loads(self.ask("document.getElementById('data').textContent"))["plots"][0]
        self.assertLessEqual(max(plot["series"][0]["y"]), 1 + 1e-4)
        self.assertGreater(len(self.ask("window.poses[0].scene.poses")), 3)


class DesignUnderLimits(Page):
    command = ["solve", "robot.h5", "--experiments", "20", "--stock", "1", "--report", "page.html"]
    page = "page.html"

    @classmethod
    def prepare(cls):
        Design.prepare.__func__(cls)

    def test_only_candidates_at_their_limit_exceed_the_bound(self):
        plot = json.loads(self.ask("document.getElementById('data').textContent"))["plots"][0]
        everyone, chosen = plot["series"][0], plot["series"][2]
        weight = dict(self.ask("""[...document.querySelectorAll('#design tbody tr')].map(row =>
            [Number(row.cells[1].dataset.value), Number(row.cells[8].dataset.value)])"""))
        above = [x for x, y in zip(everyone["x"], everyone["y"]) if y > 1 + 1e-4]
        self.assertGreater(len(above), 3)
        for candidate in above:
            self.assertAlmostEqual(weight[candidate], 1 / 20, delta=1e-6)
        self.assertEqual(set(chosen["x"]), set(weight))


def load_tests(loader, _standard, _pattern):
    return unittest.TestSuite(loader.loadTestsFromTestCase(case) for case in [
        Diagnosis, Prediction, Fit, Study, Design, ExactDesign, RobustDesign, DesignUnderLimits])


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0]], verbosity=1)
