"""The rule of the verdict, and what is harmless."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from calibration.attribution.hypothesis import Evidence, Hypothesis, Origin
from calibration.attribution.rules import RULES, Trial, doubted
from calibration.findings.held_out import HeldOutErrors
from calibration.findings.record import _specimens_in_words
from calibration.statistics.budget import Work, limited, work_done
from calibration.statistics.study import Study
from calibration.verdict import calibrate
from calibration.verdict.calibrate import _listed
from calibration.verdict.explain import _forecast
from calibration.verdict.verdict import Verdict
from calibration.words.render import next_steps
from common.errors import InputError
from tests.calibration.toy_tables import DRAG, FEW_CANDIDATES, ambiguous, calibrated, none, number, toy_table


@pytest.mark.parametrize(
    ("p_value", "effects", "rival_numbers", "number_explains", "verdict"),
    [
        (0.5, 0, 0, False, "none"),
        (0.5, 0, 0, True, "number"),
        (0.01, 0, 0, True, "number"),
        (0.01, 1, 0, True, "effect"),
        (0.01, 1, 1, True, "ambiguous"),
        (0.01, 0, 0, False, "unexplained"),
        (0.01, 0, 0, False, "partial"),
        (0.01, 1, 0, False, "effect"),
        (0.01, 2, 0, False, "ambiguous"),
    ],
)
def test_the_rule(p_value: float, effects: int, rival_numbers: int, number_explains: bool, verdict: str) -> None:
    found = none().attribution
    effect = Hypothesis(Origin.EFFECT, (), found.base)
    number = Hypothesis(Origin.NUMBER, (), found.base, Evidence(pulls=none().pulls[:1]))
    explanations = (effect,) * effects + (number,) * rival_numbers if effects else (number,) * number_explains
    nearest = replace(effect, origin=Origin.FORM) if verdict == "partial" else None
    tested = replace(
        found, misfit=replace(found.misfit, p_value=p_value), explanations=explanations, nearest=nearest
    )
    assert tested.verdict(0.04) == verdict


def unexplained(
    error: float, interval: tuple[float, float], *, p_value: float = 0.4, verdict: str = "unexplained"
) -> Verdict:
    """A verdict with errors on its held-out runs; noise 2.36 %."""
    rms = {"uncalibrated": 0.2, "before": error, "after": error}
    return replace(none(), verdict=verdict, errors=HeldOutErrors(rms, {}, interval, 0.0236, p_value))


def test_a_residual_that_the_held_out_runs_do_not_show_is_harmless() -> None:
    small = unexplained(0.0237, (0.0219, 0.0256))
    assert small.harmless
    assert "harmless for prediction" in small.sentence
    assert "off by 2.37 %, and noise alone makes 2.36 %" in small.sentence
    assert next_steps(small.facts)[0].startswith("Plan with the corrected robot")
    assert "harmless" in next_steps(small.facts)[0]
    assert not unexplained(0.0237, (0.0219, 0.0256), verdict="effect").harmless
    for shown in (
        unexplained(0.0265, (0.0245, 0.0290)),  # the held-out runs show it
        unexplained(0.0280, (0.0200, 0.0350)),  # too few of them to say
        unexplained(0.0237, (0.0219, 0.0256), p_value=0.001),  # in one output, say
    ):
        assert not shown.harmless
        assert "harmless" not in shown.sentence
        assert "Look where the residual is large" in next_steps(shown.facts)[1]


def test_what_is_claimed_must_lower_the_error() -> None:
    for verdict, after, falls in (("none", 0.02, None), ("number", 0.02, True), ("effect", 0.031, False)):
        errors = HeldOutErrors({"uncalibrated": 0.2, "before": 0.03, "after": after}, {}, (0.0, 1.0), 0.02, 0.5)
        assert replace(none(), verdict=verdict, errors=errors).held_out_error_falls is falls


@pytest.mark.parametrize(
    ("given", "after", "gain", "p_value", "advice"),
    [
        (0.2, 0.02, (0.005, 0.015), 0.5, "corrected"),
        (0.2, 0.029, (-0.001, 0.003), 0.5, "wait"),
        (0.2, 0.031, None, 0.5, "wait"),
        (0.2, 0.02, (0.005, 0.015), 0.001, "wait"),
        (0.02, 0.021, (0.005, 0.013), 0.5, "as given"),
    ],
)
def test_the_model_to_use_is_better_on_the_held_out_runs(
    given: float, after: float, gain: tuple[float, float] | None, p_value: float, advice: str
) -> None:
    rms = {"uncalibrated": given, "before": 0.03, "after": after}
    errors = HeldOutErrors(rms, {}, (0.0, 1.0), 0.02, p_value, gain)
    assert replace(none(), verdict="effect", errors=errors).advice == advice


@pytest.mark.parametrize(("tolerances", "hedged"), [(8.3, True), (4.0, False)])
def test_a_number_that_is_hardly_an_error_of_measurement_is_hedged(tolerances: float, hedged: bool) -> None:
    said = number()
    (pull,) = (p for p in said.pulls if p.freed)
    pull = replace(pull, alone=tolerances * pull.parameter.sigma)
    claim = said.attribution.number.seen(imitable=0.0, transfer=0.5, pulls=(pull,))
    claim = doubted(claim, Trial(Study(said.base.model, said.split), said.base), RULES)
    sentence = replace(said, attribution=replace(said.attribution, explanations=(claim,))).sentence
    assert ("or something outside the catalogue looks like it" in sentence) == hedged
    assert ("off by 8 of its tolerances" in sentence) == hedged


def test_what_breaks_down_at_its_ends_loses_no_verdict(monkeypatch: pytest.MonkeyPatch) -> None:
    """A rival that cannot be simulated at the next runs, and a model that cannot at the ends of its intervals."""

    def breaks(*_: object, **__: object) -> Any:
        raise InputError("the simulation of a run broke down")

    few = (DRAG, "surface_couple", "tail_contact", "left_right_bias")
    whole = ambiguous()  # which other tests read, too
    for name in ("next_runs", "profile_intervals"):
        monkeypatch.setattr(calibrate, name, breaks)
    broken = calibrated(toy_table(1, lengths_cm=(8.0,), **{DRAG: 4.0}), few=few)
    assert broken.verdict == "ambiguous"
    assert (len(broken.explanations), broken.next_runs) == (len(whole.explanations), ())
    assert broken.base_intervals == {name: broken.base.interval(name) for name in broken.base.names}


def test_coefficients_that_the_runs_do_not_determine_are_named() -> None:
    two_tails = toy_table(3, lengths_cm=(10.0, 10.5, 11.0, 11.5), design={"tails": (2,)})
    said = "these runs determine C_t and C_yr to no better than a factor of two"
    assert said in calibrated(two_tails, few=FEW_CANDIDATES).caveats
    assert not any("factor of two" in limit for limit in none().caveats)


@pytest.mark.parametrize(
    ("seconds", "comes_first"), [(1e4, False), (5.0, True)], ids=["a long one", "a short one"]
)
def test_the_end_of_the_search_is_told_where_it_comes_before_all_fits(
    seconds: float, comes_first: bool, capsys: pytest.CaptureFixture[str]
) -> None:
    shown: Any = SimpleNamespace(progress=True)
    with limited(Work(seconds=seconds)):
        _forecast(shown, work_done(), 1.0, 0.1)(3, 6.0)
    said = capsys.readouterr().err
    assert "3 effects to fit take 6 s of processor time" in said
    assert "pairs follow, 21 s at most" in said
    assert ("the search ends after about 5 s" in said) == comes_first


@pytest.mark.parametrize(
    ("specimen", "trace", "words"),
    [(np.zeros(2), None, "specimens"), (None, None, "sessions"), (None, np.zeros(2), "sessions of traces")],
)
def test_sizes_differ_between_specimens_only_where_some_are_noted(specimen: Any, trace: Any, words: str) -> None:
    runs: Any = SimpleNamespace(specimen=specimen, trace=trace)
    assert _specimens_in_words(runs) == words


def test_of_many_single_readings_the_first_three_are_listed() -> None:
    assert _listed(["a", "b", "c"]) == "a; b; c"
    assert _listed(["a", "b", "c", "d", "e"]) == "a; b; c; and 2 others"
