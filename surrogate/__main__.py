"""Command line of the look-up table.

python -m surrogate train DIR --out MODEL            learn a data set
python -m surrogate query POINTS.csv --out OUT.csv   predict rows, without simulating
python -m surrogate errors [--model MODEL]           the stored held-out errors
python -m surrogate robot ROBOT.toml --out T.json    the table of one robot with its effects, for the planner
"""

from __future__ import annotations

import argparse
import sys

from sim.io.errors import InputError, run_command


def _train(arguments: argparse.Namespace) -> None:
    from dataclasses import replace

    from surrogate.evaluate import error_table
    from surrogate.export import identity, save
    from surrogate.train import Settings, train

    settings = Settings()
    if arguments.epochs is not None:
        if arguments.epochs < 1:
            raise InputError(f"--epochs {arguments.epochs}; give a whole number from 1")
        settings = replace(settings, epochs=arguments.epochs)
    lookup = train(arguments.data, settings)
    save(lookup, arguments.out)
    rows = lookup.provenance["rows"]
    print(f"model {identity(lookup)}: {rows['train']} rows, held-out error on {rows['held_out']}")
    print(error_table(lookup))
    print(f"-> {arguments.out}")


def _query(arguments: argparse.Namespace) -> None:
    import pandas as pd

    from sim.io.files import whole_file
    from sim.io.tables import read_table
    from surrogate.export import load

    points = read_table(arguments.points)
    result = load(arguments.model).query({str(c): points[c].to_numpy() for c in points})
    table = pd.concat([points, pd.DataFrame(result)], axis=1)
    with whole_file(arguments.out) as part:
        table.to_csv(part, index=False, float_format="%.8g")
    print(f"{len(table)} rows -> {arguments.out}")


def _errors(arguments: argparse.Namespace) -> None:
    from surrogate.evaluate import error_table
    from surrogate.export import identity, load

    lookup = load(arguments.model)
    print(f"model {identity(lookup)}, trained on data of code {lookup.provenance['data_code_version']}")
    print(error_table(lookup))


def _robot(arguments: argparse.Namespace) -> None:
    from sim.inputs import load_robot
    from surrogate.single import save_single
    from surrogate.tabulate import tabulate

    table = tabulate(load_robot(arguments.robot))
    save_single(table, arguments.out)
    worst = max(error["rms"] for error in table.errors.values())
    print(f"{len(table.dwells)} dwells, largest error {100 * worst:.2f} % -> {arguments.out}")


def main(argv: list[str] | None = None) -> None:
    from surrogate.export import SHIPPED

    parser = argparse.ArgumentParser(prog="python -m surrogate", description=__doc__.splitlines()[0])
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    train = commands.add_parser("train", help="learn a data set")
    train.add_argument("data", help="folder made by python -m dataset build")
    train.add_argument("--out", required=True, help="model file to write")
    train.add_argument("--epochs", type=int, help="at most this many epochs")
    train.set_defaults(run=_train)
    query = commands.add_parser("query", help="predict rows without simulating")
    query.add_argument("points", help="CSV like that of python -m sim steady; dwell_bar optional")
    query.add_argument("--out", required=True, help="CSV to write")
    query.add_argument("--model", default=SHIPPED, help="model file (default: the shipped one)")
    query.set_defaults(run=_query)
    errors = commands.add_parser("errors", help="print the stored held-out errors")
    errors.add_argument("--model", default=SHIPPED, help="model file (default: the shipped one)")
    errors.set_defaults(run=_errors)
    robot = commands.add_parser("robot", help="simulate the table of one robot")
    robot.add_argument("robot", help="robot.toml or the name of a preset")
    robot.add_argument("--out", required=True, help="JSON to write")
    robot.set_defaults(run=_robot)
    arguments = parser.parse_args(argv)
    arguments.run(arguments)


if __name__ == "__main__":
    sys.exit(run_command(main))
