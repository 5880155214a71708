"""A wheel holds all package data, and its `softflagella demo` works away from the repository."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PACKAGES = ("softflagella", "sim", "camera", "dataset", "surrogate", "planner", "calibration")
CODE = (".py", ".pyc", ".nbi", ".nbc")


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build the wheel of the tracked files, and unpack it."""
    source, unpacked = tmp_path_factory.mktemp("source"), tmp_path_factory.mktemp("installed")
    ignored = shutil.ignore_patterns("__pycache__")
    for package in PACKAGES:
        shutil.copytree(ROOT / package, source / package, ignore=ignored)
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, source)
    words = ["wheel", "--no-deps", "--no-build-isolation", "--quiet", "--wheel-dir", str(source), str(source)]
    subprocess.run([sys.executable, "-m", "pip", *words], check=True, timeout=600)
    (built,) = source.glob("*.whl")
    with zipfile.ZipFile(built) as archive:
        archive.extractall(unpacked)
    return unpacked


def data_files(root: Path) -> set[str]:
    """List files of the packages that are no code."""
    files = (file for package in PACKAGES for file in (root / package).rglob("*") if file.is_file())
    return {str(f.relative_to(root)) for f in files if f.suffix not in CODE and "__pycache__" not in f.parts}


@pytest.mark.rest
def test_all_package_data_are_in_the_wheel(wheel: Path) -> None:
    expected = data_files(ROOT)
    assert {
        "dataset/sweep.toml", "softflagella/demo.toml", "softflagella/py.typed", "softflagella/__init__.pyi",
        "surrogate/shipped/model.safetensors", "surrogate/readers/lookup.h", "planner/c/tracker.h",
    } <= expected  # fmt: skip
    assert data_files(wheel) == expected


@pytest.mark.rest
def test_the_demo_s_sweep_runs_from_the_wheel(wheel: Path, tmp_path: Path) -> None:
    """The demo's robot and its sweep, in another folder, from the unpacked wheel alone."""
    code = (
        "import softflagella.demo as demo, softflagella as sf, pathlib\n"
        f"assert demo.__file__.startswith({str(wheel)!r}), demo.__file__\n"
        "robot, motions = demo._look(pathlib.Path('.'))\n"
        "assert len(motions) == 2 and sf.load_robot('robot.toml').tails == 2\n"
        "from dataset.design import load_design\n"
        "assert load_design().rows > load_design(demo.SWEEP_TOML).rows > 0\n"
    )
    cache = next((ROOT / "sim" / "__pycache__").glob("compiled-*"), None)
    if cache:  # machine code does not depend on the folder of its sources
        shutil.copytree(ROOT / "sim" / "__pycache__", wheel / "sim" / "__pycache__", dirs_exist_ok=True)
    environment = {**os.environ, "PYTHONPATH": str(wheel), "PYTHONSAFEPATH": "1"}
    for words in (["-c", code], ["-m", "softflagella", "--version"], ["-m", "softflagella", "sim", "check"]):
        done = subprocess.run(
            [sys.executable, *words], cwd=tmp_path, env=environment, text=True, capture_output=True, timeout=900
        )
        assert done.returncode == 0, done.stderr
