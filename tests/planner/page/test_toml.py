"""TOML is read as Python reads it, and refused in the same words."""

from __future__ import annotations

from pathlib import Path

import pytest

from sim.io.errors import InputError
from sim.io.reading import read_toml
from tests.planner.page.page_core import answers, without_digits

GOOD = [
    "", "# nothing\n", 'name = "a"\n[t]\nx = 1 # c\ny = -2.5e3\n', "a.b.c = 1\na.b.d = 'x\\y'\n[e]\n",
    'x = "tab\\t \\u00e9 \\U0001F41F \\" \\\\"\n', "[a.b]\nx = true\n[a]\ny = false\n",
    "x = [1, 2.5, # comment\n [3], 'a',]\r\ny = 1_000\n",
    "x = 0x1F\ny = 0b11\nz = 0o17\nw = +inf\n", '"quoted key" = 1\n',
    "\ufeffx = 1\n", "x = 1e5\ny = -0.0\nz = 6.02e+23",
]  # fmt: skip
BAD = [
    "x", "x = ", "x = 1 2", "= 1", "[t", "[t]\n[t]\n", "x = 1\nx = 2\n", "x = 1\n[x]\n", "x = 0,5\n", "x = 'a\n",
    'x = "a', 'x = "\\q"\n', 'x = "\\u12"\n', 'x = "\\ud800"\n', "x = [1, 2\n", "x = [1 2]\n", "?\n", "x = 01\n",
    "x = tru\n", "[]\n", "x = 1.\n", "# \x01\n", 'x = "\x02"\n', "[t]\nlength_cm = 1,5  # cm\n",
    "a.b = 1\na = 2\n",
]  # fmt: skip


@pytest.mark.parametrize("text", GOOD, ids=repr)
def test_good_texts(text: str, tmp_path: Path) -> None:
    file = tmp_path / "robot.toml"
    file.write_bytes(text.encode())
    (found,) = answers([("toml.js", "readToml", text, "robot.toml")])
    assert found == read_toml(file)


def test_bad_texts_are_refused_in_the_same_words(tmp_path: Path) -> None:
    file = tmp_path / "robot.toml"
    found = answers([("toml.js", "readToml", text, str(file)) for text in BAD])
    for refusal, text in zip(found, BAD, strict=True):
        file.write_bytes(text.encode())
        with pytest.raises(InputError) as wanted:
            read_toml(file)
        assert isinstance(refusal, InputError), text
        assert without_digits(refusal) == without_digits(wanted.value), text
