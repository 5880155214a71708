"""Read tables of any usual kind: text, spreadsheets (.xlsx) and Parquet.

The text of a camera, a spreadsheet or an oscilloscope does not say how it is written. Its first lines show it:

- Encoding: UTF-8, UTF-16 with a byte order mark, otherwise Windows-1252, which contains the letters of Latin-1.
  Further byte order marks, as joined files have them, are left out.
- Lines above the names that begin with # or % are comments. So are those between the names and the first row,
  unless a number follows the mark or the first cell is a missing value (#N/A). If the columns have no names, and
  the last comment above them has as many words as there are columns, these are the names (as `numpy.savetxt`
  writes them).
- The separator is the first of semicolon, tab and comma that splits the first two rows into equally many cells,
  two or more; otherwise that which splits the first row into most; without any of them, blanks.
- A second row of nothing but units belongs to the names: x above mm is the column "x [mm]".
- `common.number_words` says what numbers and missing values are.

Empty lines are left out. The index of the table has the line of each row in the file. A spreadsheet's first sheet
is read as the text of its cells. A text that can be read in two ways is refused.
"""

from __future__ import annotations

import csv
import io
import re
import warnings
import zipfile
from collections.abc import Iterator, Sequence
from itertools import chain, islice, pairwise, zip_longest
from pathlib import Path
from typing import Any

import pandas as pd

from common.errors import InputError
from common.keywords import checks_keywords
from common.number_words import check_marks, is_missing, is_number, plain_numbers, plain_text, values_of
from common.reading import MOST_BYTES, decode, read_bytes
from common.units import find_unit

LINE = "line"  # name of the index
_LONGEST_TAG = 2**20  # bytes
_PARQUET, _SHEET = (".parquet", ".pq"), (".xlsx", ".xlsm")
_COMMENT = re.compile(r"^\s*[#%]")
_MARKED_NUMBER = re.compile(r"^\s*[#%]+\s*[+-]?[.,]?[0-9]")
_BLANKS = re.compile(r'("(?:[^"]|"")*")|\s+')
_SEPARATORS = (";", "\t", ",")

Row = tuple[int, list[str]]  # the number of a line, and its words


@checks_keywords
def read_table(path: str | Path, *, names: bool = True) -> pd.DataFrame:
    """Read a table: Parquet or a spreadsheet if the name ends so, otherwise text.

    `common.quantities` converts columns to the units that a program needs.

    Args:
        path: the file.
        names: the columns must have names; otherwise they may be 0, 1, …

    Raises:
        InputError: the file is empty, too large, or it is not a table.

    Example:
        >>> import softflagella as sf
        >>> sf.read_table("falls.xlsx")["time_s"].mean()  # doctest: +SKIP
        8.93
    """
    kind = Path(path).suffix.lower()
    if kind in _PARQUET:
        table = _read_parquet(Path(path))
    elif kind in _SHEET:
        table = _parse_lines(_sheet_lines(path), str(path), names, "\t")
    else:
        table = parse_table(read_bytes(path), str(path), names=names)
    table = table.rename(columns=lambda name: name.strip() if isinstance(name, str) else name)
    if table.empty:
        raise InputError(f"{path} has no rows; give at least one below the header")
    return table


def parse_table(data: bytes, where: str, *, names: bool = True) -> pd.DataFrame:
    """Parse a table that is text, in any of the forms above.

    Args:
        data: content of the file.
        where: its name, for messages.
        names: the columns must have names; without, a table of numbers alone has the columns 0, 1, …

    Raises:
        InputError: the text is no table, or can be read in two ways.
    """
    try:
        text = decode(data)
    except UnicodeDecodeError:
        text = data.decode("cp1252", errors="replace").replace("\ufffd", "\0")
    if "\0" in text:
        raise InputError(f"{where} is no text; give a table as text, .xlsx or .parquet")
    text = text.replace("\ufeff", "").replace("\r\n", "\n").replace("\r", "\n")
    return _parse_lines(text.split("\n"), where, names)


def row_name(table: pd.DataFrame, row: int) -> str:
    """Name a row, from 0, by its number from 1 and by its line in the file if it has one: "row 5 (line 6)"."""
    return f"row {row + 1}" + (f" (line {table.index[row]})" if table.index.name == LINE else "")


def _read_parquet(path: Path) -> pd.DataFrame:
    if not path.is_file():
        read_bytes(path)  # says what it is
    try:
        table = pd.read_parquet(path)
    except Exception as broken:  # a damaged file can raise any error from within the parsers
        raise InputError(f"{path} is no Parquet table ({_reason(broken)})") from None
    _check_names(list(map(str, table)), str(path))
    return table


def _sheet_lines(path: str | Path) -> list[str]:
    """Read the first sheet of a spreadsheet as lines of text, with tabs between the cells.

    Raises:
        InputError: the file is no spreadsheet, or a formula was never calculated.
    """
    data = read_bytes(path)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # openpyxl's, of styles and extensions that it leaves out
            _check_unpacked(data)
            formulas, values = (_cells(data, data_only=values) for values in (False, True))
    except Exception as broken:  # a damaged archive can raise any error from within the parsers
        raise InputError(f"{path} is no spreadsheet in the form .xlsx ({_reason(broken)})") from None
    text = io.StringIO()
    writer = csv.writer(text, delimiter="\t", lineterminator="\n")
    for written, row in zip(formulas, values, strict=True):
        for title, formula, cell in zip(values[0], written, row, strict=False):
            if formula.data_type == "f" and cell.value is None:
                raise InputError(
                    f"{path}: column {title.value} has no values: its formulas were never calculated (cell "
                    f"{formula.coordinate}); open the file in a spreadsheet program and save it"
                )
        writer.writerow([_word(cell) for cell in row])
    return text.getvalue().split("\n")


def _check_unpacked(data: bytes) -> None:
    """Refuse a workbook that is far larger than its file, or has a tag or a comment that takes long to parse.

    Raises:
        ValueError: what it is.
    """
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        if sum(part.file_size for part in archive.infolist()) > MOST_BYTES:
            raise ValueError(f"it unpacks to more than {MOST_BYTES / 2**20:.0f} MiB")
        if any(len(tag) > _LONGEST_TAG for name in archive.namelist() for tag in archive.read(name).split(b">")):
            raise ValueError(f"it has a comment or a tag of more than {_LONGEST_TAG / 2**20:.0f} MiB")


def _cells(data: bytes, *, data_only: bool) -> list[tuple[Any, ...]]:
    """Read the cells of the first sheet, with formulas or with the values that were calculated last."""
    import openpyxl  # it takes longer to load than a text to read

    sheet = openpyxl.load_workbook(io.BytesIO(data), read_only=True, data_only=data_only).worksheets[0]
    sheet.reset_dimensions()
    return list(sheet.iter_rows())


def _word(cell: Any) -> str:
    """Write a cell as text; per cent as such, so that 5 % is not read as 0.05 of another unit."""
    value = cell.value
    if value is None:
        return ""
    if isinstance(value, int | float) and "%" in (cell.number_format or ""):
        return f"{100 * value:.12g}%"
    return " ".join(str(value).splitlines())


def _reason(broken: Exception) -> str:
    """Return the first line of an error."""
    return (str(broken).splitlines() or [type(broken).__name__])[0]


def _parse_lines(lines: Sequence[str], where: str, names: bool, separator: str = "") -> pd.DataFrame:
    """Parse the lines of a table, see `parse_table`; without a separator it is found out."""
    top = next((i for i, line in enumerate(lines) if line.strip() and not _COMMENT.match(line)), None)
    if top is None:
        raise InputError(f"{where} is empty; give a table with one row per line")
    separator = separator or _separator(lines[top:], where)
    columns, rows = _header(lines, top, separator, where)
    if columns is None and names:
        raise InputError(f"{where} has no names of columns; write them into its first line")
    first = next(rows, None)
    if first is None:
        raise InputError(f"{where} has no rows; give at least one below the header")
    width = len(first[1]) if columns is None else len(columns)
    titles = range(width) if columns is None else columns
    # Most tables are numbers alone, which numpy reads at once.
    numbers = plain_numbers(lines[first[0] - 1 :], separator, width) if all(map(str, titles)) else None
    if numbers is not None:
        return pd.DataFrame(
            dict(zip(titles, numbers, strict=True)), pd.RangeIndex(first[0], first[0] + len(numbers[0]), name=LINE)
        )
    content = [first, *rows]
    long = next((line for line, words in content if any(words[width:])), None)
    named = max((i + 1 for i, name in enumerate(columns or ()) if name), default=0)
    longest = max(len(words) for _, words in content)
    fault = ""
    if long is not None:
        commas = "if numbers have decimal commas, separate columns by semicolons"
        fault = f"line {long} has more values than columns; {commas}"
    elif longest < named:
        fault = f"all rows have fewer values ({longest}) than there are columns ({named}); correct the names"
    if fault or 2 * sum(map(bool, columns or ())) <= max(longest, 2):
        # Faults of the rows may come from a header further down, or from another separator: say that first.
        marks = separator, _separator([line for line in lines if line.strip()][-2:], where)
        fault = max(_lower_header(lines, top, mark, where) for mark in marks) or fault
    if fault:
        raise InputError(f"{where}: {fault}")
    cells = list(zip_longest(*(words[:width] for _, words in content), fillvalue=""))
    check_marks(cells, where, separator)
    table = {
        f"column {i + 1}" if title == "" else title: values_of(words)
        for i, (title, words) in enumerate(zip(titles, cells, strict=False))
        if title != "" or any(words)
    }
    return pd.DataFrame(table, index=pd.Index([line for line, _ in content], name=LINE))


def _header(lines: Sequence[str], top: int, separator: str, where: str) -> tuple[list[str] | None, Iterator[Row]]:
    """Return the names of the columns, if there are any, and the rows below them."""
    rows = _rows(lines, top, separator, where)
    first = next(rows, None)
    if first is None:  # quotes without a text, or separators
        raise InputError(f"{where} is empty; give a table with one row per line")
    words = first[1]
    numbers = any(map(is_number, words))
    names = _commented_names(lines[:top], len(words), separator)
    if all(is_number(word) or is_missing(word) for word in words) or (names and numbers):
        if names is None:  # what looked like comments may be rows
            start = next(
                (i for i, line in enumerate(lines[:top]) if not _is_comment(_words(line, separator))), top
            )
            return None, _rows(lines, start, separator, where)
        _check_names(names, where)
        return names, chain([first], rows)
    _check_names(words, where)
    second = _next_row(rows)
    if second and len(second[1]) == len(words) and _are_units(second[1]):
        words = [_with_unit(name, unit) for name, unit in zip(words, second[1], strict=True)]
        second = _next_row(rows)
    return [plain_text(word) for word in words], chain([second] if second else [], rows)


def _lower_header(lines: Sequence[str], top: int, separator: str, where: str) -> str:
    """Say in which line the header seems to be: below others, and above rows with two numbers or more."""
    try:
        rows = list(_rows(lines, top, separator, where))
    except InputError:
        return ""
    columns = [i for i, word in enumerate(rows[-1][1] if rows else ()) if is_number(word)]
    cells = [[words[i] for i in columns if words[i:] and not is_missing(words[i])] for _, words in rows]
    data = [len(row[1]) > 1 and bool(n) and all(map(is_number, n)) for n, row in zip(cells, rows, strict=True)]
    below = data.index(True) if True in data else 0
    if below < 2 or len(columns) < 2:
        return ""
    count = len(rows[below - 1][1])
    units = sum(find_unit(word) is not None for word in filter(None, rows[below - 1][1]))
    header = below - (2 if len(rows[below - 2][1]) == count < 2 * units else 1)
    named = len(cells[header]) == len(columns) and not any(map(is_number, cells[header]))
    if header < 1 or not named or not all(map(is_number, chain(*cells[below:]))):
        return ""
    return f"the header seems to be in line {rows[header][0]}: delete the lines above it"


def _next_row(rows: Iterator[Row]) -> Row | None:
    """Return the next row that is no comment."""
    return next((row for row in rows if not _is_comment(row[1])), None)


def _is_comment(words: Sequence[str]) -> bool:
    marked = not words or _COMMENT.match(words[0])
    return bool(marked) and not (words and (_MARKED_NUMBER.match(" ".join(words)) or is_missing(words[0])))


def _rows(lines: Sequence[str], start: int, separator: str, where: str) -> Iterator[Row]:
    """Split lines into rows of words, without those that are empty."""
    source: Iterator[str] = islice(lines, start, None)
    if separator == " ":
        source, separator = (_BLANKS.sub(lambda m: m[1] or "\t", line.strip()) for line in source), "\t"
    reader = csv.reader(source, delimiter=separator, skipinitialspace=True, strict=True)
    try:
        for row in reader:
            words = [word.strip() for word in row]
            if any(words):
                yield start + reader.line_num, words
    except csv.Error as broken:
        line = start + reader.line_num
        raise InputError(
            f"{where} is no CSV table (line {line}: {broken}); give a header and one row per line"
        ) from None


def _words(line: str, separator: str) -> list[str]:
    """Split one line into words; it has none if its quotes do not pair."""
    try:
        return next(_rows([line], 0, separator, ""), (0, []))[1]
    except InputError:
        return []


def _separator(lines: Sequence[str], where: str) -> str:
    """Find what separates the columns."""
    counts = {}
    for mark in _SEPARATORS:
        try:
            counts[mark] = [len(words) for _, words in islice(_rows(lines, 0, mark, where), 2)] or [0]
        except InputError:  # quotes that end within a cell: another separator
            continue
        if counts[mark][0] > 1 and counts[mark][0] == counts[mark][-1] and len(counts[mark]) == 2:
            return mark
    most = max(counts, key=lambda mark: counts[mark][0], default=" ")
    return most if most != " " and counts[most][0] > 1 else " "


def _are_units(words: Sequence[str]) -> bool:
    """Say whether words are units, apart from empty ones."""
    given = [word for word in words if word]
    return bool(given) and all(find_unit(word) is not None and not is_number(word) for word in given)


def _with_unit(name: str, unit: str) -> str:
    """Write the unit of a column behind its name."""
    return f"{name} [{unit.strip('[]()')}]" if unit else name


def _commented_names(lines: Sequence[str], count: int, separator: str) -> list[str] | None:
    """Take names from the last comment, if it has one for each column and no number."""
    line = next((line for line in reversed(lines) if line.strip()), "").strip().lstrip("#%").strip()
    for mark in (separator, *_SEPARATORS, " "):
        words = _words(line, mark)
        if len(words) == count and not any(map(is_number, words)):
            return words
    return None


def _check_names(names: Sequence[str], where: str) -> None:
    """Refuse a name that stands above two columns."""
    for name, following in pairwise(sorted(filter(None, names))):
        if name == following:
            raise InputError(f"{where} has two columns {name!r}; rename or drop one")
