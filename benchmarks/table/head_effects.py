"""Errors and coverage of the look-up table for robots with one effect on head, disc or motor.

Usage: python -m benchmarks head_effects [MODEL]

Random robots of the domain with one, two, and three to eight tails; the effect's size is drawn evenly from its
plausible range (a wall at 0 to 0.5, a drift of the viscosity of −1 to 1). A robot that the table refuses is
counted, and left out of the errors.

Takes 5 minutes.
"""

from __future__ import annotations

import numpy as np

from benchmarks.table.shipped_table import as_reached
from sim.effects import catalogue
from surrogate.held_out import coverage, relative_errors
from surrogate.table_file import load
from surrogate.tails import needs_no_learning
from surrogate.training.simulated import draw_robots
from surrogate.training.train import with_radius

COUNT, SEED = 384, 20280202
_WALL, _DRIFT = (0.0, 0.5), (-1.0, 1.0)  # of the effects without a plausible range: tank_wall, viscosity_drift


def main(*words: str) -> None:
    lookup = load(words[0] if words else None)
    names = ["", *(name for name in catalogue() if needs_no_learning(name))]
    print(f"{'effect':24}{'N':>5}{'refused':>9}{'yaw rate: median, 95 %, worst':>32}{'surge (of the speed)':>26}"
          f"{'coverage':>10}")  # fmt: skip
    for index, name in enumerate(names):
        for tails in (1, 2, 3):
            robots = draw_robots(COUNT, SEED + 10 * index + tails, wide=False)
            random = np.random.default_rng([index, tails])
            robots["N"] = np.full(COUNT, float(tails)) if tails < 3 else random.integers(3, 9, COUNT).astype(float)
            if name:
                low, high = catalogue()[name].plausible or (_WALL if name == "tank_wall" else _DRIFT)
                robots[name] = random.uniform(low, high, COUNT)
            reached = as_reached(robots)
            answer = lookup.query(reached.robots, intervals=True, flag=True)
            inside = ~answer["outside"]
            motion = with_radius({n: values[inside] for n, values in reached.motion.items()})
            answer = {n: values[inside] for n, values in answer.items()}
            errors = relative_errors(answer, motion)
            covered = [*coverage(answer, motion).values()]
            print(f"{name or 'none':24}{tails if tails < 3 else '3–8':>5}"
                  f"{100 * np.mean(~inside):8.0f} %{_figures(errors['omega_yr_bar']):>32}"
                  f"{_figures(errors['v_z']):>26}{100 * np.mean(covered):8.0f} %", flush=True)  # fmt: skip


def _figures(errors: np.ndarray) -> str:
    size = 100 * np.abs(errors)
    return f"{np.median(size):.4f}, {np.quantile(size, 0.95):.3f}, {size.max():.2g}"
