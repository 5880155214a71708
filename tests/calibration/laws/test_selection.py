"""The choice among the places of laws: p-value of the search, EBIC, selection frequency, intervals."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import kstest, norm

import calibration.laws.selection
from calibration.laws.law_fits import Laws
from calibration.laws.linear_models import LinearModels
from calibration.laws.places import places
from calibration.laws.search import Search
from calibration.laws.selection import Selection, examine_selection
from calibration.report.law_card import _row, _simultaneous
from calibration.report.quantities import plain
from calibration.report.robot_laws import RobotLaws, find_robot_laws
from calibration.swimmer.synthetic_table import make_table
from sim.arrays import Floats
from tests.calibration.toy_tables import START, TRUTH, install_toy

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
    monkeypatch.setattr(calibration.laws.selection, "_NULL_DRAWS", 199)
    monkeypatch.setattr(calibration.laws.selection, "_LAW_DRAWS", 100)


@pytest.mark.usefixtures("few_draws")
def test_p_values_of_a_search_are_uniform_where_there_is_no_law() -> None:
    p = np.array([examine_selection(searched(noise(seed)), seed=seed).p_value for seed in range(80)])
    assert kstest(p, "uniform").pvalue > 0.05
    assert (p >= 1 / 200).all()
    best = [searched(noise(seed)).fits.gain.max() for seed in range(80)]
    assert np.mean(np.array(best) > 0) > 0.1  # so many have a smaller BIC than without a law


@pytest.mark.usefixtures("few_draws")
def test_a_law_is_beyond_all_draws_and_its_place_is_first_in_most_of_them() -> None:
    residual = noise(1) + 1.2 * TABLE[:, :, 3, 0]
    search = searched(residual)
    selection = examine_selection(search, seed=2)
    names = [place.name for place in search.places]
    assert search.ranked[0].place.name == names[3]
    assert selection.p_value == pytest.approx(1 / 200)
    assert selection.first[names[3]] > 0.95
    assert sum(selection.first.values()) == pytest.approx(1.0)
    assert all(selection.near[name] >= selection.first[name] for name in names)


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
    monkeypatch.setattr(calibration.laws.selection, "_NULL_DRAWS", 1999)
    one = examine_selection(searched(noise(1), [(0, (0,))]), seed=2).widest
    assert one == pytest.approx(norm.ppf(0.975), rel=0.1)  # S is known but for its 32 degrees of freedom
    every = examine_selection(searched(noise(1)), seed=2).widest
    assert 1.3 * one < every < norm.ppf(1 - 0.025 / (2 * len(MODELS))) * 1.15  # below Bonferroni's


def test_of_variants_of_a_place_the_best_counts() -> None:
    search = searched(noise(1) + 1.2 * TABLE[:, :, 3, 0])
    first = search.places[0]
    variants = replace(search, places=(first, first, *search.places[2:3], first, *search.places[4:]))
    assert len(variants.ranked) == len(variants.names) == PLACES - 2
    assert variants.ranked[0].place.name == first.name
    assert variants.ranked[0].gain == search.ranked[0].gain


def test_ebic_counts_the_models_with_as_many_columns() -> None:
    selection = Selection(0.5, {}, {}, 2.0, {1: 8, 2: 40})
    assert selection.ebic_gain(30.0, 1) == pytest.approx(30 - 2 * math.log(8))
    assert selection.ebic_gain(30.0, 2) == pytest.approx(30 - 2 * math.log(40))


@pytest.fixture(scope="module")
def described() -> RobotLaws:
    effects = {"law_Mz_wh_speed1000_length-1000_tails0": 5.0}
    with pytest.MonkeyPatch.context() as patch:
        install_toy(patch)
        return find_robot_laws(
            make_table(replace(TRUTH, effects=effects), seed=4, title=""), START, progress=False
        )


def laws_of(described: RobotLaws) -> Laws:
    assert described.laws is not None
    assert described.laws.selection is not None
    return described.laws


def test_the_record_has_what_the_choice_costs(described: RobotLaws) -> None:
    laws, record = laws_of(described), described.to_dict()
    selection = laws.selection
    assert selection is not None
    assert record["search_p_value"] == selection.p_value == 0.001
    assert selection.models == {1: 86, 2: 228, 3: 218, 4: 71}  # of 71 terms and 5 factors of three inputs
    assert [one["place"] for one in record["places"]] == [one.place.name for one in laws.ranked]
    assert sum(one["first"] for one in record["places"]) == pytest.approx(1.0)
    for one, ranked in zip(record["places"], laws.ranked, strict=True):
        assert one["near_first"] >= one["first"]
        assert one["gain"] - one["ebic_gain"] == pytest.approx(2 * math.log(selection.models[ranked.columns]))
    for one, law in zip(record["laws"], laws.fitted, strict=True):
        assert one["gain"] - one["ebic_gain"] == pytest.approx(2 * math.log(selection.models[law.numbers]))
    assert "(with the choice among all places counted, p ≤ 0.001)" in described.sentence


def test_a_law_is_claimed_only_if_noise_hardly_ever_gains_as_much(described: RobotLaws) -> None:
    laws = laws_of(described)
    assert laws.selection is not None
    assert laws.complete
    for p, claimed in ((0.03, True), (0.05, False)):
        other = replace(laws, selection=replace(laws.selection, p_value=p))
        assert other.complete is claimed
        assert ("is described by" in other.sentence) is claimed
        assert f"p = {p}" in other.sentence
    assert "No law is claimed: noise alone can gain as much" in other.sentence
    assert f"The nearest is {laws.kept[0].words}." in other.sentence
    assert other.rivals == ()
    assert _row(laws.kept[0], other)[-1] == "noise alone can gain as much"
    assert _row(laws.kept[0], laws)[-1] == "describes the runs"


def test_the_report_shows_in_how_many_tables_a_place_is_first(described: RobotLaws) -> None:
    laws = laws_of(described)
    assert laws.selection is not None
    law = laws.fitted[0]
    assert f"{100 * laws.selection.first[law.place.name]:.0f} %" in _row(law, laws)


def test_simultaneous_intervals_contain_those_of_the_place(described: RobotLaws) -> None:
    laws, record = laws_of(described), described.to_dict()
    assert laws.selection is not None
    best = laws.kept[0]
    numbers = next(one for one in record["laws"] if one["place"] == best.place.name)
    for name in ("size", "speed", "length", "tails"):
        (low, high), (lower, higher) = numbers[name]["interval"], numbers[name]["simultaneous_interval"]
        assert lower < low < high < higher
    at = best.fit.names.index("law_speed")
    deviation = math.sqrt(best.fit.covariance[at, at] / best.fit.inflation)
    assert numbers["speed"]["simultaneous_interval"][1] == pytest.approx(
        best.fit.parameters["law_speed"] + laws.selection.widest * deviation
    )
    low, high = numbers["speed"]["simultaneous_interval"]
    assert f"ω {plain(low, 2)} to {plain(high, 2)}" in _simultaneous(laws)
