"""Files are written completely or not at all, one or several; devices and pipes stay what they are."""

from __future__ import annotations

import csv
import io
import os
import stat
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from common.errors import CLOSED_PIPE, INTERRUPTED, InputError, run_command
from common.files import files_together, whole_file, write_csv, write_text
from common.tables import read_table
from tests.processes import LIMIT, ROOT

TABLE = pd.DataFrame({"a": [1.0, 2.5]})


def test_a_failure_leaves_the_old_file(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text("old")

    def fail() -> None:
        with whole_file(tmp_path / "a.txt") as part:
            part.write_text("half")
            raise RuntimeError

    with pytest.raises(RuntimeError):
        fail()
    assert [path.name for path in tmp_path.iterdir()] == ["a.txt"]
    assert (tmp_path / "a.txt").read_text() == "old"


def test_a_pipe_is_written_into_and_stays_a_pipe(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    texts: list[str] = []
    reader = threading.Thread(target=lambda: texts.append(pipe.read_text()))
    reader.start()
    write_csv(TABLE, pipe)
    reader.join(LIMIT)
    assert texts == ["a\n1\n2.5\n"]
    assert stat.S_ISFIFO(pipe.stat().st_mode)
    assert [path.name for path in tmp_path.iterdir()] == ["pipe"]


def test_a_device_is_written_into_and_stays_a_device() -> None:
    write_text("/dev/null", "x")
    assert stat.S_ISCHR(os.stat("/dev/null").st_mode)
    with pytest.raises(InputError, match="cannot write /dev/full: No space left on device"):
        write_text("/dev/full", "x")
    assert stat.S_ISCHR(os.stat("/dev/full").st_mode)


def test_the_standard_output_is_written_into() -> None:
    code = "from common.files import write_text; print(1); write_text('/dev/stdout', '2\\n'); print(3)"
    printed = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, timeout=LIMIT)
    assert printed.stdout == "1\n2\n3\n"


def test_a_link_stays_and_its_file_is_written_unless_it_belongs_to_another_user(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "link").symlink_to(tmp_path / "file")
    write_text(tmp_path / "link", "new")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "file").read_text() == "new"
    monkeypatch.setattr(os, "geteuid", lambda: os.getuid() + 1)
    with pytest.raises(InputError, match="symbolic link of another user"):
        write_text(tmp_path / "link", "newer")
    assert (tmp_path / "file").read_text() == "new"


def test_an_unfinished_file_is_no_link(tmp_path: Path) -> None:
    """Its name is not known in advance, so that nobody else can put a link there."""
    (tmp_path / "precious").write_text("old")
    (tmp_path / f".a.txt.part{os.getpid()}").symlink_to("precious")
    write_text(tmp_path / "a.txt", "new")
    assert ((tmp_path / "a.txt").read_text(), (tmp_path / "precious").read_text()) == ("new", "old")


def test_several_files_appear_together_and_what_is_old_goes(tmp_path: Path) -> None:
    names = ("a", "b", "c")
    for name in (*names, "notes"):
        (tmp_path / name).write_text("old")
    with files_together(tmp_path, names) as folder:
        (folder / "a").write_text("new")
        (folder / "b").write_text("new")
        assert (tmp_path / "a").read_text() == "old"
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {"a": "new", "b": "new", "notes": "old"}


@pytest.mark.parametrize("moves", [0, 2, 3, 5])
def test_several_files_stay_as_they_were_where_one_cannot_be_moved(
    moves: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Three files that replace three others are six moves; each of them may fail."""
    names = ("a", "b", "c")
    for name in names:
        (tmp_path / name).write_text("old")
    done, move = [0], os.replace

    def failing(source: Path, target: Path) -> None:
        done[0] += 1
        if done[0] == moves + 1:
            raise OSError(5, "Input/output error")
        move(source, target)

    def write() -> None:
        with files_together(tmp_path, names) as folder:
            for name in names:
                (folder / name).write_text("new")
            monkeypatch.setattr(os, "replace", failing)

    with pytest.raises(InputError, match="Input/output error"):
        write()
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == dict.fromkeys(names, "old")


def test_a_folder_where_a_file_should_be_is_refused_before_anything_is_written(tmp_path: Path) -> None:
    (tmp_path / "b").mkdir()
    with pytest.raises(InputError, match="is not a regular file"), files_together(tmp_path, ("a", "b")):
        pytest.fail("the block must not run")
    assert [path.name for path in tmp_path.iterdir()] == ["b"]


def raising(error: BaseException) -> int:
    def main(_: list[str] | None) -> None:
        raise error

    return run_command(main)


def caused(error: Exception, cause: Exception) -> Exception:
    error.__cause__ = cause
    return error


def test_an_interruption_and_what_a_machine_refuses_are_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert raising(KeyboardInterrupt()) == INTERRUPTED == 130
    assert capsys.readouterr().err == "interrupted\n"
    for error in (
        RecursionError(), MemoryError(), PermissionError(13, "Permission denied", "x"),
        OSError(24, "Too many open files"), RuntimeError("can't start new thread"),
        caused(ImportError("a page of words\nof numpy"), ImportError("x.so: failed to map segment")),
    ):  # fmt: skip
        assert raising(error) == 2
        assert capsys.readouterr().err.count("\n") == 1


def test_signs_that_the_output_lacks_are_printed_as_question_marks(monkeypatch: pytest.MonkeyPatch) -> None:
    output = io.TextIOWrapper(io.BytesIO(), encoding="latin-1")
    monkeypatch.setattr(sys, "stdout", output)
    assert run_command(lambda _: print("ω̄ = 3 ± 1")) == 0
    assert output.buffer.getvalue() == "?? = 3 ± 1\n".encode("latin-1")


def test_a_reader_that_goes_ends_the_command_without_a_word() -> None:
    code = (
        "from common.errors import run_command; import sys\n"
        "def main(_):\n    for i in range(10**6): print(i)\n"
        "sys.exit(run_command(main))"
    )
    line = f"{sys.executable} -c '{code}' | head -1; echo ${{PIPESTATUS[0]}}"
    done = subprocess.run(["bash", "-c", line], cwd=ROOT, capture_output=True, text=True, timeout=LIMIT)
    assert (done.stdout, done.stderr) == (f"0\n{CLOSED_PIPE}\n", "")
    assert CLOSED_PIPE == 141


def test_columns_are_written_as_pandas_writes_them(tmp_path: Path) -> None:
    numbers = [0.0, -0.0, 1.0, -1.5, 1 / 3, 1e-12, 123456789.0, -2.5e300]
    columns = {"x": numbers, "count": list(range(8)), "name": ["a1"] * 8, "y": np.array(numbers[::-1])}
    columns |= {
        "gap": [np.nan, np.inf, *numbers[2:]],
        "yes": [True, False] * 4,
        "a,b": ['x "y"', "u,v", None, ""] * 2,
    }
    columns |= {
        "small": np.array([*numbers[:7], 1e30], dtype=np.float32),
        "words": ["nan", np.nan, "∞\n"] + 5 * ["w"],
    }
    table = pd.DataFrame(columns)
    table["day"] = pd.to_datetime(["2026-05-01"] * 7 + [None])
    table["time"] = table["day"] + pd.to_timedelta(range(8), unit="s")
    table["whole"] = pd.array([1, None, *range(6)], dtype="Int64")
    write_csv(table, tmp_path / "table.csv")
    table.to_csv(tmp_path / "wanted.csv", index=False, float_format="%.8g")
    assert (tmp_path / "table.csv").read_text() == (tmp_path / "wanted.csv").read_text()
    write_csv(columns, tmp_path / "columns.csv")
    pd.DataFrame(columns).to_csv(tmp_path / "wanted.csv", index=False, float_format="%.8g")
    assert (tmp_path / "columns.csv").read_text() == (tmp_path / "wanted.csv").read_text()


def test_no_text_is_a_formula_and_every_text_is_read_back(tmp_path: Path) -> None:
    words = [
        "=1+1", "+a", "-b c", "@SUM(A1)", "'=x", "''-y", "'quoted'", "plain", '=HYPERLINK("http://a";"b")', "=a,b",
    ]  # fmt: skip
    table = pd.DataFrame({"session": words, "=x": np.arange(len(words)) - 3.5})
    write_csv(table, tmp_path / "table.csv")
    with open(tmp_path / "table.csv", newline="") as file:
        cells = [cell for row in csv.reader(file) for cell in row]
    assert not [cell for cell in cells if cell[0] in "=+-@" and not cell[1:].replace(".", "").isdigit()]
    assert read_table(tmp_path / "table.csv").to_dict("list") == table.to_dict("list")
