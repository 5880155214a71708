"""Command line of the calibration: `compile`, `decide`, `simulate`, `tracks`."""

from __future__ import annotations

from collections.abc import Sequence

from common.changes import RobotSource
from common.commands import Call, Program, to_stderr
from common.errors import InputError
from common.reading import refuse_missing

program = Program("calibration", "find from measured runs what the model of a robot lacks, and correct it")
main = program.main


@program.command("compile")
def _compile() -> None:
    """Compile the loops of swims now rather than on first use."""
    from time import perf_counter

    import numpy as np

    from calibration.swim.pose_noise import PoseNoise, Sizes
    from sim import jit

    jit.beforehand, began = True, perf_counter()
    still, one = np.zeros(2, dtype=int), np.ones(2)
    noise = PoseNoise(still, np.arange(2.0), still, np.zeros((2, 2)), Sizes(one, one, one, 1.0))
    noise.whiten(np.zeros((2, 3)))
    print(f"loops compiled in {perf_counter() - began:.0f} s -> {jit.CACHE}")


@program.command("decide", of="calibration.api:decide")
def _decide(decide: Call, table: str, *, robot: RobotSource | None = None, model: str | None = None) -> None:
    """Say which of several explanations new runs speak for.

    Args:
        robot: robot.toml or the name of a preset; or --model.
        model: PY, a file with a model of your own.
    """
    if bool(robot) == bool(model):
        raise InputError("give --robot, or --model with a model of your own")
    refuse_missing(*filter(None, (table, model)))
    from calibration.findings.next_runs import GIVEN_UP
    from calibration.own_model.model_file import load_model

    given, measured = load_model(model, table) if model else (robot, table)
    decision = decide(table=measured, robot=given)
    print(f"{decision.new_runs} new runs. An explanation that is behind by more than {GIVEN_UP:.1f} is given up.")
    for explanation in decision.standings:
        print(f"  {explanation.title}: {f'behind by {explanation.behind:.1f}' if explanation.behind else 'best'}")
    print(decision.sentence)


@program.command("simulate", effects="effect")
def _simulate(
    *, robot: RobotSource, out: str, effects: Sequence[str] = (), seed: int = 0, jobs: int | None = None
) -> None:
    """Make a table from the simulator, to try the calibration on.

    Args:
        out: CSV.
        effects: NAME=SIZE, hidden effect.
        seed: of the noise.
    """
    from dataclasses import replace

    from calibration.swimmer.synthetic_table import make_table
    from common.files import write_csv
    from sim.effects import check_effects
    from sim.inputs import load_robot

    given = load_robot(robot)
    hidden = dict(given.effects)
    for entry in effects:
        name, _, size = entry.partition("=")
        try:
            hidden[name] = float(size)
        except ValueError:
            raise InputError(f"--effect {entry!r}; write NAME=SIZE") from None
    check_effects(hidden)
    table = make_table(replace(given, effects=hidden), seed=seed, jobs=jobs)
    write_csv(table, out, digits=6)
    print(f"{len(table)} runs -> {out}")


@program.command("tracks", of="camera.api:tracks", written_by="from")
def _tracks(tracks: Call, runs: str, *, check: str | None = None, out: str) -> None:
    """Turn camera tracks into a table of runs.

    Args:
        out: CSV.
    """
    from common.files import write_csv

    refuse_missing(tracks.given["tracks"], runs)
    table = tracks(runs=runs, check=check)
    for line in table.attrs["converted"]:
        to_stderr(line)
    write_csv(table, out, digits=6)
    pictures = f", {check}" if check else ""
    print(f"{len(table)} runs -> {out}{pictures}")


if __name__ == "__main__":
    program.exit()
