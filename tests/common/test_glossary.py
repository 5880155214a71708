"""A term is explained once: in the help of the commands that have it, and on the page of the glossary."""

from __future__ import annotations

import re

import numpy as np
import pytest

from common.glossary import TERMS, terms_in
from docs.generate import glossary_page
from planner.jobs.plan import plan
from sim.effects import catalogue
from sim.model.presets import PRESETS
from softflagella.__main__ import WORDS, command, main
from tests.docs.pages import DOCS

EXPECTED = {
    "plan": {
        "objective",
        "stated error",
        "declared path",
        "dwell",
        "flips",
        "pivot",
        "point of the robot",
        "preset",
    },
    "goal": {"objective", "stated error", "declared path", "dwell", "flips", "pivot", "preset"},
    "check": {"stated error", "declared path"},
    "query": {"domain", "preset"},
    "robot": {"preset"},
}


@pytest.mark.parametrize("word", WORDS)
def test_help_explains_the_terms_that_it_has_and_no_others(
    word: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "60")  # a term may be on two lines
    with pytest.raises(SystemExit):
        main([word, "--help"])
    said = re.sub(r"-\s+", "-", " ".join(capsys.readouterr().out.split()))
    options, _, explained = said.partition(" terms: ")
    there = {term for term in TERMS if re.search(rf"\b{term}\b", said, re.IGNORECASE)}
    assert there == {term for term in TERMS if f"{term} {TERMS[term]}" in explained}
    assert there == EXPECTED.get(word, there)
    assert "point of the robot" in options or "point of the robot" not in explained
    assert command(word).help.lower() in options.lower() or word not in EXPECTED


def test_a_meaning_has_only_terms_that_come_later() -> None:
    """So `terms_in` misses none."""
    for term in TERMS:
        further = terms_in(term).keys() - {term}
        assert further <= set(list(TERMS)[list(TERMS).index(term) :]), term
    assert terms_in("a fragment of domains, of laws and scores, and a dwelling") == {}


def test_the_page_of_the_glossary_lists_them() -> None:
    (page,) = glossary_page()
    assert all(f"| {term} | {meaning} |" in page for term, meaning in TERMS.items())
    glossary = (DOCS / "reference" / "glossary.md").read_text()
    assert "{include} generated/glossary.md" in glossary
    assert not any(f"| {term} |" in glossary for term in TERMS)


@pytest.mark.slow
def test_the_paper_s_robot_flips_as_often_as_said() -> None:
    for objective, seconds in re.findall(r"(\w+): [^:]*?every (\d+) s", TERMS["objective"]):
        result = plan("square:3l", PRESETS["paper-control"], objective=objective)
        assert np.mean(result.seconds) == pytest.approx(float(seconds), rel=0.2)


def test_effects_are_listed_with_size_unit_and_inputs(capsys: pytest.CaptureFixture[str]) -> None:
    main(["effects"])
    lines = capsys.readouterr().out.splitlines()
    for name, effect in catalogue().items():
        (line,) = (line for line in lines if line.startswith(f"{name} "))
        assert line.split()[1] == f"{effect.typical:g}"
        assert f" {effect.unit} " in line
        following = lines[lines.index(line) + 1 :][: len(effect.drivers) + bool(effect.beside)]
        for driver in effect.drivers:
            assert any(
                f" {driver.typical:g} {driver.unit} " in each and driver.column in each for each in following
            )
        assert effect.beside in following[-1] if effect.beside else True
