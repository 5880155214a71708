"""The small copy of the look-up table: its size and loss, and its reader in C."""

from __future__ import annotations

import ctypes
import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import safetensors.numpy

from sim.io.errors import InputError, run_command
from sim.model.groups import DWELL
from sim.motion.steady_motion import STEADY_OUTPUTS
from surrogate.__main__ import main
from surrogate.domain import ROBOT
from surrogate.errors import RESPONSE_OUTPUTS, error_scale
from surrogate.small_copy import MAX_BYTES, export, make_small_copy, measure_losses
from surrogate.table_file import load
from surrogate.training.simulated import draw_robots
from tests.planner.compiled import compile_c
from tests.surrogate.small import table

pytestmark = pytest.mark.slow

OUTPUTS = (*STEADY_OUTPUTS, *RESPONSE_OUTPUTS)
LIBRARY = """#include "lookup.h"
int answer(const double *in, double *out)
{
    lookup_robot robot;
    lookup_motion motion;
    lookup_flip flip;
    lookup_real *inputs = &robot.C_t, *steady = &motion.omega_t_bar, *response = &flip.net_speed_bar;
    int state, other;
    for (int i = 0; i < 9; i++) inputs[i] = (lookup_real)in[i];
    state = lookup_query(&robot, &motion);
    for (int i = 0; i < 8; i++) out[i] = state == LOOKUP_NO_ANSWER ? NAN : steady[i];
    other = lookup_response(&robot, (lookup_real)in[9], &flip);
    for (int i = 0; i < 4; i++) out[8 + i] = other == LOOKUP_NO_ANSWER ? NAN : response[i];
    return state;
}
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("small")
    export(made)
    return made


def random_robots(count: int, seed: int) -> dict[str, np.ndarray]:
    robots = {
        name: np.array(values) for name, values in draw_robots(count, seed, wide=False).items() if name in ROBOT
    }
    robots["omega_bar"][::2] *= -1
    robots[DWELL] = np.geomspace(0.2, 5.0, count)
    return {name: robots[name] for name in (*ROBOT, DWELL)}


def library(folder: Path, *flags: str) -> ctypes.CDLL:
    (folder / "library.c").write_text(LIBRARY)
    out = folder / f"library{len(flags)}.so"
    compile_c(folder / "library.c", out, "-shared", "-fPIC", *flags)
    return ctypes.CDLL(str(out))


def answers(made: ctypes.CDLL, robots: dict[str, np.ndarray]) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Return what C answers, and its states."""
    rows = np.ascontiguousarray(np.stack([robots[name] for name in (*ROBOT, DWELL)], 1))
    found, states = np.zeros((len(rows), len(OUTPUTS))), []
    for row, out in zip(rows, found, strict=True):
        pointers = (part.ctypes.data_as(ctypes.POINTER(ctypes.c_double)) for part in (row, out))
        states.append(made.answer(*pointers))
    return dict(zip(OUTPUTS, found.T, strict=True)), np.array(states)


def apart(found: dict[str, np.ndarray], wanted: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Compute differences over the scales of the outputs; 0 where neither has an answer."""
    result = {}
    for name in OUTPUTS:
        same = (found[name] == wanted[name]) | (np.isnan(found[name]) & np.isnan(wanted[name]))
        with np.errstate(invalid="ignore"):
            result[name] = np.where(same, 0.0, np.abs(found[name] - wanted[name]) / error_scale(name, wanted))
    return result


def vectors(folder: Path) -> dict[str, np.ndarray]:
    return {str(name): column.to_numpy() for name, column in pd.read_csv(folder / "vectors.csv").items()}


def test_it_is_small_and_states_its_loss(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    data = (folder / "lookup.safetensors").read_bytes()
    assert len(data) <= MAX_BYTES
    arrays = safetensors.numpy.load(data)
    assert sum(array.nbytes for array in arrays.values()) == make_small_copy(load()).bytes
    header = json.loads(data[8 : 8 + int.from_bytes(data[:8], "little")])
    manifest = json.loads(header["__metadata__"]["manifest"])
    assert manifest["table"] == load().identity
    assert set(manifest["units"]) == {*ROBOT, DWELL, *OUTPUTS}
    loss = manifest["loss"]
    assert {*OUTPUTS} <= set(loss)
    for name in ("omega_t_bar", "omega_yr_bar", "v_x", "v_z", "R_yr_over_l"):  # nothing beside the table's errors
        assert loss[name]["p95"] < 0.05 * load().errors[name]["median"], name
        thrust = name in ("v_z", "R_yr_over_l")  # a small difference of large numbers, with one tail
        assert loss[f"{name} one_tail"]["p95"] < (0.002 if thrust else 0.001)
    for name in (*RESPONSE_OUTPUTS, "tail_gap"):
        assert loss[name]["p95"] < load().errors[name]["p95"], name
    monkeypatch.setattr("surrogate.small_copy._SEED", 91)  # of other robots
    for name, figures in measure_losses(load(), make_small_copy(load())).items():
        assert figures["p95"] < 2 * loss[name]["p95"], name


def test_the_reader_in_c_answers_for_all_robots(folder: Path) -> None:
    """In double precision as its vectors and the table of the same numbers, in single precision nearly."""
    made, wanted = library(folder), vectors(folder)
    assert set(wanted["N"]) == set(range(1, 9))
    assert {-1.0, 1.0} == set(np.sign(wanted["omega_bar"]))
    found, states = answers(made, wanted)
    assert (states == 0).all()
    assert all(error.max() < 1e-9 for error in apart(found, wanted).values())
    robots, small = random_robots(1024, 92), make_small_copy(load())
    wanted, groups = small.query(robots), {name: robots[name] for name in ROBOT}
    inside = ~(load().query(groups, flag=True)["outside"] | small.table.query(groups, flag=True)["outside"])
    assert inside.mean() > 0.97
    found, states = answers(made, robots)
    assert (states[inside] == 0).all()
    assert all(error[inside].max() < 1e-8 for error in apart(found, wanted).values())
    single, states = answers(library(folder, "-DLOOKUP_FLOAT"), robots)
    assert (states[inside] == 0).all()
    for name, error in apart(single, wanted).items():
        assert error[inside].max() < (1e-2 if name in ("tail_gap", "theta_deg") else 1e-3), name
        several = robots["N"] > 1
        for some, most in ((several, 4e-5 if name == "theta_deg" else 2e-5), (~several, 1e-3)):
            assert np.quantile(error[inside & some], 0.95) < most, name


def test_the_reader_in_c_says_when_it_does_not_know(folder: Path) -> None:
    made = library(folder)
    several = vectors(folder)["N"] > 1
    good = {name: values[several][:1] for name, values in vectors(folder).items() if name in (*ROBOT, DWELL)}
    for name, value, state in (
        ("omega_bar", 1e3, 1), ("l_over_R", 100.0, 1), ("N", 20.0, 1), ("omega_bar", 0.0, 2), ("C_t", -1.0, 2),
        ("C_t", np.nan, 2), ("N", 0.0, 2),
    ):  # fmt: skip
        assert answers(made, {**good, name: np.array([value])})[1][0] == state, (name, value)
    for name, value in ((DWELL, 0.1), ("N", 1.0)):
        assert np.isnan(answers(made, {**good, name: np.array([value])})[0]["net_speed_bar"][0])


def test_a_table_that_learned_some_tails_only(tmp_path: Path) -> None:
    export(tmp_path, lookup=table())  # three and more tails, two members
    made, wanted = library(tmp_path), vectors(tmp_path)
    assert (wanted["N"] > 2).all()
    found, states = answers(made, wanted)
    assert (states < 2).all()
    assert all(error.max() < 1e-8 for error in apart(found, wanted).values())
    assert (answers(made, {**wanted, "N": np.full(len(states), 2.0)})[1] == 2).all()


def test_a_table_that_does_not_fit_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("surrogate.small_copy.MAX_BYTES", 120_000)
    with pytest.raises(InputError, match="too large for 120 kB"):
        make_small_copy(load())


def test_the_command_prints_the_loss(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(main, ["export", "--small", str(tmp_path / "out")]) == 0
    said = capsys.readouterr().out
    assert "omega_yr_bar" in said
    assert "kB; loss against the whole table" in said
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert names == {"lookup.safetensors", "lookup_weights.h", "lookup.h", "vectors.csv"}
