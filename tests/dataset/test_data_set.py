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

from common.errors import InputError, run_command
from dataset.__main__ import main
from dataset.build import build, mend
from dataset.data_set import SWEEP, batches, read, read_manifest, sweep_key, usable
from dataset.schema import FLAGS, INPUTS, OUTPUTS, schema
from dataset.shards import BadFileError, Part, checked_part
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


def file(folder: Path, number: int = 1) -> Path:
    return sorted((folder / "rows").iterdir())[number]


def assert_refused_then_mended(built: Path, original: Path, words: str) -> None:
    for reads in (lambda: read(built), lambda: list(batches(built, ["v_x"]))):
        with pytest.raises(InputError, match=words) as refusal:
            reads()
        assert "--mend" in str(refusal.value)
    mend(built, jobs=1, title="", simulate=invented)
    assert read(built).equals(read(original))
    new_bytes = {"parts": [], "digest": ""}  # a file of the same rows may have other bytes
    assert {**read_manifest(built), **new_bytes} == {**read_manifest(original), **new_bytes}


def test_rows_columns_units_and_provenance(original: Path) -> None:
    table, manifest, stored = read(original), read_manifest(original), pq.read_schema(file(original))
    for column in (*INPUTS, *OUTPUTS, *FLAGS):
        field = stored.field(column.name)
        assert field.type == column.type
        assert field.metadata[b"unit"].decode() == column.unit
        assert not field.nullable
    assert json.loads(stored.field("lag_z").metadata[b"grid"]) == DWELLS.tolist()
    points = design(ROWS).points()
    assert table["row"].tolist() == list(range(ROWS))
    assert all(table[name].to_numpy().tobytes() == v.tobytes() for name, v in points.items() if name != "N")
    assert {"code_version", "config_hash", "libraries"} <= set(manifest)
    assert manifest["rows"] == ROWS
    assert manifest["failed"] == table["failed"].sum() == manifest["reasons"]["it turns too fast"] > 0
    assert manifest["cost_s"] == pytest.approx(ROWS * 1e-3)


# What a row is about, typed and with units: the eight inputs, and what the robot does.
UNITS = {
    "C_t": "1", "C_r": "1", "C_yr": "1", "l_over_R": "1", "L_over_R": "1", "l_over_r0": "1",
    "omega_bar": "EI/(mu0 l^4)", "N": "1",
    "omega_yr_bar": "EI/(mu0 l^4)", "R_yr_over_l": "l", "theta_deg": "degree",
    "v_x": "EI/(mu0 l^3)", "v_z": "EI/(mu0 l^3)",
}  # fmt: skip


def test_pandas_reads_the_folder_as_one_data_set(original: Path) -> None:
    rows = pd.read_parquet(original / "rows")
    assert rows.equals(read(original))
    assert {name: str(rows[name].dtype) for name in UNITS} == {**dict.fromkeys(UNITS, "float64"), "N": "int32"}
    for path in (original / "rows").iterdir():
        form = pq.read_schema(path)
        assert {name: form.field(name).metadata[b"unit"].decode() for name in UNITS} == UNITS


def test_polars_reads_the_folder_as_one_data_set(original: Path) -> None:
    polars = pytest.importorskip("polars", reason="the extra clusters is not installed")
    found, rows = polars.read_parquet(original / "rows"), read(original)
    assert all(found[name].to_numpy().tobytes() == rows[name].to_numpy().tobytes() for name in UNITS)
    assert {str(found[name].dtype) for name in UNITS} == {"Float64", "Int32"}
    assert found["reason"].to_list() == rows["reason"].tolist()


def test_duckdb_reads_the_folder_as_one_data_set(original: Path) -> None:
    duckdb = pytest.importorskip("duckdb", reason="the extra clusters is not installed")
    found, rows = duckdb.sql(f"from '{original}/rows/*.parquet' order by row").fetchnumpy(), read(original)
    found["L_over_R"] = found["L_over_R_1"]  # it ignores case, as the card says
    assert all(found[name].tobytes() == rows[name].to_numpy().tobytes() for name in UNITS)
    assert "L_over_R_1" in (original / "card.md").read_text()


def test_an_older_data_set_is_read(tmp_path: Path) -> None:
    """Its rows were joined to one file, by another version of the code; nothing is added to it."""
    older = Path(shutil.copytree(Path(__file__).parent / "format-2", tmp_path / "older"))
    rows = read(older)
    assert rows["row"].tolist() == list(range(8))
    assert rows["C_t"].tolist() == design(8).points()["C_t"].tolist()
    for work in (lambda: build(design(9), older, simulate=invented), lambda: mend(older, simulate=invented)):
        with pytest.raises(InputError, match=r"holds rows of another version: 0\.1\.0\+"):
            work()


def flipped(whole: bytes, at: int) -> bytes:
    """Flip one bit of a byte."""
    return whole[:at] + bytes([whole[at] ^ (1 << (at % 8))]) + whole[at + 1 :]


def test_one_flipped_bit_is_never_silent(built: Path, original: Path) -> None:
    """Nor in a file that no manifest lists yet: its pages have checksums."""
    path, key, rows = file(built), read_manifest(original)["config_hash"], (75, 150)
    whole = path.read_bytes()
    wanted = checked_part(whole, *rows, schema([]), key)._replace(sha256="")
    for at in np.random.default_rng(0).integers(4, len(whole), 60).tolist():
        path.write_bytes(flipped(whole, at))
        with pytest.raises(InputError, match="digest"):
            read(built)
        found: Part | None = None
        with suppress(BadFileError):
            found = checked_part(path.read_bytes(), *rows, schema([]), key)
        assert found is None or found._replace(sha256="") == wanted
    assert_refused_then_mended(built, original, "digest")


def edit_the_manifest(built: Path) -> None:
    content = json.loads((built / "manifest.json").read_text())
    content["converged"] += 1
    (built / "manifest.json").write_text(json.dumps(content))


def change_a_number(built: Path) -> None:
    table = pq.read_table(file(built))
    at = table.schema.get_field_index("omega_yr_bar")
    changed = table.set_column(at, table.schema.field(at), [np.asarray(table["omega_yr_bar"]) * 1.1])
    pq.write_table(changed, file(built))


@pytest.mark.parametrize(
    ("damage", "words"),
    [
        (lambda built: file(built).unlink(), "missing"),
        (lambda built: shutil.copy(file(built), built / "rows" / "copy.parquet"), "not in the manifest"),
        (lambda built: file(built).write_bytes(file(built).read_bytes()[:-100]), "digest"),
        (edit_the_manifest, "edited"),
        (change_a_number, "digest"),
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
    before = {p: p.stat().st_mtime_ns for p in built.rglob("*") if p.is_file() and p.name != ".lock"}
    assert "manifest kept" in mend(built, jobs=1, title="", simulate=invented)
    assert before.items() <= {p: p.stat().st_mtime_ns for p in built.rglob("*")}.items()
    (built / "rows" / "thesis.txt").write_text("x")
    with pytest.raises(InputError, match=r"thesis\.txt"):
        mend(built, jobs=1, title="", simulate=invented)
    assert (built / "rows" / "thesis.txt").read_text() == "x"


def test_streaming_gives_the_same_rows_in_small_batches(original: Path) -> None:
    found = list(batches(original, ["v_x", "row"], rows=64))
    assert max(batch.num_rows for batch in found) <= 64
    assert pa.Table.from_batches(found).to_pandas().equals(read(original)[["v_x", "row"]])
    with pytest.raises(InputError, match="no column 'x'"):
        next(batches(original, ["x"]))


def test_the_card_says_how_to_read_and_what_failed(original: Path) -> None:
    card = (original / "card.md").read_text()
    for words in ("pandas.read_parquet", "polars.", "duckdb.sql", "| it turns too fast | 2 |", "| omega_bar |"):
        assert words in card
    assert read_manifest(original)["digest"] in card


def test_usable_leaves_failed_rows_out(original: Path) -> None:
    table = read(original).iloc[:6].assign(failed=False, converged=True, row=range(6))
    table.loc[0, "failed"] = True
    table.loc[1, "converged"] = False
    table.loc[2, "v_z"] = np.nan
    assert usable(table)["row"].tolist() == [3, 4, 5]


def test_no_function_runs_because_a_file_names_it(
    built: Path,
    original: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """A sweep.json may name any function, and its key can be computed by anyone who writes one."""
    sweep = json.loads((built / SWEEP).read_text())
    forged = {**sweep, "rows_by": "forged.rows"}
    forged["key"] = sweep_key(sweep["config"], sweep["code"], "forged.rows")
    (built / SWEEP).write_text(json.dumps(forged))
    (tmp_path / "forged.py").write_text("import pathlib\npathlib.Path('ran').touch()\nrows = print\n")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    words = ["verify", str(built), "--mend", "--jobs", "1", "--rows", "0"]
    assert run_command(main, words) == 2
    assert "rows were made by 'forged.rows'" in capsys.readouterr().err
    assert not (tmp_path / "ran").exists()
    assert run_command(main, [*words, "--rows-by", "forged.nothing"]) == 2
    assert "no function 'forged.nothing'" in capsys.readouterr().err
    (built / SWEEP).write_text(json.dumps(sweep))
    file(built).unlink()
    run_command(main, [*words, "--rows-by", "tests.dataset.sweeps.invented"])
    assert "300 rows are whole: 75 rows simulated again" in capsys.readouterr().out
    assert read(built).equals(read(original))
