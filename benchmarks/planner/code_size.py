"""Flash, RAM, stack and times of tracker.h on a Cortex-M4 and on an AVR.

The plan is a square of sides 3 l of the paper's control robot. For the Cortex-M4 the main loop is that of the
tracker's how-to, compiled with -Os for the floating-point unit. Its stack is that of the deepest chain of calls.
The C library and the compiler's routines for double precision are not counted there. For the ATmega2560
avr_tracker.c is compiled and run in a simulator at 16 MHz; its flash includes the C library, and printf with 2 kB.
Needs Debian's gcc-arm-none-eabi, gcc-avr, avr-libc and simavr.

Usage: python -m benchmarks code_size

Takes ten seconds.
"""

from __future__ import annotations

import re
import subprocess
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

from planner.files.tracker_header import tracker_header
from planner.paths.path import polygon
from planner.planning.plan import plan
from sim.model.presets import PRESETS

_HOW_TO = Path(__file__).parents[2] / "docs" / "howto" / "tracker.md"
_AVR_MAIN = Path(__file__).parent / "avr_tracker.c"
_AVR = "atmega2560"
_COMPILE = ("arm-none-eabi-gcc", "-std=c99", "-Os", "-mcpu=cortex-m4", "-mthumb", "-mfpu=fpv4-sp-d16",
            "-mfloat-abi=hard", "-ffunction-sections", "-fcallgraph-info=su", "-c")  # fmt: skip
_COMPILE_AVR = ("avr-gcc", "-std=gnu99", f"-mmcu={_AVR}", "-Os", "-DF_CPU=16000000UL")


def _output(folder: Path, *words: str) -> str:
    done = subprocess.run(words, cwd=folder, check=True, capture_output=True, text=True)
    return done.stdout + done.stderr


def cortex(folder: Path, *flags: str) -> dict[str, int]:
    """Compile main.c, and return bytes of code, tables and state, and of the deepest chain of calls."""
    subprocess.run([*_COMPILE, *flags, "main.c", "-o", "main.o"], cwd=folder, check=True)
    listed = _output(folder, "arm-none-eabi-size", "-A", "main.o")
    sections = re.findall(r"^\.(text|rodata|bss)\S*\s+(\d+)", listed, re.MULTILINE)
    totals = {
        name: sum(int(size) for kind, size in sections if kind == name) for name in ("text", "rodata", "bss")
    }
    stack = deepest((folder / "main.ci").read_text())
    return {"code": totals["text"], "tables": totals["rodata"], "state": totals["bss"], "stack": stack}


def deepest(graph: str) -> int:
    """Compute the stack of the deepest chain of calls in a compiler's call graph, in bytes."""
    frames = {name: int(size) for name, size in re.findall(r'title: "([^"]+)"[^}]*?\\n(\d+) bytes', graph)}
    calls = re.findall(r'sourcename: "([^"]+)" targetname: "([^"]+)"', graph)

    @cache
    def below(name: str) -> int:
        return frames.get(name, 0) + max((below(callee) for caller, callee in calls if caller == name), default=0)

    return max(map(below, frames))


def avr(folder: Path) -> str:
    """Compile avr_tracker.c and run it; return bytes and milliseconds as text."""
    _output(folder, *_COMPILE_AVR, "-I", str(folder), str(_AVR_MAIN), "-o", "main.elf", "-lm")
    sections = {
        kind: int(size)
        for kind, size in re.findall(
            r"^\.(text|data)\s+(\d+)", _output(folder, "avr-size", "-A", "main.elf"), re.M
        )
    }
    symbols = _output(folder, "avr-nm", "-S", "main.elf")
    state = int(re.findall(r"^\w+ (\w+) [bB] keeper$", symbols, re.MULTILINE)[0], 16)
    printed = _output(folder, "simavr", "-m", _AVR, "-f", "16000000", "main.elf")
    numbers = re.findall(r"flip (\d+) pose (\d+) way (\d+) stack (\d+)", printed)
    flip, pose, way, stack = map(int, numbers[0])
    flash = sections["text"] + sections["data"]
    return f"flash {flash}, state {state}, stack {stack}; ms: a flip {flip}, a pose {pose}, a way back {way}"


def main() -> None:
    """Print a line for each precision, and one for the AVR."""
    result = plan(polygon(4, 3.0), PRESETS["paper-control"])
    code = re.search(r"```c\n(.*?)```", _HOW_TO.read_text(), re.DOTALL)
    assert code is not None
    with TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "tracker.h").write_text(tracker_header(result, "code_size"))
        (folder / "main.c").write_text(code[1])
        print(f"{len(result.declared.reference.q)} points of the path; bytes")
        for precision, flags in (("single", ("-DTRACKER_FLOAT",)), ("double", ())):
            listed = ", ".join(f"{what} {size}" for what, size in cortex(folder, *flags).items())
            print(f"Cortex-M4, {precision} precision: {listed}")
        print(f"{_AVR}: {avr(folder)}")


if __name__ == "__main__":
    main()
