"""The engine: rows are added, not made anew; a dead worker is replaced; one writer and one sweep a folder."""

from __future__ import annotations

import json
from pathlib import Path
from tempfile import TemporaryDirectory

import pandas as pd
import pytest

from dataset.build import scheduler as engine
from dataset.build.build import build, chunks
from dataset.build.signals import UnfinishedError
from dataset.rows.design import Axis
from dataset.rows.version import rows_version
from dataset.storage.data_set import read
from dataset.storage.storage import open_storage
from dataset.workers.backend import GONE
from dataset.workers.tasks import Join, Task, run_task
from sim.io.errors import InputError
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
def test_more_rows_only_add_chunks(tmp_path: Path, marks: Path) -> None:
    short = tmp_path / "short"
    build(design(120), short, jobs=1, title="", simulate=sweeps.slow)
    done = len(list(marks.iterdir()))
    build(design(200), short, jobs=2, title="", simulate=sweeps.slow)
    assert read(short).equals(calm_rows(200))
    first = {float(c).hex() for c in design(120).points()["C_t"]}
    made = [p.name.split("-")[1] for p in marks.iterdir()]
    assert len(made) > done == 4
    assert sum(name in first for name in made) == done
    assert [path.name for path in (short / "rows").iterdir()] == ["rows-0000000000-0000000200.parquet"]


def test_a_finished_build_is_left_alone_and_another_configuration_is_not_mixed_in(tmp_path: Path) -> None:
    build(design(20), tmp_path / "out", jobs=1, title="", simulate=invented)
    before = files(tmp_path / "out")
    manifest = build(design(20), tmp_path / "out", jobs=1, title="", simulate=invented)
    assert manifest == build(design(9), tmp_path / "out", jobs=1, title="", simulate=invented)
    assert manifest["rows"] == 20
    with pytest.raises(InputError, match="seed 5 there, 6 here"):
        build(design(20, seed=6), tmp_path / "out", jobs=1, title="", simulate=invented)
    other = design(20)
    other.axes["C_r"] = Axis(1.5, 3.0, "linear")
    with pytest.raises(InputError, match=r"C_r \[1.5, 3.5\] linear there, \[1.5, 3\] linear here"):
        build(other, tmp_path / "out", jobs=1, title="", simulate=invented)
    with pytest.raises(InputError, match=r"made by tests.*invented, not by tests.*raising"):
        build(design(20), tmp_path / "out", jobs=1, title="", simulate=sweeps.raising)
    assert files(tmp_path / "out") == before
    path = tmp_path / "out" / "sweep.json"
    content = json.loads(path.read_text())
    content["config"]["seed"] = 6
    path.write_text(json.dumps(content))
    with pytest.raises(InputError, match="edited"):
        build(design(20, seed=6), tmp_path / "out", jobs=1, title="", simulate=invented)


@pytest.mark.parametrize("name", ["thesis.txt", "part-00000.parquet", "manifest.json"])
def test_a_folder_with_other_files_is_left_alone(name: str, tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / name).write_text("x")
    with pytest.raises(InputError, match=r"thesis|older|manifest\.json"):
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
def test_a_poisonous_chunk_is_set_aside_and_named(
    simulate: sweeps.Rows, reason: str, tmp_path: Path, marks: Path
) -> None:
    with pytest.raises(UnfinishedError, match=r"rows \d+ to \d+ \(" + reason) as ended:
        build(design(200), tmp_path / "out", jobs=2, title="", simulate=simulate)
    assert ended.value.status != 0
    assert len(list(marks.iterdir())) == (3 if simulate is sweeps.poisonous else 0)
    with pytest.raises(InputError, match="no finished data set"):
        read(tmp_path / "out")
    held = sum(int(p.stem[16:]) - int(p.stem[5:15]) for p in (tmp_path / "out" / "pending").iterdir())
    assert held == 200 - 25
    assert f"{held} of 200 rows" in str(ended.value)


@pytest.mark.slow
def test_a_damaged_pending_piece_is_made_again(tmp_path: Path) -> None:
    with pytest.raises(UnfinishedError):
        build(design(200), tmp_path / "out", jobs=1, title="", simulate=sweeps.raising)
    pending = sorted((tmp_path / "out" / "pending").iterdir())
    pending[0].write_bytes(pending[0].read_bytes()[:-50])
    whole = pending[1].read_bytes()
    pending[1].write_bytes(whole[:2000] + bytes([whole[2000] ^ 1]) + whole[2001:])
    with pytest.raises(UnfinishedError, match=r"rows 76 to 113 .* 162 of 200"):
        build(design(200), tmp_path / "out", jobs=1, title="", simulate=sweeps.raising)


class Forgetful(InThisProcess):
    """A backend in this process that forgets every task once, and has no workers for a while."""

    def __init__(self, absent: int = 0):
        super().__init__()
        self.absent, self.seen = absent, list[Task | Join]()

    def slots(self) -> int:
        self.absent -= 1
        return 0 if self.absent >= 0 else 2

    def submit(self, number: int, task: Task | Join) -> None:
        self.seen.append(task)
        if [(type(one), one.start) for one in self.seen].count((type(task), task.start)) > 1:
            super().submit(number, task)
        else:
            self._ended.append((number, GONE))


def test_files_are_joined_by_workers_and_forgotten_tasks_are_asked_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("dataset.build.sweep_folder.SEGMENT", 64)
    crew = Forgetful(absent=3)
    monkeypatch.setattr("dataset.build.build.open_backend", lambda *_, **__: crew)
    build(design(200), tmp_path / "out", title="", simulate=invented)
    joined = [(task.start, task.stop) for task in crew.seen if isinstance(task, Join)]
    assert sorted(joined) == sorted(2 * [(0, 64), (64, 128), (128, 192)])  # each of them forgotten once
    assert len(list((tmp_path / "out" / "rows").iterdir())) == 4
    monkeypatch.undo()
    assert read(tmp_path / "out").equals(calm_rows(200))


def test_a_piece_that_is_damaged_before_it_is_joined(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    class Damaging(Forgetful):
        def submit(self, number: int, task: Task | Join) -> None:
            if isinstance(task, Join):
                path = tmp_path / "out" / task.sources[0].name
                path.write_bytes(path.read_bytes()[:-50])
            super().submit(number, task)

    monkeypatch.setattr("dataset.build.build.open_backend", lambda *_, **__: Damaging())
    with pytest.raises(UnfinishedError, match=r"skipped: rows 0 to 199 \(BadShardError: it is damaged"):
        build(design(200), tmp_path / "out", title="", simulate=invented)
    monkeypatch.setattr("dataset.build.build.open_backend", lambda *_, **__: Forgetful())
    build(design(200), tmp_path / "out", title="", simulate=invented)
    assert read(tmp_path / "out").equals(calm_rows(200))


def test_without_workers_it_ends_with_a_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("dataset.build.build.open_backend", lambda *_, **__: Forgetful(absent=10**9))
    monkeypatch.setattr(engine, "PATIENCE", 0.5)
    with pytest.raises(UnfinishedError, match=r"no workers for .* 0 of 50 rows .* go on with: the same words"):
        build(design(50), tmp_path / "out", title="", simulate=invented, resume="the same words")


def test_a_worker_with_other_code_or_without_the_folder_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    there = open_storage(tmp_path / "elsewhere")
    kind, words = run_task(Task(there.address, design(1).config(), "", rows_version(), invented, 0, 1))
    assert kind == "storage"
    assert "does not see" in words
    monkeypatch.setattr("dataset.build.build.rows_version", lambda: "0.0+other")
    with pytest.raises(InputError, match=r"has version .* the build has 0\.0\+other"):
        build(design(50), tmp_path / "out", jobs=1, title="", simulate=invented)


def test_chunks_are_sized_by_cost_and_workers() -> None:
    def sizes(rows: int, workers: int, cost: float) -> set[int]:
        return {stop - start for start, stop in list(chunks([(0, rows)], workers, cost))[:-1]}

    assert sizes(10**6, 2, 0.1) == {1024}
    assert sizes(10**6, 2, 0.01) == {2000}
    assert sizes(10**6, 2, 0.001) == {4096}
    assert sizes(1000, 2, 0.01) == {125}
    assert list(chunks([(0, 3), (10, 12)], 1, 1.0)) == [(0, 2), (2, 3), (10, 12)]


@pytest.mark.parametrize(
    ("backend", "jobs", "words"),
    [
        ("slurm", 1, "allowed are loky"),
        ("loky", 0, "jobs = 0"),
        ("dask", 1, r"pip install 'dask\[distributed\]'"),
        ("ray", 1, "install 'ray'"),
    ],
)
def test_impossible_backends_leave_no_folder(
    backend: str, jobs: int, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("dataset.workers.open_backend.find_spec", lambda _: None)
    with pytest.raises(InputError, match=words):
        build(design(4), tmp_path / "out", backend=backend, jobs=jobs, title="", simulate=invented)
    assert not (tmp_path / "out").exists()
