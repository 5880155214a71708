"""Command line of the look-up table: `train`, `query`, `inverse`, `errors`, `robot`, `export`, `compile`."""

from __future__ import annotations

import sys
from argparse import Namespace
from pathlib import Path

from sim.io.commands import LOOKUP, RUNS_OF, Program, argument, out, refuse_runs_of
from sim.io.errors import InputError, naming

program = Program("surrogate", "Train look-up tables and query them.")
main = program.main


@program.command(
    "train",
    "learn a data set",
    argument("data", nargs="+", help="folders made by softflagella sweep"),
    out("model file"),
    argument("--epochs", type=int, help="this many epochs, and as many iterations after them"),
    argument(
        "--device",
        choices=("cpu", "cuda", "auto"),
        default="cpu",
        help="where to train (default: cpu); auto: on a CUDA device if there is one",
    ),
)
def _train(arguments: Namespace) -> None:
    from dataclasses import replace

    from dataset.data_set import read_manifest
    from sim.io.files import write_text

    if arguments.epochs is not None and arguments.epochs < 1:
        raise InputError(f"--epochs {arguments.epochs}; give a whole number from 1")
    for folder in arguments.data:  # before torch is loaded
        read_manifest(folder)
    from surrogate.networks.checkpoints import device_named, remove_states
    from surrogate.networks.training_loop import Settings
    from surrogate.table.errors import error_table, shortcomings
    from surrogate.training.fit_response import SETTINGS
    from surrogate.training.model_card import model_card
    from surrogate.training.train import held_out, train

    device, states = device_named(arguments.device), f"{arguments.out}.states"
    print(f"trains on the device {device}", flush=True)
    tails, curves = Settings(), SETTINGS
    if arguments.epochs is not None:
        tails, curves = (replace(s, epochs=arguments.epochs, iterations=arguments.epochs) for s in (tails, curves))
    lookup = train(arguments.data, tails, curves, device=device, states=states)
    lookup.save(arguments.out)
    card = Path(arguments.out).with_suffix(".md")
    write_text(card, model_card(lookup, held_out(arguments.data)))
    remove_states(states)
    rows = lookup.provenance["rows"]
    print(f"model {lookup.identity}: {rows['train']} rows, held-out error on {rows['held_out']}")
    print(error_table(lookup.errors))
    for words in shortcomings(lookup.errors):
        print(f"warning: {words}", file=sys.stderr)
    print(f"-> {arguments.out}, {card}")


@program.command(
    "query",
    "predict the motion of a robot, or of many, with intervals, without simulating",
    argument("robot", metavar="ROBOT", help="robot.toml, the name of a preset, or a table of points or runs "
             "like that of softflagella steady, dwell_bar optional"),
    RUNS_OF,
    out("CSV; needed for a table of points", default=None),
    LOOKUP,
    argument(
        "--flag", action="store_true", help="answer outside the domain, too; the column `outside` says where"
    ),
    argument("--certify", action="store_true", help="simulate each row as well: the column `certified_error`"),
)  # fmt: skip
def _query(arguments: Namespace) -> None:
    from sim.inputs import names_robot

    if names_robot(arguments.robot):
        refuse_runs_of(arguments)
        _query_robot(arguments)
    elif arguments.out is None:
        from sim.io.tables import read_table

        read_table(arguments.robot)  # refuses what is no table
        raise InputError(f"{arguments.robot} is a table of points; name the file of the answers with --out")
    else:
        _query_points(arguments)


def _query_robot(arguments: Namespace) -> None:
    """Print the answer for one robot in lab units, beside the dimensionless numbers."""
    from sim.inputs import group_columns, load_robot
    from sim.io.files import write_csv
    from sim.motion.lab_units import describe_motion, lab_motion
    from surrogate.table.answers import answer_with_error
    from surrogate.table.model_file import load_table
    from surrogate.table.refusals import refusing_robots

    robot, table = load_robot(arguments.robot), load_table(arguments.lookup)
    columns = group_columns([robot])
    with refusing_robots([robot], table):
        answer = answer_with_error(table, columns, flag=arguments.flag, certify=arguments.certify)
    print(describe_motion(robot, answer, error="relative error of the look-up table (90 %)"))
    if arguments.certify and "certified_error" in answer:
        print(f"  certified relative error {100 * answer['certified_error'][0]:.2g} %")
    if arguments.flag and answer.get("outside", [False])[0]:
        print("note: the robot is outside the domain of the look-up table", file=sys.stderr)
    if arguments.out:
        import pandas as pd

        rows = pd.DataFrame({"robot": [robot.name], **lab_motion([robot], answer), **answer})
        write_csv(rows, arguments.out)
        print(f"-> {arguments.out}")


def _query_points(arguments: Namespace) -> None:
    """Answer for every row of a table."""
    import pandas as pd

    from sim.inputs import point_columns
    from sim.io.files import write_csv
    from sim.io.tables import read_table
    from sim.motion.lab_units import lab_motion
    from surrogate.table.lookup import NeuralTable
    from surrogate.table.model_file import load_table

    points = read_table(arguments.robot)
    table = load_table(arguments.lookup)
    with naming(arguments.robot):
        robots, columns = point_columns(points, arguments.runs_of, arguments.robot)
        if isinstance(table, NeuralTable):
            result = table.query(columns, intervals=True, flag=arguments.flag, certify=arguments.certify)
        else:
            result = table.query(columns)
    if robots:
        result = {**lab_motion(robots, result), **result}
    kept = points.drop(columns=[name for name in result if name in points]).reset_index(drop=True)
    answers = pd.concat([kept, pd.DataFrame(result)], axis=1)
    write_csv(answers, arguments.out)
    print(f"{len(answers)} rows -> {arguments.out}")


@program.command(
    "inverse",
    "find robots that have given motions",
    argument("targets", help="CSV: the given inputs of the robots, and outputs that they shall have"),
    out("CSV: a row for each solution"),
    LOOKUP,
    argument("--free", default="C_t,C_r,C_yr", help="inputs to find, with commas (default: C_t,C_r,C_yr)"),
)
def _inverse(arguments: Namespace) -> None:
    from sim.io.files import write_csv
    from sim.io.tables import read_table
    from surrogate.table.inverse import inverse_table
    from surrogate.table.model_file import load

    points = read_table(arguments.targets)
    names = [name.strip() for name in arguments.free.split(",")]
    with naming(arguments.targets):
        table = inverse_table(load(arguments.lookup), points, names, where=arguments.targets)
    write_csv(table, arguments.out)
    print(f"solutions: {len(table)}, targets: {len(points)} -> {arguments.out}")


@program.command("errors", "print the stored held-out errors", LOOKUP)
def _errors(arguments: Namespace) -> None:
    from surrogate.table.errors import error_table
    from surrogate.table.model_file import load

    lookup = load(arguments.lookup)
    rows = lookup.provenance["rows"]
    print(f"model {lookup.identity}: {rows['train']} rows, held-out error on {rows['held_out']}")
    print(error_table(lookup.errors))


@program.command(
    "robot",
    "simulate the table of one robot, effects included",
    argument("robot", help="robot.toml or the name of a preset"),
    out("JSON"),
)
def _robot(arguments: Namespace) -> None:
    from sim.inputs import load_robot
    from surrogate.one_robot.tabulate import tabulate

    table = tabulate(load_robot(arguments.robot))
    table.save(arguments.out)
    worst = max(error["rms"] for error in table.errors.values())
    print(f"both directions of the motor, largest error {100 * worst:.2f} % -> {arguments.out}")


@program.command(
    "export",
    "write a look-up table for other programs",
    argument("model", nargs="?", help="look-up table (default: the one that comes with the package)"),
    argument("--onnx", metavar="OUT.onnx", help="no longer written; use --small"),
    argument("--small", metavar="FOLDER", help="at most 150 kB, for a microcontroller, with a reader in C"),
)
def _export(arguments: Namespace) -> None:
    from surrogate.export.small_copy_files import save_small_copy
    from surrogate.table.model_file import load

    if arguments.onnx:
        raise InputError("ONNX files are no longer written; give --small FOLDER for a reader in C")
    if not arguments.small:
        raise InputError("nothing to write; give --small FOLDER")
    table = load(arguments.model)
    print(save_small_copy(table, arguments.small))
    print(f"model {table.identity} -> {arguments.small}")


@program.command("compile", "compile the loops of queries now rather than on first use")
def _compile(_: Namespace) -> None:
    from time import perf_counter

    import numpy as np

    from sim.inputs import group_columns
    from sim.model.presets import PRESETS
    from surrogate.networks.loops import FOLDER
    from surrogate.table.model_file import load

    began = perf_counter()
    robot = group_columns([PRESETS["paper-control"]])
    load().query({**robot, "dwell_bar": np.ones(1)}, intervals=True)
    print(f"loops compiled in {perf_counter() - began:.0f} s -> {FOLDER}")


if __name__ == "__main__":
    program.exit()
