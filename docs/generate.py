"""Pages that are written from the code: the table of effects, the columns of files, the commands."""

from __future__ import annotations

import inspect
import os
from collections.abc import Iterable, Sequence
from importlib import import_module
from pathlib import Path

from dataset.rows.schema import FLAGS, INPUTS, OUTPUTS
from sim.effects import catalogue
from sim.io.commands import Command
from sim.model.effect import Effect
from softflagella.__main__ import PACKAGES, WORDS, command


def write_generated_pages(folder: Path) -> None:
    """Write effects.md, columns.md and commands.md into `folder`."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in (("effects", effects_page()), ("columns", columns_page()), ("commands", commands_page())):
        page = folder / f"{name}.md"
        if not page.exists() or page.read_text() != text:
            page.write_text(text)


def effects_page() -> str:
    """Every effect with equation, source, unit and bounds, from its declaration."""
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
        f"The base model leaves things out. Each of these {len(effects)} files in `sim/effects` adds one of them. "
        "An effect has one size ε. At its null value the model is exactly the base model.",
        "In a robot.toml, effects are lines `name = size` in the table `[effects]`. In a table of robots they are "
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
    """Columns of a data set, from its schema."""
    parts = ["# Columns of a data set", "Unit and meaning are stored in the Parquet files, too."]
    for title, columns in (("Inputs", INPUTS), ("Outputs", OUTPUTS), ("Flags", FLAGS)):
        rows = [(f"`{c.name}`", str(c.type), c.unit, c.meaning) for c in columns]
        parts += [f"## {title}", table(("column", "type", "unit", "meaning"), rows)]
    parts.append("A sweep over effects has a column for each, see [Effects](effects.md).")
    return "\n\n".join(parts) + "\n"


def commands_page() -> str:
    """Write what `--help` prints for every command."""
    os.environ["COLUMNS"] = "100"
    parts = [
        "# Commands",
        "The most important commands have a word of their own. Bad input ends with one line on stderr and exit "
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
    """A number with a typographic minus."""
    return f"{value:g}".replace("-", "−")


def bounds(ends: tuple[float, float]) -> str:
    """An interval in words."""
    return f"{number(ends[0])} to {number(ends[1])}"


def table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A Markdown table."""
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines)
