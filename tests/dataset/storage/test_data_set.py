"""The store: nothing is silently wrong. Whatever happens to a file, reading refuses and mending restores."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from dataset.__main__ import main
from dataset.build.build import build, mend
from dataset.build.sweep_folder import sweep_key
from dataset.rows.schema import FLAGS, INPUTS, OUTPUTS, schema
from dataset.storage.data_set import batches, read, read_manifest, usable
from dataset.storage.shards import BadShardError, Shard, check_shard, shards_in
from dataset.storage.storage import open_storage
from sim.io.errors import InputError, run_command
from sim.model.response import DWELLS
from tests.dataset.sweeps import design, invented

ROWS = 300


@pytest.fixture(scope="module")
def original(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("data") / "out"
    build(design(ROWS), folder, jobs=1, title="", simulate=invented)
    return folder


@pytest.fixture
def built(original: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(original, tmp_path / "out"))


def part(folder: Path) -> Path:
    (found,) = (folder / "rows").iterdir()
    return found


def assert_refused_then_mended(built: Path, original: Path, words: str) -> None:
    for reads in (lambda: read(built), lambda: list(batches(built, ["v_x"]))):
        with pytest.raises(InputError, match=words) as refusal:
            reads()
        assert "--mend" in str(refusal.value)
    mend(built, jobs=1, title="", simulate=invented)
    assert read(built).equals(read(original))
    assert without_parts(built) == without_parts(original)


def without_parts(folder: Path) -> dict[str, object]:
    """Return the manifest without what a new file of the same rows changes."""
    return {k: v for k, v in read_manifest(folder).items() if k not in ("parts", "digest")}


def test_columns_types_and_units(original: Path) -> None:
    stored = pq.read_schema(part(original))
    for column in (*INPUTS, *OUTPUTS, *FLAGS):
        field = stored.field(column.name)
        assert field.type == column.type
        assert field.metadata[b"unit"].decode() == column.unit
        assert not field.nullable
    assert json.loads(stored.field("lag_z").metadata[b"grid"]) == DWELLS.tolist()


def test_rows_and_provenance(original: Path) -> None:
    table, manifest = read(original), read_manifest(original)
    points = design(ROWS).points()
    assert table["row"].tolist() == list(range(ROWS))
    assert all(table[name].to_numpy().tobytes() == v.tobytes() for name, v in points.items() if name != "N")
    assert {"code_version", "config_hash", "libraries"} <= set(manifest)
    assert manifest["rows"] == ROWS
    assert manifest["failed"] == table["failed"].sum() == manifest["reasons"]["it turns too fast"] > 0
    assert manifest["cost_s"] == pytest.approx(ROWS * 1e-3)


def flipped(whole: bytes, at: int) -> bytes:
    """Flip one bit of a byte."""
    return whole[:at] + bytes([whole[at] ^ (1 << (at % 8))]) + whole[at + 1 :]


def test_one_flipped_bit_is_never_silent(built: Path, original: Path) -> None:
    path = part(built)
    whole = path.read_bytes()
    for at in np.random.default_rng(0).integers(0, len(whole), 40).tolist():
        path.write_bytes(flipped(whole, at))
        with pytest.raises(InputError, match="digest"):
            read(built)
    assert_refused_then_mended(built, original, "digest")


def test_a_flipped_bit_in_a_page_is_found_without_the_manifest(original: Path, tmp_path: Path) -> None:
    """Shards that wait to be joined have no digest yet: their pages have checksums."""
    storage, key = open_storage(original), read_manifest(original)["config_hash"]
    (shard,) = shards_in(storage, "rows")
    wanted = check_shard(storage, shard, schema([]), key)._replace(sha256="", bytes=0)
    contents = part(original).read_bytes()
    end = len(contents) - 8 - int.from_bytes(contents[-8:-4], "little")  # of the pages
    copy = Shard(f"p/{part(original).name}", 0, ROWS)
    (tmp_path / "p").mkdir()
    for at in np.random.default_rng(1).integers(4, end, 60).tolist():
        (tmp_path / copy.name).write_bytes(flipped(contents, at))
        with suppress(BadShardError):
            checked = check_shard(open_storage(tmp_path), copy, schema([]), key)
            assert checked._replace(sha256="", bytes=0) == wanted


def cut(built: Path) -> None:
    part(built).write_bytes(part(built).read_bytes()[:-100])


def edit_the_manifest(built: Path) -> None:
    content = json.loads((built / "manifest.json").read_text())
    content["converged"] += 1
    (built / "manifest.json").write_text(json.dumps(content))


def change_a_number(built: Path) -> None:
    table = pq.read_table(part(built))
    at = table.schema.get_field_index("omega_yr_bar")
    changed = table.set_column(at, table.schema.field(at), [np.asarray(table["omega_yr_bar"]) * 1.1])
    pq.write_table(changed, part(built))


@pytest.mark.parametrize(
    ("damage", "words"),
    [
        (lambda built: part(built).unlink(), "missing"),
        (lambda built: shutil.copy(part(built), built / "rows" / "copy.parquet"), "not in the manifest"),
        (cut, "cut short"),
        (edit_the_manifest, "edited"),
        (change_a_number, "cut short|digest"),
    ],
)
def test_a_damaged_folder_is_refused_and_mended(
    damage: Callable[[Path], object], words: str, built: Path, original: Path
) -> None:
    damage(built)
    assert_refused_then_mended(built, original, words)


def test_a_broken_manifest_is_refused_and_mended(built: Path, original: Path) -> None:
    for text in ("", "{", "[]", '{"config_hash": 1}', "\x00\xff"):
        (built / "manifest.json").write_text(text)
        with pytest.raises(InputError, match=r"manifest\.json"):
            read(built)
        mend(built, jobs=1, title="", simulate=invented)
        assert read(built).equals(read(original))


def test_mending_leaves_whole_and_strange_files_alone(built: Path) -> None:
    before = {p: p.stat().st_mtime_ns for p in built.rglob("*") if p.is_file()}
    assert "manifest kept" in mend(built, jobs=1, title="", simulate=invented)
    assert {p: p.stat().st_mtime_ns for p in built.rglob("*") if p.is_file()} == before
    (built / "rows" / "thesis.txt").write_text("x")
    with pytest.raises(InputError, match=r"thesis\.txt"):
        mend(built, jobs=1, title="", simulate=invented)
    assert (built / "rows" / "thesis.txt").read_text() == "x"


def test_streaming_gives_the_same_rows_in_small_batches(original: Path) -> None:
    found = list(batches(original, ["row", "v_x"], rows=64))
    assert max(batch.num_rows for batch in found) <= 64
    assert pa.Table.from_batches(found).to_pandas().equals(read(original)[["row", "v_x"]])
    with pytest.raises(InputError, match="no column 'x'"):
        next(batches(original, ["x"]))


def test_other_libraries_read_the_folder(original: Path) -> None:
    rows = read(original)
    assert pd.read_parquet(original / "rows").equals(rows)
    polars, duckdb = pytest.importorskip("polars"), pytest.importorskip("duckdb")
    found = polars.read_parquet(original / "rows")
    assert found["omega_yr_bar"].to_numpy().tobytes() == rows["omega_yr_bar"].to_numpy().tobytes()
    assert found["reason"].to_list() == rows["reason"].tolist()
    (count, total), *_ = duckdb.sql(f"select count(*), sum(row) from '{original}/rows/*.parquet'").fetchall()
    assert (count, total) == (ROWS, ROWS * (ROWS - 1) // 2)


def test_the_card_says_how_to_read_and_what_failed(original: Path) -> None:
    card = (original / "card.md").read_text()
    for words in ("pandas.read_parquet", "polars.", "duckdb.sql", "it turns too fast", "| omega_bar |"):
        assert words in card
    assert read_manifest(original)["digest"] in card


def test_usable_leaves_failed_rows_out(original: Path) -> None:
    table = read(original).iloc[:6].assign(failed=False, converged=True, row=range(6))
    table.loc[0, "failed"] = True
    table.loc[1, "converged"] = False
    table.loc[2, "v_z"] = np.nan
    assert usable(table)["row"].tolist() == [3, 4, 5]


def test_no_function_runs_because_a_file_names_it(
    built: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A sweep.json may name any function, and its key can be computed by anyone who writes one."""
    folder = built
    sweep = json.loads((folder / "sweep.json").read_text())
    sweep["rows_by"] = "forged.rows"
    sweep["key"] = sweep_key(sweep["config"], sweep["code"], sweep["rows_by"])
    (folder / "sweep.json").write_text(json.dumps(sweep))
    (tmp_path / "forged.py").write_text("import pathlib\npathlib.Path('ran').touch()\nrows = print\n")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    assert run_command(main, ["verify", str(folder), "--mend"]) == 2
    assert "rows were made by 'forged.rows'" in capsys.readouterr().err
    assert not (tmp_path / "ran").exists()
    assert run_command(main, ["verify", str(folder), "--mend", "--rows-by", "forged.nothing"]) == 2
    assert "no function 'forged.nothing'" in capsys.readouterr().err


def test_a_function_of_the_lab_mends_when_it_is_named(
    built: Path, original: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    part(built).unlink()
    words = ["verify", str(built), "--mend", "--jobs", "1", "--rows", "0"]
    run_command(main, [*words, "--rows-by", "tests.dataset.sweeps.invented"])
    assert "300 rows are whole" in capsys.readouterr().out
    assert read(built).equals(read(original))
