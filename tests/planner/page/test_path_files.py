"""Paths from tables are Python's, and so are the refusals."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from planner.paths.path_files import read_path
from sim.io.errors import InputError
from tests.planner.page.page_core import answer, without_digits

GOOD = [
    b"x,y\n0,0\n3,0\n3,4\n", b"0 0\n1 2\n5 7\n", b"x_mm;y_mm\n1,5;2\n3;4,5\n9;1\n",
    b"X [cm],Y [mm]\n0,0\n1,5\n2,0\n",
    b"time_s,x_cm,y_cm\n0,1,2\n1,3,4\n2,1,0\n", b"x,y\n0,0\n1,0\n1,1\n0,0\n",
    b"\xef\xbb\xbf\"x\",\"y\"\n0,0\n1,1\n",
]  # fmt: skip
BAD = [
    b"", b"x,y\n", b"x,y\n1,2\n", b"x,y\n1,2\n1,2\n", b"a,b\n1,2\n", b"x_mm,y\n1,2\n3,4\n", b"x,y\n1,a\n2,3\n",
    b"x,x_mm,y\n1,2,3\n4,5,6\n", b"1\n2\n", b"x,y\n1,inf\n2,3\n", b"x,y\n1e120,2\n3,4\n",
]  # fmt: skip


@pytest.mark.parametrize("closed", [None, True])
@pytest.mark.parametrize("data", GOOD, ids=repr)
def test_paths(data: bytes, closed: bool | None, tmp_path: Path) -> None:
    file = tmp_path / "path.csv"
    file.write_bytes(data)
    found = answer("path_files.js", "readTablePath", list(data), str(file), closed)
    wanted = read_path(file, closed=closed)
    assert found["unit"] == wanted.unit
    assert found["path"]["closed"] == wanted.path.closed
    assert np.array_equal(found["path"]["points"], wanted.path.points)


@pytest.mark.parametrize("data", BAD, ids=repr)
def test_bad_paths_are_refused_in_the_same_words(data: bytes, tmp_path: Path) -> None:
    file = tmp_path / "path.csv"
    file.write_bytes(data)
    with pytest.raises(InputError) as wanted:
        read_path(file)
    found = answer("path_files.js", "readTablePath", list(data), str(file))
    assert isinstance(found, InputError)
    assert without_digits(found) == without_digits(wanted.value)
