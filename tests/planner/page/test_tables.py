"""Tables of numbers and the paths in them are read, and files of other kinds refused, as by Python."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

import softflagella as sf
from planner.paths.path import circle
from planner.paths.path_files import read_path
from sim.io.errors import InputError
from sim.io.quantities import numbers_of
from sim.io.seals import sealed
from sim.io.text_tables import parse_table
from sim.model.plan_file import plan_id
from sim.model.robot_toml import robot_toml
from tests.planner.page.cases import CONTROL, planned
from tests.planner.page.page_core import answer, check_near
from tests.planner.page.parity import check_parity, refusal_of, without_digits

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
    "x;y\n1\u202f200,5;1\n".encode(), b"'=x,'=x\n1,2\n", b"x\ty\n1 2\n3 4\n", b"1,2\n3,4\n",
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


def numbers_in(data: bytes, name: str, names: bool) -> dict[str, Any]:
    table = parse_table(data, name, names=names)
    table = table.rename(columns=lambda name: name.strip() if isinstance(name, str) else name)
    return {"names": list(table), "columns": [numbers_of(table[name]).to_list() for name in table]}


def test_numbers_of_tables() -> None:
    given = [(data, "table.csv", False) for data in TABLES]
    assert check_parity("text_tables.js", "parseTable", numbers_in, given) == 0
    bad = [(data, "table.csv", True) for data in BAD_TABLES]
    assert check_parity("text_tables.js", "parseTable", numbers_in, bad, words=without_digits) == len(bad)


def path_in(data: bytes, name: str, closed: bool | None = None) -> dict[str, Any]:
    Path(name).write_bytes(data)
    drawing = read_path(name, closed=closed)
    return {"path": drawing.path, "unit": drawing.unit}


def test_paths_in_tables() -> None:
    cases = [(data, "a.csv", closed) for data in PATHS for closed in (None, True)]
    assert check_parity("path_files.js", "readTablePath", path_in, cases) == 0
    bad = [(data, "a.csv") for data in BAD_PATHS]
    assert check_parity("path_files.js", "readTablePath", path_in, bad, words=without_digits) == len(bad)


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


def opened(name: str, text: str | bytes) -> Any:
    content = text.encode() if isinstance(text, str) else text
    return answer("open_file.js", "openFile", {"name": name, "bytes": content})


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


def test_paths_tracks_robots_runs_and_drawings_are_told_apart() -> None:
    path = opened("a.csv", "x_mm;y_mm\n0;0\n300,5;0\n")
    assert (path["kind"], path["unit"]) == ("path", pytest.approx(0.1))
    check_near(path["paths"][0]["points"], [[0, 0], [300.5, 0]])
    assert opened("b.csv", "x,y\n0,0\n3,0\n")["unit"] is None
    track = opened("t.csv", "time_s,x_cm,y_cm,heading_deg,plan_id\n0,0,0,0,p1\n1,0,0,0,\n2,0,0,0,p1\n")
    assert (track["kind"], track["table"]["plans"]) == ("track", ["p1"])
    runs = ("N,l_cm,omega_rpm,theta_deg\n3,9,100,20\n", "tails;rpm\n3;100\n", "theta_deg,R_yr_mm\n3,4\n")
    assert [opened("runs.csv", text)["kind"] for text in runs] == ["runs"] * 3
    assert opened("robot.toml", robot_toml(CONTROL))["fields"]["tailLength"] == CONTROL.tail_length
    drawing = opened("two.svg", '<svg><path id="a" d="M0 0 h 9"/><path id="b" d="M0 0 v 9 h 3 z"/></svg>')
    assert [(path["name"], path["closed"]) for path in drawing["paths"]] == [("a", False), ("b", True)]


def check_plan_opened(content: dict[str, Any]) -> None:
    found = opened("plan.json", json.dumps(content, indent=1))
    (drawn,) = found["paths"]
    assert (found["kind"], found["unit"], drawn["closed"]) == ("path", pytest.approx(11.0), content["closed"])
    check_near(drawn["points"], content["raw_path"][:-1] if content["closed"] else content["raw_path"])


def test_a_plan_with_more_than_a_path_gives_it() -> None:
    content = {**planned("circle", objective="flips").to_dict(), "lap": {"period_s": 1.0}, "arrival": None}
    check_plan_opened({**content, "id": plan_id(content)})


@pytest.mark.rest
def test_plans_with_laps_walls_or_an_arrival_give_their_paths() -> None:
    walls = [sf.Circle(6.0, 0.0, 0.5)]
    options: dict[str, dict[str, Any]] = {"lap": {"loop": True}, "arrival": {"arrive_seconds": 1800.0},
                                          "kept_clear": {"keep_out": walls}}  # fmt: skip
    for kind, option in options.items():
        content = sf.plan(circle(2.0), CONTROL, objective="flips", **option).to_dict()
        assert kind in content
        check_plan_opened(content)


def test_an_edited_plan_and_a_robot_that_was_cut_are_refused() -> None:
    content = {**planned("circle", objective="flips").to_dict(), "code_version": "0"}
    check_plan_opened(content)
    content["raw_path"][1][0] += 0.1
    assert "plan.json was edited or damaged after it was written" in str(opened("plan.json", json.dumps(content)))
    whole = sealed(robot_toml(CONTROL))
    assert opened("robot.toml", whole)["kind"] == "robot"
    for text in (whole[:-30], whole.replace("C_t = 3.", "C_t = 4.")):
        assert "robot.toml was edited, damaged or cut short" in str(opened("robot.toml", text))


def test_other_files_are_refused_in_one_line() -> None:
    for name, content in (
        ("names.csv", b"a,b\n1,2\n2,3\n"), ("none.svg", b"<svg></svg>"), ("bad.svg", b"<svg><path d='M'"),
        ("picture.png", b"\x89PNG\r\n\x1a\n\x00\x00\x00\rIHDR"), ("robot.toml", b"tails = 2\nlenght_cm = 3\n"),
        ("robot.toml", b"\xff\xfe\x00"), ("track.csv", b"time_s,x_cm,y_cm,heading_deg\n"), ("plan.json", b"{"),
        ("plan.json", b"{}"), ("plan.json", b'{"format": 1}'), ("plan.json", b'{"format": 2}'),
        ("plan.json", b"[1, 2]"),
        ("plan.json", b'{"format": 2, "robot": {"tail_length_m": 0.1}, "raw_path": [[0, 1], [2]]}'),
        ("plan.json", b'{"format": 2, "robot": {"tail_length_m": 0.1}, "raw_path": 3}'),
    ):  # fmt: skip
        refusal = opened(name, content)
        assert isinstance(refusal, InputError), content
        assert len(str(refusal).splitlines()) == 1
