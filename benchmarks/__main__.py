"""List the benchmarks, or run them.

Usage: python -m benchmarks                       list all: name, what it measures, how long it takes
       python -m benchmarks NAME [ARGUMENT …]     run one
       python -m benchmarks --claimed             run those whose figures the README claims

A benchmark is a module in a room of this folder with a function `main`, which takes the words of the command line.
The first line of its docstring says what it measures; a line "Takes …." says how long that takes on two cores.
"""

from __future__ import annotations

import ast
import re
import sys
from importlib import import_module
from inspect import signature
from pathlib import Path
from typing import NamedTuple

from common.errors import InputError, run_command

FOLDER = Path(__file__).parent
ROOMS = ("simulator", "data", "table", "planner", "calibration")
CLAIMED = ("accuracy", "speed", "response", "lookup", "single_query", "tracking")
_USAGE = re.compile(r"^Usage: (.+)$", re.MULTILINE)
_DURATION = re.compile(r"^Takes (.+)\.$", re.MULTILINE)


class Benchmark(NamedTuple):
    """What the list says about a benchmark."""

    room: str
    subject: str
    duration: str


def benchmarks() -> dict[str, Benchmark]:
    """Find all benchmarks by name without importing them; ValueError where a docstring states no duration."""
    known = {}
    for room in ROOMS:
        for file in sorted((FOLDER / room).glob("*.py")):
            module = ast.parse(file.read_text())
            if not any(isinstance(node, ast.FunctionDef) and node.name == "main" for node in module.body):
                continue  # something that several benchmarks share
            docstring = ast.get_docstring(module) or ""
            duration = _DURATION.search(docstring)
            if duration is None:
                raise ValueError(f"the docstring of {file} has no line 'Takes ….'")
            known[file.stem] = Benchmark(room, docstring.splitlines()[0], duration[1])
    return known


def listing() -> str:
    """Name, subject and duration of each benchmark, by room."""
    known = benchmarks()
    width = max(map(len, known))
    lines = ["python -m benchmarks NAME [ARGUMENT …]; * is run by `make bench`"]
    for room in ROOMS:
        lines += ["", room]
        for name, (_, subject, duration) in ((k, v) for k, v in known.items() if v.room == room):
            lines.append(f"{'*' if name in CLAIMED else ' '} {name:{width}}  {subject} ({duration})")
    return "\n".join(lines)


def run(name: str, *words: str) -> None:
    """Run one benchmark with words of the command line; InputError if they are too many."""
    known = benchmarks()
    if name not in known:
        raise InputError(f"no benchmark {name!r}; `python -m benchmarks` lists all")
    module = import_module(f"benchmarks.{known[name].room}.{name}")
    try:
        signature(module.main).bind(*words)
    except TypeError as misfit:
        raise InputError(f"{name}: {misfit}; {_USAGE.findall(module.__doc__ or '')[0]}") from None
    module.main(*words)


def main(words: list[str] | None) -> None:
    """List benchmarks, or run one or those that are claimed."""
    if not words or words[0] in ("-h", "--help"):
        print(listing())
    elif words == ["--claimed"]:
        for name in CLAIMED:
            run(name)
    else:
        run(*words)


if __name__ == "__main__":
    sys.exit(run_command(main, sys.argv[1:]))
