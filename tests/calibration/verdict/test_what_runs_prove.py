"""What runs prove of a model of one's own: errors before, forms alike, and a noise that is declared or unknown."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
import pytest
from scipy.optimize import least_squares

import softflagella as sf
from calibration.attribution.forms import envelope
from calibration.attribution.hypothesis import Hypothesis, Origin
from calibration.attribution.left_out import paired_gain
from calibration.own_model.table_of_runs import Roles, read_runs_of
from calibration.statistics.fit import fit
from calibration.statistics.statistical_model import start_values
from calibration.statistics.study import quarter_of_conditions
from calibration.verdict.calibrate import calibrate, first_fit
from calibration.verdict.verdict import Verdict
from tests.oracles.drawn_falls import DIAMETERS, NOISE, fall, falls, model_of


def verdict(table: pd.DataFrame, **roles: Any) -> Verdict:
    return calibrate(model_of(table, **roles), draws=200, progress=False)


@pytest.mark.parametrize("rounds", [1, 3, 5])
@pytest.mark.parametrize("missing", [{"wall": 1.0}, {"late": 0.8}, {"bump": 0.1}, {"wall": 1.0, "scatter": 0.03}])
def test_the_error_before_is_that_of_least_squares(rounds: int, missing: dict[str, float]) -> None:
    """A misfit that all sessions share is no scatter of sessions, however many there are."""
    for seed in range(4):
        model = model_of(falls(seed, rounds=rounds, **missing))
        study, base, given = first_fit(model, draws=20)
        runs, used = model.runs, study.split.fitted
        least = least_squares_of(model, used)
        for rows in (used, study.split.test):
            before = np.sqrt(np.mean((runs.y - base.prediction)[rows] ** 2))
            assert before == pytest.approx(np.sqrt(np.mean(least[rows] ** 2)), rel=0.05)
        of_given = np.mean((runs.y - given)[used] ** 2)
        assert np.mean((runs.y - base.prediction)[used] ** 2) < 1.001 * of_given


def least_squares_of(model: Any, used: Any) -> Any:
    """Residuals of the numbers that least squares gives."""
    names, start = [p.name for p in model.coefficients], start_values(model)

    def residual(x: Any) -> Any:
        at = {**start, **dict(zip(names, np.exp(x).tolist(), strict=True))}
        return (model.runs.y - model.predict([at])[0])[:, 0]

    return residual(least_squares(lambda x: residual(x)[used], [np.log(start[n]) for n in names]).x)


@pytest.mark.parametrize(("levels", "days"), [(1, 1), (1, 4), (4, 4)])
@pytest.mark.parametrize("bend", [0.1, 0.3])
def test_a_level_that_bends_the_slope_is_not_pushed_off(levels: int, days: int, bend: float) -> None:
    """A common misfit, or a level for each day, does not buy a better slope with wrong levels."""

    def curve(columns: Mapping[str, Any], p: Mapping[str, float]) -> dict[str, Any]:
        a = np.array([p[f"a{day % levels}"] for day in columns["day"].astype(int)])
        return {"y": a * (1 + np.exp(-a) * columns["x"]) * np.exp(p["square"] * columns["x"] ** 2)}

    model = sf.Model(
        curve,
        outputs={"y": sf.Output("level")},
        numbers=[sf.Number(f"a{k}", 1.0, low=0.1, high=10) for k in range(levels)],
        effects=[sf.Effect("square", "a square", low=-3, high=3, typical=0.1)],
        settings=["x"],
    )
    rng = np.random.default_rng(1)
    table = pd.DataFrame({"x": np.tile(np.linspace(0, 1, 12), 8), "day": np.repeat(np.arange(4), 24) % days})
    shape = (1 + bend * table["x"] ** 2) * np.exp(0.5 * table["x"] + 0.01 * rng.standard_normal(96))
    shape *= np.exp(np.array([0.05, -0.05, 0.02, -0.02])[table["day"]])
    experiment = read_runs_of(table.assign(y=shape), model, Roles(session="day"))[0]
    held_out = np.arange(96) % 12 == 5
    study, base, _ = first_fit(experiment, held_out=held_out, draws=20)
    least = least_squares_of(study.model, study.split.fitted)[study.split.fitted]
    residual = (experiment.runs.y - base.prediction)[study.split.fitted]
    assert np.sqrt(np.mean(residual**2)) < 1.0005 * np.sqrt(np.mean(least**2))


def test_a_number_for_each_session_leaves_nothing_known_of_their_scatter() -> None:
    def own(columns: Mapping[str, Any], p: Mapping[str, float]) -> dict[str, Any]:
        mu = np.array([p[f"mu{name[-1]}"] for name in columns["round"]])
        return {"v": columns["d"] ** 2 / mu * np.exp(p["surface"] / columns["d"])}

    numbers = [sf.Number(f"mu{k}", 1.0, low=0.1, high=10) for k in range(3)]
    effects = [sf.Effect("surface", "drag of the surface", low=-2, high=2, typical=0.2)]
    given = sf.Model(
        own, outputs={"v": sf.Output("speed")}, numbers=numbers, effects=effects, settings=["d", "round"]
    )
    table = falls(1, rounds=3, wall=1.5)
    model = read_runs_of(table, given, Roles(session="round"))[0]
    study, base, _ = first_fit(model, held_out=np.arange(len(table)) % 18 == 0, draws=20)
    assert base.noise.session_ratio == pytest.approx(1.0)  # unknown
    for k in range(3):
        some = study.split.fitted & (table["round"] == f"round {k}").to_numpy()
        mean = np.log(table["d"] ** 2 / table["v"])[some].mean()
        assert np.log(base.parameters[f"mu{k}"]) == pytest.approx(mean, abs=1e-3)


def test_intervals_contain_the_scatter_of_sessions() -> None:
    within, count = 0, 60
    for seed in range(count):
        base = first_fit(model_of(falls(100 + seed, scatter=0.03)), draws=20)[1]
        low, high = base.interval("viscosity")
        within += low < 1.0 < high
    assert 0.87 * count <= within


def test_forms_alike_are_named_and_numbers_have_their_envelope() -> None:
    """A decoy describes what the wall leaves; neither is exact. The size of theory comes first."""
    result = verdict(falls(3, wall=1.0, bump=0.02))
    titles = [form.title for form in result.forms]
    assert titles[0] == "wall of the tube at the size of theory, 1"
    assert {"wall of the tube", "stop-watch late and drag of the surface"} < set(titles)
    own = result.final.interval("viscosity")
    assert not own[0] < 1.0 < own[1]  # that of a wrong form
    low, high = result.final_intervals["viscosity"]
    assert low < 1.0 < high
    for form in result.forms:
        assert low <= form.fit.parameters["viscosity"] <= high
    record = result.facts
    assert [form["title"] for form in record["forms"]] == titles
    assert all(0 < form["error"] < 0.1 for form in record["forms"])


def test_a_gain_is_paired_over_conditions() -> None:
    model = model_of(falls(5, wall=1.0))
    study, base, _ = first_fit(model, draws=20)
    wall = fit(study.model, {**base.parameters, "wall": 0.5}, ("viscosity", "wall"), study.split.fitted, title="")
    gain = paired_gain(study, wall, base)
    assert len(gain.of_conditions) == len(DIAMETERS)
    assert gain.certain
    assert gain.gain == pytest.approx(-paired_gain(study, base, wall).gain, rel=0.5)
    same = paired_gain(study, wall, wall)
    assert (same.gain, same.certain) == (0.0, False)
    joined = envelope(study, ("viscosity",), [Hypothesis(Origin.FORM, model.effects[:1], f) for f in (base, wall)])
    assert joined["viscosity"][0] < wall.parameters["viscosity"] < joined["viscosity"][1]
    assert joined["viscosity"][0] < base.parameters["viscosity"] < joined["viscosity"][1]


@pytest.mark.rates
def test_envelopes_contain_the_truth_where_the_catalogue_has_it() -> None:
    names, count, within = ("wall", "surface", "late"), 60, 0
    for seed in range(count):
        size = {"wall": 0.8, "surface": 0.25, "late": 0.3}[names[seed % 3]]
        result = verdict(falls(1000 + seed, scatter=0.01, **{names[seed % 3]: size}))
        low, high = result.final_intervals["viscosity"]
        within += low < 1.0 < high
    assert within >= 0.9 * count


def test_conditions_that_were_not_fitted_have_an_error_of_their_own() -> None:
    result = verdict(falls(7, wall=1.5))
    of_conditions = result.errors.of_conditions
    assert of_conditions is not None
    assert of_conditions.names == "a quarter of the conditions"
    assert of_conditions.after < 0.5 * of_conditions.before
    out, _ = quarter_of_conditions(result.runs, result.split.fitted)
    left_out = set(np.exp(result.runs.inputs[out, 0]).round(3))
    assert len(left_out) == 2
    assert left_out & {2.0, 9.0}  # an end of the setting
    assert result.facts["errors_of_conditions"]["after"] == of_conditions.after


def test_a_noise_that_is_declared_needs_no_repeats() -> None:
    table = falls(9, repeats=1, wall=1.5)
    table = table[table["round"].isin(["round 0", "round 1", "round 2"])].assign(
        d=lambda t: t["d"] + t.index / 100
    )
    table["v"] = fall({name: table[name].to_numpy() for name in ("d", "round")}, {"viscosity": 1.0, "wall": 1.5})[
        "v"
    ]
    table["v"] *= np.exp(NOISE * np.random.default_rng(0).standard_normal(len(table)))
    unknown = verdict(table)
    assert (unknown.runs.noise_known, unknown.verdict, unknown.effects) == (False, "partial", ())
    assert unknown.nearest is not None
    assert not unknown.harmless
    assert "neither repeats nor a declared noise" in " ".join(unknown.caveats)
    declared = verdict(table, noise={"v": f"{100 * NOISE:g} %"})
    assert declared.runs.noise_known
    assert "wall" in declared.effects
    assert declared.noise_ceiling == pytest.approx(NOISE)
    same = verdict(table, noise="unknown")
    assert same.verdict == unknown.verdict


def test_the_loop_turns_until_only_noise_is_left() -> None:
    """Two effects are missing, and the rest is no noise, so that none and no pair explains the runs."""
    result = verdict(falls(11, rounds=6, repeats=6, wall=1.5, late=1.0, bump=0.03))
    assert result.verdict == "partial"
    assert len({turn.named for turn in result.attribution.turns}) == 3
    assert result.attribution.turns[0].named == ""
    errors = [turn.error for turn in result.attribution.turns]
    assert errors == sorted(errors, reverse=True)
    assert result.errors.rms["after"] == pytest.approx(errors[-1])
    assert [turn["error"] for turn in result.facts["turns"]] == errors


def test_a_pull_without_a_residual_is_no_wrong_number() -> None:
    """The largest of many pulls is large by chance in some tables; a bootstrap knows how large."""
    numbers = [
        sf.Number("viscosity", 1.0, low=0.01, high=100),
        sf.Number("scale", 1.0, low=0.5, high=2, sigma=0.01),
    ]

    def scaled(columns: Mapping[str, Any], p: Mapping[str, float]) -> dict[str, Any]:
        return {"v": fall(columns, p)["v"] * p["scale"] ** columns["d"]}

    effects = [sf.Effect("wall", "wall of the tube", low=-1, high=3)]
    given = sf.Model(scaled, outputs={"v": sf.Output("speed")}, numbers=numbers, effects=effects, settings=["d"])
    seen = []
    for off in (0.0, 0.1):
        table = falls(13).assign(v=lambda t, off=off: t["v"] * (1 + off) ** t["d"])
        result = calibrate(read_runs_of(table, given, Roles(session="round"))[0], draws=200, progress=False)
        seen.append((result.verdict, result.attribution.misfit.p["pull"] < 0.02))
    assert seen[0] == ("none", False)
    assert seen[1][1]
    assert seen[1][0] != "none"
