"""Command line of the calibration.

python -m calibration close TABLE.csv --robot robot.toml --out DIR    verdict.json, report.html, corrected.toml
python -m calibration simulate --robot robot.toml --out TABLE.csv     a table to try it on
python -m calibration tracks TRACKS.csv RUNS.csv --out TABLE.csv      camera tracks to a table of runs
python -m calibration demo --out PAGE.html                            the whole pipeline, see `make demo`
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

from sim.io.errors import InputError, run_command


def _close(arguments: argparse.Namespace) -> None:
    from calibration.loop import close, verdict_record
    from calibration.measurements import read_measurements
    from calibration.protocols import PROTOCOLS
    from calibration.report import write_report
    from calibration.swimmer import Swimmer, corrected_robot
    from sim.inputs import load_robot, robot_toml
    from sim.io.files import write_text

    robot = load_robot(arguments.robot)
    data = read_measurements(arguments.table)
    for line in data.set_aside:
        print(f"set aside: {line}", file=sys.stderr)
    data, locked = PROTOCOLS[arguments.protocol](data)
    result = close(Swimmer(robot, data, arguments.jobs), locked=locked, seed=arguments.seed)
    out = Path(arguments.out)
    record = verdict_record(result, table=Path(arguments.table).name)
    write_report(result, data, out / "report.html", title=Path(arguments.table).name)
    write_text(out / "corrected.toml", robot_toml(corrected_robot(robot, result.delivered)))
    write_text(out / "verdict.json", json.dumps(record, indent=1) + "\n")
    print(result.sentence)
    print(
        f"error on the locked runs ({result.locked}): as given {100 * result.error_uncalibrated:.2f} %, "
        f"calibrated {100 * result.error_before:.2f} %, with effects {100 * result.error_after:.2f} %, "
        f"noise {100 * result.noise_ceiling:.2f} %"
    )
    for limit in result.limits:
        print(f"a weaker conclusion: {limit}")
    if result.set_aside:
        print(f"set aside: {len(result.set_aside)}, first {result.set_aside[0]}")
    print(f"-> {out / 'verdict.json'}, {out / 'report.html'}, {out / 'corrected.toml'}")


def _simulate(arguments: argparse.Namespace) -> None:
    from dataclasses import replace

    from calibration.synthetic import make_table
    from sim.inputs import load_robot
    from sim.io.files import whole_file

    robot = load_robot(arguments.robot)
    effects = dict(robot.effects)
    for entry in arguments.effect:
        name, _, size = entry.partition("=")
        try:
            effects[name] = float(size)
        except ValueError:
            raise InputError(f"--effect {entry!r}; write NAME=SIZE") from None
    table = make_table(replace(robot, effects=effects), seed=arguments.seed, jobs=arguments.jobs)
    with whole_file(arguments.out) as part:
        table.to_csv(part, index=False, float_format="%.6g")
    print(f"{len(table)} runs -> {arguments.out}")


def _tracks(arguments: argparse.Namespace) -> None:
    from calibration.tracks import measure_tracks
    from sim.io.files import whole_file

    table, aside = measure_tracks(arguments.tracks, arguments.runs)
    for line in aside:
        print(f"set aside: {line}", file=sys.stderr)
    with whole_file(arguments.out) as part:
        table.to_csv(part, index=False, float_format="%.6g")
    print(f"{len(table)} runs -> {arguments.out}")


def _demo(arguments: argparse.Namespace) -> None:
    from calibration.demo import run_demo

    run_demo(arguments.out)


def main(argv: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(prog="python -m calibration", description=__doc__.splitlines()[0])
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    close = commands.add_parser("close", help="fit a table, find what the model lacks, correct the robot")
    close.add_argument("table", help="CSV of measured runs")
    close.add_argument("--robot", required=True, help="robot.toml or the name of a preset")
    close.add_argument("--out", required=True, help="folder to write")
    close.add_argument(
        "--protocol", choices=("session", "paper"), default="session", help="what is fitted and tested"
    )
    close.add_argument("--seed", type=int, default=0, help="of the bootstrap")
    close.add_argument("--jobs", type=int, help="processes (default: all processors)")
    close.set_defaults(run=_close)
    simulate = commands.add_parser("simulate", help="make a table from the simulator")
    simulate.add_argument("--robot", required=True, help="robot.toml or the name of a preset")
    simulate.add_argument("--out", required=True, help="CSV to write")
    simulate.add_argument("--effect", action="append", default=[], metavar="NAME=SIZE", help="hidden effect")
    simulate.add_argument("--seed", type=int, default=0)
    simulate.add_argument("--jobs", type=int, help="processes (default: all processors)")
    simulate.set_defaults(run=_simulate)
    tracks = commands.add_parser("tracks", help="turn camera tracks into a table of runs")
    tracks.add_argument("tracks", help="CSV: run, time_s, x_cm, y_cm, heading_deg")
    tracks.add_argument("runs", help="CSV: run, N, l_cm, omega_rpm and what else was noted")
    tracks.add_argument("--out", required=True, help="CSV to write")
    tracks.set_defaults(run=_tracks)
    demo = commands.add_parser("demo", help="the whole pipeline on the paper's robots")
    demo.add_argument("--out", default="reports/demo.html", help="page to write")
    demo.set_defaults(run=_demo)
    arguments = parser.parse_args(argv)
    arguments.run(arguments)


if __name__ == "__main__":
    sys.exit(run_command(main))
