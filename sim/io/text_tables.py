"""Tables as text: comma, semicolon, tab or blanks between columns; comment lines; quotes as in CSV.

The text of a camera, a spreadsheet or an oscilloscope does not say how it is written. Its first lines show it:

- Encoding: UTF-8, UTF-16 with a byte order mark, otherwise Windows-1252, which contains the letters of Latin-1.
- Lines above the names that begin with # or % are comments. So are those between the names and the first row,
  unless a number follows the mark or the first cell is a missing value (#N/A). If the columns have no names, and
  the last comment above them has as many words as there are columns, these are the names (as `numpy.savetxt`
  writes them).
- The separator is the first of semicolon, tab and comma that splits the first two rows into equally many cells,
  two or more; otherwise that which splits the first row into most; without any of them, blanks.
- A second row of nothing but units belongs to the names: x above mm is the column "x [mm]".
- `sim.io.number_words` says what numbers and missing values are.

Empty lines are left out. The index of the table has the line of each row in the file. A text that can be read in
two ways is refused.
"""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import chain, islice, zip_longest

import pandas as pd

from sim.io.errors import InputError
from sim.io.number_words import check_marks, is_missing, is_number, plain_text, values_of
from sim.io.reading import decode
from sim.io.units import find_unit

LINE = "line"  # name of the index
_COMMENT = re.compile(r"\s*[#%]")
_MARKED_NUMBER = re.compile(r"\s*[#%]+\s*[+-]?[.,]?[0-9]")
_BLANKS = re.compile(r'("(?:[^"]|"")*")|\s+')
_SEPARATORS = (";", "\t", ",")
_MOST_COLUMNS = 10_000

Row = tuple[int, list[str]]  # the number of a line, and its words


def parse_table(data: bytes, where: str, *, names: bool = True) -> pd.DataFrame:
    """Parse a table of any of these forms.

    Args:
        data: content of the file.
        where: its name, for messages.
        names: the columns must have names; without, a table of numbers alone has the columns 0, 1, …

    Raises:
        InputError: the text is no table, or can be read in two ways.
    """
    text = _decoded(data, where).replace("\r\n", "\n").replace("\r", "\n")
    return parse_lines(text.split("\n"), where, names=names)


def parse_lines(
    lines: Sequence[str], where: str, *, names: bool = True, separator: str | None = None
) -> pd.DataFrame:
    """Parse the lines of a table, see `parse_table`; without a separator it is found out."""
    top = next((i for i, line in enumerate(lines) if line.strip() and not _COMMENT.match(line)), None)
    if top is None:
        raise InputError(f"{where} is empty; give a table with one row per line")
    separator = separator or _separator(lines[top:], where)
    columns, rows = _header(lines, top, separator, where)
    if columns is None and names:
        raise InputError(f"{where} has no names of columns; write them into its first line")
    content = list(rows)
    if not content:
        raise InputError(f"{where} has no rows; give at least one below the header")
    width = len(content[0][1]) if columns is None else len(columns)
    long = next((line for line, words in content if any(words[width:])), None)
    if long is not None:
        raise InputError(
            f"{where}: line {long} has more values than columns; if numbers have decimal commas, separate columns "
            "by semicolons"
        )
    named = max((i + 1 for i, name in enumerate(columns or ()) if name), default=0)
    longest = max(len(words) for _, words in content)
    if longest < named:
        raise InputError(
            f"{where}: all rows have fewer values ({longest}) than there are columns ({named}); correct the names"
        )
    cells = list(zip_longest(*(words[:width] for _, words in content), fillvalue=""))
    check_marks(cells, where, separator)
    titles = range(width) if columns is None else columns
    table = {
        f"column {i + 1}" if title == "" else title: values_of(words)
        for i, (title, words) in enumerate(zip(titles, cells, strict=False))
        if title != "" or any(words)
    }
    return pd.DataFrame(table, index=pd.Index([line for line, _ in content], name=LINE))


def row_name(table: pd.DataFrame, row: int) -> str:
    """Name a row, from 0, by its number from 1 and by its line in the file if it has one: "row 5 (line 6)"."""
    return f"row {row + 1}" + (f" (line {table.index[row]})" if table.index.name == LINE else "")


def _header(lines: Sequence[str], top: int, separator: str, where: str) -> tuple[list[str] | None, Iterator[Row]]:
    """Return the names of the columns, if there are any, and the rows below them."""
    rows = _rows(lines, top, separator, where)
    first = next(rows)
    words = first[1]
    if len(words) > _MOST_COLUMNS:
        raise InputError(f"{where} has more than {_MOST_COLUMNS} columns; give a table with one row per line")
    numbers = any(map(is_number, words))
    names = _commented_names(lines[:top], len(words), separator)
    if all(is_number(word) or is_missing(word) for word in words) or (names and numbers):
        if names is None:  # what looked like comments may be rows
            start = next(
                (i for i, line in enumerate(lines[:top]) if not _is_comment(_words(line, separator))), top
            )
            return None, _rows(lines, start, separator, where)
        check_names(names, where)
        return names, chain([first], rows)
    check_names(words, where)
    second = _next_row(rows)
    if second and len(second[1]) == len(words) and are_units(second[1]):
        words = [with_unit(name, unit) for name, unit in zip(words, second[1], strict=True)]
        second = _next_row(rows)
    return [plain_text(word) for word in words], chain([second] if second else [], rows)


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
            counts[mark] = [len(words) for _, words in islice(_rows(lines, 0, mark, where), 2)]
        except InputError:  # quotes that end within a cell: another separator
            continue
        if counts[mark][0] > 1 and counts[mark][0] == counts[mark][-1] and len(counts[mark]) == 2:
            return mark
    most = max(counts, key=lambda mark: counts[mark][0], default=" ")
    return most if most != " " and counts[most][0] > 1 else " "


def are_units(words: Sequence[str]) -> bool:
    """Say whether words are units, apart from empty ones."""
    given = [word for word in words if word]
    return bool(given) and all(find_unit(word) is not None and not is_number(word) for word in given)


def with_unit(name: str, unit: str) -> str:
    """Write the unit of a column behind its name."""
    return f"{name} [{unit.strip('[]()')}]" if unit else name


def _decoded(data: bytes, where: str) -> str:
    try:
        text = decode(data)
    except UnicodeDecodeError:
        try:
            text = data.decode("cp1252")
        except UnicodeDecodeError:
            raise InputError(f"{where} is no text in UTF-8, UTF-16 or Latin-1") from None
    if "\0" in text:
        raise InputError(f"{where} is no text; give a table as text, .xlsx or .parquet")
    return text


def _commented_names(lines: Sequence[str], count: int, separator: str) -> list[str] | None:
    """Take names from the last comment, if it has one for each column and no number."""
    line = next((line for line in reversed(lines) if line.strip()), "").strip().lstrip("#%").strip()
    for mark in (separator, *_SEPARATORS, " "):
        words = _words(line, mark)
        if len(words) == count and not any(map(is_number, words)):
            return words
    return None


def check_names(names: Sequence[str], where: str) -> None:
    """Refuse a name that stands above two columns."""
    for name, times in Counter(filter(None, names)).items():
        if times > 1:
            raise InputError(f"{where} has two columns {name!r}; rename or drop one")
