"""Installed: a wheel holds all package data and works in any folder; modules that hide ours are named."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from softflagella.shadowing import PACKAGES
from tests.processes import LIMIT, ROOT

IN_WHEEL = ("softflagella", *PACKAGES)
CODE = (".py", ".pyc", ".nbi", ".nbc")


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build the wheel of the tracked files, and unpack it."""
    source, unpacked = tmp_path_factory.mktemp("source"), tmp_path_factory.mktemp("installed")
    ignored = shutil.ignore_patterns("__pycache__")
    for package in IN_WHEEL:
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
    files = (file for package in IN_WHEEL for file in (root / package).rglob("*") if file.is_file())
    return {str(f.relative_to(root)) for f in files if f.suffix not in CODE and "__pycache__" not in f.parts}


@pytest.mark.rest
def test_all_package_data_are_in_the_wheel(wheel: Path) -> None:
    expected = data_files(ROOT)
    assert {
        "dataset/sweep.toml", "softflagella/demo.toml", "softflagella/py.typed", "softflagella/__init__.pyi",
        "surrogate/shipped/model.safetensors", "planner/c/schedule.h",
    } <= expected  # fmt: skip
    assert data_files(wheel) == expected


@pytest.mark.rest
def test_the_demo_s_sweep_runs_from_the_wheel(wheel: Path, tmp_path: Path) -> None:
    """The demo's robot and its sweep, in another folder, from the unpacked wheel alone."""
    code = (
        "import softflagella.demo as demo, softflagella as sf, pathlib\n"
        f"assert demo.__file__.startswith({str(wheel)!r}), demo.__file__\n"
        "demo.run_steps(demo.CHAINS[:1], pathlib.Path('.'))\n"
        "assert sf.load_robot('robot.toml').tails == 2\n"
        "from dataset.design import load_design\n"
        "from softflagella.demo_steps import SWEEP_TOML\n"
        "assert load_design().rows > load_design(SWEEP_TOML).rows > 0\n"
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


def run_script(folder: Path, code: str, *, first: str = "") -> subprocess.CompletedProcess[str]:
    """Run a script in a folder; softflagella is found after what lies beside the script, and after `first`."""
    script = folder / "my_script.py"
    script.write_text(code)
    path = os.pathsep.join(part for part in (first, str(ROOT)) if part)
    environment = {**os.environ, "PYTHONPATH": path}
    words = [sys.executable, str(script)]
    return subprocess.run(words, capture_output=True, text=True, cwd=folder, timeout=LIMIT, env=environment)


def last_line(*given: object, first: str = "") -> str:
    return run_script(*given, first=first).stderr.splitlines()[-1]  # type: ignore[arg-type]


def test_a_file_or_a_package_beside_a_script_is_named(tmp_path: Path) -> None:
    assert {"common", "sim", "camera", "dataset", "surrogate", "planner", "tracking", "calibration"} == set(
        PACKAGES
    )
    (tmp_path / "planner").mkdir()
    for name, file in (("sim", tmp_path / "sim.py"), ("planner", tmp_path / "planner" / "__init__.py")):
        file.write_text("x = 1\n")
        last = last_line(tmp_path, "import softflagella\n")
        assert last.startswith(f"ImportError: {file} hides the package '{name}' of softflagella ({ROOT / name})")
        assert last.endswith("rename it, or run from another folder")
        file.unlink()


def test_a_folder_without_code_hides_nothing(tmp_path: Path) -> None:
    (tmp_path / "dataset").mkdir()
    done = run_script(
        tmp_path, "import softflagella as sf, dataset.folder; print(sf.load_robot('paper-control').tails)"
    )
    assert (done.stdout, done.returncode) == ("2\n", 0), done.stderr


def test_a_folder_that_does_hide_a_package_is_named(tmp_path: Path) -> None:
    """Where softflagella is installed for development, another folder of the name comes first."""
    (tmp_path / "dataset").mkdir()
    code = f"""
import sys
from importlib.machinery import PathFinder
from pathlib import Path
class Last:
    def find_spec(name, path=None, target=None):
        return PathFinder.find_spec(name, [{str(ROOT)!r}]) if path is None else None
sys.path = [p for p in sys.path if not Path(p, "softflagella").is_dir()]
sys.meta_path.append(Last)
import softflagella
"""
    assert f"{tmp_path / 'dataset'} hides the package 'dataset'" in last_line(tmp_path, code)


def test_another_package_of_the_index_is_named(tmp_path: Path) -> None:
    installed = tmp_path / "site-packages"
    (installed / "dataset").mkdir(parents=True)
    (installed / "dataset" / "__init__.py").write_text("")
    last = last_line(tmp_path, "import softflagella\n", first=str(installed))
    assert f"{installed / 'dataset' / '__init__.py'} hides the package 'dataset'" in last
    assert "uninstall that package (pip uninstall dataset)" in last


def test_a_module_that_was_imported_before_is_named(tmp_path: Path) -> None:
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "sim.py").write_text("")
    code = "import sys; sys.path.insert(0, 'other'); import sim; sys.path.remove('other'); import softflagella\n"
    assert "hides the package 'sim'" in last_line(tmp_path, code)
