"""Command line of data sets: `softflagella sweep`, `report`, `verify`, `config`."""

from __future__ import annotations

import os
import shlex
import threading
from argparse import Namespace

from sim.io.commands import JOBS, Program, argument, out

program = Program("dataset", "Simulate sweeps of robots into data sets.")
main = program.main
_DATA = argument("data", help="folder or URL of a data set")
_SCHEDULER = "DASK_SCHEDULER_ADDRESS"
_FORCE = argument("--force", action="store_true", help="take over a URL whose writer was killed")


@program.command(
    "build",
    "simulate a sweep into Parquet",
    argument("--config", help="sweep.toml (default: the one that comes with the package)"),
    out("folder, or a URL that fsspec knows (s3://…),"),
    argument("--rows", type=int, help="number of rows (default: the configuration's); more than before adds rows"),
    JOBS,
    argument("--backend", choices=("local", "dask", "ray"),
             type=lambda name: "local" if name == "loky" else name,  # its name of the last release
             help="where to run: processes here, dask or ray (default: local, or dask with a scheduler)"),
    argument("--scheduler", help="address of a dask scheduler (default: DASK_SCHEDULER_ADDRESS) or ray head "
             "(default: RAY_ADDRESS)"),
    _FORCE,
)  # fmt: skip
def _build(arguments: Namespace) -> None:
    from dataset.build import Interrupted, build
    from dataset.design import SWEEP_TOML, load_design

    design = load_design(arguments.config or SWEEP_TOML).with_rows(arguments.rows)
    known = arguments.scheduler or os.environ.get(_SCHEDULER)
    backend = arguments.backend or ("dask" if known else "local")
    where = {"jobs": arguments.jobs, "backend": backend, "address": arguments.scheduler}
    try:
        manifest = build(design, arguments.out, resume=_command(arguments), force=arguments.force, **where)
    except Interrupted as stop:
        emergency = threading.Timer(1.0, os._exit, (stop.status,))  # clusters wait at an ordinary one
        emergency.daemon = True
        emergency.start()
        raise
    print(
        f"{manifest['rows']} rows: {manifest['converged']} converged, {manifest['failed']} failed, "
        f"tails touch in {manifest['touching']} -> {arguments.out}"
    )


def _command(arguments: Namespace) -> str:
    """Write the command that continues a build."""
    words = ["softflagella", "sweep"]
    for name in ("config", "out", "rows", "jobs", "backend", "scheduler"):
        if getattr(arguments, name) is not None:
            words += [f"--{name}", str(getattr(arguments, name))]
    return shlex.join(words)


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
    argument("--mend", action="store_true", help="repair first: remove damaged files, simulate missing rows"),
    argument("--rows-by", metavar="MODULE.FUNCTION", help="with --mend: the function of yours that made the rows"),
    JOBS,
    _FORCE,
)
def _verify(arguments: Namespace) -> None:
    from dataset.build import imported_function, mend
    from dataset.verify import verify

    if arguments.mend:
        named = imported_function(arguments.rows_by) if arguments.rows_by else None
        print(mend(arguments.data, jobs=arguments.jobs, simulate=named, force=arguments.force))
    print(verify(arguments.data, rows=arguments.rows))


@program.command(
    "config",
    "write a sweep.toml, to edit",
    argument("--robot", help="robot.toml or the name of a preset: sweep around it, in cm and rpm "
             "(default: a copy of the sweep that comes with the package)"),
    out("sweep.toml"),
)  # fmt: skip
def _config(arguments: Namespace) -> None:
    from dataset.design import SWEEP_TOML
    from dataset.robot_inputs import sweep_toml
    from sim.inputs import load_robot
    from sim.io.files import write_text
    from sim.model.presets import PRESETS

    if arguments.robot is None:
        text = SWEEP_TOML.read_text()
    else:
        source = arguments.robot
        if source not in PRESETS:
            source = os.path.relpath(source, os.path.dirname(os.path.abspath(arguments.out)))
        text = sweep_toml(load_robot(arguments.robot), source)
    write_text(arguments.out, text)
    print(f"-> {arguments.out}")


if __name__ == "__main__":
    program.exit()
