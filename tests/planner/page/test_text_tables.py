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
    b'"marker, note",x,y\n"a, b",0,5\n"c ""d""",30,6\n', b'"a;b";"x"\n1;2\n', b'"x\n[cm]",y\n1,"2"\n',
    b"time, s;x, cm\n0,5;1\n",
    b"x,y\n# a note\n#N/A,15\n%30,2\n1,2\n# late,3\n", b"#N/A,15\n1,2\n", b"# 25 fps\n#x,y,w\n1,2,a\n3,4,b\n",
    b"%30,15\n1,2\n",
    b"x;y\n#WERT!;0,5\nErr:502;-\n####;n/a\n1,5;None\n", b"x;y;z\n0,200;1,234;12,5\n1,234;2,000;3\n",
    b'"1,5","2,5"\n"3,0","4"\n',
    b"time_s,x\n0:00:01,1\n1:02:03.5,2\nlost,3\n",
    b"time_min,x\n2026-05-01T12:00:00Z,1\n2026-05-01 14:00:30+01:00,2\n2026-13-01 12:00:00,2\n",
    b"t_s,x\n1714560000.5,1\n1714560002,2\n", b"t_s,x\n1714560000500,1\n0,2\n",
    b"time_h,x\n1 day 00:30:00,1\n2024-02-30,2\n",
    b"x,y,\n1,2,\n3,4\n", b"x y z\n 1 \"a b\" 3\n", b"x;y\n'=1+1;'-a\n''=b;-3\n", b"x,x_1\n1.200,300\n",
]  # fmt: skip
BAD = [
    b"", b"\n\n", b"# only\n", b"x,y\n", b"x,y\n1,2,3\n", b"x,y\n1,2\n1,2,3\n", b"x,x\n1,2\n", b"x;y\n1.234,5;2\n",
    b"x;y\n1,5;2.5\n", b"a\0b\n", b"x,y\n1,2,3\n4,5,6,7\n",
    b"x,y,z\n1,2\n3,4\n", b'x,y\n"1,2\n3,4\n', b'x,y\n"1"2,3\n', b"x;y\n1,200;300\n",
    b"x;y;z\n1,200;1;0,5\n300;2;0,5\n",
    b"x;y\n1.200;1\n300;2\n", b"x;y\n1 200;1\n", b"x;y\n1.200.300;1\n", b'x,y\n"1,200",300\n',
    "x;y\n1\u202f200,5;1\n".encode(),
    b"'=x,'=x\n1,2\n", b"x\ty\n1 2\n3 4\n",
]  # fmt: skip


def columns_of(data: bytes, *, names: bool) -> tuple[list[Any], list[list[float]]]:
    table = parse_table(data, "table.csv", names=names)
    table = table.rename(columns=lambda name: name.strip() if isinstance(name, str) else name)
    return list(table), [numbers_of(table[name]).tolist() for name in table]


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
        parse_table(data, "table.csv")
    assert isinstance(found, InputError)
    assert without_digits(found) == without_digits(wanted.value)


def test_values_are_shown_as_python_shows_them() -> None:
    data = b"a;b;c;d;e\n\n1;1,5;NA;2;x\n007;2;3,25;abc;\n-2;nan;1e-7;0,5;3,5\n"
    (found,) = answers([("text_tables.js", "parseWords", list(data), "table.csv")])
    table = parse_table(data, "table.csv")
    assert found["lines"] == list(table.index)
    shown = answers([("number_words.js", "textsOf", column) for column in found["words"]])
    assert shown == [[str(value) for value in table[name]] for name in table]
    numbers = answers([("number_words.js", "numbersOf", column) for column in found["words"]])
    assert np.array_equal(numbers, [numbers_of(table[name]).to_list() for name in table], equal_nan=True)
