"""Command lines from functions: a function's parameters, their types and its docstring are the parser.

    program = Program("sim", "Simulate swimming robots.")

    @program.command("steady", of="sim.api:steady")
    def _steady(robots: str, *, out: str | None = None, **given: Any) -> None:
        '''Simulate the mean motion of a robot, or of many.

        Args:
            out: CSV with the motion.
        '''

The command has the parameters of the public function `of` whose types can be written as words, and its own; what
its docstring describes is its own. Parameters before the * are positional, the others options. A bool is a flag,
`--no-NAME` with "do not" before its description if its default is True. A description that begins LOW:HIGH, or
X Y, names the values. The function is called with what was written, so defaults stand in its signature alone.
Signatures are read from the source, not imported: help needs no libraries.

`softflagella sim steady …` runs the function; the most important commands have a word of their own, such as
`softflagella plan …` (`softflagella.__main__`).
"""

from __future__ import annotations

import ast
import re
import sys
from argparse import SUPPRESS, Action, ArgumentParser, Namespace
from collections.abc import Callable, Iterator, Mapping
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple, NoReturn, TypeVar

from sim.io.errors import InputError, run_command
from sim.io.units import LENGTHS

_RENAMED = {
    "--minimum-dwell": "--min-dwell",
    "--minimum-seconds": "--min-dwell-s",
    "--lookup": "--model",
}  # old names
_PLAIN: dict[str, dict[str, Any]] = {"str": {}, "bool": {}, "int": {"type": int}, "float": {"type": float}}
Run = Callable[[Namespace], None]
F = TypeVar("F", bound=Callable[..., None])


class Parameter(NamedTuple):
    """A parameter of a function, as its source says."""

    name: str
    hint: ast.expr | None
    file: Path  # of the source, in which names of types are found
    default: Any = None  # a literal; None: none, or no literal
    needed: bool = False
    positional: bool = False
    help: str | None = None  # None: the docstring does not describe it


@cache
def _source(file: Path) -> ast.Module:
    return ast.parse(file.read_text())


def read_function(file: Path, name: str) -> tuple[str, dict[str, Parameter]]:
    """Read the first sentence of a function's docstring, and its parameters by name, from the source."""
    found = (node for node in _source(file).body if isinstance(node, ast.FunctionDef) and node.name == name)
    function = next(found)
    summary, about = _read_docstring(ast.get_docstring(function) or "")
    signature = function.args
    plain = [*signature.posonlyargs, *signature.args]
    defaults = [*[None] * (len(plain) - len(signature.defaults)), *signature.defaults, *signature.kw_defaults]
    parameters = {}
    for node, default in zip([*plain, *signature.kwonlyargs], defaults, strict=True):
        value = default.value if isinstance(default, ast.Constant) else None
        parameters[node.arg] = Parameter(node.arg, node.annotation, file, value, default is None,
                                         node in plain, about.get(node.arg))  # fmt: skip
    return summary, parameters


def _read_docstring(text: str) -> tuple[str, dict[str, str]]:
    """Return the first sentence, and what stands under "Args:" by parameter."""
    summary = " ".join(text.split("\n\n")[0].split())
    section = re.search(r"^Args:\n((?:    .*\n|\n)*)", text + "\n", re.MULTILINE)
    entries = re.findall(
        r"^    (\w+(?:, \w+)*): (.*\n(?:     .*\n)*)", section[1] if section else "", re.MULTILINE
    )
    about = {
        name: " ".join(words.split()).replace("`", "") for names, words in entries for name in names.split(", ")
    }
    return summary, {name: words.removesuffix(".") for name, words in about.items()}


def _alternatives(hint: ast.expr, file: Path) -> Iterator[tuple[ast.expr, Path]]:
    """List the types of a union, names of other types in the packages' sources resolved."""
    if isinstance(hint, ast.BinOp):
        yield from _alternatives(hint.left, file)
        yield from _alternatives(hint.right, file)
    elif not (isinstance(hint, ast.Name) and hint.id not in _PLAIN):
        yield hint, file
    else:
        for node in ast.walk(_source(file)):
            if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == hint.id:
                yield from _alternatives(node.value, file)
            elif isinstance(node, ast.ImportFrom) and hint.id in [alias.name for alias in node.names]:
                spec = find_spec(node.module or "") if "." in (node.module or "") else None
                if spec and spec.origin:
                    yield from _alternatives(hint, Path(spec.origin))


def _from_words(hint: ast.expr, file: Path) -> dict[str, Any] | None:
    """Say how argparse makes values of a type, None if it cannot; bool is {"type": bool}."""
    union = hint
    while isinstance(union, ast.BinOp):  # str in sight needs no other file
        if ast.unparse(union.right) == "str":
            return {}
        union = union.left
    if ast.unparse(union) == "str":
        return {}
    for node, home in list(_alternatives(hint, file)):
        if isinstance(node, ast.Name):
            return {"type": bool} if node.id == "bool" else dict(_PLAIN[node.id])
        if not isinstance(node, ast.Subscript):
            continue
        kind, parts = (
            ast.unparse(node.value),
            node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice],
        )
        if kind == "Literal":
            return {"choices": [ast.literal_eval(part) for part in parts]}
        inner = _from_words(parts[0], home)
        if kind == "tuple" and inner is not None:
            return {**inner, "nargs": len(parts)}
        if kind == "Sequence" and inner is not None:
            return {**inner, "many": True}
    return None


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
    """A command of a program: a function that is called with what was written."""

    run: Callable[..., None]
    name: str
    help: str
    of: str = ""  # the public function whose parameters it has, module:name
    names: Mapping[str, str] = {}  # parameter -> the option that it is called in the command; "": none
    further: Mapping[str, str] = {}  # options of words for its **given -> help

    def parameters(self) -> dict[str, Parameter]:
        """Return the parameters of the public function, with those of its own."""
        code = self.run.__code__
        own = read_function(Path(code.co_filename), code.co_name)[1]
        if not self.of:
            return own
        module, _, name = self.of.partition(":")
        theirs = read_function(Path(str(find_spec(module).origin)), name)[1]  # type: ignore[union-attr]
        return theirs | {name: each for name, each in own.items() if each.help is not None or name not in theirs}

    def add_arguments(self, parser: ArgumentParser) -> None:
        """Add the arguments to a parser."""
        for parameter in self.parameters().values():
            name = self.names.get(parameter.name, parameter.name)
            words = _from_words(parameter.hint, parameter.file) if parameter.hint else None
            if name and words is not None:
                _add(parser, parameter, name.replace("_", "-"), words)
        for name, about in self.further.items():
            _add(parser, Parameter(name, None, Path(), help=about), name, {})

    def parser(self, prog: str) -> ArgumentParser:
        """Return a parser of this command alone."""
        parser = Parser(
            prog=prog, description=self.help[0].upper() + self.help[1:] + ".", argument_default=SUPPRESS
        )
        self.add_arguments(parser)
        return parser

    def main(self, prog: str, words: list[str]) -> None:
        """Parse words and run the command."""
        self.run(**vars(self.parser(prog).parse_args(words)))


def _add(parser: ArgumentParser, parameter: Parameter, name: str, words: dict[str, Any]) -> None:
    """Add a parameter to a parser, as a positional argument or as an option."""
    about, default = (parameter.help or "").replace("%", "%%"), parameter.default  # % is argparse's own sign
    if default not in (None, "") and not isinstance(default, bool) and "default" not in about.lower():
        about = f"{about} (default: {default})".lstrip()
    many, flag = words.pop("many", False), words.get("type") is bool
    if values := re.match(r"([A-Z][A-Z:=]*(?: [A-Z]+)*), (?=[a-z])", about):
        shown, about = values[1].split(), about[values.end() :]
        words["metavar"] = tuple(shown) if "nargs" in words else shown[0]
    if parameter.positional and not name.startswith("-"):
        if many or not parameter.needed:
            words["nargs"] = "+" if many else "?"
        parser.add_argument(parameter.name, metavar=name.upper(), help=about, **words)
        return
    option = f"--{name.removeprefix('--')}"
    if flag and default:
        option, about = f"--no-{name}", f"do not {about}"
    if flag:
        words = {"action": f"store_{str(not default).lower()}"}
    elif many:
        words["action"], about = "append", f"{about}; may be given again"
    parser.add_argument(option, dest=parameter.name, help=about, required=parameter.needed, **words)
    if old := _RENAMED.get(option):
        parser.add_argument(old, dest=parameter.name, action=_Renamed, const=option, help=SUPPRESS, **words)


class Program:
    """The commands of one package."""

    def __init__(self, package: str, about: str):
        self.package, self.about = package, about
        self.commands: dict[str, Command | Declared] = {}

    def command(
        self,
        name: str,
        help: str = "",
        *arguments: Argument,
        of: str = "",
        further: Mapping[str, str] | None = None,
        **names: str,
    ) -> Callable[[F], F]:
        """Decorate the function that runs a command; its docstring begins with a sentence for overviews.

        Args:
            name: what a user types.
            of: the public function whose parameters the command has, such as "sim.api:steady".
            further: options of words for the function's **given, with their help.
            names: parameter -> the name of its argument, where it differs; "--name" makes a positional one an
                option, "" leaves one out.
        """

        def add(run: F) -> F:
            if help:
                self.commands[name] = Declared(run, name, help, arguments)
                return run
            summary = " ".join((run.__doc__ or "").split("\n\n")[0].split()).removesuffix(".")
            summary = summary[0].lower() + summary[1:]
            self.commands[name] = Command(run, name, summary, of, names, further or {})
            return run

        return add

    @property
    def prog(self) -> str:
        """What a user types to run the program."""
        return f"softflagella {self.package}".removesuffix(" softflagella")

    def parser(self) -> ArgumentParser:
        """Return the parser of the commands' names."""
        parser = Parser(prog=self.prog, description=self.about)
        subparsers = parser.add_subparsers(required=True, metavar="COMMAND")
        for command in self.commands.values():
            subparsers.add_parser(command.name, help=command.help)
        return parser

    def main(self, argv: list[str] | None = None) -> None:
        """Parse and run a command; bad input raises `InputError`."""
        words = sys.argv[1:] if argv is None else argv
        if words and words[0] in self.commands:
            self.commands[words[0]].main(f"{self.prog} {words[0]}", words[1:])
        else:
            self.parser().parse_args(words)

    def exit(self) -> None:
        """Run as a process: exit status 0; for bad input 2, with one line on stderr."""
        sys.exit(run_command(self.main))


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


class Declared(NamedTuple):
    """A command whose arguments are declared one by one."""

    run: Callable[[Namespace], None]
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
        parser = Parser(prog=prog, description=self.help[0].upper() + self.help[1:] + ".")
        self.add_arguments(parser)
        return parser

    def main(self, prog: str, words: list[str]) -> None:
        """Parse words and run the command."""
        self.run(self.parser(prog).parse_args(words))
