"""Places where a term may act that the model lacks.

A `Place` is one of

- a component of the wrench on head and disc, driven by a component of the velocity (`sim.model.laws`). Terms
  that are odd in the direction of the motor are among them if the runs have both directions;
- a side force at one place on the axis, along the tails or along the head. How far ahead of the disc it acts, its
  lever λ, is fitted, too;
- an effect on the tails: spin drag, splay, sag, natural curvature along the circle of the clamps, which is odd,
  and drag that depends on the local speed or on the place along the tail;
- a coefficient of the head, the drag of the tails, or their stiffness: a factor, which is 1 without a law.

The first three are terms of a size ε. Each is multiplied by m = (ω/ω_m)^p (l/l_m)^q (N/N_m)^r, with ω_m, l_m and
N_m the geometric means of the runs, and by factors of noted inputs (`calibration.laws.readings`).

The drag of the tails is that of a more viscous fluid around the tails alone: the viscosity times m, and the
coefficients of the head divided by m. The stiffness stands for the viscosity of the whole fluid, too: the motion
at a given speed of the motor depends on their ratio alone, and no run tells stiffer tails from a thinner fluid.
A side force F_x with a lever is F_x at the disc and the couple M_y = λ l F_x or λ L F_x.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from sim.effects import catalogue
from sim.model.effect import Effect
from sim.model.laws import (
    COEFFICIENTS,
    LEVERS,
    LOCAL_DRAG,
    MOTIONS,
    SCALED,
    TAILS,
    WRENCHES,
    Load,
    PowerLawEffect,
    Powers,
    make_law,
)

_WRENCH_WORDS = {
    "Fx": "a side force on the head",
    "Fz": "a force along the axis",
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
_STIFFNESS_WORDS = "the stiffness of the tails over the viscosity of the fluid"
_ELSEWHERE = "a side force away from the disc"
_TAIL_EFFECTS = {
    "tail_spin_drag": "drag on the tails' own spin",
    "natural_splay": "a natural curvature of the tails away from the axis",
    "tail_sag": "a steady load on the tails across the axis",
    "natural_curvature": "a natural curvature of the tails along the circle of the clamps",
    "tail_drag_by_speed": "drag of the tails by a power of their local speed",
    "tail_drag_along": "drag that grows along the tails",
}
_ODD = "_odd"
# Levers with which a side force is ranked, and between which it is fitted.
_RANKED_LEVERS = {"l": (-0.25, -0.5, -0.75), "L": (0.5, 1.0)}
_LEVER_BOUNDS = {"l": (-1.2, 0.3), "L": (-0.3, 1.3)}


@dataclass(frozen=True)
class Place:
    """A place where a term may act.

    Example:
        >>> places()[0].words
        'a side force on the head that is driven by the sideways velocity v_x'
    """

    name: str  # in files
    words: str
    moves: tuple[tuple[str, int], ...]  # parameters of the model that it multiplies by m to a power, and terms
    part: str = "head"  # on which it acts: "head" or "tails"; "robot" for a force along the axis
    is_term: bool = True  # of a size of its own, and not a factor
    wrench: str = ""  # of WRENCHES, of a load at one place
    motion: str = ""  # of MOTIONS, of a load at one place
    odd: bool = False  # in the direction of the motor
    lever_unit: str = ""  # of LEVERS, of a side force elsewhere than at the disc

    @property
    def levers(self) -> tuple[float, ...]:
        """Levers λ with which the place is ranked; one that means nothing if it has none."""
        return _RANKED_LEVERS.get(self.lever_unit, (0.0,))

    @property
    def elsewhere(self) -> tuple[str, ...]:
        """Names of the places where a side force at the disc has a lever; none for all other places."""
        levered = self.wrench == "Fx" and not self.odd and not self.lever_unit
        return tuple(f"{self.name}_at_{unit}" for unit in LEVERS) if levered else ()

    @property
    def at_disc(self) -> str:
        """Name of the place of the same side force at the disc, of one that has a lever."""
        return f"{self.wrench}_{self.motion}"

    @property
    def lever_bounds(self) -> tuple[float, float]:
        """Least and largest λ of a place that has one."""
        return _LEVER_BOUNDS[self.lever_unit]

    def law(self, powers: Powers, lever: float = 0.0) -> PowerLawEffect:
        """Return the law at this place (`sim.model.laws`)."""
        if not self.wrench:
            return make_law(_effects_on_tails().get(self.name, self.name), powers)
        load = Load(self.wrench, self.motion, self.odd, self.lever_unit)
        return make_law(load.place, powers, lever=lever if self.lever_unit else 0.0)


def place_named(name: str) -> Place:
    """Return the place of that name; KeyError if there is none."""
    return {place.name: place for place in places()}[name]


def in_common(chosen: Sequence[Place]) -> str:
    """Say what places have in common, as a predicate; empty if that is nothing."""
    if len({place.part for place in chosen}) > 1:
        return ""
    wrenches, motions = {place.wrench for place in chosen}, {place.motion for place in chosen}
    at_disc = not any(place.lever_unit for place in chosen)
    if len(wrenches) == 1 and chosen[0].wrench and at_disc:
        return f"are {_WRENCH_WORDS[chosen[0].wrench]}"
    acts = f"act on the {chosen[0].part}"
    return (
        f"{acts}, driven by {_MOTION_WORDS[chosen[0].motion]}" if len(motions) == 1 and chosen[0].motion else acts
    )


def places(*, both_directions: bool = True) -> tuple[Place, ...]:
    """List every place; what is odd only if there are runs in both directions of the motor."""
    loads = [_load(wrench, motion, odd=False) for wrench in WRENCHES for motion in MOTIONS]
    elsewhere = [_load("Fx", motion, odd=False, lever_unit=unit) for unit in LEVERS for motion in MOTIONS]
    odd = [_load(wrench, motion, odd=True) for wrench in WRENCHES for motion in MOTIONS] if both_directions else []
    coefficients = [
        Place(name, _COEFFICIENT_WORDS[name], ((field, 1),), is_term=False) for name, field in COEFFICIENTS.items()
    ]
    drag = (("viscosity", 1), *((field, -1) for field in COEFFICIENTS.values()))
    drag_of_tails, stiffness = TAILS
    return (
        *loads,
        *coefficients,
        Place(drag_of_tails, "the drag of the tails", drag, "tails", is_term=False),
        Place(stiffness, _STIFFNESS_WORDS, (("youngs_modulus", 1),), "tails", is_term=False),
        *(
            Place(name, _TAIL_EFFECTS[name], ((make_law(effect).name, 1),), "tails", odd=effect.symmetry == "odd")
            for name, effect in _effects_on_tails().items()
            if both_directions or effect.symmetry == "even"
        ),
        *elsewhere,
        *odd,
    )


def _effects_on_tails() -> dict[str, Effect]:
    """Return the effects on the tails that a law multiplies, by name."""
    return {name: catalogue()[name] for name in SCALED} | LOCAL_DRAG


def _load(wrench: str, motion: str, *, odd: bool, lever_unit: str = "") -> Place:
    """Make the place of a load at one place on the axis."""
    moves = [(make_law(Load(wrench, motion, odd).place).name, 1)]
    words = _WRENCH_WORDS[wrench]
    if lever_unit:
        moves.append((make_law(Load("My", motion).place).name, 1))
        words = _ELSEWHERE
    sides = ", and that differs between left and right turns" if odd else ""
    return Place(
        f"{wrench}_{motion}{_ODD if odd else ''}{f'_at_{lever_unit}' if lever_unit else ''}",
        f"{words} that is driven by {_MOTION_WORDS[motion]}{sides}",
        tuple(moves),
        part="tails" if lever_unit == "l" else "robot" if wrench == "Fz" else "head",
        wrench=wrench,
        motion=motion,
        odd=odd,
        lever_unit=lever_unit,
    )
