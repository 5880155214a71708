"""The store: nothing is silently wrong. Whatever happens to a file, reading refuses and mending restores."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from dataset.__main__ import main
from dataset.build.build import build, mend
from dataset.build.sweep_folder import sweep_key
from dataset.rows.schema import FLAGS, INPUTS, OUTPUTS, Column, arrow_table, parquet_field, schema
from dataset.storage.data_set import batches, read, read_manifest, usable
from dataset.storage.shards import BadShardError, Shard, check_shard, join, plain, shards_in, write_shard
from dataset.storage.storage import open_storage
from sim.io.errors import InputError, run_command
from tests.dataset.sweeps import design, invented, without_cost

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


def test_columns_as_plain_arrays() -> None:
    flags = pa.array([True, False, True, True, False] * 7)
    assert plain(flags.slice(3, 20)).tolist() == flags.slice(3, 20).to_pylist()
    assert plain(pa.chunked_array([flags, flags.slice(1)])).tolist() == flags.to_pylist() + flags.to_pylist()[1:]
    assert plain(pa.array([1, 2, 3], pa.int32()).slice(1)).tolist() == [2, 3]
    assert plain(pa.chunked_array([["a", ""], ["b"]])).tolist() == ["a", "", "b"]
    assert len(plain(pa.chunked_array([], type=pa.bool_()))) == 0


def test_rows_and_provenance(original: Path) -> None:
    table, manifest = read(original), read_manifest(original)
    points = design(ROWS).points()
    assert table["row"].tolist() == list(range(ROWS))
    assert all(table[name].to_numpy().tobytes() == v.tobytes() for name, v in points.items() if name != "N")
    assert {"code_version", "config_hash", "libraries"} <= set(manifest)
    assert manifest["rows"] == ROWS
    assert manifest["failed"] == table["failed"].sum() == manifest["reasons"]["it turns too fast"] > 0
    assert manifest["cost_s"] == pytest.approx(ROWS * 1e-3)


def test_one_flipped_bit_is_never_silent(built: Path, original: Path) -> None:
    """Of single flipped bits 40 % used to be read as wrong numbers without a word."""
    path = part(built)
    whole = path.read_bytes()
    for at in np.random.default_rng(0).integers(0, len(whole), 100).tolist():
        bad = bytearray(whole)
        bad[at] ^= 1 << (at % 8)
        path.write_bytes(bad)
        with pytest.raises(InputError, match="digest"):
            read(built)
    assert_refused_then_mended(built, original, "digest")


def test_a_flipped_bit_in_a_page_is_found_without_the_manifest(original: Path) -> None:
    """Shards that wait to be joined have no digest yet: their pages have checksums."""
    storage, key = open_storage(original), read_manifest(original)["config_hash"]
    (shard,) = shards_in(storage, "rows")
    contents = part(original).read_bytes()
    end = len(contents) - 8 - int.from_bytes(contents[-8:-4], "little")  # of the pages
    silent = 0
    for at in np.random.default_rng(1).integers(4, end, 200).tolist():
        bad = bytearray(contents)
        bad[at] ^= 1 << (at % 8)
        (original.parent / "p").mkdir(exist_ok=True)
        (original.parent / "p" / part(original).name).write_bytes(bad)
        try:
            copies = open_storage(original.parent)
            checked = check_shard(copies, Shard(f"p/{part(original).name}", 0, ROWS), schema([]), key)
            silent += checked._replace(sha256="", bytes=0) != check_shard(
                storage, shard, schema([]), key
            )._replace(sha256="", bytes=0)
        except BadShardError:
            pass
    assert silent == 0


def test_a_missing_file(built: Path, original: Path) -> None:
    part(built).unlink()
    assert_refused_then_mended(built, original, "missing")


def test_a_truncated_file(built: Path, original: Path) -> None:
    path = part(built)
    path.write_bytes(path.read_bytes()[:-100])
    assert_refused_then_mended(built, original, "cut short")


def test_a_doubled_file(built: Path, original: Path) -> None:
    shutil.copy(part(built), built / "rows" / "copy.parquet")
    assert_refused_then_mended(built, original, "not in the manifest")


def test_an_edited_manifest(built: Path, original: Path) -> None:
    path = built / "manifest.json"
    content = json.loads(path.read_text())
    content["converged"] += 1
    path.write_text(json.dumps(content))
    assert_refused_then_mended(built, original, "edited")


@pytest.mark.parametrize("text", ["", "{", "[]", '{"config_hash": 1}', "\x00\xff"])
def test_a_broken_manifest(text: str, built: Path, original: Path) -> None:
    (built / "manifest.json").write_text(text)
    with pytest.raises(InputError, match=r"manifest\.json"):
        read(built)
    mend(built, jobs=1, title="", simulate=invented)
    assert read(built).equals(read(original))


def test_rows_rewritten_with_another_number(built: Path, original: Path) -> None:
    path = part(built)
    table = pq.read_table(path)
    at = table.schema.get_field_index("omega_yr_bar")
    pq.write_table(table.set_column(at, table.schema.field(at), [np.asarray(table["omega_yr_bar"]) * 1.1]), path)
    assert_refused_then_mended(built, original, "cut short|digest")


def test_mending_what_is_whole_changes_nothing(built: Path) -> None:
    before = {p: p.stat().st_mtime_ns for p in built.rglob("*") if p.is_file()}
    assert "manifest kept" in mend(built, jobs=1, title="", simulate=invented)
    assert {p: p.stat().st_mtime_ns for p in built.rglob("*") if p.is_file()} == before


def test_strange_files_are_left_alone(built: Path) -> None:
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


def test_pandas_reads_the_folder(original: Path) -> None:
    assert pd.read_parquet(original / "rows").equals(read(original))


def test_polars_reads_the_folder(original: Path) -> None:
    polars = pytest.importorskip("polars")
    found = polars.read_parquet(original / "rows")
    assert found["omega_yr_bar"].to_numpy().tobytes() == read(original)["omega_yr_bar"].to_numpy().tobytes()
    assert found["reason"].to_list() == read(original)["reason"].tolist()


def test_duckdb_reads_the_folder(original: Path) -> None:
    duckdb = pytest.importorskip("duckdb")
    (count, total), *_ = duckdb.sql(f"select count(*), sum(row) from '{original}/rows/*.parquet'").fetchall()
    assert (count, total) == (ROWS, ROWS * (ROWS - 1) // 2)


def test_the_card_says_how_to_read_and_what_failed(original: Path) -> None:
    card = (original / "card.md").read_text()
    for words in (
        "pandas.read_parquet",
        "polars.read_parquet",
        "duckdb.sql",
        "it turns too fast",
        "| omega_bar |",
    ):
        assert words in card
    assert read_manifest(original)["digest"] in card


def test_lists_on_a_grid_are_stored_and_joined(tmp_path: Path) -> None:
    grid = tuple(np.linspace(0.2, 4.0, 5).tolist())
    names = ("row", "converged", "failed", "touching", "reason", "cost_s")
    plain = [column for column in FLAGS if column.name in names]
    form = pa.schema(map(parquet_field, [*plain, Column("lag", pa.list_(pa.float32(), 5), "l", "offset", grid)]))
    values = np.arange(50, dtype=np.float32).reshape(10, 5) / 7
    flags = {"converged": np.ones(5, bool), "failed": np.zeros(5, bool), "touching": np.zeros(5, bool)}
    storage = open_storage(tmp_path)
    for start in (0, 5):
        rows = {"row": np.arange(start, start + 5), "lag": values[start : start + 5], "cost_s": np.ones(5)}
        table = arrow_table({**rows, **flags, "reason": [""] * 5}, form)
        write_shard(storage, f"p/rows-{start:010d}-{start + 5:010d}.parquet", table, "key")
    name = "p/rows-0000000000-0000000010.parquet"
    joined = join(storage, shards_in(storage, "p"), name, form, "key")
    assert check_shard(storage, Shard(name, 0, 10), form, "key") == joined
    stored = pq.read_table(tmp_path / name)
    assert np.stack(stored.to_pandas()["lag"].to_list()).tobytes() == values.tobytes()
    assert json.loads(stored.schema.field("lag").metadata[b"grid"]) == list(grid)


def test_usable_leaves_failed_rows_out(original: Path) -> None:
    table = read(original).iloc[:6].assign(failed=False, converged=True, row=range(6))
    table.loc[0, "failed"] = True
    table.loc[1, "converged"] = False
    table.loc[2, "v_z"] = np.nan
    assert usable(table)["row"].tolist() == [3, 4, 5]
    assert len(without_cost(table).columns) == len(table.columns) - 1


def test_no_function_runs_because_a_file_names_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A sweep.json may name any function, and its key can be computed by anyone who writes one."""
    folder = tmp_path / "data"
    build(design(40), folder, jobs=1, title="", simulate=invented)
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
