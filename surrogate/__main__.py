"""Command line of the look-up table: `train`, `query`, `inverse`, `errors`, `robot`."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Literal

from common.changes import RobotSource
from common.commands import Call, Program
from common.errors import InputError

program = Program("surrogate", "train look-up tables and query them")
main = program.main


@program.command("train")
def _train(
    data: Sequence[str], *, out: str, epochs: int | None = None, device: Literal["cpu", "cuda", "auto"] = "cpu"
) -> None:
    """Learn a data set.

    Args:
        data: folders made by softflagella sweep.
        out: model file.
        epochs: this many epochs, and as many iterations after them.
        device: where to train; auto: on a CUDA device if there is one.
    """
    from dataclasses import replace

    from common.files import write_text
    from dataset.data_set import read_manifest

    if epochs is not None and epochs < 1:
        raise InputError(f"--epochs {epochs}; give a whole number from 1")
    for folder in data:  # before torch is loaded
        read_manifest(folder)
    from surrogate.held_out import shortcomings
    from surrogate.training.fits import CURVES
    from surrogate.training.model_card import model_card
    from surrogate.training.networks import Settings, device_named, remove_states
    from surrogate.training.train import held_out, train

    trained_on, states = device_named(device), f"{out}.states"
    print(f"trains on the device {trained_on}", flush=True)
    tails, curves = Settings(), CURVES
    if epochs is not None:
        tails, curves = (replace(s, epochs=epochs, iterations=epochs) for s in (tails, curves))
    lookup = train(data, tails, curves, device=trained_on, states=states)
    lookup.save(out)
    card = Path(out).with_suffix(".md")
    write_text(card, model_card(lookup, held_out(data)))
    remove_states(states)
    _errors(lookup=out)
    for words in shortcomings(lookup.errors):
        print(f"warning: {words}", file=sys.stderr)
    print(f"-> {out}, {card}")


@program.command("query", of="surrogate.api:query", derivatives="")
def _query(
    query: Call,
    robots: RobotSource,
    *,
    robot: RobotSource | None = None,
    out: str | None = None,
    lookup: str | None = None,
) -> None:
    """Predict the motion of a robot, or of many, with intervals, without simulating.

    Args:
        robots: robot.toml, the name of a preset, or a table of points or runs like that of softflagella steady,
            dwell_bar optional.
        robot: of a table of runs, N,l_cm,omega_rpm: robot.toml or the name of a preset.
        out: CSV; needed for a table of points.
    """
    from sim.model.groups import DWELL
    from sim.motion.steady_motion import describe_motion
    from sim.robot_rows import command_rows, write_motion
    from surrogate.answers import answer_rows
    from surrogate.interface import NOTE
    from surrogate.table_file import load_table

    rows = command_rows(robots, robot, out, DWELL)
    answer = answer_rows(rows, load_table(lookup), **query.given)
    outside = sum(map(bool, answer.get(NOTE, ())))
    if outside and len(answer[NOTE]) > 1:
        print(
            f"note: {outside} of {len(answer[NOTE])} robots are outside the look-up table: see the column {NOTE}",
            file=sys.stderr,
        )
    if rows.file:
        return write_motion(rows, answer, out, f"{len(answer['v_z'])} rows")
    said = describe_motion(rows.robots[0], answer, error="relative error of the look-up table (90 %)")
    if "certified_error" in answer:
        said += f"\n  certified relative error {100 * answer['certified_error'][0]:.2g} %"
    if answer.get("outside", [False])[0]:
        print("note: the robot is outside the domain of the look-up table", file=sys.stderr)
    write_motion(rows, answer, out, said)


@program.command("inverse", of="surrogate.api:inverse")
def _inverse(inverse: Call, *, out: str) -> None:
    """Find robots that have given motions.

    Args:
        out: CSV: a row for each solution.
    """
    from common.files import write_csv

    table = inverse()
    write_csv(table, out)
    print(f"solutions: {len(table)}, targets: {table.attrs['targets']} -> {out}")


@program.command("errors")
def _errors(*, lookup: str | None = None) -> None:
    """Print the stored held-out errors."""
    from surrogate.held_out import error_table
    from surrogate.table_file import load

    table = load(lookup)
    rows = table.provenance["rows"]
    print(f"model {table.identity}: {rows['train']} rows, held-out error on {rows['held_out']}")
    print(error_table(table.errors))


@program.command("robot")
def _robot(robot: RobotSource, *, out: str) -> None:
    """Simulate the table of one robot, effects included.

    Args:
        out: JSON.
    """
    from sim.inputs import load_robot
    from surrogate.tabulate import tabulate

    table = tabulate(load_robot(robot))
    table.save(out)
    worst = max(error["rms"] for error in table.errors.values())
    print(f"both directions of the motor, largest error {100 * worst:.2f} % -> {out}")


if __name__ == "__main__":
    program.exit()
