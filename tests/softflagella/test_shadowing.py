"""A module of the user that hides a package of ours is named at the import of softflagella."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from softflagella.shadowing import PACKAGES
from tests.processes import LIMIT

ROOT = Path(__file__).parents[2]


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
    assert {"sim", "camera", "dataset", "surrogate", "planner", "calibration"} == set(PACKAGES)
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
