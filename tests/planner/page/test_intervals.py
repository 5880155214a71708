"""Half-widths of intervals are Python's in every part, for one tail and for several."""

from __future__ import annotations

import numpy as np

from surrogate.table.errors import COMPARED, error_scale
from surrogate.table.intervals import PARTS, Intervals
from tests.planner.page.page_core import answers
from tests.planner.page.robots import check_alike, shipped


def test_half_widths_in_all_parts() -> None:
    intervals = shipped().intervals
    assert intervals is not None
    features = intervals.shift + np.random.default_rng(0).normal(size=(200, 11)) * intervals.scale * 2
    features[:, -1] = np.arange(200) % 10 == 0
    assert len(set(intervals.part(features).tolist())) == PARTS
    page = _page(intervals)
    for name in ("omega_yr_bar", "theta_deg"):
        found = answers([("intervals.js", "halfWidth", page, name, row, 2.0) for row in features])
        check_alike(np.log(found)[:, None], np.log(intervals.half_widths(name, features, 2.0))[:, None])


def test_scales_of_errors() -> None:
    answer = {name: 0.5 - i for i, name in enumerate((*COMPARED, "net_speed_bar", "lag_z", "lag_psi_rad"))}
    found = answers([("intervals.js", "errorScale", name, answer) for name in answer])
    check_alike(found, [float(error_scale(name, answer)) for name in answer], 1e-15)


def _page(intervals: Intervals) -> dict[str, object]:
    tensors = {name: {"values": getattr(intervals, name)} for name in ("shift", "scale", "middle")}
    rows = {
        kind: {name: {"values": part} for name, part in getattr(intervals, kind).items()}
        for kind in ("weights", "factor")
    }
    return {**tensors, **rows, "bounds": {name: list(ends) for name, ends in intervals.bounds.items()}}
