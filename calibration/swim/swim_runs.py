"""The poses of swims as runs: each is an output of three numbers, white once its noise is known.

Each swim has two parts, each from a start pose of its own: what is fitted, and the last third, which is held out.
The first poses of the last third are fitted, too, so that its start is known; it is predicted freely from there.
Poses that follow each other are left out together, in blocks of some dwells.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from calibration.swim.course import Moments
from calibration.swim.measured_swim import MeasuredSwim
from calibration.swim.pose_noise import PoseNoise, Sizes
from calibration.table.excluded import Excluded
from calibration.table.runs import Runs
from common.arrays import Flags, Floats, Integers

OUTPUTS = ("x", "y", "heading")
_HELD_OUT, _HEAD = 1 / 3, 1 / 5  # shares: of the dwells of a swim, and of the poses of its last part
_BLOCKS = 12  # of a part
_DRAWS = 200  # of the noise


@dataclass(frozen=True)
class SwimRuns(Runs):
    """Poses of swims; places in tail lengths, headings in rad."""

    swims: tuple[MeasuredSwim, ...]
    part: Integers  # (n,) two of each swim
    part_names: tuple[str, ...]
    block: Integers  # (n,) poses that are left out together
    poses: Floats  # (n, 3) as y, not white
    length: float  # the tail length as given [m]
    noise_of_poses: PoseNoise | None = None  # with it y is white, and so is what is predicted

    @property
    def settings(self) -> dict[str, tuple[Floats, str]]:
        return {"time": (self.inputs[:, 0], " s")}

    @property
    def drawn(self) -> tuple[str, tuple[str, Integers, tuple[str, ...]]]:
        """The time, and the direction of the motor in colour."""
        turning = self.inputs[:, 1] > 0
        return "time", ("direction of the motor", turning.astype(int), ("motor at −1", "motor at +1"))

    def in_noise(self, sizes: Sizes, course: Floats) -> SwimRuns:
        """Return the same poses white in a noise, along a course (n, 3) without it."""
        time = np.concatenate([swim.time for swim in self.swims])
        dwell = np.concatenate([np.searchsorted(swim.flips, swim.time, side="right") for swim in self.swims])
        same = np.append(False, np.diff(self.part) == 0)
        moved = np.where(same[:, None], np.diff(course[:, :2], axis=0, prepend=course[:1, :2]), 0.0)
        flips = np.where(same, np.diff(dwell, prepend=0), 0)
        noise = PoseNoise(self.part, time, flips, moved, sizes)
        return replace(self, noise_of_poses=noise, y=noise.whiten(self.poses))

    @property
    def subject(self) -> str:
        return "robot"

    @property
    def row(self) -> str:
        return "pose"

    @property
    def least_surviving(self) -> float:
        """Of a path that bends another way, start and coefficients take nearly all."""
        return 0.01

    @property
    def stretches(self) -> str:
        return "stretches"

    @property
    def along(self) -> Floats:
        """Zero: a shift of all poses is that of the start."""
        return np.zeros(len(self))

    @property
    def plane(self) -> tuple[str, str]:
        return "x", "y"

    @property
    def parts(self) -> tuple[Integers, tuple[str, ...]]:
        return self.part, self.part_names

    @property
    def together(self) -> Integers:
        return self.block

    @property
    def made_at_once(self) -> Integers:
        return self.session

    @property
    def resampled(self) -> Integers:
        return self.block

    def raw(self, table: Floats) -> Floats:
        """Take the whitening from a table (n, 3, …)."""
        return table if self.noise_of_poses is None else self.noise_of_poses.colour(table)

    def whitened(self, table: Floats) -> Floats:
        """Whiten a table (n, 3, …)."""
        return table if self.noise_of_poses is None else self.noise_of_poses.whiten(table)

    def white_features(self, table: Floats) -> Floats:
        """Leave features (n, f) as they are: innovations may follow them."""
        return table

    def deviations(self, run_covariance: Floats, rows: Flags | slice = slice(None)) -> Floats:
        """Compute by how far a part that runs freely is off by noise alone, (3,), in some rows."""
        if self.noise_of_poses is None:
            return super().deviations(run_covariance, rows)
        drawn = np.random.default_rng(0).normal(size=(len(self), 3, _DRAWS))
        return np.asarray(np.sqrt((self.noise_of_poses.colour(drawn)[rows] ** 2).mean((0, 2))))


def runs_of_swims(swims: Sequence[MeasuredSwim], length: float) -> tuple[SwimRuns, Flags]:
    """Make runs of swims.

    Args:
        length: the tail length [m].

    Returns:
        The runs, and the poses (n,) that are held out; to the first of these their start is fitted.
    """
    part, held_out, heads, block, names = [], [], [], [], []
    for place, swim in enumerate(swims):
        cut = swim.flips[first_of_last(swim)]
        late = swim.time >= cut
        first = np.flatnonzero(late)[: max(int(_HEAD * late.sum()), 3)]
        head = np.isin(np.arange(len(late)), first)
        part.append(2 * place + late)
        held_out.append(late)
        heads.append(head)
        order = np.concatenate([np.arange((~late).sum()) / (~late).sum(), 1 + np.arange(late.sum()) / late.sum()])
        block.append(2 * _BLOCKS * place + np.minimum((order * _BLOCKS).astype(int), 2 * _BLOCKS - 1))
        names += [f"first part of {swim.name}", f"last third of {swim.name}"]
    poses = np.concatenate([swim.poses for swim in swims]) / [length, length, 1.0]
    count, numbers = len(poses), [len(swim.time) for swim in swims]
    moment = np.concatenate([swim.time - swim.flips[0] for swim in swims])
    forward = np.concatenate([Moments.of(swim, swim.time).forward for swim in swims])
    inputs = np.column_stack([moment, np.where(forward, 1.0, -1.0), np.cos(poses[:, 2]), np.sin(poses[:, 2])])
    scales = {"x": (100 * length, "cm"), "y": (100 * length, "cm"), "heading": (np.degrees(1.0), "°")}
    told = tuple(Excluded(f"{swim.name}: {line}") for swim in swims for line in swim.said)
    runs = SwimRuns(
        outputs=OUTPUTS, y=poses, condition=np.arange(count), session=np.repeat(np.arange(len(swims)), numbers),
        session_names=tuple(swim.name for swim in swims), inputs=inputs,
        input_names=("time", "direction", "course_x", "course_y"), rows=np.arange(1, count + 1),
        excluded=told, caveats=(), swims=tuple(swims), part=np.concatenate(part), part_names=tuple(names),
        block=np.concatenate(block), poses=poses, length=length, sigma=np.ones(3), heads=np.concatenate(heads),
        output_scales=scales,
    )  # fmt: skip
    return runs, np.concatenate(held_out)


def first_of_last(swim: MeasuredSwim) -> int:
    """Return the dwell with which the last part of a swim begins."""
    return round((1 - _HELD_OUT) * len(swim.dwells))
