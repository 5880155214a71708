"""Command line of the calibration: `calibrate`, `decide`, `simulate`, `tracks`."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from pathlib import Path

from common.commands import Call, Program
from common.errors import InputError

program = Program("calibration", "find from measured runs what the model of a robot lacks, and correct it")
main = program.main


def _refuse_early(*files: str) -> None:
    """Refuse a file that is missing before anything that takes seconds to load; a pipe is read once, later."""
    from common.reading import read_bytes

    for file in files:
        if not os.path.exists(file):
            read_bytes(file)


def _to_stderr(line: str) -> None:
    print(line, file=sys.stderr)


@program.command("calibrate", of="calibration.api:calibrate", paths="path", progress="")
def _calibrate(
    calibrate: Call,
    table: str = "",
    *,
    robot: str,
    out: str,
    films: str | None = None,
    view: str | None = None,
    paths: Sequence[str] | None = None,
    no_path: bool = False,
) -> None:
    """Fit a table, find what the model lacks, correct the robot.

    Args:
        table: CSV or Parquet of measured runs; or --films and --view.
        films: TABLE, of runs with their films, in a column film; the measured table goes into the folder.
        view: TOML, scale, lens and markers of the films.
        paths: a path, as for softflagella plan, on which the error is stated before and after (default:
            square:3l).
        no_path: state no error on a path, which takes some seconds, up to two minutes where the parts of the robot
            move in each other's flow or touch.
    """
    if bool(table) == bool(films) or bool(films) != bool(view):
        raise InputError("give a table of runs, or --films runs.csv with --view view.toml")
    if no_path and paths:
        raise InputError("--path and --no-path exclude each other")
    if table:
        _refuse_early(table)
    from calibration.report.robot_verdict import FILES  # loads SciPy
    from common.files import refuse_kept

    refuse_kept(out, ["table.csv", *FILES] if films else FILES)  # before hours of work
    if films and view:
        table = _filmed(films, view, robot, out)
    from calibration.report.path_error import DEFAULT_PATHS
    from calibration.statistics.budget import stopped_by_interrupt
    from calibration.statistics.excluded import summary_of_excluded

    stated = () if no_path else paths or DEFAULT_PATHS
    with stopped_by_interrupt():
        result = calibrate(table=table, robot=robot, paths=stated, tell=_to_stderr)
    files = result.save(out)
    print(result.sentence)
    print(result.errors_in_words)
    for error in result.paths:
        print(error.sentence)
    for limit in result.caveats:
        print(f"the conclusion is weaker: {limit}")
    for line in summary_of_excluded(result.split.outliers, result.rows):
        print(f"excluded: {line}")
    print(f"-> {', '.join(map(str, files))}")


def _filmed(films: str, view: str, robot: str, out: str) -> str:
    """Measure films; write table.csv and return its path."""
    from camera.measured_films import measure_films
    from common.files import make_folder, write_csv
    from sim.inputs import load_robot

    if Path(out).is_file():  # before films are tracked, which takes a while
        raise InputError(f"{out} is a file; give a folder")
    measured = measure_films(films, view, load_robot(robot), tell=_to_stderr)
    for line in (*measured.converted, *(f"excluded: {line}" for line in measured.excluded)):
        _to_stderr(line)
    make_folder(out)
    table = f"{out}/table.csv"
    write_csv(measured.table, table, digits=6)
    return table


@program.command("decide", of="calibration.api:decide", robot="--robot")
def _decide(decide: Call, table: str) -> None:
    _refuse_early(table)
    from calibration.verdict.next_runs import GIVEN_UP

    decision = decide(table=table)
    print(f"{decision.new_runs} new runs. An explanation that is behind by more than {GIVEN_UP:.1f} is given up.")
    for explanation in decision.standings:
        print(f"  {explanation.title}: {f'behind by {explanation.behind:.1f}' if explanation.behind else 'best'}")
    print(decision.sentence)


@program.command("simulate", effects="effect")
def _simulate(
    *, robot: str, out: str, effects: Sequence[str] = (), seed: int = 0, jobs: int | None = None
) -> None:
    """Make a table from the simulator, to try the calibration on.

    Args:
        out: CSV.
        effects: NAME=SIZE, hidden effect.
        seed: of the noise.
    """
    from dataclasses import replace

    from calibration.swimmer.synthetic_table import make_table
    from common.files import write_csv
    from sim.effects import check_effects
    from sim.inputs import load_robot

    given = load_robot(robot)
    hidden = dict(given.effects)
    for entry in effects:
        name, _, size = entry.partition("=")
        try:
            hidden[name] = float(size)
        except ValueError:
            raise InputError(f"--effect {entry!r}; write NAME=SIZE") from None
    check_effects(hidden)
    table = make_table(replace(given, effects=hidden), seed=seed, jobs=jobs)
    write_csv(table, out, digits=6)
    print(f"{len(table)} runs -> {out}")


@program.command("tracks", of="camera.api:tracks", written_by="from")
def _tracks(tracks: Call, runs: str, *, check: str | None = None, out: str) -> None:
    """Turn camera tracks into a table of runs.

    Args:
        out: CSV.
    """
    from common.files import write_csv

    _refuse_early(tracks.given["tracks"], runs)
    table = tracks(runs=runs, check=check)
    for line in table.attrs["converted"]:
        _to_stderr(line)
    write_csv(table, out, digits=6)
    pictures = f", {check}" if check else ""
    print(f"{len(table)} runs -> {out}{pictures}")


if __name__ == "__main__":
    program.exit()
