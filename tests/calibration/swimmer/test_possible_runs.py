"""Runs that a lab can make next: the table's range, or what the lab has."""

from __future__ import annotations

import math
from itertools import product

import numpy as np
import pandas as pd
import pytest

from calibration.swimmer.measured_table import OUTPUTS
from calibration.swimmer.possible_runs import UNITS, owned, possible_settings
from sim.io.errors import InputError
from tests.calibration.toy_tables import START, calibrated, toy_swimmer, toy_table


def test_without_a_word_it_is_what_the_table_has_and_a_lab_gets_only_what_it_has() -> None:
    runs = toy_swimmer(toy_table(3)).runs
    grid = possible_settings(runs, {})
    assert set(grid[:, 0]) == {2, 3, 4, 5}
    assert set(grid[:, 1]) == {5, 8, 11}
    assert np.abs(grid[:, 2]).max() == pytest.approx(np.abs(runs.omega).max() * 30 / math.pi)
    assert len(np.unique(grid, axis=0)) == len(grid) == 4 * 3 * 6
    one_length = toy_swimmer(toy_table(3, lengths_cm=(8.0,))).runs
    assert len(possible_settings(one_length, {})) == 4 * 6
    lab = owned(["N=2,4", "l_cm=5,7", "omega_rpm=60"])
    expected = set(product((2, 4), (5, 7), (60, -60)))
    assert {tuple(row) for row in possible_settings(runs, lab).tolist()} == expected
    lengths = tuple(np.linspace(5.0, 13.0, 17))  # of which six are proposed
    grid = possible_settings(toy_swimmer(toy_table(3, lengths_cm=lengths)).runs, {})
    assert set(grid[:, 1]) <= set(lengths)
    assert len(np.unique(grid[:, 1])) == 6
    assert (grid[:, 1].min(), grid[:, 1].max()) == (5.0, 13.0)


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
    ids=["no value", "half a list", "column", "negative", "nan", "half a tail", "many tails"],
)
def test_what_cannot_be_set_is_refused(entry: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        owned([entry])


def refused(table: pd.DataFrame, words: str) -> None:
    with pytest.raises(InputError, match=words):
        calibrated(table)


@pytest.mark.parametrize("name", UNITS)
def test_an_output_in_another_unit_is_refused_with_that_unit(name: str) -> None:
    column = OUTPUTS[name][0]
    for unit, factor in UNITS[name].items():
        table = toy_table(4)
        if column not in table:
            table[column] = np.abs(table["omega_yr_rad_s"]) * table["R_yr_cm"]
            table[column] *= np.exp(0.02 * np.random.default_rng(0).normal(size=len(table)))
        table[column] *= factor
        if name.startswith("omega_") and name != "omega_yr":  # the other spin would be refused as their sum
            table = table.drop(columns={"omega_h": "omega_t_rpm", "omega_t": "omega_h_rpm"}[name])
        refused(table, f"{column} is .* times what the robot as given does: it seems to be in {unit}")


def test_an_output_ten_times_too_small_and_spins_in_another_unit_are_refused() -> None:
    table = toy_table(4)
    for column in ("omega_yr_rad_s", "R_yr_cm", "theta_deg"):
        small = table.assign(**{column: table[column] / 10})
        refused(small, f"{column} is 0.* times what the robot as given does")
    for factor, meant, stated in ((math.pi / 30, "rad/s", "rpm"), (30 / math.pi, "rpm", "rad/s")):
        table = toy_table(4, lengths_cm=(5.0, 5.5, 6.0))
        for column in ("omega_rpm", "omega_h_rpm", "omega_t_rpm"):
            table[column] *= factor
        refused(table, f"the spins of motor, head and tails are all in {meant} where {stated} is stated")
