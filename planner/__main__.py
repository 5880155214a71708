"""Command line of the planner: plan a path, go to a goal, visit places, hold one, write the page."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Any

from common.commands import Call, Program
from planner.paths.units import in_lab
from planner.progress import progress_bar

if TYPE_CHECKING:
    from planner.planning.plan import Plan

program = Program("planner", "plan switching schedules for paths")
main = program.main


def _write(result: Plan, out: str, *lines: str, arduino: str | None = None) -> None:
    """Write a plan, and print warnings, what there is to say of it, and its files."""
    from planner.files.arduino import write_arduino
    from planner.files.plan_files import write_plan

    library = [] if arduino is None else [write_arduino(result, arduino)]
    files = [*write_plan(result, out), *library]
    for warning in result.warnings:
        print(f"warning: {warning}", file=sys.stderr)
    for line in (*result.lines(), *lines, f"-> {', '.join(map(str, files))}"):
        print(line)


def _refuse_early(arduino: str | None) -> None:
    """Refuse a folder that no library can be written into, before a plan is made for it."""
    if arduino is not None:
        from planner.files.arduino import check_library

        check_library(arduino)


def planned(call: Call, *, arduino: str | None = None, **further: Any) -> Plan:
    """Plan with a public function and a bar."""
    _refuse_early(arduino)
    with progress_bar() as progress:
        plan: Plan = call(progress=progress, **further)
    return plan


@program.command("plan", of="planner.jobs.plan:plan", robot="--robot")
def _plan(plan: Call, *, out: str, arduino: str | None = None) -> None:
    """Plan the switching times for a path."""
    result = planned(plan, arduino=arduino, tell=print)
    errors = result.errors
    rms, largest, missed = (
        in_lab(value, result.robot) for value in (errors.drawn_rms, errors.drawn_max, result.declared.missed)
    )
    drawn = f"from the path as drawn {rms} rms, {largest} at most; every drawn point is within {missed} of the "
    _write(result, out, f"{drawn}declared path", arduino=arduino)


@program.command("goal", of="planner.goal.trip:to_goal", robot="--robot")
def _goal(
    to_goal: Call,
    *,
    goal: tuple[str, str, str],
    start: tuple[str, str, str] = ("0", "0", "0"),
    out: str,
    arduino: str | None = None,
) -> None:
    """Plan the way from one pose to another, around obstacles; exit status 3 where there is none.

    Args:
        goal: X Y DEGREES, of the head's centre at the end.
        start: X Y DEGREES, of the head's centre at the start, at rest (default: 0 0 0).
    """
    _write(planned(to_goal, arduino=arduino, start=start, goal=goal), out, arduino=arduino)


@program.command("hold", of="planner.jobs.hold:hold", robot="--robot", seconds="for")
@program.command("tour", of="planner.jobs.tour:tour", robot="--robot", back="return")
def _job(job: Call, *, out: str, arduino: str | None = None) -> None:
    _write(planned(job, arduino=arduino), out, arduino=arduino)


@program.command("page", of="planner.page.write_page:write_page", path="", robot="--robot", paths="path")
def _page(write_page: Call, *, out: str) -> None:
    """Write one HTML file that plans: draw a path in the browser, take the schedule along.

    Args:
        out: the page, HTML.
    """
    page = write_page(path=out)
    print(f"{page.stat().st_size / 1e6:.2f} MB, opens in a browser -> {page}")


if __name__ == "__main__":
    program.exit()
