"""The declared path: tight, noisy and degenerate paths are refused with a remedy that works, or followed."""

from __future__ import annotations

import re
from typing import Any, cast

import numpy as np
import pytest

from planner.paths.path import Path2D, circle, polygon, smoothed
from planner.paths.tractrix import STILL
from planner.planning import remedy
from planner.planning.declared_path import declare
from planner.planning.feasible import Feasibility, changed, cost, feasible
from planner.planning.plan import plan
from planner.planning.progress import DECLARING, REMEDY, Share
from planner.planning.request import Corner
from sim.io.errors import InputError
from sim.model.presets import PRESETS
from tests.planner.plans import CONTROL
from tests.planner.vehicles import vehicle

SPIKE = Path2D.of([[0, 0], [3, 0], [3.05, 2], [3.1, 0], [6, 0]])


def star(outer: float, inner: float) -> Path2D:
    angle = np.pi * np.arange(10) / 5 + np.pi / 2
    radius = np.where(np.arange(10) % 2 == 0, outer, inner)[:, None]
    return Path2D.of(radius * np.stack([np.cos(angle), np.sin(angle)], 1), closed=True)


def five_tails(corner: Corner = "nearest") -> Feasibility:
    """A robot whose pivot turns on a small circle far behind the head, as robots with five tails do."""
    car = vehicle(surge=0.0022, sway=0.045)
    return Feasibility(PRESETS["paper-control"], car, car.pivot_distance, STILL, corner)


def refusal(path: Any) -> str:
    with pytest.raises(InputError) as caught:
        plan(path, CONTROL)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def advised(words: str) -> float:
    """Return the number at the end of an advice."""
    return float(words.rsplit(" ", 1)[1].removesuffix("l"))


@pytest.mark.parametrize("radius", [0.4, 0.57])
def test_a_tight_circle_is_refused_with_a_scale_that_works(radius: float) -> None:
    words = refusal(circle(radius))
    assert "too tight" in words
    assert plan(circle(radius * advised(words)), CONTROL).predicted_rms < 0.1


@pytest.mark.parametrize("noise", [0.02, 0.2])
def test_the_smoothing_that_a_noisy_path_is_told_works(noise: float) -> None:
    rng = np.random.default_rng(0)
    angle = np.arange(0, 2 * np.pi, 0.005)
    ring = 2 * np.stack([np.cos(angle), np.sin(angle)], 1)
    noisy = Path2D.of(ring + noise * rng.normal(size=ring.shape))
    words = refusal(noisy)
    assert re.search("it looks noisy: .* give --smooth", words)
    smooth, _ = smoothed(noisy, advised(words))
    assert plan(smooth, CONTROL).predicted_rms < 0.1


def test_a_declared_path_far_from_the_drawn_one_says_so_first(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("planner.planning.declared_path.FAR", 0.02)
    triangle = plan(polygon(3, 4.0), CONTROL, objective="flips")
    assert triangle.warnings[0].startswith("the declared path leaves the drawn one by up to")


def test_small_paths_are_small_and_a_line_and_back_ends_with_a_line() -> None:
    small = refusal(circle(0.2))
    assert small.endswith("scale the path by 3.5")
    assert "noisy" not in small
    refusal([[0, 0], [5, 0], [0, 0]])


def test_many_points_with_little_noise_are_the_same_path() -> None:
    """30,000 points with noise of 1e-4 l: as many flips as the circle without it, within 2 %."""
    rng = np.random.default_rng(0)
    angle = np.linspace(0, 2 * np.pi, 30_000, endpoint=False)
    clean = 1.5 * np.stack([np.cos(angle), np.sin(angle)], 1)
    one, other = (
        plan(Path2D.of(clean + s * rng.normal(size=clean.shape), closed=True), CONTROL, objective="flips")
        for s in (0, 1e-4)
    )
    assert len(other.dwells) == pytest.approx(len(one.dwells), rel=0.02)
    assert other.errors.drawn_rms == pytest.approx(one.errors.drawn_rms, rel=0.05)


@pytest.mark.parametrize(("outer", "inner"), [pytest.param(4.0, 1.8, marks=pytest.mark.rest), (2.0, 0.8)])
def test_a_star_is_followed_by_a_robot_that_turns_on_the_spot(outer: float, inner: float) -> None:
    """The finest poses do not converge to a track that it can follow; coarser ones, with wider turns, do."""
    declared = declare(star(outer, inner), five_tails())
    assert max(declared.off_drawn, declared.missed) < 0.65


TIGHT = {"circle": circle(0.2), "star": star(0.7, 0.25), "spike": SPIKE}


@pytest.mark.parametrize(
    "name", ["star", *(pytest.param(name, marks=pytest.mark.rest) for name in ("circle", "spike"))]
)
def test_the_search_is_bounded_and_says_that_it_goes_on(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    work: list[float] = []

    def counted(raw: Path2D, feasibility: Feasibility, way: float, *rest: Any) -> Any:
        work.append(cost(raw, feasibility, way))
        return changed(raw, feasibility, way, *rest)

    monkeypatch.setattr(remedy, "changed", counted)
    told: list[Share] = []
    with pytest.raises(InputError) as caught:
        declare(TIGHT[name], five_tails(), lambda share: told.append(cast(Share, share)))
    assert "\n" not in str(caught.value)
    assert 0 < sum(work) <= remedy.MOST_WORK
    shares = [share.done for share in told if share.stage == REMEDY]
    assert len(shares) > 4 * len(work)  # several times while one way is tried
    assert shares == sorted(shares)
    assert shares[-1] <= 1
    assert {share.stage for share in told} == {DECLARING, REMEDY}
    assert max(told) == 0  # of the path


QUICK = [("circle", "nearest"), ("circle", "fillet"), ("circle", "error")]


@pytest.mark.parametrize(
    ("name", "corner"),
    [
        pytest.param(name, corner, marks=() if (name, corner) in QUICK else pytest.mark.rest)
        for name in TIGHT
        for corner in ("nearest", "minimax", "fillet", "error")
    ],
)
def test_what_is_advised_is_accepted(name: str, corner: Corner) -> None:
    path, task = TIGHT[name], five_tails(corner)
    try:
        if feasible(path, task) is not None:
            return
    except InputError:  # corners are not allowed
        return
    advice = remedy.remedy(path, task)
    if "scale the path by" in advice:
        changed_path = path.scaled(advised(advice))
    elif "--smooth" in advice:
        changed_path, _ = smoothed(path, advised(advice))
    else:
        assert "neither a larger scale nor smoothing" in advice
        return
    assert feasible(changed_path, task) is not None


def test_without_work_the_answer_is_the_best_so_far(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(remedy, "MOST_WORK", 0.0)
    assert remedy.remedy(circle(0.2), five_tails()) == "scale the path by 5"  # followed as drawn
    assert "which moves it by up to" in remedy.remedy(SPIKE, five_tails())
    assert remedy.remedy(star(0.7, 0.25), five_tails()).startswith("draw it with wider turns")
