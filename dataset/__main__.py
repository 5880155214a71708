"""Command line of data sets.

python -m dataset build --config sweep.toml --out DIR [--rows N] [--jobs J] [--backend loky|dask|ray]
python -m dataset report DIR --out PAGE.html         the sweep at a glance
python -m dataset verify DIR [--rows N]              check the files, simulate some rows again
"""

from __future__ import annotations

import argparse
import sys

from sim.io.errors import run_command


def _build(arguments: argparse.Namespace) -> None:
    from dataset.design import load_design
    from dataset.sweep import build

    design = load_design(arguments.config).with_rows(arguments.rows)
    manifest = build(design, arguments.out, jobs=arguments.jobs, backend=arguments.backend)
    print(
        f"{manifest['rows']} rows: {manifest['converged']} converged, {manifest['failed']} failed, "
        f"tails touch in {manifest['touching']} -> {arguments.out}"
    )


def _report(arguments: argparse.Namespace) -> None:
    from dataset.report import write_report

    write_report(arguments.data, arguments.out)
    print(f"-> {arguments.out}")


def _verify(arguments: argparse.Namespace) -> None:
    from dataset.verify import verify

    print(verify(arguments.data, rows=arguments.rows))


def main(argv: list[str] | None = None) -> None:
    from dataset.sweep import BACKENDS

    parser = argparse.ArgumentParser(prog="python -m dataset", description=__doc__.splitlines()[0])
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    build = commands.add_parser("build", help="simulate a sweep into Parquet")
    build.add_argument("--config", required=True, help="sweep.toml")
    build.add_argument("--out", required=True, help="folder to write")
    build.add_argument("--rows", type=int, help="number of rows (default: the configuration's)")
    build.add_argument("--jobs", type=int, help="processes (default: all processors)")
    build.add_argument("--backend", default="loky", choices=BACKENDS, help="joblib backend")
    build.set_defaults(run=_build)
    report = commands.add_parser("report", help="the sweep at a glance, one page")
    report.add_argument("data", help="folder of a data set")
    report.add_argument("--out", default="reports/dataset.html", help="page to write")
    report.set_defaults(run=_report)
    verify = commands.add_parser("verify", help="check a data set against schema and simulator")
    verify.add_argument("data", help="folder of a data set")
    verify.add_argument("--rows", type=int, default=8, help="rows to simulate again")
    verify.set_defaults(run=_verify)
    arguments = parser.parse_args(argv)
    arguments.run(arguments)


if __name__ == "__main__":
    sys.exit(run_command(main))
