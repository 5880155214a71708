"""Raw tracks from a camera to measured outputs: circle, yaw rate, slip angle and speed of every run, with errors.

Tables are checked for what a camera's software often gets wrong: units, the direction of the y axis, the side of
the turn, the size of the motion.

The tracked point must be the head's centre; with another point the calibration finds `tracked_point`. Columns in
other units than COLUMNS are converted. Angles are counter-clockwise, seen from above (docs/reference/signs.md).

`camera.circle` fits each run; a run that turns by less than LEAST_TURN gives only a speed and a slip angle.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import asdict
from pathlib import Path
from typing import NamedTuple, Unpack

import numpy as np
import pandas as pd

from camera.circle import TrackedRun, TrackFit, fit_track
from camera.gaps import seen_poses
from camera.pose_tracks import read_tracks, run_names
from camera.spin import fit_spin
from common.arrays import Floats
from common.errors import InputError, naming
from common.quantities import convert_columns, numbers_of
from common.run_columns import MEASURED, RUN, RUN_SYNONYMS, check_factor
from common.tables import read_table, row_name
from common.track_options import TrackOptions
from sim.inputs import run_columns
from sim.model.robot import Robot
from sim.motion.batches import steady_columns
from sim.motion.steady_motion import lab_motion

COLUMNS = ("run", "time_s", "x_cm", "y_cm", "heading_deg")
_DOTS = ("head_left_cm", "head_area_mm2", "tail_left_cm", "tail_area_mm2")  # of films, see `camera.tracks`
_SYNONYMS = {"t": "time"}
_LARGEST = 1e9  # of a sample
_FEWEST = 12  # samples that a run needs
_LISTED = 8  # names of runs in a message
_TAIL_FIRST = 100.0  # degrees of slip; the model stays below 92, with any effect of the catalogue
MIRRORED = 'give --y-down if the camera\'s y axis points down, or of a film looks = "up" in view.toml'
_ALIKE = 1.3  # ratio of the angles by which path and heading turn


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
    samples = read_tracks(tracks, **options)
    where = "the tracks" if isinstance(tracks, pd.DataFrame) else str(tracks)
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
    names = run_names(table["run"])
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
    of_run = _tracks_by_run(samples)
    nothing = pd.DataFrame(columns=COLUMNS[1:], dtype=float)
    unnamed = of_run.pop("", nothing)
    runs = list(run_names(table["run"]))
    if not set(runs) & set(of_run):
        raise InputError(f"no run has a track: the runs are {_listed(runs)}; the tracks are {_listed(of_run)}")
    aside = [f"{len(unnamed)} samples have no name of a run"] if len(unnamed) else []
    aside += [f"run {name}: a track, but no row among the runs" for name in of_run if name not in runs]
    tracked: list[TrackedRun] = [TrackedRun() for _ in runs]
    spins: list[dict[str, float]] = [{} for _ in runs]
    fitted: list[Track] = []
    for index, run in enumerate(runs):
        track = _usable(of_run.get(run, nothing), run, samples, aside)
        if track is None:
            continue
        time, x, y, heading = (track[c].to_numpy(dtype=float) for c in COLUMNS[1:])
        _check_radians(run, x, y, heading)
        # A picture's y points down: mirrored, a left turn is a left turn again.
        side = -1.0 if y_down else 1.0
        fit = _fitted(time, x, side * y, side * heading)
        if fit is None:
            aside.append(f"run {run}: neither a circle nor a line fits its samples")
            continue
        if len(fit.path) < len(time):
            aside.append(
                f"run {run}: {len(fit.path)} of {len(time)} samples are used, the longest part; how far the robot "
                "turned in a gap beside it is unknown"
            )
        tracked[index] = fit.result
        fitted.append(Track(run, x[fit.used], side * y[fit.used], fit))
        spins[index], reasons = _spins(track, table.iloc[index], fit.result.omega_yr_rad_s)
        aside += [f"run {run}: {reason}" for reason in reasons]
    columns = pd.DataFrame([asdict(p) | s for p, s in zip(tracked, spins, strict=True)], index=table.index)
    known = [c for c in columns if columns[c].notna().any()]
    if not known:
        raise InputError(f"no track gives a number{f' ({aside[0]})' if aside else ''}; check the tracks")
    # One wrong sense may be an error of a row; all of them are one of the camera.
    _check_senses(table, columns, y_down)
    if robot is not None:
        _check_motion(robot, table, columns)
    return MeasuredTracks(pd.concat([table, columns[known]], axis=1), aside, fitted, ())


def _tracks_by_run(samples: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """Divide samples by the names of their runs; what is no number of a possible size becomes NaN."""
    dots = [name for name in _DOTS if name in samples]
    values = pd.DataFrame({name: numbers_of(samples[name]) for name in (*COLUMNS[1:], *dots)})
    values = values.reset_index(drop=True)
    values[~(values.abs() < _LARGEST)] = np.nan
    return {str(name): track for name, track in values.groupby(run_names(samples["run"]).to_numpy(), sort=False)}


def _usable(track: pd.DataFrame, run: str, samples: pd.DataFrame, aside: list[str]) -> pd.DataFrame | None:
    """Return the samples of a run that have all values; None where they make no track.

    Args:
        track: the samples of the run.
        run: its name.
        samples: of all runs, to name a row.
        aside: is told what is left out, and why.
    """
    known = track[list(COLUMNS[1:])].notna().all(axis=1)
    if not known.all():
        aside.append(f"run {run}: {int((~known).sum())} samples with a value that is not a number")
    track = track[known]
    back = track.index[1:][np.diff(track["time_s"]) < 0]
    if len(back):
        aside.append(
            f"run {run}: its time goes back at {row_name(samples, back[0])}; give its samples in order, with a "
            "clock that runs on"
        )
    elif len(track) < _FEWEST:
        aside.append(f"run {run}: {len(track)} samples; a track needs at least {_FEWEST}")
    else:
        values = track[list(COLUMNS[1:])].to_numpy(dtype=float)
        seen, lines = seen_poses(values[:, 0], values[:, 1:])
        aside += [f"run {run}: {line}" for line in lines]
        return track[seen]
    return None


def _spins(track: pd.DataFrame, run: pd.Series, yaw: float) -> tuple[dict[str, float], list[str]]:
    """Return the spins that a run's dots show, signed as the motor where a dot has no sign, and what failed."""
    given = float(pd.to_numeric(run.get("omega_rpm", math.nan), errors="coerce"))
    direction = math.copysign(1.0, given if math.isfinite(given) else yaw)
    spins: dict[str, float] = {}
    reasons = []
    for body, letter, sense in (("head", "h", -1.0), ("tail", "t", 1.0)):
        noted = f"omega_{letter}_rpm" in run
        if noted or f"{body}_left_cm" not in track or not math.isfinite(given):
            continue
        time, left, area = (track[c].to_numpy() for c in ("time_s", f"{body}_left_cm", f"{body}_area_mm2"))
        spin = fit_spin(time, left, area, abs(given) * math.pi / 30)
        if isinstance(spin, str):
            reasons.append(f"no spin of the {body}: {spin}")
            continue
        signed = spin.omega if spin.sign_seen else direction * sense * abs(spin.omega)
        spins |= {f"omega_{letter}_rpm": signed * 30 / math.pi, f"omega_{letter}_error": spin.error * 30 / math.pi}
    return spins, reasons


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


def _check_senses(runs: pd.DataFrame, measured: pd.DataFrame, y_down: bool) -> None:
    """Compare the senses in which each run turns and its head spins with the direction of its motor.

    Raises:
        InputError: all runs turn to the wrong side, or all swim tail first.
    """
    omega = numbers_of(runs["omega_rpm"]).to_numpy() if "omega_rpm" in runs else math.nan
    outputs = measured.reindex(columns=["omega_yr_rad_s", "omega_h_rpm", "theta_deg"])
    yaw, head, slip = outputs.to_numpy(dtype=float, copy=True).T
    if _all_above_zero(-omega * yaw):
        raise InputError(
            "all runs turn to the other side than their motors make them (seen from above, a positive omega_rpm "
            f"turns to the left): {'leave out --y-down' if y_down else MIRRORED}, or change the sign of omega_rpm"
        )
    tails = numbers_of(runs["N"]).to_numpy() if "N" in runs else math.nan
    slip[np.isnan(yaw) | (tails == 1)] = math.nan  # a line may drift, and some robots with one tail go tail first
    if _all_above_zero(omega * head) or _all_above_zero(slip - _TAIL_FIRST):
        raise InputError(
            "all runs swim tail first, or their heads spin with the motors: front and rear are exchanged; of a "
            "film exchange their colours in view.toml (turn a tag by 180 degrees), of other tracks --front and "
            "--rear"
        )


def _all_above_zero(values: Floats) -> bool:
    """Tell whether there are values above 0, and none below."""
    return bool((values > 0).any() and not (values < 0).any())


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
        column = MEASURED[output].column
        factors = np.abs(measured[column][usable].to_numpy(dtype=float) / simulated[column])
        if np.isfinite(factors).any():
            check_factor(output, float(np.nanmedian(factors)))
