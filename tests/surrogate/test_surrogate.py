"""Look-up table: what ships is accurate, what is trained is what was asked for, and nothing is extrapolated."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from dataset.store import write_rows
from sim.io.errors import InputError, run_command
from surrogate.__main__ import main
from surrogate.export import SHIPPED, load, save
from surrogate.train import Settings, split, train
from tests.dataset import sweeps
from tests.reference.cases import CONTROL, STEADY_INPUTS, STEADY_POINTS

SMALL = Settings(width=24, depth=2, members=2, epochs=200, patience=200, batch=64)


def invented(folder: Path, rows: int = 512) -> Path:
    """A data set with outputs in closed form, so that learning is tested without simulating."""
    if (folder / "data").exists():
        return folder / "data"
    sweep = sweeps.design(rows)
    columns = sweeps.invented(sweep.points())
    whole = {"failed": np.zeros(rows, bool), "converged": np.ones(rows, bool), "row": np.arange(rows)}
    write_rows(folder / "data", sweep.config(), {**columns, **whole}, code="test")
    return folder / "data"


@pytest.fixture(scope="module")
def trained(tmp_path_factory: pytest.TempPathFactory):  # type: ignore[no-untyped-def]
    return train(str(invented(tmp_path_factory.mktemp("data"))), SMALL, title="")


def columns_of(points: tuple[tuple[float, ...], ...]) -> dict[str, np.ndarray]:
    return dict(zip(STEADY_INPUTS, np.array(points).T, strict=True))


def test_the_shipped_table_matches_the_independent_solver() -> None:
    table = load()
    found = table.query(columns_of(tuple(p[0] for p in STEADY_POINTS)))
    truth = np.array([p[1] for p in STEADY_POINTS]).T
    names = ("omega_t_bar", "omega_h_bar", "omega_yr_bar", "v_x", "v_z", "R_yr_over_l")
    for name, values in zip(names, truth, strict=False):
        assert found[name] == pytest.approx(values, rel=0.04), name
    assert found["theta_deg"] == pytest.approx(truth[6], abs=0.5)
    control = {"C_t": 3.0, "C_r": 2.8, "C_yr": 2.0, "l_over_R": 6.875, "L_over_R": 3.75, "l_over_r0": 34.375,
               "omega_bar": 10.0, "N": 2.0}  # fmt: skip
    one = table.query({k: np.array([v]) for k, v in control.items()})
    for name in ("omega_t_bar", "omega_yr_bar", "v_x", "R_yr_over_l"):
        assert one[name][0] == pytest.approx(CONTROL[name], rel=0.01)


def test_the_shipped_table_states_its_errors() -> None:
    table = load()
    assert SHIPPED.stat().st_size < 4e6
    assert table.provenance["rows"]["held_out"] > 500
    for name in ("omega_t_bar", "omega_yr_bar", "R_yr_over_l", "v_x"):
        assert 0 < table.errors[name]["median"] <= table.errors[name]["rms"] < 0.01


def test_training_learns_and_reports_held_out_errors(trained) -> None:  # type: ignore[no-untyped-def]
    assert trained.errors["omega_yr_bar"]["rms"] < 0.05
    assert trained.errors["omega_t_bar"]["rms"] < 0.02
    rows = trained.provenance["rows"]
    assert sum(rows.values()) == 512
    assert rows["held_out"] > 30


def test_training_is_repeatable(tmp_path: Path, trained) -> None:  # type: ignore[no-untyped-def]
    again = train(str(invented(tmp_path)), SMALL, title="")
    assert again.identity == trained.identity
    other = train(str(invented(tmp_path)), replace(SMALL, seed=2), title="")
    assert other.identity != trained.identity


def test_early_stopping_keeps_the_best_weights(tmp_path: Path) -> None:
    """A step size that diverges after a while must not spoil what was good."""
    wild = replace(SMALL, learning_rate=0.5, epochs=60, patience=5)
    table = train(str(invented(tmp_path)), wild, title="")
    assert np.isfinite(table.errors["omega_yr_bar"]["rms"])


def test_the_split_is_fixed_and_disjoint() -> None:
    parts = split(np.arange(10_000))
    assert np.array_equal(parts[:500], split(np.arange(500)))
    shares = np.bincount(parts) / 10_000
    assert shares == pytest.approx([0.8, 0.1, 0.1], abs=0.02)


def test_files_come_back_as_they_were(tmp_path: Path, trained) -> None:  # type: ignore[no-untyped-def]
    save(trained, tmp_path / "model.pt")
    again = load(tmp_path / "model.pt")
    assert again.identity == trained.identity
    assert (again.domain, again.errors, again.provenance) == (
        trained.domain,
        trained.errors,
        trained.provenance,
    )
    (tmp_path / "broken.pt").write_bytes((tmp_path / "model.pt").read_bytes()[:2000])
    with pytest.raises(InputError, match="not a model file"):
        load(tmp_path / "broken.pt")


def test_a_reversed_motor_mirrors_the_answer() -> None:
    values = {k: v[:1] for k, v in columns_of(tuple(p[0] for p in STEADY_POINTS)).items()}
    values["dwell_bar"] = np.array([1.0])
    forward = load().query(values)
    backward = load().query({**values, "omega_bar": -values["omega_bar"]})
    for name in ("omega_t_bar", "omega_h_bar", "omega_yr_bar", "v_x"):
        assert backward[name] == pytest.approx(-forward[name])
    for name in ("v_z", "R_yr_over_l", "theta_deg", "net_speed_bar", "lag_psi_rad"):
        assert backward[name] == pytest.approx(forward[name])


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"omega_bar": 300.0}, "omega_bar = 300 is outside the look-up table"),
        ({"N": 6.0}, "N = 6 is outside"),
        ({"l_over_R": 2.0}, "l_over_R = 2 is outside"),
        ({"C_t": -1.0}, "C_t = -1"),
        ({"C_t": float("nan")}, "C_t = nan"),
        ({"colour": 1.0}, "unknown column"),
        ({"dwell_bar": 40.0}, "dwell_bar = 40 is outside"),
        ({"end_over_end_drag": 5.0}, "end_over_end_drag = 5 is outside"),
    ],
)
def test_the_command_refuses_and_writes_nothing(
    change: dict[str, float], expected: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    values = {k: v[0] for k, v in columns_of(tuple(p[0] for p in STEADY_POINTS)).items()} | change
    pd.DataFrame([values]).to_csv(tmp_path / "p.csv", index=False)
    assert run_command(main, ["query", str(tmp_path / "p.csv"), "--out", str(tmp_path / "o.csv")]) == 2
    error = capsys.readouterr().err
    assert expected in error
    assert len(error.splitlines()) == 1
    assert [p.name for p in tmp_path.iterdir()] == ["p.csv"]


def test_query_command(tmp_path: Path) -> None:
    pd.DataFrame(columns_of(tuple(p[0] for p in STEADY_POINTS))).to_csv(tmp_path / "p.csv", index=False)
    assert run_command(main, ["query", str(tmp_path / "p.csv"), "--out", str(tmp_path / "o.csv")]) == 0
    assert {"omega_yr_bar", "R_yr_over_l", "theta_deg"} <= set(pd.read_csv(tmp_path / "o.csv"))


def test_training_refuses_what_is_no_data_set(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(main, ["train", str(tmp_path), "--out", str(tmp_path / "m.pt")]) == 2
    assert "no finished data set" in capsys.readouterr().err
    with pytest.raises(InputError, match="training needs"):
        train(str(invented(tmp_path / "few", rows=40)), SMALL, title="")
    assert not (tmp_path / "m.pt").exists()
