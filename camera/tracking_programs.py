"""Points that other programs have tracked: DeepLabCut, SLEAP, TrackMate, Tracker, idtracker.ai, Motive, TUM files.

Each reader returns the points of one file, in the file's own units. No pickle is loaded, and of HDF5 only numbers
and texts within the file are read. Projects (.slp, .trk) are not read; export their tracks.
`camera.pose_tracks` makes poses of the points.
"""

from __future__ import annotations

import csv
import io
import math
import pickletools
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from common.errors import InputError
from common.reading import MOST_BYTES, decode, read_bytes
from common.units import find_unit, split, to_si

_HDF5 = (".h5", ".hdf5")
_SPELLINGS = {"micron": "um", "microns": "um", "millimeters": "mm", "centimeters": "cm"}
_SPOT = ["TRACK_ID", "FRAME", "POSITION_T", "POSITION_X", "POSITION_Y"]  # of TrackMate
_MOST_NAMES = 2**16  # bytes of names
_NUMBERS = r"(?:[-+.\de]+[ \t]+){7}[-+.\de]+"  # time, place and quaternion, in a line of text
_NO_NAMES = r"(?![ \t]*(?:\S+[ \t]+){7}\S+[ \t]*\r?\n)"  # eight words above them are names of a table


class TrackedPoints(NamedTuple):
    """The points of one file: robot, point, time, x, y, `sure` (a likelihood), and the heading of a rigid body."""

    points: pd.DataFrame
    metres: float | None = None  # of the unit of length; None: a pixel, or unknown
    seconds: float | None = None  # of the unit of time; None: a frame


class TrackingProgram(NamedTuple):
    """A program that tracks."""

    title: str
    read: Callable[[Path], TrackedPoints]
    endings: tuple[str, ...]  # of its files; of one film the first is read
    begins: str  # how they begin, in Latin-1: a pattern
    y_down: bool = True  # as in pictures
    likely: float = 0.0  # least likelihood of a point that counts: the program's own default


def _points(
    robot: object,
    point: object,
    time: ArrayLike,
    x: ArrayLike,
    y: ArrayLike,
    sure: ArrayLike = 1.0,
    **more: ArrayLike,
) -> pd.DataFrame:
    """Make rows of a point."""
    columns = {"time": time, "x": x, "y": y, "sure": np.broadcast_to(sure, np.shape(time)), **more}
    numbers = {name: np.asarray(values, dtype=float) for name, values in columns.items()}
    return pd.DataFrame({"robot": str(robot), "point": str(point), **numbers})


def _text(path: Path) -> str:
    return decode(read_bytes(path))


def _csv(path: Path, **options: Any) -> pd.DataFrame:
    return pd.read_csv(io.StringIO(_text(path)), **options)


def _is_hdf5(path: Path) -> bool:
    return path.suffix.lower() in _HDF5


def _hdf5(path: Path) -> Any:
    """Open an HDF5 file."""
    try:
        import h5py
    except ImportError:
        raise InputError(f"{path} needs h5py: pip install 'softflagella[hdf5]', or export CSV") from None
    return h5py.File(io.BytesIO(read_bytes(path)), "r")


def _stored(file: Any, name: str, most: int = MOST_BYTES) -> Any:
    """Read a dataset of an HDF5 file.

    Raises:
        InputError: it does not lie within the file, holds objects, or is too large.
    """
    from h5py import check_string_dtype

    data = file[name]
    faults = {
        "lies in other files": data.is_virtual or data.external,
        "holds objects": data.dtype.hasobject and check_string_dtype(data.dtype) is None,
        f"has more than {most} bytes": data.nbytes > most,
    }
    for fault in (words for words, found in faults.items() if found):
        raise InputError(f"{name!r} {fault}, which is not read; export the tracks as CSV")
    return np.asarray(data[:])


def _pickled_texts(data: bytes) -> list[str]:
    """List the texts of a pickle in their order, without loading it."""
    texts: list[str] = []
    memo: dict[Any, str | None] = {}
    last = None  # the text that has just been read
    for code, value, _ in pickletools.genops(data):
        if code.name.endswith(("PUT", "MEMOIZE")):
            memo[len(memo) if value is None else value] = last
            continue
        last = memo[value] if code.name.endswith("GET") else value if code.name.endswith("UNICODE") else None
        if last is not None:
            texts.append(last)
    return texts


def _unit(words: str, kind: str) -> float | None:
    """Return a unit in SI units; None for pixels and frames."""
    word = words.strip().strip("()").lower()
    unit = find_unit(_SPELLINGS.get(word, word))
    return to_si(1.0, unit.suffix) if unit is not None and unit.kind == kind else None


def _deeplabcut(path: Path) -> TrackedPoints:
    """Read the table of a film: scorer, perhaps individuals, bodyparts and coords stand above its columns."""
    if _is_hdf5(path):
        with _hdf5(path) as file:
            table = file[next(iter(file))]
            rows = _stored(table, "table")
            texts = _pickled_texts(bytes(table["table"].attrs["values_block_0_kind"]))
        frames, values = rows["index"], rows["values_block_0"]
        names: Any = np.reshape(texts, (values.shape[1], -1))
    else:
        text = _text(path)
        heads = 3 + text.split("\n", 2)[1].startswith("individuals")
        written = pd.read_csv(io.StringIO(text), header=list(range(heads)), index_col=0)
        frames, values = written.index.to_numpy(), written.to_numpy(dtype=float)
        names = [list(name) for name in written.columns]
    columns = {tuple(name): values[:, k] for k, name in enumerate(names)}
    parts = dict.fromkeys(name[:-1] for name in columns)
    return TrackedPoints(
        pd.concat(
            _points(part[-2] if len(part) > 2 else "", part[-1], frames, columns[*part, "x"], columns[*part, "y"],
                    sure=columns.get((*part, "likelihood"), 1.0))
            for part in parts
        )
    )  # fmt: skip


def _sleap(path: Path) -> TrackedPoints:
    """Read an "analysis" export."""
    if _is_hdf5(path):
        with _hdf5(path) as file:
            tracks = _stored(file, "tracks")  # (robots, 2, nodes, frames)
            scores = _stored(file, "point_scores") if "point_scores" in file else np.ones_like(tracks[:, 0])
            nodes, robots = (
                [name.decode() for name in _stored(file, f"{kind}_names", _MOST_NAMES).tolist()]
                for kind in ("node", "track")
            )
        frames = np.arange(tracks.shape[-1])
        return TrackedPoints(
            pd.concat(
                _points(robot, node, frames, tracks[i, 0, k], tracks[i, 1, k], scores[i, k])
                for i, robot in enumerate(robots or [""])
                for k, node in enumerate(nodes)
            )
        )
    table = _csv(path)
    nodes = [name.removesuffix(".x") for name in map(str, table) if name.endswith(".x")]
    seen = [
        _points("", node, table["frame_idx"], table[f"{node}.x"], table[f"{node}.y"],
                sure=table.get(f"{node}.score", 1.0))
        for node in nodes
    ]  # fmt: skip
    robot_of = table["track"].fillna("").astype(str).to_numpy()
    return TrackedPoints(pd.concat(rows.assign(robot=robot_of) for rows in seen))


def _trackmate(path: Path) -> TrackedPoints:
    """Read the table of spots, TrackMate's own file (XML), or its export of tracks (XML); a track is a point."""
    rows, length, time = _trackmate_xml(path) if path.suffix.lower() == ".xml" else _trackmate_csv(path)
    spots = rows[_SPOT].apply(pd.to_numeric, errors="coerce").dropna(subset="TRACK_ID").astype({"TRACK_ID": int})
    seconds = _unit(time, "time")
    when = spots["FRAME" if seconds is None else "POSITION_T"]
    seen = _points("", "", when, spots["POSITION_X"], spots["POSITION_Y"])
    return TrackedPoints(
        seen.assign(point=spots["TRACK_ID"].astype(str).to_numpy()), _unit(length, "length"), seconds
    )


def _trackmate_csv(path: Path) -> tuple[pd.DataFrame, str, str]:
    table = _csv(path, dtype=str, keep_default_na=False).rename(columns=str.upper)
    units = table.iloc[min(2, len(table) - 1)]  # below three lines of names; older tables have no units
    return table, units["POSITION_X"], units["POSITION_T"]


def _trackmate_xml(path: Path) -> tuple[pd.DataFrame, str, str]:
    root = ElementTree.fromstring(read_bytes(path))
    rows: list[tuple[Any, ...]]
    if root.tag == "Tracks":
        interval = float(root.get("frameInterval", "1"))
        if not 0 < interval < math.inf:
            raise InputError(f"frameInterval is {interval:g}; correct it, above 0 and finite")
        rows = [
            (k, spot.get("t"), interval * float(spot.get("t", "nan")), spot.get("x"), spot.get("y"))
            for k, particle in enumerate(root.iter("particle"))
            for spot in particle.iter("detection")
        ]
        return pd.DataFrame(rows, columns=_SPOT), root.get("spaceUnits", ""), root.get("timeUnits", "")
    track_of = {
        edge.get(end): track.get("TRACK_ID")
        for track in root.iter("Track")
        for edge in track.iter("Edge")
        for end in ("SPOT_SOURCE_ID", "SPOT_TARGET_ID")
    }
    rows = [(track_of.get(spot.get("ID")), *(spot.get(name) for name in _SPOT[1:])) for spot in root.iter("Spot")]
    model = next(root.iter("Model"))
    return pd.DataFrame(rows, columns=_SPOT), model.get("spatialunits", ""), model.get("timeunits", "")


def _tracker(path: Path) -> TrackedPoints:
    """Read exported text: names of point masses above the names of their columns, of which x and y are read."""
    lines = [line for line in _text(path).splitlines() if line.strip()]
    mark = max("\t,; ", key=lambda mark: max(line.count(mark) for line in lines[:3]))
    rows = [[word.strip() for word in line.split(mark)] for line in lines]
    top = next(k for k, row in enumerate(rows) if split(row[0]).quantity == "t")
    masses, mass = rows[top - 1] if top else [], ""
    names = [split(word) for word in rows[top]]
    values = pd.DataFrame(rows[top + 1 :]).apply(_numbers)
    places: dict[str, dict[str, pd.Series]] = {}
    for k, name in enumerate(names):
        mass = (masses[k] if k < len(masses) else "") or mass
        if name.quantity in ("x", "y"):
            places.setdefault(mass, {})[name.quantity] = values[k]
    unit = next(name.unit for name in names if name.quantity == "x")
    seen = pd.concat(_points("", mass, values[0], at["x"], at["y"]) for mass, at in places.items())
    return TrackedPoints(seen, None if unit is None else to_si(1.0, unit.suffix), 1.0)


def _numbers(words: pd.Series) -> pd.Series:
    return pd.to_numeric(words.str.replace(",", "."), errors="coerce")


def _idtrackerai(path: Path) -> TrackedPoints:
    """Read trajectories; an individual is a point."""
    if path.suffix.lower() == ".npy":
        raise InputError("it is a pickle, which is not read; export CSV or HDF5 from idtracker.ai")
    if _is_hdf5(path):
        with _hdf5(path) as file:
            places, names = _stored(file, "trajectories"), file.attrs.get("identities_labels")
            seconds = 1 / float(file.attrs["frames_per_second"])
        time = np.arange(len(places))
    else:
        table = _csv(path).astype(float).to_numpy()
        time, places, names, seconds = table[:, 0], table[:, 1:].reshape(len(table), -1, 2), None, 1.0
    names = range(1, places.shape[1] + 1) if names is None else names
    return TrackedPoints(
        pd.concat(_points("", name, time, *places[:, k].T) for k, name in enumerate(names)), None, seconds
    )


def _motive(path: Path) -> TrackedPoints:
    """Read the CSV that is exported with y upwards: seen from above, x points to the right and z downwards."""
    rows = [row for row in csv.reader(io.StringIO(_text(path))) if any(row)]
    about = dict(zip(rows[0][::2], rows[0][1::2], strict=False))
    top = next(k for k, row in enumerate(rows) if row[0] == "Frame")
    kinds, names, *_, what, axes = rows[1 : top + 1]
    values = pd.DataFrame(rows[top + 1 :]).apply(pd.to_numeric, errors="coerce").to_numpy(dtype=float)
    columns = {head: values[:, k] for k, head in enumerate(zip(kinds, names, what, axes, strict=True))}
    seen = []
    for kind, name in dict.fromkeys((kind, name) for kind, name, of, _ in columns if of == "Position"):
        x, z = (columns[kind, name, "Position", axis] for axis in "XZ")
        if kind != "Rigid Body":
            seen.append(_points("", name, values[:, 1], x, z))
            continue
        if about["Rotation Type"] != "Quaternion":
            raise InputError(f"{path} has angles of rotation; export it from Motive with quaternions")
        a, b, c, w = (columns[kind, name, "Rotation", axis] for axis in "XYZW")
        heading = np.arctan2(2 * (w * b - a * c), 1 - 2 * (b * b + c * c))  # of the body's x axis
        seen.append(_points(name, name, values[:, 1], x, z, heading=heading))
    return TrackedPoints(pd.concat(seen), _unit(about["Length Units"], "length"), 1.0)


def _tum(path: Path) -> TrackedPoints:
    """Read time, place and quaternion, in s and m, as SLAM writes them."""
    table = _csv(path, sep=r"\s+", comment="#", header=None).to_numpy(dtype=float)
    time, x, y, _, a, b, c, w = table.T
    heading = np.arctan2(2 * (w * c + a * b), 1 - 2 * (b * b + c * c))  # of the body's x axis
    return TrackedPoints(_points("robot", "robot", time - time.min(), x, y, heading=heading), 1.0, 1.0)


PROGRAMS = {
    "deeplabcut": TrackingProgram("DeepLabCut", _deeplabcut, (".csv", *_HDF5), "scorer,|\x89HDF", likely=0.6),
    "sleap": TrackingProgram("SLEAP", _sleap, (".csv", *_HDF5), "track,frame_idx,|\x89HDF", likely=0.2),
    "trackmate": TrackingProgram("TrackMate", _trackmate, (".csv", ".xml"), "(?i:LABEL),ID,TRACK_ID,|<"),
    "tracker": TrackingProgram("Tracker", _tracker, (".txt", ".csv"), "#?multi:", y_down=False),
    "idtrackerai": TrackingProgram(
        "idtracker.ai", _idtrackerai, (".csv", *_HDF5, ".npy"), "seconds,x1,y1|\x93NUMPY|\x89HDF"
    ),
    "motive": TrackingProgram("Motive", _motive, (".csv",), "Format Version,"),
    "tum": TrackingProgram(
        "TUM",
        _tum,
        (".txt", ".tum"),
        rf"(?:(?:#.*\n)*#(?:.* tx .*|{_NO_NAMES}.*)\n)?{_NUMBERS}[ \t]*\r?\n",
        y_down=False,
    ),
}
