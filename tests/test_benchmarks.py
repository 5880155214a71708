"""The command of the benchmarks lists each of them, and refuses other names."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]


def benchmarks(*words: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "benchmarks", *words]
    return subprocess.run(command, capture_output=True, text=True, cwd=ROOT, timeout=300)


def test_the_list_names_each_benchmark() -> None:
    listed = [line[2:].split()[0] for line in benchmarks().stdout.splitlines()[1:] if line[:2] in ("* ", "  ")]
    files = (ROOT / "benchmarks").glob("*/*.py")
    assert sorted(listed) == sorted(file.stem for file in files if "\ndef main(" in file.read_text())


def test_an_unknown_name_is_refused() -> None:
    done = benchmarks("accurracy")
    assert (done.returncode, done.stderr) == (
        2,
        "error: no benchmark 'accurracy'; `python -m benchmarks` lists all\n",
    )
