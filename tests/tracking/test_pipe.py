"""The pipe: the same orders as from Python, in seconds; lines that cannot be read do no harm."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

import pytest

from common.errors import InputError
from sim.model.presets import PRESETS
from tests.planner.plans import planned
from tracking.pipe import answers
from tracking.tracker import Tracker

ROBOT = PRESETS["paper-control"]
SCALE, POSE = ROBOT.time_scale, (0.3, -2.5, 1.0)


def begin(pose: tuple[float, float, float], now: float) -> Tracker:
    return Tracker(planned(), begin=now, start=pose)


def words_of(tracker: Tracker | None, lines: Iterable[str]) -> list[list[str]]:
    return [line.split() for line in answers(tracker, lines, ROBOT, begin)]


def test_it_answers_like_the_tracker_in_seconds() -> None:
    start = planned().start
    piped, direct = Tracker(planned()), Tracker(planned())
    lines = ["0", f"1.0 {start[0]} {start[1]} {start[2]}", "nonsense", "", "2.5 nan 0 0", "3 1"]
    expected = [direct.update(0.0), direct.update(1.0 / SCALE, start), direct.update(direct._now)]
    expected += [direct.update(time) for time in (direct._now, 2.5 / SCALE, 3 / SCALE)]
    for words, command in zip(words_of(piped, lines), expected, strict=True):
        assert int(words[0]) == command.direction
        assert float(words[1]) == pytest.approx(command.flip_at * SCALE, abs=1e-5)


def test_a_line_with_the_announced_time_is_the_flip() -> None:
    """A time that is printed rounded down is not taken for the moment before the flip."""
    directions, line = [], "0"

    def lines() -> Iterator[str]:
        for _ in range(60):
            yield line

    for answer in answers(Tracker(planned()), lines(), ROBOT):
        direction, line = answer.split()[:2]
        directions.append(int(direction))
    assert directions == [planned().first_direction * (-1) ** k for k in range(60)]


def test_the_first_pose_or_a_line_decides_where_the_robot_begins() -> None:
    waiting = words_of(None, ["0", "nonsense", "4 nan 0 0", "5 0.3 -2.5 1.0", "7"])
    assert [words[0] for words in waiting[:3]] == ["0", "0", "0"]
    assert [float(words[1]) for words in waiting[:3]] == [1.0, 1.0, 5.0]
    direct = begin(POSE, 5 / SCALE)
    commands = [direct.command, direct.update(7 / SCALE)]
    expected = [[f"{command.direction}", f"{command.flip_at * SCALE:.9f}"] for command in commands]
    assert [words[:2] for words in waiting[3:]] == expected
    lines = ["0", "begin 1 2", "begin", "begin 1.5 inf 0 0", "begin 2.5 0.3 -2.5 1.0"]
    told = words_of(Tracker(planned()), lines)
    assert all(words == told[0] for words in told[1:3])
    command = begin(POSE, 2.5 / SCALE).command
    assert told[4][:2] == [f"{command.direction}", f"{command.flip_at * SCALE:.9f}"]


def test_a_pose_that_is_too_far_away_counts_as_none() -> None:
    lines = ["0", "1 1e200 0 0", "2 0 -1e200 0", "begin 2 1e200 0 0"]
    assert words_of(Tracker(planned()), lines) == words_of(Tracker(planned()), ["0", "1", "2", "2"])
    far = [f"{k} {sign}1e308 0 {sign}1e308" for k in range(4, 40) for sign in ("", "-")]
    told = words_of(Tracker(planned()), far)
    assert len(told) == len(far)
    assert {words[3] for words in told} == {"0"}
    assert words_of(None, ["0 1e200 0 0"])[0][0] == "0"


def test_a_header_says_the_units_of_the_laboratory() -> None:
    """The same orders as in tail lengths; the error is in the unit of x, and columns may change places."""
    x, y, heading = planned().start
    cm, degrees = 100 * ROBOT.tail_length, math.degrees(heading)
    plain = ["0", f"1 {x:.9f} {y:.9f} {heading:.9f} 0.5", f"2.1 {x:.9f} {y:.9f} {heading:.9f}", "3"]
    given = [
        "time_s,y_mm,x_cm,heading_deg,seen_s",
        "0",
        f"1, {10 * cm * y:.9f}, {cm * x:.9f}, {degrees:.9f}, 0.5",
        f"2.1 {10 * cm * y:.9f} {cm * x:.9f} {degrees:.9f}",
        "3",
    ]
    header, *told = answers(Tracker(planned()), given, ROBOT)
    assert header == "direction flip_at_s error_cm alarm"
    for answer, expected in zip(told, answers(Tracker(planned()), plain, ROBOT), strict=True):
        direction, flip, error, alarm = (float(word) for word in answer.split())
        wanted = [float(word) for word in expected.split()]
        assert [direction, flip, alarm] == pytest.approx([wanted[0], wanted[1], wanted[3]], abs=1e-5)
        assert error == pytest.approx(cm * wanted[2], abs=1e-4 * cm)


@pytest.mark.parametrize(
    ("header", "message"),
    [
        ("time_s x_cm y_cm", "give time first, and x, y and heading"),
        ("time_s x_deg y_cm heading_deg", "'x_deg' needs a unit of length, such as x_cm"),
        ("time_s x_cm y_cm angle_deg", "'angle_deg' is not one of time, x, y, heading, seen"),
        ("time_s x_cm x_mm heading_deg", "'x_mm' is there twice"),
        ("\ufefftime_s,x_cm,y_cm,heading_deg", "'\\\\ufefftime_s' is not one of"),
        ('"time_s","x_cm","y_cm","heading_deg"', "is not one of"),
        ("time_s;x_cm;y_cm;heading_deg", "is not one of"),
        ("x_cm,y_cm,heading_deg,time_s", "give time first"),
        ("# time_s,x_cm,y_cm,heading_deg", "'#' is not one of"),
        ("0.9;22.2;3.2;70", "give numbers, or a header such as time_s x_cm y_cm heading_deg"),
        ("0,9 22,2 3,2 70", "give numbers, or a header"),
        ("0 22.2 3.2", "give numbers, or a header"),
        ("", "give time first"),
    ],
)
def test_a_first_line_that_is_neither_numbers_nor_a_header_is_refused(header: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        list(answers(Tracker(planned()), [header, "0.9,22.2,3.2,70"], ROBOT))
