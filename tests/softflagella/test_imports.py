"""What answers need at run time: torch is for training alone, slow libraries are imported where they are used."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from planner.files.plan_files import write_plan
from planner.paths.path import circle
from planner.planning.plan import plan
from sim.model.presets import PRESETS
from tests.processes import LIMIT

SLOW = ("torch", "scipy.stats", "scipy.interpolate", "scipy.optimize", "scipy.spatial", "matplotlib", "joblib")
TABLES = ("pandas", "pyarrow")
COMMAND = "import sys; from softflagella.__main__ import main; main(sys.argv[1:]); "
SAY = "print('\\nloaded:', *(name for name in {slow} if name in sys.modules))"


def loaded(code: str, *words: str, slow: tuple[str, ...] = (*SLOW, *TABLES)) -> list[str]:
    """Return which of the slow libraries a process has loaded at the end of some code."""
    done = subprocess.run(
        [sys.executable, "-c", code + SAY.format(slow=slow), *words],
        capture_output=True, text=True, check=True, timeout=LIMIT, cwd=Path(__file__).parents[2],
    )  # fmt: skip
    return done.stdout.splitlines()[-1].split()[1:]


@pytest.mark.parametrize(
    "words",
    [("query", "paper-control"), ("steady", "paper-control"), ("plan", "circle:1.5l", "--robot", "paper-control")],
)
def test_a_command_loads_no_torch(words: tuple[str, ...], tmp_path: Path) -> None:
    folder = ("--out", str(tmp_path)) if words[0] == "plan" else ()
    assert loaded(COMMAND, *words, *folder) == []
    assert bool(folder) == (tmp_path / "plan.json").exists()


def test_training_looks_at_its_files_before_it_loads_torch(tmp_path: Path) -> None:
    code = "import sys; from sim.io.errors import run_command; from softflagella.__main__ import main; "
    refused = "assert run_command(main, sys.argv[1:]) == 2; "
    assert loaded(code + refused, "train", str(tmp_path), "--out", str(tmp_path / "m"), slow=("torch",)) == []


def test_a_replay_loads_no_torch(tmp_path: Path) -> None:
    write_plan(plan(circle(1.0), PRESETS["paper-control"]), tmp_path)
    assert (
        loaded(COMMAND, "replay", str(tmp_path / "plan.json"), "--out", str(tmp_path / "track.csv"), slow=SLOW)
        == []
    )
    assert (tmp_path / "track.csv").exists()


def test_answers_from_python_load_no_torch() -> None:
    """With a dwell, intervals, derivatives and tracking."""
    code = """
import sys, numpy as np, softflagella as sf
robot = sf.load_robot("paper-control")
columns = {name: np.array([value]) for name, value in robot.group_values().items()}
table = sf.load_table()
table.query(columns | {"dwell_bar": np.array([1.0])}, intervals=True)
table.response(columns)
table.jacobian(columns, ["C_t", "disc_drag"])
sf.Tracker(sf.plan(sf.circle(2.0), robot)).update(0.0)
"""
    assert loaded(code, slow=("torch", "scipy.stats", "scipy.interpolate", "scipy.optimize", "joblib")) == []
