"""The rule of the verdict, and the old names of its parts."""

from __future__ import annotations

from dataclasses import fields
from types import SimpleNamespace
from typing import Any

import pytest

from calibration.verdict.contents import Corrections, Evidence, HeldOutErrors
from calibration.verdict.next_steps import next_steps
from calibration.verdict.old_names import OLD_NAMES
from calibration.verdict.verdict import Verdict, reach_verdict


def evidence(p_value: float, effects: int, numbers: int) -> Any:
    misfit = SimpleNamespace(p_value=p_value)
    return SimpleNamespace(misfit=misfit, explaining=(None,) * effects, rival_numbers=(None,) * numbers)


@pytest.mark.parametrize(
    ("p_value", "effects", "rival_numbers", "number_explains", "verdict"),
    [
        (0.5, 0, 0, False, "none"),
        (0.5, 0, 0, True, "number"),
        (0.01, 0, 0, True, "number"),
        (0.01, 1, 0, True, "effect"),
        (0.01, 1, 1, True, "ambiguous"),
        (0.01, 0, 0, False, "unexplained"),
        (0.01, 1, 0, False, "effect"),
        (0.01, 2, 0, False, "ambiguous"),
        (0.01, 5, 0, False, "ambiguous"),
    ],
)
def test_the_rule(p_value: float, effects: int, rival_numbers: int, number_explains: bool, verdict: str) -> None:
    given = evidence(p_value, effects, rival_numbers)
    assert reach_verdict(given, 0.04, number_explains=number_explains) == verdict


def unexplained(
    *, error: float, interval: tuple[float, float], p_value: float = 0.4, verdict: str = "unexplained"
) -> Verdict:
    """A verdict with nothing but its errors; noise 2.36 %."""
    rms = {"uncalibrated": 0.2, "before": error, "after": error}
    found = Evidence(SimpleNamespace(p_value=0.004), 1000, (), (), (), {})  # type: ignore[arg-type]
    fits: Any = SimpleNamespace(pulls=(), base=None, final=None)
    conditions: Any = SimpleNamespace(split=SimpleNamespace(names="N=4"))
    parts: Any = {"fits": fits, "corrections": Corrections(None, None), "next": None, "conditions": conditions}  # type: ignore[arg-type]
    return Verdict(verdict, found, errors=HeldOutErrors(rms, {}, interval, 0.0236, p_value), **parts)


def test_a_residual_that_the_held_out_runs_do_not_show_is_harmless() -> None:
    small = unexplained(error=0.0237, interval=(0.0219, 0.0256))
    assert small.harmless
    assert "harmless for prediction" in small.sentence
    assert "off by 2.37 %, and noise alone makes 2.36 %" in small.sentence
    assert next_steps(small)[0].startswith("Plan with the corrected robot")
    assert "harmless" in next_steps(small)[0]


@pytest.mark.parametrize(
    "other",
    [
        unexplained(error=0.0265, interval=(0.0245, 0.0290)),  # the held-out runs show it
        unexplained(error=0.0280, interval=(0.0200, 0.0350)),  # too few of them to say
        unexplained(error=0.0237, interval=(0.0219, 0.0256), p_value=0.001),  # in one output, say
    ],
    ids=["shown", "too few", "disagreement"],
)
def test_any_other_residual_is_not(other: Verdict) -> None:
    assert not other.harmless
    assert "harmless" not in other.sentence
    assert "Look where the residual is large" in next_steps(other)[0]


def test_what_is_explained_is_not_called_harmless() -> None:
    assert not unexplained(error=0.0237, interval=(0.0219, 0.0256), verdict="effect").harmless


def test_old_names_warn_and_find_their_part() -> None:
    parts: dict[str, Any] = {}
    for path in OLD_NAMES.values():
        part, *steps = path.split(".")
        holder = parts.setdefault(part, SimpleNamespace())
        for step in steps[:-1]:
            holder.__dict__.setdefault(step, SimpleNamespace())
            holder = getattr(holder, step)
        setattr(holder, steps[-1], path)
    assert set(parts) <= {field.name for field in fields(Verdict)}
    verdict = Verdict(**{"verdict": "none", "errors": None, **parts})
    for old, new in OLD_NAMES.items():
        with pytest.warns(DeprecationWarning, match=f"Verdict.{old} is deprecated; use Verdict.{new}"):
            assert getattr(verdict, old) == new
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        verdict.nothing  # noqa: B018
