"""Obstacles of a map of ROS: cells of map.yaml and its picture that are not free, joined to polygons, in m.

A cell counts where it is occupied or unknown, as `map_server` reads it; grey 205 of a trinary map is unknown at
any threshold, as savers of maps write it. Outlines lie up to two cells outside their cells, so that they have few
corners, and never inside. What has a hole is cut through it.
"""

from __future__ import annotations

import math
import re
import warnings
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image
from shapely import Geometry, box, disjoint_subset_union_all, get_parts, simplify
from shapely import Polygon as Outline
from shapely.affinity import affine_transform

from common.arrays import Flags, Floats
from common.errors import InputError, InputWarning
from common.reading import decode, expecting, read_bytes
from planner.paths.named_paths import NamedPaths, with_own_names
from planner.paths.path import Path2D

_ENTRY = re.compile(r"^(\w+):(.*)", re.M)
_ORIGIN = re.compile("^origin:" + 3 * r"[\[\s,]++(?:-\s++)?([-+.\deE]++)", re.M)
_MOST_CELLS, _MOST_RUNS = 5e7, 200_000
_UNSEEN = 50  # of 255: how occupied grey 205 is
_GROWN, _MOVED = 0.75, 0.72  # of a cell: outlines are moved outwards, and then simplified by at most so much


def read_map(path: Path) -> NamedPaths:
    """Read the outlines of what is not free.

    Raises:
        InputError: the file is no map.yaml, or its picture cannot be read; or all cells are free.
    """
    with expecting("a map of ROS", path, "give map.yaml as map_saver writes it"):
        text = decode(read_bytes(path))
        entries = {name: words.partition("#")[0].strip(" \t\r'\"") for name, words in _ENTRY.findall(text)}
        cell = float(entries["resolution"])
        if not 0 < cell < math.inf:
            raise InputError(f"resolution {cell:g}; give the side of a cell in m, above 0")
        if (origin := _ORIGIN.search(text)) is None:
            raise KeyError("origin: [x, y, yaw]")
        x, y, yaw = map(float, origin.groups())
        occupied, free = (_share(entries, f"{kind}_thresh") for kind in ("occupied", "free"))
        if free > occupied:
            raise InputError(f"free_thresh {free:g} is above occupied_thresh {occupied:g}; exchange them")
        mode = entries.get("mode", "trinary")
        levels = _levels(path.parent / entries["image"], mode, entries["negate"])
        unseen = (levels > 1) | (mode == "trinary") & (np.rint(255 * levels) == _UNSEEN)
        unknown = unseen | (levels > free) & (levels < occupied)
        if unknown.any():
            count = f"{unknown.sum()} of {unknown.size} cells"
            warnings.warn(f"{path}: {count} are unknown and count as occupied", InputWarning, stacklevel=2)
        grown = get_parts(disjoint_subset_union_all(_grown_runs(unknown | (levels >= occupied))))
    parts = [part for each in simplify(grown, _MOVED) for part in without_holes(each)]  # at once it takes minutes
    if not parts:
        raise InputError(f"{path}: all cells are free; leave it out")
    along, aside = cell * np.cos(yaw), cell * np.sin(yaw)
    placed = [affine_transform(part, [along, -aside, aside, along, x, y]) for part in parts]
    outlines = [("outline", Path2D(np.array(part.exterior.coords), True)) for part in placed]
    return NamedPaths(with_own_names(outlines), 1.0)


def _share(entries: Mapping[str, str], name: str) -> float:
    """Read a threshold."""
    with suppress(ValueError):
        if 0 <= (share := float(entries[name])) <= 1:
            return share
    raise InputError(f"{name} {entries[name]}; give a share from 0 to 1, such as 0.65 for 65 %")


def _levels(picture: Path, mode: str, negate: str) -> Floats:
    """Read how occupied the cells are, from 0 to 1; what is transparent is occupied, what is above 1 unknown."""
    read_bytes(picture)  # says what is wrong if it cannot be read, or is too large
    try:
        with Image.open(picture) as image:
            if image.width * image.height > _MOST_CELLS:
                raise ValueError(f"more than {_MOST_CELLS:.0e} cells")
            deep = image.mode.startswith("I;16") or (image.mode == "I" and image.format in ("PNG", "PPM"))
            if (mode == "raw") if deep else image.mode in ("I", "F"):
                raise ValueError(f"a {mode} map of Pillow's mode {image.mode}, and not of 8 bits")
            if deep:  # Pillow would cut at 255
                grey, seen = np.asarray(image) / 257, np.asarray(image) != image.info.get("transparency")
            else:
                grey, alpha = np.moveaxis(np.asarray(image.convert("LA")), 2, 0)
                seen = alpha == 255
    except Exception as broken:  # a damaged picture can raise any error from within the parser
        raise InputError(f"{picture} cannot be read as a picture ({broken}); save the map again") from None
    if mode == "raw":
        return grey / 100
    if mode not in ("trinary", "scale"):
        raise InputError(f"mode {mode}; allowed are trinary, scale and raw")
    occupied = grey if negate.lower() in ("1", "true") else 255 - grey
    return np.where(seen, occupied / 255, 1.0)


def _grown_runs(cells: Flags) -> Any:
    """Return a box around each run of cells in a row; the lower left corner of the picture is (0, 0)."""
    steps = np.diff(np.pad(cells.astype(np.int8), ((0, 0), (1, 1))), axis=1)
    row, start = np.nonzero(steps == 1)
    if len(row) > _MOST_RUNS:
        raise InputError(f"{len(row)} runs of cells that are not free, more than {_MOST_RUNS}; remove specks")
    end, top = np.nonzero(steps == -1)[1], len(cells) - row
    return box(start - _GROWN, top - 1 - _GROWN, end + _GROWN, top + _GROWN)


def without_holes(region: Geometry) -> list[Outline]:
    """Cut the polygons of a region through their holes."""
    whole, rest = [], [region]
    while rest:
        part = rest.pop()
        if not isinstance(part, Outline):
            rest += [each for each in getattr(part, "geoms", ()) if each.area]
        elif part.interiors:
            low, bottom, high, top = part.bounds
            cut = sorted(hole.centroid.x for hole in part.interiors)[len(part.interiors) // 2]
            rest += [part & box(low, bottom, cut, top), part & box(cut, bottom, high, top)]
        elif part.area > 1e-9 * part.length**2:
            whole.append(part)
    return whole
