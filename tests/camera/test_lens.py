"""The lens from drawn chessboards: the numbers that were drawn, poses through it, pictures that do not serve."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from camera.detector import Detector, Pose
from camera.lens import calibrate_lens
from camera.view import read_setup
from common.errors import InputError, run_command
from softflagella.__main__ import main
from tests.oracles.tank import LENGTH, TAIL, Tank, board, circling

TANK = Tank(distortion=-0.2)
# Turns about the picture's axes [rad], place of the board's middle [squares], distance in front of the camera.
POSES = [(0.0, 0.0, -1.5, 1.0, 19.0), (0.5, 0.0, 2.0, -1.5, 20.0), (-0.5, 0.2, -2.5, 1.5, 20.0),
         (0.1, 0.6, -2.5, -1.5, 20.0), (-0.2, -0.6, 2.5, 1.5, 20.0), (0.4, 0.4, 0.0, 0.0, 16.0),
         (-0.4, 0.5, 2.5, 0.0, 19.0), (0.3, -0.5, -2.5, 0.0, 19.0)]  # fmt: skip


def boards(folder: Path, poses: Sequence[Sequence[float]]) -> list[str]:
    import cv2

    files = [str(folder / f"board-{index}.png") for index in range(len(poses))]
    for file, pose in zip(files, poses, strict=True):
        cv2.imwrite(file, board(TANK, pose))
    return files


def test_the_lens_is_that_which_was_drawn_and_poses_through_it_are_right(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run_command(main, ["camera", "lens", *boards(tmp_path, POSES)]) == 0
    said = capsys.readouterr()
    assert said.err == ""
    assert said.out.startswith("[lens]  # 8 pictures of a chessboard, reprojection error 0.")
    scale, _, robots = TANK.view_toml().partition("[lens]")
    (tmp_path / "view.toml").write_text(scale + "[[robots]]" + robots.partition("[[robots]]")[2] + said.out)
    setup = read_setup(tmp_path / "view.toml")
    lens = setup.view.lens
    assert lens is not None
    assert lens.matrix.diagonal()[:2] == pytest.approx(np.full(2, TANK.focal), rel=0.005)
    assert lens.matrix[:2, 2] == pytest.approx([(TANK.width - 1) / 2, (TANK.height - 1) / 2], abs=1.5)
    pixels = np.stack(np.meshgrid(np.arange(10, 480, 20.0), np.arange(10, 360, 20.0)), -1).reshape(-1, 2)
    undistorted = replace(setup.view, homography=np.eye(3)).to_tank(pixels)
    drawn = TANK.rays(pixels) * TANK.focal + (np.array([TANK.width, TANK.height]) - 1) / 2
    assert np.abs(undistorted - drawn).max() < 0.5
    detector, motion = Detector(setup.robots, setup.view, head_length=LENGTH), circling()
    for time in np.arange(0, 20, 2.5):
        (pose,) = detector.poses(TANK.frame(motion, time))
        assert isinstance(pose, Pose)
        assert np.hypot(*np.subtract((pose.x, pose.y), motion(time)[:2])) < 0.02 * TAIL


def test_pictures_that_leave_the_lens_open_are_named(tmp_path: Path) -> None:
    notes = calibrate_lens(boards(tmp_path, [(0.0, 0.02 * k, 0.2 * k, 0.0, 22.0) for k in range(4)])).notes
    assert any("focal length is uncertain by" in note and "tilt the board" in note for note in notes)
    assert any("never near the edges" in note for note in notes)


def test_pictures_that_do_not_serve_are_refused_with_what_to_change(tmp_path: Path) -> None:
    import cv2

    files = boards(tmp_path, POSES[:2])
    with pytest.raises(InputError, match=r"10x7 .* 2 of 2 pictures, .* 3"):
        calibrate_lens(files)
    with pytest.raises(InputError, match=r"12x9 .* 0 of 2 pictures"):
        calibrate_lens(files, squares="12x9")
    with pytest.raises(InputError, match=r"squares '9'; give those of the board"):
        calibrate_lens(files, squares="9")
    with pytest.raises(InputError, match=r"none\.png: no such file"):
        calibrate_lens([*files, tmp_path / "none.png"])
    (tmp_path / "text.png").write_text("no picture")
    with pytest.raises(InputError, match=r"text\.png.*no picture that can be read"):
        calibrate_lens([*files, tmp_path / "text.png"])
    cv2.imwrite(str(tmp_path / "small.png"), np.zeros((60, 80), np.uint8))
    with pytest.raises(InputError, match=r"small\.png.*80 × 60 pixels, others 480 × 360"):
        calibrate_lens([*files, tmp_path / "small.png"])
