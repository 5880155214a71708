"""The pipe: the same orders as from Python, in seconds; lines that cannot be read do no harm."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from planner.paths.path import circle
from planner.planning.plan import plan
from planner.tracking.pipe import answers
from planner.tracking.tracker import Tracker
from sim.model.presets import PRESETS


def test_it_answers_like_the_tracker_in_seconds() -> None:
    result = plan(circle(2.0), PRESETS["paper-control"])
    scale = result.robot.time_scale
    piped, direct = Tracker(result), Tracker(result)
    lines = [
        "0",
        f"1.0 {result.start[0]} {result.start[1]} {result.start[2]}",
        "nonsense",
        "",
        "2.5 nan 0 0",
        "3 1",
    ]
    answered = [line.split() for line in answers(piped, lines, scale)]
    expected = [direct.update(0.0), direct.update(1.0 / scale, result.start)]
    expected += [
        direct.update(direct._now),
        direct.update(direct._now),
        direct.update(2.5 / scale),
        direct.update(3 / scale),
    ]
    assert len(answered) == len(lines)
    for words, command in zip(answered, expected, strict=True):
        assert int(words[0]) == command.direction
        assert float(words[1]) == pytest.approx(command.flip_at * scale, abs=1e-5)


def test_a_line_with_the_announced_time_is_the_flip() -> None:
    """Times that were printed rounded down were taken for the moment before the flip."""
    result = plan(circle(2.0), PRESETS["paper-control"])
    directions, line = [], "0"

    def lines() -> Iterator[str]:
        for _ in range(60):
            yield line

    for answer in answers(Tracker(result), lines(), result.robot.time_scale):
        direction, line = answer.split()[:2]
        directions.append(int(direction))
    assert directions == [result.first_direction * (-1) ** k for k in range(60)]
