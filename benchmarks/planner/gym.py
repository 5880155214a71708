"""Scores in the Gymnasium environment, the tracker's being the one to beat, and steps a second.

Usage: python -m benchmarks gym

Takes a minute.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from benchmarks.common import heading, row
from planner.jobs.plan import plan
from planner.paths.path import circle, polygon
from softflagella.gym import LONGEST, Episode, Observation, PathEnv, Policy, TrackerPolicy, episode

PATHS = {"circle, radius 2 l": circle(2.0), "square, side 3 l": polygon(4, 3.0)}
EPISODES = 10


def scheduled(env: PathEnv) -> Policy:
    """Flip as planned, whatever is seen."""
    flips = np.round(np.cumsum(env.plan.dwells) / env.every).astype(int)
    return lambda seen, info: int(round(info["time"] / env.every) in flips)


def random(env: PathEnv) -> Policy:
    """Flip with a probability of one half."""
    rng = np.random.default_rng(0)
    return lambda seen, info: int(rng.integers(2))


def main() -> None:
    policies: tuple[tuple[str, Any, Callable[[PathEnv], Policy], int], ...] = (
        ("tracker", "table", TrackerPolicy, EPISODES),
        ("tracker", "simulator", TrackerPolicy, 1),
        ("plan, open loop", "table", scheduled, EPISODES),
        ("random", "table", random, 3),
    )
    print(f"Mean scores; an episode ends after {LONGEST:g} planned durations")
    print(heading("path", "policy", "model", "score", "rms error [l]", "finished", "steps a second"))
    for path, drawn in PATHS.items():
        planned = plan(drawn, "paper-control")
        for name, model, policy, count in policies:
            env = PathEnv(planned, model=model)
            runs = [timed_episode(env, policy, seed) for seed in range(count)]
            errors = np.concatenate([run.errors for run, _ in runs])
            steps = len(errors) / sum(seconds for _, seconds in runs)
            score = np.mean([run.score for run, _ in runs])
            rms = float(np.sqrt((errors**2).mean()))
            finished = sum(run.finished for run, _ in runs)
            print(row(path, name, model, f"{score:.2f}", f"{rms:.4f}", f"{finished}/{count}", f"{steps:,.0f}"))


def timed_episode(env: PathEnv, policy: Callable[[PathEnv], Policy], seed: int) -> tuple[Episode, float]:
    """Run an episode; return it, and the processor time in the environment's steps [s]."""
    spent, step = 0.0, env.step

    def timed(action: int) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        nonlocal spent
        began = time.process_time()
        result = step(action)
        spent += time.process_time() - began
        return result

    env.step = timed  # type: ignore[method-assign, assignment]
    run = episode(env, policy, seed)
    env.step = step  # type: ignore[method-assign]
    return run, spent


if __name__ == "__main__":
    main()
