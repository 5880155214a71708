"""Command line of the look-up table: `train`, `query`, `inverse`, `errors`, `robot`, `export`, `compile`."""

from __future__ import annotations

import sys
from argparse import Namespace
from pathlib import Path

from sim.io.commands import MODEL, Program, argument, out
from sim.io.errors import InputError

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

    from sim.io.files import write_text
    from surrogate.networks.checkpoints import device_named, remove_states
    from surrogate.networks.training_loop import Settings
    from surrogate.table.errors import error_table, shortcomings
    from surrogate.table.model_file import save
    from surrogate.training.fit_response import SETTINGS
    from surrogate.training.model_card import model_card
    from surrogate.training.train import held_out, train

    device, states = device_named(arguments.device), f"{arguments.out}.states"
    print(f"trains on the device {device}", flush=True)
    tails, curves = Settings(), SETTINGS
    if arguments.epochs is not None:
        if arguments.epochs < 1:
            raise InputError(f"--epochs {arguments.epochs}; give a whole number from 1")
        tails, curves = (replace(s, epochs=arguments.epochs, iterations=arguments.epochs) for s in (tails, curves))
    lookup = train(arguments.data, tails, curves, device=device, states=states)
    save(lookup, arguments.out)
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
    "predict rows, with intervals, without simulating",
    argument("points", help="CSV like that of softflagella sim steady; dwell_bar optional"),
    out("CSV"),
    MODEL,
    argument(
        "--flag", action="store_true", help="answer outside the domain, too; the column `outside` says where"
    ),
    argument("--certify", action="store_true", help="simulate each row as well: the column `certified_error`"),
)
def _query(arguments: Namespace) -> None:
    import pandas as pd

    from sim.io.files import write_csv
    from sim.io.tables import read_table
    from surrogate.table.lookup import NeuralTable
    from surrogate.table.model_file import load_table

    points = read_table(arguments.points)
    table = load_table(arguments.model)
    columns = {str(c): points[c].to_numpy() for c in points}
    if isinstance(table, NeuralTable):
        result = table.query(columns, intervals=True, flag=arguments.flag, certify=arguments.certify)
    else:
        result = table.query(columns)
    found = pd.concat([points, pd.DataFrame(result)], axis=1)
    write_csv(found, arguments.out)
    print(f"{len(found)} rows -> {arguments.out}")


@program.command(
    "inverse",
    "find robots that have given motions",
    argument("targets", help="CSV: the given inputs of the robots, and outputs that they shall have"),
    out("CSV: a row for each solution"),
    MODEL,
    argument("--free", default="C_t,C_r,C_yr", help="inputs to find, with commas (default: C_t,C_r,C_yr)"),
)
def _inverse(arguments: Namespace) -> None:
    import pandas as pd

    from sim.io.files import write_csv
    from sim.io.tables import read_table
    from sim.motion.steady_motion import STEADY_OUTPUTS
    from surrogate.input_ranges import BOUNDS
    from surrogate.table.inverse import inverse
    from surrogate.table.model_file import load

    points = read_table(arguments.targets)
    names = [name.strip() for name in arguments.free.split(",")]
    for name in names:
        if name not in BOUNDS:
            raise InputError(f"--free {name}; allowed are {', '.join(BOUNDS)}")
    columns = {str(c): points[c].to_numpy() for c in points}
    targets = {name: array for name, array in columns.items() if name in STEADY_OUTPUTS}
    if not targets:
        raise InputError(f"{arguments.targets} has no outputs; give at least one of {', '.join(STEADY_OUTPUTS)}")
    robots = {name: array for name, array in columns.items() if name not in targets}
    found = inverse(load(arguments.model), robots, targets, {name: BOUNDS[name] for name in names})
    table = pd.DataFrame(
        {"target": found.target + 1, **found.inputs, "misfit": found.misfit, "outside": found.outside}
    )
    write_csv(table, arguments.out)
    print(f"{len(table)} solutions of {len(points)} targets -> {arguments.out}")


@program.command("errors", "print the stored held-out errors", MODEL)
def _errors(arguments: Namespace) -> None:
    from surrogate.table.errors import error_table
    from surrogate.table.model_file import load

    lookup = load(arguments.model)
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
    from surrogate.one_robot.robot_table import save_robot_table
    from surrogate.one_robot.tabulate import tabulate

    table = tabulate(load_robot(arguments.robot))
    save_robot_table(table, arguments.out)
    worst = max(error["rms"] for error in table.errors.values())
    print(f"both directions of the motor, largest error {100 * worst:.2f} % -> {arguments.out}")


@program.command(
    "export",
    "write a look-up table for other programs",
    argument("model", nargs="?", help="look-up table (default: the one that comes with the package)"),
    argument("--onnx", metavar="OUT.onnx", help="the whole query as one ONNX graph, in double precision"),
    argument(
        "--small", metavar="FOLDER", help="at most 150 kB, for a web page or a microcontroller, with readers"
    ),
)
def _export(arguments: Namespace) -> None:
    from surrogate.export.onnx_query import save_onnx
    from surrogate.export.small_copy_files import save_small_copy
    from surrogate.table.model_file import load

    if not (arguments.onnx or arguments.small):
        raise InputError("nothing to write; give --onnx OUT.onnx or --small FOLDER")
    table = load(arguments.model)
    if arguments.onnx:
        save_onnx(table, arguments.onnx)
        print(f"model {table.identity}, {Path(arguments.onnx).stat().st_size / 1000:.0f} kB -> {arguments.onnx}")
    if arguments.small:
        print(save_small_copy(table, arguments.small))
        print(f"model {table.identity} -> {arguments.small}")


@program.command("compile", "compile the loops of queries now rather than on first use")
def _compile(_: Namespace) -> None:
    from surrogate.compile_loops import compile_all
    from surrogate.loops import FOLDER

    print(f"loops compiled in {compile_all():.0f} s -> {FOLDER}")


if __name__ == "__main__":
    program.exit()
