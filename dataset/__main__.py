"""Command line of data sets.

python -m dataset build --config sweep.toml --out DIR [--rows N] [--jobs J] [--backend loky|dask|ray]
python -m dataset report DIR --out PAGE.html         the sweep at a glance
python -m dataset verify DIR [--rows N]              check the files, simulate some rows again
"""

from __future__ import annotations

from argparse import Namespace

from dataset.backends import BACKENDS
from sim.io.commands import JOBS, Program, argument, out

program = Program("dataset", "Simulate sweeps of robots into data sets.")
main = program.main
_DATA = argument("data", help="folder of a data set")


@program.command(
    "build",
    "simulate a sweep into Parquet",
    argument("--config", required=True, help="sweep.toml"),
    out("folder"),
    argument("--rows", type=int, help="number of rows (default: the configuration's)"),
    JOBS,
    argument("--backend", default="loky", choices=BACKENDS, help="joblib backend (default: loky)"),
)
def _build(arguments: Namespace) -> None:
    from dataset.design import load_design
    from dataset.sweep import build

    design = load_design(arguments.config).with_rows(arguments.rows)
    manifest = build(design, arguments.out, jobs=arguments.jobs, backend=arguments.backend)
    print(
        f"{manifest['rows']} rows: {manifest['converged']} converged, {manifest['failed']} failed, "
        f"tails touch in {manifest['touching']} -> {arguments.out}"
    )


@program.command("report", "the sweep at a glance, one page", _DATA, out("page", default="reports/dataset.html"))
def _report(arguments: Namespace) -> None:
    from dataset.report import write_report

    write_report(arguments.data, arguments.out)
    print(f"-> {arguments.out}")


@program.command(
    "verify",
    "check a data set against schema and simulator",
    _DATA,
    argument("--rows", type=int, default=8, help="rows to simulate again (default: 8)"),
)
def _verify(arguments: Namespace) -> None:
    from dataset.verify import verify

    print(verify(arguments.data, rows=arguments.rows))


if __name__ == "__main__":
    program.exit()
