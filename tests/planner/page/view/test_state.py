"""The state of the page: units, addresses, undo and redo."""

from __future__ import annotations

import math

import numpy as np

from sim.model.presets import PRESETS
from tests.planner.page.page_core import answer, answers

ROBOT = PRESETS["paper-measured"]
SI = {
    "tails": ROBOT.tails, "tailLength": ROBOT.tail_length, "motorSpeed": ROBOT.motor_speed,
    "viscosity": ROBOT.viscosity, "tailRadius": ROBOT.tail_radius, "youngsModulus": ROBOT.youngs_modulus,
    "headRadius": ROBOT.head_radius, "headLength": ROBOT.head_length, "discOffset": None, "C_t": ROBOT.C_t,
    "C_r": ROBOT.C_r, "C_yr": ROBOT.C_yr,
}  # fmt: skip
OPTIONS = {"objective": "error", "corner": "nearest", "point": "head_centre", "minimumSeconds": None,
           "tolerance": None, "timeWeight": 0, "smooth": None}  # fmt: skip
SHAPES = ["circle", "square"]


def first() -> dict:
    values = answer("view/state.js", "labValues", SI)
    return {
        "robot": {"name": "paper-measured", "values": values},
        "path": {"shape": "circle", "size": 20},
        "options": OPTIONS,
    }


def test_laboratory_units_are_round_numbers_and_lead_back_to_the_last_bit() -> None:
    values = answer("view/state.js", "labValues", SI)
    assert (values["tailLength"], values["tailRadius"], values["youngsModulus"]) == (11, 3.2, 1.2)
    assert math.isclose(values["motorSpeed"], 143.66, rel_tol=1e-12)
    assert answer("view/state.js", "siValues", values, SI) == SI
    changed = answer("view/state.js", "siValues", {**values, "tailLength": 10, "discOffset": 8}, SI)
    assert changed == {**SI, "tailLength": 0.1, "discOffset": 0.008}


def test_an_address_holds_what_differs_and_leads_back_to_the_same_state() -> None:
    initial = first()
    rng = np.random.default_rng(1)
    drawn = (np.cumsum(rng.integers(-400, 400, (300, 2)), 0) / 1000).tolist()
    opened = [*rng.normal(size=(20, 2)).tolist(), [1e-9, -1e21]]
    values = {**initial["robot"]["values"], "viscosity": 0.97, "discOffset": 12.5}
    states = [
        initial,
        {**initial, "path": {"shape": "square", "size": 12.5}},
        {**initial, "path": {"points": drawn, "closed": True, "name": "a & b = ü#"}},
        {**initial, "path": {"points": opened, "closed": False, "name": "file"}},
        {**initial, "robot": {"name": "mine", "values": values}},
        {**initial, "options": {**OPTIONS, "objective": "flips", "tolerance": 0.4, "smooth": 1.5}},
    ]
    addresses = answers([("view/state.js", "addressOf", state, initial) for state in states])
    assert addresses[0] == ""
    assert len(addresses[2]) < 8 * len(drawn)
    read = answers([("view/state.js", "fromAddress", address, initial, SHAPES) for address in addresses])
    assert read == [{"state": state, "problem": ""} for state in states]


def test_an_unknown_or_broken_address_gives_the_first_state_and_says_so() -> None:
    initial = first()
    broken = ["v=2", "rubbish", "v=1&points=1.", "v=1&points=2.3", "v=1&places=2,3", "v=1&places=2,3~4",
              "v=1&places=2,3~4,x", "v=1&path=heptagon%3A3", "v=1&C_t=x",
              "v=1&name=%E0%A4%A", "v=1&path=circle%3A", "v=1&unknown=3", "v=1&C_t=none", "=",
              "v=1&&"]  # fmt: skip
    read = answers([("view/state.js", "fromAddress", address, initial, SHAPES) for address in broken])
    for entry in read:
        assert entry["state"] == initial
        assert entry["problem"].startswith("The link cannot be read: ")


def test_a_misspelt_shape_in_an_address_is_told_the_nearest_one() -> None:
    entry = answer("view/state.js", "fromAddress", "v=1&path=squre%3A3", first(), SHAPES)
    assert "it has an unknown shape, squre (is it square?)" in entry["problem"]


def test_points_lie_on_the_grid_once() -> None:
    assert answer("view/state.js", "onGrid", [[0.1234, 2], [0.12341, 2.0001], [-1, 0]]) == [
        [0.123, 2],
        [-1, 0],
    ]
