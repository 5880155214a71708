"""Command line of the simulator: `steady`, `branches`, `film`, `robot`, `check`, `compile`."""

from __future__ import annotations

import sys
from argparse import Namespace
from pathlib import Path

from sim.io.commands import JOBS, RUNS_OF, Program, argument, out, refuse_runs_of
from sim.io.errors import InputError, naming
from sim.model.sweepable import SWEEPABLE, read_range

program = Program("sim", "Simulate swimming robots.")
main = program.main


@program.command(
    "steady",
    "mean motion of a robot, or of many, at constant motor speed",
    argument("robot", metavar="ROBOT", help="robot.toml, the name of a preset, or a table of points: CSV with "
             "C_t,C_r,C_yr,l_over_R,L_over_R,l_over_r0,omega_bar,N,…, or, with --robot, runs: N,l_cm,omega_rpm"),
    RUNS_OF,
    out("CSV with the same rows and their motion; needed for a table of points", default=None),
    argument("--no-stability", action="store_true",
             help="do not compute whether small perturbations decay, which adds a quarter to the time"),
    JOBS,
)  # fmt: skip
def _steady(arguments: Namespace) -> None:
    from sim.inputs import names_robot

    if names_robot(arguments.robot):
        refuse_runs_of(arguments)
        _steady_robot(arguments)
    elif arguments.out is None:
        from sim.io.tables import read_table

        read_table(arguments.robot)  # refuses what is no table
        raise InputError(f"{arguments.robot} is a table of points; name the file of their motion with --out")
    else:
        _steady_points(arguments)


def _steady_robot(arguments: Namespace) -> None:
    """Print the motion of one robot in lab units, beside the dimensionless numbers."""
    from sim.inputs import group_columns, load_robot
    from sim.io.files import write_csv
    from sim.motion.batches import steady_columns
    from sim.motion.lab_units import describe_motion, lab_motion

    robot = load_robot(arguments.robot)
    columns = group_columns([robot])
    stability = not arguments.no_stability
    motion = steady_columns(columns, stability=stability, jobs=arguments.jobs, title="")
    print(describe_motion(robot, motion))
    if motion["note"][0]:
        print(f"note: {motion['note'][0]}", file=sys.stderr)
    if arguments.out:
        import pandas as pd

        table = pd.DataFrame({"robot": [robot.name], **lab_motion([robot], motion), **motion})
        write_csv(table, arguments.out)
        print(f"-> {arguments.out}")


def _steady_points(arguments: Namespace) -> None:
    """Simulate every row of a table."""
    import numpy as np
    import pandas as pd

    from sim.effects.tail_contact import EFFECT as CONTACT
    from sim.effects.tail_contact import least_gap
    from sim.inputs import point_columns
    from sim.io.files import write_csv
    from sim.io.tables import read_table
    from sim.motion.batches import steady_columns
    from sim.motion.lab_units import LAB_COLUMNS, lab_motion
    from sim.motion.steady_motion import QUALITY_COLUMNS, STEADY_COLUMNS

    points = read_table(arguments.robot)
    lab = () if arguments.runs_of is None else LAB_COLUMNS
    replaced = [name for name in (*lab, *STEADY_COLUMNS, *QUALITY_COLUMNS) if name in points]
    if replaced:
        print(
            f"note: these columns of the input are replaced by new results: {', '.join(replaced)}", file=sys.stderr
        )
        points = points.drop(columns=replaced)
    with naming(arguments.robot):
        robots, columns = point_columns(points, arguments.runs_of, arguments.robot)
        motion = steady_columns(columns, stability=not arguments.no_stability, jobs=arguments.jobs)
    result = {**lab_motion(robots, motion), **motion} if robots else motion
    table = pd.concat([points.reset_index(drop=True), pd.DataFrame(result)], axis=1)
    write_csv(table, arguments.out)
    ended = table["converged"].to_numpy()
    touching = int(np.count_nonzero(table["tail_gap"] < least_gap(columns.get(CONTACT.name, 0.0))))
    direct = int(np.count_nonzero(table["method"] == "direct"))
    print(
        f"{len(table)} rows, {int(ended.sum())} converged ({direct} solved directly), "
        f"tails touch in {touching} -> {arguments.out}"
    )


@program.command(
    "branches",
    "all steady motions along an input: folds, Hopf points, stability, hysteresis; where LOW is negative, write "
    "--INPUT=LOW:HIGH",
    argument("robot", metavar="ROBOT", help="robot.toml or the name of a preset"),
    argument("--speed", metavar="LOW:HIGH", help="sweep the motor's speed [rpm], such as 20:200"),
    *(argument(f"--{name}", metavar="LOW:HIGH", help=f"sweep {what}")
      for name, what in SWEEPABLE.items()),
    argument("--steps", type=int, default=24, help="values in a slow sweep by time steps (default: 24)"),
    out("folder, or the name of a page, FILE.html (default: branches)", default="branches"),
)  # fmt: skip
def _branches(arguments: Namespace) -> None:
    given = [name for name in ("speed", *SWEEPABLE) if getattr(arguments, name) is not None]
    if len(given) != 1:
        what = "no range is given" if not given else f"ranges of {' and '.join(given)} are given"
        raise InputError(f"{what}; give the range of one input, such as --speed 20:200")
    low, high = read_range(given[0], getattr(arguments, given[0]))
    from sim.compile_stages import saying_first_use
    from sim.compiling import CACHE
    from sim.inputs import load_robot
    from sim.motion.batches import one_thread
    from sim.motion.branch_report import special_rows, summary, write_branches
    from sim.motion.branches import find_branches
    from sim.motion.swept_input import SweptInput

    swept = SweptInput(load_robot(arguments.robot), given[0], low, high)
    with one_thread(), saying_first_use("sim", CACHE):
        result = find_branches(
            swept, steps=arguments.steps, progress=lambda line: print(line, file=sys.stderr, flush=True)
        )
    files = write_branches(result, arguments.out)
    print(summary(result))
    for branch, kind, value, yaw, _ in special_rows(result):
        print(f"  branch {branch}: {kind} at {swept.column} = {value}, yaw rate {yaw}")
    print(f"-> {', '.join(map(str, files))}")


@program.command("effects", "list the effects that the base model leaves out, a sentence each")
def _effects(arguments: Namespace) -> None:
    from importlib import import_module

    from sim.effects import catalogue

    for name in catalogue():
        sentence = str(import_module(f"sim.effects.{name}").__doc__).splitlines()[0]
        print(f"{name:22} {sentence}")


@program.command(
    "film",
    "film of a plan: the robot from above with its bent tails, simulated",
    argument("plan", help="plan.json"),
    out("the film: .gif, .webp, or .mp4 where ffmpeg is installed"),
    argument("--speed", type=float,
             help="how many times faster than the robot (default: so that the film takes about 15 s)"),
    argument("--width", type=int, default=640, help="pixels (default: 640)"),
)  # fmt: skip
def _film(arguments: Namespace) -> None:
    from tqdm import tqdm

    from sim.model.plan_file import read_plan_file
    from sim.model.schedule import load_schedule
    from sim.motion.film import Film, fitting_speed, write_film

    if not 100 <= arguments.width <= 2000:
        raise InputError(f"--width {arguments.width}; give 100 to 2000 pixels")
    schedule = load_schedule(arguments.plan)
    film = Film(arguments.speed or fitting_speed(schedule), width=arguments.width)
    with tqdm(total=len(schedule.dwells), desc="simulating", unit="dwell", delay=1.0) as bar:
        count = write_film(read_plan_file(arguments.plan), schedule, arguments.out, film, progress=bar.update)
    print(f"{count} pictures at {film.speed:g} times the robot's speed -> {arguments.out}")


@program.command(
    "robot",
    "write a preset robot as TOML, to start from",
    argument("preset", help="paper-control, paper-triangle or paper-measured"),
    out("robot.toml"),
)
def _robot(arguments: Namespace) -> None:
    from sim.io.files import write_text
    from sim.model.presets import PRESETS
    from sim.model.robot_toml import robot_toml

    if arguments.preset not in PRESETS:
        raise InputError(f"no preset {arguments.preset!r}; there are {', '.join(PRESETS)}")
    write_text(arguments.out, robot_toml(PRESETS[arguments.preset]))
    print(f"{arguments.preset} -> {Path(arguments.out)}")


@program.command("check", "the paper's measured point, measured and simulated")
def _check(_: Namespace) -> None:
    from sim.model.presets import PRESETS
    from sim.motion.steady import steady

    motion = steady(PRESETS["paper-measured"].groups())
    share = float(motion.omega_h[0] / (motion.omega_h[0] - motion.omega_t[0]))
    print("N = 4, l = 11 cm, motor at 143.66 rpm: head's share of the motor speed, omega_h/omega")
    print("  measured in the paper       0.441")
    print(f"  this simulator, its fit     {share:.3f}")


@program.command("compile", "compile the simulator's loops now rather than on first use")
def _compile(_: Namespace) -> None:
    from sim.compiling import CACHE
    from sim.motion.warm import compile_all

    print(f"loops compiled in {compile_all():.0f} s -> {CACHE}")


if __name__ == "__main__":
    program.exit()
