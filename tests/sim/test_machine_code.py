"""Compiled functions import numba on their first call, call one another, and are told by their names."""

from __future__ import annotations

import pickle
import subprocess
import sys
from pathlib import Path

from sim.compiling import Loop
from sim.linear.dense import invert, solve_dense
from sim.linear.vectors import dot
from tests.processes import LIMIT

ROOT = Path(__file__).parents[2]
LAZY = """
import sys
import numpy as np
import sim.solve.orbit, sim.motion.steady, sim.motion.response
from sim.linear.dense import solve_dense
print("numba" in sys.modules)
a, b = 2 * np.eye(3), np.ones((3, 1))
solve_dense(a, b)
print("numba" in sys.modules, b.ravel().tolist())
"""


def test_numba_is_imported_on_the_first_call() -> None:
    done = subprocess.run(
        [sys.executable, "-c", LAZY], capture_output=True, text=True, check=True, cwd=ROOT, timeout=LIMIT
    )
    assert done.stdout.split("\n")[:2] == ["False", "True [0.5, 0.5, 0.5]"]


def test_a_compiled_function_keeps_its_name_and_can_be_sent_to_processes() -> None:
    loop: object = solve_dense
    assert isinstance(loop, Loop)
    assert loop.__name__ == "solve_dense"
    assert loop.__doc__ is not None
    assert loop.__doc__.startswith("Solve b")
    assert pickle.loads(pickle.dumps(invert)) is invert


def test_a_formula_is_plain_python() -> None:
    assert dot((1.0, 2.0, 3.0), (4.0, 5.0, 6.0)) == 32.0
