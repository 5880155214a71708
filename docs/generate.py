"""Generate pages from the code: effects, columns, fields of objects, commands, terms, rules of a verdict."""

from __future__ import annotations

import ast
import inspect
import os
import textwrap
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import is_dataclass
from importlib import import_module
from pathlib import Path
from typing import Any, get_args, get_type_hints

import softflagella
from calibration.attribution.hypothesis import Origin
from calibration.attribution.rules import RULES, Stage
from calibration.laws.laws import LAW_RULES
from common.glossary import TERMS
from dataset.schema import FLAGS, INPUTS, OUTPUTS
from sim.effects import catalogue
from sim.model.effect import Effect
from softflagella.__main__ import WORDS, command, further, packages
from softflagella.shadowing import PACKAGES


def write_generated_pages(folder: Path) -> None:
    """Write what pages of the same names include into `folder`, where it has changed."""
    folder.mkdir(parents=True, exist_ok=True)
    for make in (effects_page, columns_page, objects_page, commands_page, glossary_page, rules_page):
        page, text = folder / f"{make.__name__.removesuffix('_page')}.md", "\n\n".join(filter(None, make())) + "\n"
        if not page.exists() or page.read_text() != text:
            page.write_text(text)


def effects_page() -> Iterator[str]:
    """Describe every effect as it is declared: equation, source, unit, bounds."""
    effects = catalogue().values()
    yield "Each adds to the base model, with a size ε; at the null of ε the model is the base model."
    yield "robot.toml has lines `name = size` in the table `[effects]`; a table of robots has columns."
    links = [f"[`{effect.name}`](#{effect.name.replace('_', '-')})" for effect in effects]
    rows = [(k, e.title, number(e.null), number(*e.bounds), e.unit) for k, e in zip(links, effects, strict=True)]
    yield table(("effect", "what it is", "null", "bounds", "unit of ε"), rows)
    for e in effects:
        yield f"## {e.name.replace('_', ' ')}\n\n{inspect.getdoc(import_module(f'sim.effects.{e.name}'))}"
        yield table(("property", ""), _properties(e))


def _properties(effect: Effect) -> Iterator[tuple[str, str]]:
    yield "name", f"`{effect.name}`"
    yield "equation", f"`{effect.equation}`"
    yield "source", effect.source
    yield "null, bounds, typical", f"{number(effect.null)}, {number(*effect.bounds)}, {number(effect.typical)}"
    yield "left and right turns", "mirror images" if effect.symmetry == "even" else "differ"
    yield "twice the viscosity at half the speed", "half the rate" if effect.similar else "another motion"
    yield "energy", "only dissipates" if effect.dissipative else "may also drive"
    for driver in effect.drivers:
        size = f"null + ε × `{driver.column}`; unit of ε: {driver.unit}"
        yield f"candidate in a calibration: `{driver.name}`", f"{driver.title}: {size}"
    if effect.beside:
        yield "shows only beside", f"`{effect.beside}`"


def columns_page() -> Iterator[str]:
    """List the columns of a data set as its schema declares them."""
    yield "A sweep over [effects](effects.md) has one more for each."
    for title, columns in (("Inputs", INPUTS), ("Outputs", OUTPUTS), ("Flags", FLAGS)):
        rows = [(f"`{c.name}`", str(c.type), c.unit, c.meaning) for c in columns]
        yield f"## {title}\n\n{table(('column', 'type', 'unit', 'meaning'), rows)}"


def rules_page() -> Iterator[str]:
    """Tabulate the rules by which hypotheses are judged, in order, with the origins to which each applies."""
    for stage in Stage:
        rules = [rule for rule in (*RULES, *LAW_RULES) if rule.stage is stage]
        origins = [origin for origin in Origin if any(origin in rule.origins for rule in rules)]
        rows = [(rule.reason, rule.text, *(_mark(origin in rule.origins) for origin in origins)) for rule in rules]
        yield f"## {stage.capitalize()}\n\n{table(('reason', 'if', *origins), rows)}"


def _mark(applies: bool) -> str:
    return "×" if applies else ""


def objects_page() -> Iterator[str]:
    """List the fields of the public classes, then those of the classes of which their fields are made."""
    yield "Lengths are in tail lengths l, times in μ0 l⁴/EI, unless a field says its unit."
    public = [*(getattr(softflagella, name) for name in softflagella.__all__), Effect]
    records = [record for each in public for record in _records(each)]
    for record in records:  # which grows
        parts = [part for hint in get_type_hints(record).values() for part in _records(hint)]
        records += [part for part in dict.fromkeys(parts) if part not in records]
        summary = (inspect.getdoc(record) or "").split("\n\n")[0].replace("\n", " ")
        yield f"## {record.__name__}\n\n{summary}"
        yield table(("field", "type", "meaning"), _fields(record).values())


def _records(hint: Any) -> list[type]:
    ours = inspect.isclass(hint) and hint.__module__.partition(".")[0] in PACKAGES
    own = [hint] if ours and (is_dataclass(hint) or hasattr(hint, "_fields")) else []
    return own + [record for argument in get_args(hint) for record in _records(argument)]


def _fields(record: type) -> dict[str, tuple[str, str, str]]:
    """Map the fields, those of bases first, to name, type and the comment behind them."""
    fields: dict[str, tuple[str, str, str]] = {}
    for base in filter(_records, reversed(record.__mro__)):
        source = textwrap.dedent(inspect.getsource(base))
        for node in ast.walk(ast.parse(source)):
            if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name) and node.col_offset == 4:
                meaning = source.splitlines()[(node.end_lineno or 1) - 1].partition("  # ")[2]
                fields[node.target.id] = (f"`{node.target.id}`", f"`{ast.unparse(node.annotation)}`", meaning)
    return fields


def commands_page() -> Iterator[str]:
    """List every command with its help text."""
    os.environ["COLUMNS"] = "100"
    usage = "```text\n{}```".format
    yield "Bad input ends with one line and exit status 2; no way to a goal, or a missed part of a path, with 3."
    for word in WORDS:
        yield from (f"## {word}", usage(command(word).parser(f"softflagella {word}").format_help()))
    for package in packages():
        program = further(package)
        yield f"## {package}\n\n{program.parser().description}"
        for name, packaged in program.commands.items():
            yield f"### {package} {name}"
            yield usage(packaged.parser(f"softflagella {package} {name}").format_help())


def glossary_page() -> Iterator[str]:
    """List the terms that the help of commands explains."""
    yield table(("term", "meaning"), sorted(TERMS.items(), key=lambda item: item[0].lower()))


def number(*values: float) -> str:
    """Write a number, or a range, with typographic minus signs."""
    return " to ".join(f"{value:g}" for value in values).replace("-", "−")


def table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Write a Markdown table."""
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines)
