"""Command line of the simulator: `steady`, `film`, `check`, `compile`."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from common.changes import RobotSource
from common.commands import Call, Program
from common.errors import InputError

if TYPE_CHECKING:
    from sim.model.robot import Robot
    from sim.robot_rows import RobotRows

program = Program("sim", "simulate robots: steady motion, films")
main = program.main


@program.command("steady", of="sim.api:steady")
def _steady(
    steady: Call,
    robots: RobotSource,
    *,
    robot: RobotSource | None = None,
    out: str | None = None,
    shapes: str | None = None,
    vary: Sequence[str] = (),
    plot: str | None = None,
) -> None:
    """Mean motion of a robot, or of many, at constant motor speed.

    Args:
        robots: robot.toml, the name of a preset, or a table of points: CSV with
            C_t,C_r,C_yr,l_over_R,L_over_R,l_over_r0,omega_bar,N,…, or, with --robot, runs: N,l_cm,omega_rpm.
        out: CSV with the same rows and their motion; needed for a table of points. Until it is there, OUT.journal
            keeps the rows that are done, with which the same command goes on.
        shapes: of one robot, its shape and the forces on it in a turn of the disc: .npz, or .pvd for ParaView.
        vary: KEY=VALUES, a number of one robot: motor.speed_rpm=20:120:11, drag.C_t=1:8:9log, or a list; a second
            one makes a family of curves.
        plot: SVG, PNG or PDF, of what is varied, with a CSV of the same name beside.
    """
    from sim.motion.batches import steady_columns
    from sim.robot_rows import command_rows

    if vary or plot:
        from sim.variations import write_variations

        if robot or shapes:
            raise InputError("--vary and --plot are for one robot, without --robot and --shapes")
        return write_variations(robots, vary, lambda rows: steady_columns(rows.columns, **steady.given), out, plot)
    rows = command_rows(robots, robot, out)
    if shapes is not None:
        _write_steady_shapes(rows.robots, shapes)
    with rows.journal(out, {**steady.given, "jobs": None}) as kept:
        with rows.naming():
            motion = steady_columns(rows.columns, kept=kept, **steady.given)
        _write_motion(rows, motion, out)


def _write_motion(rows: RobotRows, motion: dict[str, Any], out: str | None) -> None:
    """Say and write what was simulated."""
    import numpy as np

    from sim.motion.steady_motion import describe_motion
    from sim.robot_rows import write_motion

    if not np.isfinite(motion["v_z"]).any():
        which = f"none of the {len(motion['note'])} robots" if rows.file else rows.robots[0].name
        raise InputError(f"{which}: no steady motion was found: {motion['note'][0]}")
    if rows.file:
        said = _counts(rows.columns, motion)
    else:
        said = describe_motion(rows.robots[0], motion)
        if motion["note"][0]:
            print(f"note: {motion['note'][0]}", file=sys.stderr)
    write_motion(rows, motion, out, said)


def _write_steady_shapes(robots: Sequence[Robot], path: str) -> None:
    """Write the shapes of one robot."""
    from sim.motion.shape_files import check_name, write_shapes
    from sim.motion.shapes import steady_shapes

    check_name(path)
    if len(robots) != 1:
        raise InputError("--shapes goes with one robot; give a robot.toml or the name of a preset")
    shapes = steady_shapes(robots[0])
    write_shapes(path, shapes, robot=robots[0])
    print(f"{len(shapes.times)} shapes -> {path}")


def _counts(robots: dict[str, Any], motion: dict[str, Any]) -> str:
    """Count the rows that converged, those whose tails touch, and those with a large error."""
    from sim.effects.tail_contact import EFFECT as CONTACT
    from sim.effects.tail_contact import least_gap
    from sim.motion.steady_motion import LARGE_ERROR

    wrong = int((motion["error"] > LARGE_ERROR).sum())
    beside = f"; do not rely on the {wrong} whose error is above {100 * LARGE_ERROR:.0f} %" if wrong else ""
    touching = int((motion["tail_gap"] < least_gap(robots.get(CONTACT.name, 0.0))).sum())
    direct, ended = int((motion["method"] == "direct").sum()), motion["converged"]
    converged = f"{len(ended)} rows, {int(ended.sum())} converged ({direct} solved directly)"
    return f"{converged}, tails touch in {touching}{beside}"


@program.command("effects")
def _effects() -> None:
    """List the effects that the base model leaves out: name, size, unit, what it is, and its inputs."""
    from importlib import import_module

    from sim.effects import catalogue

    print(f"{'name':22} {'size':>6} {'unit':32} what it is; the size is one that is often met")
    for name, effect in catalogue().items():
        sentence = str(import_module(f"sim.effects.{name}").__doc__).splitlines()[0]
        print(f"{name:22} {effect.typical:>6g} {effect.unit:32} {sentence}")
        for driver in effect.drivers:
            print(f"{'':22} {driver.typical:>6g} {driver.unit:32} times {driver.column}, a column of runs")
        if effect.beside:
            print(f"{'':62} it shows only beside {effect.beside}")


@program.command("film")
def _film(plan: str, *, out: str, speed: float | None = None, width: int = 640) -> None:
    """Film of a plan: the robot from above with its bent tails, simulated.

    Args:
        out: the film: .gif, .webp, or .mp4 where ffmpeg is installed.
        speed: how many times faster than the robot (default: so that the film takes about 15 s).
        width: pixels.
    """
    from common.progress import progress_bar
    from sim.model.schedule import load_schedule, read_plan_file
    from sim.pictures.film import FilmSettings, fitting_speed, write_film

    if not 100 <= width <= 2000:
        raise InputError(f"--width {width}; give 100 to 2000 pixels")
    schedule = load_schedule(plan)
    film = FilmSettings(speed or fitting_speed(schedule), width=width)
    with progress_bar("simulating", total=len(schedule.dwells), unit="dwell") as bar:
        count = write_film(read_plan_file(plan), schedule, out, film, progress=bar.update)
    print(f"{count} pictures at {film.speed:g} times the robot's speed -> {out}")


@program.command("check")
def _check() -> None:
    """The paper's measured point, measured and simulated."""
    from sim.model.presets import PRESETS
    from sim.motion.steady import steady

    motion = steady(PRESETS["paper-measured"].groups())
    share = float(motion.omega_h[0] / (motion.omega_h[0] - motion.omega_t[0]))
    print("N = 4, l = 11 cm, motor at 143.66 rpm: head's share of the motor speed, omega_h/omega")
    print("  measured in the paper       0.441")
    print(f"  this simulator, its fit     {share:.3f}")


@program.command("compile")
def _compile() -> None:
    """Compile the simulator's loops now rather than on first use."""
    from sim.jit import CACHE
    from sim.motion.warm import compile_all

    print(f"loops compiled in {compile_all():.0f} s -> {CACHE}")


if __name__ == "__main__":
    program.exit()
