"""Command line of the look-up table.

python -m surrogate train DIR --out MODEL            learn a data set
python -m surrogate query POINTS.csv --out OUT.csv   predict rows, without simulating
python -m surrogate errors [--model MODEL]           the stored held-out errors
python -m surrogate robot ROBOT.toml --out T.json    the table of one robot with its effects, for the planner
"""

from __future__ import annotations

from argparse import Namespace

from sim.io.commands import MODEL, Program, argument, out
from sim.io.errors import InputError

program = Program("surrogate", "Train look-up tables and query them.")
main = program.main


@program.command(
    "train",
    "learn a data set",
    argument("data", help="folder made by python -m dataset build"),
    out("model file"),
    argument("--epochs", type=int, help="at most this many epochs"),
)
def _train(arguments: Namespace) -> None:
    from dataclasses import replace

    from surrogate.evaluate import error_table
    from surrogate.export import save
    from surrogate.train import Settings, train

    settings = Settings()
    if arguments.epochs is not None:
        if arguments.epochs < 1:
            raise InputError(f"--epochs {arguments.epochs}; give a whole number from 1")
        settings = replace(settings, epochs=arguments.epochs)
    lookup = train(arguments.data, settings)
    save(lookup, arguments.out)
    rows = lookup.provenance["rows"]
    print(f"model {lookup.identity}: {rows['train']} rows, held-out error on {rows['held_out']}")
    print(error_table(lookup))
    print(f"-> {arguments.out}")


@program.command(
    "query",
    "predict rows without simulating",
    argument("points", help="CSV like that of python -m sim steady; dwell_bar optional"),
    out("CSV"),
    MODEL,
)
def _query(arguments: Namespace) -> None:
    import pandas as pd

    from sim.io.files import whole_file
    from sim.io.tables import read_table
    from surrogate.export import load_table

    points = read_table(arguments.points)
    result = load_table(arguments.model).query({str(c): points[c].to_numpy() for c in points})
    table = pd.concat([points, pd.DataFrame(result)], axis=1)
    with whole_file(arguments.out) as part:
        table.to_csv(part, index=False, float_format="%.8g")
    print(f"{len(table)} rows -> {arguments.out}")


@program.command("errors", "print the stored held-out errors", MODEL)
def _errors(arguments: Namespace) -> None:
    from surrogate.evaluate import error_table
    from surrogate.export import load

    lookup = load(arguments.model)
    print(f"model {lookup.identity}, trained on data of code {lookup.provenance['data_code_version']}")
    print(error_table(lookup))


@program.command(
    "robot",
    "simulate the table of one robot, effects included",
    argument("robot", help="robot.toml or the name of a preset"),
    out("JSON"),
)
def _robot(arguments: Namespace) -> None:
    from sim.inputs import load_robot
    from surrogate.single import save_single
    from surrogate.tabulate import tabulate

    table = tabulate(load_robot(arguments.robot))
    save_single(table, arguments.out)
    worst = max(error["rms"] for error in table.errors.values())
    print(f"both directions of the motor, largest error {100 * worst:.2f} % -> {arguments.out}")


if __name__ == "__main__":
    program.exit()
