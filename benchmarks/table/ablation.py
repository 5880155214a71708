"""Ablations of the look-up table, and other methods: error, training and query time, size.

Robots with three tails and more. Rows are learned from wide robots; errors are those of the yaw rate and the
forward velocity (of itself), median and 95 %, on fresh robots of the domain whose tails do not touch.

Usage: python -m benchmarks ablation WORK [--rows 4096] [--picture docs/lookup.png]
       (WORK as in benchmarks.table.shipped_table)

Takes half an hour.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
from scipy.spatial.distance import cdist
from torch import Tensor

from benchmarks.table.shipped_table import kept
from dataset.report.figures import plain_logarithms
from sim.arrays import Floats
from surrogate.networks import training_loop
from surrogate.networks.checkpoints import TrainingContext
from surrogate.networks.ensemble import SHARED, Ensemble
from surrogate.networks.trainable import TrainableEnsemble
from surrogate.networks.training_loop import _HARDEST, Problem, Settings
from surrogate.training import fit_wrench
from surrogate.training.fit_wrench import WrenchSamples, learnable, wrench_samples
from surrogate.training.simulated import SimulatedRobots
from surrogate.training.train import without_effects
from surrogate.wrench.tails import SMOOTHNESS, straight_wrench, tail_inputs, wrench_slopes
from tests.oracles.balance import solve

SMALL = Settings(width=32, depth=3, members=1, epochs=60, iterations=600)
_CENTRES, _TESTED = 1000, 1000
_LONGER = 2  # iterations of L-BFGS for one of BFGS
Result = tuple[str, float, float, float, tuple[float, ...]]  # name, train s, query µs, numbers, errors


def main(*words: str) -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("work", type=Path)
    parser.add_argument("--rows", type=int, default=4096)
    parser.add_argument("--picture")
    options = parser.parse_args(words)
    torch.set_num_threads(1)
    learned, tested = (_several(kept(options.work, name)) for name in ("tails", "widths"))
    tested = tested.at((tested.gap >= 1) & (tested.motion[:, 2] < 0.6 * tested.motion[:, 4]))
    tested = tested.at(np.arange(min(_TESTED, len(tested.motion))))
    samples = learned.at(np.arange(options.rows))
    results = [_network("as shipped, smaller", samples, tested)]
    power, training_loop._POWER = training_loop._POWER, 1.0
    results.append(_network("least squares", samples, tested))
    training_loop._POWER = power
    polish: Callable[..., None] = training_loop._polish
    training_loop._polish = _lbfgs  # type: ignore[assignment]
    results.append(
        _network("L-BFGS for BFGS", samples, tested, replace(SMALL, iterations=_LONGER * SMALL.iterations))
    )
    training_loop._polish = polish
    results.append(_network("Adam alone", samples, tested, replace(SMALL, iterations=0)))
    smooth, fit_wrench.SMOOTHNESS = fit_wrench.SMOOTHNESS, (1.5,) * 7  # type: ignore[attr-defined]
    results.append(_network("inputs scaled alike", samples, tested))
    fit_wrench.SMOOTHNESS = smooth  # type: ignore[attr-defined]
    results.append(_network("single precision", samples, tested, single=True))
    results.append(_network("half the rows", samples.at(np.arange(options.rows // 2)), tested))
    results.append(_kernel("Gaussian process", samples.at(np.arange(min(_CENTRES, options.rows))), tested))
    results.append(_nearest("nearest row", samples, tested))
    print(f"{options.rows} rows, {len(tested.motion)} fresh robots; errors in %")
    print(f"{'':26}{'train s':>8}{'query µs':>9}{'numbers':>9}{'ω_yr median':>12}{'95 %':>8}{'v_z':>8}{'95 %':>8}")
    for name, train, query, size, errors in results:
        figures = f"{errors[0]:12.4f}{errors[1]:8.3f}{errors[2]:8.4f}{errors[3]:8.3f}"
        print(f"{name:26}{train:8.0f}{query:9.1f}{size:9.0f}{figures}")
    if options.picture:
        _draw(results, options.picture)


def _several(rows: SimulatedRobots) -> WrenchSamples:
    rows = rows.at((rows.robots["N"] > 2) & without_effects(rows.robots))
    samples = wrench_samples(rows.robots, rows.motion)
    return samples.at(learnable(samples))


def _judge(
    name: str, rows: WrenchSamples, numbers: Callable[[Floats], Floats], seconds: float, size: float
) -> Result:
    began = time.process_time()
    motion, _ = solve(rows.heads, rows.tails, lambda tails, motion: numbers(tail_inputs(tails, motion)))
    query = 1e6 * (time.process_time() - began) / len(motion)
    errors = [np.nan_to_num(np.abs(motion[:, i] / rows.motion[:, i] - 1), nan=9.0) * 100 for i in (2, 1)]
    return name, seconds, query, size, tuple(float(q) for e in errors for q in np.quantile(e, [0.5, 0.95]))


def _network(
    name: str, rows: WrenchSamples, tested: WrenchSamples, settings: Settings = SMALL, *, single: bool = False
) -> Result:
    began = time.process_time()
    learn: Callable[..., Ensemble] = fit_wrench._learn_wrench
    network = learn(rows, settings, TrainingContext(), 3)
    if single:
        state = {part: array.astype(np.float32).astype(float) for part, array in network.state.items()}
        network = Ensemble.from_state(state)  # the weights rounded
    size = sum(array.size for part, array in network.state.items() if part not in SHARED)
    return _judge(name, tested, network, time.process_time() - began, size)


def _lbfgs(network: TrainableEnsemble, k: int, problem: Problem, iterations: int, *others: object) -> None:
    """Minimise with the last 80 steps only, not the whole matrix."""
    alone = network.member(k).requires_grad_(True)
    optimiser = torch.optim.LBFGS(
        alone.parameters(), max_iter=iterations, max_eval=2 * iterations, history_size=80,
        line_search_fn="strong_wolfe", tolerance_change=0.0, tolerance_grad=0.0,
    )  # fmt: skip

    def closure() -> Tensor:
        optimiser.zero_grad(set_to_none=True)
        value = problem.loss(alone, problem.every(), _HARDEST)
        value.backward()  # type: ignore[no-untyped-call]
        return value

    optimiser.step(closure)  # type: ignore[no-untyped-call]
    network.replace_member(k, alone)


def _kernel(name: str, rows: WrenchSamples, tested: WrenchSamples) -> Result:
    """Fit a Gaussian process with the same prior smoothness to y from the wrench (y_4 = y_5 = 0)."""
    began = time.process_time()
    inputs, wanted = tail_inputs(rows.tails, rows.motion), _numbers(rows)
    shift, scale = inputs.mean(0), inputs.std(0) * SMOOTHNESS
    scale[-1] = 1e9
    mean, spread = wanted.mean(0), wanted.std(0) + 1e-12

    def kernel(a: Floats, b: Floats) -> Floats:
        return np.asarray(np.exp(-0.5 * cdist((a - shift) / scale, (b - shift) / scale) ** 2))

    matrix = kernel(inputs, inputs) + 1e-8 * np.eye(len(inputs))
    weights = np.linalg.solve(matrix, (wanted - mean) / spread)
    seconds = time.process_time() - began
    return _judge(
        name, tested, lambda x: kernel(x[:, :7], inputs) @ weights * spread + mean, seconds, weights.size
    )


def _nearest(name: str, rows: WrenchSamples, tested: WrenchSamples) -> Result:
    inputs, wanted = tail_inputs(rows.tails, rows.motion), _numbers(rows)
    scale = inputs.std(0) * SMOOTHNESS
    scale[-1] = 1e9
    return _judge(
        name,
        tested,
        lambda x: wanted[cdist(x[:, :7] / scale, inputs / scale).argmin(1)],
        0.0,
        wanted.size,
    )


def _numbers(rows: WrenchSamples) -> Floats:
    """Compute y (M, 6) of rows with y_4 = y_5 = 0."""
    wrench = (rows.heads.resistance @ rows.motion[..., None])[..., 0]
    remainder = wrench - straight_wrench(rows.tails, rows.motion)
    units = wrench_slopes(rows.tails, rows.motion)[:, :, :4].diagonal(axis1=1, axis2=2)
    return np.concatenate([remainder / units, np.zeros((len(remainder), 2))], 1)


def _draw(results: list[Result], path: str) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.5, 3.8), layout="constrained")
    axes = figure.add_subplot()
    for place, (_, _, _, _, errors) in enumerate(reversed(results)):
        axes.plot(errors[:2], [place, place], "-", color="#9fb8cc", lw=5, solid_capstyle="round")
        axes.plot(errors[0], place, "o", color="#2a7fba", ms=7)
    axes.set_xscale("log")
    plain_logarithms(axes.xaxis)
    axes.set_yticks(range(len(results)), [name for name, *_ in reversed(results)])
    axes.set_xlabel("error of the yaw rate [%]: median (dot) to 95 %")
    axes.grid(axis="x", alpha=0.3)
    figure.savefig(path, dpi=110)
