"""Held-out error of the look-up table, per output.

For outputs that keep their sign, the error is relative. For θ it is in degrees. For v_z and for the response to
a flip it is relative to the distance (or turn) of the robot in one unit of time. For the net speed it is
relative to v_z, its limit for long dwells. Reported are the root mean square, the median, the 95th percentile
and the largest error over rows whose tails do not touch, where the model is valid, and the same over all rows.
Stated errors are those of robots with two tails and more without effects; robots with one tail have errors several
times as large, and wider intervals. `coverage` is the share of rows inside their interval.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from common.arrays import Flags, Floats
from sim.model.response import LAGS
from sim.motion.steady_motion import STEADY_OUTPUTS

Columns = Mapping[str, Any]
Errors = Mapping[str, Mapping[str, float]]  # output -> figures of `summary`

RELATIVE = ("omega_t_bar", "omega_h_bar", "omega_yr_bar", "v_x", "R_yr_over_l", "tail_gap")
COMPARED = (*RELATIVE, "v_z", "theta_deg")
RESPONSE_OUTPUTS = ("net_speed_bar", *LAGS[::-1])
OUTPUTS = (*STEADY_OUTPUTS, *RESPONSE_OUTPUTS)  # that have an interval
ITSELF, ONE, SPEED, SURGE, YAW_RATE = range(5)  # what an error is relative to
SCALES = {
    **dict.fromkeys(RELATIVE, ITSELF), **dict.fromkeys(("v_z", "lag_x", "lag_z"), SPEED),
    "theta_deg": ONE, "net_speed_bar": SURGE, "lag_psi_rad": YAW_RATE,
}  # fmt: skip
RATES = ("omega_t_bar", "omega_h_bar", "omega_yr_bar")
_VELOCITIES = ("v_x", "v_z")
CERTIFIED_OUTPUTS = (*RATES, *_VELOCITIES)
_POOR = 0.05  # a 95th percentile from which on `shortcomings` speaks
_UNITS = {"theta_deg": "deg", "lag_psi_rad": "of turn/unit", "v_z": "of speed", "lag_x": "of speed",
          "lag_z": "of speed", "net_speed_bar": "of v_z"}  # fmt: skip


def error_scale(name: str, truth: Columns) -> Floats | float:
    """Return the number by which the error of an output is divided."""
    kind = SCALES[name]
    if kind == ITSELF:
        return np.abs(truth[name])
    if kind == ONE:
        return 1.0
    if kind == SPEED:
        return np.hypot(truth["v_x"], truth["v_z"])
    return np.abs(truth["v_z" if kind == SURGE else "omega_yr_bar"])


def relative_errors(answer: Columns, truth: Columns) -> dict[str, Floats]:
    """Return errors of every steady output over its scale, (M,)."""
    with np.errstate(invalid="ignore"):  # one tail has no gap
        return {name: (answer[name] - truth[name]) / error_scale(name, truth) for name in COMPARED}


def certified_error(robots: Mapping[str, Floats], answer: Mapping[str, Any]) -> Floats:
    """Certify the relative error of each robot's answer, (M,); NaN where the simulator finds no steady motion."""
    from sim.motion.batches import steady_columns  # a query that is not certified needs no simulator

    simulated = steady_columns(robots, stability=False, title="certify")
    speed = np.hypot(simulated["v_x"], simulated["v_z"])
    apart = [np.abs(answer[name] / simulated[name] - 1) for name in RATES]
    apart += [np.abs(answer[name] - simulated[name]) / speed for name in _VELOCITIES]
    error = np.max(apart, axis=0) + simulated["error"]
    return np.where(simulated["converged"], error, np.nan)


def curve_errors(response: Any, truth: Columns) -> dict[str, Floats]:
    """Return errors of the response, (M, D) over the dwells.

    Args:
        response: of the table.
        truth: columns of the steady motion; `lag` (M, D, 3) and `net_speed` (M, D) of the simulator.
    """
    errors = {}
    for i, name in enumerate(LAGS):
        errors[name] = (response.lag - truth["lag"])[..., i] / np.asarray(error_scale(name, truth))[:, None]
    speed = np.asarray(error_scale("net_speed_bar", truth))[:, None]
    return errors | {"net_speed_bar": (response.net_speed - truth["net_speed"]) / speed}


def summary(errors: Mapping[str, Floats], valid: Flags) -> dict[str, dict[str, float]]:
    """Return figures of errors (M, …) by output; `valid` (M,) marks rows whose tails do not touch."""
    report: dict[str, dict[str, float]] = {}
    for name, error in errors.items():
        known = np.isfinite(error)
        untouched = np.abs(error[valid & known] if error.ndim == 1 else error[valid][known[valid]])
        every = np.abs(error[known])
        if not len(every):
            continue
        untouched = untouched if len(untouched) else every
        report[name] = {
            "rms": float(np.sqrt(np.mean(untouched**2))),
            "median": float(np.median(untouched)),
            "p95": float(np.quantile(untouched, 0.95)),
            "largest": float(untouched.max()),
            "rms_with_touching": float(np.sqrt(np.mean(every**2))),
            "p95_with_touching": float(np.quantile(every, 0.95)),
        }
    return report


def coverage(answer: Columns, truth: Columns) -> dict[str, float]:
    """Return the share of rows whose true value lies inside the interval, by output; not of one without rows."""
    shares = {}
    for name in COMPARED:
        if f"{name}_low" in answer:
            known = np.isfinite(truth[name])
            inside = (truth[name] >= answer[f"{name}_low"]) & (truth[name] <= answer[f"{name}_high"])
            if known.any():
                shares[name] = float(np.mean(inside[known]))
    return shares


def shortcomings(errors: Errors) -> list[str]:
    """List warnings about a table that is too inaccurate for planning."""
    warnings = []
    for name, words in (("omega_yr_bar", "the yaw rate"), ("net_speed_bar", "the net speed")):
        error = errors.get(name)
        if error and error["p95"] > _POOR:
            warnings.append(
                f"{words} is off by {100 * error['p95']:.0f} % at 95 % of the held-out rows; learn more rows, or "
                "give robots tables of their own (softflagella surrogate robot)"
            )
    return warnings


def error_table(errors: Errors) -> str:
    """Format the held-out errors as text."""
    lines = [f"{'output':16}{'rms':>9}{'median':>9}{'95 %':>9}{'largest':>9}{'95 %, all':>11}"]
    for name, error in errors.items():
        percent = 1 if name == "theta_deg" else 100
        figures = "".join(f"{percent * error[k]:9.4f}" for k in ("rms", "median", "p95"))
        figures += f"{percent * error['largest']:9.2f}{percent * error['p95_with_touching']:11.4f}"
        lines.append(
            f"{name:16}{figures}  {_UNITS.get(name, '%') if percent == 1 else '% ' + _UNITS.get(name, '')}"
        )
    return "\n".join(line.rstrip() for line in lines)
