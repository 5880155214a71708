"""Pages that are written from the code contain what the code declares, and pages name only what there is."""

from __future__ import annotations

import inspect
import re
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

import pytest

import softflagella as sf
from dataset.rows.schema import FLAGS, INPUTS, OUTPUTS
from sim.effects import catalogue
from softflagella.__main__ import PACKAGES, WORDS
from tests.docs.pages import DOCS, PAGES, ROOT, generator, page_name

TOP = (*PACKAGES, "softflagella", "benchmarks", "tests")
_MODULE = re.compile(rf"`((?:{'|'.join(TOP)})(?:\.\w+)+)`")
_COMMAND = re.compile(rf"python -m ((?:{'|'.join(TOP)})(?:\.\w+)*)")
_BENCHMARK = re.compile(r"python -m\s+benchmarks[ \n]([a-z_]+)\b")
_FILE = re.compile(rf"`((?:{'|'.join((*TOP, 'docs'))})/[\w/.-]+)`")
SOURCES = sorted(file for top in (*PACKAGES, "softflagella", "benchmarks") for file in (ROOT / top).rglob("*.py"))


def test_the_page_of_effects_has_each() -> None:
    page = generator().effects_page()
    for effect in catalogue().values():
        for words in (f"`{effect.name}`", effect.title, f"`{effect.equation}`", effect.source, effect.unit):
            assert words.replace("|", "\\|") in page, effect.name
        for driver in effect.drivers:
            assert f"`{driver.name}`" in page


def test_the_page_of_columns_has_each() -> None:
    page = generator().columns_page()
    for column in (*INPUTS, *OUTPUTS, *FLAGS):
        assert f"| `{column.name}` | {column.type} | {column.unit} | {column.meaning} |" in page


def test_the_page_of_commands_has_each() -> None:
    page = generator().commands_page()
    for package in PACKAGES:
        for name in import_module(f"{package}.__main__").program.commands:
            assert f"usage: softflagella {package} {name}" in page
    for word in WORDS:
        assert f"usage: softflagella {word}" in page


def test_all_fields_of_public_classes_say_what_they_hold() -> None:
    generate = generator()
    records = generate.public_records()
    names = {record.__name__ for record in records}
    assert {"Robot", "Plan", "Command", "Drawing", "Verdict", "RobotVerdict", "Declared", "Evidence"} <= names
    page = generate.objects_page()
    for record in records:
        assert f"## {record.__name__}\n" in page
        for field in generate.fields_of(record):
            assert field.meaning, f"{record.__module__}.{record.__name__}.{field.name} has no comment"
            assert f"| `{field.name}` |" in page


_SHAPE = re.compile(r"\((?:[A-Za-z\d](?: \+ 1)?,|(?:[A-Za-z\d](?: \+ 1)?, )+[A-Za-z\d])\)")


def test_shapes_are_written_with_the_letters_of_the_page() -> None:
    """In docstrings of public names and their methods, and in the comments of fields."""
    page = (DOCS / "reference" / "api.md").read_text()
    letters = set(re.findall(r"^\| (\w) \|", page, re.MULTILINE))
    texts = {}
    for name in sf.__all__:
        thing = getattr(sf, name)
        parts = vars(thing).items() if inspect.isclass(thing) else []
        shown = {part: value for part, value in parts if callable(value) or isinstance(value, property)}
        texts |= {f"{name}.{part}": inspect.getdoc(value) or "" for part, value in shown.items()}
        texts[name] = inspect.getdoc(thing) or ""
    generate = generator()
    for record in generate.public_records():
        texts |= {f"{record.__name__}.{field.name}": field.meaning for field in generate.fields_of(record)}
    shapes = {(name, shape) for name, text in texts.items() for shape in _SHAPE.findall(text)}
    assert len(shapes) > 40
    for name, shape in shapes:
        assert set(re.findall(r"[A-Za-z]", shape)) <= letters, f"{name}: {shape}"


def test_the_page_of_python_has_each_public_name() -> None:
    page = (DOCS / "reference" / "api.md").read_text()
    documented = set(re.findall(r"^\.\. auto(?:function|class|exception):: (\w+)$", page, re.MULTILINE))
    assert documented == set(sf.__all__) - {"__version__"}


def test_generated_pages_are_written_once(tmp_path: Path) -> None:
    write = generator().write_generated_pages
    write(tmp_path / "new")
    files = sorted((tmp_path / "new").iterdir())
    assert [file.name for file in files] == ["columns.md", "commands.md", "effects.md", "objects.md"]
    before = [file.stat().st_mtime_ns for file in files]
    write(tmp_path / "new")
    assert [file.stat().st_mtime_ns for file in files] == before


def exists(name: str) -> bool:
    """Tell whether a dotted name is a module, or something in one."""
    parts = name.split(".")
    for count in range(len(parts), 0, -1):
        module = ".".join(parts[:count])
        try:
            if find_spec(module) is None:
                continue
        except ModuleNotFoundError:
            continue
        value: object = import_module(module)
        for part in parts[count:]:
            if not hasattr(value, part) and part not in getattr(value, "__annotations__", {}):
                return False
            value = getattr(value, part, None)
        return True
    return False


@pytest.mark.parametrize("file", [*PAGES, *SOURCES], ids=lambda f: f.relative_to(ROOT).as_posix())
def test_what_is_named_exists(file: Path) -> None:
    text = file.read_text()
    for name in {*_MODULE.findall(text), *_COMMAND.findall(text)}:
        assert exists(name), f"{file.relative_to(ROOT)} names {name}"
    for name in _BENCHMARK.findall(text):
        assert list((ROOT / "benchmarks").glob(f"*/{name}.py")), f"{file.relative_to(ROOT)} names benchmark {name}"
    for path in _FILE.findall(text):
        assert (ROOT / path).exists(), f"{file.relative_to(ROOT)} names {path}"


def test_every_page_is_in_the_table_of_contents() -> None:
    entries = (DOCS / "index.md").read_text().splitlines()
    for page in PAGES:
        name = page_name(page).removesuffix(".md")
        assert name == "index" or name in entries
