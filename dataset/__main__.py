"""Command line of data sets: `softflagella sweep`, `report`, `verify`, `config`."""

from __future__ import annotations

import os
import shlex
import threading

from common.changes import ChangedRobot, RobotSource
from common.commands import Call, Program
from common.errors import InputError

program = Program("dataset", "simulate sweeps into data sets, report and verify them")
main = program.main


@program.command("build", of="dataset.api:sweep", resume="")
def _build(sweep: Call, *, out: str, config: str | None = None) -> None:
    """Simulate a sweep into Parquet."""
    from dataset.build import Interrupted

    written = {"config": config, "out": out, **sweep.given, "force": None}
    words = [word for name, value in written.items() if value is not None for word in (f"--{name}", str(value))]
    try:
        manifest = sweep(config=config, out=out, resume=shlex.join(["softflagella", "sweep", *words]))
    except Interrupted as stop:
        emergency = threading.Timer(1.0, os._exit, (stop.status,))  # clusters wait at an ordinary one
        emergency.daemon = True
        emergency.start()
        raise
    print(
        f"{manifest['rows']} rows: {manifest['converged']} converged, {manifest['failed']} failed, "
        f"tails touch in {manifest['touching']} -> {out}"
    )


@program.command("report")
def _report(data: str, *, out: str = "reports/dataset.html") -> None:
    """The sweep at a glance, one page.

    Args:
        out: page.
    """
    from dataset.report import write_report

    write_report(data, out)
    print(f"-> {out}")


@program.command("verify")
def _verify(
    data: str,
    *,
    rows: int = 8,
    mend: bool = False,
    rows_by: str | None = None,
    jobs: int | None = None,
    force: bool = False,
) -> None:
    """Check a data set against schema and simulator.

    Args:
        rows: rows to simulate again.
        mend: repair first: remove damaged files, simulate missing rows.
        rows_by: MODULE.FUNCTION of yours that made the rows, with --mend.
        jobs: processes (default: all processors).
        force: take over a URL whose writer was killed.
    """
    from dataset import build
    from dataset.verify import verify

    if mend:
        named = build.imported_function(rows_by) if rows_by else None
        print(build.mend(data, jobs=jobs, simulate=named, force=force))
    print(verify(data, rows=rows))


@program.command("config")
def _config(*, out: str, robot: RobotSource | None = None) -> None:
    """Write a sweep.toml, to edit.

    Args:
        robot: robot.toml or the name of a preset: sweep around it, in cm and rpm (default: a copy of the sweep
            that comes with the package).
        out: sweep.toml.
    """
    from common.files import write_text
    from dataset.design import SWEEP_TOML
    from dataset.robot_inputs import sweep_toml
    from sim.inputs import load_robot
    from sim.model.presets import PRESETS

    if robot is None:
        text = SWEEP_TOML.read_text()
    elif isinstance(robot, ChangedRobot):
        raise InputError(f"a sweep.toml names the file of its robot, {robot}; change that, not --set")
    else:
        source = robot if robot in PRESETS else os.path.relpath(robot, os.path.dirname(os.path.abspath(out)))
        text = sweep_toml(load_robot(robot), source)
    write_text(out, text)
    print(f"-> {out}")


if __name__ == "__main__":
    program.exit()
