"""Tables as laboratories write them: every dialect is the same table, and what is ambiguous is refused."""

from __future__ import annotations

import io
from pathlib import Path

import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sim.io.errors import InputError
from sim.io.tables import read_table
from sim.io.text_tables import parse_table

TABLE = pd.DataFrame({"run": ["a", "b c"], "x [mm]": [0.5, -3.25], "y [mm]": [1.0, 1250.0]})
TEXTS = {
    "comma": "run,x_mm,y_mm\na,0.5,1\nb c,-3.25,1250\n",
    "semicolon": "run;x_mm;y_mm\na;0.5;1\nb c;-3.25;1250\n",
    "tab": "run\tx_mm\ty_mm\na\t0.5\t1\nb c\t-3.25\t1250\n",
    "decimal comma": "run;x_mm;y_mm\na;0,5;1,0\nb c;-3,25;1,25e3\n",
    "decimal comma and tab": "run\tx_mm\ty_mm\na\t0,5\t1\nb c\t-3,25\t1250\n",
    "blanks": 'run x_mm y_mm\na 0.5 1\n"b c"   -3.25 1250\n',
    "byte order mark": "\ufeffrun,x_mm,y_mm\na,0.5,1\nb c,-3.25,1250\n",
    "comments": "# tank 3\n% calibrated\nrun,x_mm,y_mm\n# first\na,0.5,1\nb c,-3.25,1250\n",
    "blanks around names": " run , x_mm ,\ty_mm\na, 0.5, 1\nb c, -3.25, 1250\n",
    "units below": "run,x,y\n,mm,mm\na,0.5,1\nb c,-3.25,1250\n",
    "units in brackets below": "run;x;y\n;[mm];[mm]\na;0,5;1\nb c;-3,25;1250\n",
    "units in brackets": "run,x [mm],y [mm]\na,0.5,1\nb c,-3.25,1250\n",
    "carriage returns": "run,x_mm,y_mm\r\na,0.5,1\r\nb c,-3.25,1250\r\n",
    "old line ends": "run,x_mm,y_mm\ra,0.5,1\rb c,-3.25,1250\r",
    "empty lines": "\n\nrun,x_mm,y_mm\n\na,0.5,1\n\nb c,-3.25,1250\n\n",
    "separators at the ends": "run,x_mm,y_mm\na,0.5,1,\nb c,-3.25,1250,\n",
}


def in_millimetres(table: pd.DataFrame) -> pd.DataFrame:
    return table.rename(columns={"x_mm": "x [mm]", "y_mm": "y [mm]"})


@pytest.mark.parametrize("dialect", TEXTS)
def test_every_dialect_is_the_same_table(dialect: str, tmp_path: Path) -> None:
    (tmp_path / "table.csv").write_text(TEXTS[dialect], encoding="utf-8", newline="")
    table = in_millimetres(read_table(tmp_path / "table.csv"))
    pd.testing.assert_frame_equal(table, TABLE, check_dtype=False)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "latin-1", "cp1252"])
def test_every_encoding_is_the_same_table(encoding: str, tmp_path: Path) -> None:
    (tmp_path / "table.csv").write_bytes("session,theta [°]\nFüllung 1,12.5\n".encode(encoding))
    table = read_table(tmp_path / "table.csv")
    assert table.to_dict("records") == [{"session": "Füllung 1", "theta [°]": 12.5}]


@pytest.mark.parametrize("units", [False, True])
def test_spreadsheets_and_parquet_are_the_same_table(units: bool, tmp_path: Path) -> None:
    sheet = TABLE.rename(columns={"x [mm]": "x", "y [mm]": "y"}) if units else TABLE
    rows = pd.concat([pd.DataFrame([{"run": None, "x": "mm", "y": "mm"}]), sheet]) if units else sheet
    rows.to_excel(tmp_path / "table.xlsx", index=False)
    TABLE.to_parquet(tmp_path / "table.parquet")
    for name in ("table.xlsx", "table.parquet"):
        pd.testing.assert_frame_equal(read_table(tmp_path / name), TABLE, check_dtype=False)


def test_names_in_a_comment_belong_to_the_columns(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text("# made by numpy.savetxt\n# x_cm y_cm\n1 2\n3 4\n")
    assert read_table(tmp_path / "a.txt").to_dict("list") == {"x_cm": [1, 3], "y_cm": [2, 4]}


def test_a_table_without_names_has_numbered_columns_where_that_is_allowed(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text("1 2\n3 4\n")
    assert read_table(tmp_path / "a.txt", names=False).to_dict("list") == {0: [1, 3], 1: [2, 4]}
    with pytest.raises(InputError, match="no names of columns"):
        read_table(tmp_path / "a.txt")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("x,y\n1,5,2,5\n", "more values than columns; if numbers have decimal commas"),
        ("x;y\n1,5;2.5\n", r"decimal comma \(1,5\) and with a decimal point \(2.5\)"),
        ("x;y\n1.234,5;2\n", "'1.234,5'; write numbers without separators of thousands"),
        ("x,y,x\n1,2,3\n", "two columns 'x'"),
        ("", "is empty"),
        ("# only a comment\n", "is empty"),
        ("x,y\n", "no rows"),
        ("x,y\nmm,mm\n", "no rows"),
        ("x,y\n1,2\0\n", "is no text"),
    ],
)
def test_what_is_no_table_or_could_be_two_is_refused(text: str, words: str, tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(text)
    with pytest.raises(InputError, match=words) as refusal:
        read_table(tmp_path / "a.csv")
    assert str(tmp_path / "a.csv") in str(refusal.value)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize("name", ["a.xlsx", "a.parquet"])
def test_a_damaged_file_is_refused(name: str, tmp_path: Path) -> None:
    buffer = io.BytesIO()
    if name.endswith("xlsx"):
        TABLE.to_excel(buffer, index=False)
    else:
        TABLE.to_parquet(buffer)
    for content in (b"", b"no such thing", buffer.getvalue()[: len(buffer.getvalue()) // 2]):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(InputError, match="is no"):
            read_table(tmp_path / name)


@given(
    st.lists(st.tuples(st.floats(-1e12, 1e12), st.integers(-1000, 1000)), min_size=1, max_size=6),
    st.sampled_from([(",", "."), (";", "."), (";", ","), ("\t", "."), ("\t", ",")]),
    st.sampled_from(["utf-8", "utf-8-sig", "utf-16"]),
)
@settings(max_examples=50, deadline=None)
def test_numbers_are_read_to_the_last_digit(
    rows: list[tuple[float, int]], form: tuple[str, str], encoding: str
) -> None:
    separator, decimal = form
    lines = [separator.join(repr(value).replace(".", decimal) for value in row) for row in rows]
    text = "\n".join([f"a{separator}b", *lines])
    table = parse_table(text.encode(encoding), "table")
    assert table["a"].tolist() == [a for a, _ in rows]
    assert table["b"].tolist() == [b for _, b in rows]
