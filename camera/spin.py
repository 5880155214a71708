"""The spin of head or tails from a dot that comes and goes.

A dot on the side of a body that spins at ω about the robot's axis, seen from above, is left of the axis by u and
shows the area A,

    u = −r sin(φ₀ + ω t),     A = A₀ max(cos(φ₀ + ω t), 0),

with ω positive clockwise, seen from behind (docs/reference/signs.md). Each series is fitted by its mean and by a
cosine and a sine of |ω| t (least squares; Lomb and Scargle's periodogram with a mean), both weighted by their
scatter; |ω| has the smallest sum of squares. Whether A leads or follows u is the sign. The standard error is that
of least squares, from the curvature of the sum at its minimum, widened by the correlation of the residuals.

Frames at a rate f show the same for ω and ω ± 2π f: spins up to the motor's speed are told apart above two frames
a turn, and safely from `FRAMES_A_TURN` on.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from camera.correlation import correlation_time
from common.arrays import Floats

FRAMES_A_TURN = 4.0  # that a spin needs
_FEWEST = 12  # samples of a dot
_TURNS = 2.0  # that a track must cover
_ROUNDED = 0.1  # frames a second, by which time stamps in milliseconds may state another rate
_FINER = 8  # frequencies within the width of a peak of the periodogram


class Spin(NamedTuple):
    """A spin with its standard error [rad/s], positive clockwise seen from behind."""

    omega: float = math.nan
    error: float = math.nan
    sign_seen: bool = False  # from the dot; otherwise only the magnitude is known


def fit_spin(time: Floats, left: Floats, area: Floats, fastest: float) -> Spin | str:
    """Fit the spin of a dot, or say why there is none.

    Args:
        time: of the frames (m,) in which the robot was seen [s].
        left: of the axis, in any unit; NaN where the dot is out of sight (m,).
        area: of the dot, in any unit; 0 where it is out of sight (m,).
        fastest: magnitude that the spin does not exceed, the motor's speed [rad/s].
    """
    seen = np.isfinite(left)
    if seen.sum() < _FEWEST:
        return f"the dot is seen in {int(seen.sum())} frames; check its colour"
    if reason := aliasing(time, fastest):
        return reason
    span, middle = float(np.ptp(time)), float(time.mean())
    series = [(time[seen] - middle, left[seen]), (time - middle, area / max(float(area.max()), 1e-300))]
    if np.std(series[1][1]) < 1e-9:
        del series[1]
    # The frequencies above the motor's speed are scanned, too: a peak there is noise, and no spin.
    grid = np.arange(_TURNS * math.tau / span, 1.2 * fastest, math.tau / span / _FINER)
    if len(grid) < 3:
        return "the track is too short for a spin; film at least three turns of the head"
    sums = _sums(grid, series)
    best = int(np.argmin(sums))
    if best in (0, len(grid) - 1) or sums[best] > 0.7 * float(np.median(sums)):
        return "the dot does not come and go regularly; check its colour, and that the motor did not change"
    omega = float(grid[best])
    for step in (grid[1] - grid[0], (grid[1] - grid[0]) / 20):
        low, at, high = _sums(np.array([omega - step, omega, omega + step]), series)
        omega += float(np.clip(0.5 * step * (low - high) / (low - 2 * at + high), -step, step))
    low, at, high = _sums(np.array([omega - step, omega, omega + step]), series)
    parts = [_fitted(omega, *each) for each in series]
    wider = max(correlation_time(residual) for _, residual in parts)
    freedom = sum(len(values) for _, values in series) - 3 * len(series) - 1
    error = step * math.sqrt(2 * wider * at / freedom / max(low - 2 * at + high, 1e-300))
    sign_seen, sign = False, 1.0
    if len(parts) == 2:
        (_, a, b), (_, c, d) = (weights for weights, _ in parts)
        sign_seen = math.hypot(c, d) > 0.2  # a dot that is always seen shows no front and no back
        sign = math.copysign(1.0, a * d - b * c) if sign_seen else 1.0
    return Spin(sign * omega, error, sign_seen)


def aliasing(time: Floats, fastest: float) -> str:
    """Say that frames at times (m,) [s] are too few for spins up to `fastest` [rad/s]; "" if they are not."""
    rate = 1 / float(np.median(np.diff(time)))
    needed = FRAMES_A_TURN * fastest / math.tau - _ROUNDED
    if not rate < needed:
        return ""
    return (
        f"{rate:.3g} frames a second cannot tell spins up to {fastest * 30 / math.pi:.0f} rpm apart (aliasing); "
        f"film with {math.ceil(needed)} or more, or slow the motor down"
    )


def _fitted(omega: float, time: Floats, values: Floats) -> tuple[Floats, Floats]:
    """Return mean, cosine and sine (3,) and residuals of a series."""
    design = np.stack([np.ones_like(time), np.cos(omega * time), np.sin(omega * time)], 1)
    weights = np.linalg.lstsq(design, values, rcond=None)[0]
    return weights, values - design @ weights


def _sums(grid: Floats, series: list[tuple[Floats, Floats]]) -> Floats:
    """Return the sum of the squares of the residuals at frequencies of equal distance; each series in its scatter.

    The normal equations of `_fitted` need three sums at each frequency, of which one is turned into the next.
    """
    total = np.zeros(len(grid))
    for time, values in series:
        off, count = values - values.mean(), len(time)
        turn, onward, sums = np.exp(1j * grid[0] * time), np.exp(1j * (grid[1] - grid[0]) * time), []
        for _ in grid:
            sums.append((turn.sum(), turn @ turn, turn @ off))
            turn *= onward
        once, twice, seen = np.array(sums).T
        cosine, mixed, sine = (count + twice.real) / 2, twice.imag / 2, (count - twice.real) / 2
        normal = np.array([[np.full(len(grid), count), once.real, once.imag], [once.real, cosine, mixed],
                           [once.imag, mixed, sine]]).transpose(2, 0, 1)  # fmt: skip
        right = np.stack([np.zeros(len(grid)), seen.real, seen.imag], 1)
        squares = off @ off - np.sum(right * np.linalg.solve(normal, right[..., None])[..., 0], 1)
        total += squares / max(float(values.var()), 1e-300)
    return total
