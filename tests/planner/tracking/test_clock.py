"""The tracker's clock: a jump is not believed before it is confirmed, and the flips go on."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest

from planner.paths.path import circle
from planner.planning.plan import plan
from planner.tracking.clock import CONFIRMED, EARLY, LATE, Clock
from planner.tracking.tracker import Tracker
from sim.model.presets import PRESETS


def test_a_jump_is_refused_until_it_is_confirmed() -> None:
    clock = Clock(0.0)
    assert clock.tell(1.0, 2.0) == 0.0
    for _ in range(5):
        assert clock.tell(300.0, 2.0) == 0.0  # the same message again confirms nothing
        assert clock.now == 1.0
    assert [clock.tell(301.0 + k, 2.0) for k in range(CONFIRMED - 1)] == [0.0, 299.0]
    assert clock.now == 302.0


@pytest.mark.parametrize("now", [math.nan, math.inf, -50.0, 2.1 + LATE])
def test_times_that_cannot_be_are_taken_for_the_last_one(now: float) -> None:
    clock = Clock(1.0)
    assert clock.tell(now, 2.0) == 0.0
    assert clock.now == 1.0


def test_late_messages_are_taken_for_the_last_time() -> None:
    """They overtook each other on the way; however many there are, they do not set the clock back."""
    clock = Clock(5.0)
    for k in range(2 * CONFIRMED):
        assert clock.tell(5.0 - EARLY + 0.1 * k, 6.0) == 0.0
        assert (clock.now, clock.believed) == (5.0, True)
    clock.tell(4.9 - EARLY, 6.0)
    assert not clock.believed


@pytest.mark.parametrize("jump", [140.0, -140.0], ids=["forward", "back"])
@pytest.mark.parametrize("lasts", [1, 1000], ids=["one message", "for good"])
def test_the_flips_go_on(jump: float, lasts: int) -> None:
    """One time that was 300 s ahead stopped the flips for 300 s."""
    tracker = Tracker(plan(circle(2.0), PRESETS["paper-control"]))
    flips, direction = [], tracker.command.direction
    for k in range(200):
        now, jumped = 0.25 * k, 40 <= k < 40 + lasts
        command = tracker.update(now + (jump if jumped else 0.0))
        if command.direction != direction:
            flips.append(now)
            direction = command.direction
    gaps = [late - early for early, late in pairwise(flips)]
    assert len(gaps) > 40
    assert max(gaps) < 3.0
    assert min(gaps) > 0.5
