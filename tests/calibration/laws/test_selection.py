"""The choice among the places of laws: p-value of the search, EBIC, selection frequency, intervals."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import kstest, norm

import calibration.laws.search
from calibration.laws.laws import Laws
from calibration.laws.places import places
from calibration.laws.search import LinearModels, Search, Selection, examine_selection
from calibration.report.report import sections
from calibration.report.robot_verdict import RobotLaws
from calibration.verdict.record import facts
from calibration.words.quantities import plain
from common.arrays import Floats
from tests.calibration.toy_tables import laws_of_toy, none

SESSION = np.repeat(np.arange(4), 16)
CONDITION = np.arange(len(SESSION)) // 2
OUTPUTS, PLACES, COLUMNS = 2, 8, 2
MODELS = [(place, chosen) for place in range(PLACES) for chosen in ((0,), (0, 1))]
PRECISION = np.array([0.0, 25.0])
_RNG = np.random.default_rng(0)
ABSORBED = _RNG.normal(size=(len(SESSION) // 2, OUTPUTS, len(PRECISION)))[CONDITION]
TABLE = _RNG.normal(size=(len(SESSION) // 2, OUTPUTS, PLACES, COLUMNS))[CONDITION]


def searched(residual: Floats, models: list[tuple[int, tuple[int, ...]]] = MODELS) -> Search:
    columns = LinearModels(ABSORBED, PRECISION, TABLE, models, SESSION, CONDITION)
    of_places = places()[: 1 + max(place for place, _ in models)]
    return Search(
        of_places, (0.0,) * len(of_places), columns, ("law_speed",), residual, columns.fit(residual[None])
    )


def noise(seed: int) -> Floats:
    rng = np.random.default_rng(seed)
    sessions = rng.normal(scale=0.3, size=(4, OUTPUTS))[SESSION]
    nuisances = rng.normal(size=len(PRECISION)) * np.array([1.0, 0.2])
    return np.asarray(rng.normal(size=(len(SESSION), OUTPUTS)) + sessions + ABSORBED @ nuisances)


@pytest.fixture
def few_draws(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(calibration.laws.search, "_NULL_DRAWS", 199)
    monkeypatch.setattr(calibration.laws.search, "_LAW_DRAWS", 100)


@pytest.mark.slow
@pytest.mark.usefixtures("few_draws")
def test_p_values_of_a_search_are_uniform_where_there_is_no_law() -> None:
    searches = [searched(noise(seed)) for seed in range(80)]
    p = np.array([examine_selection(search, seed=seed).p_value for seed, search in enumerate(searches)])
    assert kstest(p, "uniform").pvalue > 0.05
    assert (p >= 1 / 200).all()
    smaller_bic = np.array([search.fits.gain.max() for search in searches]) > 0
    assert smaller_bic.mean() > 0.1


@pytest.mark.usefixtures("few_draws")
def test_a_law_is_beyond_all_draws_and_its_place_is_first_in_most_of_them() -> None:
    search = searched(noise(1) + 1.2 * TABLE[:, :, 3, 0])
    selection = examine_selection(search, seed=2)
    names = [place.name for place in search.places]
    assert search.ranked[0].place.name == names[3]
    assert selection.p_value == pytest.approx(1 / 200)
    assert selection.first[names[3]] > 0.95
    assert sum(selection.first.values()) == pytest.approx(1.0)
    assert all(selection.near[name] >= selection.first[name] for name in names)
    first = search.places[0]  # of variants of a place the best counts
    variants = replace(search, places=(first, first, *search.places[2:3], first, *search.places[4:]))
    assert len(variants.ranked) == len(variants.names) == PLACES - 2
    assert (variants.ranked[0].place.name, variants.ranked[0].gain) == (first.name, search.ranked[0].gain)


@pytest.mark.usefixtures("few_draws")
def test_places_with_the_same_columns_share_the_first_rank(monkeypatch: pytest.MonkeyPatch) -> None:
    alike = TABLE.copy()
    alike[:, :, 5] = alike[:, :, 3] + 0.03 * TABLE[:, :, 5]
    monkeypatch.setitem(globals(), "TABLE", alike)
    selection = examine_selection(searched(noise(1) + alike[:, :, 3, 0]), seed=2)
    names = [place.name for place in places()[:PLACES]]
    for number in (3, 5):
        assert 0.2 < selection.first[names[number]] < 0.8
        assert selection.near[names[number]] > 0.95
    assert max(selection.first[name] for i, name in enumerate(names) if i not in (3, 5)) < 0.05


@pytest.mark.usefixtures("few_draws")
def test_simultaneous_intervals_are_those_of_one_weight_where_there_is_one_model(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(calibration.laws.search, "_NULL_DRAWS", 1999)
    one = examine_selection(searched(noise(1), [(0, (0,))]), seed=2).widest
    of_scatter = math.sqrt(32 / 29 * (1 + 1 / 30))  # S of two outputs has 32 degrees of freedom
    assert one == pytest.approx(of_scatter * norm.ppf(0.975), rel=0.05)
    every = examine_selection(searched(noise(1)), seed=2).widest
    assert 1.3 * one < every < norm.ppf(1 - 0.025 / (2 * len(MODELS))) * 1.15  # below Bonferroni's


def described() -> tuple[RobotLaws, Laws, Selection]:
    found = laws_of_toy(4, **{"law_Mz_wh_speed1000_length-1000_tails0": 5.0})
    assert found.laws is not None
    assert found.laws.selection is not None
    return found, found.laws, found.laws.selection


def in_report(laws: Laws) -> str:
    """The sections of a report with laws."""
    record = facts(none()) | {"next_steps": [], "laws": {**laws.to_dict(), "beside": ""}, "path": None}
    return " ".join(sections(record, {}).split())


@pytest.mark.slow
def test_the_record_has_what_the_choice_costs() -> None:
    found, laws, selection = described()
    record = found.to_dict()
    assert record["search_p_value"] == selection.p_value == 0.001
    assert [one["place"] for one in record["places"]] == [one.place.name for one in laws.ranked]
    assert sum(one["first"] for one in record["places"]) == pytest.approx(1.0)
    assert all(one["near_first"] >= one["first"] for one in record["places"])
    for one, columns in (
        *zip(record["places"], (ranked.columns for ranked in laws.ranked), strict=True),
        *zip(record["laws"], (law.numbers for law in laws.fitted), strict=True),
    ):
        assert one["gain"] - one["ebic_gain"] == pytest.approx(2 * math.log(selection.models[columns]))
    assert "(with the choice among all places counted, p ≤ 0.001)" in found.sentence
    assert record["laws"][0]["first"] == selection.first[laws.fitted[0].place.name]


def test_a_law_is_claimed_only_if_noise_hardly_ever_gains_as_much() -> None:
    _, laws, selection = described()
    assert laws.complete
    for p, claimed in ((0.03, True), (0.05, False)):
        other = replace(laws, selection=replace(selection, p_value=p))
        assert other.complete is claimed
        assert ("is described by" in other.sentence) is claimed
        assert f"p = {p}" in other.sentence
    assert "No law is claimed: noise alone can gain as much" in other.sentence
    assert f"The nearest is {laws.kept[0].words}." in other.sentence
    assert other.rivals == ()
    assert "<td>noise alone can gain as much</td>" in in_report(other)
    assert "<td>describes the runs</td>" in in_report(laws)


def test_simultaneous_intervals_contain_those_of_the_place() -> None:
    found, laws, selection = described()
    best = laws.kept[0]
    numbers = next(one for one in found.to_dict()["laws"] if one["place"] == best.place.name)
    for name in ("size", "speed", "length", "tails"):
        (low, high), (lower, higher) = numbers[name]["interval"], numbers[name]["simultaneous_interval"]
        assert lower < low < high < higher
    low, high = numbers["speed"]["simultaneous_interval"]
    at = best.fit.names.index("law_speed")
    deviation = math.sqrt(best.fit.covariance[at, at] / best.fit.inflation)
    assert high == pytest.approx(best.fit.parameters["law_speed"] + selection.widest * deviation)
    assert f"ω {plain(low, 2)} to {plain(high, 2)}" in in_report(laws)
