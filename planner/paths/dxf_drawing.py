"""Paths of DXF drawings: what each layer shows in model space, curves as polylines.

Lines and curves of a layer that meet end to end are one path, up to the next branch; it runs as the first of them
was drawn. Texts, dimensions and hatches, and layers that are off or frozen, are left out.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from common.errors import InputError
from common.reading import read_bytes
from planner.paths.named_paths import NamedPaths, with_own_names
from planner.paths.path import Path2D

_DRAWN = {"LINE", "LWPOLYLINE", "POLYLINE", "ARC", "CIRCLE", "ELLIPSE", "SPLINE", "HELIX"}
_METRES = {1: 0.0254, 2: 0.3048, 4: 1e-3, 5: 1e-2, 6: 1.0, 10: 0.9144, 13: 1e-6, 14: 0.1}  # of $INSUNITS
_MEETS = 1e-5  # of the drawing's size
_SAGITTA = 3e-5  # of a curve's size, between it and its polyline
_NO_UNIT = '$INSUNITS does not say its unit; set it in the CAD program, or give --unit mm (in Python unit="mm")'


def read_dxf(path: Path) -> NamedPaths:
    """Read the paths of a drawing by layer, and the size of its unit.

    Raises:
        InputError: there are none, the file is damaged, or ezdxf is missing.
    """
    read_bytes(path)  # says what is wrong if it cannot be read, or is too large
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
        return NamedPaths(joined, _METRES.get(drawing.units), _NO_UNIT)
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
    for entity in recursive_decompose(drawing.modelspace().query(" ".join([*_DRAWN, "INSERT"]))):
        layer = entity.dxf.layer
        mesh = any(getattr(entity, name, False) for name in ("is_poly_face_mesh", "is_polygon_mesh"))
        if entity.dxftype() not in _DRAWN or mesh or entity.dxf.invisible or layer.lower() in hidden:
            continue
        outline = make_path(entity)
        size = float(np.ptp([at.vec2 for at in (outline.start, *outline.control_vertices())], axis=0).max())
        if size > 0:
            points = np.array([at.vec2 for at in outline.flattening(_SAGITTA * size)])
            yield layer, Path2D(points, outline.is_closed)


def _joined(pieces: list[Path2D], gap: float) -> Iterator[Path2D]:
    """Join pieces whose ends are at most a gap apart, where no third one meets them."""
    from ezdxf import edgeminer

    yield from (piece for piece in pieces if piece.closed)
    edges = [edgeminer.make_edge(*piece.points[[0, -1]], payload=piece) for piece in pieces if not piece.closed]
    ends = edges and edgeminer.Deposit(edges, gap_tol=gap)
    used: set[Any] = set()
    for edge in edges:
        if edge not in used:
            chain = edgeminer.find_simple_chain(ends, edge)
            used.update(chain)
            points = [each.payload.points[:: -1 if each.is_reverse else 1] for each in chain]
            yield Path2D(
                np.concatenate([points[0], *(more[1:] for more in points[1:])]),
                edgeminer.is_loop(chain, gap_tol=gap),
            )
