"""Obstacles of files that other programs write: maps of ROS, and polygons of GeoJSON."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path
from time import process_time

import numpy as np
import pytest
from PIL import Image

from common.arrays import Flags, Floats
from common.errors import InputError, InputWarning
from planner.jobs.plan import plan
from planner.options import read_regions, request_of
from planner.paths.obstacles import Circle, FreeSpace
from planner.paths.ros_map import without_holes
from tests.planner.plans import CONTROL

YAML = "image: tank.pgm\nresolution: 0.01\norigin: [-0.5, -0.4, 0.0]\nnegate: 0\noccupied_thresh: 0.65\n"
FREE, UNKNOWN, OCCUPIED = 254, 205, 0


def map_of(folder: Path, levels: Floats, yaml: str = f"{YAML}free_thresh: 0.196\n") -> FreeSpace:
    """Return the obstacles of a map, in m."""
    name = yaml.partition("image: ")[2].partition("\n")[0].strip("'\"")
    Image.fromarray(levels.astype(np.uint8)).save(folder / name)
    (folder / "map.yaml").write_text(yaml)
    regions = read_regions(str(folder / "map.yaml"), None, CONTROL)
    return FreeSpace(tuple(regions))


def middles(cells: Flags, *, cell: float = 0.01, yaw: float = 0.0) -> tuple[Floats, Floats]:
    """Return the middles (n, 2) of cells in l, where they are set and where they are not, by the definition."""
    rows, columns = np.indices(cells.shape)
    x, y = cell * (columns + 0.5), cell * (len(cells) - rows - 0.5)
    turned = np.stack([x * np.cos(yaw) - y * np.sin(yaw) - 0.5, x * np.sin(yaw) + y * np.cos(yaw) - 0.4], -1)
    return turned[cells] / CONTROL.length_scale, turned[~cells] / CONTROL.length_scale


def checked(space: FreeSpace, cells: Flags, *, yaw: float = 0.0) -> None:
    """All cells are inside an outline, and none is more than two cells inside that is not set."""
    kept, free = middles(cells, yaw=yaw)
    assert space.distance(kept).max() < 0
    apart = np.linalg.norm(free[:, None] - kept[None], axis=-1).min(1)
    assert (space.distance(free)[apart > 0.026 / CONTROL.length_scale] > 0).all()


def room(rng: np.random.Generator) -> Flags:
    """Return a room with walls, a slanted bar and specks."""
    cells = rng.random((60, 80)) < 0.004
    cells[[0, -1]] = cells[:, [0, -1]] = True
    rows, columns = np.indices(cells.shape)
    return cells | (np.abs(columns - 2 * rows + 20) < 4) & (rows > 15) & (rows < 45)


@pytest.mark.parametrize("seed", range(5))
def test_outlines_contain_all_cells_and_have_few_corners(seed: int, tmp_path: Path) -> None:
    cells = room(np.random.default_rng(seed))
    space = map_of(tmp_path, np.where(cells, OCCUPIED, FREE))
    checked(space, cells)
    corners = sum(len(region.corners) for region in space.regions)
    assert corners < 0.5 * cells.sum()


def test_origin_yaw_picture_and_negation(tmp_path: Path) -> None:
    cells = room(np.random.default_rng(5))
    yaml = YAML.replace("0.0]", "0.7]").replace("tank.pgm", "'tank.png'").replace("negate: 0", "negate: 1")
    yaml = yaml.replace("[-0.5, -0.4, 0.7]", "\n- -0.5\n- -0.4\n- 0.7") + "free_thresh: 0.1  # of 1\nmode: scale\n"
    checked(map_of(tmp_path, np.where(cells, 255, 0), yaml), cells, yaw=0.7)


def test_unknown_cells_are_occupied_and_said(tmp_path: Path) -> None:
    levels = np.full((30, 40), FREE)
    levels[10:14, 20:29] = UNKNOWN
    with pytest.warns(InputWarning, match="36 of 1200 cells are unknown and count as occupied"):
        space = map_of(tmp_path, levels)
    checked(space, levels == UNKNOWN)


@pytest.mark.parametrize("mode", ["", "mode: trinary\n", "mode: scale\n", "mode: raw\n"])
def test_the_grey_of_cells_that_no_scan_has_reached_is_unknown_at_the_threshold_of_nav2(
    mode: str, tmp_path: Path
) -> None:
    """Grey 205 is 0.196, below 0.25; in the other modes it means what the thresholds say."""
    levels = np.full((30, 40), FREE if "raw" not in mode else 0)
    levels[10:14, 20:29] = UNKNOWN
    levels[2:4, 2:4] = OCCUPIED if "raw" not in mode else 100
    kept = levels != levels[0, 0] if "scale" not in mode else levels == OCCUPIED
    with nullcontext() if "scale" in mode else pytest.warns(InputWarning, match="36 of 1200 cells are unknown"):
        checked(map_of(tmp_path, levels, f"{YAML}free_thresh: 0.25\n{mode}"), kept)


GREYS = np.repeat([[OCCUPIED, UNKNOWN, FREE, 255]], 8, axis=1).repeat(12, axis=0).astype(np.uint8)
EIGHT, DEEP = Image.fromarray(GREYS), Image.fromarray(GREYS.astype(np.uint16) * 257)
PICTURES = {  # with the options of their file
    "8 bits.png": (EIGHT, {}), "16 bits.png": (DEEP, {}), "16 bits.pgm": (DEEP, {}), "16 bits.tiff": (DEEP, {}),
    "palette.png": (EIGHT.convert("P"), {}), "colours.png": (EIGHT.convert("RGBA"), {}),
    "ink.tiff": (EIGHT.convert("CMYK"), {}), "two bits.png": (EIGHT.quantize(4), {}),
    "seen through.png": (EIGHT, {"transparency": UNKNOWN}),
    "seen through and deep.png": (DEEP, {"transparency": UNKNOWN * 257}),
    "palette seen through.png": (EIGHT.convert("P"), {"transparency": UNKNOWN}),
    "palette of alphas.png": (EIGHT.convert("P"), {"transparency": bytes([255] * UNKNOWN + [0] + [255] * 50)}),
}  # fmt: skip


@pytest.mark.filterwarnings("ignore:.*unknown and count as occupied")
@pytest.mark.parametrize("name", PICTURES)
def test_pictures_of_any_depth_say_the_same(name: str, tmp_path: Path) -> None:
    picture, options = PICTURES[name]
    picture.save(tmp_path / name, **options)
    (tmp_path / "map.yaml").write_text(YAML.replace("tank.pgm", name) + "free_thresh: 0.196\n")
    checked(FreeSpace(tuple(read_regions(str(tmp_path / "map.yaml"), None, CONTROL))), GREYS < FREE)


@pytest.mark.parametrize("mode", ["I", "F"])
def test_a_picture_whose_white_is_not_known_is_refused(mode: str, tmp_path: Path) -> None:
    EIGHT.convert(mode).save(tmp_path / "tank.tiff")
    (tmp_path / "map.yaml").write_text(YAML.replace("pgm", "tiff") + "free_thresh: 0.196\n")
    with pytest.raises(InputError, match=f"a trinary map of Pillow's mode {mode}, and not of 8 bits"):
        read_regions(str(tmp_path / "map.yaml"), None, CONTROL)
    DEEP.save(tmp_path / "tank.tiff")
    (tmp_path / "map.yaml").write_text(YAML.replace("pgm", "tiff") + "free_thresh: 0.196\nmode: raw\n")
    with pytest.raises(InputError, match="a raw map of Pillow's mode I;16, and not of 8 bits"):
        read_regions(str(tmp_path / "map.yaml"), None, CONTROL)


def test_a_map_of_many_specks_is_read_at_once_and_one_of_too_many_is_refused(tmp_path: Path) -> None:
    specks = np.random.default_rng(0).random((1100, 1100)) < 0.04
    began = process_time()
    space = map_of(tmp_path, np.where(specks, OCCUPIED, FREE))
    assert process_time() - began < 10
    assert len(space.regions) > 20_000
    with pytest.raises(InputError, match=r"map\.yaml: 500000 runs of cells .*more than 200000; remove specks"):
        map_of(tmp_path, np.indices((1000, 1000)).sum(0) % 2 * FREE)


BROKEN = {
    "resolution: 0.01\n": ("", "no entry 'resolution'"), "0.01": ("0", "resolution 0; give"),
    "tank.pgm\n": ("other.pgm\n", "other.pgm: no such file"),
    "free_thresh: 0.196": ("free_thresh: low", "free_thresh low; give a share from 0 to 1, such as 0.65 for 65 %"),
    "0.196": ("19.6", "free_thresh 19.6; give a share"), "0.65": ("65%", "occupied_thresh 65%; give a share"),
    "h: 0.65": ("h: -0.65", "occupied_thresh -0.65; give"), "h: 0.196": ("h: nan", "free_thresh nan; give"),
    "sh: 0.196": ("sh: 0.7", "free_thresh 0.7 is above occupied_thresh 0.65; exchange them"),
    "[-0.5, -0.4, 0.0]": ("[1]", "no entry 'origin: [x, y, yaw]'"),
    "negate: 0": ("negate: 0\nmode: odd", "mode odd; allowed"),
}  # fmt: skip


@pytest.mark.parametrize("given", BROKEN)
def test_damaged_maps_are_refused_in_one_line(given: str, tmp_path: Path) -> None:
    text, (other, words) = f"{YAML}free_thresh: 0.196\n", BROKEN[given]
    Image.fromarray(np.full((4, 4), OCCUPIED, dtype=np.uint8)).save(tmp_path / "tank.pgm")
    (tmp_path / "map.yaml").write_text(text.replace(given, other))
    with pytest.raises(InputError) as refusal:
        read_regions(str(tmp_path / "map.yaml"), None, CONTROL)
    assert words in str(refusal.value)
    assert "map.yaml" in str(refusal.value)


def test_a_map_without_obstacles_or_with_a_damaged_picture_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="all cells are free"):
        map_of(tmp_path, np.full((4, 4), FREE))
    (tmp_path / "tank.pgm").write_text("no picture")
    with pytest.raises(InputError, match=r"tank.pgm cannot be read as a picture [^<]*; save"):
        read_regions(str(tmp_path / "map.yaml"), None, CONTROL)


@pytest.mark.parametrize("make", [os.mkfifo, os.mkdir])
def test_a_picture_that_is_no_file_is_refused(make: Callable[[Path], None], tmp_path: Path) -> None:
    make(tmp_path / "tank.pgm")
    (tmp_path / "map.yaml").write_text(f"{YAML}free_thresh: 0.196\n")
    with pytest.raises(InputError, match=r"tank\.pgm is a .*; give a file"):
        read_regions(str(tmp_path / "map.yaml"), None, CONTROL)


@pytest.mark.parametrize("spread", [0.1, 5.0, 50.0])
def test_distances_are_those_from_the_nearest_of_all_regions(spread: float) -> None:
    rng = np.random.default_rng(6)
    regions = tuple(Circle(*rng.uniform(-20, 20, 2), rng.uniform(0.1, 3)) for _ in range(60))
    points = rng.uniform(-20, 20, 2) + spread * rng.standard_normal((40, 2))
    nearest = np.min([region.distance(points) for region in regions], axis=0)
    assert FreeSpace(regions).distance(points).tolist() == nearest.tolist()


SQUARE = [[0, 0], [1, 0], [1, 1], [0, 1], [0, 0]]
HOLE = [[0.2, 0.2], [0.2, 0.8], [0.8, 0.8], [0.8, 0.2], [0.2, 0.2]]


def geojson(folder: Path, *shapes: tuple[str, object]) -> str:
    geometries = [{"type": kind, "coordinates": places} for kind, places in shapes]
    (folder / "a.geojson").write_text(json.dumps({"type": "GeometryCollection", "geometries": geometries}))
    return str(folder / "a.geojson")


def test_polygons_of_geojson_are_obstacles_and_their_holes_are_free(tmp_path: Path) -> None:
    far = [[[x + 3, y] for x, y in SQUARE]]
    file = geojson(tmp_path, ("Polygon", [SQUARE, HOLE]), ("MultiPolygon", [far]))
    space = FreeSpace(tuple(read_regions(file, "m", CONTROL)))
    places = (
        np.array([[0.1, 0.5], [0.6, 0.1], [0.9, 0.9], [3.5, 0.5], [0.5, 0.5], [2, 0.5]]) / CONTROL.length_scale
    )
    assert (space.distance(places) < 0).tolist() == [True, True, True, True, False, False]
    assert space.distance(places[4:]) * CONTROL.length_scale == pytest.approx([0.3, 1.0])
    with pytest.raises(InputError, match=r"a\.geojson.* give --unit m"):
        read_regions(file, None, CONTROL)
    far_away = [[[x + 90, y] for x, y in SQUARE]]
    obstacle = geojson(tmp_path, ("Polygon", far_away))
    beside = plan("circle:2l", CONTROL, keep_out=(obstacle,), unit="m")
    assert beside.request.space.boxes()[0][0] * CONTROL.length_scale == pytest.approx([90, 0])
    assert beside.drawn.length == pytest.approx(4 * np.pi, rel=1e-3)
    geojson(tmp_path, ("Polygon", [SQUARE, HOLE]), ("MultiPolygon", [far]))
    with pytest.raises(InputError, match="give a box or an outline"):
        request_of({"walls": file, "unit": "m"}, CONTROL)


def test_lines_and_crossing_polygons_of_geojson_are_no_obstacles(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="LineString, which encloses nothing"):
        read_regions(geojson(tmp_path, ("LineString", SQUARE)), "m", CONTROL)
    eight = [[[0, 0], [1, 1], [1, 0], [0, 1], [0, 0]]]
    with pytest.raises(InputError, match="Self-intersection"):
        read_regions(geojson(tmp_path, ("Polygon", eight)), "m", CONTROL)
    with pytest.raises(InputError, match="not GeoJSON"):
        read_regions(geojson(tmp_path, ("Polygon", [[[0, 0], [1, 1]]])), "m", CONTROL)
    for empty in ([], [[]]):
        with pytest.raises(InputError, match="or an empty one"):
            request_of({"keep_out": (geojson(tmp_path, ("Polygon", empty)),), "unit": "m"}, CONTROL)


def test_all_shapes_of_a_drawing_are_obstacles(tmp_path: Path) -> None:
    (tmp_path / "a.svg").write_text("<svg><rect width='2' height='1'/><circle cx='9' r='1'/></svg>")
    assert len(read_regions(str(tmp_path / "a.svg"), "cm", CONTROL)) == 2


def test_a_region_is_cut_through_its_holes_and_keeps_its_area() -> None:
    from shapely import Polygon, union_all

    holes = [[(x + 0.1, y + 0.1), (x + 0.4, y + 0.1), (x + 0.1, y + 0.4)] for x in range(3) for y in range(3)]
    region = Polygon([(0, 0), (4, 0), (4, 4), (0, 4)], holes)
    parts = without_holes(region)
    assert not any(part.interiors for part in parts)
    assert math.fsum(part.area for part in parts) == pytest.approx(region.area)
    assert union_all(parts).symmetric_difference(region).area < 1e-9
