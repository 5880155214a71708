"""Tables as laboratories write them: dialects, units, columns, times; what could be two things is refused."""

from __future__ import annotations

import io
import math
import zipfile
from datetime import datetime, timedelta
from pathlib import Path

import openpyxl
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from common.errors import InputError
from common.quantities import convert_columns, numbers_of
from common.tables import parse_table, read_table, row_name
from common.units import UNITS, convert, find_unit, format_length, format_time, from_si, of_kind, split, to_si

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
    ('""\n', "is empty"),
    (",,\n", "no rows"),
    (" \t;\n", "no rows"),
    ("\ufeff\ufeff\n", "is empty"),
    ("b,b,a,a\n1,2,3,4\n", "two columns 'a'"),
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


def test_files_that_were_joined_have_byte_order_marks_within() -> None:
    table = parse_table(b"\xef\xbb\xbfx,y\n1,2\n\xef\xbb\xbf3,4\n", "t.csv")
    assert table.to_dict("list") == {"x": [1, 3], "y": [2, 4]}


@pytest.mark.parametrize("columns", [1, 10_000])
def test_a_column_is_of_integers_where_all_are_written_so(columns: int) -> None:
    """2.0, 1e3 and what no float holds exactly are none."""
    rows = [["7", "2.0", "3", "9007199254740993", "-1"], ["8", "2", "1e3", "1", "0"]]
    table = parse_table("\n".join(",".join(row * columns) for row in rows).encode(), "t.csv", names=False)
    assert [dtype.kind for dtype in table.dtypes] == [*"ifffi"] * columns


@pytest.mark.parametrize(("text", "words"), REFUSED)
def test_what_is_no_table_or_could_be_two_is_refused(text: str, words: str, tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(text)
    with pytest.raises(InputError, match=words) as refusal:
        read_table(tmp_path / "a.csv")
    assert str(tmp_path / "a.csv") in str(refusal.value)
    assert "\n" not in str(refusal.value)


ETHOVISION = (
    '\ufeff"Number of header lines:";"8";\n"Experiment";"Exp 1";\n"Trial name";"Trial     1";\n"Trial ID";"1";\n'
    '"Start time";"12/3/2013 13:52:31.467";\n\n"Trial time";"X center";"Y center";"Area";\n"s";"cm";"cm";"cm²";\n'
    '0;"-";"-";"-";\n0.04;10.1;3.2;4.5;\n0.08;10.3;3.4;4.6;\n'
)
LABVIEW = (
    "LabVIEW Measurement\t\nSeparator\tTab\nDecimal_Separator\t,\nTime\t16:21:22,319\n***End_of_Header***\t\n\t\n"
    "Channels\t2\t\t\nSamples\t3\t3\t\nY_Unit_Label\tV\tV\nX0\t0,00E+0\t0,00E+0\nDelta_X\t0,1\t0,1\t\n"
    "***End_of_Header***\t\t\t\nX_Value\tx_cm\ty_cm\tComment\n0,0\t0,9\t1,5\t\n0,1\t1,4\t1,5\n"
)
TITLED = [  # and the line of the header
    ("Versuch 3\nx_cm;y_cm\n0;0,5\n10;1\n", 2),
    ("Versuch 3;\nx_cm;y_cm\n0;0\n10;1\n", 2),
    ("Path of the robot\nx_cm,y_cm\n0,0\n10,1\n", 2),
    ("Path\nx_cm\ty_cm\n0\t0\n10\t1\n", 2),
    ("2026\nx_cm,y_cm\n0,0\n10,1\n", 2),
    ("Tank A\nby me, on Monday\n\nrun,x,y\n,cm,cm\na,0,0\nb,10,1\n", 4),
    (";Robot;\nt_s;x_cm;y_cm\n0;0;0\n1;10;1\n", 2),
    ("Name:,Robert\nFrames:,30\nt_s,x_cm,y_cm\n0,0,0\n1,2,3\n", 3),
    (ETHOVISION, 7),
    (LABVIEW, 13),
]


@pytest.mark.parametrize(("text", "line"), TITLED)
def test_lines_above_the_header_are_to_be_deleted(text: str, line: int, tmp_path: Path) -> None:
    words = f"table: the header seems to be in line {line}: delete the lines above it"
    with pytest.raises(InputError, match=words):
        parse_table(text.encode(), "table", names=False)
    below = "\n".join(text.splitlines()[line - 1 :])
    assert parse_table(below.encode(), "table", names=False).shape[1] > 1
    sheet(tmp_path / "titled.xlsx", [["Path of the robot", None], [], ["x_cm", "y_cm"], [0, 0], [10, 1]])
    with pytest.raises(InputError, match="header seems to be in line 3"):
        read_table(tmp_path / "titled.xlsx")


NAN = float("nan")
READ = {
    "a row of words below the names": ("x,y\nleft,up\n1,2\n", {"x": ["left", "1"], "y": ["up", "2"]}),
    "words below one name": ("x,\nleft,up\nright,2\n", {"x": ["left", "right"], "column 2": ["up", "2"]}),
    "a note of words and numbers": ("note\na,b\nc,5\n", {"note": ["a,b", "c,5"]}),
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


@pytest.mark.parametrize(("part", "words"), [
    (b"<!--" + b" " * 2**21 + b"-->", "a comment or a tag of more than 1 MiB"),
    (b"<a>" * 2**20, "unpacks to more than 2 MiB"),
])  # fmt: skip
def test_a_workbook_that_unpacks_to_far_more_is_refused(
    part: bytes, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "book.xlsx"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as book:
        book.writestr("xl/worksheets/sheet1.xml", part)
    if "unpacks" in words:
        monkeypatch.setattr("common.tables.MOST_BYTES", 2**21)
    with pytest.raises(InputError, match=f"is no spreadsheet in the form .xlsx .it .*{words}"):
        read_table(path)


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


def test_a_name_is_split_into_quantity_and_unit() -> None:
    for name, quantity, suffix in (
        ("omega_yr_rad_s", "omega_yr", "rad_s"), ("omega_yr_deg_s", "omega_yr", "deg_s"), ("R_mm", "R", "mm"),
        ("viscosity_mPa_s", "viscosity", "mPa_s"), ("viscosity_Pa_s", "viscosity", "Pa_s"),
        ("time_s", "time", "s"), ("v_cm_min", "v", "cm_min"), ("X [cm]", "X", "cm"),
        ("omega (deg/s)", "omega", "deg_s"), ("theta [°]", "theta", "deg"), ("motor[U/min]", "motor", "rpm"),
    ):  # fmt: skip
        assert split(name) == (quantity, UNITS[suffix]), name
    for name in ("x", "N", "C_t", "C_yr", "omega_yr", "run", "cm", "rpm", "R [ells]", "x_1"):
        assert split(name).unit is None, name


def test_known_conversions() -> None:
    assert convert(60.0, "rpm", "rad_s") == pytest.approx(math.tau)
    assert convert(180.0, "deg", "rad") == math.pi
    assert convert(11.0, "cm", "m") == 0.11
    assert convert(3.2, "mm", "m") == 0.0032
    assert convert(20.0, "C", "K") == 293.15
    assert convert(68.0, "F", "C") == pytest.approx(20.0)
    assert convert(1490.0, "cP", "Pa_s") == 1.49
    assert convert(6.0, "cm_min", "mm_s") == pytest.approx(1.0)
    with pytest.raises(ValueError, match="unit of length"):
        convert(1.0, "cm", "s")


@given(st.sampled_from(sorted(UNITS)), st.floats(-1e6, 1e6))
def test_conversion_to_si_and_back_is_the_same_number(suffix: str, value: float) -> None:
    assert from_si(to_si(value, suffix), suffix) == pytest.approx(value, rel=1e-12, abs=1e-9)


@given(st.sampled_from(sorted(UNITS)))
def test_every_unit_is_found_as_it_is_written(suffix: str) -> None:
    unit = UNITS[suffix]
    assert find_unit(suffix) == find_unit(f"[{unit.text}]") == unit
    assert suffix in of_kind(unit.kind)


def test_times_and_lengths_as_people_say_them() -> None:
    assert [format_time(s) for s in (0.354, 48.2, 750.0, 12_000.0, 7200.0, 134_000.0, 890_000.0)] == [
        "0.354 s", "48.2 s", "12.5 min", "3 h 20 min", "2 h", "37 h 13 min", "10.3 days",
    ]  # fmt: skip
    assert [format_length(m) for m in (0.0032, 0.124, 1.5, 104.0, 0.0)] == [
        "3.2 mm", "12.4 cm", "150 cm", "104 m", "0 cm",
    ]  # fmt: skip


WANTED = ("N", "l_cm", "omega_rpm", "omega_h_rpm", "omega_yr_rad_s", "R_yr_cm", "theta_deg", "temperature_C")


def converted(**columns: float) -> tuple[dict[str, float], tuple[str, ...]]:
    table, notes = convert_columns(pd.DataFrame({k: [v] for k, v in columns.items()}), WANTED, "runs.csv")
    return {str(name): table[name].iloc[0] for name in table}, notes


@pytest.mark.parametrize(
    ("column", "value", "wanted", "expected"),
    [
        ("l_mm", 110.0, "l_cm", 11.0),
        ("omega_yr_deg_s", 180.0, "omega_yr_rad_s", math.pi),
        ("Theta (rad)", math.pi / 2, "theta_deg", 90.0),
        ("omega_rad_s", math.tau, "omega_rpm", 60.0),
        ("omega_h_Hz", 2.0, "omega_h_rpm", 120.0),
        ("temperature_K", 293.15, "temperature_C", 20.0),
        ("l [cm]", 11.0, "l_cm", 11.0),
        ("n", 2.0, "N", 2.0),
    ],
)
def test_a_column_in_another_unit_is_converted(column: str, value: float, wanted: str, expected: float) -> None:
    row, notes = converted(**{column: value, "note": 1.0})
    assert row == {wanted: pytest.approx(expected, rel=1e-14), "note": 1.0}
    assert len(notes) == 1
    assert notes[0].startswith(f"column {column} ")
    assert wanted in notes[0]


def test_columns_that_fit_are_left_alone() -> None:
    """The length of the head is not taken for that of the tails."""
    assert converted(l_cm=3.0, omega_h_rpm=4.0, L_cm=6.0) == ({"l_cm": 3.0, "omega_h_rpm": 4.0, "L_cm": 6.0}, ())
    assert converted(L_mm=60.0) == ({"L_mm": 60.0}, ())


@pytest.mark.parametrize(
    ("columns", "words"),
    [
        ({"l_cm": 1.0, "l_mm": 10.0}, "l_cm and l_mm are the same quantity"),
        ({"R_yr [cm]": 1.0, "R_yr [mm]": 10.0}, r"R_yr \[cm\] and R_yr \[mm\] are the same quantity"),
        ({"omega_h": 1.0}, "'omega_h' has no unit; name it one of omega_h_rad_s, omega_h_deg_s, omega_h_rpm"),
        ({"theta": 1.0}, "'theta' has no unit; name it one of theta_rad, theta_deg"),
    ],
)
def test_what_could_mean_two_things_is_refused(columns: dict[str, float], words: str) -> None:
    with pytest.raises(InputError, match=words):
        converted(**columns)


def test_a_synonym_may_be_a_unit_and_a_value_that_is_no_number_is_missing() -> None:
    table, notes = convert_columns(pd.DataFrame({"rpm": [60.0]}), WANTED, "runs.csv", {"rpm": "omega"})
    assert table.to_dict("list") == {"omega_rpm": [60.0]}
    assert notes == ("column rpm read as omega_rpm",)
    table, _ = convert_columns(pd.DataFrame({"l_mm": ["110", "?"]}), WANTED, "runs.csv")
    assert table["l_cm"].iloc[0] == 11.0
    assert math.isnan(table["l_cm"].iloc[1])


@pytest.mark.parametrize(
    ("name", "given", "expected"),
    [
        ("time_s", pd.to_timedelta([0, 1.5], unit="s"), [0, 1.5]),
        ("time_ms", pd.to_timedelta([0, 1.5], unit="s"), [0, 1500]),
        ("elapsed_min", pd.to_datetime(["2026-01-01 00:03", "2026-01-01 00:00", None]), [3, 0, NAN]),
        ("elapsed_min", ["0:03:00", "0 days 00:00:30.0", "1 day, 0:00:00"], [3, 0.5, 1440]),
        ("elapsed_min", ["0:03:00", "9" * 5000 + " days 00:00:30"], [3, math.inf]),
        ("t_s", ["2026-05-01T12:00:00Z", "2026-05-01 14:00:01,5+02:00", "2026-05-01"], [43200, 43201.5, 0]),
        ("time_s", ["0:00:01", "1:30", "2026"], [1, NAN, NAN]),
        ("time_s", [1.7e9, 1.7e9 + 0.5], [0, 0.5]),
        ("time_ms", [1.7e12, NAN, 1.7e12 + 500], [0, NAN, 500]),
        ("time_s", [1.7e12, 1.7e12 + 500], [NAN, NAN]),
        ("time_s", [5.0, 7.0], [5, 7]),
        ("time_s", ["5", "lost"], [5, NAN]),
        ("heading_deg", pd.to_timedelta([0, 1.5], unit="s"), [NAN, NAN]),
        ("heading_deg", pd.to_datetime(["2026-01-01", "2026-01-02"]), [NAN, NAN]),
    ],
    ids=str,
)
def test_times(name: str, given: object, expected: list[float]) -> None:
    assert numbers_of(pd.Series(given, name=name)).tolist() == pytest.approx(expected, nan_ok=True, abs=1e-9)


def test_a_duration_has_a_unit_of_its_own() -> None:
    table = convert_columns(
        pd.DataFrame({"t_ms": ["0:00:01", "0:00:02"]}), ["time_s"], "tracks", {"t": "time"}
    ).table
    assert table["time_s"].tolist() == [1, 2]
