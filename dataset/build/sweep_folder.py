"""The folder of a data set while it is being made: what is in it, what is missing, and how it is completed.

Order of completing: join pending pieces into pieces of SEGMENT rows, still pending; move these to rows/; write
the manifest; remove what they replace. Wherever that is interrupted, every row is in some whole piece, and the
next build goes on: it sorts pieces by what they hold, not by what a journal says.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import pyarrow as pa

from dataset.report.data_card import write_card
from dataset.rows.design import Design
from dataset.rows.schema import schema
from dataset.storage.data_set import (
    CARD,
    MANIFEST,
    PENDING,
    ROWS,
    SWEEP,
    manifest_of,
    read_manifest,
    write_manifest,
)
from dataset.storage.shards import SEGMENT, BadPieceError, Contents, Piece, contents_of, key_in, piece_name, pieces
from dataset.storage.storage import Place
from dataset.workers.tasks import Joining, Receipt, Work
from sim.io.errors import InputError
from sim.io.provenance import fingerprint

_KNOWN = {MANIFEST, SWEEP, CARD, ROWS, PENDING}
_CHOSEN, _DIGEST = "chosen", "chosen_digest"  # in sweep.json; the manifest has the digest under the first name
Held = dict[Piece, Contents]
Joiner = Callable[[Sequence[Joining], Callable[[Work, Receipt], None]], None]


def key_of(config: dict[str, Any], code: str, source: str) -> str:
    """What names the rows of a sweep: its inputs and all that makes rows of them."""
    return fingerprint({"config": config, "code": code, "rows_by": source})


def chosen_digest(design: Design, rows: int) -> str | None:
    """What the manifest says of the first `rows` chosen points; None where the rows are the first ones."""
    return None if design.chosen is None else fingerprint(list(design.chosen[:rows]))


class SweepFolder:
    """A place that holds, or will hold, the rows of one sweep. Only its writer (`lock`) makes one."""

    def __init__(self, place: Place, design: Design, code: str, source: str):
        self.place, self.design, self.code = place, design, code
        self.config = design.config()
        self.key = key_of(self.config, code, source)
        self.form: pa.Schema = schema(design.effects, design.sensitivities)
        self._rest = {"config": self.config, "code": code, "rows_by": source, "key": self.key}

    def claim(self, *, mending: bool = False) -> None:
        """Write what the folder is for, unless that is there.

        Raises:
            InputError: the folder holds something else.
        """
        names = [name for name in self.place.names() if not name.startswith(".")]
        strangers = sorted(set(names) - _KNOWN)
        old = [name for name in strangers if name.startswith("part-")]
        if old:
            raise InputError(f"{self.place.address} holds a data set of an older format; give another folder")
        if strangers or (names and SWEEP not in names and MANIFEST not in names):
            other = (strangers or names)[0]
            raise InputError(f"{self.place.address} holds other files ({other}); give an empty or a new folder")
        self._refuse_strangers()
        if SWEEP in names:
            there = _loaded(self.place)
            self._compare(there)
            self._go_on(there.get(_CHOSEN))
        elif MANIFEST in names and not mending:
            manifest = read_manifest(self.place)
            if manifest["config_hash"] != self.key:
                raise self._other("rows of another configuration or version")
            if manifest.get(_CHOSEN) != chosen_digest(self.design, manifest["rows"]):
                raise self._other("other rows of this sweep")
            self._write_sweep()
        else:
            self._write_sweep()

    def _go_on(self, there: list[int] | None) -> None:
        """Compare the chosen points; the longer list counts, and begins with the shorter one."""
        ours = self.design.chosen
        if (there is None) != (ours is None):
            other = "chosen rows of this sweep" if ours is None else "the first rows of this sweep, none chosen"
            raise self._other(other)
        if there is None or ours is None:
            return
        common = min(len(there), len(ours))
        if tuple(there[:common]) != ours[:common]:
            raise self._other("other chosen rows of this sweep")
        if len(there) >= len(ours):
            self.design = replace(self.design, chosen=tuple(there))
        else:
            self._write_sweep()

    def _write_sweep(self) -> None:
        content: dict[str, Any] = dict(self._rest)
        if self.design.chosen is not None:
            content |= {_CHOSEN: list(self.design.chosen), _DIGEST: fingerprint(list(self.design.chosen))}
        self.place.write(SWEEP, json.dumps(content, indent=None if self.design.chosen else 1) + "\n")

    def _refuse_strangers(self) -> None:
        """Refuse files in rows/ that no reader could tell from rows; a copy of one of our pieces is removed."""
        ours = {piece.name for piece in pieces(self.place, ROWS)}
        for name in self.place.names(ROWS):
            path = f"{ROWS}/{name}"
            if path not in ours and not name.startswith("."):
                if key_in(self.place, path) != self.key:
                    raise InputError(f"{self.place.path(path)} is no part of the data set; move it elsewhere")
                self.place.delete(path)

    def _compare(self, there: dict[str, Any]) -> None:
        if {name: there[name] for name in self._rest} == self._rest:
            return
        theirs, ours = there["config"], self.config
        if theirs["seed"] != ours["seed"]:
            raise self._other(f"rows of another configuration: seed {theirs['seed']} there, {ours['seed']} here")
        for name in sorted({*theirs["inputs"], *ours["inputs"]}):
            one, other = theirs["inputs"].get(name), ours["inputs"].get(name)
            if one != other:
                raise self._other(
                    f"rows of another configuration: {name} {_words(one)} there, {_words(other)} here"
                )
        raise self._other(f"rows of another version: {there['code']} there, {self.code} here")

    def _other(self, what: str) -> InputError:
        return InputError(f"{self.place.address} holds {what}; give another folder or remove this one")

    def rows_there(self) -> int:
        """Rows of the finished data set in the folder, by its manifest and the names in rows/; 0 without one."""
        if self.place.size(MANIFEST) is None:
            return 0
        named = max((piece.stop for piece in pieces(self.place, ROWS)), default=0)
        try:
            return max(named, int(read_manifest(self.place)["rows"]))
        except InputError:  # edited or damaged
            return named

    def holds(self, *, mending: bool = False) -> Held:
        """Whole pieces that together hold each row at most once; everything is read and checked.

        Files that are damaged are removed, and so are those whose rows are in another piece. What the manifest
        lists must be as it lists it.
        """
        listed = self._listed(mending)
        whole: Held = {}
        for piece in [*pieces(self.place, ROWS), *pieces(self.place, PENDING)]:
            try:
                contents = contents_of(self.place, piece, self.form, self.key, self.design.indices)
                if contents.sha256 != listed.get(piece.name, contents.sha256):
                    raise BadPieceError("it does not have the digest that the manifest states")
            except BadPieceError:
                self.place.delete(piece.name)
            else:
                whole[piece] = contents
        kept: Held = {}
        end = 0
        for piece in sorted(whole, key=lambda p: (p.start, -p.stop, p.name not in listed)):
            if piece.start >= end:
                kept[piece] = whole[piece]
                end = piece.stop
            elif piece.name not in listed:  # a listed file stays until the manifest no longer lists it
                self.place.delete(piece.name)
        return kept

    def _listed(self, mending: bool) -> dict[str, str]:
        if self.place.size(MANIFEST) is None:
            return {}
        try:
            manifest = read_manifest(self.place)
        except InputError:
            if not mending:
                raise
            return {}
        return {piece_name(ROWS, p["start"], p["stop"]): p["sha256"] for p in manifest["parts"]}

    def missing(self, held: Held, rows: int) -> list[tuple[int, int]]:
        """Runs of rows below `rows` that no piece holds, cut at the ends of segments."""
        gaps, at = [], 0
        for piece in [*sorted(held, key=lambda p: p.start), Piece("", rows, rows)]:
            while at < min(piece.start, rows):
                end = min(piece.start, rows, (at // SEGMENT + 1) * SEGMENT)
                gaps.append((at, end))
                at = end
            at = max(at, piece.stop)
        return gaps

    def complete(self, held: Held, rows: int, joined: Joiner) -> dict[str, Any]:
        """Bring the first `rows` rows into rows/ and write the manifest, unless it is so already; returns it.

        A piece that goes on beyond `rows` is taken whole.

        Args:
            joined: does the joining; calls its second argument for each one that is done.
        """
        groups: dict[int, list[Piece]] = {}
        for piece in sorted(held, key=lambda p: p.start):
            if piece.start < rows:
                groups.setdefault(piece.start // SEGMENT, []).append(piece)
        final: Held = {group[0]: held[group[0]] for group in groups.values() if len(group) == 1}

        def then(work: Work, receipt: Receipt) -> None:
            contents = receipt.contents
            name = piece_name(PENDING, contents.start, contents.stop)
            final[Piece(name, contents.start, contents.stop)] = contents
            for piece in groups[contents.start // SEGMENT]:
                if piece.name.startswith(PENDING):
                    self.place.delete(piece.name)

        joined(
            [
                Joining(self.place.address, self.config, self.key, self.code, tuple(group))
                for group in groups.values()
                if len(group) > 1
            ],
            then,
        )
        final = dict(sorted(final.items(), key=lambda item: item[0].start))
        for piece in final:
            if piece.name.startswith(PENDING):
                self.place.move(piece.name, piece_name(ROWS, piece.start, piece.stop))
        manifest = self._manifest(list(final.values()))
        current = {piece_name(ROWS, piece.start, piece.stop) for piece in final}
        for piece in pieces(self.place, ROWS):
            if piece.name not in current:
                self.place.delete(piece.name)
        self._tidy()
        if self.place.size(CARD) is None or manifest["digest"] not in _text(self.place, CARD):
            write_card(self.place)
        return manifest

    def _manifest(self, parts: Sequence[Contents]) -> dict[str, Any]:
        if self.place.size(MANIFEST) is not None:
            try:
                there = read_manifest(self.place)
                if there["parts"] == [part._asdict() for part in parts] and there["config_hash"] == self.key:
                    return there
            except InputError:
                pass  # edited or damaged: written anew
        content = manifest_of(self.config, self.key, self.code, self.design.effects, parts)
        if self.design.chosen is not None:
            content[_CHOSEN] = chosen_digest(self.design, content["rows"])
        return write_manifest(self.place, content)

    def _tidy(self) -> None:
        """Remove what interrupted writers left."""
        for folder in (PENDING, ROWS, ""):
            for name in self.place.names(folder):
                if name.startswith(".") and (folder or name != ".lock"):
                    self.place.delete(f"{folder}/{name}" if folder else name)
        if not self.place.names(PENDING) and PENDING in self.place.names():
            self.place.delete(PENDING)


def load_sweep(place: Place) -> tuple[Design, str]:
    """The design of a folder, and the name of the function that makes its rows.

    Raises:
        InputError: the folder holds no sweep, or its sweep.json has been edited.
    """
    if place.size(SWEEP) is None:
        raise InputError(f"{place.address} is no data set (no {SWEEP}); make it with python -m dataset build")
    there = _loaded(place)
    return Design.from_config(there["config"], 1, there.get(_CHOSEN)), there["rows_by"]


def _loaded(place: Place) -> dict[str, Any]:
    try:
        there = json.loads(_text(place, SWEEP))
        sound = there["key"] == key_of(there["config"], there["code"], there["rows_by"])
        sound = sound and (_CHOSEN not in there or there[_DIGEST] == fingerprint(there[_CHOSEN]))
    except (ValueError, KeyError, TypeError):
        sound = False
    if not sound:
        raise InputError(
            f"{place.path(SWEEP)} has been edited or is damaged; give another folder or remove this one"
        )
    return dict(there)


def _text(place: Place, name: str) -> str:
    return bytes(place.read(name)).decode(errors="replace")


def _words(axis: dict[str, Any] | None) -> str:
    if axis is None:
        return "not swept"
    low, high = axis["range"]
    return f"[{low:g}, {high:g}] {axis['scale']}" + (" both directions" if axis.get("both_directions") else "")
