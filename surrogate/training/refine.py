"""More rows for a data set, where a look-up table is unsure: chosen points of the sequence of its sweep.

A row is an index of one sequence (`dataset.rows.design`), so the chosen rows are rows that a longer sweep would
have, bit for bit. They lie in a folder of their own, and `surrogate.training.train` learns from both. Only points
that training learns (`surrogate.training.train.split`) are chosen. So the held-out rows stay a fair sample of the
sweep, and the stated errors are those of the sweep.

A point's doubt is the half-width of the table's intervals, relative, as the root mean square over spins, yaw rate
and velocities. Intervals are wide where the members of the table disagree, and far from what was learned. Points
are drawn with chances in proportion to their doubt, so that the rows do not crowd in one corner.
Source of the drawing: Efraimidis and Spirakis (2006).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from dataset.build.build import build
from dataset.build.sweep_folder import load_sweep
from dataset.rows.design import MOST_ROWS, Design
from dataset.storage.data_set import SWEEP, read_manifest
from dataset.storage.storage import place
from dataset.workers.tasks import Simulate
from sim.arrays import Floats, Integers
from sim.io.errors import InputError
from surrogate.table.errors import error_scale
from surrogate.table.lookup import NeuralTable
from surrogate.training.train import split

CANDIDATES = 16  # points that are looked at for each one that is chosen
POWER = 1.0
_JUDGED = ("omega_t_bar", "omega_h_bar", "omega_yr_bar", "v_x", "v_z")


def refine(
    folder: str | Path,
    table: NeuralTable,
    out: str | Path,
    rows: int,
    *,
    jobs: int | None = None,
    title: str = "refine",
    resume: str = "run the same command again",
    simulate: Simulate | None = None,
) -> dict[str, Any]:
    """Simulate chosen rows of a finished data set's sweep into another folder; goes on where it stopped.

    Args:
        folder: a data set with the first rows of its sequence.
        table: learned from it.
        out: folder or URL of the chosen rows. What was chosen there before stays; `table` chooses what is added.
        rows: number of rows that `out` shall have.
        jobs, title, resume, simulate: as for `dataset.build.build.build`.

    Returns:
        The manifest of `out`.

    Raises:
        InputError: no such data set, `out` holds something else, or the table has no intervals.
        UnfinishedError: as for `dataset.build.build.build`.
    """
    manifest = read_manifest(folder)
    if manifest.get("chosen") is not None:
        raise InputError(f"{folder} holds chosen rows; give the data set with the first rows of the sweep")
    if rows < 1:
        raise InputError(f"rows = {rows}; give a whole number from 1")
    design, there = Design.from_config(manifest["config"], manifest["rows"]), place(out)
    before: tuple[int, ...] = ()
    if there.size(SWEEP) is not None:
        before = load_sweep(there)[0].chosen or ()
    chosen = before
    if len(before) < rows:
        chosen += choose(table, design, rows - len(before), design.rows, before)
    refined = replace(design, rows=rows, chosen=chosen)
    return build(refined, out, jobs=jobs, title=title, resume=resume, simulate=simulate)


def choose(
    table: NeuralTable,
    design: Design,
    count: int,
    start: int,
    without: Sequence[int] = (),
    *,
    power: float = POWER,
) -> tuple[int, ...]:
    """Indices of `count` points of the sequence, from `start` on, that are worth simulating.

    Args:
        without: indices that are not chosen.
        power: chances are in proportion to this power of the doubt; infinite: the most doubtful points.
    """
    candidates = _candidates(count * CANDIDATES, start + CANDIDATES * len(without))
    candidates = np.setdiff1d(candidates, without)
    points = replace(design, rows=len(candidates), chosen=tuple(candidates.tolist())).points()
    chances = np.random.default_rng(start + len(without)).random(len(candidates))
    doubts = doubt(table, points)
    order = np.argsort(-doubts if np.isinf(power) else -np.log(chances) / doubts**power, kind="stable")
    return tuple(np.sort(candidates[order[:count]]).tolist())


def _candidates(count: int, start: int) -> Integers:
    """The first `count` indices from `start` on that training learns."""
    block = np.arange(start, start + 2 * count + 64)
    found = block[split(block) == 0][:count]
    if found[-1] >= MOST_ROWS:
        raise InputError(f"the sequence has {MOST_ROWS} points; ask for fewer rows")
    return found


def doubt(table: NeuralTable, robots: dict[str, Floats]) -> Floats:
    """How unsure the table is of robots, (M,), as a relative error; where it has no answer, as at its worst."""
    found = table.query(robots, intervals=True, flag=True)
    with np.errstate(invalid="ignore"):
        parts = [(found[f"{n}_high"] - found[f"{n}_low"]) / (2 * np.abs(error_scale(n, found))) for n in _JUDGED]
        size = np.sqrt(np.mean(np.square(parts), axis=0))
    known = np.isfinite(size)
    if not known.any():
        raise InputError("this look-up table has no finite intervals; train it on more rows")
    return np.clip(np.where(known, size, size[known].max()), 1e-12, None)
