"""Tables, drawings and the paths in them are read or refused as by Python; a browser reads the same trees."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from common.errors import InputError
from common.quantities import numbers_of
from common.tables import parse_table
from planner.paths.path_files import ADVICE, READERS, read_path
from tests.common.test_tables import READ, REFUSED, TEXTS, TITLED
from tests.planner.page.page_core import (
    EXACT,
    FOLDER,
    answer,
    check_near,
    drawing_tree,
    opened,
    refusal_of,
    without_digits,
)
from tests.planner.page.view.browser import started_chromium
from tests.planner.paths import svg_cases
from tests.planner.paths.svg_cases import BROKEN, svg
from tests.planner.paths.test_path_files import ALIKE, SIZED, UNCLEAR

pytestmark = pytest.mark.usefixtures("empty_folder")

TABLES = [
    *(text.encode() for text in (*TEXTS.values(), *(text for text, _ in READ.values()))),
    b"1,2\n3,4\n", "x,y\n1,2\n".encode("utf-16"), "größe;y\n1;2\n".encode("latin-1"), b"\n\nx,y\n1,2",
    b"x,y\n1,\n,2\nabc,4\nnan,inf\n", b"x, y\n1, 2e3\n+.5, -1.\n", b"x,y,z\n1,2,\n3,4,\n", b"x,y\n1\n2,3\n",
    b"x;y\n1,5;abc\n2,5;3,5\n", b"x,y\n0x10,1_000\n1,2\n", b'x,y\n"c ""d""",30\n', b'"a;b";"x"\n1;2\n',
    b'"x\n[cm]",y\n1,"2"\n', b"#N/A,15\n1,2\n", b"%30,15\n1,2\n", b"x;y;z\n0,200;1,234;12,5\n1,234;2,000;3\n",
    b"time_s,x\n0:00:01,1\n1:02:03.5,2\nlost,3\n",
    b"time_min,x\n2026-05-01T12:00:00Z,1\n2026-05-01 14:00:30+01:00,2\n2026-13-01 12:00:00,2\n",
    b"t_s,x\n1714560000.5,1\n1714560002,2\n", b"t_s,x\n1714560000500,1\n0,2\n",
    b"time_h,x\n1 day 00:30:00,1\n2024-02-30,2\n",
    b"x,y,\n1,2,\n3,4\n", b"x y z\n 1 \"a b\" 3\n", b"x;y\n'=1+1;'-a\n''=b;-3\n", b"x,x_1\n1.200,300\n",
]  # fmt: skip
BAD_TABLES = [
    *(text.encode() for text, _ in (*REFUSED, *TITLED)), b"\n\n", b"x,y\n1,2,3\n4,5,6,7\n", b'x,y\n"1"2,3\n',
    b"x;y\n1 200;1\n", "x;y\n1\u202f200,5;1\n".encode(), b"'=x,'=x\n1,2\n", b"x\ty\n1 2\n3 4\n", b"x,y\n1,\x81\n",
]  # fmt: skip
PATHS = [
    *(text.encode() for text in (*ALIKE, *SIZED)), b"x,y\n0,0\n1,0\n1,1\n0,0\n",
    b"% G-code of a mill\n0 0\n1 1\n", b"G1,x,y\n1,0,0\n2,1,1\n", b"point (no),x,y\n1,0,0\n2,1,1\n",
]  # fmt: skip
BAD_PATHS = [
    *(text.encode() for text in UNCLEAR), b"", b"x,y\n", b"x,y\n1,2\n", b"x,y\n1,2\n1,2\n", b"a,b\n1,2\n",
    b"x,y\n1,inf\n2,3\n", b"x,y\n1,nan\n2,3\n", b"x,y\n1e120,2\n3,4\n", b"x_cm,y_cm\n1,5,2,5\n3,5,4,5\n",
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
    "a path of PathPlanner": ['{"waypoints": [{"anchor": {"x": 1, "y": 2}}]}'],
    "a bag of ROS": ["#ROSBAG V2.0\n"],
    "a map of ROS": ["image: tank.pgm\nresolution: 0.01\n", "# a\nresolution: 0.01\n"],
    "the picture of a map of ROS": ["P5\n8 6\n255\n"],
    "a message of ROS": ["header:\n  frame_id: map\nposes:\n- header:\n", "#!/bin/sh\nros2 pub nav_msgs/Path\n",
                         '{"header": {},\n"poses": [{"pose": {"position": {"x": 0, "y": 0}}}]}'],
    "YAML": ["---\na: 1\n"], "a script": ["#!/bin/sh\necho 1\n"],
    "PDF": ["%PDF-1.7"], "a picture": ["\x89PNG\r\n", "\xff\xd8\xff\xe0"],
}  # fmt: skip
ENDINGS = {"a.geojson": "GeoJSON", "a.gpx": "GPX", "a.GCODE": "G-code", "a.wkt": "WKT", "a.dxf": "DXF",
           "a.svgz": "a drawing", "a.mcap": "a bag of ROS"}  # fmt: skip


def test_files_of_other_kinds_are_refused_by_name() -> None:
    files = [(f"a.{ending}", text.encode("latin-1" if kind == "a picture" else "utf-8"), kind)
             for kind, texts in KINDS.items() for text in texts for ending in ("txt", "csv")]  # fmt: skip
    files += [(name, b"1,2\n3,4\n", kind) for name, kind in ENDINGS.items()]
    for name, content, kind in files:
        Path(name).write_bytes(content)
        shown = str(opened(name, content))
        assert kind in shown, content
        if kind in READERS:
            assert (
                shown == f"{name}: the page does not read {kind}; give CSV or SVG, or make the page with this path"
            )
            continue
        assert f"is not read; {ADVICE.get(kind, 'give a table with columns x and y')}" in shown
        assert shown == refusal_of(read_path, name)


BODIES = [
    "<polyline points='0,0 3,0 3,-4'/>", "<polygon points='0,0 3,0 3,-4'/>", "<path d='M 0 0 h 3 v -4 Z'/>",
    "<path d='M 1 1 L 4 1 l 0 -4'/>", "<line x1='1' y1='1' x2='4' y2='-3'/>", "<circle cx='2' cy='1' r='3'/>",
    "<rect x='1' y='1' width='3' height='2'/>", "<rect x='1' width='9' height='6' rx='2'/>",
    "<ellipse rx='3' ry='1'/>", "<path d='M 0 0 A 3 1 0 0 1 6 0'/>", "<path d='M 0 0 C 1 2 3 2 4 0'/>",
    "<path d='M0,0c1-2 3-2 4 0s3 2 4 0'/>", "<path d='M0 0Q1 2 3 0T6 0t3 1'/>", "<path d='m1 1 2 3 4-1z'/>",
    "<path d='M0 0a2 3 30 1 0 4 1A1 1 0 0110 10'/>",
    "<g transform='translate(10,0) rotate(90)'><path d='M 0 0 L 2 0' transform='scale(3)'/></g>",
    "<path d='M0 0H5V2h-1v3' transform='matrix(1 .5 -.3 2 7 8)'/>", "<circle r='2' transform='scale(2,-1)'/>",
    "<rect width='4' height='2' transform='rotate(30)'/>", "<path d='M0 0L1 2' transform='rotate(0.25turn 1 0)'/>",
    "<path d='M0 0C1 2 3 2 4 0' transform='skewX(20) skewY(-10deg) translate(3)'/>",
    "<ellipse rx='3' ry='1' transform='rotate(30 1 2)'/>", "<path d='M0 0L1 2' transform='rotate(3rad)'/>",
    "<path d='M0 0A3 1 20 0 0 5 5' transform='rotate(40)'/>",
    "<path d='M0 0A3 1 20 0 0 5 5A2 2 0 0 1 7 7' transform='skewX(30) scale(1 -3)'/>",
    "<path d='M0 0L1 2' transform='none'/>",
    "<defs><path id='p' d='M0 0L1 2 3 1'/></defs><use href='#p' x='3' y='1' transform='scale(2)'/>",
    "<g style='display:none'><path d='M0 0L9 9'/></g><path d='M0 0L1 1'/>", "<path d='M0 0L1e1,2.5e-1.5.5'/>",
    "<!-- c --><path d='M0 0L&#49; 1'/><text><![CDATA[<]]></text><title>t &amp; &#x41;</title>",
    "<g xmlns:p='v' p:d='1'><p:c p:d='1' e='2'/><path d=\"M0 0L1 1\"\n/></g>",
]  # fmt: skip
ROOTS = ["width='5cm' height='5cm' viewBox='0 0 100 100'", "width='70mm' height='30mm' viewBox='1 2 100 100'",
         "viewBox='0 0 10 10' width='200' height='100' preserveAspectRatio='xMaxYMin slice'"]  # fmt: skip
SEVERAL = (
    "<defs><clipPath id='c'><path d='M 0 0 L 9 9'/></clipPath></defs>"
    "<path id='outline' d='M 0 0 L 1 0 M 5 5 L 5 7'/><rect width='2' height='2'/><text>no path</text>"
)

DRAWINGS = [svg(body) for body in BODIES]
DRAWINGS += [svg(body, root) for root in ROOTS for body in (BODIES[5], BODIES[11], "<circle cx='5' r='3cm'/>")]
DRAWINGS += [text for pair in svg_cases.ALIKE for text in pair]


def check_drawing(text: str, shape: str | None = None, index: int = 0) -> None:
    Path("a.svg").write_text(text, encoding="utf-8")
    drawing, found = read_path("a.svg", shape=shape), opened("a.svg", text)
    path, unit = drawing.path, drawing.unit
    assert not isinstance(found, InputError), (found, text)
    drawn = found["paths"][index]
    assert drawn["closed"] == path.closed
    assert (found["unit"] is None) == (unit is None)
    check_near(drawn["points"], path.points, EXACT * max(1.0, float(np.abs(path.points).max())))
    if unit is not None:
        assert found["unit"] == pytest.approx(100 * unit)


def test_drawings() -> None:
    for text in DRAWINGS:
        check_drawing(text)
    for index, name in enumerate(("outline/1", "outline/2", "rect1")):
        check_drawing(svg(SEVERAL), name, index)
    assert [path["name"] for path in opened("a.svg", svg(SEVERAL))["paths"]] == ["outline/1", "outline/2", "rect1"]


BAD_DRAWINGS = [text for text, _ in svg_cases.REFUSED if "<?xml-stylesheet" not in text]


@pytest.mark.parametrize("text", BAD_DRAWINGS, ids=range(len(BAD_DRAWINGS)))  # no process starts with a long name
def test_bad_drawings_are_refused(text: str) -> None:
    refusal = opened("a.svg", text)
    assert isinstance(refusal, InputError), text
    assert str(refusal).startswith("a.svg")
    assert "\n" not in str(refusal)


def test_a_browser_reads_the_same_trees() -> None:
    source = "\n".join((FOLDER / name).read_text() for name in ("words.js", "view/files.js"))
    source = "\n".join(line for line in source.splitlines() if not line.startswith(("import ", "export ")))
    read = f"""(texts) => {{ {source}
      return texts.map((text) => refusing(() => drawingTree(text, "a.svg"), ({{ message }}) => message)); }}"""
    entity = "<!DOCTYPE svg [<!ENTITY e 'M 0 0 L 9 9'>]>"
    texts = [*DRAWINGS, svg("<path d='&e;'/>", "", entity), svg(BODIES[0], "", "<?xml version='1.0'?><!-- c -->")]
    with started_chromium() as browser:
        found: list[Any] = browser.new_page().evaluate(
            read, [*texts, *BROKEN, "<?xml-stylesheet href='a'?><svg/>"]
        )
    assert found[: len(texts)] == [drawing_tree(text) for text in texts]
    assert all(words.startswith("a.svg is not SVG: ") and "\n" not in words for words in found[len(texts) : -1])
    assert "save the drawing with its style" in found[-1]
