"""Tables of numbers and the paths in them are read, and files of other kinds refused, as by Python."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from planner.paths.path_files import read_path
from sim.io.quantities import numbers_of
from sim.io.tables import parse_table
from tests.planner.page.page_core import answer, check_near, opened, refusal_of, without_digits

pytestmark = pytest.mark.usefixtures("empty_folder")

TABLES = [
    b"x,y\n1,2\n3,4\n", b"x;y\n1,5;2\n3;4,25\n", b"x\ty\n1\t2\n", b"x y\n1 2\n 3   4\n", b"\xef\xbb\xbfx,y\n1,2\n",
    b'"x [cm]","y [cm]"\n"1.5","2"\n', b"# a\n% x y\n1 2\n3 4\n", b"1,2\n3,4\n", b"x,y\nmm,mm\n1,2\n",
    "x,y\n1,2\n".encode("utf-16"), "größe;y\n1;2\n".encode("latin-1"), b"x,y\r\n1,2\r\n\r\n3,4\r\n",
    b"\n\nx,y\n1,2",
    b"x,y\n1,\n,2\nabc,4\nnan,inf\n", b"x, y\n1, 2e3\n+.5, -1.\n", b"x,y,z\n1,2,\n3,4,\n", b"x,y\n1,2,\n3,4,\n",
    b"x,y\n1\n2,3\n", b"x;y\n1,5;abc\n2,5;3,5\n", b"x,,y\n1,2,3\n", b" x ; y \n1;2\n", b"x,y\n0x10,1_000\n1,2\n",
    b'"marker, note",x,y\n"a, b",0,5\n"c ""d""",30,6\n', b'"a;b";"x"\n1;2\n', b'"x\n[cm]",y\n1,"2"\n',
    b"time, s;x, cm\n0,5;1\n",
    b"x,y\n# a note\n#N/A,15\n%30,2\n1,2\n# late,3\n", b"#N/A,15\n1,2\n", b"# 25 fps\n#x,y,w\n1,2,a\n3,4,b\n",
    b"%30,15\n1,2\n",
    b"x;y\n#WERT!;0,5\nErr:502;-\n####;n/a\n1,5;None\n", b"x;y;z\n0,200;1,234;12,5\n1,234;2,000;3\n",
    b'"1,5","2,5"\n"3,0","4"\n',
    b"time_s,x\n0:00:01,1\n1:02:03.5,2\nlost,3\n",
    b"time_min,x\n2026-05-01T12:00:00Z,1\n2026-05-01 14:00:30+01:00,2\n2026-13-01 12:00:00,2\n",
    b"t_s,x\n1714560000.5,1\n1714560002,2\n", b"t_s,x\n1714560000500,1\n0,2\n",
    b"time_h,x\n1 day 00:30:00,1\n2024-02-30,2\n",
    b"x,y,\n1,2,\n3,4\n", b"x y z\n 1 \"a b\" 3\n", b"x;y\n'=1+1;'-a\n''=b;-3\n", b"x,x_1\n1.200,300\n",
]  # fmt: skip
BAD_TABLES = [
    b"", b"\n\n", b"# only\n", b"x,y\n", b"x,y\n1,2,3\n", b"x,y\n1,2\n1,2,3\n", b"x,x\n1,2\n", b"x;y\n1.234,5;2\n",
    b"x;y\n1,5;2.5\n", b"a\0b\n", b"x,y\n1,2,3\n4,5,6,7\n",
    b"x,y,z\n1,2\n3,4\n", b'x,y\n"1,2\n3,4\n', b'x,y\n"1"2,3\n', b"x;y\n1,200;300\n",
    b"x;y;z\n1,200;1;0,5\n300;2;0,5\n",
    b"x;y\n1.200;1\n300;2\n", b"x;y\n1 200;1\n", b"x;y\n1.200.300;1\n", b'x,y\n"1,200",300\n',
    "x;y\n1\u202f200,5;1\n".encode(), b"'=x,'=x\n1,2\n", b"x\ty\n1 2\n3 4\n",
]  # fmt: skip
PATHS = [
    b"x,y\n0,0\n3,0\n3,4\n", b"0 0\n1 2\n5 7\n", b"x_mm;y_mm\n1,5;2\n3;4,5\n9;1\n",
    b"X [cm],Y [mm]\n0,0\n1,5\n2,0\n", b"time_s,x_cm,y_cm\n0,1,2\n1,3,4\n2,1,0\n", b"x,y\n0,0\n1,0\n1,1\n0,0\n",
    b"\xef\xbb\xbf\"x\",\"y\"\n0,0\n1,1\n", b"% G-code of a mill\n0 0\n1 1\n", b"G1,x,y\n1,0,0\n2,1,1\n",
    b"point (no),x,y\n1,0,0\n2,1,1\n",
]  # fmt: skip
BAD_PATHS = [
    b"", b"x,y\n", b"x,y\n1,2\n", b"x,y\n1,2\n1,2\n", b"a,b\n1,2\n", b"x_mm,y\n1,2\n3,4\n", b"x,y\n1,a\n2,3\n",
    b"x,x_mm,y\n1,2,3\n4,5,6\n", b"1\n2\n", b"x,y\n1,inf\n2,3\n", b"x,y\n1,nan\n2,3\n", b"x,y\n1e120,2\n3,4\n",
    b"x_cm,y_cm\n1,5,2,5\n3,5,4,5\n",
]  # fmt: skip


def check_read(found: Any, wanted: pd.DataFrame) -> None:
    """Assert that words of the page are those of a table, and its numbers Python's."""
    assert [str(name).strip() for name in found["names"]] == [str(name).strip() for name in wanted]
    for name, words in zip(wanted, found["words"], strict=True):
        check_near(answer("tables.js", "numbersOf", words, str(name)), numbers_of(wanted[name]), 1e-12)


def test_numbers_of_tables() -> None:
    for data in TABLES:
        check_read(answer("tables.js", "parseWords", data, "t.csv"), parse_table(data, "t.csv", names=False))
    for data in BAD_TABLES:
        found = answer("tables.js", "parseWords", data, "t.csv")
        assert without_digits(found) == without_digits(refusal_of(parse_table, data, "t.csv", names=False)), data


def test_paths_in_tables() -> None:
    for data in PATHS:
        Path("a.csv").write_bytes(data)
        drawing, found = read_path("a.csv"), opened("a.csv", data)
        path, unit = drawing.path, drawing.unit
        (drawn,) = found["paths"]
        check_near(drawn["points"], path.points)
        assert (drawn["closed"], found["unit"] is None) == (path.closed, unit is None)
        assert unit is None or found["unit"] == pytest.approx(100 * unit)
    for data in BAD_PATHS:
        Path("a.csv").write_bytes(data)
        assert without_digits(opened("a.csv", data)) == without_digits(refusal_of(read_path, "a.csv")), data


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
ENDINGS = {"a.geojson": "GeoJSON", "a.gpx": "GPX", "a.GCODE": "G-code", "a.wkt": "WKT", "a.dxf": "DXF",
           "a.svgz": "a drawing"}  # fmt: skip


def test_files_of_other_kinds_are_refused_by_name() -> None:
    files = [(f"a.{ending}", text.encode("latin-1" if kind == "a picture" else "utf-8"), kind)
             for kind, texts in KINDS.items() for text in texts for ending in ("txt", "csv")]  # fmt: skip
    files += [(name, b"1,2\n3,4\n", kind) for name, kind in ENDINGS.items()]
    for name, content, kind in files:
        Path(name).write_bytes(content)
        refusal = refusal_of(read_path, name)
        assert kind in refusal, content
        assert "is not read; give a table with columns x and y, such as CSV, or an SVG drawing" in refusal
        assert str(opened(name, content)) == refusal
