"""Files of other kinds are refused by name, by command and page; tables that look a little like them are read."""

from __future__ import annotations

from pathlib import Path

import pytest

from planner.paths.path_files import read_path
from sim.io.errors import InputError
from tests.planner.page.page_core import answers

KINDS = {
    "GeoJSON": ['{"type": "FeatureCollection", "features": []}', '\ufeff\n{"a": [1], "type":"LineString"}',
                '{"type": "MultiPolygon", "coordinates": [[[0,0],[1,1]]]}'],
    "JSON": ["[[0, 0], [1, 1]]", '{"x": [0, 1]}', '[{"x": 0}]'],
    "GPX": ['<?xml version="1.0"?>\n<!-- c --><gpx version="1.1"><trk/></gpx>', "<gpx></gpx>"],
    "KML": ['<?xml version="1.0"?>\n<kml xmlns="k"></kml>'], "XML": ["<html></html>"],
    "a drawing with another ending": ["<svg><path d='M0 0L1 1'/></svg>", "<?xml version='1.0'?><svg/>"],
    "G-code": ["G21\nG1 X0 Y0\n", "; slicer\n\n(mm)\nG0X1Y2\n", "%\nO1000\nN10 G90 G54\n", "M3 S1000\nG1 X1\n"],
    "WKT": ["LINESTRING (0 0, 1 1)", "SRID=4326;POLYGON Z((0 0 1, 1 1 1))", "MULTILINESTRING((0 0,1 1))",
            'WKT,name\n"LINESTRING (0 0,1 1)",a\n', "id;geom\n1;POINT(1 2)\n"],
    "DXF": ["0\nSECTION\n2\nHEADER\n", "  0\r\nSECTION\r\n"],
    "PDF": ["%PDF-1.7"], "a picture": ["\x89PNG\r\n", "\xff\xd8\xff\xe0"],
}  # fmt: skip
ENDINGS = {
    "a.geojson": "GeoJSON",
    "a.gpx": "GPX",
    "a.GCODE": "G-code",
    "a.wkt": "WKT",
    "a.dxf": "DXF",
    "a.svgz": "a drawing",
}
TABLES = [
    "x,y\n0,0\n1,1\n",
    "% G-code of a mill\n0 0\n1 1\n",
    "0 0\n1 1\n",
    "point (no),x,y\n1,0,0\n2,1,1\n",
    "G1,x,y\n1,0,0\n2,1,1\n",
]


def test_files_of_other_kinds_are_refused_by_name(tmp_path: Path) -> None:
    files = [
        (f"{i}.{ending}", text, kind)
        for kind, texts in KINDS.items()
        for i, text in enumerate(texts)
        for ending in ("txt", "csv")
    ]
    files += [(name, "1,2\n3,4\n", kind) for name, kind in ENDINGS.items()]
    calls = []
    refusals = []
    for name, text, kind in files:
        content = text.encode("latin-1" if kind == "a picture" else "utf-8")
        file = tmp_path / name
        file.write_bytes(content)
        with pytest.raises(InputError) as refusal:
            read_path(file)
        assert f"{kind}" in str(refusal.value), text
        assert "is not read; give a table with columns x and y, such as CSV, or an SVG drawing" in str(
            refusal.value
        ), text
        refusals.append(str(refusal.value))
        calls.append(("open_file.js", "openFile", {"name": str(file), "bytes": list(content)}))
    assert [str(each) for each in answers(calls)] == refusals


@pytest.mark.parametrize("text", TABLES)
def test_tables_are_read(text: str, tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(text)
    assert read_path(tmp_path / "a.csv").path.points.tolist() == [[0, 0], [1, 1]]
