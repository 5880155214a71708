"""The poses of swims beside the runs of a table: a row is one or the other, and lacks the outputs of the other.

What a row lacks are gaps (`calibration.table.runs`), and 0 in what was measured and in every prediction. The
covariance of a row is block-diagonal: 1 for white poses, and S of the table, from its repeats. A fit weighs runs
with c S, since 1/S of a few repeats is too large; where S is declared, its degrees of freedom are those of all
outputs. Tests estimate S anew in each draw, as those of the table alone do.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.linalg import block_diag

from calibration.statistics.fit import variance_factor
from calibration.statistics.study import divided, groups, split_runs
from calibration.swim.swim_runs import SwimRuns
from calibration.swimmer.measured_table import Measurements
from calibration.table.runs import Runs, without_gaps
from common.arrays import Flags, Floats, Integers

_Named = tuple[Integers, tuple[str, ...]]  # numbers (n,), and their names


@dataclass(frozen=True)
class JointRuns(Runs):
    """Poses of swims, and then runs of a table, of one robot."""

    swum: SwimRuns
    table: Measurements
    robot: Measurements  # runs of the robot that swam
    table_parts: _Named  # what is held out of the table is some of these
    factor: float  # c

    @property
    def pieces(self) -> list[tuple[slice, Runs]]:
        return [(slice(len(self.swum)), self.swum), (slice(len(self.swum), None), self.table)]

    @property
    def along(self) -> Floats:
        return np.concatenate([self.swum.along, self.table.along])

    @property
    def subject(self) -> str:
        return "robot"

    @property
    def row(self) -> str:
        return "row"

    @property
    def parts(self) -> _Named:
        return _beside(self.swum.parts, self.table_parts)

    @property
    def blocks(self) -> _Named:
        return _beside(groups(self.swum), groups(self.table))

    @property
    def together(self) -> Integers:
        return _numbered(self.swum.together, self.table.together)

    @property
    def resampled(self) -> Integers:
        return _numbered(self.swum.resampled, self.table.resampled)

    @property
    def least_surviving(self) -> float:
        return self.swum.least_surviving

    @property
    def stretches(self) -> str:
        return f"{self.swum.stretches} and {self.table.stretches}"

    @property
    def settings(self) -> dict[str, tuple[Floats, str]]:
        """Those of the table, and of the robot that swam."""
        own = self.robot.settings
        return {
            name: (np.append(np.full(len(self.swum), own[name][0][0]), values), unit)
            for name, (values, unit) in self.table.settings.items()
        }

    @property
    def drawn(self) -> tuple[str, tuple[str, Integers, tuple[str, ...]]]:
        """What each piece is drawn against, in words."""
        (of_poses, (colour, kind, kinds)), (of_runs, (other, *_)) = self.swum.drawn, self.table.drawn
        words = f"{of_poses}, and of every run against {of_runs}", f"{colour}, and {other}"
        return words[0], (words[1], np.append(kind, np.zeros(len(self.table), dtype=int)), kinds)

    @property
    def identities(self) -> dict[str, Floats]:
        unknown = np.full(len(self.swum), np.nan)
        return {name: np.append(unknown, values) for name, values in self.table.identities.items()}

    @property
    def mirrored(self) -> tuple[Integers, Floats]:
        (poses, none), (runs, directions) = self.swum.mirrored, self.table.mirrored
        return _numbered(poses, runs), np.append(none, directions)

    @property
    def partners(self) -> Floats:
        """Those of the table; no pose has one."""
        settings = self.table.partners
        alone = -1.0 - np.arange(len(self.swum))
        return np.vstack([np.repeat(alone[:, None], settings.shape[1], 1), settings])

    def row_name(self, place: int) -> str:
        return f"{super().row_name(place)} of {self.session_names[self.session[place]]}"

    def nearer(self, used: Flags) -> list[Flags]:
        """Those of either kind, beside all of the other kind."""
        swum, table = (used[rows] for rows, _ in self.pieces)
        of_swims = [np.append(near, table) for near in self.swum.nearer(swum)]
        return of_swims + [np.append(swum, near) for near in self.table.nearer(table)]

    def raw(self, table: Floats) -> Floats:
        """Take the whitening from the poses of a table (n, k, …)."""
        return self._poses_replaced(table, self.swum.raw)

    def whitened(self, table: Floats) -> Floats:
        """Whiten the poses of a table (n, k, …)."""
        return self._poses_replaced(table, self.swum.whitened)

    def white_features(self, table: Floats) -> Floats:
        return table

    def with_swims(self, swum: SwimRuns) -> JointRuns:
        """Return the same rows with poses that are white in another noise."""
        return replace(self, swum=swum, y=self._poses_replaced(self.y, lambda _: swum.y))

    def _poses_replaced(self, table: Floats, change: Any) -> Floats:
        changed, poses = table.copy(), (slice(len(self.swum)), slice(len(self.swum.outputs)))
        changed[poses] = change(table[poses])
        return changed

    def scatter(self, run_covariance: Floats) -> Floats:
        """Return the standard deviation of a row, of S in place of c S."""
        deviation, k = super().scatter(run_covariance), len(self.swum.outputs)
        return np.append(deviation[:k], deviation[k:] / math.sqrt(self.factor))

    def deviations(self, run_covariance: Floats, rows: Flags | slice = slice(None)) -> Floats:
        chosen, k = np.zeros(len(self), dtype=bool), len(self.swum.outputs)
        chosen[rows] = True
        poses = self.swum.deviations(run_covariance[:k, :k], chosen[: len(self.swum)])
        return np.append(poses, self.scatter(run_covariance)[k:])

    @property
    def known_covariance(self) -> Floats:
        """1 for poses; NaN for the outputs of the table, whose covariance is estimated."""
        k = len(self.table.outputs)
        return block_diag(np.eye(len(self.swum.outputs)), np.full((k, k), np.nan))

    def noise(self, rows: Flags) -> tuple[Floats, float]:
        """Estimate the covariance of a row for fits, c S for the table."""
        run = self._table.noise(rows[self.pieces[1][0]])[0]
        return block_diag(np.eye(len(self.swum.outputs)), self.factor * run), math.inf

    def guessed_noise(self, rows: Flags, residual: Floats) -> dict[str, Any]:
        return {}

    def repeats(self, rows: Flags | slice = slice(None)) -> Integers | Floats:
        """Tell what is the same in repeats of the table; a pose has none."""
        chosen = np.zeros(len(self), dtype=bool)
        chosen[rows] = True
        poses, runs = (chosen[of] for of, _ in self.pieces)
        repeated = self._table.repeats(runs)
        if repeated.ndim == 1:
            return _numbered(np.arange(poses.sum()), repeated.astype(np.int64))
        return np.vstack([np.zeros((poses.sum(), repeated.shape[1])), repeated])

    @property
    def _table(self) -> Measurements:
        """The table, with what its repeats were found to differ by."""
        return (
            self.table
            if self.differing is None
            else replace(self.table, differing=self.differing[-len(self.table) :])
        )


def joint_runs(
    swum: SwimRuns, last: Flags, table: Measurements, held_out: Flags, robot: Measurements
) -> tuple[JointRuns, Flags]:
    """Put the runs of a table beside poses.

    Args:
        last: the poses that are held out.
        held_out: the runs of the table that are held out.
        robot: runs of the robot that swam.

    Returns:
        The rows, and those that are held out.
    """
    gaps = np.ones((len(swum) + len(table), len(swum.outputs) + len(table.outputs)), dtype=bool)
    poses, runs = np.s_[: len(swum), : len(swum.outputs)], np.s_[len(swum) :, len(swum.outputs) :]
    gaps[poses], gaps[runs] = swum.gaps, table.gaps
    completion = without_gaps(gaps)
    if table.completion is not None:
        completion[runs[0], runs[1], runs[1]] = table.completion
    names, inputs = _inputs(swum, table, robot)
    session, session_names = _beside((swum.session, swum.session_names), (table.session, table.session_names))
    outputs = (*swum.outputs, *table.outputs)
    split = split_runs(table, held_out, (np.zeros(len(table), dtype=bool), ()))
    assert swum.heads is not None
    joint = JointRuns(
        outputs=outputs, y=block_diag(swum.y, table.y), condition=_numbered(swum.condition, table.condition),
        session=session, session_names=session_names, inputs=inputs, input_names=names,
        rows=np.append(swum.rows, table.rows), excluded=(*swum.excluded, *table.excluded),
        caveats=(*swum.caveats, *table.caveats, *split.caveats), converted=table.converted, completion=completion,
        notes={name: _noted_of_runs(values, len(swum)) for name, values in table.notes.items()},
        specimen=np.zeros(len(gaps), dtype=int), specimen_names=("the robot",),
        output_titles={**swum.output_titles, **table.output_titles},
        output_scales={**swum.output_scales, **{name: table.scale_of(name) for name in table.outputs}},
        unit_checked=dict.fromkeys(outputs, True), heads=np.append(swum.heads, np.zeros(len(table), dtype=bool)),
        swum=swum, table=table, robot=robot, factor=variance_factor(table.noise(~held_out)[1], len(table.outputs)),
        table_parts=groups(table) if divided(table, held_out) else (table.session, table.session_names),
    )  # fmt: skip
    return joint, np.append(last, held_out)


def _numbered(first: Integers, second: Integers) -> Integers:
    """Number rows of both kinds, none of one kind as one of the other."""
    return np.append(first, second + (first.max(initial=-1) + 1 - second.min(initial=0)))


def _beside(first: _Named, second: _Named) -> _Named:
    """Number and name groups of both kinds."""
    return np.append(first[0], second[0] + len(first[1])), (*first[1], *second[1])


def _inputs(swum: SwimRuns, table: Measurements, robot: Measurements) -> tuple[tuple[str, ...], Floats]:
    """Name and join the inputs of both kinds; one that a kind lacks is the robot's, or the mean of the other's."""
    known: list[Mapping[str, Floats]] = [
        dict(zip(runs.input_names, runs.inputs.T, strict=True)) for runs in (swum, table)
    ]
    own = {"N": robot.tails[0], "ln l": math.log(robot.length[0]), "ln |omega|": math.log(abs(robot.omega[0]))}
    names, columns = tuple(dict.fromkeys((*swum.input_names, *table.input_names))), []
    for name in names:
        mean = float(np.mean(np.concatenate([of[name] for of in known if name in of])))
        of_poses = known[0].get(name, np.full(len(swum), own.get(name, mean)))
        columns.append(np.append(of_poses, known[1].get(name, np.full(len(table), mean))))
    return names, np.stack(columns, 1)


def _noted_of_runs(values: Any, poses: int) -> Any:
    """Put the notes (n,) of runs after so many poses without any."""
    noted = np.asarray(values)
    noted = noted.astype(float if noted.dtype.kind in "fiu" else str)
    return np.append(np.full(poses, np.nan if noted.dtype.kind == "f" else ""), noted)
