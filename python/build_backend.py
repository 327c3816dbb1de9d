"""Makes the wheel for pip (PEP 517): CMake builds and installs the module, this packs it.

    pip wheel . --no-build-isolation --no-deps
    pip wheel . --no-build-isolation --no-deps --config-settings build-dir=build/release

A build tree that is there is used: the one that is named, else build/release if it is for the same
interpreter. Without one, all of graybox that the module needs is compiled in build/wheel.
"""
import re
import subprocess
import sys
import sysconfig
import tempfile
from pathlib import Path

from wheel.wheelfile import WheelFile

ROOT = Path(__file__).resolve().parent.parent
SUFFIX = sysconfig.get_config_var("EXT_SUFFIX")


def _version():
    text = (ROOT / "CMakeLists.txt").read_text()
    return re.search(r"project\(graybox VERSION ([\d.]+)", text).group(1)


def _cached(build, name):
    """The value of a variable in CMake's cache; None where there is no such build tree."""
    cache = build / "CMakeCache.txt"
    if not cache.exists():
        return None
    found = re.search(rf"^{name}:\w+=(.*)$", cache.read_text(), re.MULTILINE)
    return found.group(1) if found else None


def _build_tree(settings):
    if settings and settings.get("build-dir"):
        return (ROOT / settings["build-dir"]).resolve()
    release = ROOT / "build/release"
    if (_cached(release, "GRAYBOX_WITH_PYTHON") == "ON"
            and _cached(release, "PYTHON_MODULE_EXTENSION") == SUFFIX):
        return release
    build = ROOT / "build/wheel"
    subprocess.run(["cmake", "-S", ROOT, "-B", build, "-G", "Ninja", "-DCMAKE_BUILD_TYPE=Release",
                    "-DGRAYBOX_BUILD_TESTS=OFF", "-DGRAYBOX_BUILD_BENCHMARKS=OFF",
                    "-DGRAYBOX_WITH_PYTHON=ON", f"-DGRAYBOX_PYTHON_INTERPRETER={sys.executable}"],
                   check=True)
    return build


def _metadata(version):
    return (f"Metadata-Version: 2.1\nName: graybox\nVersion: {version}\n"
            "Summary: Optimal experiment design for gray-box models, and the physics they leave out\n"
            "License: MIT\nRequires-Python: >=3.9\nRequires-Dist: numpy\n")


def build_wheel(wheel_directory, config_settings=None, metadata_directory=None):
    build, version = _build_tree(config_settings), _version()
    python = f"cp{sys.version_info.major}{sys.version_info.minor}"
    tag = f"{python}-{python}-{sysconfig.get_platform().replace('-', '_').replace('.', '_')}"
    name = f"graybox-{version}-{tag}.whl"
    subprocess.run(["cmake", "--build", build, "--target", "graybox_python"], check=True)
    with tempfile.TemporaryDirectory() as folder:
        stage = Path(folder)
        subprocess.run(["cmake", "--install", build, "--component", "python", "--prefix", stage],
                       check=True, stdout=subprocess.DEVNULL)
        package = next(stage.rglob("__init__.py")).parent
        with WheelFile(Path(wheel_directory) / name, "w") as wheel:
            for file in sorted(package.iterdir()):
                wheel.write(file, f"graybox/{file.name}")
            info = f"graybox-{version}.dist-info"
            wheel.write(ROOT / "LICENSE", f"{info}/LICENSE")
            wheel.writestr(f"{info}/METADATA", _metadata(version))
            wheel.writestr(f"{info}/WHEEL", "Wheel-Version: 1.0\nGenerator: graybox\n"
                                            f"Root-Is-Purelib: false\nTag: {tag}\n")
    return name
