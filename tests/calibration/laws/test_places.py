"""What places of laws have in common."""

from __future__ import annotations

import pytest

from calibration.laws.places import in_common, place_named, places


@pytest.mark.parametrize(
    ("names", "said"),
    [
        (("Fz_wt", "Fz_vx"), "are a force along the axis"),
        (("Fz_wt", "Cr"), ""),
        (("My_wt", "Fx_wt"), "act on the head, driven by the spin of the tails ω_t"),
        (("Ct", "Fx_wt"), "act on the head"),
        (("Ct", "Cyr"), "act on the head"),
        (("tail_drag", "tail_stiffness"), "act on the tails"),
        (("tail_drag", "Cr"), ""),
        (("Fx_wt_at_l", "tail_drag_along"), "act on the tails"),
        (("Fx_wt_at_l", "Fx_wt"), ""),
        (("Fx_wt_at_L", "Fx_wt"), "act on the head, driven by the spin of the tails ω_t"),
        (("Fx_wt_at_L", "Fx_wt_odd"), "act on the head, driven by the spin of the tails ω_t"),
    ],
)
def test_what_they_have_in_common_is_said(names: tuple[str, ...], said: str) -> None:
    assert in_common([place_named(name) for name in names]) == said


def test_places_have_names_of_their_own() -> None:
    names = [place.name for place in places()]
    assert len(set(names)) == len(names) == 61
    assert len(places(both_directions=False)) == 40
    with pytest.raises(KeyError):
        place_named("no such place")
