"""Paths and polygons of GeoJSON.

RFC 7946 has degrees of longitude and latitude, in which nothing of a tank can be drawn well; many programs write
metres all the same. So its numbers have no unit until one is given, and declared degrees are refused.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from common.arrays import Floats
from common.errors import InputError
from common.reading import expecting, read_json
from planner.paths.named_paths import NamedPaths, with_own_names
from planner.paths.path import Path2D

_DEGREES = re.compile(  # codes, datums that no projection follows, and words
    r"CRS:?(?:84|83|27)\b|long?lat|lat\W?lon|geographic|\bGCS_"
    r"|EPSG[:/ ]+(?:[\d.]+[:/ ]+)?(?:4326|4979|4258|4937|4269|4267|4283|7844|4490|4612|6668|4674|4167|6318)\b"
    r"|^\w+ (?:WGS|ETRS|NAD|GDA|ED|JGD|CGCS|SIRGAS)[ _-]?(?:19|20)?\d\d(?:\W*\(\w+\))?$",
    re.IGNORECASE,
)
_NO_UNIT = 'GeoJSON has degrees of longitude and latitude; if these are metres, give --unit m (in Python unit="m")'


def read_geojson(path: Path) -> NamedPaths:
    """Read the lines and rings of a file, named as its features are.

    Raises:
        InputError: it has none, or degrees.
    """
    parts = (
        (name if k == 0 else f"{name}/hole{k}", Path2D(ring, kind == "Polygon"))
        for name, kind, rings in read_shapes(path)
        for k, ring in enumerate(rings)
    )
    return NamedPaths(with_own_names(parts), None, _NO_UNIT)


def read_regions(path: Path) -> NamedPaths:
    """Read the polygons of a file; what has a hole is cut through it.

    Raises:
        InputError: there are none, or other shapes besides, or degrees.
    """
    from shapely import Polygon
    from shapely.validation import explain_validity

    from planner.paths.ros_map import without_holes

    outlines = []
    with expecting("GeoJSON", path, "draw polygons that do not cross themselves"):
        for name, kind, rings in read_shapes(path):
            if kind != "Polygon":
                raise InputError(f"{name} is a {kind}, which encloses nothing; give polygons")
            region = Polygon(rings[0], rings[1:])
            if not region.is_valid:
                raise ValueError(f"{name}: {explain_validity(region)}")
            outlines += [(name, Path2D(np.array(part.exterior.coords), True)) for part in without_holes(region)]
    return NamedPaths(with_own_names(outlines), None, _NO_UNIT)


def read_shapes(path: Path) -> list[tuple[str, str, list[Floats]]]:
    """Read name, kind and rings of each LineString and Polygon; of a polygon holes follow the outline.

    Raises:
        InputError: there are none, or they are in degrees.
    """
    with expecting("GeoJSON", path, "export it again"):
        content = read_json(path)
        shapes = [(name, kind, [_points(ring) for ring in rings]) for name, kind, rings in _shapes(content, "")]
        if not shapes or not all(rings and all(map(len, rings)) for _, _, rings in shapes):
            raise InputError("it has no LineString and no Polygon, or an empty one; draw one")
        return shapes


def _points(ring: list[list[float]]) -> Floats:
    return np.array([(x, y) for x, y, *_ in ring], dtype=float).reshape(-1, 2)


def _shapes(part: Mapping[str, Any], name: str) -> Iterator[tuple[str, str, list[Any]]]:
    """Yield name, kind and rings of the shapes of a part of the file."""
    kind, crs = part["type"], part.get("crs") or {}
    system = " ".join(map(str, crs.get("properties", {}).values()))
    if _DEGREES.search(f"{crs.get('type')} {system}"):
        raise InputError(f"its crs is {system}: degrees; project it to metres, such as UTM, and export it again")
    if kind == "Feature":
        name = str((part.get("properties") or {}).get("name") or part.get("id") or "")
        if part["geometry"] is not None:
            yield from _shapes(part["geometry"], name)
    for inner in (*part.get("features", ()), *part.get("geometries", ())):
        yield from _shapes(inner, name)
    if kind in ("LineString", "MultiLineString", "Polygon", "MultiPolygon"):
        single, places = kind.removeprefix("Multi"), part["coordinates"]
        for each in places if kind != single else [places]:
            yield name or single, single, [each] if single == "LineString" else each
