"""Tables of any usual kind are read as Python reads them, and refused in the same words."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from sim.io.errors import InputError
from sim.io.quantities import numbers_of
from sim.io.text_tables import parse_table
from tests.planner.page.page_core import answers, without_digits

TABLES = [
    b"x,y\n1,2\n3,4\n", b"x;y\n1,5;2\n3;4,25\n", b"x\ty\n1\t2\n", b"x y\n1 2\n 3   4\n", b"\xef\xbb\xbfx,y\n1,2\n",
    b'"x [cm]","y [cm]"\n"1.5","2"\n', b"# a\n% x y\n1 2\n3 4\n", b"1,2\n3,4\n", b"x,y\nmm,mm\n1,2\n",
    "x,y\n1,2\n".encode("utf-16"), "größe;y\n1;2\n".encode("latin-1"), b"x,y\r\n1,2\r\n\r\n3,4\r\n",
    b"\n\nx,y\n1,2",
    b"x,y\n1,\n,2\nabc,4\nnan,inf\n", b"x, y\n1, 2e3\n+.5, -1.\n", b"x,y,z\n1,2,\n3,4,\n", b"x,y\n1,2,\n3,4,\n",
    b"x,y\n1\n2,3\n", b"x;y\n1,5;abc\n2,5;3,5\n", b"x,,y\n1,2,3\n", b" x ; y \n1;2\n", b"x,y\n0x10,1_000\n1,2\n",
]  # fmt: skip
BAD = [
    b"", b"\n\n", b"# only\n", b"x,y\n", b"x,y\n1,2,3\n", b"x,y\n1,2\n1,2,3\n", b"x,x\n1,2\n", b"x;y\n1.234,5;2\n",
    b"x;y\n1,5;2.5\n", b"a\0b\n", b"x,y\n1,2,3\n4,5,6,7\n",
]  # fmt: skip


def columns_of(data: bytes, *, names: bool) -> tuple[list[Any], list[list[float]]]:
    table = parse_table(data, "table.csv", names=names)
    table = table.rename(columns=lambda name: name.strip() if isinstance(name, str) else name)
    return list(table), [numbers_of(table[name]).tolist() for name in table]


def checked_table(data: bytes) -> None:
    """Parse a table, and refuse one without rows as `read_table` does."""
    if parse_table(data, "table.csv").empty:
        raise InputError("table.csv has no rows; give at least one below the header")


def test_tables() -> None:
    found = answers([("text_tables.js", "parseTable", list(data), "table.csv", False) for data in TABLES])
    for table, data in zip(found, TABLES, strict=True):
        names, columns = columns_of(data, names=False)
        assert table["names"] == names, data
        assert np.array_equal(table["columns"], columns, equal_nan=True), data


@pytest.mark.parametrize("data", [*BAD, b"1,2\n3,4\n"], ids=repr)
def test_bad_tables_are_refused_in_the_same_words(data: bytes) -> None:
    (found,) = answers([("text_tables.js", "parseTable", list(data), "table.csv", True)])
    with pytest.raises(InputError) as wanted:
        checked_table(data)
    assert isinstance(found, InputError)
    assert without_digits(found) == without_digits(wanted.value)


def test_values_are_shown_as_python_shows_them() -> None:
    data = b"a;b;c;d;e\n1;1,5;NA;2;x\n007;2;3,25;abc;\n-2;nan;1e-7;0,5;3,5\n"
    (found,) = answers([("text_tables.js", "parseWords", list(data), "table.csv")])
    table = parse_table(data, "table.csv")
    shown = answers([("text_tables.js", "textsOf", column, found["comma"]) for column in found["words"]])
    assert shown == [[str(value) for value in table[name]] for name in table]
    numbers = answers([("text_tables.js", "numbersOf", column, found["comma"]) for column in found["words"]])
    assert np.array_equal(numbers, [numbers_of(table[name]).to_list() for name in table], equal_nan=True)
