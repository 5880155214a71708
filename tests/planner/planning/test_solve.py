"""The solver's ladder of dwells, and jobs as the files know them."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from planner.goal.trip import Trip
from planner.jobs.cover import Coverage
from planner.jobs.hold import Orbit
from planner.jobs.tour import Visits
from planner.planning import solve
from planner.planning.conditions import BlockedError
from planner.planning.plan import KINDS
from planner.planning.request import PlanRequest
from planner.vehicle.zigzag import dwells_for, longer_dwells
from sim.io.errors import InputError
from tests.planner.plans import CONTROL, tracked


class Rungs:
    """Stands for the plans with one dwell each: they are blocked above a dwell, and their errors grow with it."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, clear_below: float = 99.0, *, hopeless: bool = False):
        self.tried: list[float] = []
        self._clear_below, self._hopeless = clear_below, hopeless
        monkeypatch.setattr(solve, "at_dwell", self.at)

    def at(self, task: Any, tracked: Any, request: Any, dwell: float, **_: Any) -> Any:
        self.tried.append(dwell)
        if dwell >= self._clear_below:
            refusal = BlockedError(f"blocked at {dwell:.3f}")
            refusal.hopeless = self._hopeless
            raise refusal
        return SimpleNamespace(
            stated_error=0.1 * dwell, predicted_max=0.1 * dwell, minimum_dwell=dwell, robot=CONTROL
        )

    def plan(self, *, longer: bool = True, **options: Any) -> Any:
        task = solve.Task(source=lambda _: 1 / 0, longer=longer)
        return solve.by_dwell(task, tracked(), PlanRequest(objective="flips", **options))


@pytest.mark.parametrize("longer", [True, False])
def test_where_the_path_is_blocked_longer_and_shorter_dwells_are_tried(
    longer: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Longer ones first, if the task allows them; the first that is clear is taken."""
    dwells = dwells_for(tracked().vehicle, "flips", None)
    rungs = Rungs(monkeypatch, clear_below=dwells[0])
    assert rungs.plan(longer=longer).minimum_dwell == rungs.tried[-1] < dwells[0]
    others = longer_dwells(tracked().vehicle, dwells[0])[:4] if longer else []
    assert rungs.tried[:-1] == [dwells[0], *others]


def test_the_first_refusal_is_told_and_a_hopeless_one_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    first = dwells_for(tracked().vehicle, "flips", None)[0]
    for hopeless, count in ((False, 5), (True, 1)):
        rungs = Rungs(monkeypatch, 0.0, hopeless=hopeless)
        with pytest.raises(BlockedError, match=f"blocked at {first:.3f}"):
            rungs.plan(longer=False)
        assert len(rungs.tried) == count
    with pytest.raises(BlockedError):
        Rungs(monkeypatch, 0.0).plan(dwell=1.0)


def test_the_longest_dwell_that_keeps_a_tolerance_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    dwells = dwells_for(tracked().vehicle, "flips", None)
    best = Rungs(monkeypatch).plan(tolerance=0.1)
    assert best.minimum_dwell == max(dwell for dwell in dwells if 0.1 * dwell <= 0.1)
    with pytest.raises(InputError, match=r"tolerance 0.11 mm .* cannot be kept: the smallest stated error is"):
        Rungs(monkeypatch).plan(tolerance=0.001)


def test_files_know_the_kinds_of_jobs() -> None:
    assert (Trip.kind, Visits.kind, Coverage.kind, Orbit.kind) == KINDS
