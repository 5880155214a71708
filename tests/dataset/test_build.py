"""The engine: rows are added, not made anew; a dead worker is replaced; one writer and one sweep a folder."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import pandas as pd
import pytest

from common.errors import InputError
from dataset import build as engine
from dataset.build import UnfinishedError, build, chunk_rows, cut, mend, missing
from dataset.data_set import SWEEP, read
from dataset.design import Axis
from dataset.schema import rows_version
from dataset.workers import Chunk, Ended, Failure
from tests.dataset import sweeps
from tests.dataset.sweeps import InThisProcess, design, invented
from tests.shared import shared


@pytest.fixture(autouse=True)
def marks() -> Path:
    for mark in sweeps.MARKS.iterdir():
        mark.unlink()
    return sweeps.MARKS


@shared
def calm_rows(rows: int) -> pd.DataFrame:
    """Return the rows of an undisturbed build."""
    with TemporaryDirectory() as folder:
        build(design(rows), Path(folder) / "out", jobs=1, title="", simulate=invented)
        return read(Path(folder) / "out")


def files(folder: Path) -> dict[str, int]:
    return {str(p.relative_to(folder)): p.stat().st_mtime_ns for p in folder.rglob("*") if p.is_file()}


@pytest.mark.slow
def test_more_rows_only_add_chunks(tmp_path: Path) -> None:
    """The last chunk of 190 rows is a short one."""
    out = tmp_path / "out"
    build(design(190), out, jobs=2, title="", simulate=invented)
    before = files(out / "rows")
    build(design(300), out, jobs=1, title="", simulate=invented)
    assert read(out).equals(calm_rows(300))
    assert files(out / "rows").items() > before.items()


def test_rows_that_are_missing_are_cut_on_a_grid() -> None:
    parts = [sweeps.part(start, stop) for start, stop in ((0, 20), (30, 40), (95, 110))]
    assert missing(parts, 100) == [(20, 30), (40, 95)]
    assert missing(parts, 120) == [(20, 30), (40, 95), (110, 120)]
    assert list(cut([(20, 30), (40, 95)], 25)) == [(20, 25), (25, 30), (40, 50), (50, 75), (75, 95)]


def test_chunks_are_shares_of_the_workers_and_few_where_rows_are_many() -> None:
    assert chunk_rows(100, 100, 5) == 5
    assert chunk_rows(10**5, 10**5, 2) == 1024
    assert chunk_rows(10**7, 10**7, 1000) == 2442
    assert chunk_rows(10**7, 2000, 1000) == 1  # rows that are mended


def test_a_finished_build_is_left_alone_and_another_configuration_is_not_mixed_in(tmp_path: Path) -> None:
    build(design(20), tmp_path / "out", jobs=1, title="", simulate=invented)
    before = files(tmp_path / "out")
    del before[".lock"]
    manifest = build(design(20), tmp_path / "out", jobs=1, title="", simulate=invented)
    assert manifest == build(design(9), tmp_path / "out", jobs=1, title="", simulate=invented)
    assert manifest["rows"] == 20
    with pytest.raises(InputError, match="seed 5 there, 6 here"):
        build(design(20, seed=6), tmp_path / "out", jobs=1, title="", simulate=invented)
    other = design(20)
    other.axes["C_r"] = Axis(1.5, 3.0, "linear")
    with pytest.raises(InputError, match=r"C_r .*\[1.5, 3.5\].* there, .*\[1.5, 3.0\].* here"):
        build(other, tmp_path / "out", jobs=1, title="", simulate=invented)
    with pytest.raises(InputError, match=r"made by tests.*invented there, tests.*raising here"):
        build(design(20), tmp_path / "out", jobs=1, title="", simulate=sweeps.raising)
    assert files(tmp_path / "out").items() >= before.items()
    path = tmp_path / "out" / SWEEP
    content = json.loads(path.read_text())
    content["config"]["seed"] = 6
    path.write_text(json.dumps(content))
    with pytest.raises(InputError, match="edited"):
        build(design(20, seed=6), tmp_path / "out", jobs=1, title="", simulate=invented)


@pytest.mark.parametrize("name", ["thesis.txt", "part-00000.parquet", "manifest.json"])
def test_a_folder_with_other_files_is_left_alone(name: str, tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / name).write_text("x")
    with pytest.raises(InputError, match=rf"holds other files \({name}\)"):
        build(design(20), tmp_path / "out", jobs=1, title="", simulate=invented)
    assert (tmp_path / "out" / name).read_text() == "x"


@pytest.mark.slow
def test_a_killed_worker_is_replaced_and_its_chunk_tried_again(tmp_path: Path, marks: Path) -> None:
    build(design(100), tmp_path / "out", jobs=2, title="", simulate=sweeps.killing_once)
    assert read(tmp_path / "out").equals(calm_rows(100))
    attempts = [p.name.split("-")[-2] for p in marks.iterdir()]
    assert attempts.count("0") == attempts.count("1") == 8


@pytest.mark.slow
@pytest.mark.parametrize(
    ("simulate", "reason"),
    [(sweeps.poisonous, "its worker died 3 times"), (sweeps.raising, "ZeroDivisionError: a robot that nobody")],
)
def test_a_poisonous_chunk_is_set_aside_and_named_and_damaged_files_are_made_again(
    simulate: sweeps.Rows, reason: str, tmp_path: Path, marks: Path
) -> None:
    words = rf"rows 100 to 124 \({reason}.* 175 of 200 rows"
    with pytest.raises(UnfinishedError, match=words) as ended:
        build(design(200), tmp_path / "out", jobs=2, title="", simulate=simulate)
    assert ended.value.status == 1
    assert len(list(marks.iterdir())) == (3 if simulate is sweeps.poisonous else 0)
    with pytest.raises(InputError, match="no finished data set"):
        read(tmp_path / "out")
    one, two, *rest = sorted((tmp_path / "out" / "rows").iterdir())
    assert len(rest) == 5
    one.write_bytes(one.read_bytes()[:-50])
    whole, before = two.read_bytes(), files(tmp_path / "out" / "rows")
    two.write_bytes(whole[:2000] + bytes([whole[2000] ^ 1]) + whole[2001:])
    with pytest.raises(UnfinishedError, match=rf"rows 100 to 109 \({reason}.* 190 of 200 rows"):
        build(design(200), tmp_path / "out", jobs=2, title="", simulate=simulate)
    assert len(files(tmp_path / "out" / "rows").items() & before.items()) == 5


class Forgetful(InThisProcess):
    """A backend in this process that loses every chunk once, and has no workers for a while."""

    def __init__(self, absent: int = 0):
        super().__init__()
        self.absent, self.seen = absent, set[int]()

    def slots(self) -> int:
        self.absent -= 1
        return 0 if self.absent >= 0 else 2

    def collect(self, seconds: float) -> Ended:
        ended: Ended = []
        for chunk, outcome in super().collect(seconds):
            ended.append((chunk, outcome if chunk.start in self.seen else Failure("gone")))
            self.seen.add(chunk.start)
        return ended


def test_chunks_that_a_cluster_loses_are_submitted_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What a worker stored before it was lost stays as it is."""
    crew = Forgetful(absent=3)
    monkeypatch.setattr(engine, "open_backend", lambda *_: crew)
    build(design(200), tmp_path / "out", title="", simulate=invented)
    assert len(crew.seen) == 4
    assert read(tmp_path / "out").equals(calm_rows(200))


def test_without_workers_it_ends_with_a_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(engine, "open_backend", lambda *_: Forgetful(absent=10**9))
    monkeypatch.setattr(engine, "PATIENCE", 0.5)
    with pytest.raises(UnfinishedError, match=r"no workers for .* 0 of 50 rows .* go on with: the same words"):
        build(design(50), tmp_path / "out", title="", simulate=invented, resume="the same words")


def test_workers_with_other_code_without_the_folder_or_of_another_build_write_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def outcome(address: Path, **changes: object) -> Failure:
        known = (design(1).config(), "", rows_version(), [1, 1], invented, 0, 1)
        found = Chunk(str(address), *known)._replace(**changes).run()
        assert isinstance(found, Failure)
        assert found.kind == "refused"
        return found

    assert "does not see" in outcome(tmp_path / "elsewhere").message
    monkeypatch.setattr(engine, "open_backend", lambda *_: InThisProcess())
    build(design(20), tmp_path / "out", title="", simulate=invented)
    before = files(tmp_path / "out")
    assert "has version" in outcome(tmp_path / "out", code="0.0+other").message
    assert "another build has begun" in outcome(tmp_path / "out").message
    assert files(tmp_path / "out") == before
    monkeypatch.setattr(engine, "rows_version", lambda: "0.0+other")
    with pytest.raises(InputError, match=r"has version .* the build has 0\.0\+other"):
        build(design(50), tmp_path / "new", title="", simulate=invented)


def lose_a_file(out: Path) -> None:
    next((out / "rows").iterdir()).unlink()


def repeat_rows(out: Path) -> None:
    """In a file of a build that cuts its chunks otherwise."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(engine, "open_backend", lambda *_: InThisProcess())
        with pytest.raises(UnfinishedError):
            build(design(200), out.with_name("other"), title="", simulate=sweeps.raising)
    shutil.copy(out.with_name("other") / "rows" / "rows-0000000000-0000000050.parquet", out / "rows")


@pytest.mark.parametrize("damage", [lose_a_file, repeat_rows])
def test_mending_an_unfinished_build_finishes_it(
    damage: Callable[[Path], None], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(engine, "open_backend", lambda *_: Forgetful())
    with pytest.raises(UnfinishedError):
        build(design(200), tmp_path / "out", title="", simulate=sweeps.raising)
    damage(tmp_path / "out")
    monkeypatch.setattr(sweeps, "DANGER", False)
    mend(tmp_path / "out", title="", simulate=sweeps.raising)
    assert read(tmp_path / "out").equals(calm_rows(200))


@pytest.mark.parametrize(
    ("backend", "jobs", "words"),
    [
        ("ray", 1, "backend 'ray'; allowed are local, dask"),
        ("local", 0, "jobs = 0"),
        ("dask", 1, r"pip install 'dask\[distributed\]'"),
    ],
)
def test_impossible_backends_leave_no_folder(
    backend: str, jobs: int, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("dataset.clusters.find_spec", lambda _: None)
    with pytest.raises(InputError, match=words):
        build(design(4), tmp_path / "out", backend=backend, jobs=jobs, title="", simulate=invented)
    assert not (tmp_path / "out").exists()
