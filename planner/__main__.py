"""Command line of the planner: robots to edit; plans for paths, goals, tours and places to hold; the page."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Any, TypedDict

from common.changes import ChangedRobot, RobotSource
from common.commands import Call, Program
from common.errors import InputError
from planner.paths.units import in_lab
from planner.progress import plan_bar

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from planner.planning.plan import Plan

program = Program("planner", "plan switching schedules for paths")
main = program.main
CAMERA = "--camera-errors"  # the camera itself is that of softflagella track --camera


class BoardOptions(TypedDict, total=False):
    """Folders for boards.

    Attributes:
        arduino: DIR, an Arduino library with the schedule, and sketches that drive the motor.
        micropython: DIR, modules for MicroPython with the schedule, and the motor.
    """

    arduino: str
    micropython: str


def _write(result: Plan, out: str, *lines: str, **folders: Unpack[BoardOptions]) -> None:
    """Write a plan, and print warnings, what there is to say of it, and its files."""
    from planner.files import boards
    from planner.files.plan_files import write_plan

    for_boards = [getattr(boards, f"write_{board}")(result, folder) for board, folder in folders.items()]
    files = [*write_plan(result, out), *for_boards]
    for warning in result.warnings:
        print(f"warning: {warning}", file=sys.stderr)
    for line in (*result.lines(), *lines, f"-> {', '.join(map(str, files))}"):
        print(line)


def planned(call: Call, folders: BoardOptions, **further: Any) -> Plan:
    """Plan with a public function and a bar; refuse first a folder that nothing can be written into."""
    from planner.files.boards import check_folder

    for board, folder in folders.items():
        check_folder(board, str(folder))
    with plan_bar() as progress:
        plan: Plan = call(progress=progress, **further)
    return plan


@program.command("plan", of="planner.jobs.plan:plan", robot="--robot", camera=CAMERA)
def _plan(plan: Call, *, out: str, **folders: Unpack[BoardOptions]) -> None:
    """Plan the switching times for a path."""
    result = planned(plan, folders, tell=print)
    errors = result.errors
    rms, largest, missed = (
        in_lab(value, result.robot) for value in (errors.drawn_rms, errors.drawn_max, result.declared.missed)
    )
    drawn = f"from the path as drawn {rms} rms, {largest} at most; every drawn point is within {missed} of the "
    _write(result, out, f"{drawn}declared path", **folders)


@program.command("goal", of="planner.goal.trip:to_goal", robot="--robot", camera=CAMERA)
def _goal(
    to_goal: Call,
    *,
    goal: tuple[str, str, str],
    start: tuple[str, str, str] = ("0", "0", "0"),
    out: str,
    **folders: Unpack[BoardOptions],
) -> None:
    """Plan the way from one pose to another, around obstacles; exit status 3 where there is none.

    Args:
        goal: X Y DEGREES, of the head's centre at the end.
        start: X Y DEGREES, of the head's centre at the start, at rest (default: 0 0 0).
    """
    _write(planned(to_goal, folders, start=start, goal=goal), out, **folders)


@program.command("hold", of="planner.jobs.hold:hold", robot="--robot", camera=CAMERA, seconds="for")
@program.command("tour", of="planner.jobs.tour:tour", robot="--robot", camera=CAMERA, back="return")
def _job(job: Call, *, out: str, **folders: Unpack[BoardOptions]) -> None:
    _write(planned(job, folders), out, **folders)


@program.command("robot")
def _robot(preset: RobotSource, *, out: str) -> None:
    """Write a preset robot, or a vehicle of five measured numbers, as TOML to edit.

    Args:
        preset: paper-control, paper-triangle or paper-measured; or vehicle.
        out: robot.toml, or vehicle.toml.
    """
    from common.files import write_text
    from planner.vehicle.measured import EXAMPLE
    from sim.inputs import load_robot, save_robot
    from sim.model.presets import PRESETS

    if str(preset) not in (*PRESETS, "vehicle"):
        raise InputError(f"no preset {str(preset)!r}; there are {', '.join(PRESETS)} and vehicle")
    if str(preset) != "vehicle":
        save_robot(load_robot(preset), out)
    elif isinstance(preset, ChangedRobot):
        raise InputError(f"--set changes presets; leave it out, and edit {out}")
    else:
        write_text(out, EXAMPLE)
    print(f"{preset} -> {out}")


@program.command("page", of="planner.page.write_page:write_page", path="", robot="--robot", paths="path")
def _page(write_page: Call, *, out: str) -> None:
    """Write one HTML file that plans: draw a path in the browser, take the schedule along.

    Args:
        out: the page, HTML.
    """
    page = write_page(path=out)
    print(f"{page.stat().st_size / 1e6:.2f} MB, opens in a browser -> {page}")


@program.command("compile")
def _compile() -> None:
    """Compile the loops of queries, plans and training now rather than on first use."""
    from time import perf_counter

    import numpy as np

    from planner.jobs.plan import plan
    from planner.paths.path import circle
    from sim import jit
    from sim.inputs import group_columns
    from sim.model.presets import PRESETS
    from surrogate.domain import Support
    from surrogate.intervals import Intervals
    from surrogate.table_file import load

    jit.beforehand, began = True, perf_counter()
    robot, table = group_columns([PRESETS["paper-control"]]), load()
    table.query({**robot, "dwell_bar": np.ones(1)}, intervals=True)
    plan(circle(2.0), PRESETS["paper-control"])
    Support.learned(np.eye(2))
    Intervals.learned(np.eye(2), {})
    print(f"loops compiled in {perf_counter() - began:.0f} s -> {jit.CACHE}")


if __name__ == "__main__":
    program.exit()
