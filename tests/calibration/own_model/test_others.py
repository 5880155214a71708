"""What is named in the measurements of others: docs/explanation/found.md."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import softflagella as sf
from calibration.own_model.model_file import load_model
from tests.oracles.others import MODELS, SETS, calibrated, named
from tests.shared import shared

MEASURED = Path(__file__).parents[4] / "shared/measured"
SHIP, CAN = MEASURED / "real/ship_captive.csv", MEASURED / "traces/filmcan.csv"
BESIDE = {"ship": SHIP.parent, "filmcan": CAN.parent}
SOURCE = re.compile(r"github\.com/[\w.-]+/\s?[\w.-]+")  # of a table, in the docstring of its model
CAPILLARY = 0.1946  # Pa s, of the oil of 2019


@shared
def record(name: str) -> dict[str, Any]:
    return calibrated(name, BESIDE.get(name, "")).facts


def falls(name: str) -> tuple[float, float]:
    """Return by which factor the error falls, on sessions and on conditions."""
    found = record(name)
    conditions = found["errors_of_conditions"]
    return found["error_before"] / found["error_after"], conditions["before"] / conditions["after"]


def interval(name: str, number: str) -> tuple[float, float]:
    low, high = record(name)["parameters"][number]["interval"]
    return low, high


@pytest.mark.parametrize("name", ["tube-2017", "tube-2019"])
def test_the_wall_of_the_tube_is_named_at_the_size_of_theory(name: str) -> None:
    assert named(record(name)).startswith("wall of the tube at the size of theory")
    assert "watch" not in named(record(name))
    assert min(falls(name)) > 1.5
    assert record(name)["gain_interval"][0] > 0


def test_a_time_that_does_not_fit_its_repeats_is_left_out() -> None:
    """9.98 s among 8.80 to 9.01 s."""
    (outlier,) = calibrated("tube-2017").split.outliers
    assert str(outlier).startswith("row 3 (line 4)")


def test_the_viscosity_of_the_capillary_is_in_the_envelope() -> None:
    low, high = interval("tube-2019", "viscosity")
    assert low < CAPILLARY < high < 1.5 * low
    given = record("tube-2019")["parameters_without_effects"]["viscosity"]["interval"]
    assert not given[0] < CAPILLARY < given[1]
    assert min(falls("tube-2019")) > 2


def test_thrust_goes_as_the_square_of_the_speed() -> None:
    assert named(record("propellers")).startswith("square of the speed at the size of theory")
    assert not {"zero", "tips"} & set(record("propellers")["parameters"])
    sessions, conditions = falls("propellers")
    assert sessions > 1.5  # the propeller that is held out has another coefficient
    assert conditions > 4


def test_a_dead_zone_then_a_resistance_are_named_in_the_speed_of_a_motor() -> None:
    assert named(record("motor")) == "dead zone of the throttle, then resistance"
    assert min(falls("motor")) > 5
    low, high = interval("motor", "resistance")
    assert 0 < low < high < 0.3


def test_the_zero_of_an_ammeter_is_named_and_its_gain_is_not_certain() -> None:
    assert named(record("coil")).startswith("zero of the coarse ammeter")
    assert record("coil")["gain_is_certain"] is False


@pytest.mark.skipif(not SHIP.exists(), reason="the table of the ship has no licence and is not here")
def test_the_cross_flow_of_a_ship_is_named_and_an_angle_is_not() -> None:
    assert "cross-flow drag" in named(record("ship"))
    assert "angle" not in named(record("ship"))
    assert min(falls("ship")) > 2


def test_the_drag_of_a_sphere_has_its_coefficient() -> None:
    assert record("tower")["effects"] == ["quadratic_drag"]
    low, high = interval("tower", "quadratic_drag")
    assert 0.3 < low < 0.5 < high < 0.75
    assert falls("tower")[1] > 2


def test_the_drag_of_a_telephone_is_turbulent_at_the_size_of_theory() -> None:
    """What imitates it on the falls that are fitted, a drift or a lag of the accelerometer, is not named."""
    assert named(record("phonefall")).startswith("drag in the square of the speed at the size of theory")
    assert not {"drift", "late"} & set(record("phonefall")["parameters"])
    assert record("phonefall")["gain_interval"][0] > 0
    assert record("phonefall")["error_before"] > 2 * record("phonefall")["error_after"]


def test_balls_from_a_bridge_lack_a_drag_that_differs_between_them() -> None:
    """Linear in the speed, as their authors find, too; by the book it is quadratic."""
    assert record("balldrop")["verdict"] == "partial"
    assert named(record("balldrop")) == "linear drag"
    assert not {"scale", "carried"} & set(record("balldrop")["parameters"])
    assert min(falls("balldrop")) > 2


def test_a_ship_that_lacks_both_stiffening_and_eddies_is_not_explained_by_one() -> None:
    assert record("shiproll")["verdict"] == "unexplained"
    assert record("shiproll")["nearest_candidate"]["title"] == "stiffening by the sides"


def test_the_stiffening_of_a_ship_is_that_of_a_simulation_of_its_hull() -> None:
    """Of M. Alexandersson et al., without viscosity: 0.754 per rad² fits their fnpf_kvlcc2_rolldecay_0kn.csv."""
    model, rows = load_model(MODELS / "shiproll.py", MODELS / "data/shiproll.csv")
    stiffening = sf.Number("stiffening", 0.5, unit="1/rad²", low=-5, high=10)
    declared = replace(model.without("stiffening"), numbers=[*model.numbers, stiffening])
    verdict = sf.calibrate(rows, declared, trace="test", held_out="21338", progress=False)
    low, high = verdict.facts["parameters"]["stiffening"]["interval"]
    assert 0.65 < low < high < 0.8
    assert (
        verdict.facts["error_before"] > 2 * verdict.facts["error_after"]
    )  # by a damping that grows with the angle


def test_of_tanks_without_repeats_nothing_is_claimed() -> None:
    assert record("tanks")["noise_known"] is False
    assert not record("tanks")["effects"]


@pytest.mark.skipif(not CAN.exists(), reason="the table of the film can has no licence and is not here")
def test_laws_that_fit_three_cans_and_fail_on_one_of_them_are_withdrawn() -> None:
    assert record("filmcan")["noise_known"] is False
    assert not record("filmcan")["effects"]
    assert record("filmcan")["withdrawn"]


def test_every_table_has_its_source_and_licence() -> None:
    licences = (MODELS / "data/LICENCES.md").read_text()
    tables = {file.name for file in (MODELS / "data").glob("*.csv")}
    assert tables < {measured.table for measured in SETS.values()}
    assert all(f"| {table} |" in licences for table in tables)
    not_copied = [measured for measured in SETS.values() if measured.table not in tables]
    assert all(SOURCE.search((MODELS / measured.model).read_text()) for measured in not_copied)
