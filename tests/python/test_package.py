"""The module as users get it: a wheel, an installation, type stubs, no names without a word."""
import ast
import inspect
import os
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

import graybox

SOURCE, BUILD = Path(os.environ["GRAYBOX_SOURCE"]), os.environ["GRAYBOX_BUILD"]
SOLVES = """import numpy as np, graybox
H = np.eye(3)[:, :, None] * np.eye(3)[:, None, :]
print(graybox.__file__, graybox.solve(H).status)
"""


def solved_with(folder):
    """What the few lines print with the module of that folder."""
    environment = {**os.environ, "PYTHONPATH": str(folder)}
    return subprocess.run([sys.executable, "-c", SOLVES], cwd=folder, env=environment, check=True,
                          capture_output=True, text=True).stdout


class Package(unittest.TestCase):
    def setUp(self):
        self._folder = tempfile.TemporaryDirectory()
        self.addCleanup(self._folder.cleanup)
        self.folder = Path(self._folder.name)

    def pip(self, *arguments):
        done = subprocess.run([sys.executable, "-m", "pip", "--disable-pip-version-check",
                               *map(str, arguments)], cwd=SOURCE, capture_output=True, text=True)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)

    def test_wheel(self):
        self.pip("wheel", ".", "--no-build-isolation", "--no-deps", "--wheel-dir", self.folder,
                 "--config-settings", f"build-dir={BUILD}")
        wheels = list(self.folder.glob("graybox-*.whl"))
        self.assertEqual(len(wheels), 1)
        place = self.folder / "site"
        self.pip("install", "--no-index", "--no-deps", "--target", place, wheels[0])
        self.assertTrue((place / "graybox/py.typed").exists())
        out = solved_with(place)
        self.assertIn(str(place), out)
        self.assertIn("solved", out)

    def test_installation(self):
        subprocess.run(["cmake", "--install", BUILD, "--component", "python", "--prefix",
                        self.folder], check=True, stdout=subprocess.DEVNULL)
        place = next(self.folder.rglob("__init__.py")).parent.parent
        self.assertEqual(place.relative_to(self.folder).parts[0], "lib")
        self.assertIn(str(place), solved_with(place))


class Stubs(unittest.TestCase):
    """The stubs have the names and the parameters of the code."""

    def test_every_name_is_there_with_its_parameters(self):
        for module, file in ((graybox, "__init__.pyi"), (graybox.study, "study.pyi")):
            tree = ast.parse((SOURCE / "python/graybox" / file).read_text())
            self.held_against(module, tree.body)

    def held_against(self, module, body):
        functions = {node.name: node for node in body if isinstance(node, ast.FunctionDef)}
        classes = {node.name: node for node in body if isinstance(node, ast.ClassDef)}
        public = getattr(module, "__all__", ["run", "Problem", "Row", "Study"])
        for name in public:
            value = getattr(module, name)
            if inspect.isfunction(value):
                self.assertIn(name, functions)
                arguments = functions[name].args
                stated = [each.arg for each in arguments.args + arguments.kwonlyargs]
                parameters = inspect.signature(value).parameters.values()
                known = [each.name for each in parameters if each.kind not in (
                    inspect.Parameter.VAR_KEYWORD, inspect.Parameter.VAR_POSITIONAL)]
                self.assertEqual([each for each in stated if each in known], known, name)
            elif inspect.isclass(value):
                self.assertIn(name, classes)

    def test_every_name_says_what_it_does(self):
        for name in graybox.__all__:
            if not name.startswith("__"):
                self.assertTrue((getattr(graybox, name).__doc__ or "").strip(), name)


if __name__ == "__main__":
    unittest.main()
