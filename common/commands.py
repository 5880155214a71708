"""Command lines from functions: a function's parameters, their types and its docstring are the parser.

    program = Program("calibration", "find from measured runs what the model lacks")

    @program.command("decide", of="calibration.api:decide", robot="--robot")
    def _decide(decide: Call, *, out: str | None = None) -> None:
        '''Say which of several explanations new runs speak for.

        Args:
            out: TXT, the answer.
        '''
        ... decide() ...

The command has the parameters of the public function `of` whose types can be written as words, and its own. What
its docstring does not describe, that of the public function does, up to a sentence that begins "In Python";
where there is no docstring, the first sentence is that of the public function, too. Parameters before the * are
positional, the others options. A bool is a flag, `--no-NAME` with "do not" before its description if its default
is True. A description that begins NAME=SIZE, or X Y, names the values. The function is called with what was
written, so defaults stand in its signature alone: first with the public function and what is written for that,
then with its own. Signatures are read from the source, not imported: help needs no libraries.

`python -m sim steady …` runs the function, and so does `softflagella steady …` (`softflagella.__main__`).
"""

from __future__ import annotations

import ast
import difflib
import os
import re
import sys
import warnings
from argparse import SUPPRESS, Action, ArgumentParser
from collections.abc import Callable, Iterator, Mapping
from functools import cache, partial
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple, NoReturn, TypeVar

from common.changes import changed_robots
from common.errors import InputError, InputWarning, run_command
from common.files import kept
from common.glossary import terms_in

_HELP = {  # of parameters that no docstring describes
    "out": "folder",
    "jobs": "threads (default: all processors)",
    "robot": "robot.toml or the name of a preset",
    "plan": "plan.json",
    "data": "folder or URL of a data set",
    "table": "CSV or Parquet of measured runs",
    "lookup": "look-up table (default: the one that comes with the package)",
}
_PLAIN: dict[str, dict[str, Any]] = {kind.__name__: {"type": kind} for kind in (str, bool, int, float)}
F = TypeVar("F", bound=Callable[..., None])


class FunctionParameter(NamedTuple):
    """A parameter of a function, as its source says."""

    name: str
    hint: ast.expr | None
    file: Path  # of the source, in which names of types are found
    default: Any = None  # a literal; None: none, or no literal
    needed: bool = False
    positional: bool = False
    help: str | None = None  # None: the docstring does not describe it


@cache
def _source(file: Path) -> dict[str, ast.stmt]:
    """Map the names of a module's source to what makes them: functions, classes, assignments, imports."""
    names: dict[str, ast.stmt] = {}
    top = ast.parse(file.read_text()).body
    for node in [inner for each in top for inner in (each.body if isinstance(each, ast.If) else [each])]:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            names[node.name] = node
        elif isinstance(node, ast.Assign):
            names[ast.unparse(node.targets[0])] = node
        elif isinstance(node, ast.ImportFrom):
            names |= {alias.name: node for alias in node.names}
    return names


def _function(place: str) -> tuple[ast.FunctionDef, Path]:
    """Find a function, module:name, in its source."""
    module, _, name = place.partition(":")
    file = Path(str(find_spec(module).origin))  # type: ignore[union-attr]
    function = _source(file)[name]
    assert isinstance(function, ast.FunctionDef)
    return function, file


@cache
def read_function(place: str) -> dict[str, FunctionParameter]:
    """Read a function's parameters from the source, those of **options: Unpack[Options] among them."""
    function, file = _function(place)
    signature, about = function.args, _read_docstring(function)
    plain = [*signature.posonlyargs, *signature.args]
    defaults = [*[None] * (len(plain) - len(signature.defaults)), *signature.defaults, *signature.kw_defaults]
    parameters = {}
    for node, default in zip([*plain, *signature.kwonlyargs], defaults, strict=True):
        value = default.value if isinstance(default, ast.Constant) else None
        parameters[node.arg] = FunctionParameter(node.arg, node.annotation, file, value, default is None,
                                         node in plain, about.get(node.arg))  # fmt: skip
    options = signature.kwarg.annotation if signature.kwarg else None
    further = _read_options(ast.unparse(options.slice), file) if isinstance(options, ast.Subscript) else {}
    return further | parameters


def _read_options(name: str, file: Path) -> dict[str, FunctionParameter]:
    """Read the fields of a TypedDict from the source, those of its bases first."""
    node, home = _named(name, file)
    if not isinstance(node, ast.ClassDef):
        return {}
    fields, about = dict[str, FunctionParameter](), _read_docstring(node)
    for base in node.bases:
        fields |= _read_options(ast.unparse(base), home)
    own = [field for field in node.body if isinstance(field, ast.AnnAssign)]
    keys = [ast.unparse(field.target) for field in own]
    hints = [field.annotation for field in own]
    return fields | {
        k: FunctionParameter(k, hint, home, help=about.get(k)) for k, hint in zip(keys, hints, strict=True)
    }


def _named(name: str, file: Path) -> tuple[ast.stmt | None, Path]:
    """Find what makes a name: in a file, or in the file of the packages from which that imports it."""
    node = _source(file).get(name)
    if not isinstance(node, ast.ImportFrom):
        return node, file
    spec = find_spec(node.module) if node.module and "." in node.module else None
    return _named(name, Path(spec.origin)) if spec and spec.origin else (None, file)


def _read_docstring(node: ast.FunctionDef | ast.ClassDef) -> dict[str, str]:
    """Return what stands under "Args:" or "Attributes:" by name, up to "In Python"."""
    text = ast.get_docstring(node) or ""
    section = re.search(r"^(?:Args|Attributes):\n((?:    .*\n|\n)*)", text + "\n", re.MULTILINE)
    entry = re.compile(r"^    (\w+(?:, \w+)*): (.*\n(?:     .*\n)*)", re.MULTILINE)
    return {
        name: " ".join(words.split()).partition(" In Python")[0].replace("`", "").removesuffix(".")
        for names, words in entry.findall(section[1] if section else "")
        for name in names.split(", ")
    }


def _alternatives(hint: ast.expr, file: Path) -> Iterator[tuple[ast.expr, Path]]:
    """List the types of a union from the last to the first, names of unions resolved."""
    if isinstance(hint, ast.BinOp):
        yield from _alternatives(hint.right, file)
        yield from _alternatives(hint.left, file)
    elif isinstance(hint, ast.Name) and hint.id not in _PLAIN:
        node, home = _named(hint.id, file)
        if isinstance(node, ast.Assign):
            yield from _alternatives(node.value, home)
    else:
        yield hint, file


def _from_words(hint: ast.expr, file: Path) -> dict[str, Any] | None:
    """Say how argparse makes values of a type, of a union of the last one that it can; None if it cannot."""
    for node, home in _alternatives(hint, file):
        if isinstance(node, ast.Name):
            return dict(_PLAIN[node.id])
        if not isinstance(node, ast.Subscript):
            continue
        parts = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
        kind, inner = ast.unparse(node.value), None
        if kind == "Literal":
            return {"choices": [ast.literal_eval(part) for part in parts]}
        if kind in ("tuple", "Sequence"):
            inner = _from_words(parts[0], home)
        if inner is not None:
            return {**inner, **({"nargs": len(parts)} if kind == "tuple" else {"many": True})}
    return None


class Parser(ArgumentParser):
    """A parser that refuses wrong words in one line, as all bad input is refused; -3cm is a value, no option."""

    def __init__(self, **options: Any):
        super().__init__(**options)
        self._negative_number_matcher = re.compile(r"-\.?\d")

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Refuse an option that there is not, before argparse asks for those that are needed."""
        for word in args or ():
            option, known = word.partition("=")[0], self._option_string_actions
            if option == "--":
                break
            if option.startswith("--") and not any(name.startswith(option) for name in known):
                near = difflib.get_close_matches(option, known, 1)
                self.error(f"no option {option}" + (f"; is it {near[0]}?" if near else ""))
        return super().parse_known_args(args, namespace)

    def format_help(self) -> str:
        """Explain below the options the terms that they and the description have."""
        text, formatter = super().format_help(), self._get_formatter()
        if terms := terms_in(text):
            formatter.start_section("terms")
            formatter.add_arguments(Action([], term, metavar=term, help=means) for term, means in terms.items())
            formatter.end_section()
        return "\n".join(filter(None, (text, formatter.format_help())))

    def error(self, message: str) -> NoReturn:
        """End with exit status 2."""
        raise InputError(f"{message}; {self.prog} --help lists what can be given")


def _sentence(about: str) -> str:
    return f"{about[0].upper()}{about[1:]}."


_ROBOTS = ("robot", "robots", "preset")  # parameters that name a robot, which --set changes
_OUTPUTS = ("out", "check", "shapes", "arduino", "micropython", "plot")  # parameters that name files to write


class Call(NamedTuple):
    """A public function, imported when called, with what was written for it."""

    of: str  # module:name
    given: Mapping[str, Any]

    def __call__(self, **further: Any) -> Any:
        """Call the function; further arguments replace those that were written."""
        module, _, name = self.of.partition(":")
        return getattr(import_module(module), name)(**{**self.given, **further})


class Subcommand(NamedTuple):
    """A command of a program: a function that is called with what was written.

    Its names map a parameter to its argument, where that differs: "--name" makes a positional one an option,
    "" leaves it out.
    """

    run: Callable[..., None]
    of: str = ""  # module:name of the public function whose parameters it has
    names: Mapping[str, str] = {}

    @property
    def place(self) -> str:
        """The function that runs it, module:name."""
        return f"{self.run.__module__}:{self.run.__name__}"

    @property
    def help(self) -> str:
        """The sentence for overviews: the first paragraph of its docstring, or of the public function's."""
        text = ast.get_docstring(_function(self.place if self.run.__doc__ else self.of)[0]) or ""
        words = " ".join(text.split("\n\n")[0].split()).removesuffix(".")
        return words[0].lower() + words[1:]

    def parameters(self) -> tuple[dict[str, FunctionParameter], dict[str, FunctionParameter]]:
        """Return the parameters of the public function, and its own, without that function."""
        own = read_function(self.place)
        if not self.of:
            return {}, own
        call = _function(self.place)[0].args.args[0].arg
        return read_function(self.of), {name: each for name, each in own.items() if name != call}

    def parser(self, prog: str) -> ArgumentParser:
        """Return a parser of this command alone."""
        parser = Parser(prog=prog, description=_sentence(self.help), argument_default=SUPPRESS)
        theirs, own = self.parameters()
        own = {name: each._replace(help=each.help or theirs.get(name, each).help) for name, each in own.items()}
        for parameter in (theirs | own).values():
            name = self.names.get(parameter.name, parameter.name)
            words = _from_words(parameter.hint, parameter.file) if parameter.hint else None
            if name and words is not None:
                _add(parser, parameter, name.replace("_", "-"), words)
        if not {*theirs, *own}.isdisjoint(_ROBOTS):
            about = "change an entry of robot.toml, such as fluid.viscosity_Pa_s=0.7; may be given again"
            parser.add_argument("--set", action="append", metavar="KEY=VALUE", help=about)
        return parser

    def main(self, prog: str, words: list[str]) -> None:
        """Parse words and run the command."""
        given, names = vars(self.parser(prog).parse_args(words)), self.parameters()[1]
        changes, inputs = given.pop("set", []), _inputs(given)
        if changes:
            given |= changed_robots({name: given[name] for name in _ROBOTS if name in given}, changes)
        own = {name: given.pop(name) for name in [*given] if name in names}
        with kept(inputs), warnings.catch_warnings():
            warnings.simplefilter("default", InputWarning)  # each line once
            warnings.showwarning = partial(_show_warning, warnings.showwarning)
            self.run(*([Call(self.of, given)] if self.of else []), **own)


def _inputs(given: Mapping[str, Any]) -> list[Path]:
    """Return the files that are given and are no outputs.

    Raises:
        InputError: an output is one of them, or another output.
    """
    outputs = [(name, value) for name, value in given.items() if name in _OUTPUTS and isinstance(value, str)]
    others = [(name, each) for name, value in given.items() if name not in _OUTPUTS
              for each in ([value] if isinstance(value, str) else value if isinstance(value, list | tuple) else ())
              if isinstance(each, str)]  # fmt: skip
    for k, (name, value) in enumerate(outputs):
        for other, word in others + outputs[:k]:
            known = os.path.isfile(value) and os.path.isfile(word) and os.path.samefile(value, word)
            if known or (other in _OUTPUTS and os.path.realpath(value) == os.path.realpath(word)):
                raise InputError(
                    f"--{name} {value} is the same file as {other.replace('_', '-')} {word}; give another name"
                )
    return [Path(word).resolve() for _, word in others if os.path.isfile(word)]


def _show_warning(otherwise: Callable[..., None], message: Warning | str, *place: Any) -> None:
    """Print a warning of the input as one line, and others as Python does."""
    if isinstance(message, InputWarning):
        print(message, file=sys.stderr)
    else:
        otherwise(message, *place)


def _add(parser: ArgumentParser, parameter: FunctionParameter, name: str, words: dict[str, Any]) -> None:
    """Add a parameter to a parser, as a positional argument or as an option."""
    about = (parameter.help or _HELP.get(parameter.name, "")).replace("%", "%%")  # % is argparse's own sign
    default = parameter.default
    if default not in (None, "") and not isinstance(default, bool) and "default" not in about.lower():
        about = f"{about} (default: {default})".lstrip()
    many, flag = words.pop("many", False), words.get("type") is bool
    if values := re.match(r"([A-Z][A-Z=]*(?: [A-Z]+)*), (?=[a-z])", about):
        shown, about = values[1].split(), about[values.end() :]
        words["metavar"] = tuple(shown) if "nargs" in words else shown[0]
    if parameter.positional and not name.startswith("-"):
        if many or not parameter.needed:
            words["nargs"] = "+" if many else "?"
        words.setdefault("metavar", name.upper())
        parser.add_argument(parameter.name, help=about, **words)
        return
    option = name if name.startswith("--") else f"--{name}"
    if flag and default:
        option, about = f"--no-{name}", f"do not {about}"
    if flag:
        words = {"action": f"store_{str(not default).lower()}"}
    elif many:
        words["action"], about = "append", f"{about}; may be given again"
    parser.add_argument(option, dest=parameter.name, help=about, required=parameter.needed, **words)


class Program:
    """The commands of one package."""

    def __init__(self, package: str, about: str):  # begins with a small letter, for overviews
        self.package, self.about = package, about
        self.commands: dict[str, Subcommand] = {}

    def command(self, name: str, *, of: str = "", **names: str) -> Callable[[F], F]:
        """Decorate the function that runs a command with what a user types for it, and fields of `Subcommand`."""

        def add(run: F) -> F:
            self.commands[name] = Subcommand(run, of, names)
            return run

        return add

    def parser(self, prog: str = "") -> ArgumentParser:
        """Return the parser of the commands' names."""
        parser = Parser(prog=prog or f"softflagella {self.package}", description=_sentence(self.about))
        subparsers = parser.add_subparsers(required=True, metavar="COMMAND")
        for name, command in self.commands.items():
            subparsers.add_parser(name, help=command.help)
        return parser

    def main(self, argv: list[str] | None = None, prog: str = "") -> None:
        """Parse and run a command; bad input raises `InputError`.

        Args:
            prog: what a user types to run the program (default: softflagella and the package).
        """
        words, prog = sys.argv[1:] if argv is None else argv, prog or f"softflagella {self.package}"
        if words and words[0] in self.commands:
            self.commands[words[0]].main(f"{prog} {words[0]}", words[1:])
        else:
            self.parser(prog).parse_args(words[:1])  # options behind an unknown command are not looked at

    def exit(self) -> None:
        """Run as a process: exit status 0; for bad input 2, with one line on stderr."""
        sys.exit(run_command(partial(self.main, prog=f"python -m {self.package}")))


def to_stderr(line: str) -> None:
    """Print a line that is no result."""
    print(line, file=sys.stderr)
