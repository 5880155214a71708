"""Command lines: one program for each package, one function for each command, the same options everywhere.

    program = Program("sim", "Simulate swimming robots.")

    @program.command("steady", "mean motion at constant motor speed", argument("points", help="CSV"), out("CSV"))
    def _steady(arguments: Namespace) -> None: ...

`python -m sim steady …` and `softflagella sim steady …` run the same function.
"""

from __future__ import annotations

import sys
from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from sim.io.errors import run_command

Run = Callable[[Namespace], None]


class Argument(NamedTuple):
    """Arguments for `ArgumentParser.add_argument`."""

    names: tuple[str, ...]
    options: dict[str, Any]


def argument(*names: str, **options: Any) -> Argument:
    """An argument of a command, written as for argparse."""
    return Argument(names, options)


def out(what: str, **options: Any) -> Argument:
    """The option --out; it is required unless it has a default."""
    return Argument(("--out",), {"required": "default" not in options, "help": f"output: {what}", **options})


ROBOT = argument("--robot", required=True, help="robot.toml or the name of a preset")
JOBS = argument("--jobs", type=int, help="processes or threads (default: all processors)")
MODEL = argument("--model", help="look-up table (default: the one that comes with the package)")


class _Command(NamedTuple):
    run: Run
    name: str
    help: str
    arguments: tuple[Argument, ...]
    aliases: tuple[str, ...]


class Program:
    """The commands of one package."""

    def __init__(self, package: str, about: str):
        self.package, self.about = package, about
        self._commands: list[_Command] = []

    @property
    def names(self) -> list[str]:
        """Names of the commands."""
        return [command.name for command in self._commands]

    def command(
        self, name: str, help: str, *arguments: Argument, aliases: Sequence[str] = ()
    ) -> Callable[[Run], Run]:
        """Decorator of the function that runs a command."""

        def add(run: Run) -> Run:
            self._commands.append(_Command(run, name, help, arguments, tuple(aliases)))
            return run

        return add

    def parser(self, prog: str | None = None) -> ArgumentParser:
        """The parser of all commands."""
        return self._parsers(prog)[0]

    def help_texts(self, prog: str | None = None) -> dict[str, str]:
        """What --help prints, by command."""
        return {name: parser.format_help() for name, parser in self._parsers(prog)[1].items()}

    def _parsers(self, prog: str | None) -> tuple[ArgumentParser, dict[str, ArgumentParser]]:
        parser = ArgumentParser(prog=prog or f"python -m {self.package}", description=self.about)
        commands = parser.add_subparsers(required=True, metavar="COMMAND")
        own_parsers = {}
        for command in self._commands:
            own = commands.add_parser(
                command.name, help=command.help, description=_sentence(command.help), aliases=command.aliases
            )
            for names, options in command.arguments:
                own.add_argument(*names, **options)
            own.set_defaults(run=command.run)
            own_parsers[command.name] = own
        return parser, own_parsers

    def main(self, argv: list[str] | None = None, *, prog: str | None = None) -> None:
        """Parse and run; bad input raises `InputError`."""
        arguments = self.parser(prog).parse_args(argv)
        arguments.run(arguments)

    def exit(self) -> None:
        """Run as a process: exit status 0; for bad input 2, with one line on stderr."""
        sys.exit(run_command(self.main))


def _sentence(words: str) -> str:
    return words[0].upper() + words[1:] + "."
