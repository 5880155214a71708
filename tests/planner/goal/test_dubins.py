"""Dubins' words end at their goals, and no random track is shorter."""

from __future__ import annotations

import numpy as np
import pytest

from planner.goal.dubins import TURNS, DubinsPaths, shortest_paths, words
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
