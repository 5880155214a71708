"""Many robots in parallel: rows are split into batches of one N, which run in threads.

Each thread uses one processor. More threads inside small operations would only compete with the others.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from common.arrays import Floats, Integers
from common.errors import InputError
from common.journal import Journal
from common.progress import progress_bar
from sim.inputs import check_columns
from sim.model.groups import Groups
from sim.motion.run import Resolution
from sim.motion.sensitivity import Sensitivities, sensitivities
from sim.motion.settling import settle
from sim.motion.steady import steady
from sim.motion.steady_motion import STABILITY_COLUMNS
from sim.solve.refinement import PHASES_FOR_SLOPES
from sim.threads import in_threads

_DIRECT_ROWS, _SLOPE_ROWS, _STEPPED_ROWS = 128, 16, 4  # robots a batch: the progress bar moves after each
RESPONSE_ROWS = 16
_KINDS = ("values", "derivatives")  # of `Sensitivities`
one_thread = partial(threadpool_limits, 1, user_api="blas")  # a context in which matrix operations use one thread


def split(tails: Floats, rows: int) -> list[Integers]:
    """Split rows into batches of one N with at most `rows` rows; yield their row numbers."""
    order = np.argsort(tails, kind="stable")
    ends = np.flatnonzero(np.diff(tails[order])) + 1
    return [part for same in np.split(order, ends) for part in np.array_split(same, -(-len(same) // rows))]


def in_batches(
    work: Callable[[Groups], Mapping[Any, Any]],
    columns: Mapping[str, Floats],
    rows: int,
    *,
    jobs: int | None = None,
    title: str = "",
    kept: Journal | None = None,
) -> dict[Any, Any]:
    """Apply `work` to batches of robots of one N in threads, and join its columns in the order of the robots.

    Args:
        work: compiled loops, which do not hold the interpreter's lock: from robots to columns, a row for each.
        columns: robots by column name, each (M,).
        rows: the most robots of a batch; the progress bar moves after each.
        jobs: threads; default all processors.
        title: of the progress bar; empty for none.
        kept: has the batches that are done, and gets those that follow.

    Raises:
        InputError: fewer than one thread, or a robot is not possible.
    """
    if jobs is not None and jobs < 1:
        raise InputError(f"jobs = {jobs}; give at least 1, or nothing for all processors")
    batches = split(columns["N"], rows)
    results: dict[int, Mapping[Any, Any]] = (
        {} if kept is None else {k: _arrays(part) for k, part in kept.done.items()}
    )
    left = [k for k in range(len(batches)) if k not in results]
    parts = [Groups.from_columns({name: array[batches[k]] for name, array in columns.items()}) for k in left]
    before = sum(len(batches[k]) for k in results)
    with (
        one_thread(),  # a setting of the process: set once, not in each thread
        progress_bar(title, total=len(columns["N"]), initial=before, unit="row", disable=not title) as bar,
    ):
        for k, part in zip(left, in_threads(work, parts, jobs), strict=True):
            results[k] = part
            if kept is not None:
                kept.add(k, {name: values.tolist() for name, values in part.items()})
            bar.update(len(batches[k]))
    order = np.argsort(np.concatenate(batches))
    return {name: np.concatenate([results[k][name] for k in range(len(batches))])[order] for name in results[0]}


def _arrays(columns: Mapping[str, list[Any]]) -> dict[str, Any]:
    return {name: np.array(values) for name, values in columns.items()}


def steady_columns(
    columns: Mapping[str, Floats],
    *,
    stability: bool = True,
    jobs: int | None = None,
    title: str = "steady",
    kept: Journal | None = None,
) -> dict[str, Any]:
    """Simulate the steady motion of any robots, in parallel (`sim.motion.steady`).

    Args:
        columns: robots by column name, see `sim.inputs.check_columns`, each (M,).
        stability: whether to compute the growth of small perturbations, see `sim.motion.steady`.
        jobs: threads; default all processors.
        title: of the progress bar; empty for none.
        kept: as for `in_batches`.

    Returns:
        The columns of `Steady.columns`, each (M,), in the order of the rows; without STABILITY_COLUMNS if these
        are not computed.
    """

    def work(groups: Groups) -> dict[str, Any]:
        motion = steady(groups, stability=stability).columns()
        return {name: column for name, column in motion.items() if stability or name not in STABILITY_COLUMNS}

    return in_batches(work, check_columns(columns), _DIRECT_ROWS, jobs=jobs, title=title, kept=kept)


def sensitivity_columns(
    columns: Mapping[str, Floats],
    parameters: Sequence[str],
    *,
    phases: int = PHASES_FOR_SLOPES,
    jobs: int | None = None,
    title: str = "sensitivities",
) -> Sensitivities:
    """Simulate the steady motion of any robots and its derivatives, in parallel (`sim.motion.sensitivity`).

    Args:
        columns: robots by column name, each (M,).
        parameters: names out of `sim.model.groups.SLOPE_INPUTS` and `sim.effects.catalogue()`, K of them.
        phases: number of phases to begin with, see `sim.motion.sensitivity`.
        jobs: threads; default all processors.
        title: of the progress bar; empty for none.
    """

    def work(groups: Groups) -> dict[tuple[str, str], Floats]:
        found = sensitivities(groups, parameters, phases=phases)
        return {(kind, name): array for kind in _KINDS for name, array in getattr(found, kind).items()}

    found = in_batches(work, check_columns(columns), _SLOPE_ROWS, jobs=jobs, title=title)
    parts = ({name: array for (kind, name), array in found.items() if kind == wanted} for wanted in _KINDS)
    return Sensitivities(tuple(parameters), *parts)


def stepped_columns(
    columns: Mapping[str, Floats],
    *,
    finer: int = 1,
    jobs: int | None = None,
    title: str = "time stepping",
) -> dict[str, Any]:
    """Simulate by time stepping from rest (`sim.motion.settling`): the reference for the direct solution.

    Args:
        columns: robots by column name, each (M,).
        finer: a factor by which edge length and time step are divided.
        jobs: threads; default all processors.
        title: of the progress bar; empty for none.
    """

    def work(groups: Groups) -> dict[str, Any]:
        return settle(groups, resolution=lambda speed: Resolution.fitting(speed).finer(finer)).columns()

    return in_batches(work, check_columns(columns), _STEPPED_ROWS, jobs=jobs, title=title)
