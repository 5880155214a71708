"""Command line of data sets.

python -m dataset build --config sweep.toml --out DIR [--rows N] [--jobs J] [--backend loky|dask|ray]
                        [--scheduler ADDRESS]        simulate; goes on where it stopped
python -m dataset report DIR --out PAGE.html         the sweep at a glance
python -m dataset verify DIR [--rows N] [--mend]     check the files, simulate some rows again; repair
"""

from __future__ import annotations

import os
import shlex
from argparse import Namespace

from dataset.build.exits import ended
from dataset.workers.open_backend import BACKENDS
from sim.io.commands import JOBS, Program, argument, out

program = Program("dataset", "Simulate sweeps of robots into data sets.")
main = program.main
_DATA = argument("data", help="folder or URL of a data set")
_SCHEDULER = "DASK_SCHEDULER_ADDRESS"


@program.command(
    "build",
    "simulate a sweep into Parquet",
    argument("--config", required=True, help="sweep.toml"),
    out("folder, or a URL that fsspec knows (s3://…),"),
    argument("--rows", type=int, help="number of rows (default: the configuration's); more than before adds rows"),
    JOBS,
    argument(
        "--backend",
        choices=BACKENDS,
        help="where to run: loky, this machine's processes; dask; ray (default: loky, or dask with a scheduler)",
    ),
    argument(
        "--scheduler",
        help="address of a dask scheduler (default: DASK_SCHEDULER_ADDRESS) or ray head (default: RAY_ADDRESS)",
    ),
)
def _build(arguments: Namespace) -> None:
    from dataset.build.build import build
    from dataset.rows.design import load_design

    design = load_design(arguments.config).with_rows(arguments.rows)
    known = arguments.scheduler or os.environ.get(_SCHEDULER)
    backend = arguments.backend or ("dask" if known else "loky")
    manifest = ended(
        lambda: build(
            design,
            arguments.out,
            jobs=arguments.jobs,
            backend=backend,
            address=arguments.scheduler,
            resume=_command(arguments),
        )
    )
    print(
        f"{manifest['rows']} rows: {manifest['converged']} converged, {manifest['failed']} failed, "
        f"tails touch in {manifest['touching']} -> {arguments.out}"
    )


def _command(arguments: Namespace) -> str:
    words = ["python", "-m", "dataset", "build"]
    for name in ("config", "out", "rows", "jobs", "backend", "scheduler"):
        if getattr(arguments, name) is not None:
            words += [f"--{name}", str(getattr(arguments, name))]
    return shlex.join(words)


@program.command("report", "the sweep at a glance, one page", _DATA, out("page", default="reports/dataset.html"))
def _report(arguments: Namespace) -> None:
    from dataset.report.report import write_report

    write_report(arguments.data, arguments.out)
    print(f"-> {arguments.out}")


@program.command(
    "verify",
    "check a data set against schema and simulator",
    _DATA,
    argument("--rows", type=int, default=8, help="rows to simulate again (default: 8)"),
    argument("--mend", action="store_true", help="repair first: remove what is damaged, simulate what is missing"),
    JOBS,
)
def _verify(arguments: Namespace) -> None:
    if arguments.mend:
        from dataset.build.build import mend

        print(ended(lambda: mend(arguments.data, jobs=arguments.jobs)))
    from dataset.build.verify import verify

    print(verify(arguments.data, rows=arguments.rows))


if __name__ == "__main__":
    program.exit()
