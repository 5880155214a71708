"""Places where a term may act that the model lacks.

A `Place` is one of

- a component of the wrench on head and disc, driven by a component of the velocity (`sim.model.power_law`), of
  which the even ones in the direction of the motor are listed. Its size is ε;
- a coefficient of the head, the drag of the tails, or their stiffness: a factor, which is 1 without a law.

Each is multiplied by m = (ω/ω_m)^p (l/l_m)^q (N/N_m)^r. ω_m, l_m and N_m are geometric means of the runs.

The drag of the tails is that of a more viscous fluid around the tails alone: the viscosity times m, and the
coefficients of the head divided by m.

Left out: terms at a free place on the axis, terms of one part of the tails, and terms that are odd in the
direction of the motor.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from sim.model.effect import Effect
from sim.model.power_law import COEFFICIENTS, MOTIONS, TAILS, WRENCHES, Powers, factor_law, force_law

_WRENCH_WORDS = {
    "Fx": "a side force on the head",
    "Fz": "a force along the axis on the head",
    "My": "a couple on the head about the vertical",
    "Mz": "a couple on the head about its axis",
}
_MOTION_WORDS = {
    "vx": "the sideways velocity v_x",
    "vz": "the forward velocity v_z",
    "wyr": "the yaw rate ω_yr",
    "wh": "the spin of the head ω_h",
    "wt": "the spin of the tails ω_t",
}
_COEFFICIENT_WORDS = {
    "Ct": "the drag coefficient C_t of the head",
    "Cr": "the spin-drag coefficient C_r of the head",
    "Cyr": "the side-force coefficient C_yr of the head",
}


@dataclass(frozen=True)
class Place:
    """A place where a term may act.

    Example:
        >>> places()[0].words
        'a side force on the head that is driven by the sideways velocity v_x'
    """

    name: str  # in files
    words: str
    moves: tuple[tuple[str, int], ...]  # parameters of the model that it multiplies by m to a power
    wrench: str = ""  # of WRENCHES, of a term
    motion: str = ""  # of MOTIONS, of a term

    @property
    def part(self) -> str:
        """The part of the robot on which it acts: "head" or "tails"."""
        return "tails" if self.name in TAILS else "head"

    @property
    def is_term(self) -> bool:
        """Whether it is a term of a size of its own, and not a factor."""
        return bool(self.wrench)

    def effect(self, powers: Powers) -> Effect:
        """Return the effect of `sim.model.power_law` at this place."""
        return force_law(self.wrench, self.motion, powers) if self.is_term else factor_law(self.name, powers)


def place_named(name: str) -> Place:
    """Return the place of that name.

    Raises:
        KeyError: there is none.
    """
    return {place.name: place for place in places()}[name]


def in_common(chosen: Sequence[Place]) -> str:
    """Say what places have in common, as a predicate; empty if that is nothing."""
    if len({place.part for place in chosen}) > 1:
        return ""
    wrenches, motions = {place.wrench for place in chosen}, {place.motion for place in chosen}
    if len(wrenches) == 1 and chosen[0].wrench:
        return f"are {_WRENCH_WORDS[chosen[0].wrench]}"
    acts = f"act on the {chosen[0].part}"
    return (
        f"{acts}, driven by {_MOTION_WORDS[chosen[0].motion]}" if len(motions) == 1 and chosen[0].motion else acts
    )


def places() -> tuple[Place, ...]:
    """List every place."""
    terms = [
        Place(
            f"{wrench}_{motion}",
            f"{_WRENCH_WORDS[wrench]} that is driven by {_MOTION_WORDS[motion]}",
            ((force_law(wrench, motion, Powers()).name, 1),),
            wrench,
            motion,
        )
        for wrench in WRENCHES
        for motion in MOTIONS
    ]
    coefficients = [Place(name, _COEFFICIENT_WORDS[name], ((field, 1),)) for name, field in COEFFICIENTS.items()]
    drag = (("viscosity", 1), *((field, -1) for field in COEFFICIENTS.values()))
    return (
        *terms,
        *coefficients,
        Place("tail_drag", "the drag of the tails", drag),
        Place("tail_stiffness", "the stiffness of the tails", (("youngs_modulus", 1),)),
    )
