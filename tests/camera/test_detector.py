"""Poses in single pictures, of tanks whose truth is known: errors, stated errors, why a robot is lost."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from camera.detector import Detector, Lost, Pose
from camera.view import read_setup
from common.arrays import Floats
from tests.oracles.tank import APART, LENGTH, TAIL, Tank, circling

TANKS: dict[str, dict[str, Any]] = {
    "plain": {},
    "noise": {"noise": 8.0},
    "blur": {"blur": 2.0},
    "glare": {"glare": 150.0},
    "uneven light": {"shade": 0.6},
    "slanting": {"tilt": 0.25},
    "lens": {"distortion": -0.2},
    "all": {"distortion": -0.2, "tilt": 0.2, "glare": 120.0, "shade": 0.4, "noise": 5.0},
    "clutter": {"clutter": True},
    "small": {"width": 320, "height": 240, "scale": 0.001},
    "large": {"width": 1280, "height": 960, "scale": 0.00025},
    "rolling shutter": {"readout": 0.03},
}


def detector_of(tank: Tank, folder: Path, **given: Any) -> Detector:
    file = folder / "view.toml"
    file.write_text(tank.view_toml(**given))
    setup = read_setup(file)
    return Detector(setup.robots, setup.view, head_length=LENGTH)


def off(pose: Pose, truth: tuple[float, ...]) -> Floats:
    return np.array([pose.x - truth[0], pose.y - truth[1], math.remainder(pose.heading - truth[2], math.tau)])


def exposed(tank: Tank, pose: Pose, time: float) -> float:
    """Return when the row of the robot was exposed."""
    return float(time + tank.readout * np.mean(pose.marks, axis=0)[1] / tank.height)


@pytest.mark.parametrize("name", TANKS)
def test_poses_are_within_a_fiftieth_of_a_tail_and_a_degree_and_their_errors_hold(
    name: str, tmp_path: Path
) -> None:
    tank, motion = Tank(**TANKS[name]), circling()
    detector, times = detector_of(tank, tmp_path), np.arange(0, 20, 2.1 if name == "large" else 0.7)
    poses = [detector.poses(tank.frame(motion, time))[0] for time in times]
    pairs = zip(poses, times, strict=True)
    seen = [(pose, off(pose, motion(exposed(tank, pose, time)))) for pose, time in pairs if isinstance(pose, Pose)]
    assert len(seen) >= 0.9 * len(times), poses
    errors = np.array([error for _, error in seen])
    sigmas = np.array([(pose.sigma_x, pose.sigma_x, pose.sigma_heading) for pose, _ in seen])
    assert np.abs(errors[:, :2]).max() < 0.02 * TAIL
    assert np.abs(errors[:, 2]).max() < math.radians(1)
    assert (np.abs(errors) < 1.96 * sigmas).mean() >= 0.9
    assert np.median(sigmas, axis=0) == pytest.approx([0.005 * TAIL, 0.005 * TAIL, math.radians(0.4)], rel=0.6)


def test_a_lost_robot_is_named_with_the_reason_and_found_again(tmp_path: Path) -> None:
    tank, motion = Tank(), circling()
    detector = detector_of(tank, tmp_path)
    assert isinstance(detector.poses(tank.frame(motion, 0.0))[0], Pose)
    bare = Tank(colours=("", "", "", ""))
    assert detector.poses(bare.frame(motion, 0.1)) == [Lost("1", "no red")]
    half = Tank(colours=("red", "", "", ""))
    assert detector.poses(half.frame(motion, 0.2)) == [Lost("1", "no green")]
    for _ in range(8):
        detector.poses(bare.frame(motion, 0.3))
    again = detector.poses(tank.frame(motion, 9.0))[0]
    assert isinstance(again, Pose)
    assert np.abs(off(again, motion(9.0))).max() < 0.02


def test_a_thing_beside_a_band_loses_the_robot_until_it_is_taken_for_a_part_of_it(tmp_path: Path) -> None:
    tank, motion = Tank(), circling()
    detector, picture = detector_of(tank, tmp_path), tank.frame(motion, 0.0)
    (pose,) = detector.poses(picture)
    assert isinstance(pose, Pose)
    (u, v), (across, down) = np.array(pose.marks)[0], np.diff(pose.marks, axis=0)[0] * 0.15
    cv2.circle(picture, (round(u - across), round(v - down)), 7, (40, 40, 205), -1)
    for _ in range(21):
        assert detector.poses(picture) == [Lost("1", "more that is red beside it")]
    assert isinstance(detector.poses(picture)[0], Pose)


def test_a_robot_that_the_edge_of_the_picture_cuts_is_lost(tmp_path: Path) -> None:
    tank = Tank()
    detector = detector_of(tank, tmp_path)
    for x, seen in ((0.03, Pose), (0.008, Lost)):
        (pose,) = detector.poses(tank.frame(circling(0.0, 0.0, centre=(x, 0.12), start=1.5), 0.0))
        assert isinstance(pose, seen)
    assert pose == Lost("1", "at the edge of the picture")


def test_a_hand_that_rests_on_the_robot_is_not_taken_for_a_band(tmp_path: Path) -> None:
    tank, motion = Tank(width=320, height=240, scale=0.001), circling(0.5, 0.06)
    detector, seen = detector_of(tank, tmp_path), 0
    for index in range(110):
        tank.hand = (index - 40) / 60 if 40 <= index < 100 else -1.0
        (pose,) = detector.poses(tank.frame(motion, 0.1 * index))
        if isinstance(pose, Pose):
            seen += 1
            sigmas = np.array([pose.sigma_x, pose.sigma_x, pose.sigma_heading])
            assert (np.abs(off(pose, motion(0.1 * index))) < 5 * sigmas).all()  # 40, where any area was taken
    assert seen > 60


def test_dots_are_seen_at_their_side_of_the_axis(tmp_path: Path) -> None:
    tank, motion = Tank(), circling(head=-1.0, tails=1.0)
    detector = detector_of(tank, tmp_path)
    for time in np.arange(0, 7, 0.5):
        (pose,) = detector.poses(tank.frame(motion, time))
        assert isinstance(pose, Pose)
        (left, area), (side, _) = pose.dots["head"], pose.dots["tail"]
        *_, head, tails = motion(time)
        if math.cos(head) > 0.3:
            assert left == pytest.approx(-0.016 * math.sin(head), abs=0.002)
            assert area > 2e-5
        if math.cos(head) < -0.5:
            assert area == 0
            assert math.isnan(left)
        assert side == pytest.approx(-0.016 * math.sin(tails), abs=0.002)


def test_two_robots_are_told_apart_by_their_colours(tmp_path: Path) -> None:
    tank = Tank(width=640)
    file = tmp_path / "view.toml"
    first, second = ("red", "green"), ("blue", "yellow")
    robots = "".join(f'[[robots]]\nname = "{n}"\nfront = "{f}"\nrear = "{r}"\n'
                     for n, (f, r) in zip("ab", (first, second), strict=True))  # fmt: skip
    file.write_text(tank.view_toml(robots=robots))
    setup = read_setup(file)
    detector = Detector(setup.robots, setup.view, head_length=LENGTH)
    one, other = circling(centre=(0.12, 0.12)), circling(rate=-0.2, centre=(0.31, 0.12))
    for time in (0.0, 1.0, 2.0):
        picture = tank.drawn([(one, (*first, "", "")), (other, (*second, "", ""))], time)
        poses = detector.poses(picture)
        assert [pose.robot for pose in poses] == ["a", "b"]
        for pose, motion in zip(poses, (one, other), strict=True):
            assert isinstance(pose, Pose)
            assert np.abs(off(pose, motion(time))[:2]).max() < 0.02 * TAIL


def test_a_tag_is_followed_in_a_part_of_the_picture_and_found_again_after_a_jump(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    tag = cv2.aruco.generateImageMarker(cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50), 3, 60)
    tag, read = np.pad(tag, 12, constant_values=255), list[int]()
    file = tmp_path / "view.toml"
    file.write_text("[scale]\npoints_px = [[0, 479], [100, 479]]\nlength_cm = 10\n[[robots]]\ntag = 3\n")
    setup, grey = read_setup(file), cv2.cvtColor
    monkeypatch.setattr(cv2, "cvtColor", lambda part, code: read.append(part.size) or grey(part, code))
    detector, searches = Detector(setup.robots, setup.view), []
    for u, v in ((100, 100), (110, 95), (125, 90), (500, 300), (495, 310), (4, 7), (2, 3)):
        picture = np.full((480, 640, 3), 160, np.uint8)
        picture[v : v + 84, u : u + 84] = tag[..., None]
        read.clear()
        (pose,) = detector.poses(picture)
        searches.append(read.count(picture.size))
        assert isinstance(pose, Pose)
        assert 1000 * np.array([pose.x, pose.y]) == pytest.approx([u + 41.5, 479 - (v + 41.5)], abs=0.2)
    assert searches == [1, 0, 0, 1, 0, 1, 0]
    region = np.array([[200, 0], [640, 0], [640, 480], [200, 480]])
    assert Detector(setup.robots, replace(setup.view, region=region)).poses(picture) == [Lost("1", "no tag 3")]


@pytest.mark.parametrize(("side", "blur"), [(14, 0.3), (20, 1.0), (32, 1.5)])
def test_stated_errors_of_small_and_blurred_tags_hold(side: float, blur: float, tmp_path: Path) -> None:
    file = tmp_path / "view.toml"
    file.write_text("[scale]\npoints_px = [[0, 159], [100, 159]]\nlength_cm = 10\n[[robots]]\ntag = 3\n")
    setup, ratios = read_setup(file), []
    for index in range(16):
        angle, place = 0.4 * index, (100.3 + 0.3 * index, 80.7 - 0.2 * index)
        picture = draw_tag(np.full((160, 200), 130.0), 3, side, place, angle, cv2.aruco.DICT_4X4_50)
        noise = np.random.default_rng(index).normal(scale=3, size=(160, 200, 3))
        noisy = np.clip(cv2.GaussianBlur(picture, (0, 0), blur)[..., None] + noise, 0, 255).astype(np.uint8)
        (pose,) = Detector(setup.robots, setup.view).poses(noisy)
        assert isinstance(pose, Pose)
        truth = (place[0] / 1000, (159 - place[1]) / 1000, math.pi / 2 - angle)
        ratios.append(off(pose, truth) / [pose.sigma_x, pose.sigma_x, pose.sigma_heading])
    rms = np.sqrt((np.array(ratios) ** 2).mean(axis=0))
    assert (rms < [0.7, 0.7, 1.7]).all()
    assert rms[2] > 0.5


def draw_tag(picture: np.ndarray, number: int, side: float, centre: Sequence[float], angle: float, dictionary: int,
             *, white_on_black: bool = False) -> np.ndarray:  # fmt: skip
    """Add a tag with a border to a grey picture (H, W), turned by an angle clockwise."""
    fine = 4
    known = cv2.aruco.getPredefinedDictionary(dictionary)
    tag = np.pad(cv2.aruco.generateImageMarker(known, number, 320), 40, constant_values=255)
    tag = 255 - tag if white_on_black else tag
    turn = side * fine / 320 * np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    middle = (np.array(centre) + 0.5) * fine - 0.5
    move = np.column_stack([turn, middle - turn @ [199.5, 199.5]])
    size = picture.shape[1] * fine, picture.shape[0] * fine
    shrunk = [cv2.resize(cv2.warpAffine(whole, move, size), picture.shape[::-1], interpolation=cv2.INTER_AREA)
              for whole in (tag, np.full_like(tag, 255))]  # fmt: skip
    return picture + (shrunk[0] - picture.astype(float)) * (shrunk[1] / 255)


@pytest.mark.parametrize("angle", [0.0, 0.4, 2.1, -1.3])
@pytest.mark.parametrize(
    ("looks", "dictionary", "turned", "white"),
    [("down", "4x4_50", 0, False), ("up", "aruco_original", 0, False), ("down", "apriltag_36h11", 90, True)],
)
def test_a_tag_gives_pose_and_scale(
    tmp_path: Path, looks: str, dictionary: str, turned: float, white: bool, angle: float
) -> None:
    """The robot's tag is 32 pixels wide, the other, of 5 cm, gives the scale of 100 pixels."""
    number = getattr(cv2.aruco, f"DICT_{dictionary.upper()}")
    picture = draw_tag(np.full((480, 640), 130.0), 7, 100, (520.3, 370.6), 0.2, number)
    picture = draw_tag(picture, 3, 32, (260.2, 210.7), angle, number, white_on_black=white)
    file = tmp_path / "view.toml"
    file.write_text(f'''looks = "{looks}"
dictionary = "{dictionary}"
[scale]
tag_cm = 5
tag_id = 7
[[robots]]
tag = 3
ahead_mm = 10
turned_deg = {turned}
tail = "yellow"
''')
    setup = read_setup(file)
    noisy = picture[..., None] + np.random.default_rng(0).normal(scale=3, size=(480, 640, 3))
    seen = np.clip(np.round(noisy), 0, 255).astype(np.uint8)
    up = 1 if looks == "up" else -1  # y of the tank along v of the picture
    axis = np.exp(1j * (angle - math.pi / 2 + math.radians(turned)))  # in the picture, u + i v
    dot = complex(260.2, 210.7) + axis * (-40 + 10j * up)
    cv2.circle(seen, (round(dot.real), round(dot.imag)), 4, (40, 205, 215), -1)
    detector = Detector(setup.robots, setup.view)
    (pose,) = detector.poses(seen)
    assert isinstance(pose, Pose)
    assert pose.dots["tail"] == pytest.approx((0.005, 1.2e-5), abs=1e-3)
    ahead = complex(axis.real, up * axis.imag)
    place = 0.0005 * complex(260.2 - 520.3, up * (210.7 - 370.6)) - 0.01 * ahead
    assert abs(complex(pose.x, pose.y) - place) < 0.0005
    assert abs(complex(pose.x, pose.y) - place) < 3 * math.sqrt(2) * pose.sigma_x
    assert math.remainder(pose.heading - np.angle(ahead), math.tau) == pytest.approx(0, abs=0.012)
    assert 1000 * detector.view.metres(np.array([320, 240])) == pytest.approx(0.5, rel=0.004)
    assert detector.view.scale_error < 0.004


def test_the_distance_of_the_bands_cannot_exceed_the_head(tmp_path: Path) -> None:
    tank = Tank()
    file = tmp_path / "view.toml"
    file.write_text(tank.view_toml())
    setup = read_setup(file)
    short = Detector(setup.robots, setup.view, head_length=0.8 * APART)
    assert short.poses(tank.frame(circling(), 0.0)) == [Lost("1", "red and green at a wrong distance")]
