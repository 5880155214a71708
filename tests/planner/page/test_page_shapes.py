"""Shapes that the page has besides those in words."""

from __future__ import annotations

import numpy as np
import pytest

from planner.paths.shapes import shape_of
from sim.io.errors import InputError
from tests.planner.page.page_core import answer, answers, check_near


def test_words_and_names_give_the_same_shapes_as_the_command() -> None:
    for name, size in (("circle", 20.5), ("square", 3.0), ("triangle", 7.0), ("polygon:6", 2.0)):
        wanted = shape_of(f"{name}:{size}cm")
        assert wanted is not None
        check_near(answer("page_shapes.js", "pageShape", name, size)["points"], wanted[0].points)


def test_an_eight_and_a_wave_have_their_size() -> None:
    eight, wave = answers([("page_shapes.js", "pageShape", name, 40) for name in ("eight", "wave")])
    assert (eight["closed"], wave["closed"]) == (True, False)
    assert np.ptp(np.array(eight["points"])[:, 0]) == pytest.approx(40, rel=1e-3)
    assert np.ptp(np.array(wave["points"])[:, 0]) == pytest.approx(40)


def test_a_size_that_cannot_be_is_refused() -> None:
    for size in (0, -3, None):
        assert isinstance(answer("page_shapes.js", "pageShape", "eight", size), InputError)
