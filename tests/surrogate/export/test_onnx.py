"""The query as an ONNX graph: the same answers in another runtime, for every N and both directions."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sim.io.errors import InputError, run_command
from sim.motion.steady_motion import STEADY_OUTPUTS
from surrogate.__main__ import main
from surrogate.export.onnx_query import save_onnx
from surrogate.input_ranges import ROBOT
from surrogate.table.lookup import NeuralTable
from surrogate.table.model_file import load
from surrogate.training.simulated import draw_robots
from tests.docs.pages import DOCS, blocks
from tests.surrogate.small import table

REASON = "needs the packages onnx and onnxruntime: pip install 'softflagella[onnx]'"


def session(lookup: NeuralTable, folder: Path) -> Any:
    onnxruntime = pytest.importorskip("onnxruntime", reason=REASON)
    pytest.importorskip("onnx", reason=REASON)
    save_onnx(lookup, folder / "query.onnx")
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    return onnxruntime.InferenceSession(str(folder / "query.onnx"), options, providers=["CPUExecutionProvider"])


def run(made: Any, robots: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    names = [output.name for output in made.get_outputs()]
    return dict(zip(names, made.run(None, robots), strict=True))


def of(count: int, seed: int, *, wide: bool) -> dict[str, np.ndarray]:
    robots = {
        name: np.array(values) for name, values in draw_robots(count, seed, wide=wide).items() if name in ROBOT
    }
    robots["omega_bar"][::2] *= -1
    return robots


@pytest.mark.parametrize("wide", [False, True])
def test_it_answers_as_the_table_does(wide: bool, tmp_path: Path) -> None:
    made = session(load(), tmp_path)
    robots = of(2048, 31, wide=wide)
    assert set(robots["N"]) >= set(range(1, 9))
    wanted, found = load().query(robots, flag=True), run(made, robots)
    assert np.count_nonzero(wanted["outside"] != found["outside"]) <= 2  # a limit may be met to rounding
    inside = ~wanted["outside"] & ~found["outside"]
    assert inside.mean() > 0.9
    # The table of one tail has second solutions. Rounding decides which one some few robots get.
    other = np.abs(found["omega_t_bar"] / wanted["omega_t_bar"] - 1) > 1e-8
    assert np.count_nonzero(inside & other) <= 3
    assert (robots["N"][inside & other] == 1).all()
    inside &= ~other
    for name in STEADY_OUTPUTS:
        size = np.hypot(wanted["v_x"], wanted["v_z"]) if name == "v_z" else np.abs(wanted[name])
        with np.errstate(invalid="ignore"):
            error = np.where(found[name] == wanted[name], 0.0, np.abs(found[name] - wanted[name]) / size)
        assert error[inside].max() < 1e-8, name


def test_the_example_of_the_page_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    session(load(), tmp_path)
    monkeypatch.chdir(tmp_path)
    (code,) = (block.code for block in blocks(DOCS / "howto" / "files.md") if block.language == "python")
    exec(compile(code, "files.md", "exec"), {})
    assert "'omega_yr_bar': array([0.049" in capsys.readouterr().out


def test_robots_far_outside_are_flagged_and_one_robot_is_enough(tmp_path: Path) -> None:
    made = session(load(), tmp_path)
    one = {name: values[:1] for name, values in of(8, 3, wide=False).items()}
    answer = load().query(one, flag=True)
    assert run(made, one)["omega_yr_bar"] == pytest.approx(answer["omega_yr_bar"], rel=1e-8)
    for name, value in (("omega_bar", 1e5), ("l_over_R", 0.1), ("l_over_r0", 1e4)):
        assert run(made, {**one, name: np.array([value])})["outside"].all()


def test_a_table_that_learned_some_tails_only_flags_the_others(tmp_path: Path) -> None:
    made = session(table(), tmp_path)  # two members, and robots with three and more tails
    robots = of(256, 32, wide=False)
    wanted, found = table().query(robots, flag=True), run(made, robots)
    assert found["outside"][robots["N"] < 3].all()
    inside = ~wanted["outside"] & ~found["outside"]
    assert inside.sum() > 50
    assert found["v_z"][inside] == pytest.approx(wanted["v_z"][inside], rel=1e-7)
    assert np.count_nonzero(wanted["outside"] != found["outside"]) <= 1


def test_inputs_and_outputs_have_names_and_units(tmp_path: Path) -> None:
    made = session(load(), tmp_path)
    assert [part.name for part in made.get_inputs()] == [*ROBOT]
    assert [part.name for part in made.get_outputs()] == [*STEADY_OUTPUTS, "outside"]
    told = made.get_modelmeta().custom_metadata_map
    assert told["table"] == load().identity
    assert set(json.loads(told["units"])) == {*ROBOT, *STEADY_OUTPUTS, "outside"}
    assert json.loads(told["domain"])["omega_bar"] == [*load().ranges["omega_bar"]]


def test_the_command_writes_the_same_bytes_again(tmp_path: Path) -> None:
    session(load(), tmp_path)
    assert run_command(main, ["export", "--onnx", str(tmp_path / "again.onnx")]) == 0
    assert (tmp_path / "again.onnx").read_bytes() == (tmp_path / "query.onnx").read_bytes()


def test_without_the_package_the_message_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setitem(sys.modules, "onnx", None)
    monkeypatch.delitem(sys.modules, "surrogate.export.onnx_builder", raising=False)
    with pytest.raises(
        InputError, match=r"needs the package onnx; install it with pip install 'softflagella\[onnx\]'"
    ):
        save_onnx(load(), tmp_path / "query.onnx")


def test_the_command_needs_something_to_write(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(main, ["export"]) == 2
    assert "give --onnx OUT.onnx or --small FOLDER" in capsys.readouterr().err
