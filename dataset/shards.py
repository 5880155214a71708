"""Files of rows: Parquet files that each hold consecutive rows of a design.

A file is named by its rows, rows-<first>-<end>.parquet (end exclusive), and carries the key of what made it:
inputs, settings, code. So name and key say what must be in it. Every page has a checksum. The encodings are the
smallest ones of the benchmark `data_sets`: numbers split into streams of bytes, then zstd; a dictionary only for
words.
"""

from __future__ import annotations

import hashlib
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from dataset.schema import COST

ROWS = "rows"  # the folder that holds these files, and nothing else
_NAME = re.compile(r"rows-(\d{10})-(\d{10})\.parquet")
_KEY = b"key"


class Part(NamedTuple):
    """What a file of rows holds, for the manifest."""

    start: int
    stop: int
    bytes: int
    sha256: str
    converged: int
    failed: int
    touching: int
    reasons: dict[str, int]  # rows that failed, by reason
    cost_s: float

    @property
    def name(self) -> str:
        """The file's name, with its folder."""
        return file_name(self.start, self.stop)


class BadFileError(ValueError):
    """A file is not what its name says; the message says in what."""


def file_name(start: int, stop: int) -> str:
    """Name the file of some rows, with its folder."""
    return f"{ROWS}/rows-{start:010d}-{stop:010d}.parquet"


def rows_named(name: str) -> tuple[int, int] | None:
    """Return the rows that a file's name states, first and end; None where it is no such name."""
    match = _NAME.fullmatch(name.rsplit("/", 1)[-1])
    return (int(match[1]), int(match[2])) if match and match[1] < match[2] else None


def packed(table: pa.Table, key: str) -> bytes:
    """Return rows as the bytes of a file."""
    numbers, words = [], []
    for field in table.schema:
        is_list = pa.types.is_fixed_size_list(field.type)
        if pa.types.is_floating(field.type.value_type if is_list else field.type):
            numbers.append(f"{field.name}.list.element" if is_list else field.name)
        elif pa.types.is_string(field.type):
            words.append(field.name)
    sink = pa.BufferOutputStream()
    settings = {"compression": "zstd", "use_dictionary": words, "use_byte_stream_split": numbers}
    pq.write_table(table.replace_schema_metadata({_KEY: key}), sink, write_page_checksum=True, **settings)
    return bytes(sink.getvalue())


def checked_part(data: bytes, start: int, stop: int, form: pa.Schema, key: str) -> Part:
    """Check every page of a file with the rows start … stop − 1; return what it holds.

    Raises:
        BadFileError: the file is damaged, or holds something else.
    """
    table = pa.Table.from_batches(record_batches(data, stop - start, form, key, rows=2**20), form)
    if table["row"].to_pylist() != list(range(start, stop)):
        raise BadFileError("its rows are not those of its name")
    counts = {name: pc.sum(table[name]).as_py() for name in ("converged", "failed", "touching")}
    reasons = Counter(table["reason"].filter(table["failed"]).to_pylist())
    cost = pc.sum(table[COST].cast(pa.float64())).as_py()
    sha256 = hashlib.sha256(data).hexdigest()
    return Part(start, stop, len(data), sha256, **counts, reasons=dict(sorted(reasons.items())), cost_s=cost)


def record_batches(
    data: bytes, count: int, form: pa.Schema, key: str, columns: Sequence[str] | None = None, *, rows: int
) -> Iterator[pa.RecordBatch]:
    """Yield `count` rows of a file, at most `rows` at a time, pages checked.

    Args:
        data: the file.
        count: how many rows it must have.
        form: the schema that it must have.
        key: the key that it must carry.
        columns: names; default all.
        rows: most rows of a batch.

    Raises:
        BadFileError: the file is damaged, or holds something else.
    """
    try:
        file = pq.ParquetFile(pa.BufferReader(data), page_checksum_verification=True)
        stored = file.schema_arrow
        if (stored.metadata or {}).get(_KEY) != key.encode():
            raise BadFileError("it is of another configuration or version")
        if not stored.remove_metadata().equals(form.remove_metadata()):
            raise BadFileError("it does not have this version's columns")
        if file.metadata.num_rows != count:
            raise BadFileError("its number of rows is not that of its name")
        names = form.names if columns is None else list(columns)
        yield from (b.select(names) for b in file.iter_batches(rows, columns=names, use_threads=False))
    except BadFileError:
        raise
    except (pa.ArrowException, OSError, ValueError) as broken:
        raise BadFileError(f"it is damaged ({(str(broken) or 'unreadable').splitlines()[0]})") from None


def carries_key(data: bytes, key: str) -> bool:
    """Whether a file, of whatever name, holds rows of this key."""
    try:
        return (pq.read_schema(pa.BufferReader(data)).metadata or {}).get(_KEY) == key.encode()
    except (pa.ArrowException, OSError, ValueError):
        return False
