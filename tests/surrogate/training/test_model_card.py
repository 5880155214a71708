"""The model card: what it says is what the table does."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np

from surrogate.table.errors import relative_errors
from surrogate.training.model_card import model_card
from surrogate.training.train import with_radius
from tests.surrogate.small import rows, table


def test_the_card_states_the_errors_of_the_held_out_robots() -> None:
    held = rows(256, 13, wide=False)
    card = model_card(table(), held)
    answer = table().query(held.robots, flag=True)
    error = 100 * np.abs(relative_errors(answer, with_radius(held.motion))["omega_yr_bar"])
    yaw_rate = card.split("## Yaw rate")[1]
    stated = re.findall(r"N ≥ 2, touching or not \| ([\d.e-]+) \|", yaw_rate)
    several = ~answer["outside"] & (held.robots["N"] > 1)
    assert np.isclose(float(stated[0]), np.median(error[several]), rtol=0.06)
    assert table().identity in card
    assert "## Where not to trust it" in card


def test_a_card_without_known_errors_says_why() -> None:
    """It used to state errors "on 0 robots"."""
    held = rows(64, 13, wide=False)
    beyond = {name: 1000 * values if name == "omega_bar" else values for name, values in held.robots.items()}
    card = model_card(table(), replace(held, robots=beyond))
    assert "Not known: all 64 held-out robots are outside its domain" in card
    assert "On 0" not in card
