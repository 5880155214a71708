"""A vehicle with one shortest dwell: straight motion, what carries it off its heading, guidance."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from planner.paths.tractrix import Drift
from planner.paths.units import time_in_lab
from planner.planning.declared_path import Declared
from planner.planning.line_of_sight import Guidance
from planner.planning.stated_error import look_ahead
from planner.vehicle.tracked_point import TrackedVehicle
from planner.vehicle.zigzag import Zigzag, zigzag
from sim.io.errors import InputError


class Setting(NamedTuple):
    """A vehicle with one shortest dwell, and what its reference keeps to. Lengths in l, times in μ0 l⁴/EI."""

    tracked: TrackedVehicle
    dwell: float
    straight: Zigzag
    drift: Drift
    margin: float | None = None  # around the body; None: no error is known yet
    longer: float = 0.0  # length that a swing must add

    @staticmethod
    def of(tracked: TrackedVehicle, dwell: float, longer: float = 0.0) -> Setting:
        """Compute straight motion and drift with a shortest dwell.

        Raises:
            InputError: with such dwells the robot does not get ahead.
        """
        straight = zigzag(tracked.vehicle, dwell, tracked.offset)
        return Setting(tracked, dwell, straight, zigzag_drift(tracked, straight), longer=longer)

    def guidance(self, declared: Declared) -> Guidance:
        """Choose look-ahead and hysteresis for a declared path."""
        ahead = look_ahead(self.tracked.vehicle, declared.curvature, self.straight)
        return Guidance(self.dwell, ahead, self.straight.hysteresis(ahead))


def zigzag_drift(tracked: TrackedVehicle, straight: Zigzag) -> Drift:
    """Return what carries the robot off its heading in straight motion, as shares of its net speed.

    Raises:
        InputError: with such dwells the robot does not get ahead.
    """
    vehicle = tracked.vehicle
    if straight.speed <= 0:
        dwell = min(straight.dwells)
        turn = dwell * float(np.abs(vehicle.twist[:, 2]).max())
        remedy = "shorter ones: it turns too far" if turn > 1.0 else "longer ones: it is still accelerating"
        raise InputError(
            f"with dwells of {time_in_lab(dwell, tracked.robot)} the robot does not get ahead; allow {remedy} in "
            "each dwell"
        )
    sideways = straight.drift / straight.speed
    x, y = (vehicle.current / straight.speed).tolist()
    # A mirror-symmetric robot has no drift: what is left is rounding.
    return Drift(0.0 if abs(sideways) < 1e-9 else sideways, (x, y))
