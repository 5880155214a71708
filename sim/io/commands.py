"""Command lines: one program for each package, one function for each command, the same options everywhere.

    program = Program("sim", "Simulate swimming robots.")

    @program.command("steady", "mean motion at constant motor speed", argument("points", help="CSV"), out("CSV"))
    def _steady(arguments: Namespace) -> None: ...

`softflagella sim steady …` runs the function; the most important commands have a word of their own, such as
`softflagella plan …` (`softflagella.__main__`).
"""

from __future__ import annotations

import re
import sys
from argparse import SUPPRESS, Action, ArgumentParser, Namespace
from collections.abc import Callable
from typing import Any, NamedTuple, NoReturn

from sim.io.errors import InputError, run_command
from sim.io.units import LENGTHS

Run = Callable[[Namespace], None]


class Argument(NamedTuple):
    """Arguments of `ArgumentParser.add_argument`."""

    names: tuple[str, ...]
    options: dict[str, Any]


def argument(*names: str, **options: Any) -> Argument:
    """Declare an argument of a command, written as for argparse; `old`: its name of the last release."""
    return Argument(names, options)


def out(what: str, **options: Any) -> Argument:
    """Declare the option --out; it is required unless it has a default."""
    return Argument(("--out",), {"required": "default" not in options, "help": f"output: {what}", **options})


ROBOT = argument("--robot", required=True, help="robot.toml or the name of a preset")
RUNS_OF = argument(
    "--robot", dest="runs_of", help="robot.toml or the name of a preset, for a table of its runs: N,l_cm,omega_rpm"
)
JOBS = argument("--jobs", type=int, help="processes or threads (default: all processors)")
UNIT = argument("--unit", choices=LENGTHS, metavar="UNIT",
                help="of all lengths that are given without one: m, cm, mm, or l for tail lengths. 24cm and 3l, "
                "columns x_cm and y_cm, and drawings with a size have their own")  # fmt: skip
LOOKUP = argument("--lookup", old="--model", help="look-up table (default: the one that comes with the package)")


def refuse_runs_of(arguments: Namespace) -> None:
    """Refuse RUNS_OF beside a robot."""
    if arguments.runs_of is not None:
        raise InputError(
            f"--robot goes with a table of runs, and {arguments.robot} is a robot; leave one of them out"
        )


class Parser(ArgumentParser):
    """A parser that refuses wrong words in one line, as all bad input is refused; -3cm is a value, no option."""

    def __init__(self, **options: Any):
        super().__init__(**options)
        self._negative_number_matcher = re.compile(r"-\.?\d")

    def error(self, message: str) -> NoReturn:
        """End with exit status 2."""
        raise InputError(f"{message}; {self.prog} --help lists what can be given")


class _Renamed(Action):
    """An old name of an option: it works, with a warning; `const` is the new one."""

    def __call__(
        self, parser: ArgumentParser, namespace: Namespace, values: Any, option: str | None = None
    ) -> None:
        print(f"warning: {option} is deprecated; use {self.const}", file=sys.stderr)
        setattr(namespace, self.dest, values)


class Command(NamedTuple):
    """A command of a program."""

    run: Run
    name: str
    help: str
    arguments: tuple[Argument, ...]

    def add_arguments(self, parser: ArgumentParser) -> None:
        """Add the arguments to a parser, and the function that runs the command."""
        for names, options in self.arguments:
            old = options.get("old")
            added = parser.add_argument(*names, **{key: value for key, value in options.items() if key != "old"})
            if old:
                kind = options.get("type", str)
                parser.add_argument(old, dest=added.dest, type=kind, action=_Renamed, const=names[0],
                                    default=SUPPRESS, help=SUPPRESS)  # fmt: skip
        parser.set_defaults(run=self.run)

    def parser(self, prog: str) -> ArgumentParser:
        """Return a parser of this command alone."""
        parser = Parser(prog=prog, description=_sentence(self.help))
        self.add_arguments(parser)
        return parser


class Program:
    """The commands of one package."""

    def __init__(self, package: str, about: str):
        self.package, self.about = package, about
        self.commands: dict[str, Command] = {}

    def command(self, name: str, help: str, *arguments: Argument) -> Callable[[Run], Run]:
        """Decorate the function that runs a command."""

        def add(run: Run) -> Run:
            self.commands[name] = Command(run, name, help, arguments)
            return run

        return add

    @property
    def prog(self) -> str:
        """What a user types to run the program."""
        return f"softflagella {self.package}".removesuffix(" softflagella")

    def parser(self) -> ArgumentParser:
        """Return the parser of all commands."""
        parser = Parser(prog=self.prog, description=self.about)
        subparsers = parser.add_subparsers(required=True, metavar="COMMAND")
        for command in self.commands.values():
            command.add_arguments(
                subparsers.add_parser(command.name, help=command.help, description=_sentence(command.help))
            )
        return parser

    def main(self, argv: list[str] | None = None) -> None:
        """Parse and run a command; bad input raises `InputError`."""
        arguments = self.parser().parse_args(argv)
        arguments.run(arguments)

    def exit(self) -> None:
        """Run as a process: exit status 0; for bad input 2, with one line on stderr."""
        sys.exit(run_command(self.main))


def _sentence(words: str) -> str:
    return words[0].upper() + words[1:] + "."
