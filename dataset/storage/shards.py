"""Shards: Parquet files that each hold a run of consecutive rows of a design.

A shard is named by its rows, rows-<first>-<end>.parquet (end exclusive), and carries the key of what made it:
inputs, settings, code. So its name and key say what must be in it. Every page has a checksum. Small shards are
joined to shards of SEGMENT rows; the bytes of a joined shard depend on its rows alone.

The encodings are the smallest ones of the benchmark `data_sets`: numbers split into streams of bytes, then zstd; a
dictionary only for words.
"""

from __future__ import annotations

import hashlib
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from dataset.rows.schema import COST
from dataset.storage.storage import Storage

SEGMENT = 2**20  # rows of a joined shard
ROW_GROUP = 2**16  # rows that are read at once
_NAME = re.compile(r"^rows-(\d{10})-(\d{10})\.parquet$")
KEY = b"key"


class Shard(NamedTuple):
    """Rows start … stop − 1 in a file."""

    name: str  # with its folder
    start: int
    stop: int


class Contents(NamedTuple):
    """The contents of a shard, for the manifest."""

    start: int
    stop: int
    bytes: int
    sha256: str
    converged: int
    failed: int
    touching: int
    reasons: dict[str, int]  # rows that failed, by reason
    cost_s: float


class BadShardError(ValueError):
    """A file is not what its name says; the message says in what."""


class OtherColumnsError(BadShardError):
    """A shard does not have the columns of this version."""


def shard_name(folder: str, start: int, stop: int) -> str:
    """Name the shard of some rows."""
    return f"{folder}/rows-{start:010d}-{stop:010d}.parquet"


def shards_in(storage: Storage, folder: str) -> list[Shard]:
    """List the files of a folder that are named as shards, in the order of their rows."""
    matches = [(name, _NAME.match(name)) for name in storage.names(folder)]
    shards = [Shard(f"{folder}/{name}", int(m[1]), int(m[2])) for name, m in matches if m]
    return sorted(shards, key=lambda shard: (shard.start, -shard.stop))


def write_shard(storage: Storage, name: str, table: pa.Table, key: str) -> Contents:
    """Write one table as a shard."""
    return _write(storage, name, [table], table.schema, key)


def join(storage: Storage, sources: Sequence[Shard], name: str, form: pa.Schema, key: str) -> Contents:
    """Write a shard with the rows of consecutive shards."""
    return _write(storage, name, _regrouped(_tables(storage, sources, form, key), ROW_GROUP), form, key)


def key_in(storage: Storage, name: str) -> str | None:
    """Return the key that a file carries; None where it is no shard."""
    try:
        metadata = pq.read_schema(pa.BufferReader(storage.read(name))).metadata or {}
        return bytes(metadata[KEY]).decode()
    except (pa.ArrowException, OSError, ValueError, KeyError):
        return None


def check_shard(storage: Storage, shard: Shard, form: pa.Schema, key: str) -> Contents:
    """Read and check every page of a shard; return its contents.

    Raises:
        BadShardError: the file is damaged, or holds something else.
    """
    data = storage.read(shard.name)
    count, start = _Count(), shard.start
    for table in tables(data, shard, form, key):
        if not np.array_equal(plain(table["row"]), np.arange(start, start + len(table))):
            raise BadShardError("its rows are not those of its name")
        start += len(table)
        count.add(table)
    if start != shard.stop:
        raise BadShardError("it has too few rows")
    return count.contents(shard.start, shard.stop, data.size, hashlib.sha256(data).hexdigest())


def tables(
    data: pa.Buffer, shard: Shard, form: pa.Schema, key: str, columns: Sequence[str] | None = None
) -> Iterator[pa.Table]:
    """Yield the row groups of a shard, pages checked.

    Raises:
        BadShardError: the file is damaged, or holds something else.
    """
    try:
        file = pq.ParquetFile(pa.BufferReader(data), page_checksum_verification=True)
        stored = file.schema_arrow
        if (stored.metadata or {}).get(KEY, b"").decode(errors="replace") != key:
            raise BadShardError("it is of another configuration or version")
        if not stored.remove_metadata().equals(form.remove_metadata()):
            raise OtherColumnsError("it does not have this version's columns")
        if file.metadata.num_rows != shard.stop - shard.start:
            raise BadShardError("its number of rows is not that of its name")
        for group in range(file.num_row_groups):
            yield file.read_row_group(group, columns=columns, use_threads=False)
    except (pa.ArrowException, OSError, ValueError) as broken:
        if isinstance(broken, BadShardError):
            raise
        raise BadShardError(f"it is damaged ({str(broken).splitlines()[0]})") from None


def plain(column: pa.Array | pa.ChunkedArray) -> np.ndarray:
    """Convert a column of numbers, flags or strings without nulls; pyarrow's own `to_numpy` would load pandas."""
    array = column.combine_chunks() if isinstance(column, pa.ChunkedArray) else column
    if isinstance(array, pa.ChunkedArray):  # without rows
        return np.empty(0)
    if pa.types.is_boolean(array.type):
        bits = np.unpackbits(np.frombuffer(array.buffers()[1], np.uint8), bitorder="little")
        return bits[array.offset : array.offset + len(array)].view(bool)
    if pa.types.is_string(array.type):
        return np.array(array.to_pylist(), dtype=object)
    return np.from_dlpack(array)


def _tables(storage: Storage, sources: Sequence[Shard], form: pa.Schema, key: str) -> Iterator[pa.Table]:
    """Yield the row groups of several shards."""
    for shard in sources:
        yield from tables(storage.read(shard.name), shard, form, key)


def _regrouped(parts: Iterator[pa.Table], rows: int) -> Iterator[pa.Table]:
    """Yield the same rows in tables of `rows` rows, the last one shorter."""
    pending: list[pa.Table] = []
    size = 0
    for part in parts:
        pending.append(part)
        size += len(part)
        while size >= rows:
            joined = pa.concat_tables(pending)
            yield joined.slice(0, rows)
            pending, size = [joined.slice(rows)], size - rows
    if size:
        yield pa.concat_tables(pending)


def _write(storage: Storage, name: str, parts: Any, form: pa.Schema, key: str) -> Contents:
    """Write tables as one shard."""
    match = _NAME.match(name.rsplit("/", 1)[-1])
    assert match
    count, rows = _Count(), 0
    with storage.writer(name) as sink:
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
            raise BadShardError("its number of rows is not that of its name")
    return count.contents(int(match[1]), int(match[2]), sink.size, sink.sha256)


def encodings(form: pa.Schema) -> dict[str, Any]:
    """Return options of pyarrow's writer: a dictionary for strings, numbers split into streams of bytes."""
    strings = [field.name for field in form if pa.types.is_string(field.type)]
    numbers = [
        f"{field.name}.list.element" if pa.types.is_fixed_size_list(field.type) else field.name
        for field in form
        if pa.types.is_floating(field.type)
        or (pa.types.is_fixed_size_list(field.type) and pa.types.is_floating(field.type.value_type))
    ]
    return {"use_dictionary": strings or False, "use_byte_stream_split": numbers or False}


class _Count:
    """Running counts over the tables of a shard."""

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
        """Sum up; the costs are added in one go, so that the result does not depend on how tables are cut."""
        costs = np.concatenate(self._costs) if self._costs else np.empty(0)
        total = float(np.sum(costs, dtype=float))
        return Contents(
            start, stop, size, sha256, **self._flags, reasons=dict(sorted(self._reasons.items())), cost_s=total
        )
