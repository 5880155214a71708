"""Rows depend on nothing but themselves and say what fails; a column is declared once: storage, card, report."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from matplotlib.figure import Figure

from common.errors import InputError
from dataset import build as engine
from dataset import schema
from dataset.build import build, mend
from dataset.data_set import batches, read
from dataset.report import write_report
from dataset.schema import COST, Column, column_named, rows_version
from dataset.simulate import simulate
from dataset.verify import verify
from sim.model.groups import SLOPE_INPUTS
from sim.model.presets import PRESETS
from sim.motion import response, run, settling, steady
from sim.solve.march import Marched, State
from sim.solve.refinement import LOST, NO_START, OrbitOnMeshes
from tests.dataset.sweeps import InThisProcess, design, invented

CONTROL = {**PRESETS["paper-control"].group_values(), "history": True}


def some_rows(*changes: dict[str, float]) -> dict[str, np.ndarray]:
    """Return columns of rows of the control robot with changes."""
    names = {name for change in changes for name in change} - set(CONTROL)
    base = {**CONTROL, **dict.fromkeys(names, 0.0), "a_over_R": 1.0}
    return {name: np.array([{**base, **change}[name] for change in changes]) for name in base}


def test_a_row_does_not_depend_on_its_batch(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nor does one that falls back to time steps, whose mesh is that of its own speed."""

    def lose_slow_and_fast(rows: np.ndarray, *words: Any) -> list[OrbitOnMeshes]:
        orbits = zip(np.abs(rows[:, 0]), refined_orbits(rows, *words), strict=True)
        return [lost(orbit) if speed < 9 or speed > 29 else orbit for speed, orbit in orbits]

    def lost(orbit: OrbitOnMeshes) -> OrbitOnMeshes:
        return orbit._replace(status=LOST, means=np.full(5, np.nan))

    refined_orbits = steady.refined_orbits
    monkeypatch.setattr(steady, "refined_orbits", lose_slow_and_fast)
    speeds = (8.0, 30.0, 10.0, 15.0, 20.0)
    points = some_rows(*({"omega_bar": speed, "history": speed == 15.0} for speed in speeds), {"N": 3.0})
    together = simulate(points)
    assert [bool(reason) for reason in together["reason"]] == [True, True, False, False, False, False]
    order = np.random.default_rng(2).permutation(6)
    mixed = [simulate({name: values[some] for name, values in points.items()}) for some in np.split(order, [2])]
    for name, values in together.items():
        if name != COST:
            assert np.concatenate([part[name] for part in mixed]).tobytes() == values[order].tobytes(), name


def test_rows_beyond_their_budget_say_so() -> None:
    """C_t = C_r = 1e-9 asked for 24 TiB, ω̄ = 1e-6 for days, ω̄ = 1e9 for 85 GiB."""
    found = simulate(some_rows({"C_t": 1e-9, "C_r": 1e-9}, {"omega_bar": 1e-6}, {"omega_bar": 1e9}, {}))
    assert found["failed"].tolist() == [True, True, True, False]
    assert all(found["reason"][:3])
    assert found["reason"][3] == ""
    assert np.isnan(found["omega_yr_bar"][:3]).all()
    assert np.isnan(found["lag_z"][:3]).all()
    assert found[COST].max() < 60


def test_one_to_eight_tails_other_discs_a_reversed_motor_and_memory_where_asked_for() -> None:
    found = simulate(
        some_rows(
            {"N": 1.0}, {"N": 8.0, "history": False}, {"a_over_R": 0.5}, {"omega_bar": 150.0},
            {"omega_bar": -10.0, "history": False}, {}, {"left_right_bias": 0.05},
            {"omega_bar": -10.0, "left_right_bias": 0.05},
        )
    )  # fmt: skip
    assert found["converged"].all()
    yaw, net = found["omega_yr_bar"], found["net_speed_bar"]
    assert yaw[4] == pytest.approx(-yaw[5], rel=1e-9)
    assert abs(yaw[6] + yaw[7]) > 0.01 * abs(yaw[6])
    known = np.isfinite(net[4])
    assert net[4][known] == pytest.approx(net[5][known], rel=1e-6)
    for name in ("memory_psi_rad", "rest_z"):
        assert np.isfinite(found[name]).all(1).tolist() == [True, False, True, True, False, True, True, True]
    assert found["lag_z"][4] == pytest.approx(found["lag_z"][5], abs=1e-9)


def test_derivatives_on_request() -> None:
    """Against differences of rows."""
    step = 1e-3
    rows = some_rows(
        {"history": False}, {"history": False, "C_yr": 2.0 - step}, {"history": False, "C_yr": 2.0 + step}
    )
    found = simulate(rows, sensitivities=True)
    place = SLOPE_INPUTS.index("C_yr")
    for name in ("omega_yr_bar", "v_x", "v_z", "R_yr_over_l"):
        slope = (found[name][2] - found[name][1]) / (2 * step)
        assert found[f"d_{name}"][0, place] == pytest.approx(slope, rel=1e-3, abs=1e-5)


def test_failed_rows_are_kept_and_flagged(monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither an orbit nor a time step can be solved."""

    none = (np.full((6, 2, 3), np.nan),) * 3
    lost = OrbitOnMeshes(NO_START, np.nan, np.full(5, np.nan), none, none)
    monkeypatch.setattr(steady, "refined_orbits", lambda rows, *_: [lost] * len(rows))
    monkeypatch.setattr(response, "orbits_with_phases", lambda rows, _, meshes: [[None] * len(rows)] * len(meshes))
    monkeypatch.setattr(settling, "state_on_orbit", lambda *_: None)
    nothing = Marched(0, np.empty((0, 6)), State(*[np.empty(0)] * 4))
    monkeypatch.setattr(run, "side_by_side", lambda _: [nothing])
    columns = simulate(some_rows({}))
    assert columns["failed"].tolist() == [True]
    assert columns["converged"].tolist() == [False]
    assert np.isnan(columns["omega_yr_bar"]).all()
    assert np.isnan(columns["net_speed_bar"]).all()
    assert columns["reason"][0]


TIP_SPEED = Column("tip_speed", pa.float64(), "EI/(mu0 l^3)", "speed of the tips", label="tip speed $v_t$",
                   logarithmic=True, shown=True)  # fmt: skip


def with_tip_speed(points: dict[str, np.ndarray]) -> dict[str, object]:
    """Make rows with one column more."""
    return {**invented(points), TIP_SPEED.name: np.abs(points["omega_bar"]) / points["l_over_R"]}


@pytest.fixture
def one_column_more(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(schema, "OUTPUTS", (*schema.OUTPUTS, TIP_SPEED))
    monkeypatch.setattr(engine, "open_backend", lambda *_: InThisProcess())


@pytest.mark.usefixtures("one_column_more")
def test_a_declared_column_is_stored_and_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Figures are made, but not drawn."""
    monkeypatch.setattr("common.pages.figure_markup", lambda _, description, number: f"{number}: {description}")
    monkeypatch.setattr(Figure, "tight_layout", lambda *_, **__: None)
    build(design(80), tmp_path / "out", title="", simulate=with_tip_speed)
    rows = read(tmp_path / "out")
    assert rows["tip_speed"].to_numpy() == pytest.approx(rows["omega_bar"] / rows["l_over_R"])
    file = next((tmp_path / "out" / "rows").iterdir())
    assert pq.read_schema(file).field("tip_speed").metadata[b"meaning"] == b"speed of the tips"
    write_report(str(tmp_path / "out"), tmp_path / "page.html")
    page = (tmp_path / "page.html").read_text()
    assert "tip speed against each input, by number of tails" in page
    assert "yaw rate, surge, turn radius, tip speed" in page  # their logarithms are taken
    row = r"<td[^>]*>tip speed</td><td[^>]*>omega_bar</td><td[^>]*>1\.00\s"  # a power law, without linear theory
    assert re.search(row, page)
    assert column_named("tip_speed").title == "tip speed $v_t$"


@pytest.fixture
def older(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Make a data set of another version of the code, which has one column less."""
    monkeypatch.setattr(engine, "open_backend", lambda *_: InThisProcess())
    build(design(60), tmp_path / "older", title="", simulate=invented)
    monkeypatch.setattr(schema, "OUTPUTS", (*schema.OUTPUTS, TIP_SPEED))
    for place in ("dataset.data_set.rows_version", "dataset.build.rows_version"):
        monkeypatch.setattr(place, lambda: "9.9+newer")
    return tmp_path / "older"


def test_new_code_on_an_old_folder_names_the_versions_first(older: Path, tmp_path: Path) -> None:
    words = re.escape(f"another version: {rows_version()} there, 9.9+newer here; use that version, or build")
    for act in (
        lambda: write_report(str(older), tmp_path / "page.html"),
        lambda: next(batches(older)),
        lambda: mend(older, title="", simulate=invented),
        lambda: verify(older),
        lambda: build(design(90), older, title="", simulate=invented),
    ):
        with pytest.raises(InputError, match=words) as refusal:
            act()
        assert "--mend" not in str(refusal.value)
    (older / "manifest.json").write_text("{")
    with pytest.raises(InputError, match=r"is damaged: .* use that version, or build") as refusal:
        read(older)
    assert "--mend" not in str(refusal.value)


def test_another_version_with_the_same_columns_is_read(older: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(schema, "OUTPUTS", schema.OUTPUTS[:-1])
    assert len(read(older)) == 60
    with pytest.raises(InputError, match="another version"):
        mend(older, title="", simulate=invented)
