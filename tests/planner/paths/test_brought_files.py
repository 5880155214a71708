"""Paths of files that other programs write: GeoJSON, DXF, messages of ROS, PathPlanner."""

from __future__ import annotations

import json
import math
from itertools import product
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
import pytest

from common import quantities
from common.errors import InputError
from planner.paths.path_files import Drawing, read_path
from tests.planner.plans import CONTROL

CORNERS = [[0, 0], [0.3, 0], [0.3, 0.2], [0.6, 0.2]]
RING = [[0, 0], [4, 0], [4, 3], [0, 3], [0, 0]]


def written(folder: Path, name: str, text: str, **options: Any) -> Drawing:
    (folder / name).write_text(text)
    return read_path(folder / name, **options)


def refused(folder: Path, name: str, text: str, **options: Any) -> str:
    with pytest.raises(InputError) as refusal:
        written(folder, name, text, **options)
    assert "\n" not in str(refusal.value)
    assert name in str(refusal.value)
    return str(refusal.value)


def block(x: float, y: float) -> str:
    return f"- header:\n    frame_id: map\n  pose:\n    position:\n      x: {x}\n      y: {y}\n      z: 0.0\n"


POSES = [  # of messages: ros2 topic echo, with --flow-style, rostopic echo, its poses alone, JSON, one pose each
    "header:\n  frame_id: map\nposes:\n" + "".join(block(x, y) for x, y in CORNERS) + "---\n",
    "header: {frame_id: map}\nposes: [" + ", ".join(
        f"{{pose: {{position: {{x: {x}, y: {y}, z: 0.0}}}}}}" for x, y in CORNERS) + "]\n---\n",
    "header: \n  seq: 0\nposes: \n" + "".join(
        f"  - \n    pose: \n      position: \n        x: {x}\n        y: {y}\n" for x, y in CORNERS),
    "poses:\n" + "".join(f"- position:\n    x: {x}\n    y: {y}\n" for x, y in CORNERS),
    json.dumps({"poses": [{"pose": {"position": {"x": x, "y": y}}} for x, y in CORNERS]}, indent=1),
    "---\n".join(f"header:\n  seq: 1\npose:\n  position:\n    x: {x}\n    y: {y}\n" for x, y in CORNERS),
    "#!/bin/sh\nros2 topic pub /path nav_msgs/msg/Path \"poses:\n"
    + "".join(block(x, y) for x, y in CORNERS) + '"',
]  # fmt: skip


@pytest.mark.parametrize("text", POSES, ids=range(len(POSES)))
def test_messages_of_ros_are_paths_in_metres(text: str, tmp_path: Path) -> None:
    drawing = written(tmp_path, "path.yaml", text)
    assert drawing.path.points.tolist() == CORNERS
    assert drawing.unit == 1.0


def test_a_message_that_comes_again_is_one_and_others_have_names(tmp_path: Path) -> None:
    assert written(tmp_path, "a.yaml", POSES[0] * 3).path.points.tolist() == CORNERS
    both = POSES[0] + POSES[0].replace("0.6", "0.9")
    assert "has 2 paths (message1, message2); choose one with --shape" in refused(tmp_path, "a.yaml", both)
    assert written(tmp_path, "a.yaml", both, shape="message2").path.points[-1].tolist() == [0.9, 0.2]


def test_a_message_that_was_cut_or_has_no_place_is_refused(tmp_path: Path) -> None:
    assert "--full-length" in refused(tmp_path, "a.yaml", POSES[0].replace("---", "- '...'\n---"))
    assert "no poses" in refused(tmp_path, "a.yaml", "header:\n  frame_id: map\nposes: []\n---\n")
    assert "could not convert" in refused(tmp_path, "a.yaml", POSES[0].replace("0.6", "far"))
    assert "finite numbers" in refused(tmp_path, "a.yaml", POSES[0].replace("0.6", "nan"))


@pytest.mark.parametrize("start", ["field.poses{}.pose.position.", "/plan/poses[{}]/pose/position/"])
def test_a_row_of_a_bag_is_a_path(start: str, tmp_path: Path) -> None:
    """The columns are sorted by name, as some programs do."""
    many = [[k, k % 2] for k in range(12)]
    columns = {
        start.format(k) + axis: point[i] for k, point in enumerate(many) for i, axis in enumerate("xyz"[:2])
    }
    names = ["%time", *sorted(columns)]
    row = ",".join(str(columns.get(name, 17)) for name in names)
    drawing = written(tmp_path, "a.csv", f"{','.join(names)}\n{row}\n{row}\n")
    assert drawing.path.points.tolist() == many
    assert drawing.unit == 1.0


def test_a_bag_of_single_poses_is_a_path(tmp_path: Path) -> None:
    rows = "".join(f"{k},map,{x},{y},0\n" for k, (x, y) in enumerate(CORNERS))
    head = "%time,field.header.frame_id,field.pose.position.x,field.pose.position.y,field.pose.position.z\n"
    assert written(tmp_path, "a.csv", head + rows).path.points.tolist() == CORNERS
    two = "a.position.x,a.position.y,b.position.x,b.position.y\n0,0,1,1\n1,1,2,2\n"
    assert "give x and y" in refused(tmp_path, "b.csv", two)


@pytest.mark.parametrize("anchor", ["anchor", "anchorPoint"])
def test_pathplanner_is_followed_along_its_curves(anchor: str, tmp_path: Path) -> None:
    """The quarter of a circle about (0, 0) from (1, 0) to (0, 1), of which a Bézier curve misses 0.03 %."""
    k = 4 / 3 * (math.sqrt(2) - 1)
    knots = [
        {anchor: {"x": 1, "y": 0}, "prevControl": None, "nextControl": {"x": 1, "y": k}},
        {anchor: {"x": 0, "y": 1}, "prevControl": {"x": k, "y": 1}, "nextControl": None},
    ]
    drawing = written(tmp_path, "a.path", json.dumps({"version": "2025.0", "waypoints": knots}))
    assert drawing.unit == 1.0
    assert np.hypot(*drawing.path.points.T) == pytest.approx(np.ones(len(drawing.path.points)), abs=4e-4)
    assert drawing.path.points[[0, -1]].tolist() == [[1, 0], [0, 1]]
    knots[1]["prevControl"] = None
    assert "not a path of PathPlanner" in refused(tmp_path, "a.path", json.dumps({"waypoints": knots}))
    assert "not a path of PathPlanner" in refused(tmp_path, "a.path", '{"waypoints": [{"anchor": {}}]}')


def test_poses_of_a_row_are_converted_together(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Not column by column, which takes seconds for a path of 5,000 poses."""
    calls = list[int]()
    convert = quantities.numbers_of
    monkeypatch.setattr(quantities, "numbers_of", lambda column: calls.append(len(column)) or convert(column))
    names = [f"/plan/poses[{k}]/pose/position/{axis}" for k in range(50) for axis in "xy"]
    values = [str(k + 0.5) for k in range(100)]
    drawing = written(tmp_path, "bag.csv", f"{','.join(names)}\n{','.join(values)}\n")
    assert calls == [100]
    assert drawing.path.points.ravel().tolist() == [k + 0.5 for k in range(100)]


def test_a_path_of_pathweaver_is_a_table(tmp_path: Path) -> None:
    rows = "0.8,3.9,2.4,0.0,true,false,\n4.6,3.0,1.1,0.9,true,false,\n"
    drawing = written(tmp_path, "a.path", f"X,Y,Tangent X,Tangent Y,Fixed Theta,Reversed,Name\n{rows}")
    assert drawing.path.points.tolist() == [[0.8, 3.9], [4.6, 3.0]]


def features(*parts: tuple[str, Any], **more: Any) -> str:
    shapes = [{"type": kind, "coordinates": places} for kind, places in parts]
    found = [{"type": "Feature", "id": f"f{k}", "geometry": shape} for k, shape in enumerate(shapes)]
    return json.dumps({"type": "FeatureCollection", **more, "features": found})


def test_geojson_needs_a_unit(tmp_path: Path) -> None:
    drawing = written(tmp_path, "a.geojson", features(("LineString", [[0, 0, 9], [0.5, 0, 9], [0.5, 0.4, 9]])))
    assert drawing.path.points.tolist() == [[0, 0], [0.5, 0], [0.5, 0.4]]
    with pytest.raises(InputError, match=r"degrees of longitude.* if these are metres, give --unit m"):
        drawing.in_tails(CONTROL)
    assert drawing.in_tails(CONTROL, "m").length == pytest.approx(0.9 / CONTROL.length_scale)
    for name in ("urn:ogc:def:crs:OGC:1.3:CRS84", "EPSG:4326"):
        crs = {"type": "name", "properties": {"name": name}}
        assert "degrees" in refused(tmp_path, "b.json", features(("LineString", RING), crs=crs))


def test_rings_and_parts_of_geojson_have_names(tmp_path: Path) -> None:
    hole = [[1, 1], [2, 1], [2, 2], [1, 1]]
    text = features(("Polygon", [RING, hole]), ("MultiLineString", [CORNERS, RING]), ("Point", [0, 0]))
    assert "has 4 paths (f0, f0/hole1, f1, f1/2)" in refused(tmp_path, "a.geojson", text)
    ring = written(tmp_path, "a.geojson", text, shape="f0").path
    assert ring.closed
    assert ring.length == 14
    assert written(tmp_path, "a.geojson", json.dumps({"type": "LineString", "coordinates": CORNERS})).path.length


BROKEN = [
    ("{\"type\": \"Feature\", \"geometry\": ", "not JSON"), ('{"type": "Feature"}', "no entry 'geometry'"),
    (features(("Point", [0, 0])), "no LineString and no Polygon"), (features(("LineString", 3)), "not GeoJSON"),
    (features(("LineString", [[0, "a"], [1, 1]])), "not GeoJSON"),
    (features(("Polygon", [[[0], [1]]])), "not enough values"),
    (features(("LineString", RING), ("Polygon", [])), "or an empty one"),
    (features(("LineString", [])), "or an empty one"),
]  # fmt: skip


@pytest.mark.parametrize(("text", "words"), BROKEN, ids=range(len(BROKEN)))
def test_damaged_geojson_is_refused_in_one_line(text: str, words: str, tmp_path: Path) -> None:
    assert words in refused(tmp_path, "a.geojson", text)


def test_drawings_of_cad_are_read_by_layer(tmp_path: Path) -> None:
    """A slot of two lines and two arcs, drawn in no order, and a polyline with a bulge, in mm."""
    ezdxf = pytest.importorskip("ezdxf")
    drawing = ezdxf.new(units=4)
    for layer in ("slot", "track", "off"):
        drawing.layers.add(layer)
    drawing.layers.get("off").off()
    space = drawing.modelspace()
    space.add_line((0, -10), (40, -10), dxfattribs={"layer": "slot"})
    space.add_arc((0, 0), 10, 90, 270, dxfattribs={"layer": "slot"})
    space.add_line((0, 10), (40, 10), dxfattribs={"layer": "slot"})
    space.add_arc((40, 0), 10, 270, 90, dxfattribs={"layer": "slot"})
    space.add_lwpolyline([(0, 0, 0), (30, 0, 1), (30, 20, 0)], format="xyb", dxfattribs={"layer": "track"})
    space.add_circle((0, 0), 5, dxfattribs={"layer": "off"})
    space.add_text("not drawn")
    space.add_lwpolyline([])
    space.add_line((40, 10), (40, 10), dxfattribs={"layer": "slot"})  # as a slip of the mouse leaves it
    drawing.saveas(tmp_path / "a.dxf")
    with pytest.raises(InputError, match=r"2 paths \(slot, track\); choose one with --shape"):
        read_path(tmp_path / "a.dxf")
    slot, track = (read_path(tmp_path / "a.dxf", shape=name) for name in ("slot", "track"))
    assert slot.unit == 0.001
    assert slot.path.closed
    assert slot.path.points[:2].tolist() == [[0, -10], [40, -10]]
    assert slot.path.length == pytest.approx(80 + 20 * math.pi, rel=1e-4)
    assert not track.path.closed
    assert track.path.length == pytest.approx(30 + 10 * math.pi, rel=1e-4)
    assert track.path.points[:, 0].max() == pytest.approx(40, abs=1e-3)


def test_blocks_and_curves_of_cad_are_read(tmp_path: Path) -> None:
    ezdxf = pytest.importorskip("ezdxf")
    drawing = ezdxf.new(units=0)
    drawing.blocks.new("ring").add_circle((0, 0), 1)
    drawing.modelspace().add_blockref("ring", (5, 0), dxfattribs={"xscale": 3, "yscale": 3})
    drawing.saveas(tmp_path / "a.dxf")
    ring = read_path(tmp_path / "a.dxf")
    assert ring.path.closed
    assert ring.path.length == pytest.approx(6 * math.pi, rel=2e-4)
    assert ring.path.points.mean(0) == pytest.approx([5, 0], abs=1e-2)
    with pytest.raises(InputError, match=r"\$INSUNITS does not say"):
        ring.in_tails(CONTROL)
    ellipse = ezdxf.new()
    ellipse.modelspace().add_spline([(0, 0), (1, 2), (3, 2), (4, 0)])
    ellipse.saveas(tmp_path / "b.dxf")
    assert read_path(tmp_path / "b.dxf").path.points[[0, -1]] == pytest.approx(np.array([[0, 0], [4, 0]]))


def named(name: str) -> dict[str, Any]:
    return {"type": "name", "properties": {"name": name}}


DEGREES = [
    *map(named, ["WGS 84", "WGS84", "EPSG:4326", "urn:ogc:def:crs:OGC:1.3:CRS84", "urn:ogc:def:crs:EPSG:6.9:4326",
                 "http://www.opengis.net/def/crs/EPSG/0/4326", "OGC:CRS84", "GCS_WGS_1984", "ETRS89", "epsg:4258",
                 "WGS 84 (G1762)", "NAD83", "WGS 84 (EPSG:4326)", "+proj=longlat +datum=WGS84"]),
    {"type": "EPSG", "properties": {"code": 4326}},
    {"type": "link", "properties": {"href": "http://spatialreference.org/ref/epsg/4326/proj4/", "type": "proj4"}},
]  # fmt: skip
METRES = [
    *map(named, ["urn:ogc:def:crs:EPSG::25832", "EPSG:32632", "WGS 84 / UTM zone 32N", "WGS_1984_UTM_Zone_32N",
                 "ETRS89 / UTM zone 32N", "EPSG:43260", "EPSG:2056", "WGS 84 UTM 32N", "local",
                 "+proj=utm +zone=32 +datum=WGS84 +units=m"]),
    {"type": "EPSG", "properties": {"code": 25832}}, None, {},
]  # fmt: skip


@pytest.mark.parametrize("crs", DEGREES + METRES)
def test_geojson_is_refused_where_its_crs_is_of_degrees(crs: dict[str, Any] | None, tmp_path: Path) -> None:
    line = {"type": "LineString", "coordinates": CORNERS}
    for shape in (line | {"crs": crs}, {"type": "GeometryCollection", "geometries": [line | {"crs": crs}]}):
        if crs in METRES:
            assert written(tmp_path, "a.geojson", json.dumps(shape)).in_tails(CONTROL, "m").length > 0
        else:
            assert "project it to metres" in refused(tmp_path, "a.geojson", json.dumps(shape))


def dxf(*lines: str, header: str = "$INSUNITS\n70\n4") -> str:
    """Return a drawing of lines "x y u v"; without a header it lacks that section."""
    parts = ["0\nLINE\n8\nway\n10\n{}\n20\n{}\n11\n{}\n21\n{}\n".format(*line.split()) for line in lines]
    sections = [f"HEADER\n9\n{header}\n"] * bool(header) + ["ENTITIES\n" + "".join(parts)]
    return "".join(f"0\nSECTION\n2\n{section}0\nENDSEC\n" for section in sections) + "0\nEOF\n"


WAY = ("0 0 400 0", "400 0 400 300")


@pytest.mark.parametrize("comment", ["", "999\n$INSUNITS is 9\n999\n$INSUNITS\n"])
@pytest.mark.parametrize("header", ["", "$ACADVER\n1\nAC1015", "$INSUNITS\n70\n0", "$INSUNITS\n70\n4"])
def test_a_drawing_that_does_not_say_its_unit_needs_one(header: str, comment: str, tmp_path: Path) -> None:
    pytest.importorskip("ezdxf")
    drawing = written(tmp_path, "a.dxf", comment + dxf(*WAY, header=header))
    assert drawing.unit == (1e-3 if "4" in header else None)
    assert drawing.in_tails(CONTROL, "mm").length * CONTROL.length_scale == pytest.approx(0.7)
    if drawing.unit is None:
        with pytest.raises(InputError, match="give --unit mm"):
            drawing.in_tails(CONTROL)


def test_the_unit_of_a_binary_drawing_is_known(tmp_path: Path) -> None:
    ezdxf = pytest.importorskip("ezdxf")
    for version, unit in product(("R12", "R2000"), (0, 4)):
        drawing = ezdxf.new(version, units=unit)
        drawing.modelspace().add_line((0, 0), (4, 0))
        drawing.header["$INSUNITS"] = unit
        drawing.saveas(tmp_path / "a.dxf", fmt="bin")
        assert read_path(tmp_path / "a.dxf").unit == (1e-3 if unit and version == "R2000" else None)


def test_blocks_that_stand_for_too_many_lines_are_refused_before_they_are_made(tmp_path: Path) -> None:
    ezdxf = pytest.importorskip("ezdxf")

    def drawn(insert: str, lines: int, rows: int = 1, last: str = "B0") -> str:
        """Return a drawing of blocks B0, of lines, to B8, of ten of the block before."""
        drawing = ezdxf.new(units=4)
        for k in range(9):
            drawing.blocks.new(f"B{k}")
        for k in range(1, 9):
            for _ in range(10):
                drawing.blocks.get(f"B{k}").add_blockref(f"B{k - 1}", (0, 0))
        for k in range(lines):
            drawing.blocks.get("B0").add_line((0, k), (1, k), dxfattribs={"layer": "way"})
        if last != "B0":
            drawing.blocks.get("B0").add_blockref(last, (0, 0))
        drawing.modelspace().add_blockref(insert, (0, 0)).grid((rows, rows), (2, 2))
        drawing.saveas(tmp_path / "b.dxf")
        return (tmp_path / "b.dxf").read_text()

    for given in (("B8", 10), ("b0", 1, 30_000), ("B8", 0), ("B3", 1, 20), ("B0", 1, 1, "B1")):
        assert "a.dxf: it draws more than 100000 pieces" in refused(tmp_path, "a.dxf", drawn(*given))
    assert "has 900 paths" in refused(tmp_path, "a.dxf", drawn("B0", 1, 30))


def test_many_lines_are_read_in_seconds_also_where_they_meet(tmp_path: Path) -> None:
    pytest.importorskip("ezdxf")
    turn = np.linspace(0, 60 * np.pi, 10_001)
    x, y = turn * np.cos(turn), turn * np.sin(turn)
    chain = map("{:.6f} {:.6f} {:.6f} {:.6f}".format, x, y, x[1:], y[1:])
    began = process_time()
    assert len(written(tmp_path, "a.dxf", dxf(*chain)).path.points) == 10_001
    text = dxf(*(f"0 0 {x} {y}" for x, y in zip(x[1:], y[1:], strict=True)))
    assert "has 10000 paths" in refused(tmp_path, "a.dxf", text)
    assert process_time() - began < 10


def test_a_dxf_without_lines_or_damaged_is_refused(tmp_path: Path) -> None:
    ezdxf = pytest.importorskip("ezdxf")
    ezdxf.new().saveas(tmp_path / "a.dxf")
    with pytest.raises(InputError, match=r"has no line, polyline, arc"):
        read_path(tmp_path / "a.dxf")
    assert "not DXF" in refused(tmp_path, "b.dxf", "0\nSECTION\n2\nENTITIES\n0\nLINE\n10\n")
