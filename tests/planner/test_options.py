"""Options of the planning functions: words of commands and numbers ask for the same."""

from __future__ import annotations

import math

import numpy as np
import pytest

from common.errors import InputError
from planner.options import places_of, pose_of, request_of, seconds_of
from planner.paths.obstacles import Circle
from planner.planning.request import Camera
from tests.planner.plans import CONTROL

CM = 100 * CONTROL.tail_length  # in a tail length


def test_words_ask_for_what_numbers_ask_for() -> None:
    words = {"keep_out": ["circle:1l,0,4"], "walls": "box:-3l,-2l,3l,2l", "tolerance": "5mm", "unit": "cm",
             "camera": ("0.02l", "0.03", "1", "2", "0.1"), "feedback": True}  # fmt: skip
    numbers = {"keep_out": [Circle(1, 0, 4 / CM)], "walls": [[-3, -2], [3, -2], [3, 2], [-3, 2]],
               "tolerance": 0.5 / CM, "camera": Camera((0.02, 0.03), 1.0, 2.0, 0.1), "feedback": True}  # fmt: skip
    first, second = request_of(words, CONTROL, loop=True), request_of(numbers, CONTROL, loop=True)
    assert first.tolerance == pytest.approx(second.tolerance)
    assert (first.camera, first.feedback, first.loop) == (second.camera, True, True)
    probes = np.random.default_rng(0).uniform(-4, 4, (50, 2))
    np.testing.assert_allclose(first.space.distance(probes), second.space.distance(probes), atol=1e-12)
    assert request_of({}, CONTROL).space.empty


def test_poses_places_and_times() -> None:
    assert pose_of(("1l", f"{CM}cm", "90"), None, CONTROL, "--goal") == pytest.approx((1, 1, math.pi / 2))
    assert pose_of((1, 2, 3), "cm", CONTROL, "--goal") == (1, 2, 3)
    assert places_of(["1l,0", f"0,{CM}"], "cm", CONTROL) == [pytest.approx([1, 0]), pytest.approx([0, 1])]
    assert places_of([(1, 2), (3, 4)], "cm", CONTROL) == [(1, 2), (3, 4)]
    assert places_of(["1l,0", (3, 4)], None, CONTROL) == [(1, 0), (3, 4)]
    for bad in ([(0, 0, 0)], [(0, float("nan"))], [(0, "east")], [3.0]):
        with pytest.raises(InputError, match="place"):
            places_of(bad, "cm", CONTROL)  # type: ignore[arg-type]
    assert seconds_of("1h20min", "--for") == seconds_of(4800.0, "--for") == 4800
    assert seconds_of(None, "--for") is None
