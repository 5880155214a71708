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
from warnings import warn

if TYPE_CHECKING:
    from calibration.swimmer.synthetic_table import make_table
    from calibration.verdict.verdict import Verdict
    from planner.files.plan_files import write_plan
    from planner.goal.obstacles import Circle
    from planner.goal.to_goal import GoalPlan, to_goal
    from planner.paths.path import Path2D, circle, polygon
    from planner.paths.path_files import read_path
    from planner.planning.plan import Plan, plan
    from planner.tracking.tracker import Tracker
    from sim.effects import catalogue as effects
    from sim.inputs import load_robot, save_robot
    from sim.io.errors import InputError
    from sim.io.provenance import __version__
    from sim.model.effect import Effect
    from sim.model.robot import Robot
    from sim.model.schedule import Schedule, load_schedule
    from softflagella.api.calibrate import calibrate
    from softflagella.api.simulate import replay, response, sensitivities, steady, switch_response
    from softflagella.api.sweep import read_sweep, sweep
    from surrogate.interface import LookupTable
    from surrogate.one_robot.tabulate import tabulate
    from surrogate.table.model_file import load_table
    from surrogate.training.train import train

_HOMES = {
    "Circle": "planner.goal.obstacles",
    "Effect": "sim.model.effect",
    "GoalPlan": "planner.goal.to_goal",
    "InputError": "sim.io.errors",
    "LookupTable": "surrogate.interface",
    "Path2D": "planner.paths.path",
    "Plan": "planner.planning.plan",
    "Robot": "sim.model.robot",
    "Schedule": "sim.model.schedule",
    "Verdict": "calibration.verdict.verdict",
    "__version__": "sim.io.provenance",
    "calibrate": "softflagella.api.calibrate",
    "circle": "planner.paths.path",
    "effects": "sim.effects:catalogue",
    "load_robot": "sim.inputs",
    "load_schedule": "sim.model.schedule",
    "load_table": "surrogate.table.model_file",
    "make_table": "calibration.swimmer.synthetic_table",
    "plan": "planner.planning.plan",
    "polygon": "planner.paths.path",
    "read_path": "planner.paths.path_files",
    "read_sweep": "softflagella.api.sweep",
    "replay": "softflagella.api.simulate",
    "response": "softflagella.api.simulate",
    "save_robot": "sim.inputs",
    "sensitivities": "softflagella.api.simulate",
    "steady": "softflagella.api.simulate",
    "sweep": "softflagella.api.sweep",
    "switch_response": "softflagella.api.simulate",
    "tabulate": "surrogate.one_robot.tabulate",
    "Tracker": "planner.tracking.tracker",
    "to_goal": "planner.goal.to_goal",
    "train": "surrogate.training.train",
    "write_plan": "planner.files.plan_files",
}

__all__ = [
    "Circle", "Effect", "GoalPlan", "InputError", "LookupTable", "Path2D", "Plan", "Robot", "Schedule", "Tracker",
    "Verdict", "__version__", "calibrate", "circle", "effects", "load_robot", "load_schedule", "load_table",
    "make_table", "plan", "polygon", "read_path", "read_sweep", "replay", "response", "save_robot",
    "sensitivities", "steady", "sweep", "switch_response", "tabulate", "to_goal", "train",
    "write_plan",
]  # fmt: skip


_RENAMED = {"Voyage": "GoalPlan"}  # old name -> new name, for one release


def __getattr__(name: str) -> Any:
    if name in _RENAMED:
        warn(f"{name} is now {_RENAMED[name]}", DeprecationWarning, stacklevel=2)
        name = _RENAMED[name]
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module, _, attribute = _HOMES[name].partition(":")
    value = getattr(import_module(module), attribute or name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *_HOMES})
