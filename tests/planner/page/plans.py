"""Plans as the core has them."""

from __future__ import annotations

from functools import cache
from typing import Any

from planner.paths.path import Path2D
from planner.planning.plan import plan
from planner.planning.planned import Plan
from sim.model.presets import PRESETS
from sim.model.robot import Robot
from tests.planner.page.cases import PATHS, reference_to_page
from tests.planner.page.robots import vehicle_to_page


@cache
def planned(name: str, robot: str = "paper-control", **options: Any) -> Plan:
    """Plan for one of the paths."""
    return plan(PATHS[name], PRESETS[robot], **options)


def robot_to_page(robot: Robot) -> dict[str, Any]:
    """Write a robot as the core has it."""
    return {
        "name": robot.name, "tails": robot.tails, "tailLength": robot.tail_length, "tailRadius": robot.tail_radius,
        "youngsModulus": robot.youngs_modulus, "headRadius": robot.head_radius, "headLength": robot.head_length,
        "viscosity": robot.viscosity, "motorSpeed": robot.motor_speed, "C_t": robot.C_t, "C_r": robot.C_r,
        "C_yr": robot.C_yr, "discOffset": robot.disc_offset, "timeScale": robot.time_scale,
        "omegaBar": robot.omega_bar,
        "sigmas": {_camel(name): sigma._asdict() for name, sigma in robot.sigmas.items()},
    }  # fmt: skip


def plan_to_page(result: Plan) -> dict[str, Any]:
    """Write a plan as the core has it."""
    tracked, declared, errors, switches = result.tracked, result.declared, result.errors, result.switches
    return {
        "tracked": {
            "robot": robot_to_page(result.robot), "vehicle": vehicle_to_page(tracked.vehicle),
            "point": tracked.point, "offset": tracked.offset, "model": tracked.model,
            "ownTable": tracked.own_table, "warnings": list(tracked.warnings),
            "calibrated": tracked.calibrated, "unmeasured": [],
        },
        "unmeasured": result.unmeasured_error,
        "objective": result.objective,
        "drawn": _path(result.drawn),
        "declared": {
            "reference": reference_to_page(declared.reference), "curvature": declared.curvature,
            "offDrawn": declared.off_drawn, "missed": declared.missed, "warnings": list(declared.warnings),
        },
        "straight": {
            name: getattr(result.straight, name)
            for name in ("dwells", "speed", "swing", "sway", "drift", "rms", "largest")
        },
        "guidance": result.guidance._asdict(),
        "switches": {
            "firstDirection": switches.first_direction, "dwells": switches.dwells, "poses": switches.poses,
        },
        "errors": {
            _camel(name): getattr(errors, name)
            for name in ("predicted_rms", "predicted_max", "drawn_rms", "drawn_max", "stated", "guaranteed",
                         "closure", "table_share")
        } | {"feedback": result.feedback_error},
    }  # fmt: skip


def _path(path: Path2D) -> dict[str, Any]:
    return {"points": path.points, "closed": path.closed}


def _camel(name: str) -> str:
    first, *others = name.split("_")
    return first + "".join(part.capitalize() for part in others)
