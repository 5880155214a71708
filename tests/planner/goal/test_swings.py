"""Swings and waiting circles gain their length, turn no tighter than allowed, and leave no jump."""

from __future__ import annotations

import numpy as np
import pytest

from planner.goal.swings import NoRoomError, swung
from planner.paths.path import Path2D, circle
from planner.paths.tractrix import STILL, Drift, reference
from sim.arrays import Floats

ROD, RADIUS = 0.87, 0.45


@pytest.mark.parametrize("path", [Path2D.of([[0, 0], [6, 0]]), circle(2.0)], ids=["line", "circle"])
@pytest.mark.parametrize("drift", [STILL, Drift(0.1, (0.1, 0.05))], ids=["still", "drift"])
@pytest.mark.parametrize("longer", [0.01, 0.3, 1.0, 1.5, 2.5, 3.0, 5.0, 9.0])
def test_a_swing_gains_its_length(path: Path2D, drift: Drift, longer: float) -> None:
    plain = reference(path, ROD, 0.02, drift)
    swinging, swing = swung(plain, longer, RADIUS, ROD, drift)
    assert swinging.arc[-1] - plain.arc[-1] == pytest.approx(longer, abs=0.003)
    assert swing.circles == int(longer // (2 * np.pi * RADIUS))
    assert np.hypot(*np.diff(swinging.q, axis=0).T).max() < 0.06
    assert np.abs(np.diff(swinging.heading)).max() < 0.2
    assert swinging.q[-1] == pytest.approx(plain.q[-1])
    turns = (swinging.heading[-1] - plain.heading[-1]) / (2 * np.pi)
    assert turns == pytest.approx(round(turns), abs=1e-3)
    ahead = swinging.p - swinging.q - ROD * np.stack([np.cos(swinging.heading), np.sin(swinging.heading)], 1)
    assert np.abs(ahead).max() < 1e-9


def test_arcs_are_not_tighter_than_allowed() -> None:
    plain = reference(Path2D.of([[0, 0], [6, 0]]), ROD, 0.02)
    for longer in (0.5, 1.5, 2.5, 4.0):
        curvature = np.abs(swung(plain, longer, RADIUS, ROD, STILL)[0].curvature)
        assert curvature.max() < 1.05 / RADIUS


def test_a_swing_is_where_the_body_is_free() -> None:
    plain = reference(Path2D.of([[0, 0], [9, 0]]), ROD, 0.02)

    def free(poses: Floats) -> bool:
        return bool((poses[:, 0] < 4.0).all())

    for longer in (0.5, 4.0):
        assert swung(plain, longer, RADIUS, ROD, STILL)[1].x > 4.0
        assert swung(plain, longer, RADIUS, ROD, STILL, free)[1].x < 5.0
        with pytest.raises(NoRoomError, match="no room"):
            swung(plain, longer, RADIUS, ROD, STILL, lambda poses: False)


def test_a_short_track_has_room_for_circles_only() -> None:
    plain = reference(Path2D.of([[0, 0], [0.5, 0]]), ROD, 0.02)
    with pytest.raises(NoRoomError):
        swung(plain, 1.0, RADIUS, ROD, STILL)
    assert swung(plain, 4.0, RADIUS, ROD, STILL)[1].circles == 1
