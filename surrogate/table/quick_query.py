"""Queries through the compiled loop of `surrogate.table.compiled_query`, of many robots or of a single one.

A single robot without effects, given as arrays of one number, needs no checks by arrays: the loop checks its
groups and tells whether the table knows it. What the loop does not answer is left to the checks, which have the
words.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from sim.arrays import Flags, Floats
from sim.model.groups import DWELL, GROUP_COLUMNS, OPTIONAL_COLUMNS
from sim.model.response import DWELLS
from sim.motion.steady_motion import STEADY_OUTPUTS
from surrogate.input_ranges import ROBOT
from surrogate.loops import compile_once
from surrogate.networks.blocks import BLOCK
from surrogate.table.batch_query import BLOCK_ROWS, query_blocks
from surrogate.table.compiled_query import (
    ANSWERS,
    ASSEMBLED,
    GROUPS,
    HALF,
    IMPOSSIBLE,
    INSIDE,
    REASON,
    STEADY,
    WITH_DWELL,
    WITH_WIDTHS,
    query_rows,
)
from surrogate.table.errors import OUTPUTS
from surrogate.table.flat_table import FlatTable
from surrogate.wrench.balance import MATRICES
from surrogate.wrench.balance_blocks import STATE
from surrogate.wrench.heads import ROBOT_NUMBERS

OUTSIDE = "outside"  # flag of robots that the table does not know
SHORTEST = DWELLS[0] * (1 - 1e-9)  # dwell
_NUMBER = GROUP_COLUMNS.index("N")
_ROBOT = GROUPS + 1  # where the parts of one array of numbers begin: groups, dwell, robot, answer, room
_ANSWER = _ROBOT + ROBOT_NUMBERS
_ROOM = _ANSWER + ANSWERS
_BYTES = 8
MANY, _CHUNK = 8, 8192  # robots from which they are answered in blocks; that are answered together


class QuickQuery:
    """A table for the compiled loop.

    Args:
        table: all numbers.
        widths: names of the outputs whose intervals it has.
    """

    def __init__(self, table: FlatTable, widths: Sequence[str]):
        compile_once()
        self._made_of = table, tuple(widths)
        self._table, self._widths = table, [(i, name) for i, name in enumerate(OUTPUTS) if name in widths]
        self._addresses = table.numbers.ctypes.data, table.places.ctypes.data
        self._sizes = len(table.numbers), len(table.places)
        self._matrices = _ROOM + table.room
        self._space = self._matrices + MATRICES * 16

    def __reduce__(self) -> tuple[type[QuickQuery], tuple[FlatTable, tuple[str, ...]]]:
        return QuickQuery, self._made_of  # addresses belong to one process, and to one copy

    def rows(
        self, values: Mapping[str, Floats], robots: Floats | None, dwells: Floats | None, *, widths: bool = False
    ) -> Floats:
        """Return the answers (ANSWERS, M) of the loop.

        Args:
            values: checked columns of robots, each (M,).
            robots: heads and tails of robots with effects, see `surrogate.wrench.heads.pack_robots`.
            dwells: checked, (M,).
            widths: answer half-widths of intervals as well.
        """
        groups = np.array([values[name] for name in ROBOT], dtype=float)
        count = groups.shape[1]
        wanted = WITH_DWELL * (dwells is not None) + WITH_WIDTHS * widths + ASSEMBLED * (robots is not None)
        robots = np.empty((count, ROBOT_NUMBERS)) if robots is None else robots
        dwells = np.empty(0) if dwells is None else np.array(dwells, dtype=float)
        if count >= MANY:
            return self._in_blocks(groups, robots, dwells, wanted)
        answers, room = np.empty((ANSWERS, count)), np.empty(self._table.room)
        query_rows(
            self._table.numbers, self._table.places, *self._sizes, count, groups, robots, dwells, wanted, answers,
            room, len(room), np.empty((MATRICES, 4, 4)),
        )  # fmt: skip
        return answers

    def _in_blocks(self, groups: Floats, robots: Floats, dwells: Floats, wanted: int) -> Floats:
        """Return the answers (ANSWERS, M) of the loop over blocks: those with one, two, and more tails apart."""
        count, table = groups.shape[1], self._table
        answers, lanes = np.empty((count, ANSWERS)), np.empty((BLOCK_ROWS + table.block_rows, BLOCK))
        room, matrices = np.empty(table.room), np.empty((MATRICES, 4, 4))
        most = min(count, _CHUNK)
        states, found = np.empty((most, STATE)), np.empty(most, dtype=np.int64)
        kinds = np.minimum(groups[ROBOT.index("N")], 3)
        for begin in range(0, count, _CHUNK):
            some = kinds[begin : begin + _CHUNK]
            for kind in np.unique(some):
                chosen = begin + np.flatnonzero(some == kind)
                query_blocks(
                    table.numbers, table.places, *self._sizes, table.singles, chosen, len(chosen), count, groups,
                    robots, dwells, wanted, answers, states, found, lanes, len(lanes), room, len(room), matrices,
                )  # fmt: skip
        return answers.T

    def one(self, columns: Mapping[str, Any], *, intervals: bool, flag: bool) -> dict[str, Any] | None:
        """Answer a query of one robot without effects; None for any other, and for one that must be refused.

        Args:
            columns: the robot by column name, each (1,).
            intervals, flag: see `surrogate.table.lookup.NeuralTable.query`.
        """
        numbers = _numbers_of_one(columns)
        if numbers is None:
            return None
        with_dwell = DWELL in columns
        memory = np.empty(self._space)
        try:
            memory[:_ROBOT] = numbers
        except (TypeError, ValueError, OverflowError):
            return None
        if with_dwell and not (SHORTEST <= memory[GROUPS] < np.inf and memory[_NUMBER] >= 2):
            return None
        first = memory.ctypes.data
        query_rows.call(
            *self._addresses, *self._sizes, 1, first, first + _BYTES * _ROBOT, first + _BYTES * GROUPS,
            WITH_DWELL * with_dwell + WITH_WIDTHS * intervals, first + _BYTES * _ANSWER, first + _BYTES * _ROOM,
            self._table.room, first + _BYTES * self._matrices,
        )  # fmt: skip
        reason = memory[_ANSWER + REASON]
        if reason == IMPOSSIBLE or not (flag or reason == INSIDE):
            return None
        answers = memory[_ANSWER:_ROOM].copy()[:, None]
        result = self.named(answers, with_dwell=with_dwell, widths=intervals)
        if flag:
            result[OUTSIDE] = outside(answers)
        return result

    def named(self, answers: Floats, *, with_dwell: bool, widths: bool) -> dict[str, Any]:
        """Return outputs and the ends of their intervals by name, from answers (ANSWERS, M)."""
        names = OUTPUTS if with_dwell else STEADY_OUTPUTS
        result: dict[str, Any] = {name: answers[STEADY + i] for i, name in enumerate(names)}
        if widths:
            for i, name in self._widths:
                if name in result:
                    value, half = answers[STEADY + i], answers[HALF + i]
                    result[f"{name}_low"], result[f"{name}_high"] = value - half, value + half
        return result


def outside(answers: Floats) -> Flags:
    """Return which robots are outside the table's domain, (M,)."""
    return np.asarray(answers[REASON] != INSIDE)


def _numbers_of_one(columns: Mapping[str, Any]) -> list[Any] | None:
    """Return the groups and the dwell of one robot without effects; None if the columns hold something else."""
    known = len(GROUP_COLUMNS)
    numbers: list[Any] = []
    for name in GROUP_COLUMNS:
        array = columns.get(name)
        if type(array) is not np.ndarray or array.shape != (1,):
            return None
        numbers.append(array.item())
    for name, default in ((OPTIONAL_COLUMNS[0], 1.0), (DWELL, 0.0)):
        array = columns.get(name)
        if array is None:
            numbers.append(default)
        elif type(array) is not np.ndarray or array.shape != (1,):
            return None
        else:
            numbers.append(array.item())
            known += 1
    return numbers if len(columns) == known else None
