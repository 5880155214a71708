"""Chosen rows: points of the same sequence, kept, added to and checked like any others."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dataset.build.build import UnfinishedError, build, mend
from dataset.build.verify import verify
from dataset.rows.design import Axis
from dataset.storage.data_set import read, read_manifest
from sim.io.errors import InputError
from surrogate.table.model_file import load
from surrogate.training.refine import choose, doubt, refine
from surrogate.training.train import split, train
from tests.dataset import sweeps
from tests.dataset.sweeps import design, invented

FIRST = 100


@pytest.fixture
def base(tmp_path: Path) -> Path:
    build(design(FIRST), tmp_path / "base", jobs=1, title="", simulate=invented)
    return tmp_path / "base"


def refined(base: Path, rows: int, out: str = "more", simulate: sweeps.Rows = invented) -> Path:
    refine(base, load(), base.with_name(out), rows, jobs=1, title="", simulate=simulate)
    return base.with_name(out)


def test_chosen_rows_are_those_of_a_longer_sweep(base: Path) -> None:
    found = read(refined(base, 20))
    build(design(2000), base.with_name("long"), jobs=1, title="", simulate=invented)
    assert found.equals(read(base.with_name("long")).iloc[found["row"].to_numpy()].reset_index(drop=True))
    assert found["row"].min() >= FIRST
    assert (split(found["row"].to_numpy()) == 0).all()


def test_more_rows_are_added_and_the_first_ones_stay(base: Path) -> None:
    out = refined(base, 20)
    before, config = read(out), read_manifest(out)["config"]
    assert read(refined(base, 20)).equals(before)
    assert read(refined(base, 12)).equals(before)
    after = read(refined(base, 30))
    assert after[:20].equals(before)
    assert after["row"].is_unique
    assert len(after) == 30
    assert read_manifest(out)["config"] == config


def test_points_are_chosen_where_the_table_is_unsure() -> None:
    table, sweep = load(), replace(design(FIRST), axes={**design(FIRST).axes, "N": Axis(1, 5, "integer")})
    chosen = choose(table, sweep, 64, FIRST)
    assert chosen == choose(table, sweep, 64, FIRST)
    points = replace(sweep, rows=64, chosen=chosen).points()
    others = sweep.points(FIRST, FIRST + 1024)
    assert doubt(table, points).mean() > 1.3 * doubt(table, others).mean()
    assert not set(choose(table, sweep, 64, FIRST, chosen)) & set(chosen)


def test_an_interrupted_refinement_goes_on(base: Path) -> None:
    with pytest.raises(UnfinishedError):
        refined(base, 20, simulate=some_raise)
    sweeps.MARKS.joinpath("calm").touch()
    try:
        out = refined(base, 20, simulate=some_raise)
    finally:
        sweeps.MARKS.joinpath("calm").unlink()
    assert read(out).equals(read(refined(base, 20, "calm")))


def some_raise(p: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Rows of which some are a bug, until there is a mark."""
    if p["C_r"].max() > 3.3 and not sweeps.MARKS.joinpath("calm").exists():
        raise ZeroDivisionError
    return invented(p)


def test_other_rows_are_not_mixed_in(base: Path) -> None:
    out = refined(base, 20)
    with pytest.raises(InputError, match="holds chosen rows of this sweep"):
        build(design(200), out, jobs=1, title="", simulate=invented)
    with pytest.raises(InputError, match="the first rows of this sweep, none chosen"):
        refine(base, load(), base, 200, jobs=1, title="", simulate=invented)
    with pytest.raises(InputError, match="holds chosen rows"):
        refine(out, load(), base.with_name("third"), 20, jobs=1, title="", simulate=invented)
    with pytest.raises(InputError, match="other chosen rows"):
        build(replace(design(3), chosen=(200, 300, 400)), out, jobs=1, title="", simulate=invented)
    (out / "sweep.json").unlink()
    with pytest.raises(InputError, match="other rows of this sweep"):
        build(replace(design(20), chosen=tuple(range(200, 220))), out, jobs=1, title="", simulate=invented)


def test_an_edited_list_is_found(base: Path) -> None:
    out = refined(base, 20)
    content = json.loads((out / "sweep.json").read_text())
    content["chosen"][0] += 1
    (out / "sweep.json").write_text(json.dumps(content))
    for work in (lambda: refined(base, 20), lambda: mend(out, jobs=1, title=""), lambda: verify(out)):
        with pytest.raises(InputError, match="edited"):
            work()


def test_damage_is_found_and_mended(base: Path) -> None:
    out = refined(base, 20)
    before = read(out)
    (path,) = (out / "rows").iterdir()
    path.write_bytes(path.read_bytes()[:-40])
    with pytest.raises(InputError, match="cut short"):
        read(out)
    assert "20 rows are whole: 20 rows simulated again" in mend(out, jobs=1, title="")
    assert read(out).equals(before)


def test_a_file_of_the_first_rows_is_no_file_of_chosen_rows(base: Path) -> None:
    """Both have the same key, and may have the same name."""
    out = refined(base, FIRST)
    name = f"rows-0000000000-{FIRST:010d}.parquet"
    (out / "rows" / name).write_bytes((base / "rows" / name).read_bytes())
    with pytest.raises(InputError, match=r"digest|cut short"):
        read(out)
    assert f"{FIRST} rows simulated again" in mend(out, jobs=1, title="")


def test_training_counts_a_row_once(base: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    seen = {}

    def learn(learned: object, widths: object, held_out: object, *_: object, **__: object) -> None:
        seen["sizes"] = [len(part) for part in (learned, widths, held_out)]  # type: ignore[arg-type]

    monkeypatch.setattr("surrogate.training.train.learn", learn)
    more = refined(base, 60)
    train(str(base), title="")
    alone = seen["sizes"]
    train([str(base), str(more)], title="")
    both = seen["sizes"]
    assert both[0] == alone[0] + int((~read(more)["failed"]).sum())
    assert both[1:] == alone[1:]
    train([str(base), str(more), str(base)], title="")
    assert seen["sizes"] == both
