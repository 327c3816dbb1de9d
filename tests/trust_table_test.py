#!/usr/bin/env python3
"""The table of findings in tests/README.md: every id is there, and every test that it names exists.

    python3 tests/trust_table_test.py SOURCE_FOLDER
"""
import pathlib
import re
import sys
import unittest

ROOT = pathlib.Path(sys.argv.pop()).resolve() if len(sys.argv) > 1 else pathlib.Path(__file__).resolve().parent.parent
COUNTS = {"A": 7, "B": 5, "C": 7, "D": 6, "E": 9, "S": 8}
IDS = [f"{group}{number}" for group, count in COUNTS.items() for number in range(1, count + 1)]


def rows_of(page):
    return {id: re.findall(r"`([\w./]+)`", tests)
            for id, tests in re.findall(r"^\| ([A-Z]\d) \|.*\|([^|]*)\|$", page, re.MULTILINE)}


def tests_of(sources):
    names = set()
    for text in sources:
        names |= {".".join(pair) for pair in re.findall(r"^TEST(?:_[FP])?\(\s*(\w+),\s*(\w+)\)", text, re.MULTILINE)}
        names |= set(re.findall(r"add_test\(NAME ([\w.]+)", text))
        for suite, body in re.findall(r"^class (\w+)\(unittest\.TestCase\):(.*?)(?=^\S|\Z)", text, re.MULTILINE | re.DOTALL):
            names |= {f"{suite}.{test}" for test in re.findall(r"^    def (test_\w+)", body, re.MULTILINE)}
    return names


def findings_of(text):
    """The ids that comments above tests name."""
    for line in re.findall(r"Findings? ([A-Z]\d[^.:\n]*)", text):
        yield from re.findall(r"\b[A-ES]\d\b", line)


class Table(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.rows = rows_of((ROOT / "tests" / "README.md").read_text(encoding="utf-8"))
        files = [path for ending in ("cpp", "py", "sh", "txt") for path in sorted((ROOT / "tests").rglob(f"*.{ending}"))
                 if "corpus" not in path.parts]
        cls.sources = [path.read_text(encoding="utf-8") for path in files if path.name != pathlib.Path(__file__).name]

    def test_has_a_row_for_every_id(self):
        self.assertEqual(sorted(self.rows), IDS)

    def test_names_tests_that_exist(self):
        known = tests_of(self.sources)
        self.assertGreater(len(known), 1000)
        for id, tests in self.rows.items():
            self.assertTrue(tests, id)
            for test in tests:
                self.assertTrue(test in known or (ROOT / test).is_file(), f"{id}: there is no test {test}")

    def test_has_every_id_in_a_comment_at_a_test(self):
        named = {id for text in self.sources for id in findings_of(text)}
        self.assertEqual(sorted(set(IDS) - named), [])

    def test_would_miss_a_test_that_is_gone(self):
        self.assertNotIn("Nothing.IsHere", tests_of(self.sources))
        self.assertEqual(tests_of(["TEST_F(Some,\n       Thing) {", "add_test(NAME An.Other\n"]), {"Some.Thing", "An.Other"})
        self.assertEqual(rows_of("| A1 | holds | `X.Y`, `a/b` |\n"), {"A1": ["X.Y", "a/b"]})


if __name__ == "__main__":
    unittest.main()
