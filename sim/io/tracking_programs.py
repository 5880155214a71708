"""Points that other programs have tracked: DeepLabCut, SLEAP, TrackMate, Tracker, idtracker.ai, Motive.

Each reader returns the points of one file, in the file's own units. Nothing in a file is run: of a pickle only
numbers, texts, containers and arrays are read. Projects (.slp, .trk) are not read; export their tracks.
`sim.io.pose_tracks` makes poses of the points.
"""

from __future__ import annotations

import csv
import io
import pickle
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from sim.io.errors import InputError
from sim.io.reading import decode, read_bytes
from sim.io.units import find_unit, split, to_si

_HDF5 = (".h5", ".hdf5")
_SPELLINGS = {"micron": "um", "microns": "um", "millimeters": "mm", "centimeters": "cm"}
_SPOT = ["TRACK_ID", "FRAME", "POSITION_T", "POSITION_X", "POSITION_Y"]  # of TrackMate
_ARRAYS = {  # what a pickle of arrays calls
    ("numpy", "ndarray"), ("numpy", "dtype"), ("_codecs", "encode"),
    *((f"numpy.{core}.multiarray", name) for core in ("core", "_core") for name in ("_reconstruct", "scalar")),
}  # fmt: skip


class Seen(NamedTuple):
    """The points of one file: robot, point, time, x, y, `sure` (a likelihood), and the heading of a rigid body."""

    points: pd.DataFrame
    metres: float | None = None  # of the unit of length; None: a pixel, or unknown
    seconds: float | None = None  # of the unit of time; None: a frame


class Program(NamedTuple):
    """A program that tracks."""

    title: str
    read: Callable[[Path], Seen]
    endings: tuple[str, ...]  # of its files; of one film the first is read
    begins: tuple[str, ...]  # how they begin, in Latin-1
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


class _Plain(pickle.Unpickler):
    """A reader of pickles that calls nothing but what makes arrays."""

    def find_class(self, module: str, name: str) -> Any:
        if (module, name) not in _ARRAYS:
            raise pickle.UnpicklingError(f"it holds a {module}.{name}; export it as CSV")
        return super().find_class(module.replace("numpy.core", "numpy._core"), name)


def _unpickled(data: bytes) -> Any:
    return _Plain(io.BytesIO(data)).load()


def _unit(words: str, kind: str) -> float | None:
    """Return a unit in SI units; None for pixels and frames."""
    word = words.strip().strip("()").lower()
    unit = find_unit(_SPELLINGS.get(word, word))
    return to_si(1.0, unit.suffix) if unit is not None and unit.kind == kind else None


def _deeplabcut(path: Path) -> Seen:
    """Read the table of a film: scorer, perhaps individuals, bodyparts and coords stand above its columns."""
    if _is_hdf5(path):
        with _hdf5(path) as file:
            table = file[next(iter(file))]["table"]
            rows, names = table[:], _unpickled(bytes(table.attrs["values_block_0_kind"]))
        frames, values = rows["index"], rows["values_block_0"]
    else:
        text = _text(path)
        heads = 3 + text.split("\n", 2)[1].startswith("individuals")
        written = pd.read_csv(io.StringIO(text), header=list(range(heads)), index_col=0)
        frames, values, names = written.index, written.to_numpy(dtype=float), written.columns
    columns = {tuple(name): values[:, k] for k, name in enumerate(names)}
    parts = dict.fromkeys(name[:-1] for name in columns)
    return Seen(
        pd.concat(
            _points(part[-2] if len(part) > 2 else "", part[-1], frames, columns[*part, "x"], columns[*part, "y"],
                    sure=columns.get((*part, "likelihood"), 1.0))
            for part in parts
        )
    )  # fmt: skip


def _sleap(path: Path) -> Seen:
    """Read an "analysis" export."""
    if _is_hdf5(path):
        with _hdf5(path) as file:
            tracks, scores = file["tracks"][:], file["point_scores"][:]  # (robots, 2, nodes, frames), without 2
            nodes = [name.decode() for name in file["node_names"]]
            robots = [name.decode() for name in file["track_names"]] or [""]
        frames = np.arange(tracks.shape[-1])
        return Seen(
            pd.concat(
                _points(robot, node, frames, tracks[i, 0, k], tracks[i, 1, k], scores[i, k])
                for i, robot in enumerate(robots)
                for k, node in enumerate(nodes)
            )
        )
    table = _csv(path)
    nodes = [name.removesuffix(".x") for name in map(str, table) if name.endswith(".x")]
    seen = [
        _points("", node, table["frame_idx"], table[f"{node}.x"], table[f"{node}.y"], table[f"{node}.score"])
        for node in nodes
    ]
    robot_of = table["track"].fillna("").astype(str).to_numpy()
    return Seen(pd.concat(rows.assign(robot=robot_of) for rows in seen))


def _trackmate(path: Path) -> Seen:
    """Read the table of spots, TrackMate's own file (XML), or its export of tracks (XML); a track is a point."""
    rows, length, time = _trackmate_xml(path) if path.suffix.lower() == ".xml" else _trackmate_csv(path)
    spots = rows[_SPOT].apply(pd.to_numeric, errors="coerce").dropna(subset="TRACK_ID").astype({"TRACK_ID": int})
    seconds = _unit(time, "time")
    when = spots["FRAME" if seconds is None else "POSITION_T"]
    seen = _points("", "", when, spots["POSITION_X"], spots["POSITION_Y"])
    return Seen(seen.assign(point=spots["TRACK_ID"].astype(str).to_numpy()), _unit(length, "length"), seconds)


def _trackmate_csv(path: Path) -> tuple[pd.DataFrame, str, str]:
    table = _csv(path, dtype=str, keep_default_na=False).rename(columns=str.upper)
    units = table.iloc[min(2, len(table) - 1)]  # below three lines of names; older tables have no units
    return table, units["POSITION_X"], units["POSITION_T"]


def _trackmate_xml(path: Path) -> tuple[pd.DataFrame, str, str]:
    root = ElementTree.fromstring(read_bytes(path))
    rows: list[tuple[Any, ...]]
    if root.tag == "Tracks":
        interval = float(root.get("frameInterval", "1"))
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


def _tracker(path: Path) -> Seen:
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
    return Seen(seen, None if unit is None else to_si(1.0, unit.suffix), 1.0)


def _numbers(words: pd.Series) -> pd.Series:
    return pd.to_numeric(words.str.replace(",", "."), errors="coerce")


def _idtrackerai(path: Path) -> Seen:
    """Read trajectories; an individual is a point."""
    about: Mapping[str, Any] = {}
    if path.suffix.lower() == ".csv":
        table = _csv(path).astype(float).to_numpy()
        time, places = table[:, 0], table[:, 1:].reshape(len(table), -1, 2)
    else:
        if _is_hdf5(path):
            with _hdf5(path) as file:
                places, about = file["trajectories"][:], dict(file.attrs)
        else:
            data = io.BytesIO(read_bytes(path))
            np.lib.format.read_magic(data)
            np.lib.format.read_array_header_1_0(data)
            about = _unpickled(data.read()).item()
            places = about["trajectories"]
        time = np.arange(len(places)) / float(about["frames_per_second"])
    names: Iterable[object] = about.get("identities_labels", range(1, places.shape[1] + 1))
    return Seen(pd.concat(_points("", name, time, *places[:, k].T) for k, name in enumerate(names)), None, 1.0)


def _motive(path: Path) -> Seen:
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
    return Seen(pd.concat(seen), _unit(about["Length Units"], "length"), 1.0)


PROGRAMS = {
    "deeplabcut": Program("DeepLabCut", _deeplabcut, (".csv", *_HDF5), ("scorer,", "\x89HDF"), likely=0.6),
    "sleap": Program("SLEAP", _sleap, (".csv", *_HDF5), ("track,frame_idx,", "\x89HDF"), likely=0.2),
    "trackmate": Program("TrackMate", _trackmate, (".csv", ".xml"), ("LABEL,ID,TRACK_ID,", "<")),
    "tracker": Program("Tracker", _tracker, (".txt", ".csv"), ("#multi:", "multi:"), y_down=False),
    "idtrackerai": Program(
        "idtracker.ai", _idtrackerai, (".csv", *_HDF5, ".npy"), ("seconds,x1,y1", "\x93NUMPY", "\x89HDF")
    ),
    "motive": Program("Motive", _motive, (".csv",), ("Format Version,",)),
}
