"""The command that simulates a schedule, and compares the track with the plan."""

from __future__ import annotations

from argparse import Namespace
from typing import Any

from planner.job_commands import Job
from sim.io.commands import ROBOT, argument, out

BAR_AFTER = 1.0  # s


def _replay(arguments: Namespace) -> None:
    from tqdm import tqdm

    from planner.files.plan_json import load_plan
    from planner.files.tracking_error import tracking_error
    from sim.inputs import load_robot
    from sim.io.files import write_csv
    from sim.io.units import format_length, format_time
    from sim.model.plan_file import read_plan_file
    from sim.model.schedule import load_schedule
    from sim.motion.replay import replay, replay_error

    planned = load_schedule(arguments.plan)
    schedule = planned if arguments.robot is None else planned.swum_by(load_robot(arguments.robot))
    shown: Any = {"unit": "dwell", "delay": BAR_AFTER, "disable": None}  # None: shown on a terminal alone
    with tqdm(total=len(schedule.dwells), desc="replay", **shown) as bar:
        track = replay([schedule], progress=bar.update)[0]
    error = ""
    if not arguments.no_error:
        with tqdm(total=len(schedule.dwells), desc="on a coarser mesh", **shown) as bar:
            size = replay_error(schedule, track, progress=bar.update)
        length = schedule.tail_length
        in_lab = f"{size:.2g} l" if length is None else f"{format_length(size * length)} ({size:.2g} l)"
        error = f", the simulator's own error is {in_lab} at most"
    track = planned.in_own_units(track)
    write_csv(track, arguments.out)
    end = track.iloc[-1]
    place = f"({end.x_over_l:.3f}, {end.y_over_l:.3f}) l"
    if "x_cm" in track:
        place = f"({end.x_cm:.2f}, {end.y_cm:.2f}) cm = {place}"
    time = format_time(end.time_s)
    print(f"{len(schedule.dwells)} dwells, {time}, ends at {place}{error} -> {arguments.out}")
    if "reference" in read_plan_file(arguments.plan):  # a schedule alone has no path
        print(tracking_error(load_plan(arguments.plan), track).line)


REPLAY = Job(
    "replay",
    "simulate a planned schedule, and compare the track with the plan",
    _replay,
    (
        argument("plan", help="plan.json"),
        argument(*ROBOT.names, help="another robot that carries the plan out: a robot.toml or a preset (default: "
                 "the plan's)"),
        out("CSV with the track"),
        argument("--no-error", action="store_true",
                 help="do not estimate the error of the track, which takes more than half as long again"),
    ),
)  # fmt: skip
