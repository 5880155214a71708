"""Traces: numbers of a group's own, whole traces in the function, free runs, and tables that cannot be used."""

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scipy.optimize import least_squares

import softflagella as sf
from calibration.own_model.table_of_runs import Roles, read_runs_of
from common.errors import InputError
from tests.oracles.cups import MODEL, RATE, cup, cups

ROWS = sf.Model(
    lambda columns, p: {"y": p["k"] * columns["x"]}, outputs={"y": sf.Output("y")}, numbers=[sf.Number("k", 1.0)]
)
TRACE = {"trace": "cup", "progress": False}


@pytest.fixture(scope="module")
def lagging():
    """A table whose thermometer lags."""
    return cups(3, lag=60.0)


@pytest.fixture(scope="module")
def verdict(lagging):
    return sf.calibrate(lagging, MODEL, session="day", **TRACE)


def test_what_is_missing_is_found_beside_slow_noise(verdict):
    assert verdict.effects == ("lag",)
    low, high = verdict.final_intervals["lag"]
    assert low < 60 < high
    low, high = verdict.final_intervals["rate"]
    assert low < RATE < high


def test_numbers_of_traces_are_a_table(verdict, lagging, tmp_path):
    starts = verdict.corrected["start"]
    assert list(starts) == sorted(lagging["cup"].unique())
    assert starts["cup 0 of day 0"] == pytest.approx(40, rel=0.06)
    assert verdict.facts["numbers_of_groups"]["start"]["cup 0 of day 0"]["value"] > 35
    assert not any("start of" in name for name in verdict.facts["parameters"])
    verdict.save(tmp_path)
    written = json.loads((tmp_path / "corrected.json").read_text())
    assert set(written["numbers"]["start"]["of"]) == set(starts)


def test_the_fit_is_that_of_dense_generalised_least_squares():
    table = cups(5)
    verdict = sf.calibrate(table, MODEL.without("radiation", "lag", "fill"), **TRACE)
    memory, used = verdict.runs.memory, verdict.split.fitted
    lags = np.abs(memory.time[:, None] - memory.time)
    slow = memory.share * np.exp(-lags / memory.tau) + (1 - memory.share) * np.eye(len(lags))
    R = np.where(memory.trace[:, None] == memory.trace, slow, 0.0)[np.ix_(used, used)]
    rho = float(verdict.base.noise.session_ratio[0])
    root = np.linalg.cholesky(R)
    ordered = table.sort_values(["cup", "t_s"]).reset_index(drop=True)
    codes = np.unique(ordered["cup"], return_inverse=True)[1]

    def residual(p):
        values = {"rate": np.exp(p[0]), "radiation": 0.0, "lag": 0.0, "fill": 0.0}
        parts = [
            cup({name: ordered[name].to_numpy()[codes == c] for name in ("t_s", "mass")},
                {**values, "start": start})["T"]
            for c, start in enumerate(p[1:])
        ]  # fmt: skip
        return np.linalg.solve(root, (ordered["T"] - np.concatenate(parts))[used])

    plain = least_squares(residual, [np.log(1e-3), *np.full(8, 55.0)], x_scale=[0.01, *np.full(8, 1.0)])
    fitted = verdict.base.parameters
    assert rho >= 0
    starts = [value for name, value in fitted.items() if name.startswith("start of")]
    # The scatter of sessions moves the weights a little, by far less than the standard errors.
    errors = np.sqrt(np.diag(np.linalg.inv(plain.jac.T @ plain.jac)) * verdict.base.noise.run_covariance[0, 0])
    assert abs(np.log(fitted["rate"]) - plain.x[0]) < 0.5 * errors[0]
    assert (np.abs(np.array(starts) - plain.x[1:]) < 0.5 * errors[1:]).all()


def test_the_held_out_error_is_that_of_a_free_run(verdict, lagging):
    runs, test = verdict.runs, verdict.split.test
    held = {runs.trace_names[t] for t in np.unique(runs.trace[test])}
    assert {name.split(" of ")[1] for name in held} == {"day 1"} or len(held) >= 1
    assert not (runs.heads & test).any()
    assert (np.bincount(runs.trace[runs.heads]) == 12).all()  # a fifth of 60
    parameters, square, count = verdict.final.parameters, 0.0, 0
    for name, rows in lagging.groupby("cup"):
        chosen = test[runs.trace == runs.trace_names.index(name)]
        values = {**parameters, "start": parameters[f"start of {name}"], "radiation": 0.0, "fill": 0.0}
        free = cup({key: rows[key].to_numpy() for key in ("t_s", "mass")}, values)["T"]
        square, count = square + ((rows["T"] - free)[chosen] ** 2).sum(), count + chosen.sum()
    assert verdict.errors.rms["after"] == pytest.approx(np.sqrt(square / count), rel=1e-6)


def test_the_function_sees_one_whole_trace_in_the_order_of_time():
    seen = []

    def watched(columns, p):
        seen.append((columns["t_s"].copy(), len(set(columns["mass"])), p["start"]))
        return cup(columns, p)

    table = cups(1, readings=20)
    shuffled = table.assign(place=table.groupby("cup").cumcount()).sort_values(["place", "cup"])
    sf.calibrate(shuffled.drop(columns="place"), replace(MODEL, function=watched), **TRACE)
    assert all(len(time) == 20 and (np.diff(time) > 0).all() for time, _, _ in seen)
    assert all(masses == 1 and isinstance(start, float) for _, masses, start in seen)


def test_a_number_of_one_trace_costs_the_call_of_one_trace():
    calls = []

    def counted(columns, p):
        calls.append(1)
        return cup(columns, p)

    plain = MODEL.without("radiation", "lag", "fill")
    few, many = cups(2, days=2), cups(2, days=8)
    counts = []
    for table in (few, many):
        calls.clear()
        sf.calibrate(table, replace(plain, function=partial_of(counted)), **TRACE)
        counts.append(len(calls) / table["cup"].nunique())
    assert counts[1] < 1.5 * counts[0]  # calls of a trace do not grow with the number of traces


def partial_of(function):
    """Give a function the effects at their nulls."""
    return lambda columns, p: function(columns, {"radiation": 0.0, "lag": 0.0, "fill": 0.0, **p})


def test_without_repeats_nothing_is_claimed():
    verdict = sf.calibrate(cups(3, days=1, lag=100.0), MODEL, **TRACE)
    assert verdict.effects == ()
    assert not verdict.runs.noise_known
    assert any("memory of the noise is unknown" in caveat for caveat in verdict.caveats)


def test_rows_have_numbers_of_their_specimens_and_sessions():
    rng = np.random.default_rng(0)
    mugs = pd.DataFrame({"mug": [f"mug {i}" for i in range(5)], "k": [1.0, 1.3, 0.8, 2.0, 1.1]})
    table = mugs.merge(pd.DataFrame({"x": [1.0, 2, 3, 4]}), how="cross")
    table = table.merge(pd.DataFrame({"day": ["a", "b", "c", "d"], "zero": [0.0, 0.5, -0.5, 1.0]}), how="cross")
    table["y"] = (
        table["k"] * table["x"] + table["zero"] + 0.3 * table["x"] ** 2 + 0.02 * rng.normal(size=len(table))
    )
    model = sf.Model(
        lambda columns, p: {"y": p["k"] * columns["x"] + p["zero"] + p["bend"] * columns["x"] ** 2},
        outputs={"y": sf.Output("deflection", kind="difference", sigma=0.02)},
        numbers=[
            sf.Number("k", 1.0, low=0.1, high=10, per="specimen"),
            sf.Number("zero", 0.0, low=-3, high=3, per="session"),
        ],
        effects=[sf.Effect("bend", "bend", low=-1, high=1)],
    )
    given = table[["mug", "x", "day", "y"]]
    verdict = sf.calibrate(given, model, session="day", specimen="mug", progress=False)
    assert verdict.effects == ("bend",)
    corrected = verdict.corrected
    assert corrected["bend"] == pytest.approx(0.3, abs=0.02)
    assert corrected["k"]["mug 3"] - corrected["k"]["mug 0"] == pytest.approx(1.0, abs=0.03)
    assert corrected["zero"]["d"] - corrected["zero"]["c"] == pytest.approx(1.5, abs=0.03)


def fault(table, model=MODEL, **roles):
    with pytest.raises(InputError) as error:
        sf.calibrate(table, model, **{**TRACE, **roles})
    return str(error.value)


def test_tables_of_traces_that_cannot_be_used():
    table = cups(0, readings=10)
    back = table.copy()
    back.loc[4, "t_s"] = 1.0
    assert "trace 'cup 0 of day 0' goes back in time in row 5" in fault(back)
    assert "one trace only" in fault(table[table["cup"] == "cup 0 of day 0"])
    assert "needs the column of their names, trace=" in fault(table, trace=None)
    assert "trace x needs a model with a column of the time" in fault(
        pd.DataFrame({"x": [1.0, 2, 3, 4], "y": [1.0, 2, 3, 4]}), ROWS, trace="x"
    )
    with pytest.raises(InputError, match=r"needs the column of the time: sf\.Model"):
        replace(MODEL, time=None)
    with pytest.raises(InputError, match="per 'cup'; give one of trace, session, specimen"):
        sf.Number("start", 1.0, per="cup")
    own = replace(MODEL, numbers=[*MODEL.numbers, sf.Number("room", 1.0, per="specimen")])
    assert "room is a number per specimen: name its column, specimen=" in fault(table, own)


def test_traces_that_cannot_be_used_are_set_aside():
    table = cups(0, readings=20)
    copy = table[table["cup"] == "cup 1 of day 0"].assign(cup="again", day="day 1")
    short = table[table["cup"] == "cup 2 of day 0"].head(1).assign(cup="short")
    lost = table.copy()
    lost.loc[7, "T"] = np.nan
    verdict = sf.calibrate(pd.concat([lost, copy, short]), MODEL, **TRACE)
    said = " ".join(map(str, verdict.excluded))
    assert "trace 'again' repeats trace 'cup 1 of day 0', value for value" in said
    assert "trace 'short' has 1 reading only" in said
    assert "row 8: no output has a value" in said
    assert len(verdict.runs) == len(table) - 1


def test_times_within_half_a_step_are_repeats_and_lengths_may_differ():
    table = cups(4, rho=0.0, share=0.0)
    rng = np.random.default_rng(0)
    moved = table.assign(t_s=table["t_s"] + rng.uniform(-10, 10, len(table)))
    shorter = moved[(moved["cup"] != "cup 0 of day 1") | (moved["t_s"] < 1200)]
    verdict = sf.calibrate(shorter, MODEL, **TRACE)
    assert verdict.runs.noise_known
    assert len(verdict.runs.noise_of_traces.repeats) == 4


def test_the_numbers_of_a_specimen_with_several_traces_leave_readings_to_compare():
    """The first trace of a specimen is not all spent on its numbers."""
    table = cups(5)
    table["mug"] = "the only one"
    own = replace(MODEL, numbers=[*MODEL.numbers, sf.Number("room", 1.0, low=-9, high=9, per="specimen")])
    function = lambda columns, p: {"T": MODEL.function(columns, p)["T"] + 1e-3 * p["room"]}  # noqa: E731
    model = replace(own, function=function)
    heads = read_runs_of(table, model, Roles(trace="cup", specimen="mug"))[0].runs.heads
    first = table[table["cup"] == table["cup"].min()]
    assert 0 < heads[: len(first)].sum() < len(first) / 3
    verdict = sf.calibrate(table, model, trace="cup", specimen="mug", held_out=table["cup"].min(), progress=False)
    assert verdict.split.test.any()


def test_held_out_readings_that_all_serve_a_fit_are_refused():
    table = cups(5)
    short = table[table["cup"] == table["cup"].min()].head(3)
    others = table[table["cup"] != table["cup"].min()]
    said = fault(pd.concat([short, others], ignore_index=True), held_out=table["cup"].min())
    assert "none is left to compare; hold out others" in said
