"""Flash, RAM and stack that tracker.h takes on a Cortex-M4.

The plan is a square of sides 3 l of the paper's control robot. The main loop is that of the how-to of the tracker,
compiled with -Os for the processor's floating-point unit. Not counted: the C library and the compiler's
routines for double precision. Needs Debian's gcc-arm-none-eabi.

Usage: python -m benchmarks code_size

Takes ten seconds.
"""

from __future__ import annotations

import re
import subprocess
from pathlib import Path
from tempfile import TemporaryDirectory

from planner.files.tracker_header import tracker_header
from planner.paths.path import polygon
from planner.planning.plan import plan
from sim.model.presets import PRESETS

_HOW_TO = Path(__file__).parents[2] / "docs" / "howto" / "tracker.md"
_COMPILE = ("arm-none-eabi-gcc", "-std=c99", "-Os", "-mcpu=cortex-m4", "-mthumb", "-mfpu=fpv4-sp-d16",
            "-mfloat-abi=hard", "-ffunction-sections", "-fstack-usage", "-c")  # fmt: skip


def sizes(folder: Path, *flags: str) -> dict[str, int]:
    """Compile main.c, and return bytes of code, tables and state, and of the largest frame of a function."""
    subprocess.run([*_COMPILE, *flags, "main.c", "-o", "main.o"], cwd=folder, check=True)
    listed = subprocess.run(["arm-none-eabi-size", "-A", "main.o"], cwd=folder, check=True, capture_output=True)
    sections = re.findall(r"^\.(text|rodata|bss)\S*\s+(\d+)", listed.stdout.decode(), re.MULTILINE)
    frames = [int(line.split("\t")[1]) for line in (folder / "main.su").read_text().splitlines()]
    totals = {
        name: sum(int(size) for kind, size in sections if kind == name) for name in ("text", "rodata", "bss")
    }
    return {"code": totals["text"], "tables": totals["rodata"], "state": totals["bss"], "frame": max(frames)}


def main() -> None:
    """Print a line for each precision."""
    result = plan(polygon(4, 3.0), PRESETS["paper-control"])
    code = re.search(r"```c\n(.*?)```", _HOW_TO.read_text(), re.DOTALL)
    assert code is not None
    with TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "tracker.h").write_text(tracker_header(result, "code_size"))
        (folder / "main.c").write_text(code[1])
        print(f"{len(result.reference)} points of the path; bytes")
        for precision, flags in (("single", ("-DTRACKER_FLOAT",)), ("double", ())):
            listed = ", ".join(f"{what} {size}" for what, size in sizes(folder, *flags).items())
            print(f"{precision} precision: {listed}")


if __name__ == "__main__":
    main()
