"""One command over all packages: `softflagella plan PATH`, `softflagella camera view FILM`.

The most important commands of the packages have words of their own, all others stand behind the package's name.
"""

from __future__ import annotations

import difflib
import sys
from importlib import import_module

from common.commands import Command, Program
from common.errors import InputError, run_command
from softflagella.shadowing import COMMANDED

_IMPORTANT = (
    ("sim", "robot steady effects"),
    ("planner", "plan goal tour hold"),
    ("tracking", "track"),
    ("planner", "page"),
    ("dataset", "sweep"),
    ("surrogate", "train"),
    ("camera", "tracks"),
    ("calibration", "calibrate"),
    ("tracking", "replay check"),
    ("sim", "film"),
    ("surrogate", "query"),
    ("softflagella", "demo"),
)
WORDS = {  # the most important commands -> package and command
    word: (package, "build" if word == "sweep" else word)
    for package, words in _IMPORTANT
    for word in words.split()
}
_WORD_OF = {place: word for word, place in WORDS.items()}
program = Program("softflagella", "soft flagellated robots near a surface")


@program.command("demo")
def _demo(*, out: str = "reports/demo.html") -> None:
    """Run the whole pipeline on the paper's robots.

    Args:
        out: page.
    """
    from softflagella.demo import run_demo

    run_demo(out)


def program_of(package: str) -> Program:
    """Return the commands of a package."""
    packaged: Program = import_module(f"{package}.__main__").program
    return packaged


def command(word: str) -> Command:
    """Return the command that a word stands for."""
    package, name = WORDS[word]
    return program_of(package).commands[name]


def further(package: str) -> Program:
    """Return the commands of a package that have no word of their own."""
    packaged = program_of(package)
    rest = Program(package, packaged.about)
    rest.commands = {name: each for name, each in packaged.commands.items() if (package, name) not in _WORD_OF}
    return rest


def packages() -> list[str]:
    """List the packages that have further commands."""
    return [package for package in COMMANDED if further(package).commands]


def _overview() -> str:
    lines = ["usage: softflagella COMMAND …", "", "commands:"]
    lines += [f"  {word:12} {command(word).help}" for word in WORDS]
    lines += ["", "further commands, by package (softflagella PACKAGE COMMAND …):"]
    lines += [f"  {name:12} {program_of(name).about}" for name in packages()]
    lines += ["", "--help after a command or a package tells more; --version prints the version."]
    return "\n".join(lines)


def _suggestion(word: str) -> str:
    """Suggest a command for a word that is none: one of a package, one that is spelt nearly so, or all."""
    for package in COMMANDED:
        if word in program_of(package).commands:
            return f"it is softflagella {_WORD_OF.get((package, word), f'{package} {word}')}"
    known = (*WORDS, *packages())
    near = difflib.get_close_matches(word, known, 1)
    return f"is it {near[0]}?" if near else f"there are {', '.join(known)}"


def main(argv: list[str] | None = None) -> None:
    """Run the command that the words name."""
    words = sys.argv[1:] if argv is None else argv
    if not words or words[0] in ("-h", "--help", "help"):
        print(_overview())
    elif words[0] in ("--version", "-V"):
        from common.provenance import __version__

        print(f"softflagella {__version__}")
    elif words[0] in WORDS:
        command(words[0]).main(f"softflagella {words[0]}", words[1:])
    elif tuple(words[:2]) in _WORD_OF:
        raise InputError(f"no command {' '.join(words[:2])!r}; it is softflagella {_WORD_OF[words[0], words[1]]}")
    elif words[0] in packages():
        further(words[0]).main(words[1:])
    else:
        raise InputError(f"no command {words[0]!r}; {_suggestion(words[0])}")


def run() -> None:
    """Run as the command `softflagella`."""
    sys.exit(run_command(main))


if __name__ == "__main__":
    run()
