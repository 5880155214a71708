"""A track at constant motor speed as a circle: turn radius, yaw rate, slip angle and speed, with their errors.

A run at constant motor speed is a circle with a heading that turns at the same rate,

    x = c_x + R cos α,  y = c_y + R sin α,  heading = h0 + ω_yr t,   α = α0 + ω_yr t,

fitted to all samples of a run at once (least squares; positions and heading weighted by their own scatter). A run
of a whole turn or more also shows whether the circle drifts in a current, c → c + U t. Then its radius and speed
are those relative to the fluid. The slip angle is the angle between the heading and the tangent of the circle. The
speed is R |ω_yr|. Samples of a camera are not independent, because the robot wobbles as its disc turns. So
standard errors are widened by the correlation time of the residuals. A run that turns by less than LEAST_TURN is
fitted by a straight line. It gives only a speed and a slip angle.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares

from camera.correlation import correlation_time
from camera.gaps import unwrapped
from common.arrays import Floats

LEAST_TURN = math.radians(20)  # smallest turn of a run to which a circle is fitted


@dataclass(frozen=True)
class TrackedRun:
    """Results of one track; NaN where it does not give a result; errors are standard errors."""

    omega_yr_rad_s: float = math.nan
    omega_yr_error: float = math.nan
    R_yr_cm: float = math.nan
    R_yr_error: float = math.nan
    theta_deg: float = math.nan
    theta_error: float = math.nan
    v_cm_s: float = math.nan
    v_error: float = math.nan
    drift_x_cm_s: float = math.nan  # of the circle
    drift_y_cm_s: float = math.nan
    drift_error: float = math.nan


class TrackFit(NamedTuple):
    """Results of a track, and the fitted positions in cm of the samples that were used."""

    result: TrackedRun
    path: Floats
    used: slice  # of the samples; a gap ends them, see `camera.gaps`


def fit_track(time: Floats, x: Floats, y: Floats, heading_deg: Floats) -> TrackFit:
    """Fit a circle or a line to one track; arrays (m,), in s, cm and degrees."""
    heading, used = unwrapped(time, np.radians(heading_deg))
    time, x, y, heading = time[used] - time[used].mean(), x[used], y[used], heading[used]
    rate, middle = np.polyfit(time, heading, 1)
    if abs(rate) * np.ptp(time) < LEAST_TURN:
        return _line(time, x, y, heading, used)
    scatter_h = max(float(np.std(heading - rate * time - middle)), 1e-9)
    # On the circle the position is linear in (c_x, c_y, R cos α0, R sin α0) for a given rate.
    drifts = abs(rate) * np.ptp(time) >= 2 * math.pi
    turn = np.exp(1j * rate * time)
    design = np.stack([np.ones_like(turn), turn, *([time] if drifts else [])], 1)
    weights = np.linalg.lstsq(design, x + 1j * y, rcond=None)[0]
    centre, arm, *drift = weights
    scatter = max(float(np.abs(x + 1j * y - design @ weights).std() / math.sqrt(2)), 1e-9)
    start = [centre.real, centre.imag, abs(arm), np.angle(arm), rate, middle]
    start += [part for u in drift for part in (u.real, u.imag)]

    def path(p: Floats) -> Floats:
        angle = p[3] + p[4] * time
        u, w = (p[6], p[7]) if drifts else (0.0, 0.0)
        return np.stack([p[0] + u * time + p[2] * np.cos(angle), p[1] + w * time + p[2] * np.sin(angle)])

    def residual(p: Floats) -> Floats:
        off_x, off_y = (np.stack([x, y]) - path(p)) / scatter
        return np.concatenate([off_x, off_y, (heading - p[5] - p[4] * time) / scatter_h])

    fitted = least_squares(residual, start, x_scale=np.maximum(np.abs(start), 1e-3))
    covariance = _covariance(np.asarray(fitted.jac), fitted.fun, 3)
    radius, angle, rate, middle, *drift = fitted.x[2:]
    drifted = [*map(float, drift), math.sqrt((covariance[6, 6] + covariance[7, 7]) / 2)] if drifts else []
    tangent = angle + math.copysign(math.pi / 2, rate)
    slip = abs(math.remainder(middle - tangent, 2 * math.pi))
    slip_error = math.sqrt(covariance[3, 3] + covariance[5, 5] - 2 * covariance[3, 5])
    speed_error = math.sqrt(
        rate**2 * covariance[2, 2] + radius**2 * covariance[4, 4] + 2 * abs(rate) * radius * covariance[2, 4]
        * math.copysign(1, rate)
    )  # fmt: skip
    result = TrackedRun(
        float(rate), math.sqrt(covariance[4, 4]), float(radius), math.sqrt(covariance[2, 2]), math.degrees(slip),
        math.degrees(slip_error), float(abs(rate) * radius), speed_error,
        *drifted,
    )  # fmt: skip
    return TrackFit(result, path(fitted.x).T, used)


def _line(time: Floats, x: Floats, y: Floats, heading: Floats, used: slice) -> TrackFit:
    design = np.stack([np.ones_like(time), time], 1)
    fits, variances = [], []
    for values in (x, y, heading):
        line = np.linalg.lstsq(design, values, rcond=None)[0]
        fits.append(line)
        variances.append(_covariance(design, values - design @ line, 1))
    v_x, v_y = fits[0][1], fits[1][1]
    speed = math.hypot(v_x, v_y)
    error = math.sqrt((v_x**2 * variances[0][1, 1] + v_y**2 * variances[1][1, 1]) / speed**2)
    slip = abs(math.remainder(fits[2][0] - math.atan2(v_y, v_x), 2 * math.pi))
    slip_error = math.sqrt(variances[2][0, 0] + (error / speed) ** 2)
    result = TrackedRun(
        theta_deg=math.degrees(slip), theta_error=math.degrees(slip_error), v_cm_s=speed, v_error=error
    )
    return TrackFit(result, np.stack([design @ fits[0], design @ fits[1]], 1), used)


def _covariance(J: Floats, residual: Floats, parts: int) -> Floats:
    """Estimate the covariance of a fit to `parts` series in time, each with its own scatter and correlation."""
    inverse = np.linalg.pinv(J.T @ J)
    middle = np.zeros_like(inverse)
    for rows, series in zip(np.split(J, parts), np.split(residual, parts), strict=True):
        variance = float(series @ series) / max(len(series) - J.shape[1] / parts, 1)
        middle += variance * correlation_time(series) * rows.T @ rows
    return np.asarray(inverse @ middle @ inverse)
