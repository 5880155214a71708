"""Two experiments that are read in time, cups that cool and a pendulum, and tables drawn from them.

A reading has noise of covariance K = σ² [(1 − s) 1 + s exp(−|Δt| / τ)] along its trace, white and slow, with
s = (1 + ρ)/2 and exp(−step / τ) = ρ / s: ρ is the correlation of neighbours. The size λ of a term is the length
of what it changes, whitened with K, less what all numbers can absorb: standard deviations of its score.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from scipy.linalg import block_diag

import softflagella as sf
from common.arrays import Floats

AIR = 22.0  # °C
DAYS = 3
HELD_OUT = "day 2"  # as a calibration chooses
Parameters = Mapping[str, float]


def cup(columns: Mapping[str, Any], p: Parameters) -> dict[str, Any]:
    """Compute the temperature of a cup by Newton's law, dθ/dt = −k θ of its excess θ, and what that may lack.

    Exact for radiation, −k r θ²/50 K, and for evaporation, −k e θ³/(50 K)², one at a time; terms that are not in
    `p` are at their null. The lag of the thermometer grows in a minute.
    """
    of = {name: p.get(name, 0.0) for name in ("radiation", "lag", "fill", "warming", "evaporation")}
    t = columns["t_s"] + of["lag"] * np.expm1(-columns["t_s"] / 60)
    rate, start = p["rate"] * (columns["mass_g"] / 200) ** -of["fill"], p["start"] - AIR
    remaining = np.exp(-rate * t)
    excess = start * remaining / (1 + of["radiation"] * start / 50 * (1 - remaining))
    excess = excess / np.sqrt(1 + of["evaporation"] * (start / 50) ** 2 * (1 - remaining**2))
    return {"T": AIR + excess + of["warming"] * (t - (1 - remaining) / rate)}


def pendulum(columns: Mapping[str, Any], p: Parameters) -> dict[str, Any]:
    """Compute the place of a damped pendulum of 1 m; terms that are not in `p` are at their null."""
    of = {name: p.get(name, 0.0) for name in ("air", "swing", "buoyancy", "creep", "sliding")}
    t, start, damping = columns["t_s"], p["amplitude"], p["damping"]
    remaining = np.exp(-damping * t)
    amplitude = start * remaining / (1 + of["air"] * start / 100 * (1 - remaining))
    late = of["swing"] / 16 * (start / 1000) ** 2 * (1 - remaining**2) / (2 * damping) + of["creep"] * t**2 / 100
    turns = p["frequency"] * (1 - of["buoyancy"] * 100 / columns["bob_g"]) * (t - late)
    return {"x": amplitude * np.cos(2 * np.pi * turns + p["phase"]) + of["sliding"] * t}


class Family(NamedTuple):
    """An experiment: its function, its truth, and how it is read."""

    function: Callable[[Mapping[str, Any], Parameters], dict[str, Any]]
    output: str
    declared: sf.Output
    step: float  # between readings, s
    noise: float  # standard deviation of a reading, in the output's unit
    setting: str
    settings: tuple[float, ...]
    shared: Mapping[str, float]  # truth
    own: Mapping[str, tuple[float, float, float]]  # least and largest truth, by setting; scatter between traces
    numbers: Mapping[str, Mapping[str, Any]]  # what is declared of each
    effects: tuple[sf.Effect, ...]
    mimics: tuple[str, ...]  # not in the catalogue


FAMILIES = {
    "cups": Family(
        cup, "T", sf.Output("temperature", unit="°C", kind="difference"), 30.0, 0.3,
        "mass_g", (150.0, 300.0, 200.0, 250.0, 175.0, 275.0),
        {"rate": 1 / 900}, {"start": (65.0, 90.0, 1.5)},
        {"rate": {"start": 1e-3, "unit": "1/s", "low": 1e-5, "high": 0.1},
         "start": {"start": 80.0, "unit": "°C", "low": 0.0, "high": 150.0, "per": "trace"}},
        (sf.Effect("radiation", "radiation", low=-0.8, high=3, typical=0.2),
         sf.Effect("lag", "lag of the thermometer", low=-100, high=300, unit="s", typical=15),
         sf.Effect("fill", "mass in the cup", low=-2, high=2, typical=0.1)),
        ("warming", "evaporation"),
    ),
    "pendulum": Family(
        pendulum, "x", sf.Output("place", unit="mm", kind="difference"), 0.2, 1.0,
        "bob_g", (100.0, 300.0, 150.0, 200.0, 125.0, 250.0),
        {"frequency": 0.5, "damping": 0.05}, {"amplitude": (80.0, 150.0, 3.0), "phase": (0.0, 0.0, 0.2)},
        {"frequency": {"start": 0.49, "unit": "1/s", "low": 0.1, "high": 2.0},
         "damping": {"start": 0.06, "unit": "1/s", "low": 1e-3, "high": 1.0},
         "amplitude": {"start": 100.0, "unit": "mm", "low": 1.0, "high": 1000.0, "per": "trace"},
         "phase": {"start": 0.0, "unit": "rad", "low": -3.0, "high": 3.0, "per": "trace"}},
        (sf.Effect("air", "quadratic drag of the air", low=-0.8, high=5, typical=0.1),
         sf.Effect("swing", "period that grows with the amplitude", low=-30, high=30, theory=1.0),
         sf.Effect("buoyancy", "buoyancy of the bob", low=-0.5, high=0.5, typical=0.001)),
        ("creep", "sliding"),
    ),
}  # fmt: skip


class Design(NamedTuple):
    """How a table is read."""

    traces: int = 6
    rho: float = 0.5
    repeated: bool = True  # each setting on each of three days; otherwise each trace has a setting of its own
    day_shift: float = 0.0  # standard deviation of a day's offset, over that of a reading
    jitter: float = 0.0  # largest deviation of a reading's time, in steps


class Trace(NamedTuple):
    """A trace without noise: what is known of it, and its true numbers."""

    columns: dict[str, Any]
    day: str
    truth: dict[str, float]


def traces_of(family: Family, design: Design, seed: int) -> list[Trace]:
    """Draw times and true numbers of the traces of a table, of 40 to 100 readings each."""
    rng = np.random.default_rng(seed)
    count, settings = int(rng.integers(40, 101)), design.traces // DAYS if design.repeated else design.traces
    values = np.resize(family.settings, settings) + np.arange(settings) // len(family.settings)
    traces = []
    for place in range(design.traces):
        kind, day = (place % settings, place // settings) if design.repeated else (place, place % DAYS)
        t = family.step * (np.arange(1, count + 1) + design.jitter * rng.uniform(-1, 1, count))
        share = kind / max(settings - 1, 1)
        truth = {
            name: low + share * (high - low) + scatter * rng.standard_normal()
            for name, (low, high, scatter) in family.own.items()
        }
        columns = {"t_s": t, family.setting: np.full(count, values[kind])}
        traces.append(Trace(columns, f"day {day + 1}", {**family.shared, **truth}))
    return traces


def fitted_traces(family: Family, design: Design, seed: int) -> list[Trace]:
    """Return the traces of a table that are not held out."""
    return [trace for trace in traces_of(family, design, seed) if trace.day != HELD_OUT]


def covariance(t: Floats, family: Family, rho: float) -> Floats:
    """Compute K (n, n) of the readings of a trace at times t (n,)."""
    share = (1 + rho) / 2 if rho else 0.0
    decay = rho / share if rho else 0.0
    slow = decay ** (np.abs(np.subtract.outer(t, t)) / family.step)
    return family.noise**2 * ((1 - share) * np.eye(len(t)) + share * slow)


def whitened_change(family: Family, traces: Sequence[Trace], rho: float, **terms: float) -> Floats:
    """Compute what terms, or numbers that all share, change in the output, whitened with the true K, (n,)."""
    return np.concatenate([_whitened(family, trace, rho, terms) for trace in traces])


def _whitened(family: Family, trace: Trace, rho: float, moved: Parameters) -> Floats:
    columns, _, truth = trace
    change = (
        family.function(columns, {**truth, **moved})[family.output]
        - family.function(columns, truth)[family.output]
    )
    return np.asarray(np.linalg.solve(np.linalg.cholesky(covariance(columns["t_s"], family, rho)), change))


def left_of(family: Family, traces: Sequence[Trace], rho: float, change: Floats) -> Floats:
    """Project what all numbers can absorb, shared ones and those of a trace, out of a whitened change (n,)."""
    blocks = []
    for trace in traces:
        steps = {name: 1e-5 * (abs(trace.truth[name]) or 1.0) for name in (*family.shared, *family.own)}
        up, down = (
            [_whitened(family, trace, rho, {name: trace.truth[name] + sign * by}) for name, by in steps.items()]
            for sign in (1, -1)
        )
        blocks.append(np.transpose(up) - np.transpose(down))
    shared = len(family.shared)
    own = block_diag(*(block[:, shared:] for block in blocks))
    basis = np.linalg.qr(np.column_stack([np.concatenate(blocks)[:, :shared], own]))[0]
    return np.asarray(change - basis @ (basis.T @ change))


def size_at(family: Family, design: Design, seed: int, term: str, strength: float) -> float:
    """Return the size of a term at which its λ is `strength` in the traces that are not held out."""
    fitted, size = fitted_traces(family, design, seed), 1e-6
    for _ in range(5):  # from its slope to its change, which may bend
        change = whitened_change(family, fitted, design.rho, **{term: size})
        size *= strength / float(np.linalg.norm(left_of(family, fitted, design.rho, change)))
    return size


def draw_traces(
    family: Family, design: Design, seed: int, *, noise_seed: int | None = None, **terms: float
) -> pd.DataFrame:
    """Draw a table: columns trace, day, t_s, the setting and the output."""
    rng = np.random.default_rng([seed if noise_seed is None else noise_seed, 1])
    shifts, parts = design.day_shift * family.noise * rng.standard_normal(DAYS), []
    for place, (columns, day, numbers) in enumerate(traces_of(family, design, seed)):
        root = np.linalg.cholesky(covariance(columns["t_s"], family, design.rho))
        noise = root @ rng.standard_normal(len(root)) + shifts[int(day[-1]) - 1]
        value = family.function(columns, {**numbers, **terms})[family.output] + noise
        parts.append(pd.DataFrame({"trace": f"trace {place + 1}", "day": day, **columns, family.output: value}))
    return pd.concat(parts, ignore_index=True)


def model_of_traces(family: Family) -> sf.Model:
    """Make the model of a family."""
    numbers = [sf.Number(name, **declared) for name, declared in family.numbers.items()]
    return sf.Model(
        family.function,
        outputs={family.output: family.declared},
        numbers=numbers,
        effects=family.effects,
        time="t_s",
    )
