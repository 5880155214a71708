"""Paths of DXF drawings: what each layer shows in model space, curves as polylines.

Lines and curves of a layer that meet end to end are one path, up to the next branch; it runs as the first of them
was drawn. Texts, dimensions and hatches, and layers that are off or frozen, are left out.
"""

from __future__ import annotations

import logging
import math
import re
from collections import defaultdict
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from common.errors import InputError
from common.reading import read_bytes
from planner.paths.named_paths import NamedPaths, with_own_names
from planner.paths.path import Path2D

_DRAWN = {"LINE", "LWPOLYLINE", "POLYLINE", "ARC", "CIRCLE", "ELLIPSE", "SPLINE", "HELIX"}
_METRES = {1: 0.0254, 2: 0.3048, 4: 1e-3, 5: 1e-2, 6: 1.0, 10: 0.9144, 13: 1e-6, 14: 0.1}  # of $INSUNITS
_STATES_UNIT = re.compile(rb"(?<!\d)9\s+\$INSUNITS|\t\0?\$INSUNITS")  # a text, or binary; ezdxf takes m without
_MOST_PIECES = 100_000
_MEETS = 1e-5  # of the drawing's size
_SAGITTA = 3e-5  # of a curve's size, between it and its polyline
_NO_UNIT = '$INSUNITS does not say its unit; set it in the CAD program, or give --unit mm (in Python unit="mm")'


def read_dxf(path: Path) -> NamedPaths:
    """Read the paths of a drawing by layer, and the size of its unit.

    Raises:
        InputError: there are none, the file is damaged, or ezdxf is missing.
    """
    data = read_bytes(path)  # says what is wrong if it cannot be read, or is too large
    try:
        import ezdxf
    except ImportError:
        raise InputError(f"{path} needs ezdxf: pip install 'softflagella[dxf]', or export SVG") from None
    logging.getLogger("ezdxf").addHandler(logging.NullHandler())  # what it mends is not told
    try:
        drawing = ezdxf.readfile(path)
        layers: dict[str, list[Path2D]] = {}
        for layer, piece in _pieces(drawing):
            layers.setdefault(layer, []).append(piece)
        if not layers:
            raise InputError(
                f"{path} has no line, polyline, arc, circle, ellipse or spline in model space; draw one"
            )
        places = np.concatenate([piece.points for pieces in layers.values() for piece in pieces])
        gap = _MEETS * float(np.ptp(places, axis=0).max())
        joined = with_own_names((layer, each) for layer, pieces in layers.items() for each in _joined(pieces, gap))
        unit = _METRES.get(drawing.units) if _STATES_UNIT.search(data) else None
        return NamedPaths(joined, unit, _NO_UNIT)
    except InputError:
        raise
    except Exception as broken:  # a damaged file can raise any error from within the parser
        reason = " ".join(str(broken).split()) or type(broken).__name__
        raise InputError(f"{path} is not DXF ({reason}); save it again") from None


def _pieces(drawing: Any) -> Iterator[tuple[str, Path2D]]:
    """Yield the layer and the points of all that is drawn, in blocks too."""
    from ezdxf.disassemble import recursive_decompose
    from ezdxf.path import make_path

    hidden = {layer.dxf.name.lower() for layer in drawing.layers if layer.is_off() or layer.is_frozen()}
    drawn = drawing.modelspace().query(" ".join([*_DRAWN, "INSERT"]))
    if _count(drawn, drawing.blocks, {}) > _MOST_PIECES:
        raise InputError(f"it draws more than {_MOST_PIECES} pieces, those of blocks counted; keep only the path")
    for entity in recursive_decompose(drawn):
        layer = entity.dxf.layer
        mesh = any(getattr(entity, name, False) for name in ("is_poly_face_mesh", "is_polygon_mesh"))
        if entity.dxftype() not in _DRAWN or mesh or entity.dxf.invisible or layer.lower() in hidden:
            continue
        outline = make_path(entity)
        size = float(np.ptp([at.vec2 for at in (outline.start, *outline.control_vertices())], axis=0).max())
        if size > 0:
            points = np.array([at.vec2 for at in outline.flattening(_SAGITTA * size)])
            yield layer, Path2D(points, outline.is_closed)


def _count(entities: Iterable[Any], blocks: Any, counted: dict[str, float]) -> float:
    """Count what entities stand for, blocks in blocks too, before it is made; a block in itself has no end."""
    total = 0.0
    for entity in entities:
        total += 1
        key = "name" if entity.dxftype() == "INSERT" else "geometry"  # of a dimension
        if entity.dxf.is_supported(key):
            name = str(entity.dxf.get(key)).lower()
            if name not in counted:
                counted[name] = math.inf  # until it is counted
                counted[name] = _count(blocks.get(name, ()), blocks, counted)
            total += counted[name] * getattr(entity, "mcount", 1)
    return total


def _joined(pieces: list[Path2D], gap: float) -> Iterator[Path2D]:
    """Join pieces whose ends are at most a gap apart, where no third one meets them."""
    from scipy.spatial import cKDTree

    yield from (piece for piece in pieces if piece.closed)
    lines = [piece.points for piece in pieces if not piece.closed]
    ends = np.array([line[[0, -1]] for line in lines]).reshape(-1, 2)  # 2 k and 2 k + 1 are those of line k
    corners, corner = np.unique(ends, axis=0, return_inverse=True)  # many lines may meet in one
    near = np.asarray(cKDTree(corners).query(corners, 3, distance_upper_bound=gap)[1])  # len(corners): none
    meeting = defaultdict(list)
    for end, at in enumerate(np.where(near[:, 2] < len(corners), -1, near.min(1))[corner.ravel()].tolist()):
        meeting[at].append(end)
    pairs = [ends for at, ends in meeting.items() if at >= 0 and len(ends) == 2]
    other: dict[int, int] = {one: two for pair in pairs for one, two in (pair, pair[::-1])}
    used: set[int] = set()
    for k in range(len(lines)):
        if k in used:
            continue
        start = 2 * k
        while (before := other.get(start)) is not None and (start := before ^ 1) != 2 * k:
            pass
        chain = [start]
        while (after := other.get(chain[-1] ^ 1)) not in (None, start):
            chain.append(after)
        used.update(end // 2 for end in chain)
        points = [lines[end // 2][:: -1 if end % 2 else 1] for end in chain]
        outline = np.concatenate([points[0], *(more[1:] for more in points[1:])])
        yield Path2D(outline, math.dist(outline[0], outline[-1]) <= gap)
