"""Simulated robots as the look-up table learns them: from a data set's folder, or drawn and simulated here.

The tails' wrench follows from a robot's own motion, whatever its head is. So robots with heads far wider than
those of real robots make the best rows: `draw_robots` gives them. Columns have the names of the data set. Curves
of the response to a flip are those of `sim.model.response`; rows without them have NaN.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
import pandas as pd
from scipy.stats import qmc

from common.arrays import Flags, Floats, Integers
from dataset.data_set import read, read_manifest, usable
from dataset.design import SWEEP_TOML, load_design
from sim.effects import effect_named, is_effect
from sim.model.groups import Groups
from sim.model.response import BEFORE, DWELLS, LAG_PARTS
from sim.motion.batches import in_batches
from sim.motion.response import TOLERANCE, responses
from sim.motion.steady import orbits, steady
from sim.solve.refinement import PHASES
from surrogate.domain import COEFFICIENTS, DOMAIN, MOST_TAILS, ROBOT, WIDE

MOTION = ("omega_t_bar", "omega_h_bar", "omega_yr_bar", "v_x", "v_z", "tail_gap", "error")
_TAILS = (1, 1, 2, 2, 3, 4, 5, 7)  # N of eighths of the wide robots; half of the last two have one tail more
_PHASES = {1: 8, 2: 12}  # to begin with, by N: with one or two tails the motion depends more on the disc's phase
_PHASES_HELD_OUT = {1: 12, 2: 16, 3: 6, 4: 8}  # leave an error of 0.003 % in 95 % of the robots
_BATCH, _CURVE_BATCH = 64, 8


@dataclass(frozen=True)
class SimulatedRobots:
    """M robots with their motion, and with their response curves if they were simulated."""

    robots: dict[str, Floats]  # groups and effects, each (M,)
    motion: dict[str, Floats]  # MOTION, each (M,)
    curves: dict[str, Floats]  # lag, memory, rest, spread as in `sim.model.response`, net_speed; may be empty

    def __len__(self) -> int:
        return len(self.robots["N"])

    def at(self, rows: Flags | Integers) -> SimulatedRobots:
        """Return the robots at indices or flags."""
        parts = [{name: array[rows] for name, array in part.items()} for part in vars(self).values()]
        return SimulatedRobots(*parts)

    def with_curves(self) -> SimulatedRobots:
        """Return the robots whose response was simulated."""
        if not self.curves:
            return self.at(np.zeros(len(self), dtype=bool))
        return self.at(np.flatnonzero(np.isfinite(self.curves["lag"]).all((1, 2))))


def read_robots(folder: str) -> tuple[SimulatedRobots, Integers]:
    """Read the usable rows of a data set's folder, and their numbers.

    Raises:
        InputError: there is no finished data set.
    """
    table = read(folder)
    effects = list(read_manifest(folder)["effects"])
    plain = table.select_dtypes(["number", "bool"])
    table = table.loc[usable(plain).index]
    robots = {name: table[name].to_numpy(dtype=float) for name in (*ROBOT, *effects)}
    motion = {name: table[name].to_numpy(dtype=float) for name in MOTION}
    return SimulatedRobots(robots, motion, _curves_in(table)), table["row"].to_numpy(dtype=np.int64)


def join_robots(parts: Sequence[SimulatedRobots]) -> SimulatedRobots:
    """Join the robots of all parts; effects that some do not have are at their null there."""
    effects = {name for part in parts for name in part.robots if is_effect(name)}
    full = [
        {**{name: np.full(len(part), effect_named(name).null) for name in sorted(effects)}, **part.robots}
        for part in parts
    ]
    curves = [part.curves for part in parts] if all(part.curves for part in parts) else [{} for _ in parts]
    together = (full, [part.motion for part in parts], curves)
    return SimulatedRobots(
        *({name: np.concatenate([p[name] for p in kind]) for name in kind[0]} for kind in together)
    )


def _curves_in(table: pd.DataFrame) -> dict[str, Floats]:
    """Return the response curves from lists in columns `lag_z`, …, `memory_psi_rad`; empty if there are none."""
    if "memory_z" not in table:
        return {}
    dwells, before = len(DWELLS), len(BEFORE)
    shapes = {"lag": (dwells,), "memory": (before, dwells), "rest": (dwells,), "spread": (dwells,)}
    curves = {
        name: np.stack([_lists(table[f"{name}_{part}"], shape) for part in LAG_PARTS], -1)
        for name, shape in shapes.items()
    }
    return curves | {"net_speed": _lists(table["net_speed_bar"], (dwells,))}


def _lists(column: Any, shape: Sequence[int]) -> Floats:
    empty = np.full(shape, np.nan)
    return np.array([empty if row is None else np.asarray(row, dtype=float).reshape(shape) for row in column])


def draw_robots(count: int, seed: int, *, wide: bool, effects: bool | None = None) -> dict[str, Floats]:
    """Draw robots of a scrambled Sobol sequence, even in the logarithms of DOMAIN.

    Args:
        count: number of robots.
        seed: of the scrambling.
        wide: from WIDE, a quarter each with one and two tails; else robots of DOMAIN, every N alike.
        effects: give most of them effects on head and motor; by default those of WIDE.
    """
    sampler = qmc.Sobol(len(DOMAIN) + 5, scramble=True, rng=np.random.default_rng(seed))
    share = sampler.random_base2(math.ceil(math.log2(max(count, 2))))[:count]
    ranges = WIDE if wide else DOMAIN
    robots = {n: low * (high / low) ** share[:, i] for i, (n, (low, high)) in enumerate(ranges.items())}
    eighth, more, end_over_end, axial, disc = share[:, len(DOMAIN) :].T
    if wide:
        tails = np.array(_TAILS, dtype=float)[(8 * eighth).astype(int)]
        robots["N"] = tails + (tails >= 5) * (more > 0.5)
    else:
        robots["N"] = 1 + np.floor(MOST_TAILS * eighth)
    if not (wide if effects is None else effects):
        return robots
    robots["end_over_end_drag"] = np.where(end_over_end < 0.5, 0.0, 0.1 * 150 ** (2 * end_over_end - 1))
    robots["anisotropic_head_drag"] = np.where(axial < 0.5, 0.0, -0.5 + 1.5 * (2 * axial - 1))
    robots["disc_drag"] = np.where(disc < 0.6, 0.0, 3 * (disc - 0.6) / 0.4)
    couple, sense, droop = np.random.default_rng((seed, 1)).uniform(size=(3, count))
    size = np.where(couple < 0.5, 0.0, 0.01 * 300 ** (2 * couple - 1))
    robots["surface_couple"] = np.where(sense < 0.5, -size, size)
    robots["motor_droop"] = np.where(droop < 0.7, 0.0, 0.05 * 160 ** ((droop - 0.7) / 0.3))
    return robots


def draw_as_users(count: int, seed: int) -> dict[str, Floats]:
    """Draw robots as users do: a third each of the default sweep, and of DOMAIN with even C's and even ln C.

    A quarter of them have effects on head and motor, half of them a couple in yaw.
    """
    robots = draw_robots(count, seed, wide=False, effects=True)
    kind, with_effects, even, couple = np.random.default_rng((seed, 5)).uniform(size=(4, count))
    for name in COEFFICIENTS:
        low, high = DOMAIN[name]
        share = np.log(robots[name] / low) / np.log(high / low)
        robots[name] = np.where(kind < 2 / 3, low + (high - low) * share, robots[name])
    swept: dict[str, Any] = {"a_over_R": 1.0, **replace(load_design(SWEEP_TOML), rows=count, seed=seed).points()}
    robots |= {name: np.where(kind < 1 / 3, values, robots[name]) for name, values in swept.items()}
    for name in set(filter(is_effect, robots)) - {"surface_couple"}:
        robots[name] = np.where(with_effects < 1 / 4, robots[name], 0.0)
    size = robots["surface_couple"]  # of the couples that are there, half are even
    return robots | {"surface_couple": np.where((size == 0) | (even < 0.5), size, 3 * couple - 1.5)}


def simulate_robots(
    robots: Mapping[str, Floats],
    *,
    curves: bool = False,
    history: bool = True,
    tolerance: float = TOLERANCE,
    title: str = "",
) -> SimulatedRobots:
    """Simulate robots; those without a direct solution are left out.

    Args:
        robots: groups and effects, each (M,).
        curves: simulate the response to a flip, too; it takes a hundred times as long.
        history: with memory and rest of the response; without, it takes a quarter of that.
        tolerance: of the curves, see `sim.motion.response.responses`.
        title: of the progress bar; empty for none.
    """
    work = partial(_with_curves, tolerance=tolerance, history=history) if curves else _motion
    columns = in_batches(work, robots, _CURVE_BATCH if curves else _BATCH, title=title)
    motion = {name: columns[name] for name in MOTION}
    kept = {name: columns[name] for name in columns if name not in (*MOTION, "solved")}
    everything = SimulatedRobots({name: np.asarray(array) for name, array in robots.items()}, motion, kept)
    return everything.at(columns["solved"])


def reached_columns(robots: Mapping[str, Floats], *, title: str = "") -> dict[str, Any]:
    """Simulate the motion that straight tails reach, with more phases than a data set has.

    With those of a data set, the error of the simulated yaw rate of one and two tails is as large as the table's.

    Args:
        robots: groups and effects, each (M,).
        title: of the progress bar; empty for none.

    Returns:
        MOTION, and whether it is steady ("converged"), each (M,).
    """
    return in_batches(_reached, robots, _BATCH, title=title)


def _reached(groups: Groups) -> dict[str, Any]:
    columns = steady(groups, stability=False, phases=_PHASES_HELD_OUT.get(groups.N, PHASES)).columns()
    return {name: columns[name] for name in (*MOTION, "converged")}


def _motion(groups: Groups) -> dict[str, Any]:
    motion = orbits(groups, phases=_PHASES.get(groups.N, 3))
    columns = motion.columns()
    return {name: columns[name] for name in MOTION} | {"solved": motion.converged}


def _with_curves(groups: Groups, *, tolerance: float, history: bool) -> dict[str, Any]:
    response = responses(groups, orbits(groups), history=history, tolerance=tolerance)
    columns = _motion(groups)
    names = ("lag", "memory", "rest", "spread", "net_speed") if history else ("lag", "spread")
    curves = {name: getattr(response, name) for name in names}
    return columns | curves | {"solved": columns["solved"] & ~response.failed & ~response.stepped}
