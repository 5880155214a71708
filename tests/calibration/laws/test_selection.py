"""The choice among the places of laws: the p-value of the search."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import kstest

import calibration.laws.search
from calibration.laws.laws import Laws
from calibration.laws.places import places
from calibration.laws.search import LinearModels, Search, search_p_value
from calibration.report.report import sections
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
    monkeypatch.setattr(calibration.laws.search, "DRAWS", 199)


@pytest.mark.slow
@pytest.mark.usefixtures("few_draws")
def test_p_values_of_a_search_are_uniform_where_there_is_no_law() -> None:
    searches = [searched(noise(seed)) for seed in range(80)]
    p = np.array([search_p_value(search, seed=seed) for seed, search in enumerate(searches)])
    assert kstest(p, "uniform").pvalue > 0.05
    assert (p >= 1 / 200).all()
    smaller_bic = np.array([search.fits.gain.max() for search in searches]) > 0
    assert smaller_bic.mean() > 0.1


@pytest.mark.usefixtures("few_draws")
def test_a_law_is_beyond_all_draws_and_its_place_is_first() -> None:
    search = searched(noise(1) + 1.2 * TABLE[:, :, 3, 0])
    assert search.ranked[0].place.name == search.places[3].name
    assert search_p_value(search, seed=2) == pytest.approx(1 / 200)
    first = search.places[0]  # of variants of a place the best counts
    variants = replace(search, places=(first, first, *search.places[2:3], first, *search.places[4:]))
    assert len(variants.ranked) == PLACES - 2
    assert (variants.ranked[0].place.name, variants.ranked[0].gain) == (first.name, search.ranked[0].gain)


def in_report(laws: Laws) -> str:
    """The sections of a report with laws."""
    record = none().to_dict() | {"next_steps": [], "laws": {**laws.to_dict(), "beside": ""}, "path": None}
    return " ".join(sections(record, {}).split())


def test_a_law_is_claimed_only_if_noise_hardly_ever_gains_as_much() -> None:
    laws = laws_of_toy(4, **{"law_Mz_wh_speed1000_length-1000_tails0": 5.0}).laws
    assert laws.complete
    assert "(with the choice among all places counted, p ≤ 0.001)" in laws.sentence
    record = laws.to_dict()
    assert record["search_p_value"] == 0.001
    assert [one["place"] for one in record["places"]] == [one.place.name for one in laws.ranked]
    for p, claimed in ((0.03, True), (0.05, False)):
        other = replace(laws, search_p_value=p)
        assert other.complete is claimed
        assert ("is described by" in other.sentence) is claimed
        assert f"p = {p}" in other.sentence
    assert "No law is claimed: noise alone can gain as much" in other.sentence
    assert f"The nearest is {laws.kept[0].words}." in other.sentence
    assert other.rivals == ()
    assert "<td>noise alone can gain as much</td>" in in_report(other)
    assert "<td>describes the runs</td>" in in_report(laws)
