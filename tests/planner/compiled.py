"""C and C++ compiled with all warnings as errors, with tables in memory or in the flash of a pretended AVR."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

from tests.processes import LIMIT

WARNINGS = ("-Wall", "-Wextra", "-Werror", "-pedantic")
LANGUAGES = {
    "c99": ("-std=c99", *WARNINGS, "-O2"),
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
