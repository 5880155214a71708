"""The whole way on the command line, with the simulator: build, read, verify, mend, report."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import pytest

from common.errors import InputError, run_command
from dataset.__main__ import main
from dataset.data_set import read, read_manifest
from dataset.design import load_design
from dataset.verify import verify
from tests.dataset.sweeps import SMALL, write_rows
from tests.processes import LIMIT, ROOT

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("data")
    (folder / "sweep.toml").write_text(SMALL)
    words = ["build", "--config", str(folder / "sweep.toml"), "--out", str(folder / "out"), "--jobs", "1"]
    assert run_command(main, words) == 0
    return folder


def test_rows_are_simulated(built: Path) -> None:
    table = read(built / "out")
    assert table["converged"].tolist() == [True] * 6
    points = load_design(built / "sweep.toml").points()
    assert table["omega_bar"].to_numpy() == pytest.approx(points["omega_bar"])
    assert (table["omega_t_bar"] - table["omega_h_bar"]).to_numpy() == pytest.approx(points["omega_bar"])
    assert (table["cost_s"] > 0).all()


def test_verify_mends_and_checks_rows(built: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(main, ["verify", str(built / "out"), "--rows", "2", "--mend"]) == 0
    words = capsys.readouterr().out
    assert "6 rows are whole: no row simulated again, manifest kept" in words
    assert "2 rows simulated again: the same to rounding" in words


def test_verify_notices_a_changed_number_under_sound_digests(built: Path, tmp_path: Path) -> None:
    table, manifest = read(built / "out"), read_manifest(built / "out")
    sweep = load_design(built / "sweep.toml")
    for column, change, words in (("omega_yr_bar", 1.0000001, "omega_yr_bar of rows"), ("C_t", 1.1, "C_t")):
        columns = {name: table[name].to_numpy() for name in table}
        columns[column] = columns[column] * change
        write_rows(tmp_path / column, sweep, columns, manifest["code_version"])
        with pytest.raises(InputError, match=words):
            verify(tmp_path / column, rows=6)


def make(target: str, *words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(["make", target, *words], cwd=ROOT, text=True, capture_output=True, timeout=LIMIT)


def test_make_dataset_knows_its_sources(tmp_path: Path) -> None:
    if not (ROOT / ".venv" / ".installed").exists():
        pytest.skip("there is no .venv made by make setup")
    config, other_config, data = tmp_path / "a.toml", tmp_path / "b.toml", tmp_path / "data"
    config.write_text(SMALL)
    other_config.write_text(SMALL.replace("seed = 3", "seed = 4"))
    assert run_command(main, ["build", "--config", str(config), "--out", str(data), "--jobs", "1"]) == 0
    before = (data / "manifest.json").stat().st_mtime_ns
    assert make("dataset", f"CONFIG={config}", f"DATA={data}").returncode == 0
    assert (data / "manifest.json").stat().st_mtime_ns == before
    os.utime(other_config, ns=(1, 1))  # older than the data
    refused = make("dataset", f"CONFIG={other_config}", f"DATA={data}")
    assert refused.returncode != 0
    assert "seed 3 there, 4 here" in refused.stderr
    model = tmp_path / "model.safetensors"
    model.touch()
    done = make("train", f"CONFIG={config}", f"DATA={data}", f"MODEL={model}")
    assert done.returncode == 0
    assert "surrogate" not in done.stdout
