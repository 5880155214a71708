"""All errors of a schedule are Python's."""

from __future__ import annotations

import numpy as np

from planner.paths.path import polygon
from planner.planning.plan import plan
from tests.planner.page.page_core import answer, check_near
from tests.planner.page.robots import random_robots, shipped, vehicle_to_page

NAMES = {"stated": "stated", "guaranteed": "guaranteed", "closure": "closure",
         "predictedRms": "predicted_rms", "predictedMax": "predicted_max", "drawnRms": "drawn_rms",
         "drawnMax": "drawn_max"}  # fmt: skip


def test_errors_of_a_square() -> None:
    made = plan(polygon(4, 3.0), random_robots(1)[0], lookup=shipped(), point="head_tip", objective="time", seed=5)
    switches = made.switches
    page = {"firstDirection": switches.first_direction, "dwells": switches.dwells, "poses": switches.poses}
    tracked = {"vehicle": vehicle_to_page(made.tracked.vehicle), "offset": made.tracked.offset}
    tracked["robot"] = {"timeScale": made.robot.time_scale}
    straight = {"speed": made.straight.speed, "drift": made.straight.drift}
    declared = {"reference": {"p": made.declared.reference.p}}
    bound = made.errors.guaranteed
    found = answer("errors.js", "planErrors", tracked, made.drawn, declared, page, bound, 5, straight)
    for name, of_python in NAMES.items():
        check_near(found[name], getattr(made.errors, of_python), 1e-9)
    check_near(found["feedback"], made.feedback_error, 1e-9)
    assert np.shape(found["track"]) == made.errors.track.shape
    check_near(found["track"], made.errors.track, 1e-12)
