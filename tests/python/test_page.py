"""docs/how_to/python.md: its code runs, one block after the other, and prints what the page quotes.

A quoted [...] stands for any text.
"""
import contextlib
import io
import os
import re
import tempfile
import unittest
from pathlib import Path

import arm_log
from sets import DRIVE, SOURCE

PAGE = (Path(SOURCE) / "docs/how_to/python.md").read_text()
BLOCK = re.compile(r"^```python\n(.*?)^```\n(?:\n```\n(.*?)^```\n)?", re.MULTILINE | re.DOTALL)


def pattern(quoted):
    return ".*?".join(re.escape(part) for part in quoted.strip().split("[...]"))


class Page(unittest.TestCase):
    def test_code_runs_and_prints_what_is_quoted(self):
        blocks = BLOCK.findall(PAGE)
        self.assertGreaterEqual(len(blocks), 8)
        self.assertGreaterEqual(sum(bool(quoted) for _, quoted in blocks), 2)
        back = os.getcwd()
        with tempfile.TemporaryDirectory() as folder:
            self.addCleanup(os.chdir, back)
            os.chdir(folder)
            arm_log.write(Path(folder))
            for number in (1, 2):
                Path(f"run_{number}.csv").write_bytes(Path(DRIVE, f"run_{number}.csv").read_bytes())
            names = {}
            for code, quoted in blocks:
                out = io.StringIO()
                with contextlib.redirect_stdout(out):
                    exec(compile(code, "docs/how_to/python.md", "exec"), names)
                if quoted:
                    self.assertRegex(out.getvalue().strip(),
                                     re.compile(r"\A" + pattern(quoted) + r"\Z", re.DOTALL), code)
            os.chdir(back)

    def test_the_two_beginnings_have_five_lines(self):
        for code, _ in BLOCK.findall(PAGE)[:2]:
            self.assertLessEqual(len(code.strip().splitlines()), 5)


if __name__ == "__main__":
    unittest.main()
