"""One command over all packages.

softflagella sim steady POINTS.csv --out OUT.csv     the same as python -m sim steady …
softflagella demo                                    the whole pipeline, ends with one page to look at
softflagella --version
"""

from __future__ import annotations

import sys
from argparse import Namespace
from importlib import import_module

from sim.io.commands import Program, out
from sim.io.errors import run_command

PACKAGES = {
    "sim": "simulate robots: steady motion, replays of schedules, presets",
    "dataset": "simulate sweeps into data sets, report and verify them",
    "surrogate": "train look-up tables and query them",
    "planner": "plan switching schedules for paths, check tracks",
    "calibration": "find from measured runs what the model lacks",
}
program = Program("softflagella", "Soft flagellated robots near a surface.")


@program.command("demo", "run the whole pipeline on the paper's robots", out("page", default="reports/demo.html"))
def _demo(arguments: Namespace) -> None:
    from softflagella.demo import run_demo

    run_demo(arguments.out)


def _overview() -> str:
    lines = ["usage: softflagella PACKAGE COMMAND …", "", "packages:"]
    lines += [f"  {name:12} {what}" for name, what in PACKAGES.items()]
    lines += ["", "and:", "  demo         run the whole pipeline on the paper's robots", ""]
    return "\n".join([*lines, "softflagella PACKAGE --help lists its commands; --version prints the version."])


def main(argv: list[str] | None = None) -> None:
    """Hand the command over to its package."""
    words = sys.argv[1:] if argv is None else argv
    if not words or words[0] in ("-h", "--help", "help"):
        print(_overview())
    elif words[0] in ("--version", "-V"):
        from sim.io.provenance import __version__

        print(f"softflagella {__version__}")
    elif words[0] in PACKAGES:
        own: Program = import_module(f"{words[0]}.__main__").program
        own.main(words[1:], prog=f"softflagella {words[0]}")
    elif words[0] == "demo":
        program.main(words, prog="softflagella")
    else:
        print(f"error: no package {words[0]!r}; there are {', '.join((*PACKAGES, 'demo'))}", file=sys.stderr)
        raise SystemExit(2)


def run() -> None:
    """Entry point of the command `softflagella`."""
    sys.exit(run_command(main))


if __name__ == "__main__":
    run()
