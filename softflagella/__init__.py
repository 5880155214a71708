"""Soft flagellated robots near a surface: simulate, sweep, learn, plan, replay, calibrate.

    import softflagella as sf

    robot = sf.load_robot("paper-control")
    motion = sf.steady(robot)                          # simulate its mean motion
    result = sf.plan(sf.polygon(4, side=3.0), robot)   # plan a square without simulating
    track = sf.replay(result)                          # simulate the plan

Every name below is loaded when it is first used, so importing the package is quick. Lengths are in tail lengths l,
times in μ0 l⁴/EI, forces in EI/l², angles in radians, unless a name says its unit.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from calibration.synthetic import make_table
    from calibration.verdict import Verdict
    from planner.drawings import read_path
    from planner.export import write_plan
    from planner.goal import Voyage, to_goal
    from planner.keep_out import Circle
    from planner.path import Path2D, circle, polygon
    from planner.plan import Plan, plan
    from planner.tracker import Tracker
    from sim.effects import catalogue as effects
    from sim.inputs import load_robot, save_robot
    from sim.io.errors import InputError
    from sim.io.provenance import __version__
    from sim.model.effect import Effect
    from sim.model.robot import Robot
    from sim.model.schedule import Schedule, load_schedule
    from softflagella.calibrating import calibrate
    from softflagella.simulating import replay, response, sensitivities, steady, switch_response
    from softflagella.sweeping import read_sweep, sweep
    from surrogate.export import load_table
    from surrogate.table import LookupTable
    from surrogate.tabulate import tabulate
    from surrogate.train import train

_HOMES = {
    "Circle": "planner.keep_out",
    "Effect": "sim.model.effect",
    "InputError": "sim.io.errors",
    "LookupTable": "surrogate.table",
    "Path2D": "planner.path",
    "Plan": "planner.plan",
    "Robot": "sim.model.robot",
    "Schedule": "sim.model.schedule",
    "Voyage": "planner.goal",
    "Verdict": "calibration.verdict",
    "__version__": "sim.io.provenance",
    "calibrate": "softflagella.calibrating",
    "circle": "planner.path",
    "effects": "sim.effects:catalogue",
    "load_robot": "sim.inputs",
    "load_schedule": "sim.model.schedule",
    "load_table": "surrogate.export",
    "make_table": "calibration.synthetic",
    "plan": "planner.plan",
    "polygon": "planner.path",
    "read_path": "planner.drawings",
    "read_sweep": "softflagella.sweeping",
    "replay": "softflagella.simulating",
    "response": "softflagella.simulating",
    "save_robot": "sim.inputs",
    "sensitivities": "softflagella.simulating",
    "steady": "softflagella.simulating",
    "sweep": "softflagella.sweeping",
    "switch_response": "softflagella.simulating",
    "tabulate": "surrogate.tabulate",
    "Tracker": "planner.tracker",
    "to_goal": "planner.goal",
    "train": "surrogate.train",
    "write_plan": "planner.export",
}

__all__ = [
    "Circle", "Effect", "InputError", "LookupTable", "Path2D", "Plan", "Robot", "Schedule", "Tracker", "Verdict",
    "Voyage", "__version__", "calibrate", "circle", "effects", "load_robot", "load_schedule", "load_table",
    "make_table", "plan", "polygon", "read_path", "read_sweep", "replay", "response", "save_robot",
    "sensitivities", "steady", "sweep", "switch_response", "tabulate", "to_goal", "train",
    "write_plan",
]  # fmt: skip


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module, _, attribute = _HOMES[name].partition(":")
    value = getattr(import_module(module), attribute or name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *_HOMES})
