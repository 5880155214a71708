"""Tracks as tables of poses, also of what other programs have tracked: run, time_s, x_cm, y_cm, heading_deg.

A pose needs two points on the axis of the robot, equally far ahead of and behind the head's centre:

    (x, y) = (front + rear) / 2,   heading = atan2(y_front - y_rear, x_front - x_rear)

A rigid body of Motive and a TUM trajectory have a heading of their own. The y axis of pictures points down and
is reversed. Where a program is not sure of a point (`TrackingProgram.likely`), the pose is lost.
"""

from __future__ import annotations

import math
import re
import warnings
from contextlib import suppress
from pathlib import Path
from typing import Unpack

import numpy as np
import pandas as pd

from camera.tracking_programs import PROGRAMS, TrackedPoints, TrackingProgram
from common.errors import InputError, naming
from common.reading import read_bytes
from common.tables import read_table
from common.track_options import TrackOptions
from common.units import number_and_unit, of_kind, to_si

_LISTED, _HEAD = 8, 400  # names in a message; bytes that tell which program wrote a file


def read_tracks(source: str | Path | pd.DataFrame, **options: Unpack[TrackOptions]) -> pd.DataFrame:
    """Read tracks that the program `written_by` has written; without it a table, which is returned as it is.

    A run is named as its file, without what DeepLabCut adds from "DLC" on. Where a file has several robots, each
    is a run, with its name behind that of the file. `attrs["lost"]` says how many poses are lost.

    Raises:
        InputError: the file is not as the program writes it, or an option is missing, or has no meaning for it.
    """
    name = options.get("written_by")
    if isinstance(source, pd.DataFrame):
        if given := sorted(each for each, value in options.items() if value is not None):
            raise InputError(f"{given[0]} is for the file of another program, not for a DataFrame; leave it out")
        return source
    path = Path(source)
    if name is None:
        if others := options.keys() - {"written_by"}:
            raise InputError(f"--{min(others)} is for tracks of another program; say which with --from")
        start = read_bytes(path, first=_HEAD).decode("latin-1").removeprefix("ï»¿") if path.is_file() else ""
        wrote = [name for name, program in PROGRAMS.items() if re.match(program.begins, start)]
        if not wrote:
            return read_table(path)
        if wrote != ["tum"]:  # which needs no options
            asked = f"say what wrote it: --from {' or '.join(wrote)}{_also_missing(path, wrote)}"
            raise InputError(f"{path} is no table of poses; {asked}")
        name = "tum"
    if name not in PROGRAMS:
        raise InputError(f"no program {name!r}; there are {', '.join(PROGRAMS)}")
    program, runs = PROGRAMS[name], []
    for file in _films(path, program) if path.is_dir() else [path]:
        try:
            with warnings.catch_warnings(), naming(file):
                warnings.simplefilter("ignore")  # pandas' of columns of mixed types
                seen = program.read(file)
        except InputError:
            raise
        except Exception as broken:  # a damaged file can raise any error from within the parsers
            reason = (str(broken).splitlines() or ["it ends early"])[0]
            reason = f"it has no {reason}" if isinstance(broken, KeyError) else reason
            raise InputError(f"{file} is not as {program.title} writes it ({reason})") from None
        runs.append(_poses(seen, file, program, options))
    table = pd.concat(runs, ignore_index=True)
    table.attrs["lost"] = [line for run in runs for line in run.attrs["lost"]]
    return table


def run_names(column: pd.Series) -> pd.Series:
    """Write the names of runs as text without blanks around it; a whole number has one spelling."""
    return column.astype(str).fillna("").str.strip().str.replace(r"^0*([0-9]+)(?:\.0*)?$", r"\1", regex=True)


def _films(folder: Path, program: TrackingProgram) -> list[Path]:
    """List a folder's files of a program, one for each film."""
    films: dict[str, Path] = {}
    for ending in program.endings:
        for file in sorted(folder.glob(f"*{ending}")):
            films.setdefault(file.stem, file)
    if not films:
        raise InputError(f"{folder} has no files of {program.title}: {', '.join(program.endings)}")
    return list(films.values())


def _poses(seen: TrackedPoints, path: Path, program: TrackingProgram, options: TrackOptions) -> pd.DataFrame:
    """Make poses of the points of a file."""
    if faults := _missing(seen, options):
        raise InputError(f"{path} {', and it '.join(faults)}")
    seconds, metres = _scales(seen, options)
    points, names = seen.points, _two(seen, options)
    points.loc[points["sure"] < program.likely, ["x", "y"]] = math.nan
    poses = _poses_of_two(points, names, program) if names else points[points["robot"] != ""]
    x, y = options.get("origin", (0.0, 0.0))
    if not (math.isfinite(x) and math.isfinite(y)):
        raise InputError(f"--origin {x:g} {y:g}; give two finite numbers")
    up, run = (-1 if program.y_down else 1), path.stem
    if program is PROGRAMS["deeplabcut"]:
        run = run.partition("DLC")[0].rstrip("_-") or run
    several = len(poses["robot"].unique()) > 1
    table = pd.DataFrame({
        "run": run + " " + poses["robot"] if several else run,
        "time_s": seconds * poses["time"],
        "x_cm": 100 * metres * (poses["x"] - x),
        "y_cm": 100 * metres * (poses["y"] - y) * up,
        "heading_deg": np.degrees(poses["heading"]),
    }).sort_values(["run", "time_s"], kind="stable")  # fmt: skip
    known = np.isfinite(table.drop(columns="run").to_numpy()).all(axis=1)
    lost = len(table) - int(known.sum())
    if lost == len(table):
        raise InputError(f"{path}: its two points are never both seen; name others with --front and --rear")
    table = table.loc[known]
    table.attrs["lost"] = [f"{path}: {lost} of {len(table) + lost} poses are lost"] if lost else []
    return table


def _also_missing(path: Path, programs: list[str]) -> str:
    """Say what the first program that can have written a file needs besides its name; empty: nothing."""
    for name in programs:
        with warnings.catch_warnings(), suppress(Exception):  # a file of another program can raise any error
            warnings.simplefilter("ignore")
            return "".join(f"; it {fault}" for fault in _missing(PROGRAMS[name].read(path), {}))
    return ""


def _scales(seen: TrackedPoints, options: TrackOptions) -> tuple[float, float]:
    """Return the units of a file's times [s] and lengths [m]: its own ones, or those of the options; or nan."""
    fps, (scale, unit) = options.get("fps"), number_and_unit(options.get("scale") or "", of_kind("length"))
    seconds = seen.seconds if seen.seconds is not None else 1 / fps if fps else math.nan
    metres = seen.metres or (math.nan if unit is None else float(to_si(scale, unit)))
    return seconds, metres


def _two(seen: TrackedPoints, options: TrackOptions) -> tuple[str, str] | None:
    """Name the points ahead and behind; None: the file has headings."""
    if "heading" in seen.points and not {"front", "rear"} & set(options):
        return None
    return options.get("front", "front"), options.get("rear", "rear")


def _missing(seen: TrackedPoints, options: TrackOptions) -> list[str]:
    """List what is missing or impossible, or is given though the file has its own, all at once."""
    (seconds, metres), scale = _scales(seen, options), options.get("scale")
    faults = [
        f"has its own units; leave out --{name}"
        for name, given, own in (("fps", options.get("fps"), seen.seconds), ("scale", scale, seen.metres))
        if given is not None and own is not None
    ]
    if seen.seconds is not None and not 0 < seconds < math.inf:
        faults.append(f"has frames {seconds:g} s apart; correct its frame rate, above 0 and finite")
    elif not 0 < seconds < math.inf:
        faults.append("counts frames; give the frames per second of its film, such as --fps 30")
    if not 0 < metres < math.inf:
        scaled = f"cannot have --scale {scale}" if scale else "has no unit of length"
        faults.append(f"{scaled}; give the length of a pixel, or of the file's unit, such as --scale 0.2mm")
    names, there = _two(seen, options) or (), list(seen.points["point"].unique())
    if unknown := [name for name in names if name not in there]:
        listed = ", ".join(there[:_LISTED]) + (", …" if len(there) > _LISTED else "")
        faults.append(
            f"has no point {' and no '.join(map(repr, unknown))} but {listed}; a heading needs two on the robot's "
            "axis: --front NAME --rear NAME"
        )
    elif names and names[0] == names[1]:
        faults.append(f"needs two points for a heading; --front and --rear are both {names[0]!r}")
    return faults


def _poses_of_two(points: pd.DataFrame, names: tuple[str, str], program: TrackingProgram) -> pd.DataFrame:
    """Make poses of two points on the robot's axis: the place half-way, the heading from rear to front."""
    front, rear = (points[points["point"] == name].drop_duplicates(["robot", "time"]) for name in names)
    poses = front.merge(rear, on=["robot", "time"], how="outer", suffixes=("_front", "_rear"))
    along, aside = (poses[f"{axis}_front"] - poses[f"{axis}_rear"] for axis in "xy")
    poses["heading"] = np.arctan2(-aside if program.y_down else aside, along)
    poses["x"], poses["y"] = poses["x_rear"] + along / 2, poses["y_rear"] + aside / 2
    return poses
