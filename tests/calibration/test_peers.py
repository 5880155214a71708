"""Other methods of finding an effect: their predictions, and how an effect is chosen."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from tests.oracles import peers
from tests.oracles.drawn_falls import declared, fall, falls
from tests.oracles.drawn_traces import FAMILIES, Design, draw_traces, model_of_traces, traces_of
from tests.oracles.peers import Measured
from tests.oracles.swim_peers import linear_fit


def test_a_table_is_fitted_in_the_logarithms_of_its_ratios() -> None:
    table = falls(0)
    measured = Measured.of(declared(["wall"]), table, "round", None)
    columns = {name: table[name].to_numpy() for name in table}
    expected = np.log(fall(columns, {"viscosity": 1.2, "wall": 0.5})["v"])
    np.testing.assert_allclose(measured.predict({"viscosity": 1.2, "wall": 0.5}), expected)
    np.testing.assert_allclose(measured.y, np.log(table["v"]))
    assert sorted(set(measured.session)) == [0, 1, 2, 3, 4]


def test_each_trace_has_numbers_of_its_own_and_is_predicted_alone() -> None:
    family, design = FAMILIES["cups"], Design()
    table = draw_traces(family, design, 3)
    measured = Measured.of(model_of_traces(family), table, "day", "trace")
    traces = traces_of(family, design, 3)
    p = {"rate": family.shared["rate"], "radiation": 0.0, "lag": 0.0, "fill": 0.0}
    p |= {f"start_{k}": trace.truth["start"] for k, trace in enumerate(traces)}
    exact = np.concatenate([family.function(t.columns, t.truth)["T"] for t in traces])
    np.testing.assert_allclose(measured.predict(p), exact)
    assert {name for name in measured.start() if name.startswith("start")} == p.keys() & {
        f"start_{k}" for k in range(99)
    }


@pytest.mark.parametrize(
    ("chisqr", "named"),
    [
        ({(): 100.0, ("a",): 80.0, ("b",): 99.0, ("a", "b"): 79.5}, ("a",)),
        (
            {(): 100.0, ("a",): 99.0, ("b",): 98.0, ("a", "b"): 40.0},
            (),
        ),  # a pair is reached through one effect only
        ({(): 100.0, ("a",): 80.0, ("b",): 70.0, ("a", "b"): 40.0}, ("a", "b")),
    ],
)
def test_effects_are_added_as_long_as_their_f_test_is_significant(
    chisqr: dict[tuple[str, ...], float], named: tuple[str, ...]
) -> None:
    fits = {some: SimpleNamespace(chisqr=c, ndata=90, nvarys=1 + len(some)) for some, c in chisqr.items()}
    assert peers.forwards(fits) == named


def test_a_linear_fit_has_the_numbers_of_lmfit() -> None:
    lmfit = pytest.importorskip("lmfit", reason="lmfit is not installed (extra peers)")
    rng = np.random.default_rng(3)
    columns = np.column_stack([np.ones(40), 1e4 * rng.normal(size=40)])
    y = columns @ [2.0, 3e-5] + 0.1 * rng.normal(size=40)
    parameters = lmfit.Parameters()
    parameters.add_many(("a", 0.0), ("b", 0.0))
    theirs = lmfit.minimize(lambda p: y - columns @ [p["a"].value, p["b"].value], parameters)
    own = linear_fit(columns, y)
    for name in ("chisqr", "ndata", "nvarys", "aic", "bic"):
        assert getattr(own, name) == pytest.approx(getattr(theirs, name), rel=1e-6), name
    assert own.sizes == pytest.approx([theirs.params[n].value for n in "ab"], rel=1e-4)
    assert own.errors == pytest.approx([theirs.params[n].stderr for n in "ab"], rel=1e-3)


def test_other_methods_find_a_large_effect() -> None:
    pytest.importorskip("lmfit", reason="lmfit is not installed (extra peers)")
    table = falls(1, wall=1.0)
    answers = peers.by_least_squares(Measured.of(declared(["wall", "late"]), table, "round", None))
    assert {answers[method].named for method in peers.LEAST_SQUARES} == {frozenset({"wall"})}
    low, high = answers["BIC"].intervals["viscosity"]
    assert low < 1 < high < 1.1
    pytest.importorskip("statsmodels", reason="statsmodels is not installed (extra peers)")
    (mixed,) = peers.by_mixed_model(Measured.of(declared(["wall", "late"]), table, "round", None)).values()
    assert mixed.named == {"wall"}


def test_pysindy_finds_radiation_where_there_is_no_noise() -> None:
    pytest.importorskip("pysindy", reason="pysindy is not installed (extra peers)")
    times, parts = 30.0 * np.arange(1, 90), []
    for name, start in (("a", 80.0), ("b", 70.0)):
        p = {"rate": 1 / 900, "start": start, "radiation": 0.5}
        T = FAMILIES["cups"].function({"t_s": times, "mass_g": np.full(len(times), 200.0)}, p)["T"]
        parts.append(pd.DataFrame({"trace": name, "day": "1", "t_s": times, "mass_g": 200.0, "T": T}))
    measured = Measured.of(model_of_traces(FAMILIES["cups"]), pd.concat(parts, ignore_index=True), "day", "trace")
    (answer,) = peers.by_sindy(measured).values()
    assert answer.named == {"radiation"}
