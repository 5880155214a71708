"""What answers need at run time: torch is for training alone, slow libraries are imported where they are used."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from tests.processes import LIMIT

SLOW = ("torch", "scipy.stats", "scipy.integrate", "matplotlib", "joblib")
CODE = f"""
import sys
def check(*slow):
    assert not set(slow) & set(sys.modules), set(slow) & set(sys.modules)
import softflagella as sf
check("numpy", "torch", "numba", "pandas", "matplotlib", "scipy", "pyarrow", "sim")
from sim.io.errors import run_command
from softflagella.__main__ import main
folder = sys.argv[1]
main(["query", "paper-control"])
main(["steady", "paper-control"])
main(["plan", "circle:1l", "--robot", "paper-control", "--objective", "flips", "--out", folder])
check(*{SLOW!r}, "pandas", "pyarrow")
main(["replay", folder + "/plan.json", "--out", folder + "/track.csv"])
check(*{SLOW!r})
assert run_command(main, ["train", folder, "--out", folder + "/m"]) == 2
import numpy as np
robot = sf.load_robot("paper-control")
columns = {{name: np.array([value]) for name, value in robot.group_values().items()}}
table = sf.load_table()
table.query(columns | {{"dwell_bar": np.array([1.0])}}, intervals=True)
table.response(columns)
table.derivatives(columns, ["C_t", "disc_drag"])
sf.Tracker(sf.restore_plan(folder + "/plan.json")).update(0.0)
check("torch", "scipy.stats", "scipy.integrate", "joblib")
"""


def test_commands_and_answers_from_python_load_what_they_need(tmp_path: Path) -> None:
    """A replay writes a table; training looks at its files before it loads torch."""
    done = subprocess.run(
        [sys.executable, "-c", CODE, str(tmp_path)],
        capture_output=True, text=True, timeout=LIMIT, cwd=Path(__file__).parents[2],
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "track.csv").exists()
