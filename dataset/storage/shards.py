"""Pieces: Parquet files that each hold a run of consecutive rows of a design.

A piece is named by its rows, rows-<first>-<end>.parquet (end exclusive), and carries the key of what made it:
inputs, settings, code. So its name and key say what must be in it. Every page has a checksum. Small pieces are
joined to pieces of SEGMENT rows; the bytes of a joined piece depend on its rows alone.

Encodings are what was smallest (`python -m benchmarks data_sets`): numbers split into streams of bytes, then zstd;
a dictionary only for words.
"""

from __future__ import annotations

import hashlib
import re
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from dataset.rows.schema import COST
from dataset.storage.storage import Place

SEGMENT = 2**20  # rows of a joined piece
ROW_GROUP = 2**16  # rows that are read at once
_NAME = re.compile(r"^rows-(\d{10})-(\d{10})\.parquet$")
KEY = b"key"


class Piece(NamedTuple):
    """Rows start … stop − 1 in a file."""

    name: str  # with its folder
    start: int
    stop: int


class Contents(NamedTuple):
    """What a piece holds, for the manifest."""

    start: int
    stop: int
    bytes: int
    sha256: str
    converged: int
    failed: int
    touching: int
    reasons: dict[str, int]  # rows that failed, by reason
    cost_s: float


class BadPieceError(ValueError):
    """A file that is not what its name says; the message says in what."""


def piece_name(folder: str, start: int, stop: int) -> str:
    return f"{folder}/rows-{start:010d}-{stop:010d}.parquet"


def pieces(place: Place, folder: str) -> list[Piece]:
    """Files of a folder that are named as pieces, in the order of their rows."""
    found = [(name, _NAME.match(name)) for name in place.names(folder)]
    named = [Piece(f"{folder}/{name}", int(m[1]), int(m[2])) for name, m in found if m]
    return sorted(named, key=lambda piece: (piece.start, -piece.stop))


def write_piece(place: Place, name: str, table: pa.Table, key: str) -> Contents:
    """Write one table as a piece."""
    return _write(place, name, [table], table.schema, key)


def join(place: Place, sources: Sequence[Piece], name: str, form: pa.Schema, key: str) -> Contents:
    """Write a piece with the rows of consecutive pieces."""
    return _write(place, name, _regrouped(_tables(place, sources, form, key), ROW_GROUP), form, key)


def key_in(place: Place, name: str) -> str | None:
    """The key that a file carries; None where it is no piece."""
    try:
        found = pq.read_schema(pa.BufferReader(place.read(name))).metadata or {}
        return bytes(found[KEY]).decode()
    except (pa.ArrowException, OSError, ValueError, KeyError):
        return None


def contents_of(
    place: Place, piece: Piece, form: pa.Schema, key: str, indices: Callable[[int, int], Any] = np.arange
) -> Contents:
    """What is in a piece; every page of it is read and checked.

    Args:
        indices: the column `row` of the rows start … stop − 1.

    Raises:
        BadPieceError: the file is damaged, or holds something else.
    """
    data = place.read(piece.name)
    count, start = _Count(), piece.start
    for table in tables(data, piece, form, key):
        rows = plain(table["row"])
        if not np.array_equal(rows, indices(start, start + len(rows))):
            raise BadPieceError("its rows are not those of its name")
        start += len(rows)
        count.add(table)
    if start != piece.stop:
        raise BadPieceError("it has too few rows")
    return count.contents(piece.start, piece.stop, data.size, hashlib.sha256(data).hexdigest())


def tables(
    data: pa.Buffer, piece: Piece, form: pa.Schema, key: str, columns: Sequence[str] | None = None
) -> Iterator[pa.Table]:
    """The row groups of a piece, pages checked.

    Raises:
        BadPieceError: the file is damaged, or holds something else.
    """
    try:
        file = pq.ParquetFile(pa.BufferReader(data), page_checksum_verification=True)
        found = file.schema_arrow
        if (found.metadata or {}).get(KEY, b"").decode(errors="replace") != key:
            raise BadPieceError("it is of another configuration or version")
        if not found.remove_metadata().equals(form.remove_metadata()):
            raise BadPieceError("it does not have this version's columns")
        if file.metadata.num_rows != piece.stop - piece.start:
            raise BadPieceError("its number of rows is not that of its name")
        for group in range(file.num_row_groups):
            yield file.read_row_group(group, columns=columns, use_threads=False)
    except (pa.ArrowException, OSError, ValueError) as broken:
        if isinstance(broken, BadPieceError):
            raise
        raise BadPieceError(f"it is damaged ({str(broken).splitlines()[0]})") from None


def plain(column: pa.Array | pa.ChunkedArray) -> np.ndarray:
    """A column of numbers, flags or words, none of them null; pyarrow's own `to_numpy` would load pandas."""
    array = column.combine_chunks() if isinstance(column, pa.ChunkedArray) else column
    if isinstance(array, pa.ChunkedArray):  # without rows
        return np.empty(0)
    if pa.types.is_boolean(array.type):
        bits = np.unpackbits(np.frombuffer(array.buffers()[1], np.uint8), bitorder="little")
        return bits[array.offset : array.offset + len(array)].view(bool)
    if pa.types.is_string(array.type):
        return np.array(array.to_pylist(), dtype=object)
    return np.from_dlpack(array)


def _tables(place: Place, sources: Sequence[Piece], form: pa.Schema, key: str) -> Iterator[pa.Table]:
    for piece in sources:
        yield from tables(place.read(piece.name), piece, form, key)


def _regrouped(parts: Iterator[pa.Table], rows: int) -> Iterator[pa.Table]:
    """The same rows in tables of `rows` rows, the last one shorter."""
    held: list[pa.Table] = []
    size = 0
    for part in parts:
        held.append(part)
        size += len(part)
        while size >= rows:
            whole = pa.concat_tables(held)
            yield whole.slice(0, rows)
            held, size = [whole.slice(rows)], size - rows
    if size:
        yield pa.concat_tables(held)


def _write(place: Place, name: str, parts: Any, form: pa.Schema, key: str) -> Contents:
    match = _NAME.match(name.rsplit("/", 1)[-1])
    assert match
    count, rows = _Count(), 0
    with place.writer(name) as sink:
        with pq.ParquetWriter(
            pa.PythonFile(sink, "w"),
            form.with_metadata({KEY: key}),
            compression="zstd",
            write_page_checksum=True,
            **encodings(form),
        ) as writer:
            for part in parts:
                writer.write_table(part.combine_chunks(), row_group_size=ROW_GROUP)
                count.add(part)
                rows += len(part)
        if rows != int(match[2]) - int(match[1]):
            raise BadPieceError("its number of rows is not that of its name")
    return count.contents(int(match[1]), int(match[2]), sink.size, sink.sha256)


def encodings(form: pa.Schema) -> dict[str, Any]:
    """Options of pyarrow's writer: a dictionary for words, numbers split into streams of bytes."""
    words = [field.name for field in form if pa.types.is_string(field.type)]
    numbers = [
        f"{field.name}.list.element" if pa.types.is_fixed_size_list(field.type) else field.name
        for field in form
        if pa.types.is_floating(field.type)
        or (pa.types.is_fixed_size_list(field.type) and pa.types.is_floating(field.type.value_type))
    ]
    return {"use_dictionary": words or False, "use_byte_stream_split": numbers or False}


class _Count:
    """Counts over the tables of a piece."""

    def __init__(self) -> None:
        self._flags = dict.fromkeys(("converged", "failed", "touching"), 0)
        self._reasons: Counter[str] = Counter()
        self._costs: list[np.ndarray] = []

    def add(self, table: pa.Table) -> None:
        """Count a table's rows."""
        for name in self._flags:
            self._flags[name] += int(np.count_nonzero(plain(table[name])))
        failed = plain(table["failed"])
        if failed.any():
            self._reasons.update(plain(table["reason"])[failed].tolist())
        self._costs.append(plain(table[COST]))

    def contents(self, start: int, stop: int, size: int, sha256: str) -> Contents:
        """What has been counted; the costs are added in one go, so that tables may be cut anyhow."""
        costs = np.concatenate(self._costs) if self._costs else np.empty(0)
        total = float(np.sum(costs, dtype=float))
        return Contents(
            start, stop, size, sha256, **self._flags, reasons=dict(sorted(self._reasons.items())), cost_s=total
        )
