"""The rule of the verdict, and the old names of its parts."""

from __future__ import annotations

from dataclasses import fields
from types import SimpleNamespace
from typing import Any

import pytest

from calibration.verdict.verdict import _OLD_NAMES, Verdict, reach_verdict


def evidence(p_value: float, explanations: int) -> Any:
    return SimpleNamespace(misfit=SimpleNamespace(p_value=p_value), explaining=(None,) * explanations)


@pytest.mark.parametrize(
    ("p_value", "explanations", "number_explains", "verdict"),
    [
        (0.5, 0, False, "none"),
        (0.5, 0, True, "number"),
        (0.01, 0, True, "number"),
        (0.01, 1, True, "effect"),
        (0.01, 0, False, "unexplained"),
        (0.01, 1, False, "effect"),
        (0.01, 2, False, "ambiguous"),
        (0.01, 5, False, "ambiguous"),
    ],
)
def test_the_rule(p_value: float, explanations: int, number_explains: bool, verdict: str) -> None:
    assert reach_verdict(evidence(p_value, explanations), 0.04, number_explains=number_explains) == verdict


def test_old_names_warn_and_find_their_part() -> None:
    parts: dict[str, Any] = {}
    for path in _OLD_NAMES.values():
        part, *steps = path.split(".")
        holder = parts.setdefault(part, SimpleNamespace())
        for step in steps[:-1]:
            holder.__dict__.setdefault(step, SimpleNamespace())
            holder = getattr(holder, step)
        setattr(holder, steps[-1], path)
    assert set(parts) <= {field.name for field in fields(Verdict)}
    verdict = Verdict(**{"verdict": "none", "errors": None, **parts})
    for old, new in _OLD_NAMES.items():
        with pytest.warns(DeprecationWarning, match=f"Verdict.{old} is deprecated; use Verdict.{new}"):
            assert getattr(verdict, old) == new
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        verdict.nothing  # noqa: B018
