"""A query of one robot: the numbers of the batch, the words of its refusals, and what it imports."""

from __future__ import annotations

import copy
import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from sim.io.errors import InputError
from sim.model.groups import DWELL
from surrogate.interface import OutsideError
from surrogate.table import quick_query
from surrogate.table.model_file import load
from surrogate.training.simulated import draw_robots
from tests.processes import LIMIT
from tests.surrogate.small import robots_inside, table

ROBOT = {"C_t": 3.0, "C_r": 2.8, "C_yr": 2.0, "l_over_R": 6.875, "L_over_R": 3.75, "l_over_r0": 34.375,
         "omega_bar": 10.0, "N": 3.0, "a_over_R": 1.0}  # fmt: skip
FIRST_ANSWER = """
import sys
import numpy as np
from sim.inputs import load_robot
from surrogate.table.model_file import load_table
groups = {name: np.array([value]) for name, value in load_robot("paper-control").group_values().items()}
load_table().query(groups)
load_table().query({**groups, "dwell_bar": np.array([1.0])}, intervals=True)
load_table().query({**groups, "motor_droop": np.array([1.0])})
print(*sys.modules)
"""
PLAN = """
import sys
from softflagella.__main__ import main
main(["plan", "circle:3l", "--robot", "paper-control", "--out", sys.argv[1]])
print(*sys.modules)
"""


def one(**changes: float) -> dict[str, np.ndarray]:
    return {name: np.array([value]) for name, value in (ROBOT | changes).items()}


@pytest.mark.parametrize("options", [{}, {"flag": True}, {"intervals": True}, {"intervals": True, "flag": True}])
@pytest.mark.parametrize("with_dwell", [False, True])
def test_one_robot_has_the_numbers_of_the_batch(with_dwell: bool, options: dict[str, bool]) -> None:
    """To 1e-12, reversed motors and robots with one tail among them; the batch takes other steps."""
    drawn = draw_robots(300, 9, wide=False)
    drawn["omega_bar"] = drawn["omega_bar"] * np.where(np.arange(300) % 2, 1.0, -1.0)
    if with_dwell:
        drawn["N"], drawn[DWELL] = np.maximum(drawn["N"], 2.0), np.geomspace(0.2, 20.0, 300)
    inside = ~load().query(drawn, flag=True)["outside"]
    rows = range(300) if options.get("flag") else np.flatnonzero(inside).tolist()
    batch = load().query({name: values[rows] for name, values in drawn.items()}, **options)
    for place, row in enumerate(rows):
        single = load().query({name: values[row : row + 1] for name, values in drawn.items()}, **options)
        assert list(single) == list(batch)
        for name, values in single.items():
            assert values.shape == (1,)
            found, wanted = values[0], batch[name][place]
            if name == "outside" or not np.isfinite(wanted):
                assert np.array_equal(found, wanted, equal_nan=True), (row, name)
            else:
                bound = 1e-12 * size_of(single, name) * (10 if drawn["N"][row] == 1 else 1)
                assert abs(found - wanted) <= bound, (row, name)


def size_of(answer: dict[str, np.ndarray], name: str) -> float:
    """Return what a number of one robot is exact relative to: differences of large numbers are less exact."""
    base = name.removesuffix("_low").removesuffix("_high")
    speed, value = np.hypot(answer["v_x"][0], answer["v_z"][0]), abs(answer[base][0])
    if f"{base}_low" in answer:
        value += answer[f"{base}_high"][0] - answer[f"{base}_low"][0]
    if base in ("v_x", "v_z", "lag_x", "lag_z"):
        return float(value + speed)
    if base == "lag_psi_rad":
        return float(value + abs(answer["omega_yr_bar"][0]))
    if base == "net_speed_bar":
        return float(value + 100 * speed)
    return float(value * (10 if base == "R_yr_over_l" else 1) + (60 if base == "theta_deg" else 0))


def test_blocks_have_the_numbers_of_one_by_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of 4,000 robots with one tail and more, and whatever other robots are in the batch."""
    drawn = draw_robots(4000, 12, wide=True)
    drawn["N"] = 1.0 + np.arange(4000) % 8
    found = load().query(drawn, flag=True, intervals=True)
    part = np.random.default_rng(0).permutation(4000)[:1000]
    some = load().query({name: values[part] for name, values in drawn.items()}, flag=True, intervals=True)
    monkeypatch.setattr(quick_query, "MANY", 10**9)
    wanted = load().query(drawn, flag=True, intervals=True)
    assert (found["outside"] == wanted["outside"]).all()
    known = ~wanted["outside"]
    assert known.sum() > 2000
    speed = np.hypot(wanted["v_x"], wanted["v_z"])
    cancels = np.abs(wanted["omega_yr_bar"]) < 0.1 * speed  # the yaw rate is a small difference
    for name in ("omega_t_bar", "omega_h_bar", "omega_yr_bar", "v_x", "v_z", "tail_gap", "omega_yr_bar_low"):
        rows = known & np.isfinite(wanted[name])  # a single tail has no gap
        of_speed = name.startswith("v_") | (name.startswith("omega_yr") & cancels)
        size = (np.abs(wanted[name]) + of_speed * speed + (name == "tail_gap"))[rows]
        assert (np.abs(found[name][rows] - wanted[name][rows]) <= 1e-12 * size).all(), name
        chosen = rows[part]
        apart = np.abs(some[name][chosen] - found[name][part][chosen])
        assert (apart <= 1e-12 * (np.abs(found[name][part]) + speed[part])[chosen]).all(), name


def test_lists_and_integers_are_answered_alike() -> None:
    wanted = load().query(one())
    for columns in (
        {name: values.tolist() for name, values in one().items()},
        {**one(), "N": np.array([3])},
        {name: values for name, values in one().items() if name != "a_over_R"},
        {**one(), "end_over_end_drag": np.zeros(1)},
    ):
        assert load().query(columns) == wanted


def test_answers_do_not_change_with_the_next_query() -> None:
    first = load().query(one())
    kept = {name: values.copy() for name, values in first.items()}
    load().query(one(omega_bar=20.0))
    assert first == kept


def test_a_copy_of_a_table_has_numbers_of_its_own() -> None:
    """Compiled loops get addresses, which belong to one table in one process."""
    lookup = load()
    wanted = lookup.query(one())
    copies = [copy.deepcopy(lookup), pickle.loads(pickle.dumps(lookup))]
    lookup._quick._table.numbers[:] = np.nan
    del lookup
    for copied in copies:
        assert copied.query(one()) == wanted


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"omega_bar": 2000.0}, "row 1 is outside the look-up table.*omega_bar = 2000, learned were"),
        ({"C_yr": 900.0, "C_t": 0.01}, "outside the look-up table"),
        ({"omega_bar": 0.0}, "the motor must turn"),
        ({"C_t": -1.0}, "must be above 0"),
        ({"C_r": float("nan")}, "must be a finite number"),
        ({"N": 2.5}, "integer from 1 to 64"),
        ({"N": 65.0}, "integer from 1 to 64"),
        ({"l_over_r0": 4.0}, "slender"),
        ({"nonsense": 1.0}, "unknown column 'nonsense'"),
        ({"N": 1.0, DWELL: 1.0}, "the response of one tail"),
        ({DWELL: 0.1}, "give a dwell from 0.2 on"),
        ({DWELL: float("inf")}, "give a dwell from 0.2 on"),
        ({DWELL: 0.1, "omega_bar": 2000.0}, "outside the look-up table"),
        ({"tail_sag": 0.1}, "changes more than head, disc and motor"),
    ],
)
def test_refusals(changes: dict[str, float], message: str) -> None:
    with pytest.raises(InputError, match=message):
        load().query(one(**changes))


def test_words_and_missing_columns_are_refused() -> None:
    with pytest.raises(InputError, match="no number"):
        load().query({**one(), "C_t": np.array(["many"])})
    with pytest.raises(InputError, match="missing column 'C_t'"):
        load().query({name: values for name, values in one().items() if name != "C_t"})


def test_a_refusal_says_which_robot() -> None:
    with pytest.raises(OutsideError) as refused:
        load().query({name: np.repeat(values, 3) * ([1, 1, 300] if name == "omega_bar" else 1)
                      for name, values in one().items()})  # fmt: skip
    assert refused.value.row == 2


def test_intervals_of_networks_with_several_members() -> None:
    """They have a spread, which is found by arrays."""
    robots = {name: values[:1] for name, values in robots_inside(1).items()}
    batch = {name: np.repeat(values, 2) for name, values in robots.items()}
    single, both = table().query(robots, intervals=True), table().query(batch, intervals=True)
    for name, values in single.items():
        assert both[name] == pytest.approx(np.repeat(values, 2), rel=1e-12)


@pytest.mark.parametrize("code", [FIRST_ANSWER, PLAN])
def test_a_query_and_a_plan_load_neither_compiler_nor_frames_nor_tensors(code: str, tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", code, str(tmp_path / "plan")],
        capture_output=True, text=True, check=True, cwd=Path(__file__).parents[3], timeout=LIMIT,
    )  # fmt: skip
    loaded = set(done.stdout.split())
    assert "surrogate.table.compiled_query" in loaded
    assert not loaded & {"numba", "torch", "pandas", "scipy", "matplotlib", "sim.machine_code"}
