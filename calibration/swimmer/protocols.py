"""Which runs are fitted and which are held out for the test, fixed before the data is looked at.

session   one whole session is held out, the middle one by name, so that no extrapolation is needed;
paper     as in the paper: C_t, C_r, C_yr from ω_h and ω_yr of the robots with 3 and 4 tails, prediction for 2 and
          5 tails. The errors of the paper's predictions are 14.8 % and 10 %.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from calibration.statistics.study import divided, middle_session
from calibration.swimmer.measured_table import Measurements
from sim.arrays import Flags
from sim.io.errors import InputError


def _session(data: Measurements) -> tuple[Measurements, Flags]:
    return data, middle_session(data)


def _paper(data: Measurements) -> tuple[Measurements, Flags]:
    outputs = ("omega_h", "omega_yr")
    missing = [n for n in outputs if n not in data.outputs]
    if missing or not {2.0, 3.0, 4.0, 5.0} <= set(data.tails.tolist()):
        raise InputError("the paper's protocol needs omega_h_rpm, omega_yr_rad_s and runs with N = 2, 3, 4 and 5")
    y = data.y[:, [data.outputs.index(n) for n in outputs]]
    held_out = ~np.isin(data.tails, (3, 4))
    if divided(data, held_out):
        raise InputError(
            "a session has runs with N = 3 or 4 and with N = 2 or 5; the paper's protocol would split it"
        )
    return replace(data, outputs=outputs, y=y), np.asarray(held_out)


PROTOCOLS: dict[str, Callable[[Measurements], tuple[Measurements, Flags]]] = {"session": _session, "paper": _paper}
