"""Calibrate a robot with its swims.

Once with an effect's motion as the vehicle has it, and again, where it shows, with what the vehicle leaves out.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import numpy as np

from calibration.swim.measured_swim import MeasuredSwim
from calibration.swim.swim_model import SwimModel, swim_model
from calibration.verdict.calibrate import calibrate
from calibration.verdict.verdict import Verdict
from common.arrays import Floats
from sim.effects import effect_named, is_effect
from sim.model.robot import Robot

V = TypeVar("V", bound=Verdict)
_CANDIDATES = 4  # nearest effects of which it is learnt
_SHOWS = 1.0  # standard deviations by which it moves all poses together


def calibrate_swims(
    robot: Robot,
    swims: Sequence[MeasuredSwim],
    *,
    verdict: Callable[..., V],
    jobs: int | None,
    progress: bool,
    **settings: Any,
) -> V:
    """Calibrate a robot with its swims; the settings are those of `calibration.verdict.calibrate.calibrate`."""
    model, held_out = swim_model(robot, swims, jobs=jobs, progress=progress)
    settings |= {"held_out": held_out, "progress": progress, "verdict": verdict}
    result: V = calibrate(model, **settings)
    learnt = model.learnt(_sizes(model, result))
    if float(np.linalg.norm(_moved(model, learnt, result))) < _SHOWS:
        return result
    again: V = calibrate(learnt, **settings)
    return again


def _sizes(model: SwimModel, result: Verdict) -> dict[str, float]:
    """Choose effects that are named, or nearest to the poses, with their sizes."""
    fits = sorted((c.fit.deviance, c.effect.name, c.size) for c in result.attribution.candidates if c.fit)
    named = {e.name: result.final.parameters[e.name] for e in model.effects if e.name in result.final.names}
    sizes = {name: size for _, name, size in fits[:_CANDIDATES]} | named
    steps = {e.name: sizes[e.name] - e.start for e in model.effects if e.name in sizes and is_effect(e.name)}
    # A swim with a non-local effect takes minutes.
    return {name: step for name, step in steps.items() if step and effect_named(name).reach == "local"}


def _moved(model: SwimModel, learnt: SwimModel, result: Verdict) -> Floats:
    """Compute by how far what was learnt moves the poses of the best explanation (n, 3), white."""
    best = min((c.fit for c in result.attribution.candidates if c.fit), key=lambda fit: fit.deviance, default=None)
    at = (best or result.final).parameters
    before, after = (of.predict([at])[0] for of in (model, learnt))
    return after - before
