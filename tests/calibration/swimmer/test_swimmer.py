"""The swimmer as a model: derivatives, observation, what it refuses; and runs that a lab can make next."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from itertools import product

import numpy as np
import pandas as pd
import pytest

from calibration.statistics.forward import by_differences, derivatives
from calibration.statistics.lab_settings import read_lab_settings
from calibration.statistics.statistical_model import start_values
from calibration.swimmer.influences import influences
from calibration.swimmer.measured_table import read_measurements
from calibration.swimmer.possible_runs import check_lab_settings, possible_settings
from calibration.swimmer.swimmer import SwimmerModel
from calibration.swimmer.synthetic_table import make_table
from calibration.verdict.calibrate import calibrate
from common.errors import InputError
from common.run_columns import MEASURED, OTHER_UNITS
from sim.model.presets import PRESETS
from surrogate.table_file import load
from tests.calibration import toy
from tests.calibration.toy_tables import START, TRUTH, calibrated, toy_swimmer, toy_table

FRICTION, SPEED = "contact_line", "contact_line_speed"  # of the contact line


@pytest.fixture
def table() -> pd.DataFrame:
    """A table with everything that can be noted and measured; values by the toy."""
    measured = toy_table(3, truth=START, lengths_cm=(6.0, 9.0), design={"tails": (2, 3, 5)})
    rng = np.random.default_rng(0)
    measured["v_cm_s"] = 2.0 * np.exp(rng.normal(scale=0.03, size=len(measured)))
    measured["elapsed_min"] = 3.0 * np.arange(len(measured))
    measured["temperature_C"] = 20 + rng.normal(size=len(measured))
    measured["tank_diameter_cm"] = rng.choice([40.0, 60.0], len(measured))
    measured["course_deg"] = rng.uniform(0, 360, len(measured))
    return measured


@pytest.mark.slow
def test_derivatives_are_those_of_the_prediction(table: pd.DataFrame) -> None:
    """The simulator's sensitivities, through drivers and camera, against differences of predictions."""
    rows = table.iloc[::6]
    rows = pd.concat([rows] * 3, ignore_index=True)  # enough repeats to be read
    noise = np.random.default_rng(1).normal(scale=0.01, size=(len(rows), 6))
    columns = ["omega_h_rpm", "omega_t_rpm", "omega_yr_rad_s", "R_yr_cm", "theta_deg", "v_cm_s"]
    rows[columns] *= np.exp(noise)
    model = SwimmerModel(START, read_measurements(rows))
    assert model.untestable == {}
    names = [p.name for p in (*model.coefficients, *model.effects)]
    at = {**start_values(model), "motor_slip": 0.03, "tracked_point": 0.2, "current_along_x": 0.002}
    ours, J = derivatives(model, at, names)
    theirs, differences = by_differences(model, at, names)
    assert ours == pytest.approx(theirs, abs=5e-4)  # more phases than the prediction needs
    scale = np.abs(differences).max((0, 1))
    assert [name for name, s in zip(names, scale, strict=True) if s < 1e-6] == ["tail_contact"]  # no tails touch
    off = np.abs(J - differences).max((0, 1)) / np.maximum(scale, 1e-6)
    # Differences are those of predictions on few phases, where an effect near its null may not show in full.
    tolerance = {name: 0.2 if name == "rate_dependent_modulus" else 0.06 for name in names}
    assert {name: o for name, o in zip(names, off.tolist(), strict=True) if o > tolerance[name]} == {}
    alone, beside = (derivatives(model, at, [*others, "tracked_point"])[1] for others in ([], ["C_t"]))
    assert alone[..., -1] == pytest.approx(beside[..., -1], abs=1e-9)  # nothing of it moves the robot


def test_an_odd_effect_of_the_robot_itself_tells_left_from_right(table: pd.DataFrame) -> None:
    """Even where the runs are in one direction, so that it cannot be fitted."""
    left_runs = read_measurements(table[table["omega_rpm"] < 0].drop(columns=["elapsed_min", "temperature_C"]))
    plain, biased = (
        SwimmerModel(replace(START, effects=effects), left_runs, solver=toy.SOLVER)
        for effects in ({}, {"left_right_bias": 0.3})
    )
    assert "left_right_bias" not in {e.name for e in biased.effects}
    left_turns = [m.predict([start_values(m)])[0] for m in (plain, biased)]
    mirrored = read_measurements(
        table[table["omega_rpm"] < 0].assign(
            **{c: lambda t, c=c: -t[c] for c in ("omega_rpm", "omega_h_rpm", "omega_t_rpm", "omega_yr_rad_s")}
        )
    )
    right = SwimmerModel(biased.robot, mirrored, solver=toy.SOLVER)
    right_turns = right.predict([start_values(right)])[0]
    yaw = left_runs.outputs.index("omega_yr")
    assert np.abs(left_turns[1] - left_turns[0])[:, yaw].min() > 1e-4
    assert np.abs(left_turns[1] - right_turns)[:, yaw].min() > 1e-4


def test_a_current_shows_in_the_speed_along_its_heading_and_in_the_radius(table: pd.DataFrame) -> None:
    model = toy_swimmer(table)
    at = start_values(model)
    still, moving = model.predict([at, {**at, "current_along_x": 0.001}])
    speed, radius = (model.runs.outputs.index(name) for name in ("v", "R_yr"))
    gained = np.exp(moving[:, speed]) - np.exp(still[:, speed])
    course, own = np.radians(table["course_deg"]), np.exp(still[:, speed])
    across = -0.001 * np.sin(course) / own
    assert gained == pytest.approx(0.001 * np.cos(course) + own * (np.sqrt(1 - across**2) - 1))
    slip, side = model.runs.outputs.index("theta"), np.sign(table["omega_rpm"])
    assert (moving - still)[:, slip] == pytest.approx(side * np.arcsin(across))
    assert (moving - still)[:, radius] == pytest.approx((moving - still)[:, speed])  # R = v/|ω_yr|, as seen
    assert np.delete(moving - still, [speed, radius, slip], 1) == pytest.approx(0)
    names = ("current_along_x", "camera_scale", "C_t", "tail_length_offset", "viscosity")
    at = {**at, "current_along_x": 0.001}
    exact, difference = (f(at, names)[1] for f in (partial(derivatives, model), partial(by_differences, model)))
    assert exact == pytest.approx(difference, rel=0.02, abs=0.02 * np.abs(difference).max())
    without = toy_swimmer(table.drop(columns="course_deg"))
    assert "current in the tank along x" in without.untestable
    assert "current in the tank along x" not in toy_swimmer(table.drop(columns=["v_cm_s", "R_yr_cm"])).untestable
    spins = toy_swimmer(table.drop(columns=["v_cm_s", "R_yr_cm", "theta_deg"]))
    assert spins.untestable["current in the tank along x"] == "needs v_cm_s, R_yr_cm or theta_deg"


@pytest.mark.parametrize(
    ("column", "factor", "expected"),
    [
        ("l_cm", 10.0, "l_cm = 90 is 56"),
        ("l_cm", 0.01, "head radii"),
        ("omega_rpm", 1000.0, "ω̄"),
        ("omega_rpm", np.pi / 30, "add up to 9"),
    ],
    ids=["l in mm", "l in m", "krpm", "rad/s"],
)
def test_wrong_units_are_refused(table: pd.DataFrame, column: str, factor: float, expected: str) -> None:
    rows = table.assign(**{column: table[column] * factor}).drop(columns="v_cm_s")
    with pytest.raises(InputError, match=expected):
        calibrate(toy_swimmer(rows), progress=False)
    model = toy_swimmer(table.drop(columns="v_cm_s"))  # right units are taken
    model.check(model.predict([start_values(model)])[0])


def test_the_first_guess_is_found_from_any_start(table: pd.DataFrame) -> None:
    """Runs made with the look-up table itself, coefficients far from those as given."""
    truth = replace(START, C_t=3.4, C_r=1.5, C_yr=4.5)
    data = read_measurements(table.drop(columns="v_cm_s"))
    rng = np.random.default_rng(4)
    exact = SwimmerModel(truth, data).predict([start_values(SwimmerModel(truth, data))], lookup=load())[0]
    runs = replace(data, y=exact + rng.normal(scale=0.003, size=exact.shape))
    for start in (START, replace(START, C_t=1.2, C_r=3.0, C_yr=2.0), replace(START, C_t=5.0, C_r=1.2, C_yr=6.0)):
        model = SwimmerModel(start, runs)
        guess = model.guess(start_values(model), np.ones(len(runs), bool))
        assert [guess[n] for n in ("C_t", "C_r", "C_yr")] == pytest.approx([3.4, 1.5, 4.5], rel=0.05)


def test_derivatives_along_the_friction_of_the_contact_line_and_its_speed() -> None:
    second = influences()[FRICTION].parameter.second
    assert second.name == SPEED
    table = make_table(TRUTH, seed=2, tails=(2, 3), lengths_cm=(6.0, 9.0), title="")
    model = SwimmerModel(START, read_measurements(table))
    at = {**start_values(model), FRICTION: 0.3, SPEED: 6.0}
    ours, J = derivatives(model, at, [FRICTION, SPEED])
    theirs, differences = by_differences(model, at, [FRICTION, SPEED])
    assert ours == pytest.approx(theirs, abs=1e-3)
    scale = np.abs(differences).max((0, 1))
    assert (scale > 1e-4).all()
    assert (np.abs(J - differences).max((0, 1)) < 0.05 * scale).all()


def test_a_motion_that_does_not_settle_is_refused_and_named() -> None:
    thins = replace(PRESETS["paper-control"], effects={"shear_thinning": 0.8})
    with pytest.raises(InputError, match=r"1 of 1 motions .* example N = 2, l = 11 cm"):
        make_table(thins, seed=0, tails=(2,), lengths_cm=(11.0,), motor_rpm=(100.0,), trials=1, title="")


def test_without_a_word_it_is_what_the_table_has_and_a_lab_gets_only_what_it_has() -> None:
    runs = toy_swimmer(toy_table(3)).runs
    grid = possible_settings(runs, {})
    assert set(grid[:, 0]) == {2, 3, 4, 5}
    assert set(grid[:, 1]) == {5, 8, 11}
    assert np.abs(grid[:, 2]).max() == pytest.approx(np.abs(runs.omega).max() * 30 / math.pi)
    assert len(np.unique(grid, axis=0)) == len(grid) == 4 * 3 * 6
    one_length = toy_swimmer(toy_table(3, lengths_cm=(8.0,))).runs
    assert len(possible_settings(one_length, {})) == 4 * 6
    lab = read_lab_settings(["N=2,4", "l_cm=5,7", "omega_rpm=60"])
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


def test_a_range_is_some_values_of_it() -> None:
    lab = read_lab_settings(["l_cm=5..160,7", "x=-1..1"])
    assert lab["l_cm"] == (5.0, 10.0, 20.0, 40.0, 80.0, 160.0, 7.0)
    assert lab["x"] == (-1.0, -0.6, -0.2, 0.2, 0.6, 1.0)


@pytest.mark.parametrize(
    ("entry", "said"),
    [
        ("l_cm", "write COLUMN=VALUE"),
        ("l_cm=5..", "write COLUMN=VALUE"),
        ("l_cm=5,", "write COLUMN=VALUE"),
        ("length=5", "none of N, l_cm, omega_rpm"),
        ("l_cm=-5", "must be positive"),
        ("omega_rpm=nan", "must be positive"),
        ("N=2.5", "integer from 1"),
        ("N=1000", "integer from 1"),
    ],
    ids=["no value", "half a range", "half a list", "column", "negative", "nan", "half a tail", "many tails"],
)
def test_what_cannot_be_set_is_refused(entry: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        check_lab_settings(read_lab_settings([entry]))


def refused(table: pd.DataFrame, words: str) -> None:
    with pytest.raises(InputError, match=words):
        calibrated(table)


@pytest.mark.parametrize("name", OTHER_UNITS)
def test_an_output_in_another_unit_is_refused_with_that_unit(name: str) -> None:
    column = MEASURED[name].column
    for factor, unit in OTHER_UNITS[name].items():
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
