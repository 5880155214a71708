"""Generate pages from the code: the table of effects, columns of a data set, fields of objects, the commands."""

from __future__ import annotations

import ast
import inspect
import io
import os
import textwrap
import tokenize
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import is_dataclass
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple, get_args, get_type_hints

import softflagella
from dataset.rows.schema import FLAGS, INPUTS, OUTPUTS
from sim.effects import catalogue
from sim.io.commands import Command
from sim.model.effect import Effect
from softflagella.__main__ import PACKAGES, WORDS, command


def write_generated_pages(folder: Path) -> None:
    """Write effects.md, columns.md, objects.md and commands.md into `folder`."""
    folder.mkdir(parents=True, exist_ok=True)
    pages = {
        "effects": effects_page(),
        "columns": columns_page(),
        "objects": objects_page(),
        "commands": commands_page(),
    }
    for name, text in pages.items():
        page = folder / f"{name}.md"
        if not page.exists() or page.read_text() != text:
            page.write_text(text)


def effects_page() -> str:
    """Describe every effect as it is declared: equation, source, unit, bounds."""
    effects = catalogue()
    summary = table(
        ("effect", "what it is", "null", "bounds", "unit of ε"),
        [
            (f"[`{e.name}`](#{e.name.replace('_', '-')})", e.title, number(e.null), bounds(e.bounds), e.unit)
            for e in effects.values()
        ],
    )
    parts = [
        "# Effects",
        f"Each of these {len(effects)} files in `sim/effects` adds an effect that the base model leaves out. "
        "An effect has a size ε. At its null value the model is exactly the base model.",
        "In a robot.toml, effects are lines `name = size` in the table `[effects]`; in a table of robots they are "
        "columns.",
        summary,
    ]
    for effect in effects.values():
        parts += [f"## {effect.name.replace('_', ' ')}", _about(effect)]
    return "\n\n".join(parts) + "\n"


def _about(effect: Effect) -> str:
    if effect.symmetry == "even":
        reversed_motor = "left and right turns stay mirror images"
    else:
        reversed_motor = "left and right turns differ"
    if effect.similar:
        viscosity = "the same motion at half the rate"
    else:
        viscosity = "another motion: the effect has a scale of its own"
    properties = [
        ("name", f"`{effect.name}`"),
        ("equation", f"`{effect.equation}`"),
        ("source", effect.source),
        ("unit of ε", effect.unit),
        ("null, bounds, typical", f"{number(effect.null)}, {bounds(effect.bounds)}, {number(effect.typical)}"),
        ("when the motor is reversed", reversed_motor),
        ("twice the viscosity at half the speed", viscosity),
        ("energy", "only dissipates" if effect.dissipative else "may also drive"),
    ]
    for driver in effect.drivers:
        words = f"`{driver.name}`, {driver.title}: size = null + ε × `{driver.column}`; unit of ε: {driver.unit}"
        properties.append(("candidate in a calibration", words))
    if effect.beside:
        properties.append(("shows only beside", f"`{effect.beside}`"))
    words = inspect.getdoc(import_module(f"sim.effects.{effect.name}")) or ""
    return f"{words}\n\n{table(('property', ''), properties)}"


def columns_page() -> str:
    """List the columns of a data set as its schema declares them."""
    parts = ["# Columns of a data set", "The Parquet files store the unit and the meaning of each column, too."]
    for title, columns in (("Inputs", INPUTS), ("Outputs", OUTPUTS), ("Flags", FLAGS)):
        rows = [(f"`{c.name}`", str(c.type), c.unit, c.meaning) for c in columns]
        parts += [f"## {title}", table(("column", "type", "unit", "meaning"), rows)]
    parts.append("A sweep over effects has one column for each effect, see [Effects](effects.md).")
    return "\n\n".join(parts) + "\n"


class Field(NamedTuple):
    """A field of a class, as its source declares it."""

    name: str
    type: str
    meaning: str  # the comment behind it


def objects_page() -> str:
    """List the fields of the public classes and of their parts."""
    parts = [
        "# Fields of objects",
        "What the objects of [Python](../api.md) hold, and their parts. Lengths are in tail lengths l, times in "
        "μ0 l⁴/EI, unless a field says its unit.",
    ]
    for record in public_records():
        rows = [(f"`{name}`", f"`{kind}`", meaning) for name, kind, meaning in fields_of(record)]
        summary = (inspect.getdoc(record) or "").split("\n\n")[0].replace("\n", " ")
        parts += [f"## {record.__name__}", summary, table(("field", "type", "meaning"), rows)]
    return "\n\n".join(parts) + "\n"


def public_records() -> list[type]:
    """List the public dataclasses and named tuples, then those of which their fields are made."""
    public = [getattr(softflagella, name) for name in softflagella.__all__]
    records = [thing for thing in public if _is_record(thing)]
    for record in records:  # which grows
        for hint in get_type_hints(record).values():
            records += [part for part in _classes(hint) if _is_record(part) and part not in records]
    return records


def fields_of(record: type) -> list[Field]:
    """Read the fields of a class from its source, those of its bases first."""
    bases = [base for base in reversed(record.__mro__[1:]) if _is_record(base)]
    fields = {field.name: field for base in bases for field in fields_of(base)}
    source = textwrap.dedent(inspect.getsource(record))
    tokens = tokenize.generate_tokens(io.StringIO(source).readline)
    comments = {token.start[0]: token.string.lstrip("# ") for token in tokens if token.type == tokenize.COMMENT}
    (definition,) = ast.parse(source).body
    assert isinstance(definition, ast.ClassDef)
    for node in definition.body:
        if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            meaning = comments.get(node.end_lineno or 0, "")
            fields[node.target.id] = Field(node.target.id, ast.unparse(node.annotation), meaning)
    return list(fields.values())


def _is_record(thing: Any) -> bool:
    if not inspect.isclass(thing) or thing.__module__.partition(".")[0] not in PACKAGES:
        return False
    return is_dataclass(thing) or (issubclass(thing, tuple) and hasattr(thing, "_fields"))


def _classes(hint: Any) -> Iterator[type]:
    if inspect.isclass(hint):
        yield hint
    for part in get_args(hint):
        yield from _classes(part)


def commands_page() -> str:
    """List every command with its help text."""
    os.environ["COLUMNS"] = "100"
    parts = [
        "# Commands",
        "The most frequent commands have a short form. Invalid input ends with one line on stderr and exit "
        "status 2.",
    ]
    for word, (package, name) in WORDS.items():
        same = "" if package == "softflagella" else f"The same as `softflagella {package} {name}`."
        parts += [f"## {word}", same, _help(command(word), f"softflagella {word}")]
    for package, what in PACKAGES.items():
        program = import_module(f"{package}.__main__").program
        parts += [f"## {package}", f"{what[0].upper()}{what[1:]}."]
        for name, packaged in program.commands.items():
            parts += [f"### {package} {name}", _help(packaged, f"softflagella {package} {name}")]
    return "\n\n".join(part for part in parts if part) + "\n"


def _help(described: Command, prog: str) -> str:
    return f"```text\n{described.parser(prog).format_help().rstrip()}\n```"


def number(value: float) -> str:
    """Write a number with a typographic minus."""
    return f"{value:g}".replace("-", "−")


def bounds(ends: tuple[float, float]) -> str:
    """Write an interval in words."""
    return f"{number(ends[0])} to {number(ends[1])}"


def table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Write a Markdown table."""
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines)
