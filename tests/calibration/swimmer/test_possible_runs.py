"""Runs that a lab can make next: the table's range, or what the lab has."""

from __future__ import annotations

import math
from itertools import product

import numpy as np
import pytest

from calibration.swimmer.measured_table import OUTPUTS, read_measurements
from calibration.swimmer.possible_runs import UNITS, owned, possible_settings
from sim.io.errors import InputError
from tests.calibration.toy_tables import START, calibrated, toy_swimmer, toy_table


def test_without_a_word_it_is_what_the_table_has() -> None:
    """N = 6 used to be proposed where the table has 2 to 5, and lengths between those of the table."""
    runs = toy_swimmer(toy_table(3)).runs
    grid = possible_settings(runs, {})
    assert set(grid[:, 0]) == {2, 3, 4, 5}
    assert set(grid[:, 1]) == {5, 8, 11}
    assert np.abs(grid[:, 2]).max() == pytest.approx(np.abs(runs.omega).max() * 30 / math.pi)
    assert len(np.unique(grid, axis=0)) == len(grid) == 4 * 3 * 6
    one_length = toy_swimmer(toy_table(3, lengths_cm=(8.0,))).runs
    assert len(possible_settings(one_length, {})) == 4 * 6


def test_of_many_lengths_six_are_proposed() -> None:
    lengths = tuple(np.linspace(5.0, 13.0, 17))
    grid = possible_settings(toy_swimmer(toy_table(3, lengths_cm=lengths)).runs, {})
    assert set(grid[:, 1]) <= set(lengths)
    assert len(np.unique(grid[:, 1])) == 6
    assert (grid[:, 1].min(), grid[:, 1].max()) == (5.0, 13.0)


def test_a_lab_gets_only_what_it_has() -> None:
    lab = owned(["N=2,4", "l_cm=5,7", "omega_rpm=60"])
    runs = toy_swimmer(toy_table(3)).runs
    expected = set(product((2, 4), (5, 7), (60, -60)))
    assert {tuple(row) for row in possible_settings(runs, lab).tolist()} == expected


def test_settings_are_those_of_the_lab_to_the_last_digit() -> None:
    lab = {"l_cm": (5.25, 7.0), "omega_rpm": (57.46,)}
    model, settings = toy_swimmer(toy_table(3), START, lab).possible()
    assert {s["l_cm"] for s in settings} == {5.25, 7.0}
    assert {s["omega_rpm"] for s in settings} == {57.46, -57.46}
    assert model.runs.length == pytest.approx([s["l_cm"] / 100 for s in settings])
    assert model.runs.omega == pytest.approx([s["omega_rpm"] * math.pi / 30 for s in settings])


@pytest.mark.parametrize(
    ("entry", "said"),
    [
        ("l_cm", "write COLUMN=VALUE"),
        ("l_cm=5,", "write COLUMN=VALUE"),
        ("length=5", "none of N, l_cm, omega_rpm"),
        ("l_cm=-5", "must be positive"),
        ("omega_rpm=nan", "must be positive"),
        ("N=2.5", "integer from 1"),
        ("N=1000", "integer from 1"),
    ],
)
def test_what_cannot_be_set_is_refused(entry: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        owned([entry])


OFF_BY = [(name, unit) for name, units in UNITS.items() for unit in units]


@pytest.mark.usefixtures("toy_model")
@pytest.mark.parametrize(("name", "unit"), OFF_BY, ids=[f"{name} in {unit}" for name, unit in OFF_BY])
def test_an_output_in_another_unit_is_refused_with_that_unit(name: str, unit: str) -> None:
    """R_yr in mm, ten times too large, used to be searched for effects; only a factor of 20 was refused."""
    table = toy_table(4)
    column = OUTPUTS[name][0]
    if column not in table:
        table[column] = np.abs(table["omega_yr_rad_s"]) * table["R_yr_cm"]
        table[column] *= np.exp(0.02 * np.random.default_rng(0).normal(size=len(table)))
    table[column] *= UNITS[name][unit]
    if name.startswith("omega_") and name != "omega_yr":  # the other spin alone would be refused as their sum
        table = table.drop(columns={"omega_h": "omega_t_rpm", "omega_t": "omega_h_rpm"}[name])
    words = f"{column} is .* times what the robot as given does: it seems to be in {unit}"
    with pytest.raises(InputError, match=words):
        calibrated(table)


@pytest.mark.usefixtures("toy_model")
@pytest.mark.parametrize("column", ["omega_yr_rad_s", "R_yr_cm", "theta_deg"])
def test_an_output_ten_times_too_small_is_refused(column: str) -> None:
    """R_yr_cm / 10 used to be fitted for minutes, and the corrected robot was advised with an error of 64 %."""
    table = toy_table(4)
    with pytest.raises(InputError, match=f"{column} is 0.* times what the robot as given does"):
        calibrated(table.assign(**{column: table[column] / 10}))


@pytest.mark.usefixtures("toy_model")
@pytest.mark.parametrize(
    ("factor", "meant", "stated"), [(math.pi / 30, "rad/s", "rpm"), (30 / math.pi, "rpm", "rad/s")]
)
def test_all_spins_in_another_unit_are_said(factor: float, meant: str, stated: str) -> None:
    """Their sum is right, so only the yaw rate was blamed."""
    table = toy_table(4, lengths_cm=(5.0, 5.5, 6.0))
    for column in ("omega_rpm", "omega_h_rpm", "omega_t_rpm"):
        table[column] *= factor
    words = f"the spins of motor, head and tails are all in {meant} where {stated} is stated"
    with pytest.raises(InputError, match=words):
        calibrated(table)


@pytest.mark.parametrize(
    ("given", "meant", "factor"),
    [
        ("R_yr_mm", "R_yr_cm", 10.0),
        ("omega_yr_deg_s", "omega_yr_rad_s", 180 / math.pi),
        ("l_m", "l_cm", 0.01),
        ("omega_Hz", "omega_rpm", 1 / 60),
        ("theta [rad]", "theta_deg", math.pi / 180),
        ("rpm", "omega_rpm", 1.0),
        ("Tail_length_cm", "l_cm", 1.0),
    ],
)
def test_a_column_in_another_unit_is_converted(given: str, meant: str, factor: float) -> None:
    """The advice used to be to rename it, which made its numbers wrong without a word."""
    expected = toy_table(4)
    other = expected.rename(columns={meant: given}).assign(**{given: factor * expected[meant]})
    runs, same = read_measurements(other), read_measurements(expected)
    assert runs.y == pytest.approx(same.y, rel=1e-12)
    assert runs.inputs == pytest.approx(same.inputs, rel=1e-12)
    assert [note.split(" read as")[0].split(" converted")[0] for note in runs.converted] == [f"column {given}"]
    with pytest.raises(InputError, match="are the same quantity; drop all but one"):
        read_measurements(other.assign(**{meant: 1.0}))


def test_the_course_was_called_heading() -> None:
    """The heading is the direction of the axis in tracks, and was that of the path in runs."""
    table = toy_table(4).assign(heading_deg=np.linspace(0, 350, len(toy_table(4))))
    runs = read_measurements(table)
    assert runs.noted_names == ("course_x", "course_y")
    assert runs.converted == ("column heading_deg read as course_deg",)
