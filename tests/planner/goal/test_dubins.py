"""Dubins' words end at their goals, and no random track is shorter."""

from __future__ import annotations

import numpy as np
import pytest

from planner.goal.dubins import TURNS, DubinsPaths, shortest_paths, three_arcs, words
from sim.arrays import Floats

RADIUS = 0.37


def poses(rng: np.random.Generator, count: int) -> Floats:
    return rng.uniform([-2, -2, -4], [2, 2, 4], (count, 3))


@pytest.mark.parametrize("word", range(6))
def test_every_word_ends_at_its_goal(word: int) -> None:
    rng = np.random.default_rng(word)
    start, goal = poses(rng, 400), poses(rng, 400)
    pieces = words(start, goal, RADIUS)[:, word]
    exists = np.isfinite(pieces.sum(-1))
    assert exists.sum() > 40
    tracks = DubinsPaths(start[exists], np.repeat(TURNS[word][None], exists.sum(), 0), pieces[exists])
    missed = tracks.poses(tracks.length[:, None], RADIUS)[:, 0] - goal[exists]
    missed[:, 2] = (missed[:, 2] + np.pi) % (2 * np.pi) - np.pi
    assert np.abs(missed).max() < 1e-9


def test_no_random_track_is_shorter() -> None:
    """Random tracks of arcs and straight lines: the best word reaches their ends at least as soon."""
    rng = np.random.default_rng(7)
    start = poses(rng, 3000)
    end, length = start, np.zeros(3000)
    for _ in range(4):
        turn, piece = rng.integers(-1, 2, (3000, 1)), rng.uniform(0, 1, (3000, 1))
        track = DubinsPaths(end, np.repeat(turn, 3, 1), np.concatenate([piece, 0 * piece, 0 * piece], 1))
        end, length = track.poses(piece, RADIUS)[:, 0], length + piece[:, 0]
    assert (shortest_paths(start, end, RADIUS).length <= length + 1e-9).all()


def test_all_words_of_three_arcs_end_at_the_goal() -> None:
    rng = np.random.default_rng(3)
    start, goal = rng.normal(size=(2, 300, 3)) * [1.5, 1.5, 3.0]
    turns, lengths = three_arcs(start, goal, 0.7)
    best = words(start, goal, 0.7)[:, 4:].sum(-1)
    assert lengths.sum(-1)[:, [0, 2]] == pytest.approx(best)
    for word in range(4):
        exists = np.isfinite(lengths[:, word]).all(-1)
        assert exists.sum() > 50
        track = DubinsPaths(start[exists], np.tile(turns[word], (exists.sum(), 1)), lengths[exists, word])
        end = track.poses(track.length[:, None], 0.7)[:, 0]
        assert end[:, :2] == pytest.approx(goal[exists, :2], abs=1e-9)
        assert np.cos(end[:, 2] - goal[exists, 2]) == pytest.approx(1.0)
        assert (lengths[exists, word, 1] / 0.7 >= np.pi - 1e-9).all() == (word in (0, 2))
