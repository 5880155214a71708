"""Modes of the response's errors add up to the sizes that the table states. `test_lookup.py` compares them."""

from __future__ import annotations

import numpy as np

from surrogate.error_modes import joined
from tests.planner.page.page_core import answer, check_near, typed


def test_steady_modes_come_first_and_curves_are_split_into_lag_and_memory() -> None:
    rng = np.random.default_rng(0)
    curves = rng.normal(size=(2, 17, 25, 3))
    widths = {"shift": np.zeros(11), "scale": np.ones(11), "middle": np.zeros(3)}
    terms, names = 1 + 11 + 66, ("lag_z", "lag_x", "lag_psi_rad")
    page = {
        "curves": {"shape": curves.shape, "values": typed(curves.ravel())},
        "widths": {name: {"values": part} for name, part in widths.items()}
        | {
            "weights": {name: {"values": np.zeros(terms)} for name in names},
            "factor": {name: {"values": np.full(9, 1.6449)} for name in names},
            "bounds": {name: [-1.0, 1.0] for name in names},
        },
    }
    modes = answer("curve_errors.js", "errorModes", page, [1.0, 2.0, 3.0], np.zeros(11), [0.5, 0.25, 2.0])
    wanted = joined(np.diag([1.0, 2.0, 3.0]), curves * [0.5, 0.25, 2.0])
    check_near([mode["twist"] for mode in modes], wanted.twist, 0.0)
    assert [mode["lag"] is None for mode in modes] == [True] * 3 + [False] * 2
    for name in ("lag", "memory"):
        check_near([mode[name] for mode in modes[3:]], getattr(wanted, name)[3:].reshape(2, -1), 1e-14)
