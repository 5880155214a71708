"""Parts of the page that need no browser: units, addresses, zoom, corners, poses, the summary."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from sim.model.presets import PRESETS
from tests.planner.page.page_core import answer, answers, call, check_near, to_page

ROBOT = PRESETS["paper-measured"]
SI = {name: value for name, value in to_page(ROBOT).items()
      if name not in ("name", "effects", "timeScale", "omegaBar", "sigmas")}  # fmt: skip
OPTIONS = {"objective": "error", "corner": "nearest", "point": "head_centre", "minimumSeconds": None,
           "tolerance": None, "timeWeight": 0, "smooth": None}  # fmt: skip
SHAPES = ["circle", "square"]
VIEW = {"scale": 12.0, "left": 310.0, "top": 205.0}


def first() -> dict[str, Any]:
    values = answer("view/state.js", "labValues", SI)
    path = {"shape": "circle", "size": 20}
    return {"robot": {"name": "paper-measured", "values": values}, "path": path, "options": OPTIONS}


def test_laboratory_units_are_round_numbers_and_lead_back_to_the_last_bit() -> None:
    values = answer("view/state.js", "labValues", SI)
    assert (values["tailLength"], values["tailRadius"], values["youngsModulus"]) == (11, 3.2, 1.2)
    assert math.isclose(values["motorSpeed"], 143.66, rel_tol=1e-12)
    assert answer("view/state.js", "siValues", values, SI) == SI
    changed = answer("view/state.js", "siValues", {**values, "tailLength": 10, "discOffset": 8}, SI)
    assert changed == {**SI, "tailLength": 0.1, "discOffset": 0.008}


def test_an_address_holds_what_differs_and_leads_back_to_the_same_state() -> None:
    initial, rng = first(), np.random.default_rng(1)
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
              "v=1&places=2,3~4,x", "v=1&path=heptagon%3A3", "v=1&C_t=x", "v=1&name=%E0%A4%A",
              "v=1&path=circle%3A", "v=1&unknown=3", "v=1&C_t=none", "=", "v=1&&",
              "v=1&path=squre%3A3"]  # fmt: skip
    read = answers([("view/state.js", "fromAddress", address, initial, SHAPES) for address in broken])
    for entry in read:
        assert entry["state"] == initial
        assert entry["problem"].startswith("The link cannot be read: ")
    assert "it has an unknown shape, squre (is it square?)" in read[-1]["problem"]


@pytest.mark.parametrize("link", ["v=1&robot=mine", "v=1&viscosity=2"])
def test_a_link_of_another_robot_is_refused_where_the_robot_is_locked(link: str) -> None:
    initial = first()
    assert answer("view/state.js", "fromAddress", link, initial, SHAPES)["problem"] == ""
    read = answer("view/state.js", "fromAddress", link, initial, SHAPES, True)
    assert read["state"] == initial
    assert "it is of another robot" in read["problem"]


def test_a_zoom_keeps_the_place_under_the_pointer() -> None:
    place = answer("view/scene.js", "placeAt", VIEW, 40, 70)
    check_near(answer("view/scene.js", "pixelOf", VIEW, place), [40, 70])
    for factor in (3, 1e30):
        view = call("view/scene.js", "zoomed", VIEW, factor, 40, 70)
        check_near(answer("view/scene.js", "placeAt", view, 40, 70), place)


def test_everything_fits() -> None:
    points = np.random.default_rng(0).normal(size=(50, 2)) * [30, 2]
    view = answer("view/scene.js", "fitted", points, 600, 400)
    pixels = np.array(answers([("view/scene.js", "pixelOf", view, point) for point in points]))
    assert pixels.min(0)[0] == pytest.approx(600 * 0.12 / 1.24)
    assert (pixels.min() >= 0, pixels[:, 0].max() <= 600, pixels[:, 1].max() <= 400) == (True, True, True)
    for few in ([[3, 4]], []):
        assert answer("view/scene.js", "fitted", few, 600, 400)["scale"] > 0


def test_the_grid_and_moved_corners() -> None:
    points = [[0.1234, 2], [0.12341, 2.0001], [-1, 0]]
    assert answer("view/state.js", "onGrid", points) == [[0.123, 2], [-1, 0]]
    square, same = [[0, 0], [2, 0], [2, 2], [0, 2]], {"right": 0, "up": 0, "scale": 1, "turn": 0}
    changes = [{"right": 1, "up": -2}, {"scale": 2}, {"turn": 90}]
    found = answers([("view/editor.js", "transformed", square, same | change) for change in changes])
    check_near(found[0], [[1, -2], [3, -2], [3, 0], [1, 0]])
    check_near(found[1], [[-1, -1], [3, -1], [3, 3], [-1, 3]])
    check_near(found[2], [[2, 0], [2, 2], [0, 2], [0, 0]])


def test_poses_between_samples() -> None:
    plan = {"dwells": [2, 4], "samples": 2, "motion": [[0, 0, 0], [1, 0, 0], [2, 0, 0], [2, 2, 1], [2, 4, 1]]}
    poses = answers([("view/player.js", "poseAt", plan, [0, 2, 6], time) for time in (-1, 0.5, 2, 3, 99)])
    assert [each["pose"] for each in poses] == [[0, 0, 0], [0.5, 0, 0], [2, 0, 0], [2, 1, 0.5], [2, 4, 1]]
    assert [each["dwell"] for each in poses] == [0, 0, 1, 1, 1]


def test_a_plan_is_summed_up_and_tells_where_it_leaves_the_drawn_path() -> None:
    plan = {"seconds": 600, "dwells": [300, 300], "calibrated": True, "stated": 0.5, "offDrawn": 0.2,
            "missed": 0.4, "unmeasured": None}  # fmt: skip
    guessed = plan | {"unmeasured": 64.6, "size": 24.0}
    changes = [plan, plan | {"missed": 3.0}, guessed, guessed | {"size": 240.0}]
    kept, off, unknown, known = answers([("view/panels.js", "summary", change) for change in changes])
    assert "0.500 cm" in kept
    assert ("3.00 cm" in off, "leaves" in off, "leaves" in kept) == (True, True, False)
    assert ("64.6 cm" in known, "not known" in unknown, "not known" in known) == (True, True, False)
