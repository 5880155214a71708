"""A column is declared in one place: storage, card, report and the NaN of failed rows follow from it."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from matplotlib.figure import Figure

from dataset import build as engine
from dataset import schema
from dataset.build import build, mend
from dataset.data_set import batches, read
from dataset.report import write_report
from dataset.schema import Column, column_named, rows_version
from dataset.verify import verify
from sim.io.errors import InputError
from tests.dataset.sweeps import InThisProcess, design, invented

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
    monkeypatch.setattr("sim.io.pages.figure_markup", lambda _, description, number: f"{number}: {description}")
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
