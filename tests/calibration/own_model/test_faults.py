"""Faults of a model or of its table: each is one line that names it, before anything is fitted."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import softflagella as sf
from calibration.own_model.table_of_runs import Roles, read_runs_of
from calibration.statistics.forward import secants
from calibration.statistics.statistical_model import Parameter
from calibration.table.runs import Runs
from calibration.verdict.calibrate import calibrate
from common.errors import InputError

DIAMETERS, ROUNDS = np.linspace(0.02, 0.12, 9), 5
rng = np.random.default_rng(2)
DIAMETER, ROUND = np.tile(DIAMETERS, ROUNDS), np.repeat(np.arange(ROUNDS), 9)
TABLE = pd.DataFrame({"d": DIAMETER, "round": ROUND + 1, "day": "Monday"})
TABLE["v"] = 300 * DIAMETER**2 / (1 + 2.1 * DIAMETER) * np.exp(0.02 * rng.standard_normal(45))


def fall(columns: Any, p: Any) -> Any:
    d = columns["d"]
    return {"v": p["v1"] * d**2 / (1 + 2.1 * p["wall"] * d)}


MODEL = sf.Model(
    fall,
    outputs={"v": sf.Output("speed", unit="m/s")},
    numbers=[sf.Number("v1", 100.0, unit="1/m s", low=0.1, high=1e5)],
    effects=[sf.Effect("wall", "wall", low=0, high=4, theory=1.0)],
)


def said(model: sf.Model, table: pd.DataFrame = TABLE, **options: Any) -> str:
    """What is said of a model; nothing is fitted."""
    with pytest.raises(InputError) as refusal:
        sf.calibrate(table, model, session="round", progress=False, **options)
    message = str(refusal.value)
    assert "\n" not in message
    return message


def of(value: Callable[[Any, Any], Any]) -> sf.Model:
    """The model with another function for its output."""
    return replace(MODEL, function=lambda columns, p: {"v": value(fall(columns, p)["v"], p)})


def changes_a_column(columns: Any, p: Any) -> Any:
    d = columns["d"]
    d /= 1000
    return fall(columns, p)


def test_a_round_in_another_unit_is_named() -> None:
    """Millimetres per second among metres per second, in a round of five."""
    table = TABLE.assign(v=TABLE["v"] * np.where(TABLE["round"] == 2, 1000, 1))
    assert "v of session round 2 is 1" in said(MODEL, table)
    assert "in mm there and in m in those" in said(MODEL, table)


def test_a_round_that_is_ten_times_as_fast_can_be_declared_right() -> None:
    """No other output could bear it out."""
    table = TABLE.assign(v=TABLE["v"] * np.where(TABLE["round"] == 2, 10, 1))
    assert said(MODEL, table).endswith("; if it is right, declare its Output with unit_checked=True")
    checked = replace(MODEL, outputs={"v": sf.Output("speed", unit="m/s", unit_checked=True)})
    result = sf.calibrate(table, checked, session="round", progress=False)
    assert [(move["number"], move["where"]) for move in result.facts["moves"]] == [("v1", "in session round 2")]


def test_as_it_should_be_the_wall_is_named() -> None:
    result = sf.calibrate(TABLE, MODEL, session="round", progress=False)
    assert result.effects == ("wall",)
    assert result.corrected["wall"] == pytest.approx(1.0, abs=0.35)
    assert result.corrected["v1"] == pytest.approx(300, rel=0.05)
    assert result.runs.session_names == tuple(f"round {i}" for i in range(1, 6))


@pytest.mark.parametrize(
    ("model", "words"),
    [
        (replace(MODEL, function=lambda c, p: {"w": c["d"]}), "returns no output 'v'; it has w"),
        (replace(MODEL, function=lambda c, p: c["d"]), "returns ndarray; return {output: array (n,)}"),
        (of(lambda v, p: v[:5]), "'v' of shape (5,) for 45 rows"),
        (
            of(lambda v, p: pd.Series(v, index=range(1, 46))),
            "a Series whose index does not number the 45 rows from 0",
        ),
        (of(lambda v, p: np.ma.masked_less(v, 0.1)), "returns 'v' as a masked array"),
        (of(lambda v, p: v + 0j), "returns 'v' as complex numbers"),
        (of(lambda v, p: sys.exit(0)), "fails with v1 = 100, wall = 0: SystemExit, 0 ("),
        (
            of(lambda v, p: v if p["v1"] == 100 else v * np.nan),
            "no finite numbers with v1 = 110.517, near its start",
        ),
        (of(lambda v, p: v[None]), "'v' of shape (1, 45) for 45 rows"),
        (of(lambda v, p: ["fast"] * len(v)), "'v' that is no array of numbers"),
        (of(lambda v, p: np.where(np.arange(len(v)) == 3, np.nan, v)), "v is no finite number in row 4"),
        (of(lambda v, p: v - 0.1), "v is not above 0 in row 1; return finite numbers, above 0"),
        (
            of(lambda v, p: v * p["wall"]),
            "wall (wall) does not vanish at its null, 0: there v is not above 0",
        ),
        (
            of(lambda v, p: v / p["wall"]),
            "wall (wall) does not vanish at its null, 0: there v is no finite number",
        ),
        (replace(MODEL, function=lambda c, p: {"v": p["v1"] * c["d"] ** 2}), "wall (wall) changes nothing"),
        (replace(MODEL, function=lambda c, p: {"v": c["d"] ** 2 / (1 + p["wall"] * c["d"])}), "v1 (v1) changes"),
        (of(lambda v, p: v * np.exp(rng.normal())), "other values when it is called again"),
        (replace(MODEL, function=changes_a_column), "output array is read-only"),
        (of(lambda v, p: 1e4 * v), "v is 0.000"),
        (of(lambda v, p: float("fast")), "ValueError, could not convert string to float: 'fast' ("),
        (of(lambda v, p: v * p["odd"]), "fails with v1 = 100, wall = 0: KeyError, 'odd' ("),
        (
            replace(MODEL, function=lambda c, p: {"v": c["diameter"]}),
            "asks for column 'diameter'; the table has d,",
        ),
        (replace(MODEL, settings=["diameter"]), "no column 'diameter'; it has d, round, day, v"),
        (replace(MODEL, outputs={"w": sf.Output("speed")}), "no column 'w'; it has d,"),
    ],
)
def test_a_fault_of_a_model_is_named(model: sf.Model, words: str) -> None:
    assert words in said(model)


def test_a_series_is_read_by_its_index() -> None:
    shuffled = TABLE.sample(frac=1, random_state=3)
    sorts = replace(MODEL, function=lambda c, p: {"v": pd.Series(fall(c, p)["v"]).sort_values()})
    runs = [read_runs_of(shuffled, model, Roles("round"))[0] for model in (sorts, MODEL)]
    one, other = (run.predict([{"v1": 300.0, "wall": 1.0}]) for run in runs)
    np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("above", [0.5, 1e-4])
def test_where_the_function_is_not_finite_nothing_is_fitted_and_it_is_said(above: float, tmp_path: Path) -> None:
    """The true size of the wall is 1."""
    model = of(lambda v, p: v if p["wall"] < above else v * np.nan)
    result = sf.calibrate(TABLE, model, session="round", progress=False)
    (caveat,) = (caveat for caveat in result.caveats if "finite" in caveat)
    assert caveat.startswith("the model's function gives no finite numbers with v1 = 100, wall = 1 and ")
    assert np.isfinite(list(result.corrected.values())).all()
    assert np.isfinite(result.samples(100).drop(columns="form")).all(axis=None)


def test_a_number_may_be_impossible_on_one_side() -> None:
    """The step of a derivative goes to the other one."""
    model = of(lambda v, p: v if p["v1"] < 100.5 else v * np.nan)
    halved = TABLE.assign(v=TABLE["v"] / 4)
    assert sf.calibrate(halved, model, session="round", progress=False).corrected["v1"] == pytest.approx(
        75, rel=0.05
    )


def test_a_model_without_sense_cannot_be_declared() -> None:
    for make, words in {
        lambda: replace(MODEL, effects=[*MODEL.effects, *MODEL.effects]): "the name 'wall'; rename or drop one",
        lambda: replace(MODEL, outputs={}): "outputs of a model",
        lambda: replace(MODEL, numbers=[]): "given: []",
        lambda: replace(MODEL, numbers=["v1"]): "numbers of a model are each an sf.Number, one at least",
        lambda: sf.Number("v1", 5.0, low=10, high=20): "start 5 with low 10 and high 20",
        lambda: sf.Effect("wall", "wall", low=1, high=2): "null 0 with low 1 and high 2",
        lambda: sf.Output("speed", kind="difference", sigma=-1.0): "sigma -1",
        lambda: sf.Output("speed", sigma=0.02): 'compared as a ratio; give a share, such as "2 %"',
        lambda: sf.Output("speed", kind="difference", unit="m/s", sigma="2 %"): "give a number in m/s",
        lambda: sf.Output("speed", sigma="little"): "give a number in its unit, or a text like",
        lambda: sf.Output("speed", "m/s"): "sf.Output(title, …): the further value 'm/s' needs its keyword",
        lambda: sf.Number("v1", 5.0, "m/s"): "sf.Number(name, start, …): the further value 'm/s'",
        lambda: sf.Effect("wall", "wall", 0, 1): "sf.Effect(name, title, …): the further value 0",
        lambda: sf.Number("v1", 5.0, unit=None): "v1: unit None; give a text",
        lambda: sf.Number("v1", "a"): "v1: start 'a'; give a number",
        lambda: sf.Effect("wall", "wall", low="a", high=1): "wall: low 'a'; give a number",
        lambda: sf.Number("R", 1e6, sigma=1e7): "is more than the number itself, 1e+06; give it in 1, or as a",
        lambda: sf.Number("R", 1e6, sigma="-1 %"): "R: sigma -10000; give a standard deviation above 0",
        lambda: sf.Output("speed", kind="share"): "'ratio' or 'difference'",
        lambda: MODEL.without("wind"): "no effect 'wind'; it has wall",
    }.items():
        with pytest.raises(InputError) as refusal:
            make()
        assert words in str(refusal.value)


@pytest.mark.parametrize(
    ("unit", "factor", "words"), [("1", 100.0, "seems to have per cent"), ("rad", 180 / np.pi, "to have degrees")]
)
@pytest.mark.parametrize("kind", ["ratio", "difference"])
def test_another_unit_is_guessed(unit: str, factor: float, words: str, kind: Any) -> None:
    model = replace(
        MODEL, outputs={"v": sf.Output("angle", unit=unit, kind=kind)}, numbers=[sf.Number("v1", 300.0)]
    )
    assert words in said(model, TABLE.assign(v=factor * TABLE["v"]))


def test_a_fault_of_a_table_is_named() -> None:
    some_low = TABLE.assign(v=TABLE["v"] - TABLE["v"].median())
    assert "v is not above 0 in 23 of 45 rows, first in row 1" in said(MODEL, some_low)
    assert "no usable row: row 1: no output has a value" in said(MODEL, TABLE.assign(v=np.nan))
    assert "no usable row: row 1: d has no value" in said(MODEL, TABLE.assign(d=np.nan))
    assert "column 'd' twice" in said(MODEL, pd.concat([TABLE, TABLE[["d"]]], axis=1))
    assert "no session and no column; there are round 1, round 2" in said(MODEL, held_out=["round 9"])
    assert "v is the same in all repeats" in said(MODEL, TABLE.assign(v=1 + TABLE["d"]))
    assert "45 of 45 runs are held out" in said(MODEL, TABLE.assign(test=True), held_out="test")
    assert "above 0 for each output, v" in said(MODEL, noise={"w": 1.0})
    assert "give 'unknown'" in said(MODEL, noise="large")
    for options, words in (
        ({"noise": {"v": "a"}}, "noise of v = 'a'; give a number in its unit"),
        ({"held_out": 3}, 'held_out, notes: 3; give a name as text, such as "3"'),
        ({"seed": -1}, "seed: -1; give a whole number from 0"),
        ({"max_seconds": "long"}, "max_seconds: long; give a positive number"),
        ({"max_predictions": 0}, "max_predictions: 0; give a positive number"),
    ):
        assert words in said(MODEL, **options)
    assert "all rows have one setting and one session" in said(MODEL.without("wall"), TABLE[::9].assign(round=1))
    assert "2 usable rows for 1 numbers to fit; give 4 rows" in said(MODEL, TABLE[:2])
    assert "2 usable rows for 2 numbers" in said(
        replace(MODEL, numbers=[*MODEL.numbers, sf.Number("power", 2.0)]), TABLE[:2]
    )


def test_a_tolerance_is_in_the_unit_of_its_number() -> None:
    for given, sigma in ({"sigma": 1e4}, 0.01), ({"sigma": "1 %"}, 0.01), ({"sigma": 1e4, "low": -1e7}, 1e4):
        assert sf.Number("R", 1e6, unit="ohm", **given).parameter.sigma == pytest.approx(sigma)
    assert sf.Number("zero", 0.0, sigma=0.1).parameter.sigma == 0.1


def test_a_unit_and_a_title_may_be_empty() -> None:
    assert sf.Number("k", 1.0, unit="").parameter.unit == "1"
    assert sf.Effect("wall", "", low=0, high=1, unit=" ").parameter.title == "wall"


def test_what_would_make_rows_repeats_is_said() -> None:
    columns = TABLE.drop(columns=["round", "day"]).assign(day=TABLE["round"], ball=np.arange(45))

    def caveats(**options: Any) -> str:
        return " | ".join(sf.calibrate(columns, MODEL, progress=False, **options).caveats)

    assert "no session was given; column day looks like one (--session day)" in caveats()
    assert "looks like" not in caveats(session="day")
    alone = caveats(session="day", specimen="ball")
    assert 'fewer than 8 repeats the noise is unknown; declare it: sigma="2 %" of the Output' in alone
    assert "rows of equal settings differ in ball (--specimen), so they are no repeats" in alone


def test_what_is_for_robots_is_refused_for_a_model_and_the_other_way_round() -> None:
    assert "laws, paths is not for a model" in said(MODEL, laws=False, paths=("square:3l",))
    with pytest.raises(InputError, match="session, noise is not for a robot"):
        sf.calibrate(TABLE, "paper-control", session="round", noise="unknown")


@dataclass(frozen=True)
class HandMade:
    """A model of falls that is made by hand, y = ln v."""

    runs: Runs
    coefficients: tuple[Parameter, ...] = (Parameter("v1", "v1", 100.0, (0.1, 1e5), 1.0, logarithmic=True),)
    effects: tuple[Parameter, ...] = (Parameter("wall", "wall", 0.0, (0.0, 4.0), 1.0),)
    nuisances: tuple[Parameter, ...] = ()
    untestable: dict[str, str] = field(default_factory=dict)
    change: Callable[[Any, Any], Any] = lambda y, p: y

    def predict(self, sets: Sequence[Any], *, title: str = "") -> Any:
        falls = [np.log(fall({"d": DIAMETER}, {"wall": 0.0, **p})["v"])[:, None] for p in sets]
        return self.change(np.array(falls), sets)

    def linearised(self, at: Any, along: Any, *, title: str = "", quick: bool = False) -> Any:
        return secants(self, at, along)

    def check(self, prediction: Any) -> None: ...

    def guess(self, start: Any, used: Any) -> Any:
        return start

    def possible(self) -> Any:
        return self, [{"d": d} for d in DIAMETER.tolist()]


def hand_made(**changes: Any) -> HandMade:
    y, names = np.log(TABLE["v"].to_numpy())[:, None], tuple(f"round {k + 1}" for k in range(ROUNDS))
    condition, inputs = np.tile(np.arange(9), ROUNDS), np.log(DIAMETER)[:, None]
    runs = Runs(("v",), y, condition, ROUND, names, inputs, ("ln d",), np.arange(1, 46), (), ())
    of_runs = {name: changes.pop(name) for name in ("y", "session") if name in changes}
    return HandMade(replace(runs, **of_runs), **changes)


def numbers_only(y: Any, sets: Any) -> Any:
    return y + 10 * DIAMETER[:, None] * np.log([float(p["odd"]) for p in sets])[:, None, None]


HOLE = np.where(np.arange(45) == 7, np.nan, np.log(TABLE["v"]))[:, None]
ROUND_3_DIFFERS = np.log(TABLE["v"].to_numpy() * np.exp(3 * np.where(ROUND == 2, DIAMETER, 0)))[:, None]
ODD = Parameter(
    "odd", "a number that may differ", 1.0, (0.1, 10.0), 1.0, logarithmic=True, sigma=0.02, plausible=(0.5, 2.0)
)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"y": HOLE}, "v as measured is nan in row 8"),
        ({"change": lambda y, _: np.where(np.arange(45)[:, None] == 3, np.nan, y)}, "given is nan in row 4"),
        ({"change": lambda y, _: np.exp(y)}, "the measured values seem to be logarithms, and the others not"),
        ({"y": TABLE["v"].to_numpy()[:, None]}, "the predictions seem to be logarithms"),
        ({"change": lambda y, _: y[:, :, 0]}, "has the shape (1, 45); return (1, 45, 1): sets, runs, outputs"),
        ({"session": 10 * ROUND + 5}, "a run is in session 5; number the 5 sessions from 0 to 4"),
        ({"effects": 2 * HandMade.effects}, "the name 'wall'; rename or drop one"),
        ({"nuisances": (ODD,), "change": numbers_only, "y": ROUND_3_DIFFERS}, "fails where odd differs between"),
    ],
)
def test_a_fault_of_a_hand_made_model_is_named(changes: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError) as refusal:
        calibrate(hand_made(**changes), progress=False, draws=200)
    assert words in str(refusal.value)


def test_as_it_should_be_a_hand_made_model_is_calibrated() -> None:
    assert calibrate(hand_made(), progress=False, draws=200).effects == ("wall",)


@pytest.mark.parametrize("name", ["line", "row", "session", "level_0"])
def test_a_column_may_have_any_name(name: str, tmp_path: Path) -> None:
    """The index of a table that was read has a name, too."""
    model = replace(MODEL, function=lambda columns, p: fall({"d": columns[name]}, p))
    TABLE.rename(columns={"d": name}).to_csv(tmp_path / "falls.csv", index=False)
    assert name in read_runs_of(tmp_path / "falls.csv", model, Roles(session="round"))[0].runs.settings
