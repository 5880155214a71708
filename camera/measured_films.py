"""Films of runs to a table of measured runs: `softflagella calibrate --films runs.csv --view view.toml`."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import pandas as pd

from camera.film import Film
from camera.measured_runs import MIRRORED, MeasuredTracks, measure_tracks
from camera.tracks import track_film, turn_sense
from camera.view import read_setup
from common.errors import InputError, naming
from common.quantities import numbers_of
from common.run_columns import convert_measured
from common.tables import read_table, row_name
from sim.model.robot import Robot


def measure_films(
    runs: str | Path, view: str | Path, robot: Robot, *, tell: Callable[[str], object] = lambda line: None
) -> MeasuredTracks:
    """Track the film of each run, and measure its motion and spins.

    Args:
        runs: a table with `film`, a file beside it or its path, and what was noted of a measured table:
            `N`, `l_cm`, `omega_rpm`, `session`; `start_s` and `end_s`, if a run is a part of its film.
        view: view.toml with one robot.
        robot: the robot as given.
        tell: is told what was left out of a film.

    Raises:
        InputError: a film or the table cannot be used; the message names it.
    """
    table, setup = read_table(runs), read_setup(view)
    if "film" not in table:
        raise InputError(f"{runs} has no column 'film' that names the film of each run")
    if len(setup.robots) > 1:
        raise InputError(f"{view} has {len(setup.robots)} robots; films of runs show one")
    given = {name: numbers_of(table[name]) for name in ("start_s", "end_s") if name in table}
    parts = pd.DataFrame(given, table.index, ["start_s", "end_s"], float).fillna(
        {"start_s": 0.0, "end_s": math.inf}
    )
    with naming(runs):
        noted, converted = convert_measured(table.drop(columns=["film", *given]), str(runs))
    omega = numbers_of(noted["omega_rpm"]) * math.pi / 30
    for index, film in enumerate(table["film"]):
        if not isinstance(film, str):
            raise InputError(f"{runs}: {row_name(table, index)} has no film")
        Film(Path(runs).parent / film)  # refused before the first is tracked, which takes a while
    tracks, scale_error = [], 0.0
    for number, (film, speed, (start, end)) in enumerate(
        zip(table["film"], omega, parts.to_numpy(), strict=True), 1
    ):
        tracked = track_film(
            Path(runs).parent / film,
            setup,
            head_length=robot.head_length,
            motor_speed=abs(speed),
            start=start,
            end=end,
        )
        track, notes = next(iter(tracked.tables.values())), tracked.notes
        if turn_sense(track) * speed < 0:
            notes = [*notes, f"the robot turns to the other side than omega_rpm makes it: {MIRRORED}"]
        for note in notes:
            tell(f"{film}: {note}")
        tracks.append(track.assign(run=number))
        scale_error = max(scale_error, tracked.view.scale_error)  # of a tag, whose scale each film has anew
    if "camera_scale_sigma_percent" not in noted:
        noted["camera_scale_sigma_percent"] = 100 * scale_error
    noted["run"] = range(1, len(noted) + 1)
    measured = measure_tracks(pd.concat(tracks, ignore_index=True), noted, robot=robot)
    return measured._replace(converted=(*converted, *measured.converted))
