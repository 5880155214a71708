"""Pictures of `softflagella.plot` show what they are given, on given axes; and objects have tables."""

from __future__ import annotations

import html
import re
from dataclasses import replace
from inspect import isfunction, signature
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from matplotlib import pyplot
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import softflagella as sf
from common.errors import InputError
from common.units import Sigma
from dataset.build import build
from dataset.data_set import read
from tests.dataset.sweeps import design
from tests.planner.plans import CONTROL
from tests.shared import shared

CM = 100 * CONTROL.tail_length


def axes() -> Axes:
    return Figure().add_subplot()


@shared
def square() -> sf.Plan:
    return sf.plan(sf.polygon(4, side=2.0), CONTROL)


def test_a_motion_is_two_circles_of_the_simulated_radius() -> None:
    drawn = sf.plot.motion("paper-control", ax=(ax := axes()))
    assert drawn is ax
    (radius,) = sf.steady(CONTROL)["R_yr_cm"]
    for line, side in zip(ax.get_lines()[:2], (1, -1), strict=True):
        x, y = np.asarray(line.get_xydata()).T
        assert np.sign(y.mean()) == np.sign(np.diff(y)[0]) == side  # a motor at +1 turns left
        assert np.ptp(x) / 2 == pytest.approx(radius, rel=1e-3)
        assert np.ptp(y) / 2 == pytest.approx(radius, rel=1e-3)
    assert ax.get_xlim()[1] > np.max(ax.get_lines()[0].get_xdata())  # the circle is within the frame
    with pytest.raises(InputError, match="no robot"):
        sf.plot.motion("paper-controll", ax=ax)


def test_a_plan_is_drawn_with_a_legend() -> None:
    drawn = sf.plot.plan(square())  # no axes are given
    legend = drawn.get_legend()
    assert legend is not None
    assert {"declared", "predicted"} <= {text.get_text() for text in legend.get_texts()}
    assert drawn.figure.number in pyplot.get_fignums()
    pyplot.close(drawn.figure)


@pytest.mark.slow
def test_a_sweep_is_drawn_from_rows_or_their_folder(tmp_path: Path) -> None:
    """Without rows whose tails touch; columns that there are not are refused, and all that there are are named."""
    build(design(12), str(tmp_path / "sweep"), jobs=1)
    rows = read(str(tmp_path / "sweep"))
    good = rows[rows["converged"] & ~rows["failed"] & ~rows["touching"]]
    for given in (rows, tmp_path / "sweep", str(tmp_path / "sweep")):
        ax = sf.plot.sweep(given, "theta_deg", "l_over_R", ax=axes())
        points = np.concatenate([np.asarray(line.get_xydata()) for line in ax.get_lines()])
        points = points[np.isfinite(points).all(1)]
        expected = good[["l_over_R", "theta_deg"]].to_numpy(float)
        np.testing.assert_allclose(sorted(points.tolist()), sorted(expected.tolist()))
    for column in ("theta", "note", "lag_z"):  # there is none; of words; of lists
        with pytest.raises(
            InputError, match=rf"'{column}' is no column of numbers in this sweep; there are .*theta_deg"
        ):
            sf.plot.sweep(rows, column)
    with pytest.raises(InputError, match=r"'N' is no column .*; there are R_yr_over_l, omega_bar"):
        sf.plot.sweep(pd.DataFrame({"R_yr_over_l": [1.0], "omega_bar": [1.0]}))


@pytest.mark.parametrize(
    "function", [f for f in vars(sf.plot).values() if isfunction(f) and f.__module__ == sf.plot.__name__]
)
def test_a_wrong_argument_is_refused_by_every_function(function: Any) -> None:
    first = next(iter(signature(function).parameters))
    right: dict[str, Any] = {"robot": CONTROL, "rows": pd.DataFrame()}
    for wrong in (3, None, [square()], object()):
        kind = type(wrong).__name__
        with pytest.raises(InputError, match=rf"^{function.__name__}: {first} is of type {kind}; give "):
            function(wrong)
    with pytest.raises(InputError, match="has no keyword 'axes'; is it ax"):
        function(right.get(first, "x"), axes=None)
    if first in right:
        with pytest.raises(InputError, match=r": ax is of type str; give Axes or None"):
            function(right[first], ax="x")
    else:
        with pytest.raises(InputError, match=": result is of type str; give "):
            function("x")


def test_a_column_that_is_no_text_is_refused() -> None:
    with pytest.raises(InputError, match="sweep: output is of type int; give str"):
        sf.plot.sweep(pd.DataFrame(), 3)  # type: ignore[arg-type]


def cells(thing: Any) -> dict[str, str]:
    found = re.findall(r"<tr><td>(.*?)</td><td>(.*?)</td></tr>", thing._repr_html_())
    return {html.unescape(name): html.unescape(value) for name, value in found}


def test_a_robot_is_tabulated_with_units_and_what_is_known_of_them() -> None:
    robot = replace(
        CONTROL,
        name="<script>",
        effects={"inertia": 0.05},
        sigmas={"viscosity": Sigma(0.05, True), "tail_length": Sigma(1e-3, False)},
    )
    rows = cells(robot)
    assert rows["fluid, viscosity"] == "1.49 ± 0.0745 Pa s"
    assert rows["tails, length"] == "11 ± 0.1 cm"
    assert rows["drag, C_yr"] == "2"
    assert rows["motor, speed"] == "43.26 rpm"
    assert rows["effect inertia"] == "0.05"
    assert rows["unit of time"] == f"{robot.time_scale:.4g} s"
    assert "<script>" not in robot._repr_html_()


def test_a_plan_is_tabulated_with_its_errors() -> None:
    plan = square()
    rows = cells(plan)
    assert rows["stated error, open loop"].startswith(f"{10 * CM * plan.stated_error:.3g} mm")
    assert rows["predicted error, rms"].endswith("if the coefficients are exact")
    assert rows["otherwise"] == plan.unmeasured_words
    assert ("stated error, with feedback" in rows) == (plan.feedback_error < plan.stated_error)
    near = sf.plan(sf.polygon(4, side=2.0), CONTROL, keep_out=[sf.Circle(0.0, 0.0, 0.2)])
    assert [value for name, value in near.quantities() if name == "besides"] == near.conditions() != []
    assert all(words in "\n".join(near.lines()) for words in near.conditions())


def test_a_look_up_table_is_tabulated_with_its_errors() -> None:
    table = sf.load_table()
    rows = cells(table)
    error = table.errors["omega_yr_bar"]
    expected = f"median {100 * error['median']:.2g} %, 95 % of robots below {100 * error['p95']:.2g} %"
    assert rows["error of omega_yr_bar"] == expected
    assert rows["robots"].startswith("within ")
