"""Tables as laboratories write them: every dialect is the same table, and what is ambiguous is refused."""

from __future__ import annotations

import io
import math
from datetime import datetime, timedelta
from pathlib import Path

import openpyxl
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sim.io.errors import InputError
from sim.io.quantities import numbers_of
from sim.io.tables import parse_table, read_table, row_name

TABLE = pd.DataFrame({"run": ["a", "b c"], "x [mm]": [0.5, -3.25], "y [mm]": [1.0, 1250.0]})
TEXTS = {
    "comma": "run,x_mm,y_mm\na,0.5,1\nb c,-3.25,1250\n",
    "semicolon": "run;x_mm;y_mm\na;0.5;1\nb c;-3.25;1250\n",
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
    return table.rename(columns={"x_mm": "x [mm]", "y_mm": "y [mm]"}).reset_index(drop=True)


@pytest.mark.parametrize("dialect", TEXTS)
def test_every_dialect_is_the_same_table(dialect: str, tmp_path: Path) -> None:
    (tmp_path / "table.csv").write_text(TEXTS[dialect], encoding="utf-8", newline="")
    table = in_millimetres(read_table(tmp_path / "table.csv"))
    pd.testing.assert_frame_equal(table, TABLE, check_dtype=False)


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "cp1252"])
def test_every_encoding_is_the_same_table(encoding: str, tmp_path: Path) -> None:
    (tmp_path / "table.csv").write_bytes("session,theta [°]\nFüllung 1,12.5\n".encode(encoding))
    table = read_table(tmp_path / "table.csv")
    assert table.to_dict("records") == [{"session": "Füllung 1", "theta [°]": 12.5}]


def test_spreadsheets_and_parquet_are_the_same_table(tmp_path: Path) -> None:
    below = TABLE.rename(columns={"x [mm]": "x", "y [mm]": "y"})
    units = pd.DataFrame([{"run": None, "x": "mm", "y": "mm"}])
    pd.concat([units, below]).to_excel(tmp_path / "below.xlsx", index=False)
    TABLE.to_excel(tmp_path / "table.xlsx", index=False)
    TABLE.to_parquet(tmp_path / "table.parquet")
    for name in ("below.xlsx", "table.xlsx", "table.parquet"):
        pd.testing.assert_frame_equal(in_millimetres(read_table(tmp_path / name)), TABLE, check_dtype=False)


def test_names_may_be_in_a_comment_or_missing_where_that_is_allowed(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text("# made by numpy.savetxt\n# x_cm y_cm\n1 2\n3 4\n")
    assert read_table(tmp_path / "a.txt").to_dict("list") == {"x_cm": [1, 3], "y_cm": [2, 4]}
    (tmp_path / "a.txt").write_text("1 2\n3 4\n")
    assert read_table(tmp_path / "a.txt", names=False).to_dict("list") == {0: [1, 3], 1: [2, 4]}
    with pytest.raises(InputError, match="no names of columns"):
        read_table(tmp_path / "a.txt")
    table = parse_table(b"# tank 3\n\nx,y\nmm,mm\n1,2\n\n3,4\n", "table")
    assert [row_name(table, row) for row in (0, 1)] == ["row 1 (line 5)", "row 2 (line 7)"]


REFUSED = [
    ("x,y\n1,5,2,5\n", "more values than columns; if numbers have decimal commas"),
    ("x;y\n1,5;2.5\n", r"decimal comma \(1,5\) and with a decimal point \(2.5\)"),
    ("x;y\n1.234,5;2\n", "'1.234,5'; write numbers without separators of thousands"),
    ("x,y,x\n1,2,3\n", "two columns 'x'"),
    ("", "is empty"),
    ("# only a comment\n", "is empty"),
    ("x,y\n", "no rows"),
    ("x,y\nmm,mm\n", "no rows"),
    ("x,y\n1,2\0\n", "is no text"),
    ("a,b,c\n1,2\n3,4\n", r"all rows have fewer values \(2\) than there are columns \(3\)"),
    ("x,y\n\n1,2\n# 3\n1,2,3\n", "line 5 has more values than columns"),
    ('x,y\n1,2\n"3,4\n', "line 4: unexpected end of data"),
    ("x;y\n1,200;300\n", "'1,200', which may be 1200 or 1.2"),
    ("x;y\n1,200;0,5\n300;0,5\n", "'1,200', which may be 1200 or 1.2"),
    ("x;y\n1.200;1\n300;2\n", "'1.200', which may be 1200 or 1.2"),
    ('x,y\n"1,200",300\n', "'1,200', which may be 1200 or 1.2"),
    ("x;y\n1.200.300;1\n", "'1.200.300'; write numbers without"),
    ("x\ty\n1\u202f200\t1\n", r"'1\\u202f200'; write numbers without"),
]


@pytest.mark.parametrize(("text", "words"), REFUSED)
def test_what_is_no_table_or_could_be_two_is_refused(text: str, words: str, tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(text)
    with pytest.raises(InputError, match=words) as refusal:
        read_table(tmp_path / "a.csv")
    assert str(tmp_path / "a.csv") in str(refusal.value)
    assert "\n" not in str(refusal.value)


NAN = float("nan")
READ = {
    "a separator within quotes": ('"marker, note",x\n"a, b",0\n', {"marker, note": ["a, b"], "x": [0]}),
    "a comma before the unit": ("time, s;x, cm\n0,5;1\n", {"time, s": [0.5], "x, cm": [1]}),
    "the error of a formula": ("x,y\n#N/A,1\n#DIV/0!,2\n", {"x": [NAN, NAN], "y": [1, 2]}),
    "a number behind a mark": ("x,y\n%30,1\n2,3\n", {"x": ["%30", "2"], "y": [1, 3]}),
    "a mark within the data": ("x,y\n1,2\n# late,3\n", {"x": ["1", "# late"], "y": [2, 3]}),
    "a comment with names of all kinds": ("# 25 fps\n# x y w\n1 2 a\n", {"x": [1], "y": [2], "w": ["a"]}),
    "a word among decimal commas": ("x;y\n0,5;1\n#WERT!;2\nwet;3\n", {"x": ["0.5", NAN, "wet"], "y": [1, 2, 3]}),
    "decimal commas between commas": ('x,y\n"1,5",2\n', {"x": [1.5], "y": [2]}),
    "three decimals beside others": ("x;y\n1,234;0,250\n2,000;0,125\n", {"x": [1.234, 2.0], "y": [0.25, 0.125]}),
    "values that are missing": ("x;y\n-;n/a\n#####;Err:502\n1,5;2\n", {"x": [NAN, NAN, 1.5], "y": [NAN, NAN, 2]}),
    "a column without a name and a value": ("x,,y,\n1,,2\n3,,4,\n", {"x": [1, 3], "y": [2, 4]}),
}


@pytest.mark.parametrize("case", READ)
def test_a_table_is_read_as_it_is_meant(case: str) -> None:
    text, expected = READ[case]
    table = parse_table(text.encode(), "table")
    assert list(table) == list(expected)
    for name, values in expected.items():
        pd.testing.assert_series_equal(
            table[name].reset_index(drop=True), pd.Series(values, name=name), check_dtype=False
        )


def sheet(path: Path, rows: list[list[object]], formats: dict[str, str] | None = None) -> None:
    book = openpyxl.Workbook()
    assert book.active is not None
    for row in rows:
        book.active.append(row)
    for cell, form in (formats or {}).items():
        book.active[cell].number_format = form
    book.save(path)


def test_cells_of_a_sheet_are_read_as_their_text(tmp_path: Path) -> None:
    row = [1, 0.05, timedelta(seconds=90.5), datetime(2026, 5, 1, 12), "#N/A"]
    sheet(tmp_path / "a.xlsx", [["n", "share", "t_s", "when_h", "k"], row], {"B2": "0.0%"})
    table = read_table(tmp_path / "a.xlsx")
    assert table.iloc[0, :4].tolist() == [1, "5%", "0:01:30.500000", "2026-05-01 12:00:00"]
    assert math.isnan(table["k"].iloc[0])
    assert (numbers_of(table["t_s"]).tolist(), numbers_of(table["when_h"]).tolist()) == ([90.5], [0.0])


def test_sheets_are_refused_as_texts_are(tmp_path: Path) -> None:
    refusals: list[tuple[list[list[object]], str]] = [
        ([["x", "y", "x"], [1, 2, 3]], "two columns 'x'"),
        ([["x", "R_yr_cm"], [1, 2], [3, "=B2*2"]], "column R_yr_cm has no values: its formulas .* .cell B3"),
        ([["x", "y"], ["1,200", 300]], "'1,200', which may be"),
    ]
    for rows, words in refusals:
        sheet(tmp_path / "a.xlsx", rows)
        with pytest.raises(InputError, match=words):
            read_table(tmp_path / "a.xlsx")


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
