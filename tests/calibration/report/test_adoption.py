"""A law becomes a member of the catalogue: a file with its formula, and a test that holds it."""

from __future__ import annotations

import importlib.util
import json
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from calibration.report.adoption import adopt_law
from common.errors import InputError
from sim.effects import catalogue
from sim.solve.assembly import numbers
from tests.sim.model.test_laws import with_law

LAWS = {
    "Fx_wh": ("law_Fx_wh_speed-93_length425_tails0", 0.4),
    "Cyr": ("law_Cyr_speed100_length400_tails0", 1.0),
    "tail_drag": ("law_tail_drag_speed-150_length-500_tails100", 1.0),
    "Mz_wt_odd": ("law_Mz_wt_rectified_speed-93_length425_tails0", 0.4),
    "Fx_wt_at_l": ("law_Fx_wt_l-500_speed0_length1000_tails1000", 0.1),
    "tail_spin_drag": ("law_tail_spin_drag_speed100_length0_tails0", 1.0),
    "tail_drag_along": ("law_tail_drag_along_speed100_length0_tails0", 0.4),
}


def record(place: str) -> dict[str, Any]:
    runs = {"N": [2, 5], "l_cm": [5.0, 15.0], "omega_rpm": [143.0, 143.0]}
    effect = dict(zip(("name", "size"), LAWS[place], strict=True))
    return {"place": place, "words": f"words of {place}", "effect": effect, "error": 0.026, "runs": runs}


def verdict(folder: Path) -> Path:
    laws = {"kept": list(LAWS), "laws": [record(place) for place in LAWS]}
    path = folder / "verdict.json"
    path.write_text(json.dumps({"error_before": 0.05, "laws": laws, "table": "runs.csv"}))
    return path


def module(path: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(path.stem, path)
    loaded = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(loaded)
    return loaded


@pytest.mark.parametrize("place", LAWS)
def test_the_file_is_an_effect_with_the_law_s_formula(place: str, tmp_path: Path, monkeypatch: Any) -> None:
    effect_file, test_file = adopt_law(verdict(tmp_path), "new_effect", tmp_path / "out", place=place)
    effect = module(effect_file).EFFECT
    name, size = LAWS[place]
    assert (effect.name, effect.typical, effect.null) == ("new_effect", size, 0.0)
    text = " ".join(effect_file.read_text().split())
    assert all(len(line) <= 115 for file in (effect_file, test_file) for line in file.read_text().splitlines())
    assert effect.source == "a law of measured runs, runs.csv"
    assert "N from 2 to 5, l from 5 to 15 cm, ω = 143 rpm" in text
    assert "2.60 % with it, 5.00 % without it" in text
    monkeypatch.setitem(catalogue(), "new_effect", effect)
    for changes in ({}, {"N": 4, "l_over_R": 4.0, "omega_bar": -20.0}):
        one, other = (numbers(with_law(each, 0.7 * size, **changes)) for each in ("new_effect", name))
        np.testing.assert_array_equal(one, other)
    own_test = module(test_file)
    for case in own_test.test_the_motion_is_that_of_the_law.pytestmark[0].args[1]:
        own_test.test_the_motion_is_that_of_the_law(*case)
    monkeypatch.setattr(own_test, "SIZE", 0.8 * size)
    with pytest.raises(AssertionError):
        own_test.test_the_motion_is_that_of_the_law(*case)


def test_the_best_law_is_adopted_by_default_and_words_cannot_end_a_string(tmp_path: Path) -> None:
    effect_file, _ = adopt_law(verdict(tmp_path), "new_effect", tmp_path)
    assert "Words of Fx_wh" in effect_file.read_text()
    content = json.loads((tmp_path / "verdict.json").read_text())
    content["table"] = 'a".csv\\'
    content["laws"]["laws"][0]["words"] = 'words """ raise SystemExit'
    (tmp_path / "verdict.json").write_text(json.dumps(content))
    effect = module(adopt_law(tmp_path / "verdict.json", "new_effect", tmp_path)[0]).EFFECT
    assert effect.source == "a law of measured runs, a.csv"


@pytest.mark.parametrize(
    ("name", "place", "content", "message"),
    [
        ("New Effect", "", None, "write lower-case letters"),
        ("lambda", "", None, "no keyword of Python"),
        ("disc_drag", "", None, "there is an effect disc_drag already"),
        ("new_effect", "Mz_wh", None, "no law 'Mz_wh' was kept; kept are Fx_wh, Cyr, tail_drag, "),
        ("new_effect", "", "{}", "has no laws"),
        ("new_effect", "", "[1]", "has no laws"),
        ("new_effect", "", "no", "is no verdict.json"),
        ("new_effect", "", '{"error_before": 0.1, "laws": {"kept": [], "laws": []}}', "no law describes the runs"),
        ("new_effect", "", '{"error_before": 0.1, "laws": {"kept": ["Ct"], "laws": [{"place": "Ct"}]}}',
         "cannot be read"),
    ],
    ids=["capitals", "keyword", "taken", "not kept", "no laws", "list", "no JSON", "none kept", "no effect"],
)  # fmt: skip
def test_what_cannot_be_adopted_is_refused_and_nothing_is_written(
    name: str, place: str, content: str | None, message: str, tmp_path: Path
) -> None:
    source = verdict(tmp_path)
    if content is not None:
        source.write_text(content)
    with pytest.raises(InputError, match=message):
        adopt_law(source, name, tmp_path / "out", place=place)
    assert not (tmp_path / "out").exists()
