"""Build a data set: simulate a design in chunks, on this machine or a cluster, into a folder.

The folder is the journal. A chunk's rows are written whole, under a name that says which rows they are; what is
there is checked and kept, and what is missing is simulated. So more rows of the same design only add chunks, and
an interruption loses the chunks under way. In the end the manifest lists all files.
"""

from __future__ import annotations

import hashlib
import json
import math
import signal
import threading
import time
from bisect import bisect
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from itertools import pairwise
from pathlib import Path
from shlex import quote
from types import FrameType
from typing import Any, cast

from common.errors import InputError
from common.progress import progress_bar
from dataset.card import write_card
from dataset.clusters import check_backend, open_backend
from dataset.data_set import (
    CARD,
    MANIFEST,
    SWEEP,
    check_version,
    read_design,
    read_manifest,
    sweep_key,
    write_manifest,
)
from dataset.design import SweepDesign
from dataset.folder import UNFINISHED, Folder
from dataset.schema import rows_version, schema
from dataset.shards import ROWS, BadFileError, Part, carries_key, checked_part, rows_named
from dataset.workers import Backend, Chunk, Simulate, compile_on_this_host

KILLS = 3  # dead workers after which a chunk is set aside
PATIENCE = 60.0  # seconds without any worker
_POLL = 0.2  # seconds
_CHUNKS = 4  # of a worker, at least
_MAX_ROWS, _FILES = 1024, 4096  # rows of a chunk, unless the data set then has more files than the second number
_STANDARD = "dataset.simulate.simulate"  # in the key of every row and in sweep.json: part of the format


class UnfinishedError(InputError):
    """A build ended before all rows were stored; the message is one line."""

    status = 1


class Interrupted(KeyboardInterrupt):
    """The user, or the system, ends the build; the message is one line."""

    def __init__(self, number: int, message: str):
        self.status = 128 + number
        super().__init__(message)


def build(
    design: SweepDesign, folder: str | Path, *, jobs: int | None = None, backend: str = "local",
    address: str | None = None, title: str = "sweep", resume: str = "run the same build again",
    simulate: Simulate | None = None, force: bool = False,
) -> dict[str, Any]:  # fmt: skip
    """Simulate a design into a folder and return its manifest; a build that stopped continues.

    Args:
        design: which robots.
        folder: a folder, or a URL that fsspec knows.
        jobs: processes on this machine; default all processors.
        backend: "local" or "dask"; the latter may have the `address` of a scheduler.
        title: of the progress line; empty for none.
        resume: what the last line of an interrupted build tells the user to do.
        simulate: makes the rows; default `dataset.simulate.simulate`. Workers must be able to import it.
        force: take over a folder behind a URL that another build has claimed.

    Raises:
        InputError: the folder holds something else or refuses, another process writes there, no such back end.
        UnfinishedError: some chunks were set aside, or there were no workers.
    """
    check_backend(backend, jobs)
    work = _Build(design, Folder(folder), simulate, title, resume)
    with _interruptible(work.last_words), work.folder.locked(force=force):
        return work.run(lambda: open_backend(backend, jobs, address))


def mend(
    folder: str | Path, *, jobs: int | None = None, title: str = "mend", simulate: Simulate | None = None,
    force: bool = False,
) -> str:  # fmt: skip
    """Remove damaged and duplicate files, simulate missing rows, write the manifest anew; return a line on it.

    Arguments are those of `build`; `simulate` made the rows. The folder only has its name, and no function is
    imported because a file names it.

    Raises:
        InputError: no data set there, or its rows were made by another version of the code or another function.
        UnfinishedError: as for `build`.
    """
    there = Folder(folder)
    sweep, design = read_design(there)
    check_version(there, sweep["code"])
    if sweep["rows_by"] != _source(simulate):
        raise InputError(
            f"{there.address}: its rows were made by {sweep['rows_by']!r}, not by {_source(simulate)!r}; if you "
            "trust that function, name it: softflagella dataset verify … --mend --rows-by MODULE.FUNCTION"
        )
    words = f"softflagella dataset verify {quote(there.address)} --mend"
    work = _Build(design, there, simulate, title, words, mending=True)
    with _interruptible(work.last_words), there.locked(force=force):
        before = there.read(MANIFEST) if MANIFEST in there.names() else b""
        manifest = work.run(lambda: open_backend("local", jobs, None))
        kept = there.read(MANIFEST) == before
    simulated = f"{work.simulated or 'no'} row{'s' * (work.simulated > 1)} simulated again"
    return f"{manifest['rows']} rows are whole: {simulated}, manifest {'kept' if kept else 'written anew'}"


class _Build:
    """One build of a sweep into its folder; only the holder of the folder's lock runs it."""

    def __init__(
        self, design: SweepDesign, folder: Folder, simulate: Simulate | None, title: str, resume: str,
        mending: bool = False,
    ):  # fmt: skip
        self.folder, self.simulated = folder, 0
        self._sweep: dict[str, Any]
        self._design, self._simulate, self._mending = design, simulate, mending
        self._title, self._resume = title, resume
        code, source = rows_version(), _source(simulate)
        self._key = sweep_key(design.config(), code, source)
        self._sweep = {"config": design.config(), "code": code, "rows_by": source, "key": self._key}
        self._form = schema(design.effects, design.sensitivities)
        self._parts: list[Part] = []
        self._rows = 0  # of the whole; 0 until that is known

    def last_words(self, why: str = "stopped") -> str:
        """Say how far the build is, and how to continue."""
        done = f"{_size(self._parts)} of {self._rows} rows are stored in {self.folder.address}; "
        return f"{why}: {done if self._rows else ''}go on with: {self._resume}"

    def run(self, workers: Callable[[], Backend]) -> dict[str, Any]:
        """Simulate what is missing and publish; the workers start only if something is missing."""
        self._claim()
        listed = self._listed()
        self._parts = self._checked(listed)
        begun = self._sweep.get("grid", [0, 0])[1] if self._mending and not listed else 0
        self._rows = max([self._design.rows, begun, *(part.stop for part in listed.values())])
        gaps = missing(self._parts, self._rows)
        if gaps:
            if self._simulate is None:
                compile_on_this_host()
            backend = workers()
            try:
                self._fill(gaps, backend)
            finally:
                backend.stop()
        return self._publish()

    def _fill(self, gaps: Sequence[tuple[int, int]], backend: Backend) -> None:
        """Simulate the rows of gaps, in chunks."""
        grid = [chunk_rows(self._rows, sum(stop - start for start, stop in gaps), backend.slots()), self._rows]
        if self._sweep.get("grid") != grid:  # workers that a dead build has left see it, and write nothing
            self._sweep["grid"] = grid
            self._write_sweep()
        sweep, address = self._sweep, self.folder.address
        known = (address, sweep["config"], self._key, sweep["code"], grid, self._simulate)
        chunks = [Chunk(*known, start, stop) for start, stop in cut(gaps, grid[0])]
        done, hidden = _size(self._parts), not self._title
        with progress_bar(
            self._title, total=self._rows, initial=done, unit="row", smoothing=0.0, disable=hidden
        ) as bar:
            try:
                for part in run(chunks, backend, bar.set_postfix_str):
                    self._parts.append(part)
                    self.simulated += _size([part])
                    bar.set_postfix_str(f"{sum(part.failed for part in self._parts)} failed", refresh=False)
                    bar.update(_size([part]))
            except UnfinishedError as end:
                raise UnfinishedError(self.last_words(str(end))) from None

    def _write_sweep(self) -> None:
        self.folder.write(SWEEP, (json.dumps(self._sweep, indent=1) + "\n").encode())

    def _claim(self) -> None:
        """Write what the folder is for, unless that is written already; refuse one that holds something else."""
        address, names = self.folder.address, [name for name in self.folder.names() if not name.startswith(".")]
        if SWEEP in names:
            sweep, _ = read_design(self.folder)
            if sweep["key"] != self._key:
                check_version(self.folder, sweep["code"])
                raise InputError(
                    f"{address} holds rows of another configuration: {_difference(sweep, self._sweep)}; give "
                    "another folder or remove this one"
                )
            self._sweep = sweep
        for name in names:
            if SWEEP not in names or name not in {MANIFEST, SWEEP, CARD, ROWS}:
                raise InputError(f"{address} holds other files ({name}); give an empty or a new folder")
        for name in [f"{ROWS}/{name}" for name in self.folder.names(ROWS)]:  # readers take all for rows
            if rows_named(name) is None:
                if not carries_key(self.folder.read(name), self._key):
                    raise InputError(f"{address}/{name} is no part of the data set; move it elsewhere")
                self.folder.delete(name)  # a copy of one of our files
        if SWEEP not in names:
            self._write_sweep()

    def _listed(self) -> dict[str, Part]:
        """Return the files that the manifest lists, by name; while mending, none where it is damaged."""
        try:
            manifest = read_manifest(self.folder.address)
        except InputError:
            if self._mending or MANIFEST not in self.folder.names():
                return {}
            raise
        parts = [Part(**part) for part in manifest["parts"]]
        return {part.name: part for part in parts} if manifest["config_hash"] == self._key else {}

    def _checked(self, listed: dict[str, Part]) -> list[Part]:
        """Read and check all files of rows; return whole ones that together hold each row at most once.

        Files that are damaged, or not as the manifest lists them, are removed, and so are those whose rows are in
        another file.
        """
        whole: list[Part] = []
        for name in [f"{ROWS}/{name}" for name in self.folder.names(ROWS)]:
            data, (start, stop) = self.folder.read(name), cast(tuple[int, int], rows_named(name))
            try:
                part = listed.get(name) or checked_part(data, start, stop, self._form, self._key)
                if hashlib.sha256(data).hexdigest() != part.sha256:
                    raise BadFileError("it does not have the digest that the manifest states")
                whole.append(part)
            except BadFileError:
                self.folder.delete(name)
        kept: list[Part] = []
        for part in sorted(whole, key=lambda part: (part.name not in listed, part.start, -part.stop)):
            at = bisect(kept, part)
            if any(one.start < part.stop and part.start < one.stop for one in kept[max(at - 1, 0) : at + 1]):
                self.folder.delete(part.name)
            else:
                kept.insert(at, part)
        return kept

    def _publish(self) -> dict[str, Any]:
        """Write manifest and card, unless they say the same already, and remove what interrupted writers left."""
        parts = sorted(part for part in self._parts if part.start < self._rows)
        if parts == list(self._listed().values()):
            manifest = read_manifest(self.folder.address)
        else:
            manifest = write_manifest(self.folder, self._design, self._key, self._sweep["code"], parts)
        for name in self.folder.names():
            if name.startswith(UNFINISHED):
                self.folder.delete(name)
        if CARD not in self.folder.names() or manifest["digest"].encode() not in self.folder.read(CARD):
            write_card(self.folder)
        return manifest


def chunk_rows(rows: int, missing: int, workers: int) -> int:
    """Return the rows of a chunk: some chunks for each worker; of many rows few files, as the head lists each.

    Args:
        rows: of the data set.
        missing: rows that are to be simulated.
        workers: that simulate at once.
    """
    return min(max(_MAX_ROWS, math.ceil(rows / _FILES)), math.ceil(missing / (_CHUNKS * max(workers, 1))))


def run(chunks: Sequence[Chunk], backend: Backend, show: Callable[[str], object]) -> Iterator[Part]:
    """Run all chunks; yield what is stored as soon as it is. `show` is told in words when there are no workers.

    A chunk whose worker dies is tried again. One that kills KILLS workers, or whose rows raise an error, is set
    aside while the others go on.

    Raises:
        UnfinishedError: some chunks were set aside; raised when all others are done. Or there are no workers for
            PATIENCE seconds.
        InputError: the storage refuses, or a worker has another version of the code.
    """
    waiting, under_way, kills, aside = deque(chunks), 0, Counter[int](), list[str]()
    last_seen, told = time.monotonic(), False
    while waiting or under_way:
        slots = backend.slots()
        if slots:
            last_seen, told = time.monotonic(), False
        elif not told:
            show("waiting for workers")
            told = True
        elif time.monotonic() - last_seen > PATIENCE:
            raise UnfinishedError(f"no workers for {PATIENCE:.0f} s")
        while waiting and under_way < slots:
            backend.submit(waiting.popleft())
            under_way += 1
        for chunk, outcome in backend.collect(_POLL):
            under_way -= 1
            if isinstance(outcome, Part):
                yield outcome
                continue
            if outcome.kind == "refused":
                raise InputError(outcome.message)
            # A death may be the machine's fault, an error is the row's: it would come again.
            kills[chunk.start] += outcome.kind == "died"
            if outcome.kind == "error" or kills[chunk.start] == KILLS:
                reason = outcome.message or f"its worker died {KILLS} times"
                aside.append(f"rows {chunk.start} to {chunk.stop - 1} ({reason})")
            else:
                waiting.appendleft(chunk)
    if aside:
        raise UnfinishedError(f"skipped: {', '.join(aside)}")


def _size(parts: Sequence[Part]) -> int:
    return sum(part.stop - part.start for part in parts)


def missing(parts: Sequence[Part], rows: int) -> list[tuple[int, int]]:
    """List runs of rows below `rows` that no file holds, in order; ends are exclusive."""
    ends = [(0, 0), *((part.start, part.stop) for part in parts), (rows, rows)]
    return [(stop, min(start, rows)) for (_, stop), (start, _) in pairwise(ends) if stop < min(start, rows)]


def cut(gaps: Sequence[tuple[int, int]], size: int) -> Iterator[tuple[int, int]]:
    """Cut runs of rows at the multiples of a size."""
    for start, stop in gaps:
        yield from pairwise([start, *range((start // size + 1) * size, stop, size), stop])


def _source(simulate: Simulate | None) -> str:
    """Return the name of the function that makes the rows, as in sweep.json."""
    return f"{simulate.__module__}.{simulate.__qualname__}" if simulate else _STANDARD


def imported_function(name: str) -> Simulate:
    """Import a function that the user names, as MODULE.FUNCTION.

    Raises:
        InputError: there is none.
    """
    module, _, function = name.rpartition(".")
    try:
        return cast(Simulate, getattr(import_module(module), function))
    except (ImportError, AttributeError, ValueError) as absent:
        raise InputError(f"no function {name!r} ({absent}); give MODULE.FUNCTION, importable from here") from None


def _difference(theirs: dict[str, Any], ours: dict[str, Any]) -> str:
    """Say in what two sweeps differ first: a setting, a number of the robot, an input."""
    there, here = ({**{"robot": {}, **sweep["config"]}, "made by": sweep["rows_by"]} for sweep in (theirs, ours))
    for sweep in (there, here):
        sweep.update({**sweep.pop("robot"), **sweep.pop("inputs")})
    name = next(name for name in {**there, **here} if there.get(name) != here.get(name))
    return f"{name} {there.get(name, 'missing')} there, {here.get(name, 'missing')} here"


@contextmanager
def _interruptible(last_words: Callable[[], str]) -> Iterator[None]:
    """Turn the first SIGINT or SIGTERM inside into `Interrupted`; a second one ends the process at once.

    Outside the main thread, where Python handles no signals, this does nothing.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    received: list[int] = []

    def handle(number: int, _: FrameType | None) -> None:
        received.append(number)
        for each in before:
            signal.signal(each, signal.SIG_DFL)
        raise KeyboardInterrupt

    before = {each: signal.signal(each, handle) for each in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    except BaseException:  # whatever libraries have made of the interrupt on its way
        if not received:
            raise
        raise Interrupted(received[0], last_words()) from None
    finally:
        for each, handler in before.items():
            signal.signal(each, handler)
