"""Measured tracks beside the plan, as measured and moved."""

from __future__ import annotations

import numpy as np
import pytest

from planner.paths.path import circle
from planner.planning.plan import plan
from sim.model.presets import PRESETS
from tests.planner.page.page_core import answers, check_near

ROBOT = PRESETS["paper-control"]


def test_a_track_is_compared_in_cm_and_can_be_laid_on_the_plan() -> None:
    result = plan(circle(1.5), ROBOT, objective="flips")
    content = result.to_dict()
    x, y, heading = result.poses.T
    ends = [0.0, *result.dwells.cumsum().tolist()]
    names = ["time_bar", "x_over_l", "y_over_l", "heading_rad"]
    table = {"names": names, "columns": [ends, x.tolist(), y.tolist(), heading.tolist()], "plans": ["p1"]}
    later, quarter = [time + 3 for time in ends], (heading + np.pi / 2).tolist()
    turned = {"names": names, "columns": [later, (-y).tolist(), x.tolist(), quarter]}
    measured, laid = answers(
        [("compared_track.js", "comparedTrack", content, *given) for given in ((table, "none"), (turned, "rigid"))]
    )
    assert (measured["shift"], measured["ofPlan"], laid["ofPlan"]) == ("", "p1", "")
    assert "first pose" in laid["shift"]
    assert 0 < measured["error"]["largest"] <= 11 * result.predicted_max * (1 + 1e-9)
    check_near(laid["points"], measured["points"])
    assert laid["error"]["rms"] == pytest.approx(measured["error"]["rms"])
    assert laid["csv"].splitlines()[0] == "time_s,x_cm,y_cm,heading_deg"
