"""Kinds of files that are neither tables nor drawings."""

from __future__ import annotations

import re
from pathlib import Path

from sim.io.errors import InputError

KINDS = {  # kind: its endings, and how it begins
    "GeoJSON": ("geojson topojson",
                r'\{[\s\S]*?"type"\s*:\s*"(?:Feature|Topology|Geometry|(?:Multi)?(?:Point|Line|Poly))'),
    "JSON": ("json", r"\{|\[\s*[\[{\d-]"),
    "GPX": ("gpx", r"<[\s\S]*?<gpx[\s>]|<gpx[\s>]"),
    "KML": ("kml kmz", r"<[\s\S]*?<kml[\s>]|<kml[\s>]"),
    "a drawing with another ending than .svg": ("svgz", r"<[\s\S]*?<svg[\s/>]|<svg[\s/>]"),
    "XML": ("xml gml", r"<"),
    "G-code": ("gcode gco ngc cnc tap", r"(?:[%;(O][^\n]*\n|\s)*(?:N\d+\s*)?[GM]\d+(?:\.\d+)?(?:\s|[A-Z;(]|$)"),
    "WKT": ("wkt ewkt", r"(?:[^\n]*\n)?[^\n(]*?(?:POINT|LINESTRING|RING|POLYGON|COLLECTION)[\sZM]*\(+[\s\d.+-]"),
    "DXF": ("dxf", r"(?:999\s*\n[^\n]*\n\s*)*0\s*\n\s*SECTION"),
    "a shapefile": ("shp shx dbf", r"\x00\x00\x27\x0a"),
    "a vector format": ("dwg plt hpgl eps ps ai step stp stl obj", r"%!PS|AC10\d\d"),
    "PDF": ("pdf", r"%PDF"),
    "a picture": ("png jpg jpeg gif bmp tif tiff webp heic", r"\x89PNG|\xff\xd8\xff|GIF8|II\*|MM\x00\*|RIFF"),
}  # fmt: skip
_HEAD = 4096  # bytes that tell


def refuse_other_kinds(path: Path) -> None:
    """Refuse a file that is neither a table nor a drawing; a pipe is not looked into.

    Raises:
        InputError: it is of another kind, by its content or its ending.
    """
    if not path.is_file():
        return
    with path.open("rb") as file:
        head = file.read(_HEAD).decode("latin-1").removeprefix("\xef\xbb\xbf").lstrip()
    ending = path.suffix.lower().removeprefix(".")
    by_content = [kind for kind, (_, start) in KINDS.items() if re.match(start, head, re.IGNORECASE)]
    by_ending = [kind for kind, (endings, _) in KINDS.items() if ending in endings.split()]
    for kind in [*by_content, *by_ending][:1]:
        raise InputError(
            f"{path}: {kind} is not read; give a table with columns x and y, such as CSV, or an SVG drawing"
        )
