"""Raw tracks from a camera to measured outputs: circle, yaw rate, slip angle and speed of every run, with errors.

Tables are checked for what a camera's software often gets wrong: units, the direction of the y axis, the side of
the turn, the size of the motion.

The tracked point must be the head's centre; with another point the calibration finds `tracked_point`. Columns in
other units than COLUMNS are converted. Angles are counter-clockwise, seen from above (docs/reference/signs.md).

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
from collections.abc import Collection
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import NamedTuple, Unpack

import numpy as np
import pandas as pd
from scipy.optimize import least_squares

from calibration.swimmer.measured_table import OUTPUTS
from calibration.swimmer.possible_runs import check_factor
from sim.arrays import Floats
from sim.inputs import RUN, RUN_SYNONYMS, run_columns
from sim.io.errors import InputError, naming
from sim.io.pose_tracks import read_tracks
from sim.io.quantities import convert_columns, numbers_of
from sim.io.tables import read_table, row_name
from sim.io.track_options import TrackOptions
from sim.model.robot import Robot
from sim.motion.batches import steady_columns
from sim.motion.lab_units import lab_motion

COLUMNS = ("run", "time_s", "x_cm", "y_cm", "heading_deg")
_SYNONYMS = {"t": "time"}
LEAST_TURN = math.radians(20)  # smallest turn of a run to which a circle is fitted
_LARGEST = 1e9  # of a sample
_FEWEST = 12  # samples that a run needs
_LISTED = 8  # names of runs in a message
_ALIKE = 1.3  # ratio of the angles by which path and heading turn


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
    """Results of a track, and the fitted positions (m, 2) in cm."""

    result: TrackedRun
    path: Floats


class Track(NamedTuple):
    """A track (m,) and what was fitted to it; positions in cm, x to the right and y upwards."""

    run: object
    x: Floats
    y: Floats
    fit: TrackFit


class MeasuredTracks(NamedTuple):
    """Runs with what their tracks give."""

    table: pd.DataFrame  # for `calibration.swimmer.measured_table`
    excluded: list[str]  # what was left out, and why
    tracks: list[Track]
    converted: tuple[str, ...]  # columns that were renamed or converted, in words


def measure_tracks(
    tracks: str | Path | pd.DataFrame,
    runs: str | Path | pd.DataFrame,
    *,
    y_down: bool = False,
    robot: Robot | None = None,
    **options: Unpack[TrackOptions],
) -> MeasuredTracks:
    """Make a table for `calibration.swimmer.measured_table` from tracks and the settings of each run.

    Args:
        tracks: run, time_s, x_cm, y_cm, heading_deg, or these in other units; one row for each sample.
        runs: run, N, l_cm, omega_rpm and other notes; one row for each run.
        y_down: y and headings are those of a picture, whose y axis points down.
        robot: the robot as given; what the tracks give is compared with its simulated motion.
        options: of tracks that another program has written, see `TrackOptions`.

    Returns:
        The runs with omega_yr_rad_s, R_yr_cm, theta_deg, v_cm_s and their errors, and the fits.

    Raises:
        InputError: a column is missing, headings are in radians, all runs turn to the wrong side, no track gives
            a number, or all are far from what the robot does.
    """
    samples, where = (
        (tracks, "the tracks")
        if isinstance(tracks, pd.DataFrame)
        else (read_tracks(tracks, **options), str(tracks))
    )
    lost = samples.attrs.get("lost", [])
    table, place = (runs, "the runs") if isinstance(runs, pd.DataFrame) else (read_table(runs), str(runs))
    samples, converted = convert_columns(samples, COLUMNS, where, _SYNONYMS)
    table, renamed = convert_columns(table, RUN, place, RUN_SYNONYMS)
    with naming(runs):
        _check_runs(table)
    with naming(tracks):
        measured = _measured(samples, table, y_down, robot)
    return measured._replace(excluded=[*lost, *measured.excluded], converted=(*converted, *renamed))


def _check_runs(table: pd.DataFrame) -> None:
    """Refuse runs that have no names, or that are there twice."""
    if "run" not in table:
        raise InputError("the runs have no column 'run' that says which track is theirs")
    names = _names(table["run"])
    unnamed = np.flatnonzero(names == "")
    if len(unnamed):
        raise InputError(f"{row_name(table, int(unnamed[0]))} of the runs has no name of a run")
    twice = names[names.duplicated()]
    if len(twice):
        raise InputError(f"run {str(twice.iloc[0])[:40]} is there twice; give one row for each run")


def _measured(samples: pd.DataFrame, table: pd.DataFrame, y_down: bool, robot: Robot | None) -> MeasuredTracks:
    for name in COLUMNS:
        if name not in samples:
            raise InputError(f"the tracks have no column {name!r}; they need {', '.join(COLUMNS)}")
    values = pd.DataFrame({name: numbers_of(samples[name]) for name in COLUMNS[1:]}).reset_index(drop=True)
    values[~(values.abs() < _LARGEST)] = np.nan
    of_run = {str(name): track for name, track in values.groupby(_names(samples["run"]).to_numpy(), sort=False)}
    nothing = values.iloc[:0]
    unnamed = of_run.pop("", nothing)
    runs = list(_names(table["run"]))
    if not set(runs) & set(of_run):
        raise InputError(f"no run has a track: the runs are {_listed(runs)}; the tracks are {_listed(of_run)}")
    aside = [f"{len(unnamed)} samples have no name of a run"] if len(unnamed) else []
    aside += [f"run {name}: a track, but no row among the runs" for name in of_run if name not in runs]
    tracked: list[TrackedRun] = []
    fitted: list[Track] = []
    for run in runs:
        track = of_run.get(run, nothing)
        known_samples = track.notna().all(axis=1)
        if not known_samples.all():
            aside.append(f"run {run}: {int((~known_samples).sum())} samples with a value that is not a number")
        track = track[known_samples]
        back = track.index[1:][np.diff(track["time_s"]) < 0]
        if len(back) or len(track) < _FEWEST:
            aside.append(
                f"run {run}: its time goes back at {row_name(samples, back[0])}; give its samples in order, with "
                "a clock that runs on"
                if len(back)
                else f"run {run}: {len(track)} samples; a track needs at least {_FEWEST}"
            )
            tracked.append(TrackedRun())
            continue
        time, x, y, heading = (track[c].to_numpy(dtype=float) for c in COLUMNS[1:])
        _check_radians(run, x, y, heading)
        side = -1.0 if y_down else 1.0
        fit = _fitted(time, x, side * y, side * heading)
        tracked.append(TrackedRun() if fit is None else fit.result)
        if fit is None:
            aside.append(f"run {run}: neither a circle nor a line fits its samples")
            continue
        fitted.append(Track(run, x, side * y, fit))
    columns = pd.DataFrame([asdict(p) for p in tracked], index=table.index)
    known = [c for c in columns if columns[c].notna().any()]
    if not known:
        raise InputError(f"no track gives a number{f' ({aside[0]})' if aside else ''}; check the tracks")
    _check_sides(table, columns, y_down)
    if robot is not None:
        _check_motion(robot, table, columns)
    return MeasuredTracks(pd.concat([table, columns[known]], axis=1), aside, fitted, ())


def _names(column: pd.Series) -> pd.Series:
    """Write the names of runs as text without blanks around it; a whole number has one spelling."""
    return column.astype(str).fillna("").str.strip().str.replace(r"^0*([0-9]+)(?:\.0*)?$", r"\1", regex=True)


def _listed(names: Collection[str]) -> str:
    more = f", … ({len(names)})" if len(names) > _LISTED else ""
    return ", ".join(list(names)[:_LISTED]) + more


def _fitted(time: Floats, x: Floats, y: Floats, heading_deg: Floats) -> TrackFit | None:
    """Fit a track; None where it gives no speed, as samples of one time or one place do."""
    if not np.ptp(time) > 1e-9 * np.abs(time).max():
        return None
    try:
        with np.errstate(all="ignore"):
            fit = fit_track(time, x, y, heading_deg)
    except (ArithmeticError, ValueError, np.linalg.LinAlgError):
        return None
    return fit if math.isfinite(fit.result.v_cm_s) and math.isfinite(fit.result.theta_deg) else None


def _check_radians(run: object, x: Floats, y: Floats, heading_deg: Floats) -> None:
    """Refuse headings that follow the path if they are taken as radians, and hardly turn as degrees.

    Raises:
        InputError: they seem to be in radians.
    """
    if np.abs(heading_deg).max() > math.tau:
        return
    stride = max(len(x) // _FEWEST, 1)
    path = np.ptp(np.unwrap(np.arctan2(y[stride:] - y[:-stride], x[stride:] - x[:-stride])))
    heading = np.ptp(np.unwrap(heading_deg))
    if path > math.radians(60) and 1 / _ALIKE < path / max(heading, 1e-9) < _ALIKE:
        raise InputError(
            f"run {run}: heading_deg turns by {heading:.2f}, the path by {math.degrees(path):.0f} degrees: "
            "the headings seem to be in radians; convert them"
        )


def _check_sides(runs: pd.DataFrame, measured: pd.DataFrame, y_down: bool) -> None:
    """Compare the side to which each run turns with the direction of its motor.

    Raises:
        InputError: all runs turn to the wrong side.
    """
    if "omega_rpm" not in runs:
        return
    sides = np.sign(pd.to_numeric(runs["omega_rpm"], errors="coerce") * measured["omega_yr_rad_s"])
    if (sides < 0).any() and not (sides > 0).any():
        remedy = "leave out --y-down" if y_down else "give --y-down if the camera's y axis points down"
        raise InputError(
            "all runs turn to the other side than their motors make them (seen from above, a positive omega_rpm "
            f"turns to the left): {remedy}, or change the sign of omega_rpm"
        )


def _check_motion(robot: Robot, runs: pd.DataFrame, measured: pd.DataFrame) -> None:
    """Compare what the tracks give with the simulated motion of the robot as given.

    Raises:
        InputError: the runs lack a setting, or an output is far from the simulated one in all runs together.
    """
    missing = [name for name in RUN if name not in runs]
    if missing:
        raise InputError(f"the runs have no column {missing[0]!r}; the comparison with a robot needs it")
    settings = runs[list(RUN)].apply(numbers_of)
    usable = (settings["N"] >= 1) & (settings["l_cm"] > 0) & (settings["omega_rpm"].abs() > 0)
    if not usable.any():
        return
    swimmers, columns = run_columns(settings[usable], robot, "the runs")
    simulated = lab_motion(swimmers, steady_columns(columns, stability=False))
    for output in ("omega_yr", "R_yr", "theta", "v"):
        column = OUTPUTS[output][0]
        factors = np.abs(measured[column][usable].to_numpy(dtype=float) / simulated[column])
        if np.isfinite(factors).any():
            check_factor(output, float(np.nanmedian(factors)))


def fit_track(time: Floats, x: Floats, y: Floats, heading_deg: Floats) -> TrackFit:
    """Fit a circle or a line to one track; arrays (m,), in s, cm and degrees."""
    time = time - time.mean()
    heading = np.unwrap(np.radians(heading_deg))
    rate, middle = np.polyfit(time, heading, 1)
    if abs(rate) * np.ptp(time) < LEAST_TURN:
        return _line(time, x, y, heading)
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
    return TrackFit(result, path(fitted.x).T)


def _line(time: Floats, x: Floats, y: Floats, heading: Floats) -> TrackFit:
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
    return TrackFit(result, np.stack([design @ fits[0], design @ fits[1]], 1))


def _covariance(J: Floats, residual: Floats, parts: int) -> Floats:
    """Estimate the covariance of a fit to `parts` series in time, each with its own scatter and correlation."""
    inverse = np.linalg.pinv(J.T @ J)
    middle = np.zeros_like(inverse)
    for rows, series in zip(np.split(J, parts), np.split(residual, parts), strict=True):
        variance = float(series @ series) / max(len(series) - J.shape[1] / parts, 1)
        middle += variance * _correlation_time(series) * rows.T @ rows
    return np.asarray(inverse @ middle @ inverse)


def _correlation_time(residual: Floats) -> float:
    """Compute the integrated autocorrelation time in samples, at least 1 (summed up to its first zero)."""
    centred = residual - residual.mean()
    power = np.abs(np.fft.rfft(centred, 2 * len(centred))) ** 2
    correlation = np.fft.irfft(power)[: len(centred)]
    if correlation[0] <= 0:
        return 1.0
    correlation = correlation / correlation[0]
    end = int(np.argmax(correlation <= 0)) or len(correlation)
    return float(max(1.0, 1 + 2 * correlation[1:end].sum()))
