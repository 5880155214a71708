"""Zoom, pan, fit and ticks of the page's picture; strokes, corners and poses."""

from __future__ import annotations

import numpy as np
import pytest

from tests.planner.page.page_core import answer, answers, check_near

VIEW = {"scale": 12.0, "left": 310.0, "top": 205.0}


def test_pixels_and_places_are_inverse_and_a_zoom_keeps_the_place_under_the_pointer() -> None:
    place = answer("view/viewport.js", "placeAt", VIEW, 40, 70)
    check_near(answer("view/viewport.js", "pixelOf", VIEW, place), [40, 70])
    nearer = answer("view/viewport.js", "zoomed", VIEW, 3, 40, 70)
    check_near(answer("view/viewport.js", "placeAt", nearer, 40, 70), place)
    assert nearer["scale"] == 36
    limit = answer("view/viewport.js", "zoomed", VIEW, 1e30, 40, 70)
    check_near(answer("view/viewport.js", "placeAt", limit, 40, 70), place)


def test_everything_fits() -> None:
    points = np.random.default_rng(0).normal(size=(50, 2)) * [30, 2]
    view = answer("view/viewport.js", "fitted", points, 600, 400)
    pixels = np.array(answers([("view/viewport.js", "pixelOf", view, point) for point in points]))
    assert pixels.min(0)[0] == pytest.approx(600 * 0.12 / 1.24)
    assert (pixels.min() >= 0, pixels[:, 0].max() <= 600, pixels[:, 1].max() <= 400) == (True, True, True)
    assert answer("view/viewport.js", "fitted", [[3, 4]], 600, 400)["scale"] > 0
    assert answer("view/viewport.js", "fitted", [], 600, 400)["scale"] > 0


def test_the_lens_is_where_it_hides_least() -> None:
    view = {"scale": 1.0, "left": 0.0, "top": 400.0}  # places are pixels, y upwards
    corners = {"right top": [540, 330], "left top": [60, 330], "right bottom": [540, 70], "left bottom": [60, 70],
               "middle": [300, 200]}  # fmt: skip
    for free in corners:
        points = [place for name, place in corners.items() if name != free]
        assert answer("view/viewport.js", "lensPlace", view, points, 600, 400, 150) == free
    assert answer("view/viewport.js", "lensPlace", view, [[300, 200]], 600, 400, 150) == "right top"


def test_ticks_are_round_and_far_enough_apart() -> None:
    for scale in (0.0123, 0.7, 12.0, 333.0):
        step = answer("view/viewport.js", "tickStep", {**VIEW, "scale": scale})
        assert 70 <= step * scale < 70 * 2.5 * (1 + 1e-9)
        mantissa = step / 10 ** np.floor(np.log10(step) + 1e-9)
        assert min(abs(mantissa - each) for each in (1, 2, 5)) < 1e-9
    check_near(answer("view/viewport.js", "ticks", -1.1, 2.3, 0.5), [-1, -0.5, 0, 0.5, 1, 1.5, 2])
    assert answer("view/viewport.js", "tickWords", -0.5, 0.1) == "−0.5"
    assert answer("view/viewport.js", "tickWords", 20, 10) == "20"


def test_a_stroke_that_comes_back_is_closed() -> None:
    angles = np.linspace(0, 2 * np.pi, 60)
    ring = np.stack([np.cos(angles), np.sin(angles)], 1)
    assert answer("view/path_editor.js", "closes", ring[:-1]) is True
    assert answer("view/path_editor.js", "closes", ring[:40]) is False


def test_corners_are_moved_scaled_and_turned_about_their_middle() -> None:
    square = [[0, 0], [2, 0], [2, 2], [0, 2]]
    same = {"right": 0, "up": 0, "scale": 1, "turn": 0}
    changes = [{**same, "right": 1, "up": -2}, {**same, "scale": 2}, {**same, "turn": 90}]
    moved, scaled, turned = answers(
        [("view/corner_table.js", "transformed", square, change) for change in changes]
    )
    check_near(moved, [[1, -2], [3, -2], [3, 0], [1, 0]])
    check_near(scaled, [[-1, -1], [3, -1], [3, 3], [-1, 3]])
    check_near(turned, [[2, 0], [2, 2], [0, 2], [0, 0]])


def test_the_pose_between_samples() -> None:
    plan = {"dwells": [2, 4], "samples": 2, "motion": [[0, 0, 0], [1, 0, 0], [2, 0, 0], [2, 2, 1], [2, 4, 1]]}
    poses = answers([("view/player.js", "poseAt", plan, [0, 2, 6], time) for time in (-1, 0.5, 2, 3, 99)])
    assert [each["pose"] for each in poses] == [[0, 0, 0], [0.5, 0, 0], [2, 0, 0], [2, 1, 0.5], [2, 4, 1]]
    assert [each["dwell"] for each in poses] == [0, 0, 1, 1, 1]


@pytest.mark.parametrize(
    ("seconds", "words"), [(0, "0:00.0"), (59.94, "0:59.9"), (179.96, "3:00.0"), (3599.99, "60:00.0")]
)
def test_the_clock_never_shows_sixty_seconds(seconds: float, words: str) -> None:
    assert answer("view/words.js", "clock", seconds) == words


@pytest.mark.parametrize("tails", range(1, 9))
def test_no_tail_is_drawn_behind_another(tails: int) -> None:
    across = sorted(answer("view/scene.js", "acrossOf", k, tails) for k in range(tails))
    assert np.diff(across).min(initial=1) > 0.05
