"""Sizes that make no sense are refused, with the unit that was probably meant."""

from __future__ import annotations

import math

import numpy as np
import pytest

from planner.paths.path import Path2D
from planner.paths.units import (
    check_size,
    heading_in_degrees,
    in_lab,
    place_in_lab,
    read_time,
)
from planner.planning.plan import plan
from sim.io.errors import InputError
from sim.model.presets import PRESETS

CONTROL = PRESETS["paper-control"]


def test_lengths_in_messages_are_in_a_laboratory_s_units_first() -> None:
    assert in_lab(0.32, CONTROL) == "3.52 cm (0.32 l)"
    assert place_in_lab(1.0, -0.5, CONTROL) == "(11.00, -5.50) cm = (1.000, -0.500) l"
    assert place_in_lab(-1e-9, 0.0, CONTROL) == "(0.00, 0.00) cm = (0.000, 0.000) l"
    assert in_lab(1200.0, CONTROL) == "132 m (1200 l)"


@pytest.mark.parametrize(
    ("degrees", "words"),
    [(-181.8, "178.2"), (180.0, "180.0"), (-180.0, "180.0"), (-179.97, "180.0"), (181.8, "-178.2"), (0.0, "0.0"),
     (-0.01, "0.0"), (359.99, "0.0"), (725.0, "5.0"), (-90.0, "-90.0")],
)  # fmt: skip
def test_headings_are_above_minus_180_and_up_to_180_degrees(degrees: float, words: str) -> None:
    assert heading_in_degrees(math.radians(degrees)) == f"{words} degrees"


def test_a_start_heading_is_at_most_half_a_turn() -> None:
    """A path that begins to the left used to start at −181.2 degrees."""
    headings = []
    for angle in range(-180, 180, 20):
        x, y = 4 * math.cos(math.radians(angle)), 4 * math.sin(math.radians(angle))
        text = repr(plan([[0, 0], [x, y]], CONTROL, objective="flips"))
        headings.append(float(text.partition(", heading ")[2].partition(" degrees")[0]))
    assert all(-180 < heading <= 180 for heading in headings)
    assert np.ptp(headings) > 300


def test_long_paths_pass_if_they_are_not_absurd() -> None:
    check_size(Path2D.of([[0, 0], [10_000, 0]]), CONTROL, 0.9)
    with pytest.raises(InputError, match="at most 12000 l can be planned"):
        check_size(Path2D.of([[0, 0], [13_000, 0]]), CONTROL, 0.9)


@pytest.mark.parametrize(
    ("words", "seconds"),
    [("12min", 720.0), ("90s", 90.0), ("1h20min", 4800.0), ("1.5 h", 5400.0), ("2min 5s", 125.0)],
)
def test_times_have_their_units(words: str, seconds: float) -> None:
    assert read_time(words, "--arrive") == pytest.approx(seconds)


@pytest.mark.parametrize("words", ["12", "", "min", "-3min", "0s", "1..2s", "12minutes", "nan s", "3m", "5 min x"])
def test_other_times_are_refused(words: str) -> None:
    with pytest.raises(InputError, match="with its unit"):
        read_time(words, "--arrive")
