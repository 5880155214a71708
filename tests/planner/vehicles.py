"""Vehicles for the planner's tests: the control robot's numbers, without model or simulator."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from common.arrays import Floats
from planner.guidance.line_of_sight import Guidance
from planner.planning.request import Camera
from planner.vehicle.vehicle import BEFORE_KNOTS, TIMES, Mode, Vehicle
from sim.mechanics import planar

PROMPT = Camera(delay_s=0.0, lost=0.0)
FINE = replace(PROMPT, noise=(0.005, 0.005))
ERRORS = (0.001, 0.003, 0.003)  # relative, of v_z, v_x and ω_yr


def vehicle(*, yaw: float = 0.0489, sway: float = 0.0424, surge: float = 0.0179, lag: float = 1.0,
            memory: float = 1.0, bias: float = 0.0, errors: float = 1.0) -> Vehicle:  # fmt: skip
    """Make a vehicle with the control robot's numbers.

    Args:
        yaw, sway, surge: of the positive direction.
        lag: scales the response to a flip (0: instantaneous circles).
        memory: scales what the dwell before adds.
        bias: by this share the positive direction turns faster, and the other one slower.
        errors: scales what is uncertain.
    """
    positive = np.array([surge, sway, yaw])
    twist = np.stack([positive, positive * planar.MIRROR]) * np.array([[1, 1, 1 + bias], [1, 1, 1 - bias]])
    mirrors = np.stack([np.ones(3), planar.MIRROR])
    rise = (1 - np.exp(-TIMES / 0.2))[:, None]
    curve = lag * rise * np.array([-0.0018, -0.0009, 0.0013])
    memory_curve = (
        memory * lag * np.exp(-BEFORE_KNOTS / 0.25)[:, None, None] * rise * np.array([0.003, 0.001, -0.002])
    )
    memory_curve[-1] = 0.0
    table = curve + memory_curve
    return Vehicle(
        twist=twist,
        lag=table * mirrors[:, None, None],
        rest=0.5 * curve * mirrors[:, None],
        spread=np.zeros((2, len(TIMES), 3)),
        modes=_modes(twist, errors),
        tail_gap=2.4,
    )


def plain_guidance(car: Vehicle, dwell: float, ahead: float) -> Guidance:
    """Make guidance with the swing Ω T of a robot without lags."""
    return Guidance(dwell, ahead, float(np.abs(car.twist[:, 2]).max()) * dwell)


def _modes(twist: Floats, errors: float) -> tuple[Mode, ...]:
    modes = []
    for i, share in enumerate(ERRORS):
        size = np.zeros((2, 3))
        size[:, i] = errors * share * twist[:, i]
        modes.append(Mode(str(i), size))
    return tuple(modes)


def root_mean_square(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))
