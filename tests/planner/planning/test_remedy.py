"""The search for what helps a path that is too tight: bounded, told about, and its advice works."""

from __future__ import annotations

from typing import Any, cast

import numpy as np
import pytest

from planner.paths.path import Path2D, circle, smoothed
from planner.paths.tractrix import STILL
from planner.planning import remedy
from planner.planning.declared_path import declare
from planner.planning.feasible import Feasibility, changed, cost, feasible
from planner.planning.progress import DECLARING, REMEDY, Share
from planner.planning.request import Corner
from sim.io.errors import InputError
from sim.model.presets import PRESETS
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


@pytest.mark.parametrize("path", [star(4.0, 1.8), star(2.0, 0.8)])
def test_a_star_is_followed_by_a_robot_that_turns_on_the_spot(path: Path2D) -> None:
    """The finest poses do not converge to a track that it can follow; coarser ones, with wider turns, do."""
    declared = declare(path, five_tails())
    assert max(declared.off_drawn, declared.missed) < 0.65


@pytest.mark.parametrize("path", [SPIKE, circle(0.2), star(0.7, 0.25)])
def test_the_search_is_bounded_and_says_that_it_goes_on(path: Path2D, monkeypatch: pytest.MonkeyPatch) -> None:
    """The scales used to be tried one after the other, each with four complete searches: minutes of silence."""
    work: list[float] = []

    def counted(raw: Path2D, feasibility: Feasibility, way: float, *rest: Any) -> Any:
        work.append(cost(raw, feasibility, way))
        return changed(raw, feasibility, way, *rest)

    monkeypatch.setattr(remedy, "changed", counted)
    told: list[Share] = []
    with pytest.raises(InputError) as caught:
        declare(path, five_tails(), lambda share: told.append(cast(Share, share)))
    assert "\n" not in str(caught.value)
    assert 0 < sum(work) <= remedy.MOST_WORK
    shares = [share.done for share in told if share.stage == REMEDY]
    assert len(shares) > 4 * len(work)  # several times while one way is tried
    assert shares == sorted(shares)
    assert shares[-1] <= 1
    assert {share.stage for share in told} == {DECLARING, REMEDY}
    assert max(told) == 0  # of the path


@pytest.mark.parametrize("corner", ["nearest", "minimax", "fillet", "error"])
@pytest.mark.parametrize("path", [circle(0.2), star(0.7, 0.25), SPIKE])
def test_what_is_advised_is_accepted(path: Path2D, corner: Corner) -> None:
    task = five_tails(corner)
    try:
        if feasible(path, task) is not None:
            return
    except InputError:  # corners are not allowed
        return
    advice = remedy.remedy(path, task)
    if "scale the path by" in advice:
        changed_path = path.scaled(float(advice.rsplit(" ", 1)[1]))
    elif "--smooth" in advice:
        changed_path, _ = smoothed(path, float(advice.rsplit(" ", 1)[1].removesuffix("l")))
    else:
        assert "neither a larger scale nor smoothing" in advice
        return
    assert feasible(changed_path, task) is not None


def test_without_work_the_answer_is_the_best_so_far(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(remedy, "MOST_WORK", 0.0)
    assert remedy.remedy(circle(0.2), five_tails()) == "scale the path by 5"  # followed as drawn
    assert "which moves it by up to" in remedy.remedy(SPIKE, five_tails())
    assert remedy.remedy(star(0.7, 0.25), five_tails()).startswith("draw it with wider turns")
