#!/usr/bin/env python3
"""What the filter of scripts/kill_test leaves out: times, and nothing else.

    python3 tests/kill_test_test.py SOURCE_FOLDER
"""
import importlib.machinery
import importlib.util
import json
import pathlib
import re
import sys
import tempfile
import unittest

ROOT = pathlib.Path(sys.argv.pop()).resolve() if len(sys.argv) > 1 else pathlib.Path(__file__).resolve().parent.parent
sys.dont_write_bytecode = True
loader = importlib.machinery.SourceFileLoader("kill_test", str(ROOT / "scripts" / "kill_test"))
kill_test = importlib.util.module_from_spec(importlib.util.spec_from_loader("kill_test", loader))
loader.exec_module(kill_test)


def filtered(name, text):
    """Of a file that names its folder by FOLDER."""
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder) / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(text.replace("FOLDER", folder))
        return kill_test.filtered(path, pathlib.Path(name))


class Filter(unittest.TestCase):
    def test_leaves_out_every_time_and_memory_of_a_row(self):
        source = (ROOT / "bench" / "study" / "run_row.cpp").read_text()
        written = source[source.index("void to_json(json& out, const RunRow& row)"):]
        written = written[:written.index("\n}\n")]
        names = set(re.findall(r'\{"(\w*(?:seconds|bytes))"', written))
        self.assertGreaterEqual(len(names), 7)
        row = {"kind": "run", "repetition": 0, "trace": [], "reached": {}, "passes": 3.0}
        for name in names:
            first, second = ({**row, name: value} for value in (1.0, 2.0))
            self.assertEqual(filtered("study/rows.jsonl", json.dumps(first) + "\n"),
                             filtered("study/rows.jsonl", json.dumps(second) + "\n"), name)

    def test_keeps_the_rest_of_a_row(self):
        row = {"kind": "run", "repetition": 0, "trace": [], "reached": {}, "passes": 3.0}
        self.assertNotEqual(filtered("study/rows.jsonl", json.dumps(row) + "\n"),
                            filtered("study/rows.jsonl", json.dumps({**row, "passes": 4.0}) + "\n"))

    def test_leaves_out_the_seconds_and_the_folder_of_a_page_only(self):
        template = (ROOT / "diagnosis" / "report" / "page.mustache").read_text()
        line = re.search(r"<p>Written by .*</p>", template).group()
        line = re.sub(r"\{\{[#/]has_seconds\}\}", "", line).replace("{{written_by}}", "graybox 1.2")

        def page(seconds, words):
            return filtered("report.html", f"<p>{words}</p>\n-o FOLDER/answers\n{line.replace('{{seconds}}', seconds)}\n")

        self.assertEqual(page("3.3", "settled in 3.3 s."), page("12", "settled in 3.3 s."))
        self.assertNotEqual(page("3.3", "settled in 3.3 s."), page("3.3", "settled in 3.4 s."))


if __name__ == "__main__":
    unittest.main()
