"""The engine on a model that is no robot: beads that fall in a vessel."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
import pytest

import softflagella as sf
from calibration.linear.gls import Noise
from calibration.own_model.function_model import FunctionModel
from calibration.own_model.table_of_runs import Roles, read_runs_of
from calibration.statistics.fit import fit, profile_intervals
from calibration.statistics.statistical_model import start_values
from calibration.verdict.calibrate import calibrate
from calibration.verdict.verdict import Verdict
from common.arrays import Floats, Integers
from tests.oracles.falling_balls import SPHERES_MODEL

SMALL_NOISE = 0.01
TRUTH = {"viscosity": 1.3, "wall": 0.0, "inertia": 0.0}


class OtherBeads(FunctionModel):
    """Settling beads, in a lab that has beads of other diameters, too."""

    def possible(self) -> tuple[FunctionModel, list[dict[str, Any]]]:
        diameter = np.linspace(1.0, 12.0, 23)
        other = falls(diameter, np.zeros(len(diameter), int), {}, 0)
        return FunctionModel(self.model, other.runs, other.columns), [{"diam_mm": d} for d in diameter.tolist()]


def falls(
    diameter: Floats, trial: Integers, truth: dict[str, float], seed: int, noise: float = 0.02
) -> OtherBeads:
    """Falls of beads of `diameter` (n,) [mm] in glycerine in the rounds `trial` (n,), drawn from a truth."""
    table = pd.DataFrame({"diam_mm": diameter, "trial": trial + 1})
    speed = SPHERES_MODEL.settle(table, {**TRUTH, **truth})["v_mm_s"]
    table["v_mm_s"] = speed * np.exp(np.random.default_rng(seed).normal(scale=noise, size=len(table)))
    model = read_runs_of(table, SPHERES_MODEL.MODEL, Roles(session="trial"))[0]
    return OtherBeads(model.model, model.runs, model.columns)


def spheres(truth: dict[str, float], seed: int, diameters: Sequence[float], *, noise: float = 0.02) -> OtherBeads:
    """Five rounds of falls, a fall a bead."""
    return falls(np.tile(diameters, 5), np.repeat(np.arange(5), len(diameters)), truth, seed, noise)


def law_of_diameter(model: FunctionModel) -> tuple[float, float, float] | None:
    """The power of the diameter that describes what is missing, without wall and inertia, with its interval."""

    def settle(columns: Mapping[str, Any], p: Mapping[str, float]) -> dict[str, Any]:
        speed = SPHERES_MODEL.settle(columns, {**p, "wall": 0.0, "inertia": 0.0})["v_mm_s"]
        return {"v_mm_s": speed * (columns["diam_mm"] / 4) ** -p["power"]}

    power = sf.Effect("power", "drag by a power of the diameter", low=-3, high=3, typical=0.2)
    verdict = calibrate(
        replace(model, model=replace(model.model, function=settle, effects=[power])), progress=False
    )
    if verdict.effects != ("power",) and not verdict.nearest:
        return None
    return verdict.final.parameters["power"], *verdict.final.interval("power")


BEADS, SMALL_BEADS = (1.5, 2.5, 3.5, 5.0, 7.0, 9.0), (3.0, 4.0, 5.0, 5.5)  # mm


def test_a_model_that_is_no_robot_is_calibrated() -> None:
    assert calibrate(spheres({}, 0, BEADS), progress=False).verdict == "none"
    result = calibrate(spheres({"wall": 1.0}, 2, BEADS), progress=False)
    assert result.effects == ("wall",)
    low, high = result.final.interval("wall")
    assert low < 1.0 < high


def test_without_the_names_of_effects_the_wall_is_a_power_of_the_diameter() -> None:
    """Its exponent is the slope of Faxén's correction over the diameters of the beads."""
    beads = (1.6, 2.4, 3.2, 4.7, 6.3)
    value, low, high = law_of_diameter(spheres({"wall": 1.0}, 2, beads))
    ends = np.array([beads[0], beads[-1]]) / 94
    slope = -np.diff(np.log(1 - 2.104 * ends + 2.089 * ends**3))[0] / np.log(beads[-1] / beads[0])
    assert low < slope < high
    assert value == pytest.approx(slope, abs=0.03)
    assert law_of_diameter(spheres({}, 0, beads)) is None


@pytest.mark.rates
def test_the_wall_is_mostly_found_and_sized() -> None:
    results = [calibrate(spheres({"wall": 1.0}, seed, BEADS), progress=False) for seed in range(1, 9)]
    assert sum(r.effects == ("wall",) for r in results) >= 7
    intervals = [r.final.interval("wall") for r in results if r.effects == ("wall",)]
    assert sum(low < 1.0 < high for low, high in intervals) >= len(intervals) - 2
    assert np.mean([r.error_after / r.noise_ceiling for r in results]) < 1.15


def twins(truth: dict[str, float], seed: int) -> Verdict:
    """The verdict of small beads, which alone do not tell the wall from inertia."""
    result = calibrate(small_beads(truth, seed), progress=False)
    assert result.verdict == "ambiguous"
    assert set(result.effects) == {"wall", "inertia"}
    assert [len(c.added) for c in result.claims] == [1, 1]
    assert "wall of the vessel" in result.sentence
    assert "inertia of the fluid" in result.sentence
    wanted = result.next_runs
    assert [r.separation for r in wanted] == sorted((r.separation for r in wanted), reverse=True)
    assert wanted[0].settings["diam_mm"] > 5.5
    assert all(0.5 < r.decides <= 1 for r in wanted)
    assert result.to_dict()["next_runs"] == [r.record() for r in wanted]
    return result


def small_beads(truth: dict[str, float], seed: int) -> OtherBeads:
    return spheres(truth, seed, SMALL_BEADS, noise=SMALL_NOISE)


def diameters_wanted(result: Verdict) -> Floats:
    return np.concatenate([np.full(r.repeats, r.settings["diam_mm"]) for r in result.next_runs])


def after_more_falls(truth: dict[str, float], seed: int, diameter: Floats) -> Verdict:
    """The verdict with further falls (m,), spread over the five rounds."""
    before = small_beads(truth, seed)
    trial = np.concatenate([before.runs.session, np.arange(len(diameter)) % 5])
    both = falls(np.concatenate([before.columns["diam_mm"], diameter]), trial, truth, 100 + seed, SMALL_NOISE)
    y = np.concatenate([before.runs.y, both.runs.y[len(before.runs) :]])
    return calibrate(replace(both, runs=replace(both.runs, y=y)), progress=False)


TRUTHS = pytest.mark.parametrize("truth", [{"wall": 1.0}, {"inertia": 5.0}], ids=["wall", "inertia"])


@TRUTHS
def test_twins_are_called_ambiguous_and_the_next_runs_tell_them_apart(truth: dict[str, float]) -> None:
    after = after_more_falls(truth, 1, diameters_wanted(twins(truth, 1)))
    assert after.effects == tuple(truth)
    assert after.next_runs == ()


@pytest.mark.rates
@TRUTHS
def test_twins_are_mostly_told_apart_by_the_next_runs_and_not_by_others(truth: dict[str, float]) -> None:
    """The beads asked for tell them apart, more small ones do not."""
    told_apart, still_twins, rejected = 0, 0, 0
    for seed in range(6):
        diameter = diameters_wanted(twins(truth, seed))
        after = after_more_falls(truth, seed, diameter)
        told_apart += after.effects == tuple(truth)
        assert after.effects in {(), tuple(truth)} or after.verdict == "ambiguous"
        rejected += after.verdict == "unexplained"  # the true effect is lost in one of fifty tables by the level
        assert (after.next_runs == ()) == (after.verdict != "ambiguous")
        more = after_more_falls(truth, seed, np.resize(SMALL_BEADS, len(diameter)))
        still_twins += more.verdict == "ambiguous"
    assert rejected <= 1
    assert told_apart >= 5
    assert still_twins >= 4


@pytest.mark.slow
def test_a_profile_interval_sees_that_the_model_bends() -> None:
    """Falling spheres: ln v against inertia is concave, so the upper side of its interval is the longer one."""
    model = spheres({"inertia": 1.0}, 5, (3.0, 5.0, 7.0, 9.0))
    every = np.ones(20, bool)
    fitted = fit(model, start_values(model), ("viscosity", "inertia"), every)
    low, high = profile_intervals(model, fitted, every)["inertia"]
    middle = fitted.parameters["inertia"]
    assert high - middle > middle - low
    # The deviance at the ends, by brute force over the viscosity, has risen alike on both sides.
    white = Noise(fitted.noise.run_covariance, fitted.noise.session_ratio).whitener(model.runs.session)

    def deviance(inertia: float) -> float:
        grid = [{"viscosity": v, "wall": 0.0, "inertia": inertia} for v in np.linspace(0.8, 1.8, 501)]
        residual = model.runs.y - model.predict(grid)
        return float(min((white(r) ** 2).sum() for r in residual))

    rises = [deviance(end) - deviance(middle) for end in (low, high)]
    assert rises[0] == pytest.approx(rises[1], rel=0.25)
