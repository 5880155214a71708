"""Files are read in any usual encoding, or refused in one line; edited and cut ones are noticed."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from dataset.design import load_design
from sim.inputs import load_robot
from sim.io import tables
from sim.io.errors import InputError
from sim.io.reading import ContentError, read_bytes, read_json, read_toml
from sim.io.seals import check_seal, sealed
from sim.io.tables import read_table
from sim.model.presets import PRESETS
from sim.model.robot_toml import robot_toml

DEEP = [
    ("x = " + "[" * 100_000, "nested too deeply"),
    ("x = " + "{a = " * 10_000, "nested too deeply"),
    ("a." * 100_000 + "a = 1", "a key has more than 50 parts"),
    ('"a" . ' * 60 + "b = 1", "a key has more than 50 parts"),
    ("[" + "a." * 60 + "a]", "a key has more than 50 parts"),
    ("x = 1\nx = 2", "is not TOML"),
]


@pytest.mark.parametrize(("text", "words"), DEEP, ids=range(len(DEEP)))
@pytest.mark.parametrize("load", [load_robot, load_design])
def test_settings_that_would_take_minutes_are_rejected(
    load: Callable[[Path], object], text: str, words: str, tmp_path: Path
) -> None:
    path = tmp_path / "settings.toml"
    path.write_text(text)
    with pytest.raises(InputError, match=words):
        load(path)


def test_keys_and_numbers_with_dots_are_read(tmp_path: Path) -> None:
    path = tmp_path / "a.toml"
    path.write_text("a.b.c = 1\nnumbers = [" + "1.5, " * 1000 + "]\n" + 'text = "' + "A robot. " * 1000 + '"\n')
    content = read_toml(path)
    assert content["a"] == {"b": {"c": 1}}
    assert len(content["numbers"]) == 1000


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
def test_a_robot_is_read_in_any_usual_encoding(encoding: str, tmp_path: Path) -> None:
    path = tmp_path / "robot.toml"
    path.write_bytes(robot_toml(PRESETS["paper-control"]).encode(encoding))
    assert load_robot(path) == PRESETS["paper-control"]


def test_a_file_beyond_the_limit_is_not_read(tmp_path: Path) -> None:
    path = tmp_path / "large"
    with open(path, "wb") as file:
        file.truncate(2**40)  # a sparse file
    with pytest.raises(InputError, match="has more than 1 MiB"):
        read_bytes(path, 2**20)
    with pytest.raises(InputError, match="has more than"):
        read_table(path)


def test_a_small_parquet_file_with_many_rows_is_not_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "rows.parquet"
    pq.write_table(pa.table({"a": pa.array([0.0] * 5000)}), path)
    assert len(read_table(path)) == 5000
    monkeypatch.setattr(tables, "MOST_VALUES", 4999)
    with pytest.raises(InputError, match="5000 rows and 1 columns; give a smaller table"):
        read_table(path)


@pytest.mark.parametrize("data", [b"\xff\xfe\x00", b"\x80abc", b"{", b"[" * 100_000])
def test_what_is_no_json_is_said_so(data: bytes, tmp_path: Path) -> None:
    (tmp_path / "a.json").write_bytes(data)
    with pytest.raises(ContentError, match=r"a\.json is no"):
        read_json(tmp_path / "a.json")


def test_missing_files_and_folders_are_one_line(tmp_path: Path) -> None:
    for path, words in (
        (tmp_path / "none", "no such file"),
        (tmp_path, "is a folder"),
        (Path("a\0b"), "cannot be"),
    ):
        with pytest.raises(InputError, match=words):
            read_bytes(path)


def test_a_decimal_comma_in_toml_is_pointed_out(tmp_path: Path) -> None:
    (tmp_path / "robot.toml").write_text("[tails]\nyoungs_modulus_MPa = 1,1 # measured\n")
    with pytest.raises(InputError, match=r"is not TOML: .*; write 1\.1 for 1,1$"):
        read_toml(tmp_path / "robot.toml")
    (tmp_path / "list.toml").write_text("range = [1,1]\nbroken\n")
    with pytest.raises(InputError, match="is not TOML") as caught:
        read_toml(tmp_path / "list.toml")
    assert "write" not in str(caught.value)


TEXT = robot_toml(PRESETS["paper-control"])
SEALED = sealed(TEXT)


def test_a_text_that_was_cut_is_refused_wherever_it_was_cut() -> None:
    for end in range(len(SEALED) - len(TEXT), len(SEALED) - 1, 7):
        with pytest.raises(InputError, match="cut short"):
            check_seal(SEALED[:end], "corrected.toml")


@pytest.mark.parametrize(
    ("edit", "warnings"),
    [
        (lambda text: text, 0),
        (lambda text: text.replace("\n", " \r\n") + "\r\n", 0),
        (lambda _: TEXT, 0),
        (lambda text: text.replace("C_t = 3.", "C_t = 4."), 1),
        (lambda text: text + "[effects]\ndisc_drag = 1.0\n", 1),
        (lambda text: text.partition("\n")[2], 1),
    ],
)
def test_an_edited_text_is_read_and_says_so_once(
    edit: Callable[[str], str], warnings: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "robot.toml").write_text(edit(SEALED))
    for _ in range(2):
        load_robot(tmp_path / "robot.toml")
    assert capsys.readouterr().err.count("was edited or damaged") == warnings
