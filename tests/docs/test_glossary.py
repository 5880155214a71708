"""The glossary has every name that people meet: columns, keys, options of the model, public names."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path
from tokenize import COMMENT, tokenize
from typing import get_type_hints

import numpy as np
import pytest

import softflagella as sf
from calibration.swimmer.camera_tracks import COLUMNS
from calibration.swimmer.candidate_effects import influences
from calibration.swimmer.measured_table import KNOWN_COLUMNS
from dataset.rows.schema import FLAGS, INPUTS, OUTPUTS
from sim.effects import catalogue
from sim.model.body import Body
from sim.model.groups import DWELL, GROUP_COLUMNS, OPTIONAL_COLUMNS
from sim.motion.lab_units import LAB_COLUMNS
from sim.motion.steady_motion import QUALITY_COLUMNS, STEADY_COLUMNS
from tests.docs.pages import DOCS, PAGES, ROOT, glossary, replaced_words

PACKAGES = ("sim", "dataset", "surrogate", "planner", "calibration", "softflagella", "benchmarks")
TEXTS = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *PAGES]
HISTORY = {DOCS / "log.md", DOCS / "reference" / "glossary.md"}
SOURCES = sorted(file for top in (*PACKAGES, "tests") for file in (ROOT / top).rglob("*.py"))


def plan_names() -> set[str]:
    """Collect the keys of plan.json, and the columns of plan.csv and of a track."""
    robot = sf.load_robot("paper-control")
    result = sf.plan(sf.circle(2.0), robot)
    record = result.to_dict()
    inside = {key for value in record.values() if isinstance(value, dict) for key in value}
    schedule = sf.Schedule(robot.group_values(), 1, np.array([0.05]), (0.0, 0.0, 0.0), robot.time_scale)
    return {*record, *inside, *result.to_frame(), *sf.replay(schedule), "code_version"}


def sources() -> dict[str, set[str]]:
    effects = catalogue()
    return {
        "a robot's numbers": {*Body._fields},
        "groups": {*GROUP_COLUMNS, *OPTIONAL_COLUMNS, DWELL},
        "a data set": {column.name for column in (*INPUTS, *OUTPUTS, *FLAGS)},
        "steady motion": {*STEADY_COLUMNS, *QUALITY_COLUMNS, *LAB_COLUMNS},
        "measured tables": {*KNOWN_COLUMNS},
        "camera tracks": {*COLUMNS},
        "effects": {*effects, *(driver.name for effect in effects.values() for driver in effect.drivers)},
        "influences": {*influences()},
        "public names": {*sf.__all__},
    }


@pytest.mark.parametrize("source", sources())
def test_every_name_is_in_the_glossary(source: str) -> None:
    assert sources()[source] - set(glossary()) == set()


def test_names_in_plans_and_tracks_are_in_the_glossary() -> None:
    assert plan_names() - set(glossary()) == set()


def test_a_robots_numbers_have_their_unit() -> None:
    """As declared, alone or as one of several ("m; l inside")."""
    units = glossary()
    for name, hint in get_type_hints(Body, include_extras=True).items():
        (meaning,) = hint.__metadata__
        given = {part.removesuffix(" inside").strip() for part in re.split(";", units[name])}
        assert meaning.unit in given, name


def prose(text: str) -> str:
    """Remove blocks of code and names in back-ticks."""
    return re.sub(r"```.*?```|`[^`]*`", "", text, flags=re.DOTALL)


def literals(file: Path) -> Iterator[str]:
    """Yield the docstrings, messages and comments of a module; messages are all literals with a space in them."""
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and " " in node.value:
            yield prose(node.value)
    with file.open("rb") as stream:
        yield from (prose(token.string) for token in tokenize(stream.readline) if token.type == COMMENT)


def replaced(text: str) -> set[str]:
    """Find the words of a text that the glossary has replaced by a term."""
    pattern = "|".join(sorted(map(re.escape, replaced_words()), key=len, reverse=True))
    return {match.lower() for match in re.findall(rf"\b(?:{pattern})\b", " ".join(text.split()), re.IGNORECASE)}


def test_replaced_words_are_found() -> None:
    assert replaced("The Locked\nsession holds; unlocked doors") == {"locked session", "doors"}
    assert prose("the `pieces` of\n```\nvoyage\n```\nit").split() == ["the", "of", "it"]


@pytest.mark.parametrize("page", [page for page in TEXTS if page not in HISTORY], ids=lambda p: p.name)
def test_pages_use_the_terms_of_the_glossary(page: Path) -> None:
    assert replaced(prose(page.read_text())) == set()


@pytest.mark.parametrize(
    "file", [file for file in SOURCES if file != Path(__file__)], ids=lambda f: f.relative_to(ROOT).as_posix()
)
def test_docstrings_and_messages_use_the_terms_of_the_glossary(file: Path) -> None:
    assert {word for text in literals(file) for word in replaced(text)} == set()
