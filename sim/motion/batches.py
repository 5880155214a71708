"""Many robots in parallel: rows are split into batches of one N, which run in threads or processes.

Each worker uses one thread. More threads inside small operations would only compete with the other workers.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from functools import partial
from typing import Any, TypeVar

import numpy as np
from threadpoolctl import threadpool_limits
from tqdm import tqdm

from sim.arrays import Floats, Integers
from sim.inputs import check_columns
from sim.io.errors import InputError
from sim.model.groups import Groups
from sim.motion.resolution import Resolution
from sim.motion.sensitivity import Sensitivities, sensitivities
from sim.motion.settling import settle
from sim.motion.steady import steady
from sim.motion.steady_motion import STABILITY_COLUMNS
from sim.motion.warm import compile_once
from sim.solve.refinement import PHASES_FOR_SLOPES

_DIRECT_ROWS, _SLOPE_ROWS, _STEPPED_ROWS = 128, 16, 4  # robots a batch: the progress bar moves after each

Job = TypeVar("Job")
Result = TypeVar("Result")


def split(tails: Floats, rows: int) -> list[Integers]:
    """Split rows into batches of one N with at most `rows` rows; yield their row numbers."""
    order = np.argsort(tails, kind="stable")
    ends = np.flatnonzero(np.diff(tails[order])) + 1
    return [part for same in np.split(order, ends) for part in np.array_split(same, -(-len(same) // rows))]


def available_jobs() -> int:
    """Count the processes to use by default: the processors that this process may run on."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def run_batches(
    work: Callable[[Job], Result],
    jobs_to_do: Sequence[Job],
    *,
    sizes: Sequence[int],
    jobs: int | None = None,
    title: str = "",
    threads: bool = False,
) -> list[Result]:
    """Apply `work` to every job in parallel processes, with a progress bar over rows.

    Results have the order of the jobs. The longest jobs should come first. With `threads`, jobs run in threads of
    this process; use it for compiled loops, which do not hold the interpreter's lock.
    """
    if jobs is not None and jobs < 1:
        raise InputError(f"jobs = {jobs}; give at least 1, or nothing for all processors")
    count = min(jobs or available_jobs(), len(jobs_to_do))
    in_this_process = (
        threads or count <= 1
    )  # the number of threads is a setting of the process: set it once, not in each worker
    task = work if in_this_process else partial(_single_threaded, work)
    results: list[Result] = []
    if not in_this_process:
        compile_once()
    with (
        one_thread() if in_this_process else nullcontext(),
        tqdm(total=sum(sizes), desc=title, unit="row", delay=1.0, disable=not title) as bar,
    ):
        if count <= 1:
            done = map(task, jobs_to_do)
        else:
            from joblib import Parallel, delayed  # slow to import, and one job needs none of it

            parallel = Parallel(
                n_jobs=count, return_as="generator", pre_dispatch="2*n_jobs", prefer="threads" if threads else None
            )
            done = parallel(delayed(task)(job) for job in jobs_to_do)
        for result, size in zip(done, sizes, strict=True):
            results.append(result)
            bar.update(size)
    return results


@contextmanager
def one_thread() -> Iterator[None]:
    """Let matrix operations of this process use one thread each."""
    with threadpool_limits(1, user_api="blas"):
        yield


def _single_threaded(work: Callable[[Job], Result], job: Job) -> Result:
    with one_thread():
        return work(job)


def steady_columns(
    columns: Mapping[str, Floats], *, stability: bool = True, jobs: int | None = None, title: str = "steady"
) -> dict[str, Any]:
    """Simulate the steady motion of any robots, in parallel (`sim.motion.steady`).

    Args:
        columns: robots by column name, see `sim.inputs.check_columns`, each (M,).
        stability: whether to compute the growth of small perturbations, see `sim.motion.steady`.
        jobs: threads; default all processors.
        title: of the progress bar; empty for none.

    Returns:
        The columns of `Steady.columns`, each (M,), in the order of the rows; without STABILITY_COLUMNS if these
        are not computed.
    """
    values = check_columns(columns)
    work = partial(_steady_batch, stability=stability)
    return _in_batches(work, values, split(values["N"], _DIRECT_ROWS), jobs=jobs, title=title)


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
        parameters: names out of `sim.model.sweepable.SLOPE_INPUTS` and `sim.effects.catalogue()`, K of them.
        phases: number of phases to begin with, see `sim.motion.sensitivity`.
        jobs: threads; default all processors.
        title: of the progress bar; empty for none.
    """
    values = check_columns(columns)
    batches = split(values["N"], _SLOPE_ROWS)
    parts = [Groups.from_columns({name: array[rows] for name, array in values.items()}) for rows in batches]
    work = partial(sensitivities, parameters=tuple(parameters), phases=phases)
    done = run_batches(work, parts, sizes=[len(b) for b in batches], jobs=jobs, title=title, threads=True)
    order = np.argsort(np.concatenate(batches))
    return Sensitivities(
        tuple(parameters),
        {name: np.concatenate([d.values[name] for d in done])[order] for name in done[0].values},
        {name: np.concatenate([d.derivatives[name] for d in done])[order] for name in done[0].derivatives},
    )


def stepped_columns(
    columns: Mapping[str, Floats],
    *,
    resolution: Resolution | None = None,
    finer: int = 1,
    jobs: int | None = None,
    title: str = "time stepping",
) -> dict[str, Any]:
    """Simulate by time stepping from rest (`sim.motion.settling`): the reference for the direct solution.

    Args:
        columns: robots by column name, each (M,).
        resolution: mesh and step of all rows; by default what each needs.
        finer: a factor; edge length and time step are divided by it.
        jobs: threads; default all processors.
        title: of the progress bar; empty for none.
    """
    values = check_columns(columns)
    work = partial(_settle_batch, chosen=resolution, finer=finer)
    return _in_batches(work, values, split(values["N"], _STEPPED_ROWS), jobs=jobs, title=title)


def _in_batches(
    work: Callable[[dict[str, Floats]], dict[str, Any]],
    values: dict[str, Floats],
    batches: list[Integers],
    *,
    jobs: int | None,
    title: str,
) -> dict[str, Any]:
    parts = [{name: array[rows] for name, array in values.items()} for rows in batches]
    sizes = [len(b) for b in batches]
    done = run_batches(work, parts, sizes=sizes, jobs=jobs, title=title, threads=True)
    order = np.argsort(np.concatenate(batches))
    return {name: np.concatenate([d[name] for d in done])[order] for name in done[0]}


def _steady_batch(columns: dict[str, Floats], *, stability: bool) -> dict[str, Any]:
    motion = steady(Groups.from_columns(columns), stability=stability).columns()
    return {name: column for name, column in motion.items() if stability or name not in STABILITY_COLUMNS}


def _settle_batch(columns: dict[str, Floats], *, chosen: Resolution | None, finer: int) -> dict[str, Any]:
    def resolution(speed: float) -> Resolution:
        return (chosen or Resolution.fitting(speed)).finer(finer)

    return settle(Groups.from_columns(columns), resolution=resolution).columns()
