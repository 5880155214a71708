"""The C headers compiled: as C99, as C++, with their tables in the flash of a pretended or a real AVR.

`CompiledTracker` is tracker.h as a library, a tracker that is fed like `softflagella.Tracker`, in the plan's time
units.
"""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from planner.files.headers import tracker_header
from planner.planning.plan import Plan
from planner.tracking.kalman_filter import STATES
from planner.tracking.tracker import Command
from tests.processes import LIMIT

WARNINGS = ("-Wall", "-Wextra", "-Werror", "-pedantic")
FLAGS = ("-std=c99", *WARNINGS, "-O2")
LANGUAGES = {
    "c99": FLAGS,
    **{name: ("-x", "c++", f"-std={name}", *WARNINGS, "-O2") for name in ("c++11", "c++17")},
}
_FAKE_AVR = ("-D__AVR__", "-D_DEFAULT_SOURCE", "-I", str(Path(__file__).parent / "fake_avr"))
MEMORIES = {"constants": (), "near flash": _FAKE_AVR, "far flash": (*_FAKE_AVR, "-D__AVR_HAVE_ELPM__")}
SOURCES = Path(__file__).parent / "c"


def compile_c(source: Path, out: Path, *flags: str, language: str = "c99") -> None:
    """Compile a C file with all warnings as errors; the test is skipped where there is no compiler."""
    names = ("cc", "gcc") if language == "c99" else ("c++", "g++")
    compiler = next(filter(None, map(shutil.which, names)), None)
    if compiler is None:
        pytest.skip(f"no compiler for {language} on this machine")
    words = [compiler, *LANGUAGES[language], *flags, "-o", str(out), str(source), "-lm"]
    subprocess.run(words, check=True, timeout=LIMIT)


class CompiledTracker:
    """tracker.h behind the methods of `softflagella.Tracker`; one plan in one library."""

    def __init__(
        self, plan: Plan, folder: Path, *, single: bool = False, language: str = "c99", memory: str = "constants"
    ):
        (folder / "tracker.h").write_text(tracker_header(plan, "test"))
        shutil.copy(SOURCES / "library.c", folder)
        out = folder / f"library{int(single)}.so"
        flags = ("-shared", "-fPIC", *(["-DTRACKER_FLOAT"] if single else []), *MEMORIES[memory])
        compile_c(folder / "library.c", out, *flags, language=language)
        self._library = ctypes.CDLL(str(out))
        self._library.begin.argtypes = [ctypes.c_double, ctypes.c_double, ctypes.c_void_p]
        self._library.feed.argtypes = [ctypes.c_double, ctypes.c_void_p, ctypes.c_double, ctypes.c_void_p]
        self._library.finish.argtypes = [ctypes.c_void_p]
        self.plan, self.start, self._scale = plan, plan.start, plan.robot.time_scale
        self.memory: int = self._library.memory()
        self.restart()

    def restart(self, start: tuple[float, float, float] | None = None) -> None:
        place = None if start is None else np.array(start, dtype=float)
        self._library.begin(0.01, 0.01, None if place is None else place.ctypes.data)
        self.state = np.zeros(STATES)

    def update(
        self, now: float, pose: tuple[float, float, float] | None = None, seen_at: float | None = None
    ) -> Command:
        own = None if pose is None else np.array(pose, dtype=float)
        seen = now if seen_at is None else seen_at
        out = np.zeros(5 + STATES)
        address = None if own is None else own.ctypes.data
        self._library.feed(now * self._scale, address, seen * self._scale, out.ctypes.data)
        return self._command(out)

    def finish_lap(self) -> Command:
        out = np.zeros(5 + STATES)
        self._library.finish(out.ctypes.data)
        return self._command(out)

    def _command(self, out: np.ndarray) -> Command:
        self.state = out[5:]
        return Command(int(out[0]), float(out[1]) / self._scale, bool(out[2]), bool(out[3]), float(out[4]))
