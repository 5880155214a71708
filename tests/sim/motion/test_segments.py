"""Schedules in segments: as in order, with any number of threads, where a dwell fails, and what remembers long."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd
import pytest

from common.errors import InputError
from sim import threads
from sim.model.schedule import Schedule
from sim.motion import segments
from sim.motion.replay import replay
from sim.motion.run import Resolution
from sim.motion.shapes import scheduled_shapes
from sim.solve.march import Marched, Marcher, side_by_side
from tests.sim.robots import CONTROL_VALUES

FEW = Resolution(6, 12)
POSE = ["x_over_l", "y_over_l", "heading_rad"]


def schedule(count: int = 40, **changes: float) -> Schedule:
    dwells = np.where(np.arange(count) % 2, 1.2, 1.6) * np.random.default_rng(3).uniform(0.8, 1.25, count)
    return Schedule({**CONTROL_VALUES, **changes}, 1, dwells, (1.0, -1.0, 0.5), 1.0)


def in_order(swum: Schedule, monkeypatch: pytest.MonkeyPatch) -> pd.DataFrame:
    with monkeypatch.context() as patched:
        patched.setattr(segments, "_FEWEST", np.inf)
        return replay(swum, resolution=FEW)


@pytest.mark.parametrize("changes", [
    {"N": 1.0}, {"N": 2.0}, {"N": 3.0}, {"N": 5.0}, {"N": 3.0, "tail_sag": 0.1, "left_right_bias": 0.3},
    {"N": 4.0, "natural_curvature": 0.3},
])  # fmt: skip
def test_a_track_is_that_of_dwells_in_order(changes: dict[str, float], monkeypatch: pytest.MonkeyPatch) -> None:
    swum, told = schedule(**changes), []
    track = replay(swum, resolution=FEW, progress=told.append)
    plain = in_order(swum, monkeypatch)
    assert track["dwell"].equals(plain["dwell"])
    assert track["time_bar"].equals(plain["time_bar"])
    assert track[POSE].to_numpy() == pytest.approx(plain[POSE].to_numpy(), abs=2e-6)
    assert sum(told) == 40


def test_a_track_does_not_depend_on_the_number_of_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    tracks = []
    for jobs in (1, 3):
        monkeypatch.setattr(threads, "available_jobs", lambda jobs=jobs: jobs)
        tracks.append(replay(schedule(100), resolution=FEW))
    assert tracks[0].equals(tracks[1])


def test_what_agrees_is_kept_and_the_rest_is_simulated_in_order(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    swum = schedule()
    plain = in_order(swum, monkeypatch)
    monkeypatch.setattr(segments, "_MOST_PASSES", 1)
    track = replay(swum, resolution=FEW)
    assert "simulated in order from dwell" in capsys.readouterr().err
    assert track[POSE].to_numpy() == pytest.approx(plain[POSE].to_numpy(), abs=2e-6)


@pytest.mark.parametrize("failing", [0, 17, 39])
def test_the_dwell_that_fails_is_named(failing: int, monkeypatch: pytest.MonkeyPatch) -> None:
    swum = schedule()
    swum.dwells[failing] = 1e-4

    def fail_in_short_steps(swims: Sequence[Marcher]) -> list[Marched]:
        tries = zip(swims, side_by_side(swims), strict=True)
        short = [(np.flatnonzero(swim.steps.lengths < 1e-5), done) for swim, done in tries]
        return [done._replace(done=int(at[0])) if len(at) else done for at, done in short]

    monkeypatch.setattr(segments, "side_by_side", fail_in_short_steps)
    with pytest.raises(InputError, match=f"failed in dwell {failing + 1} of"):
        replay(swum, resolution=FEW)


def test_shapes_are_those_of_dwells_in_order(monkeypatch: pytest.MonkeyPatch) -> None:
    """At the flips, too, where forces are those just after."""
    swum = schedule(32, N=4.0)
    times = np.sort(np.append(np.linspace(0, swum.dwells.sum(), 30), np.cumsum(swum.dwells)[[3, 20]]))
    cut = scheduled_shapes(swum, times)
    monkeypatch.setattr(segments, "_FEWEST", np.inf)
    plain = scheduled_shapes(swum, times)
    for name in ("heads", "nodes", "forces", "on_head", "track"):
        assert getattr(cut, name) == pytest.approx(getattr(plain, name), abs=1e-4), name
    assert cut.angles == pytest.approx(plain.angles, abs=1e-3)
