"""The folder of a data set while it is being built: what it holds, what is missing, and how it is published.

Order of publishing: join pending shards into shards of SEGMENT rows, still pending; move these to rows/; write the
manifest; remove what they replace. Wherever that is interrupted, every row is in some whole shard, and the next
build
continues: it sorts shards by what they hold, not by what a journal says.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

import pyarrow as pa

from dataset.report.data_card import write_card
from dataset.rows.design import SweepDesign, checked_design
from dataset.rows.schema import schema
from dataset.storage.data_set import (
    CARD,
    MANIFEST,
    PENDING,
    ROWS,
    SWEEP,
    check_version,
    manifest_content,
    read_manifest,
    stored_json,
    write_manifest,
)
from dataset.storage.lock import LOCK
from dataset.storage.shards import (
    SEGMENT,
    BadShardError,
    Contents,
    Shard,
    check_shard,
    key_in,
    shard_name,
    shards_in,
)
from dataset.storage.storage import Storage
from dataset.workers.tasks import Join, Task
from sim.io.errors import InputError
from sim.io.provenance import fingerprint

_KNOWN = {MANIFEST, SWEEP, CARD, ROWS, PENDING}
Stored = dict[Shard, Contents]


def sweep_key(config: dict[str, Any], code: str, source: str) -> str:
    """Return the key of the rows of a sweep: a hash of its inputs and of all that makes rows of them."""
    return fingerprint({"config": config, "code": code, "rows_by": source})


class SweepFolder:
    """A storage that holds, or will hold, the rows of one sweep. Only its writer (`lock`) makes one."""

    def __init__(self, storage: Storage, design: SweepDesign, code: str, source: str):
        self.storage, self.code = storage, code
        self.config = design.config()
        self.key = sweep_key(self.config, code, source)
        self._effects = design.effects
        self._form: pa.Schema = schema(design.effects, design.sensitivities)
        self._sweep = {"config": self.config, "code": code, "rows_by": source, "key": self.key}

    def claim(self, *, mending: bool = False) -> None:
        """Write what the folder is for, unless that is written already.

        Raises:
            InputError: the folder holds something else.
        """
        names = [name for name in self.storage.names() if not name.startswith(".")]
        unknown = sorted(set(names) - _KNOWN)
        if any(name.startswith("part-") for name in unknown):
            raise InputError(f"{self.storage.address} holds a data set of an older format; give another folder")
        if unknown or (names and SWEEP not in names and MANIFEST not in names):
            name = (unknown or names)[0]
            raise InputError(f"{self.storage.address} holds other files ({name}); give an empty or a new folder")
        self._check_names()
        if SWEEP in names:
            self._compare(_loaded(self.storage))
        else:
            if MANIFEST in names and not mending and read_manifest(self.storage)["config_hash"] != self.key:
                raise self._refusal("rows of another configuration or version")
            self.storage.write(SWEEP, json.dumps(self._sweep, indent=1) + "\n")

    def _check_names(self) -> None:
        """Reject files in rows/ that a reader would take for rows; a copy of one of our shards is removed."""
        ours = {shard.name for shard in shards_in(self.storage, ROWS)}
        for name in self.storage.names(ROWS):
            path = f"{ROWS}/{name}"
            if path not in ours and not name.startswith("."):
                if key_in(self.storage, path) != self.key:
                    raise InputError(f"{self.storage.path(path)} is no part of the data set; move it elsewhere")
                self.storage.delete(path)

    def _compare(self, stored: dict[str, Any]) -> None:
        """Reject a sweep that is not this one, and say in what it differs."""
        if all(stored[name] == value for name, value in self._sweep.items()):
            return
        check_version(self.storage, stored["code"], self.code)
        _checked(self.storage, stored)
        theirs, ours = stored["config"], self.config
        if theirs["seed"] != ours["seed"]:
            raise self._refusal(f"rows of another configuration: seed {theirs['seed']} there, {ours['seed']} here")
        if theirs.get("robot") != ours.get("robot"):
            raise self._refusal("rows of another robot")
        for name in sorted({*theirs["inputs"], *ours["inputs"]}):
            axes = theirs["inputs"].get(name), ours["inputs"].get(name)
            if axes[0] != axes[1]:
                their_axis, our_axis = map(_describe, axes)
                raise self._refusal(f"rows of another configuration: {name} {their_axis} there, {our_axis} here")
        for name in ("history_every", "sensitivities"):
            if theirs.get(name) != ours[name]:
                raise self._refusal(
                    f"rows of another configuration: {name} = {theirs.get(name)} there, {ours[name]} here"
                )
        raise self._refusal(f"rows that were made by {stored['rows_by']}, not by {self._sweep['rows_by']}")

    def _refusal(self, what: str) -> InputError:
        return InputError(f"{self.storage.address} holds {what}; give another folder or remove this one")

    def finished_rows(self) -> int:
        """Count the rows of the finished data set in the folder, by manifest and file names; 0 without one."""
        if self.storage.size(MANIFEST) is None:
            return 0
        named = max((shard.stop for shard in shards_in(self.storage, ROWS)), default=0)
        try:
            return max(named, int(read_manifest(self.storage)["rows"]))
        except InputError:  # edited or damaged
            return named

    def check_shards(self, *, mending: bool = False) -> Stored:
        """Read and check all shards; return whole ones that together hold each row at most once.

        Damaged shards are removed, and so are those whose rows are in another shard. What the manifest lists must
        be as it lists it.
        """
        listed = self._listed(mending)
        sound: Stored = {}
        for shard in [*shards_in(self.storage, ROWS), *shards_in(self.storage, PENDING)]:
            try:
                contents = check_shard(self.storage, shard, self._form, self.key)
                if contents.sha256 != listed.get(shard.name, contents.sha256):
                    raise BadShardError("it does not have the digest that the manifest states")
            except BadShardError:
                self.storage.delete(shard.name)
            else:
                sound[shard] = contents
        kept: Stored = {}
        end = 0
        for shard in sorted(sound, key=lambda s: (s.start, -s.stop, s.name not in listed)):
            if shard.start >= end:
                kept[shard] = sound[shard]
                end = shard.stop
            elif shard.name not in listed:  # a listed file stays until the manifest no longer lists it
                self.storage.delete(shard.name)
        return kept

    def _listed(self, mending: bool) -> dict[str, str]:
        """Return the digests that the manifest states, by file name."""
        if self.storage.size(MANIFEST) is None:
            return {}
        try:
            manifest = read_manifest(self.storage)
        except InputError:
            if not mending:
                raise
            return {}
        return {shard_name(ROWS, p["start"], p["stop"]): p["sha256"] for p in manifest["parts"]}

    def missing(self, stored: Stored, rows: int) -> list[tuple[int, int]]:
        """List runs of rows below `rows` that no shard holds, cut at the ends of segments."""
        gaps, at = [], 0
        for shard in [*sorted(stored, key=lambda s: s.start), Shard("", rows, rows)]:
            while at < min(shard.start, rows):
                end = min(shard.start, rows, (at // SEGMENT + 1) * SEGMENT)
                gaps.append((at, end))
                at = end
            at = max(at, shard.stop)
        return gaps

    def joins(self, stored: Stored, rows: int) -> list[Join]:
        """List tasks that join all shards of a segment; a shard that reaches beyond `rows` is taken whole."""
        segments: dict[int, list[Shard]] = {}
        for shard in _published(stored, rows):
            segments.setdefault(shard.start // SEGMENT, []).append(shard)
        return [
            Join(self.storage.address, self.config, self.key, self.code, tuple(shards))
            for shards in segments.values()
            if len(shards) > 1
        ]

    def add(self, stored: Stored, task: Task | Join, contents: Contents) -> None:
        """Add the pending shard that a task has written; it replaces the shards that were joined."""
        if isinstance(task, Join):
            for shard in task.sources:
                del stored[shard]
                if shard.name.startswith(PENDING):  # one in rows/ stays until the manifest no longer lists it
                    self.storage.delete(shard.name)
        name = shard_name(PENDING, contents.start, contents.stop)
        stored[Shard(name, contents.start, contents.stop)] = contents

    def publish(self, stored: Stored, rows: int) -> dict[str, Any]:
        """Move the shards of the first `rows` rows to rows/ and write manifest and card; return the manifest."""
        shards = _published(stored, rows)
        for shard in shards:
            if shard.name.startswith(PENDING):
                self.storage.move(shard.name, shard_name(ROWS, shard.start, shard.stop))
        manifest = self._manifest([stored[shard] for shard in shards])
        current = {shard_name(ROWS, shard.start, shard.stop) for shard in shards}
        for shard in shards_in(self.storage, ROWS):
            if shard.name not in current:
                self.storage.delete(shard.name)
        self._tidy()
        if self.storage.size(CARD) is None or manifest["digest"] not in _text(self.storage, CARD):
            write_card(self.storage)
        return manifest

    def _manifest(self, parts: Sequence[Contents]) -> dict[str, Any]:
        """Write the manifest, unless it says the same already."""
        if self.storage.size(MANIFEST) is not None:
            try:
                manifest = read_manifest(self.storage)
                if manifest["parts"] == [part._asdict() for part in parts] and manifest["config_hash"] == self.key:
                    return manifest
            except InputError:
                pass  # edited or damaged: written anew
        content = manifest_content(self.config, self.key, self.code, self._effects, parts)
        return write_manifest(self.storage, content)

    def _tidy(self) -> None:
        """Remove what interrupted writers left."""
        for folder in (PENDING, ROWS, ""):
            for name in self.storage.names(folder):
                if name.startswith(".") and (folder or name != LOCK):
                    self.storage.delete(f"{folder}/{name}" if folder else name)
        if not self.storage.names(PENDING) and PENDING in self.storage.names():
            self.storage.delete(PENDING)


def load_sweep(storage: Storage, *, same_version: bool = False) -> tuple[SweepDesign, str]:
    """Load the design of a folder, and the name of the function that makes its rows.

    Args:
        same_version: reject rows of another version of the code.

    Raises:
        InputError: the folder holds no sweep, its sweep.json has been edited, or its version is another.
    """
    if storage.size(SWEEP) is None:
        raise InputError(f"{storage.address} is no data set (no {SWEEP}); make it with softflagella sweep")
    sweep = _loaded(storage)
    if same_version:
        check_version(storage, sweep["code"])
    return _checked(storage, sweep), sweep["rows_by"]


def _published(stored: Stored, rows: int) -> list[Shard]:
    """List the shards that begin below `rows`, in order."""
    return sorted((shard for shard in stored if shard.start < rows), key=lambda s: s.start)


def _loaded(storage: Storage) -> dict[str, Any]:
    try:
        sweep = stored_json(storage, SWEEP)
        texts = isinstance(sweep["code"], str) and isinstance(sweep["rows_by"], str)
        sound = texts and sweep["key"] == sweep_key(sweep["config"], sweep["code"], sweep["rows_by"])
    except (ValueError, KeyError, TypeError):
        sound = False
    if not sound:
        raise InputError(
            f"{storage.path(SWEEP)} has been edited or is damaged; give another folder or remove this one"
        )
    return dict(sweep)


def _checked(storage: Storage, sweep: dict[str, Any]) -> SweepDesign:
    """Make the design of a sweep.json, which anybody may have written."""
    config, path = sweep["config"], storage.path(SWEEP)
    if not isinstance(config, dict):
        raise InputError(f"{path} has no table of inputs; give another folder or remove this one")
    checked_design({**config, "rows": 1}, path)
    return SweepDesign.from_config(config, 1)  # to the letter, as the key has it


def _text(storage: Storage, name: str) -> str:
    return bytes(storage.read(name)).decode(errors="replace")


def _describe(axis: dict[str, Any] | None) -> str:
    """Write an axis in one line."""
    if axis is None:
        return "not swept"
    low, high = axis["range"]
    return f"[{low:g}, {high:g}] {axis['scale']}" + (" both directions" if axis.get("both_directions") else "")
