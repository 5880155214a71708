"""What a view.toml says, and a line for each that says nothing."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from camera.detector import Detector, Lost, Pose
from camera.view import EXAMPLE, Lens, read_setup
from common.errors import InputError
from tests.oracles.tank import Tank, circling

RULER, LAST, SQUARE = "length_cm = 30", "# ahead_mm = 0", "[[100, 650], [900, 650], [900, 100], [100, 100]]"
LENS = "focal_px = [0, 9]\ncentre_px = [6, 3]\ndistortion = [0, 0, 0, 0, 0]"
REFUSED = {  # what of EXAMPLE is written otherwise, and the message
    "misspelt": (RULER, "lenght_cm = 30", "unknown entry [scale] lenght_cm; is it length?"),
    "no unit": (RULER, "length = 30", "[scale] length has no unit of length; give length_cm"),
    "places without a unit": (RULER, f"points = {SQUARE}", "[scale] points has no unit of length; give points_cm"),
    "two lengths": (RULER, f"{RULER}\nlength_mm = 310", "length_mm: another entry gives length, too"),
    "a length and places": (RULER, f"{RULER}\npoints_cm = {SQUARE}", "no scale, or two; give [scale] points_px"),
    "no length": (RULER, "length_deg = 30", "[scale] length_deg has no unit of length"),
    "no number": (RULER, 'length_cm = "30"', "[scale] length_cm = '30'; give a number"),
    "one point": ("[100, 650], ", "", "points_px: give 2 points or more"),
    "the same point": ("[100, 650], ", "[900, 650], ", "[scale] the two points are the same"),
    "no scale": ("points_px = [[100, 650], [900, 650]]\n", "", "no scale, or two; give [scale] points_px"),
    "mirrored": (RULER, "points_cm = [[0, 30], [30, 30], [30, 0], [0, 0]]", "mirror images of each other"),
    "another order": (RULER, "points_cm = [[0, 0], [30, 30], [30, 0], [0, 30]]", "go around in different orders"),
    "no distance": (LAST, "apart_mm = 0", "[robots] apart_mm = 0; give a number, apart_cm"),
    "a tiny length": (RULER, "length_cm = 1e-300", "[scale] length_cm = 1e-300; give a number, length_cm or in"),
    "a tiny distance": (LAST, "apart_cm = 1e-300", "[robots] apart_cm = 1e-300; give a number"),
    "far ahead": (LAST, "ahead_cm = -9e8", "[robots] ahead_cm = -900000000.0; give a number"),
    "a tiny focus": ("# [lens]", f"[lens]\n{LENS.replace('0', '1e-300', 1)}", "[lens] focal_px: give numbers"),
    "on a line": ("[900, 100], [100, 100]]", "[500, 650], [300, 650]]", "the points lie on a line"),
    "other robot": (LAST, "ahead = 0", "[[robots]] 1: [robots] ahead has no unit of length"),
    "no colour": ('"green"', '"grass"', "[[robots]] 1: rear = 'grass'; give red, orange"),
    "no file's name": (LAST, 'name = "a/b"', "[[robots]] 1: name = 'a/b'; give letters, digits"),
    "no word": ('"green"', '["green"]', "[[robots]] 1: rear = ['green']; give red, orange"),
    "grey": ('"green"', '"#808890"', '[[robots]] 1: rear = "#808890" is nearly grey'),
    "alike": ('"green"', '"orange"', "[[robots]] 1: front and rear have nearly the same colour"),
    "alike across red": ('"green"', '"#ff0060"', "[[robots]] 1: front and rear have nearly the same colour"),
    "one name": (LAST, '[[robots]]\nname = "1"\nfront = "blue"\nrear = "yellow"', "two robots have one name"),
    "one marking": (LAST, '[[robots]]\nfront = "red"\nrear = "green"', "two robots have the same markers"),
    "turned bands": (LAST, "turned_deg = 5", "[[robots]] 1: turned_deg = 5; give the degrees by which"),
    "no tag": (LAST, "tag = 1000", "[[robots]] 1: tag = 1000; give the number of a tag, 0 to 999"),
    "no dictionary": ('# dictionary = "4x4_50"', 'dictionary = "5x5"', "dictionary = '5x5'; give one of OpenCV's"),
    "no side": (f"points_px = [[100, 650], [900, 650]]\n{RULER}", "tag_cm = 0", "tag_cm = 0; give a number"),
    "three points": ("[100, 650], ", "[100, 650], [500, 650], ", "[scale] a length and 3 points_px; give two"),
    "no lens": ("# [lens]", f"[lens]\n{LENS}", "[lens] focal_px: give numbers of pixels, 1 or more"),
    "side": ('"down"', '"left"', "looks = 'left'; give \"down\""),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_an_entry_that_cannot_be_used_is_named(case: str, tmp_path: Path) -> None:
    old, new, message = REFUSED[case]
    text = EXAMPLE
    if case in ("mirrored", "on a line", "another order"):
        text = text.replace("[[100, 650], [900, 650]]", SQUARE)
    if case == "on a line":
        text = text.replace(RULER, "points_cm = [[0, 0], [30, 0], [15, 0], [8, 0]]")
    assert old in text
    (tmp_path / "view.toml").write_text(text.replace(old, new, 1))
    with pytest.raises(InputError, match=re.escape(message)) as refusal:
        read_setup(tmp_path / "view.toml")
    assert str(refusal.value).startswith(f"{tmp_path / 'view.toml'}: ")


def test_y_points_up_in_the_picture_unless_the_camera_looks_up(tmp_path: Path) -> None:
    for looks, y in (("down", 0.15), ("up", -0.15)):
        (tmp_path / "view.toml").write_text(EXAMPLE.replace('"down"  ', f'"{looks}"  '))
        view = read_setup(tmp_path / "view.toml").view
        assert view.scale_error == pytest.approx(math.sqrt(2) / 800)  # each end of the ruler is off by a pixel
        assert view.to_tank(np.array([500.0, 250.0]))[0] == pytest.approx([0.15, y])
        assert view.to_picture(np.array([[0.15, y]]))[0] == pytest.approx([500, 250])


def test_the_scale_of_four_points_is_as_uncertain_as_that_of_a_ruler_across_them(tmp_path: Path) -> None:
    """Where in the picture they lie is no matter."""
    text = EXAMPLE.replace(RULER, "points_cm = [[0, 0], [30, 0], [30, 30], [0, 30]]")
    for u in (100, 900):
        corners = f"[[{u}, 200], [{u + 100}, 200], [{u + 100}, 100], [{u}, 100]]"
        (tmp_path / "view.toml").write_text(text.replace("[[100, 650], [900, 650]]", corners))
        assert read_setup(tmp_path / "view.toml").view.scale_error == pytest.approx(1 / math.hypot(100, 100))


def test_a_robot_with_a_band_that_the_region_cuts_is_lost(tmp_path: Path) -> None:
    tank, motion = Tank(), circling()
    (tmp_path / "view.toml").write_text(tank.view_toml())
    setup = read_setup(tmp_path / "view.toml")
    (pose,) = Detector(setup.robots, setup.view).poses(tank.frame(motion, 0.0))
    assert isinstance(pose, Pose)
    (u, v), _ = pose.marks
    for right, found in ((100, Pose), (0, Lost)):
        region = np.array([[0, 0], [u + right, 0], [u + right, v + 100], [0, v + 100]])
        (pose,) = Detector(setup.robots, replace(setup.view, region=region)).poses(tank.frame(motion, 0.0))
        assert isinstance(pose, found)


def test_a_picture_made_smaller_shows_the_same_places(tmp_path: Path) -> None:
    (tmp_path / "view.toml").write_text(Tank().view_toml())
    lens = Lens(np.array([[900, 0, 640], [0, 800, 360], [0, 0, 1.0]]), np.array([-0.2, 0.01, 0.001, 0.002, 0]))
    view = replace(read_setup(tmp_path / "view.toml").view, lens=lens, region=np.array([[0, 0], [99, 0], [0, 99]]))
    pixels = np.array([[100, 200], [300, 400.0]])
    smaller = view.smaller(3)
    assert smaller.to_tank((pixels - 1) / 3) == pytest.approx(view.to_tank(pixels))
    assert smaller.region == pytest.approx((view.region - 1) / 3)


def test_a_tag_that_is_seen_slantwise_gives_no_scale(tmp_path: Path) -> None:
    (tmp_path / "view.toml").write_text("[scale]\ntag_cm = 5\ntag_id = 7\n[[robots]]\ntag = 3\n")
    view = read_setup(tmp_path / "view.toml").view
    square = np.array([[100, 100], [200, 100], [200, 200], [100, 200.0]])
    assert view.with_tag(square, 0.4).metres(np.array([150, 150])) == pytest.approx(0.05 / 100)
    lens = Lens(np.array([[900, 0, 640], [0, 900, 360], [0, 0, 1.0]]), np.array([-0.2, 0, 0, 0, 0]))
    bent = replace(view, lens=lens, homography=np.eye(3)).to_picture(square)
    straight = replace(view, lens=lens).with_tag(bent, 0.4).to_tank(bent)
    assert np.linalg.norm(straight - np.roll(straight, 1, axis=0), axis=1) == pytest.approx(0.05, rel=1e-4)
    with pytest.raises(InputError, match="tag 7 is seen slantwise, 80 to 100 pixels a side"):
        view.with_tag(square * [0.8, 1], 0.4)
