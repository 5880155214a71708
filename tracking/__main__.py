"""Command line of the tracker: keep a robot on a path, replay a plan, check a track."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext, redirect_stdout
from io import TextIOWrapper
from typing import TYPE_CHECKING, Any

from common.changes import RobotSource
from common.commands import Call, Program, to_stderr
from common.errors import InputError
from common.units import format_length, format_time

if TYPE_CHECKING:
    from camera.view import View
    from planner.planning.plan import Plan
    from tracking.tracker import Tracker

program = Program("tracking", "keep robots on their paths, replay plans, check tracks")
main = program.main


@program.command("track", of="planner.jobs.plan:plan", robot="--robot")
def _track(
    plan_path: Call,
    path: str,
    *,
    robot: RobotSource | None = None,
    start: tuple[str, str, str] | None = None,
    noise: str = "0.01l",
    noise_rad: float = 0.01,
    latency: float = 0.0,
    camera: str | None = None,
    view: str | None = None,
    serial: str | None = None,
    lost_seconds: float | None = None,
    show: bool = False,
) -> None:
    """Keep a robot on a path or a saved plan: poses come in on a pipe or from a camera.

    Args:
        path: a path to plan for, as for softflagella plan; or a plan.json, its folder, or a goal.json or tour.json
            beside it.
        robot: robot.toml or the name of a preset; a saved plan has its own.
        start: X Y DEGREES, of the head's centre, at rest; the robot finds its way to the path from there (default:
            a path's start; the first pose that comes in, for a saved plan).
        noise: LENGTH, standard deviation of x and y.
        noise_rad: standard deviation of the heading.
        latency: age of a pose when it comes in, or of a picture, in seconds.
        camera: number of a camera over the tank, such as 0, or a film; the track is printed.
        view: the camera's view.toml.
        serial: port of the motor's board, such as /dev/ttyACM0 (default: nothing moves).
        lost_seconds: without a pose after which the motor rests (default: 2).
        show: serve a page to this computer: picture, path, robot, and a button that stops the motor.
    """
    from planner.files.saved_plan import is_plan
    from planner.paths.units import read_length, read_pose
    from planner.progress import plan_bar
    from tracking.pipe import answers
    from tracking.tracker import Tracker
    from tracking.tracks import what_next

    _check_options(noise_rad, latency, lost_seconds)
    if camera is None and (view or serial or lost_seconds or show):
        raise InputError(
            "--view, --serial, --lost-seconds and --show are for --camera, which is missing, such as --camera 0"
        )
    if camera is not None and (view is None or start is not None):
        raise InputError("--camera needs --view view.toml and shows where the robot is; leave --start out")
    if isinstance(sys.stdin, TextIOWrapper):  # a damaged line must not end the tracker
        sys.stdin.reconfigure(errors="replace")
    saved = is_plan(path)
    with redirect_stdout(sys.stderr):
        if saved:
            plan = _saved(path, robot=robot, **plan_path.given)
        elif robot is None:
            raise InputError(f"{path} is no saved plan, so --robot is needed: a robot.toml or a preset")
        else:
            with plan_bar() as progress:
                plan = plan_path(progress=progress, path=path, robot=robot, tell=print)
    unit, scale = plan_path.given.get("unit"), plan.robot.time_scale
    deviations = (read_length(noise, unit, plan.robot, "--noise", above_zero=True), noise_rad)

    def begin(pose: tuple[float, float, float] | None, now: float) -> Tracker:
        return Tracker(plan, noise=deviations, latency=latency / scale, begin=now, start=pose)

    if camera is not None and view is not None:
        _live(plan, camera, view, serial, latency, lost_seconds or 2.0, begin, show=show)
        return
    if start is not None:
        tracker: Tracker | None = begin(read_pose(start, unit, plan.robot, "--start"), 0.0)
    else:
        tracker = None if saved else begin(None, 0.0)
    alarmed = False
    for answer in answers(tracker, sys.stdin, plan.robot, begin):
        print(answer, flush=True)
        alarmed = alarmed or answer.endswith(" 1")
    if alarmed and (line := what_next(plan.to_dict(), "track.csv")):
        to_stderr(f"alarm: the robot does not swim as planned; {line}")


def _check_options(noise_rad: float, latency: float, lost_seconds: float | None) -> None:
    """Refuse numbers that cannot be."""
    if not 0 < noise_rad < math.inf:
        raise InputError(f"--noise-rad {noise_rad}; give a number above 0")
    if not 0 <= latency < math.inf:
        raise InputError(f"--latency {latency}; give a number of seconds, 0 or more")
    if lost_seconds is not None and not 0 < lost_seconds < math.inf:
        raise InputError(f"--lost-seconds {lost_seconds}; give a number above 0")


def _live(
    plan: Plan, source: str, view: str, port: str | None, latency: float, lost: float,
    begin: Callable[[tuple[float, float, float] | None, float], Tracker], *, show: bool,
) -> None:  # fmt: skip
    """Follow a plan with a camera and a motor; print the track."""
    from tracking.live import Motor, Pictures, Ride, Sight, ending_on_signals, steer, watch
    from tracking.live_page import LivePage
    from tracking.printer import Printer
    from tracking.tracks import what_next

    length = plan.robot.length_scale
    page, told, rows = LivePage(plan.reference, length), Printer(sys.stderr), Printer(sys.stdout)

    def row(sight: Sight, direction: int, error: float, alarm: bool, flip_in: float) -> None:
        page.show(sight, direction, error, alarm, flip_in)
        x, y, heading = sight.pose or (math.nan,) * 3
        numbers = f"{100 * length * x:.4f}", f"{100 * length * y:.4f}", f"{math.degrees(heading):.3f}"
        if sight.is_picture:
            bound = f"{100 * length * error:.4f}"
            line = ",".join([f"{sight.time:.4f}", *numbers, f"{direction}", bound, f"{alarm:d}"])
            rows(line.replace("nan", ""))

    def tell(line: str) -> None:
        page.tell(line)
        told(line)

    def see(picture: Any, view: View) -> None:
        if line := page.see(picture, view):
            tell(line)

    sights, ride = watch(source, view, plan.robot.name, length, latency, see), Ride()
    with told, rows, ending_on_signals(), page if show else nullcontext():
        if show:
            told(f"live page: {page.address}")
        motor = Motor(port)
        rows("time_s,x_cm,y_cm,heading_deg,direction,error_cm,alarm")
        try:
            with Pictures(sights) as pictures, motor:  # which stops first
                steer(ride, pictures, motor, begin, plan.robot.time_scale, lost=lost, row=row, tell=tell,
                      stopped=page.stopped.is_set)  # fmt: skip
        finally:
            if page.stopped.is_set():
                tell("stopped on the live page")
            if ride.pictures:
                tell(ride.line())
            if ride.alarms and (line := what_next(plan.to_dict(), "track.csv")):
                tell(line)


def _saved(path: str, *, unit: str | None = None, lookup: str | None = None, own_table: bool = False,
           **planning: Any) -> Plan:  # fmt: skip
    """Make a saved plan again; options of planning are refused beside it."""
    from planner.files.saved_plan import restore_plan

    for name in (name for name, value in planning.items() if value is not None):
        option = f"--{name.replace('_', '-')}"
        raise InputError(f"{option}: {path} is planned already; leave {option} out, or plan again")
    return restore_plan(path, lookup=lookup, own_table=own_table)


@program.command("replay")
def _replay(
    plan: str,
    *,
    robot: RobotSource | None = None,
    out: str | None = None,
    error: bool = True,
    shapes: str | None = None,
    every: float | None = None,
) -> None:
    """Simulate a planned schedule, and compare the track with the plan.

    Args:
        robot: another robot that carries the plan out: a robot.toml or a preset (default: the plan's).
        out: CSV with the track; needed unless --shapes is given.
        error: estimate the error of the track, which takes more than half as long again.
        shapes: the shape of the robot and the forces on it in time: .npz, or .pvd for ParaView.
        every: s between the shapes (default: a 24th of a motor revolution).
    """
    from common.files import write_csv
    from common.progress import progress_bar
    from sim.inputs import load_robot
    from sim.model.schedule import load_schedule, read_plan_file
    from sim.motion.replay import replay, replay_error
    from sim.motion.shape_files import check_name, equal_times, write_shapes
    from sim.motion.shapes import shapes_and_track
    from tracking.tracks import check

    if out is None and shapes is None:
        raise InputError("name a file: --out for the track, or --shapes for the shapes")
    if every is not None and shapes is None:
        raise InputError("--every is the time between shapes; name their file with --shapes")
    planned, swimmer = load_schedule(plan), None if robot is None else load_robot(robot)
    schedule = planned if swimmer is None else planned.swum_by(swimmer)

    def bar(what: str) -> AbstractContextManager[Any]:
        """Show how many dwells are done."""
        return progress_bar(what, total=len(schedule.dwells), unit="dwell")

    if shapes is None:
        with bar("replay") as shown:
            track = replay(schedule, progress=shown.update)
    else:
        check_name(shapes)
        times = equal_times(schedule, every)
        with bar("replay") as shown:
            simulated, track = shapes_and_track(schedule, times, progress=shown.update)
        write_shapes(shapes, simulated, schedule, swimmer)
        print(f"{len(times)} shapes, {format_time(times[-1] * schedule.time_scale)} -> {shapes}")
    if out is None:
        return
    own_error = ""
    if error:
        with bar("on a coarser mesh") as shown:
            size = replay_error(schedule, track, progress=shown.update)
        length = schedule.tail_length
        in_lab = f"{size:.2g} l" if length is None else f"{format_length(size * length)} ({size:.2g} l)"
        own_error = f", the simulator's own error is {in_lab} at most"
    track = planned.in_own_units(track)
    write_csv(track, out)
    end = track.iloc[-1]
    place = f"({end.x_over_l:.3f}, {end.y_over_l:.3f}) l"
    if "x_cm" in track:
        place = f"({end.x_cm:.2f}, {end.y_cm:.2f}) cm = {place}"
    print(f"{len(schedule.dwells)} dwells, {format_time(end.time_s)}, ends at {place}{own_error} -> {out}")
    if "reference" in read_plan_file(plan):  # a schedule alone has no path
        print(check(plan, track).line)


@program.command("check", of="tracking.tracks:check", written_by="from")
def _check(check: Call, plan: str, track: str, *, out: str | None = None) -> None:
    """Compare a replayed or measured track with the declared path and the stated error of its plan.

    A track that misses a part of the path ends it with exit status 3.

    Args:
        out: overlay picture, PNG.
    """
    from planner.files.saved_plan import load_plan
    from tracking.tracks import MissedPathError, what_next, write_overlay

    content = load_plan(plan)
    error = check(plan=content, track=track)
    print(error.line)
    if out is not None:
        write_overlay(out, content, error)
        print(f"-> {out}")
    missed = error.declared_missed > error.stated
    if (missed or error.largest > error.stated) and (line := what_next(content, track, plan, check.given)):
        print(line)
    if missed:
        raise MissedPathError(f"{track} misses a part of the declared path")


if __name__ == "__main__":
    program.exit()
