"""Training: repeatable, and which robots are learned; the card states the errors of held-out ones."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import surrogate.training.train as training
from common.errors import InputError
from dataset.build import build
from surrogate.held_out import relative_errors
from surrogate.response import decoded_spread, encoded_spread
from surrogate.table import NeuralTable
from surrogate.table_file import load
from surrogate.training import fits
from surrogate.training.fits import learnable, wrench_samples
from surrogate.training.model_card import model_card
from surrogate.training.simulated import SimulatedRobots, draw_robots, join_robots, simulate_robots
from surrogate.training.train import with_radius
from tests.dataset.sweeps import design, invented
from tests.shared import shared
from tests.surrogate.small import CURVES, TAILS, flips, rows, table

pytestmark = pytest.mark.slow


@pytest.fixture(autouse=True)
def _small_network_of_the_gap(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fits, "_GAP", CURVES)


def test_training_is_repeatable_and_reads_a_folder(monkeypatch: pytest.MonkeyPatch) -> None:
    """With few steps: what they reach does not matter."""
    some = rows(256, 13, wide=False)
    tails, curves = replace(TAILS, epochs=3, iterations=3), replace(CURVES, epochs=3, iterations=3)
    manifest = {"config_hash": "h", "code_version": "c", "config": {}}
    monkeypatch.setattr(training, "read_robots", lambda folder: (some, np.arange(len(some))))
    monkeypatch.setattr(training, "read_manifest", lambda folder: manifest)
    monkeypatch.setattr(training, "simulate_robots", lambda robots, **kind: flips())
    first, again = (training.train("folder", tails, curves, title="") for _ in range(2))
    assert first.identity == again.identity
    counts = first.provenance["rows"]
    assert counts["train"] + counts["widths"] + counts["held_out"] == len(some)
    few = some.at(np.arange(40))
    monkeypatch.setattr(training, "read_robots", lambda folder: (few, np.arange(40)))
    with pytest.raises(InputError, match="training needs 64"):
        training.train("folder", tails, curves, title="")


def test_a_table_of_robots_with_effects_alone_states_its_errors() -> None:
    held = rows(256, 13, wide=False)
    held = replace(held, robots={**held.robots, "disc_drag": np.full(len(held), 0.2)})
    lookup = training._with_intervals(replace(table(), errors={}), held, held)
    assert lookup.errors["omega_yr_bar"]["median"] > 0
    card = model_card(lookup, held)
    assert "with effects on head and motor" in card
    assert "| N = 3 |" in card


@shared
def turned(tails: float, seed: int = 17) -> SimulatedRobots:
    """Simulate robots, some of which a couple in yaw turns against their tails."""
    robots = draw_robots(160, seed, wide=False) | {"N": np.full(160, tails)}
    return simulate_robots(robots | {"surface_couple": np.linspace(-1.0, 1.0, 160)})


def test_robots_that_couples_turn_against_their_tails_are_learned_with_one_tail_only() -> None:
    for tails in (1.0, 2.0):
        some = turned(tails)
        against = some.motion["omega_yr_bar"] < 0
        assert 12 < against.sum() < len(some) - 12
        learned = learnable(wrench_samples(some.robots, some.motion))
        assert learned[~against].mean() > 0.9
        assert learned[against].mean() > 0.9 if tails == 1 else not learned[against].any()


def test_a_single_tail_is_learned_beside_several() -> None:
    several = rows(256, 13, wide=False)
    held = join_robots([several, turned(1.0, 18)])
    found = training.learn(join_robots([several, turned(1.0)]), held, held, flips(), TAILS, CURVES)
    fresh = turned(1.0, 19)
    answer = found.query(fresh.robots, intervals=True, flag=True)
    wanted, inside = fresh.motion["omega_yr_bar"], ~answer["outside"]
    assert inside.mean() > 0.5
    assert np.median(np.abs(answer["omega_yr_bar"] / wanted - 1)[inside]) < 0.2
    low, high = answer["omega_yr_bar_low"], answer["omega_yr_bar_high"]
    assert 0.75 < np.mean(((low <= wanted) & (wanted <= high))[inside]) < 0.99


def test_tails_go_on_from_those_of_a_table_beside_its_response() -> None:
    several, held = rows(256, 13, wide=False), rows(96, 14, wide=False)
    first = training.learn(several, held, held, flips(), TAILS, CURVES)
    fewer = several.at(np.arange(len(several)) % 2 == 0)
    again = training.with_tails(first, fewer, held, held, TAILS, source={"seeds": 13})
    assert again.curves is first.curves
    assert again.provenance["rows"]["flips"] == first.provenance["rows"]["flips"]
    assert again.provenance["rows"]["train"] < first.provenance["rows"]["train"]
    assert again.provenance["response"]["code_version"] == first.provenance["code_version"]
    third = training.with_tails(again, several, held, held, replace(TAILS, iterations=900))
    assert third.provenance["response"] == again.provenance["response"]
    assert error_of_yaw(third, several) < 0.5 * error_of_yaw(first, several)
    same = training.with_tails(first, several, held, held, replace(TAILS, iterations=0))
    assert error_of_yaw(same, several) == error_of_yaw(first, several)


def test_tails_of_another_shape_than_those_of_the_table_are_learned_anew() -> None:
    several, narrow = rows(256, 13, wide=False), replace(TAILS, width=12)
    several_again = training.with_tails(table(), several, several, several, narrow)
    network = several_again.tails.wrench[2]
    assert network is not None
    assert network.shape["width"] == narrow.width
    assert error_of_yaw(several_again, several) < 0.1


def test_a_response_is_learned_apart_from_the_tails() -> None:
    drawn = draw_robots(192, 17, wide=False) | {"N": 2.0 + np.arange(192) % 3 // 2}
    several = simulate_robots(drawn, curves=True)
    learned, held = several.at(np.arange(len(several)) % 4 > 0), several.at(np.arange(len(several)) % 4 == 0)
    first = load()
    again = training.with_response(first, learned, replace(CURVES, iterations=100), source={"seed": 17})
    assert again.provenance["response"]["seed"] == 17
    assert again.provenance["rows"] == {**first.provenance["rows"], "flips": len(learned)}
    assert np.array_equal(again.query(held.robots, flag=True)["v_z"], first.query(held.robots, flag=True)["v_z"])
    found = again.response(held.robots, flag=True)
    two, turned = held.robots["N"] == 2, held.curves["lag"][:, -1, 2]
    assert np.median(np.abs(found.lag[:, -1, 2] / turned - 1)) < 0.3
    spread, true = (curves[two, 12:, 2] for curves in (found.spread, held.curves["spread"]))
    assert np.median(np.abs(np.log(spread / true))) < 0.5
    assert not found.spread[~two].any()


@pytest.mark.parametrize(("many", "inputs"), [(100, 11), (1000, 7)])
def test_two_tails_see_the_drag_of_the_head_where_there_are_rows_to_learn_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, many: int, inputs: int
) -> None:
    monkeypatch.setattr(fits, "_MANY", many)
    drawn = draw_robots(160, 18, wide=False) | {"N": np.full(160, 2.0)}
    pairs = simulate_robots(drawn)
    training.learn(pairs, pairs, pairs, flips(), TAILS, CURVES).save(tmp_path / "pairs.safetensors")
    lookup = load(tmp_path / "pairs.safetensors")
    network = lookup.tails.wrench[1]
    assert network is not None
    assert network.shape["inputs"] == inputs
    assert error_of_yaw(lookup, pairs) < 0.05


def test_what_is_learned_of_a_spread_gives_it_back() -> None:
    spread = np.random.default_rng(3).uniform(-1, -0.1, size=(5, 25, 3)) * [1e-4, 1e-2, 0.3]
    assert decoded_spread(encoded_spread(spread)) == pytest.approx(np.abs(spread).reshape(5, -1), abs=2e-6)


def error_of_yaw(lookup: NeuralTable, robots: SimulatedRobots) -> float:
    """Return the median relative error of the yaw rate."""
    found = lookup.query(robots.robots, flag=True)["omega_yr_bar"]
    return float(np.nanmedian(np.abs(found / robots.motion["omega_yr_bar"] - 1)))


def test_the_split_is_fixed_and_disjoint() -> None:
    parts = training.split(np.arange(10_000))
    assert np.array_equal(parts[:500], training.split(np.arange(500)))
    assert np.bincount(parts) / 10_000 == pytest.approx([0.8, 0.1, 0.1], abs=0.02)


def test_a_row_that_is_in_two_data_sets_counts_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    seen = {}

    def learn(learned: object, widths: object, held_out: object, *_: object, **__: object) -> None:
        seen["sizes"] = [len(part) for part in (learned, widths, held_out)]  # type: ignore[arg-type]

    monkeypatch.setattr(training, "learn", learn)
    first, longer, another = (str(tmp_path / name) for name in ("first", "longer", "another"))
    for folder, sweep in ((first, design(100)), (longer, design(160)), (another, design(100, seed=6))):
        build(sweep, folder, jobs=1, title="", simulate=invented)
    sizes = {}
    for folders in (first, longer, another, (first, longer), (longer, first, longer), (longer, another)):
        training.train(folders, title="")
        sizes[folders] = seen["sizes"]
    assert sum(sizes[first]) < sum(sizes[longer])
    assert sizes[first, longer] == sizes[longer, first, longer] == sizes[longer]
    assert sizes[longer, another] == [a + b for a, b in zip(sizes[longer], sizes[another], strict=True)]


def test_the_card_states_the_errors_of_the_held_out_robots() -> None:
    held = rows(256, 13, wide=False)
    card = model_card(table(), held)
    answer = table().query(held.robots, flag=True)
    error = 100 * np.abs(relative_errors(answer, with_radius(held.motion))["omega_yr_bar"])
    stated = re.findall(r"N ≥ 2, touching or not \| [^|]+ \| ([\d.e-]+) /", card)
    several = ~answer["outside"] & (held.robots["N"] > 1)
    assert np.isclose(float(stated[0]), np.median(error[several]), rtol=0.06)
    assert table().identity in card
    assert "## Where not to trust it" in card
    assert re.search(r"## Intervals\n.*\| N = 4 \| \d+ to \d+ \|", card, re.DOTALL)


def test_a_card_without_known_errors_says_why() -> None:
    held = rows(64, 13, wide=False)
    beyond = {name: 1000 * values if name == "omega_bar" else values for name, values in held.robots.items()}
    card = model_card(table(), replace(held, robots=beyond))
    assert "Not known: all 64 held-out robots are outside its domain" in card
    assert "On 0" not in card
    assert "| robots |" not in card, "a table without rows"
