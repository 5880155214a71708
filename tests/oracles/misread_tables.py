"""Measured tables in which something is off that no model has, and tables in which nothing is.

192 runs in four days: two to five tails of three lengths, four speeds, both directions, repeats on two days. Noise
2.5 %, 1.4° of slip. Three columns that no model knows: an operator (one in seven runs is B's), the humidity, the
angle of view. Nothing depends on them but for what a case says.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pandas as pd

from common.arrays import Floats

NOISE, DAYS = 0.025, 4
_DESIGN = list(itertools.product((2, 3, 4, 5), (7.0, 9.0, 12.0), (70.0, 90.0, 115.0, 145.0), (1, -1), (0, 1)))
_OUTPUTS = ("omega_h_rpm", "omega_t_rpm", "omega_yr_rad_s", "R_yr_cm", "theta_deg", "v_cm_s")


def _normal(rng: np.random.Generator, shape: tuple[int, ...]) -> Floats:
    return rng.normal(size=shape)


def _far_tails(rng: np.random.Generator, shape: tuple[int, ...]) -> Floats:
    return rng.standard_t(3, shape) / np.sqrt(3)


class Case(NamedTuple):
    """What a table is like."""

    label: str
    draw: Callable[[np.random.Generator, tuple[int, ...]], Floats] = _normal
    scatter: float = 0.0  # of sessions
    repeated: bool = True  # without repeats mirror runs serve
    lost: float = 0.0  # share of cells that are empty
    change: Callable[[pd.DataFrame], None] = lambda table: None
    named: tuple[str, str] = ("", "")  # output or identity, and column


def _operator(table: pd.DataFrame) -> None:
    table.loc[table.operator == "B", "omega_yr_rad_s"] *= 0.95


def _watch(table: pd.DataFrame) -> None:
    """Stopped 1.2 s late in a quarter turn."""
    late = 1 + 1.2 * table.omega_yr_rad_s.abs() / (np.pi / 2)
    table.omega_yr_rad_s = table.omega_yr_rad_s.where(table.operator == "A", table.omega_yr_rad_s / late)


def _tilted(table: pd.DataFrame) -> None:
    """A camera that looks at the tank askance, by 18°."""
    seen = np.hypot(np.cos(np.radians(18)) * np.cos(angle := np.radians(table.view_deg)), np.sin(angle))
    table.v_cm_s *= seen
    table.R_yr_cm *= seen


def _driver(table: pd.DataFrame) -> None:
    table.omega_rpm = table.omega_rpm.where(table.omega_rpm.abs() < 118, 1.15 * table.omega_rpm)


def _arc(table: pd.DataFrame) -> None:
    """Speed along the chord."""
    table.v_cm_s *= 0.92


CASES = (
    Case("normal noise"),
    Case("noise of t, 3 degrees of freedom", draw=_far_tails),
    Case("sessions scatter by 3 %", scatter=0.03),
    Case("mirror runs only", repeated=False),
    Case("a tenth of the cells is empty", lost=0.1),
    Case("operator B reads yaw rates 5 % low", change=_operator, named=("omega_yr", "operator")),
    Case("operator B stops the watch late", change=_watch, named=("omega_yr", "operator")),
    Case("camera tilted by 18°", change=_tilted, named=("v", "view_deg")),
    Case("driver stops at 118 rpm", change=_driver, named=("(ω_t − ω_h)/ω", "motor speed")),
    Case("speeds 8 % low", change=_arc, named=("v/(R ω_yr)", "")),
)


def make_table(case: Case, seed: int) -> pd.DataFrame:
    """Draw a table."""
    rng = np.random.default_rng(seed)
    N, length, speed, sign, trial = np.array(_DESIGN).T
    count = len(N)
    speed = speed if case.repeated else speed * rng.uniform(0.97, 1.03, count // 4).repeat(4) * (1 + 0.001 * trial)
    day = rng.permuted(np.tile(np.arange(DAYS), (count // 2, 1)), axis=1)[:, :2].ravel()
    head = 0.1 * (1 + N) * (length / 9) ** -0.4 * speed**0.95
    yaw = 0.012 * N**0.5 * (9 / length) * speed**0.6
    radius = 0.7 * length * (speed / 100) ** 0.2
    means = np.stack([head, speed - head, yaw, radius, np.full(count, 75.0), radius * yaw], 1)
    e = NOISE * case.draw(rng, means.shape) + case.scatter * rng.normal(size=(DAYS, len(_OUTPUTS)))[day]
    values = np.where(np.arange(len(_OUTPUTS)) == 4, means + np.degrees(e), means * np.exp(e))
    values *= np.column_stack([-sign, sign, sign, *np.ones((3, count))])
    values[rng.random(values.shape) < case.lost] = np.nan
    table = pd.DataFrame({"N": N, "l_cm": length, "omega_rpm": sign * speed, "session": day.astype(str)})
    table[list(_OUTPUTS)] = values
    table["operator"] = np.where(rng.random(count) < 1 / 7, "B", "A")
    table["humidity"], table["view_deg"] = rng.normal(50, 10, count), rng.uniform(0, 360, count)
    case.change(table)
    return table.sample(frac=1, random_state=seed).sort_values("session", kind="stable")
