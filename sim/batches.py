"""Many robots in parallel: rows are split into batches of one N and similar cost, spread over processes.

A batch steps all its robots together at the resolution that its fastest motor needs, so rows of similar
|ω̄| go together. Each process uses one thread: batches are the parallelism, and threads inside small
tensor operations would only fight them.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from typing import TypeVar

import numpy as np
import torch
from joblib import Parallel, delayed
from numpy.typing import NDArray
from tqdm import tqdm

from sim.robot import Groups, check_columns
from sim.steady import Resolution, steady

BATCH_NODES = 12_000  # nodes of all tails in a batch: fits the second-level cache, amortises overhead

Job = TypeVar("Job")
Result = TypeVar("Result")


def split(
    tails: NDArray[np.float64],
    omega_bar: NDArray[np.float64],
    *,
    then_by: NDArray[np.float64] | None = None,
    resolution: Resolution | None = None,
) -> list[NDArray[np.int64]]:
    """Row numbers of batches with one N and one resolution, similar in |ω̄| (and in `then_by`)."""
    speed = np.abs(omega_bar)
    octave = np.floor(np.log2(np.maximum(speed, 1e-12)) * (1 if then_by is not None else 1e6))
    second = speed if then_by is None else then_by
    batches: list[NDArray[np.int64]] = []
    needed = [resolution or Resolution.fitting(s) for s in speed]
    kinds = {(n, r) for n, r in zip(tails.tolist(), needed, strict=True)}
    for n, kind in sorted(kinds, key=lambda k: (k[0], k[1].edges, k[1].steps)):
        rows = np.array([i for i in range(len(tails)) if tails[i] == n and needed[i] == kind])
        rows = rows[np.lexsort((second[rows], octave[rows]))]
        size = max(1, int(BATCH_NODES / (n * kind.edges)))
        parts = -(-len(rows) // size)
        batches.extend(np.array_split(rows, parts))
    return batches


def available_jobs() -> int:
    """Processes to use by default: the processors that this process may run on."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def run_batches(
    work: Callable[[Job], Result],
    jobs_to_do: Sequence[Job],
    *,
    sizes: Sequence[int],
    jobs: int | None = None,
    title: str = "",
) -> list[Result]:
    """Apply `work` to every job in parallel processes, with a progress bar over rows.

    Results come back in the order of the jobs; the longest jobs should come first.
    """
    count = min(jobs or available_jobs(), len(jobs_to_do))
    results: list[Result] = []
    with tqdm(total=sum(sizes), desc=title, unit="row", delay=1.0, disable=not title) as bar:
        if count <= 1:
            for job, size in zip(jobs_to_do, sizes, strict=True):
                results.append(_single_threaded(work, job))
                bar.update(size)
            return results
        parallel = Parallel(n_jobs=count, return_as="generator", pre_dispatch="2*n_jobs")
        done = parallel(delayed(_single_threaded)(work, job) for job in jobs_to_do)
        for result, size in zip(done, sizes, strict=True):
            results.append(result)
            bar.update(size)
    return results


def _single_threaded(work: Callable[[Job], Result], job: Job) -> Result:
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        return work(job)
    finally:
        torch.set_num_threads(threads)


def steady_columns(
    columns: Mapping[str, NDArray[np.float64]],
    *,
    resolution: Resolution | None = None,
    refine: bool = False,
    jobs: int | None = None,
    title: str = "steady",
) -> dict[str, NDArray[np.float64]]:
    """Steady motion of any robots, in parallel.

    Args:
        columns: robots by column name, see `sim.robot.check_columns`, each (M,).
        resolution: mesh and step of all rows; by default what each batch needs.
        refine: simulate on half the edge length and half the step of that.
        jobs: processes; default all processors.
        title: of the progress bar; empty for none.

    Returns:
        The columns of `Steady.columns`, each (M,), in the order of the rows.
    """
    values = check_columns(columns)
    batches = split(values["N"], values["omega_bar"], resolution=resolution)
    batches.sort(key=lambda rows: -float(np.abs(values["omega_bar"][rows]).max()))
    work = [({name: array[rows] for name, array in values.items()}, resolution, refine) for rows in batches]
    done = run_batches(_steady_batch, work, sizes=[len(b) for b in batches], jobs=jobs, title=title)
    order = np.argsort(np.concatenate(batches))
    return {name: np.concatenate([d[name] for d in done])[order] for name in done[0]}


def _steady_batch(
    job: tuple[dict[str, NDArray[np.float64]], Resolution | None, bool],
) -> dict[str, NDArray[np.float64]]:
    columns, chosen, refine = job
    resolution = chosen or Resolution.fitting(float(np.abs(columns["omega_bar"]).max()))
    if refine:
        resolution = Resolution(2 * resolution.edges, 2 * resolution.steps)
    return steady(Groups.from_columns(columns), resolution=resolution)[0].columns()
