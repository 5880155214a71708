"""Files are read in any usual encoding, or refused in one line; edited and cut ones, and robots that cannot be."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import pytest

from common.errors import InputError, run_command
from common.reading import ContentError, check_seal, expecting, read_bytes, read_json, sealed
from common.tables import read_table
from dataset.design import load_design
from planner.files.saved_plan import is_plan
from planner.paths.path_files import read_outlines, read_path
from sim.__main__ import main
from sim.inputs import load_robot
from sim.model.presets import PRESETS
from sim.model.robot_toml import robot_toml
from tests.sim.robots import CONTROL_VALUES

BROKEN = {
    "lists in lists": ("x = " + "[" * 100_000, "is not TOML: .*(recursion|nested)"),
    "two values": ("x = 1\nx = 2", "is not TOML: Cannot overwrite a value"),
    "a decimal comma": ("x = 1\ny = 1,1", r"is not TOML: .*\(at line 2, column 6\); write 1.1 for 1,1"),
    "no text": (b"\x80abc", "is not TOML: .* in position 0"),
}


@pytest.mark.parametrize("case", BROKEN)
@pytest.mark.parametrize("load", [load_robot, load_design])
def test_what_is_no_toml_is_said_with_its_place(load: Callable[[Path], object], case: str, tmp_path: Path) -> None:
    content, words = BROKEN[case]
    path = tmp_path / "settings.toml"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(InputError, match=words) as refusal:
        load(path)
    assert str(path) in str(refusal.value)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
def test_a_robot_is_read_in_any_usual_encoding(encoding: str, tmp_path: Path) -> None:
    path = tmp_path / "robot.toml"
    path.write_bytes(robot_toml(PRESETS["paper-control"]).encode(encoding))
    assert load_robot(path) == PRESETS["paper-control"]


def test_a_file_beyond_the_limit_is_not_read(tmp_path: Path) -> None:
    path = tmp_path / "large"
    with open(path, "wb") as file:
        file.truncate(2**40)  # a sparse file
    for read in (read_bytes, read_table):
        with pytest.raises(InputError, match="has more than 256 MiB"):
            read(path)


NOTHING = {
    read_bytes: "a.bin", read_table: "a.csv", read_json: "a.json", load_robot: "robot.toml", load_design: "a.toml",
    read_path: "a.svg", read_outlines: "a.geojson",
}  # fmt: skip


@pytest.mark.parametrize("place", ["fifo", "/dev/zero", "/dev/tty", "folder"])
@pytest.mark.parametrize("read", NOTHING)
def test_what_is_no_file_is_refused_at_once(read: Callable[[Path], object], place: str, tmp_path: Path) -> None:
    """It is not waited for."""
    path = tmp_path / NOTHING[read]
    if place == "fifo":
        os.mkfifo(path)
    elif place == "folder":
        path.mkdir()
    else:
        path.symlink_to(place)
    with pytest.raises(InputError, match="; give a file"):
        read(path)
    assert not is_plan(path)


@pytest.mark.parametrize("data", [b"\xff\xfe\x00", b"\x80abc", b"{", b"[" * 100_000])
def test_what_is_no_json_is_said_so(data: bytes, tmp_path: Path) -> None:
    (tmp_path / "a.json").write_bytes(data)
    with pytest.raises(ContentError, match=r"a\.json is no"):
        read_json(tmp_path / "a.json")


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("{", "is not JSON: Expecting property name"),
        ("{}", "no entry 'rows'"),
        ("[1]", "an entry is missing or has another form"),
        ('{"rows": "many"}', r"could not convert string to float: 'many'"),
        ('{"rows": 0}', "float division by zero"),
    ],
)
def test_content_that_a_reader_does_not_expect_is_refused_with_the_reason(
    text: str, reason: str, tmp_path: Path
) -> None:
    path = tmp_path / "a.json"
    path.write_text(text)
    words = rf"{path} is not a list of rows \({reason}.*\); write one"
    with pytest.raises(InputError, match=words), expecting("a list of rows", path, "write one"):
        1 / float(read_json(path)["rows"])


def test_a_refusal_of_what_is_read_has_the_name_of_the_file() -> None:
    with pytest.raises(InputError, match=r"^a\.json: rows must be above 0$"), expecting("a list", "a.json", ""):
        raise InputError("rows must be above 0")


def test_missing_files_and_folders_are_one_line(tmp_path: Path) -> None:
    for path, words in (
        (tmp_path / "none", "no such file"),
        (tmp_path, "is a folder"),
        (Path("a\0b"), "cannot be"),
    ):
        with pytest.raises(InputError, match=words):
            read_bytes(path)


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


def table(**changes: object) -> str:
    values = {**CONTROL_VALUES, **changes}
    return ",".join(values) + "\n" + ",".join(str(v) for v in values.values()) + "\n"


BAD_TABLES = {
    "negative length": (table(l_over_R=-3), "l_over_R = -3"),
    "disc without radius": (table(a_over_R=0), "a_over_R = 0 in row 1; it must be above 0"),
    "no tails": (table(N=0), "N = 0"),
    "half a tail": (table(N=2.5), "N = 2.5"),
    "too many tails": (table(N=65), "N = 65"),
    "nan": (table(C_t="nan"), "C_t = nan"),
    "text": (table(C_t="three"), "C_t"),
    "integer beyond floats": (table(C_t="1" * 400), "C_t = inf in row 1"),
    "stout tail": (table(l_over_r0=1.2), "l/r0 = 1.2"),
    "motor at rest": (table(omega_bar=0), "omega_bar = 0"),
    "unknown column": (table(colour=3), "unknown column 'colour'"),
    "effect out of bounds": (table(end_over_end_drag=-1), "end_over_end_drag = -1"),
    "missing column": ("C_t,C_r\n1,2\n", "missing column"),
    "no rows": (",".join(CONTROL_VALUES) + "\n", "no rows"),
    "empty": ("", "is empty"),
}


@pytest.mark.parametrize("case", list(BAD_TABLES))
def test_steady_refuses(case: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text, expected = BAD_TABLES[case]
    points, out = tmp_path / "points.csv", tmp_path / "out.csv"
    points.write_text(text)
    assert run_command(main, ["steady", str(points), "--out", str(out)]) == 2
    error = capsys.readouterr().err
    assert expected in error
    assert "points.csv" in error
    assert error.startswith("error: ")
    assert len(error.splitlines()) == 1
    assert [p.name for p in tmp_path.iterdir()] == ["points.csv"]
