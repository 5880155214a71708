"""Swings: detours of a track of the pivot that make it longer by a given length.

Waiting circles end in the pose in which they begin, and gain 2 π ρ or more each. For less, a swing leaves the
track on an arc and joins it further along after three arcs of one radius ρ (`planner.goal.dubins`): on a straight
track arcs of angles α, 2 α and α replace the length 4 ρ sin α by 4 ρ α. Both are as late on the track as there is
room: an error of the heading that is left behind then has the least consequences. Lengths in l.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import chain
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

from planner.goal.dubins import DubinsPaths, three_arcs
from planner.paths.obstacles import FreeSpace
from planner.paths.path import Path2D, points_at
from planner.paths.tractrix import Drift, Reference
from planner.planning.conditions import Swing
from planner.planning.declare import Declared
from planner.planning.solve import Setting
from sim.arrays import Floats
from sim.io.errors import InputError

_SPACING = 0.02  # l, of the points on a swing
_LONGEST = 4.2  # radii, of the track that a swing replaces
_STRIDE = 0.5  # radii, between places that are tried
_MOST_PLACES = 400
_HALVINGS = 40
_JUMP = 1.0  # radii; lengths of swings to neighbouring places that differ by more are of another kind
_ROOM = 1.5  # of the margin of a plan without a swing: what the swing keeps clear
_CURVED = 0.75  # of the pivot's largest curvature, on the arcs of a swing

Free = Callable[[Floats], bool]  # whether the body keeps clear at poses (m, 3) of the pivot, with headings


class NoRoomError(InputError):
    """There is no room for a swing."""


def swung(
    reference: Reference, longer: float, radius: float, rod: float, drift: Drift, free: Free | None = None
) -> tuple[Reference, Swing]:
    """Make a reference longer.

    Args:
        reference: of the pivot.
        longer: length that is added.
        radius: of the arcs.
        rod: distance from the pivot to the tracked point.
        drift: what carries the robot off its heading.
        free: tells whether the body keeps clear; None: there are no obstacles.

    Raises:
        NoRoomError: the track is too short, or obstacles leave no room.
    """
    track = _Track(reference, rod, drift)
    circle = 2 * math.pi * radius
    circles = math.floor(longer / circle)
    ways = [track.swung(longer - circles * circle, circles, radius)]
    if circles:
        ways.insert(0, track.circled(circles, longer / (2 * math.pi * circles)))
    for candidate in chain(*ways):
        if free is None or free(track.headed(candidate.poses)):
            return track.joined(candidate)
    raise NoRoomError(
        "there is no room for a swing that takes the time: the path is too short, or obstacles are near"
    )


@dataclass(frozen=True)
class Delay:
    """Adds the length that a setting asks for, with turns that the vehicle can follow well.

    Args:
        space: what its body must keep clear of; the swing keeps more than the margin.
        drawn: the path as drawn; None: the declared path counts as drawn.
    """

    space: FreeSpace
    drawn: Path2D | None = None

    def __call__(self, declared: Declared, setting: Setting) -> Declared:
        """Add a swing.

        Raises:
            NoRoomError: the track is too short, or obstacles leave no room.
        """
        if not setting.longer:
            return declared
        vehicle, drift = setting.tracked.vehicle, setting.drift
        body, margin = setting.tracked.body, setting.margin or 0.0

        def free(poses: Floats) -> bool:
            return bool(body.clearance(poses, self.space).min() >= _ROOM * margin)

        radius = vehicle.pivot_radius / _CURVED * (1 + math.hypot(*drift.current))
        reference, swing = swung(declared.reference, setting.longer, radius, setting.tracked.rod, drift,
                                 None if self.space.empty else free)  # fmt: skip
        if self.drawn is not None:
            declared = declared.moved(reference, self.drawn, declared.curvature)
        return replace(declared, reference=reference, swing=swing)


class _Candidate(NamedTuple):
    """A swing between two places of a track."""

    leaves: float  # way along the track
    joins: float
    poses: Floats  # (k, 3), places and courses between the two, both ends included
    circles: int


class _Track:
    """A reference as a track of the pivot."""

    def __init__(self, reference: Reference, rod: float, drift: Drift):
        self._reference, self._rod, self._drift = reference, rod, drift
        self._poses = reference.courses(drift)
        self._arc = reference.arc

    def at(self, way: float) -> Floats:
        """Return the pose (3,) after a way along the track."""
        return points_at(np.array(way), self._arc, self._poses)

    def headed(self, poses: Floats) -> Floats:
        """Return places and headings (m, 3) of poses with courses."""
        return np.column_stack([poses[:, :2], poses[:, 2] - self._drift.slip_along(poses[:, 2])])

    def circled(self, circles: int, radius: float) -> Iterator[_Candidate]:
        """Yield circles at places from the end of the track to its beginning."""
        for way in self._places(radius):
            for side in (1, -1):
                arc = DubinsPaths.circles(self.at(way), side, circles, radius)
                yield _Candidate(way, way, arc.sampled(_SPACING), circles)

    def swung(self, rest: float, circles: int, radius: float) -> Iterator[_Candidate]:
        """Yield swings that gain `rest` besides their circles, from the end of the track to its beginning."""

        def beyond(joins: float, leaves: float, word: int) -> float:
            return float(self._gained(leaves, np.array([joins]), radius)[0, word]) - rest

        for leaves in self._places(radius):
            until = np.searchsorted(self._arc, leaves + _LONGEST * radius)
            joins = self._arc[np.searchsorted(self._arc, leaves) + 1 : until]
            if len(joins) < 2:
                continue
            joins = self._with_limits(leaves, joins, radius)
            gained = self._gained(leaves, joins, radius)
            with np.errstate(invalid="ignore"):  # where there is no swing
                jumps = np.abs(np.diff(gained, axis=0)) > _JUMP * radius
                crossed = ((gained[:-1] - rest) * (gained[1:] - rest) <= 0) & ~jumps
            for row, word in sorted(np.argwhere(crossed).tolist()):
                joins_at = brentq(beyond, joins[row], joins[row + 1], (leaves, word))
                turns, lengths = three_arcs(self.at(leaves), self.at(joins_at), radius)
                parts = lengths[word] + np.array([2 * math.pi * radius * circles, 0.0, 0.0])
                path = DubinsPaths(self.at(leaves)[None], turns[word][None], parts[None], radius)
                yield _Candidate(leaves, joins_at, path.sampled(_SPACING), circles)

    def joined(self, candidate: _Candidate) -> tuple[Reference, Swing]:
        """Put a candidate into the track."""
        before, after = np.searchsorted(self._arc, [candidate.leaves, candidate.joins]).tolist()
        old = self._reference
        x, y, first = (np.interp(candidate.leaves, self._arc, column) for column in (*old.p.T, old.heading))
        part = Reference.of_pivot(candidate.poses, self._rod, self._drift, first)
        longer = float(part.arc[-1] - (candidate.joins - candidate.leaves))
        swing = Swing(float(x), float(y), longer, candidate.circles)
        return Reference.joined(old.part(0, before), part, old.part(after + 1), closed=old.closed), swing

    def _places(self, radius: float) -> list[float]:
        """List ways along the track, the last one first."""
        length = float(self._arc[-1])
        count = min(max(math.ceil(length / (_STRIDE * radius)), 1), _MOST_PLACES)
        return np.linspace(length, 0.0, count + 1).tolist()

    def _with_limits(self, leaves: float, joins: Floats, radius: float) -> Floats:
        """Add places near those up to which there are swings, where their lengths change fast."""
        exists = np.isfinite(self._gained(leaves, joins, radius))
        added = [joins]
        for row, word in np.argwhere(exists[:-1] != exists[1:]).tolist():
            low, high = joins[row], joins[row + 1]
            for _ in range(_HALVINGS):
                middle = (low + high) / 2
                same = bool(np.isfinite(self._gained(leaves, np.array([middle]), radius)[0, word]))
                low, high = (middle, high) if same == exists[row, word] else (low, middle)
                added.append(np.array([middle]))
        return np.unique(np.concatenate(added))

    def _gained(self, leaves: float, joins: Floats, radius: float) -> Floats:
        """Compute the lengths (m, 4) that swings between two places gain."""
        ends = points_at(joins, self._arc, self._poses)
        return np.asarray(three_arcs(self.at(leaves), ends, radius)[1].sum(-1) - (joins - leaves)[:, None])
