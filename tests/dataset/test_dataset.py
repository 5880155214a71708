"""Design, sweep, store: what is built is what was asked for, whole, typed and resumable."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from dataset.__main__ import main
from dataset.design import load_design
from dataset.schema import FLAGS, INPUTS, OUTPUTS
from dataset.store import read, read_manifest, usable
from dataset.sweep import build, simulate
from dataset.verify import verify
from sim.io.errors import InputError, run_command

SMALL = """
rows = 6
seed = 3
[inputs]
C_t = { range = [2.0, 5.0] }
C_r = { range = [1.5, 3.5] }
C_yr = { range = [1.0, 7.0] }
l_over_R = { range = [4.0, 9.0] }
L_over_R = { range = [3.0, 5.0] }
l_over_r0 = { range = [20.0, 45.0] }
omega_bar = { range = [6.0, 12.0], scale = "log" }
N = { range = [2, 3], scale = "integer" }
dwell_bar = { range = [1.2, 1.5], scale = "log" }
"""


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("data")
    (folder / "sweep.toml").write_text(SMALL)
    build(load_design(folder / "sweep.toml"), folder / "out", jobs=1, title="")
    return folder


def test_the_design_fills_its_ranges_and_is_a_prefix_of_a_longer_one(tmp_path: Path) -> None:
    (tmp_path / "s.toml").write_text(SMALL)
    design = load_design(tmp_path / "s.toml").with_rows(512)
    points = design.points()
    for name, axis in design.axes.items():
        assert points[name].min() >= axis.low
        assert points[name].max() <= axis.high
    assert np.bincount(points["N"].astype(int))[2:].tolist() == [256, 256]
    halves = np.log(points["omega_bar"]) < np.log(np.sqrt(6.0 * 12.0))
    assert halves.sum() == 256
    longer = design.with_rows(700).points()
    assert all(np.array_equal(longer[k][:512], v) for k, v in points.items())


def test_columns_types_and_units(built: Path) -> None:
    schema = pq.read_schema(next((built / "out").glob("part-*.parquet")))
    for column in (*INPUTS, *OUTPUTS, *FLAGS):
        field = schema.field(column.name)
        assert field.type == column.type
        assert field.metadata[b"unit"].decode() == column.unit
        assert not field.nullable


def test_rows_and_provenance(built: Path) -> None:
    table, manifest = read(built / "out"), read_manifest(built / "out")
    assert len(table) == manifest["rows"] == 6
    assert table["converged"].all()
    assert manifest["config"]["seed"] == 3
    assert {"code_version", "config_hash", "libraries", "failed", "touching"} <= set(manifest)
    points = load_design(built / "sweep.toml").points()
    assert table["omega_bar"].to_numpy() == pytest.approx(points["omega_bar"])
    assert (table["omega_t_bar"] - table["omega_h_bar"]).to_numpy() == pytest.approx(points["omega_bar"])


def test_an_interrupted_build_goes_on(built: Path) -> None:
    parts = sorted((built / "out").glob("part-*.parquet"))
    before = read(built / "out")
    kept = parts[0].stat().st_mtime_ns
    parts[-1].unlink()
    (built / "out" / "manifest.json").unlink()
    with pytest.raises(InputError, match="no finished data set"):
        read(built / "out")
    build(load_design(built / "sweep.toml"), built / "out", jobs=1, title="")
    assert parts[0].stat().st_mtime_ns == kept
    assert read(built / "out").equals(before)


def test_another_configuration_is_not_mixed_in(built: Path) -> None:
    with pytest.raises(InputError, match="another configuration"):
        build(load_design(built / "sweep.toml").with_rows(7), built / "out", jobs=1, title="")


def test_failed_rows_are_kept_and_flagged(monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither an orbit nor a time step can be solved."""
    from sim.motion import run, steady, switching
    from sim.motion.orbits import Orbits
    from sim.solve.refinement import NO_START

    def lost(rows: np.ndarray, *_: object, **__: object) -> Orbits:
        count, none = len(rows), np.full(len(rows), np.nan)
        return Orbits(np.full((count, 5), np.nan), np.empty((count, 0, 5)), none, np.full(count, NO_START), none)

    monkeypatch.setattr(steady, "solve_orbits", lost)
    monkeypatch.setattr(switching, "state_on_orbit", lambda *_: None)
    monkeypatch.setattr(run, "advance", lambda *_: False)
    points = {"C_t": 3.0, "C_r": 2.8, "C_yr": 2.0, "l_over_R": 6.9, "L_over_R": 3.8, "l_over_r0": 34.0,
              "omega_bar": 10.0, "N": 2.0, "dwell_bar": 1.2}  # fmt: skip
    columns = simulate({k: np.array([v]) for k, v in points.items()})
    assert columns["failed"].tolist() == [True]
    assert columns["converged"].tolist() == [False]
    assert np.isnan(columns["omega_yr_bar"]).all()
    assert np.isnan(columns["net_speed_bar"]).all()


def test_verify_passes_and_notices_a_changed_number(built: Path) -> None:
    assert "6 rows" in verify(str(built / "out"), rows=2)
    part = next((built / "out").glob("part-*.parquet"))
    original = part.read_bytes()
    table = pq.read_table(part)
    index = table.schema.get_field_index("omega_yr_bar")
    wrong = table.set_column(index, table.schema.field(index), [np.asarray(table["omega_yr_bar"]) * 1.1])
    pq.write_table(wrong, part)
    with pytest.raises(InputError, match="solved again differ"):
        verify(str(built / "out"), rows=6)
    part.write_bytes(original)


def test_usable_leaves_failed_rows_out(built: Path) -> None:
    table = read(built / "out")
    table.loc[0, "failed"] = True
    table.loc[1, "converged"] = False
    table.loc[2, "lag_x"] = np.nan
    assert usable(table)["row"].tolist() == [3, 4, 5]


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("[2.0, 5.0]", "[5.0, 2.0]", "ordered"),
        ("[2.0, 5.0]", "[-2.0, 5.0]", "above 0"),
        ('"log"', '"cubic"', "scale"),
        ("C_t =", "C_x =", "unknown input"),
        ("C_t = { range = [2.0, 5.0] }", "", "missing input"),
        ("rows = 6", "rows = 0", "rows = 0"),
        ("rows = 6", "rows = ", "not TOML"),
    ],
)
def test_bad_configurations(
    old: str, new: str, expected: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "s.toml").write_text(SMALL.replace(old, new, 1))
    words = ["build", "--config", str(tmp_path / "s.toml"), "--out", str(tmp_path / "out")]
    assert run_command(main, words) == 2
    error = capsys.readouterr().err
    assert expected in error
    assert len(error.splitlines()) == 1
    assert not (tmp_path / "out").exists()


def test_a_folder_with_other_files_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "s.toml").write_text(SMALL)
    (tmp_path / "thesis.txt").write_text("x")
    with pytest.raises(InputError, match=r"s\.toml|thesis"):
        build(load_design(tmp_path / "s.toml"), tmp_path, jobs=1, title="")


def test_report_is_one_self_contained_page(built: Path) -> None:
    page = built / "page.html"
    assert run_command(main, ["report", str(built / "out"), "--out", str(page)]) == 0
    text = page.read_text()
    assert "data:image/png;base64" in text
    assert "http" not in text.split("</style>")[1]
    assert json.loads((built / "out" / "manifest.json").read_text())["config_hash"] in text
