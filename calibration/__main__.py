"""Command line of the calibration: `calibrate`, `decide`, `laws`, `adopt`, `simulate`, `tracks`."""

from __future__ import annotations

import sys
from argparse import Namespace

from sim.io.commands import JOBS, ROBOT, UNIT, Program, argument, out
from sim.io.errors import InputError

program = Program("calibration", "Find from measured runs what the model of a robot lacks, and correct it.")
main = program.main
_LISTED = 8  # laws


def _refuse_early(*tables: str) -> None:
    """Refuse what is no table before anything that takes seconds to load."""
    from sim.io.tables import read_table

    for table in tables:
        read_table(table)


@program.command(
    "calibrate",
    "fit a table, find what the model lacks, correct the robot",
    argument("table", help="CSV or Parquet of measured runs"),
    ROBOT,
    out("folder"),
    argument("--protocol", choices=("session", "paper"), default="session", help="what is fitted and tested"),
    argument("--seed", type=int, default=0, help="of the bootstrap (default: 0)"),
    argument(
        "--own",
        action="append",
        default=[],
        metavar="COLUMN=VALUES",
        help="what the lab can set in its next runs, such as l_cm=5,7,9; for N, l_cm and omega_rpm",
    ),
    argument("--no-laws", action="store_true", help="do not look for laws that describe the runs"),
    argument(
        "--path",
        action="append",
        metavar="PATH",
        help="a path, as for softflagella plan, on which the error is stated before and after (default: "
        "square:3l); may be given again",
    ),
    UNIT,
    argument(
        "--max-seconds",
        type=float,
        metavar="S",
        help="of processor time for the search; then, or at Ctrl-C, the verdict is provisional and says what was "
        "not tried (default: 90, with laws 180)",
    ),
    argument(
        "--no-path",
        action="store_true",
        help="state no error on a path, which takes some seconds, up to two minutes where the parts of the robot "
        "move in each other's flow or touch",
    ),
    JOBS,
)
def _calibrate(arguments: Namespace) -> None:
    _refuse_early(arguments.table)
    from calibration.report.path_error import DEFAULT_PATHS
    from calibration.report.robot_verdict import calibrate_robot
    from calibration.statistics.budget import stopped_by_interrupt
    from calibration.swimmer.possible_runs import owned
    from sim.inputs import load_robot

    own = owned(arguments.own)
    if arguments.no_path and arguments.path:
        raise InputError("--path and --no-path exclude each other")
    with stopped_by_interrupt():
        result = calibrate_robot(
            arguments.table,
            load_robot(arguments.robot),
            protocol=arguments.protocol,
            own=own,
            laws=not arguments.no_laws,
            paths=() if arguments.no_path else arguments.path or DEFAULT_PATHS,
            unit=arguments.unit,
            seed=arguments.seed,
            max_seconds=arguments.max_seconds,
            jobs=arguments.jobs,
            tell=lambda line: print(line, file=sys.stderr),
        )
    paths = result.save(arguments.out)
    print(result.sentence)
    print(result.errors_in_words)
    for error in result.paths:
        print(error.sentence)
    for limit in result.conditions.caveats:
        print(f"the conclusion is weaker: {limit}")
    for line in result.conditions.summary_of_excluded:
        print(f"excluded: {line}")
    print(f"-> {', '.join(map(str, paths))}")


@program.command(
    "decide",
    "say which of several explanations new runs speak for",
    argument("table", help="the table with the new runs in sessions of their own"),
    argument("verdict", help="verdict.json of the table before"),
    ROBOT,
    JOBS,
)
def _decide(arguments: Namespace) -> None:
    _refuse_early(arguments.table)
    from calibration.laws.law_model import with_law
    from calibration.swimmer.measured_table import read_measurements
    from calibration.swimmer.swimmer import SwimmerModel
    from calibration.verdict.next_runs import GIVEN_UP
    from calibration.verdict.sequential_test import decide, read_explanations
    from sim.inputs import load_robot

    explanations, before = read_explanations(arguments.verdict)
    model = SwimmerModel(load_robot(arguments.robot), read_measurements(arguments.table), arguments.jobs)
    decision = decide(model, explanations, before, with_law)
    print(f"{decision.new_runs} new runs. An explanation that is behind by more than {GIVEN_UP:.1f} is given up.")
    for explanation in decision.standings:
        print(f"  {explanation.title}: {f'behind by {explanation.behind:.1f}' if explanation.behind else 'best'}")
    print(decision.sentence)


@program.command(
    "laws",
    "describe a residual that no effect explains: where a term acts, and on which inputs it depends",
    argument("table", help="CSV or Parquet of measured runs"),
    ROBOT,
    out("folder"),
    argument("--seed", type=int, default=0, help="of the bootstrap (default: 0)"),
    JOBS,
)
def _laws(arguments: Namespace) -> None:
    _refuse_early(arguments.table)
    from calibration.report.robot_laws import find_robot_laws
    from sim.inputs import load_robot

    described = find_robot_laws(
        arguments.table,
        load_robot(arguments.robot),
        seed=arguments.seed,
        jobs=arguments.jobs,
        tell=lambda line: print(line, file=sys.stderr),
    )
    paths = described.save(arguments.out)
    print(described.sentence)
    print(
        f"error on the held-out runs ({described.study.split.names}): calibrated "
        f"{100 * described.error_without:.2f} %, noise {100 * described.noise:.2f} %"
    )
    fitted = described.laws.fitted if described.laws else ()
    for law in fitted[:_LISTED]:
        reason = law.reason or f"error {100 * law.error:.2f} %"
        print(f"  {law.place.name}: {reason}; gain in BIC {law.gain:.0f}")
    if len(fitted) > _LISTED:
        print(f"  and {len(fitted) - _LISTED} others, in laws.json")
    print(f"-> {', '.join(map(str, paths))}")


@program.command(
    "adopt",
    "write a law that describes a table as an effect for the catalogue, with its test",
    argument("verdict", help="verdict.json or laws.json"),
    argument("--name", required=True, help="of the effect, such as speed_dependent_side_force"),
    argument("--law", default="", metavar="PLACE", help="which of the laws that were kept (default: the best)"),
    out("folder"),
)
def _adopt(arguments: Namespace) -> None:
    import sim.effects
    from calibration.report.adoption import adopt_law

    paths = adopt_law(arguments.verdict, arguments.name, arguments.out, place=arguments.law)
    print(f"-> {', '.join(map(str, paths))}")
    print(f"{paths[0].name} belongs in {sim.effects.__path__[0]}; {paths[1].name} tests it there")


@program.command(
    "simulate",
    "make a table from the simulator, to try the calibration on",
    ROBOT,
    out("CSV"),
    argument("--effect", action="append", default=[], metavar="NAME=SIZE", help="hidden effect"),
    argument("--seed", type=int, default=0, help="of the noise (default: 0)"),
    JOBS,
)
def _simulate(arguments: Namespace) -> None:
    from dataclasses import replace

    from calibration.swimmer.synthetic_table import make_table
    from sim.effects import check_effects
    from sim.inputs import load_robot
    from sim.io.files import write_csv

    robot = load_robot(arguments.robot)
    effects = dict(robot.effects)
    for entry in arguments.effect:
        name, _, size = entry.partition("=")
        try:
            effects[name] = float(size)
        except ValueError:
            raise InputError(f"--effect {entry!r}; write NAME=SIZE") from None
    check_effects(effects)
    table = make_table(replace(robot, effects=effects), seed=arguments.seed, jobs=arguments.jobs)
    write_csv(table, arguments.out, digits=6)
    print(f"{len(table)} runs -> {arguments.out}")


@program.command(
    "tracks",
    "turn camera tracks into a table of runs",
    argument(
        "tracks", help="table with run, time_s, x_cm, y_cm, heading_deg, or in other units: x_mm, heading_rad"
    ),
    argument("runs", help="table with run, N, l_cm, omega_rpm and other columns of a measured table"),
    argument("--y-down", action="store_true", help="y and headings are those of a picture, with y downwards"),
    argument(
        "--robot", help="robot.toml or the name of a preset, to compare the tracks with its simulated motion"
    ),
    argument("--check", metavar="PNG", help="draw the fitted circles over the tracks"),
    out("CSV"),
)
def _tracks(arguments: Namespace) -> None:
    _refuse_early(arguments.tracks, arguments.runs)
    from calibration.report.track_pictures import draw_tracks
    from calibration.swimmer.camera_tracks import measure_tracks
    from sim.inputs import load_robot
    from sim.io.files import whole_file, write_csv

    robot = None if arguments.robot is None else load_robot(arguments.robot)
    measured = measure_tracks(arguments.tracks, arguments.runs, y_down=arguments.y_down, robot=robot)
    for line in measured.converted:
        print(line, file=sys.stderr)
    for line in measured.excluded:
        print(f"excluded: {line}", file=sys.stderr)
    write_csv(measured.table, arguments.out, digits=6)
    if arguments.check:
        with whole_file(arguments.check) as part:
            draw_tracks(measured.tracks).savefig(part, format="png", dpi=110)
    pictures = f", {arguments.check}" if arguments.check else ""
    print(f"{len(measured.table)} runs -> {arguments.out}{pictures}")


if __name__ == "__main__":
    program.exit()
