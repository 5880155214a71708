"""Laws of an effect: its size follows a power law, where the effect itself has one size.

    ε_effect = ε m,   m = (ω/ω_c)^p (l/l_c)^q (N/N_c)^r

The effect is one of those that act on the tails, or drag that differs along them:

    tail_drag_by_speed   ζ∥, ζ⊥ × (λ |v|/r0)^ε       a power of the local speed, as a power-law fluid has it
    tail_drag_along      ζ∥, ζ⊥ × e^(ε (2 s/l − 1))   larger at the free end for ε > 0

s is the distance from the clamp. λ |v|/r0 is 1 at the clamps of the paper's control example, as in
`sim.effects.shear_thinning`. The two are no members of the catalogue: a power law has no fluid of its own, and a
gradient no cause.

The name of such a law states it in full, as in `sim.model.power_law`:
"law_tail_sag_speed0_length-1000_tails0".
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from sim.arrays import Floats
from sim.model.body import Body
from sim.model.effect import Effect, Factors
from sim.model.groups import Groups
from sim.model.power_law import Powers

SCALED = ("tail_spin_drag", "natural_splay", "tail_sag", "natural_curvature")  # effects of the catalogue
_WIDER = 20.0  # bounds of a law over those of its effect
_LAW = re.compile("law_([a-z_]+)_" + Powers.PATTERN, re.ASCII)


def _local_drag(name: str, title: str, equation: str) -> Effect:
    return Effect(
        name=name,
        title=title,
        equation=equation,
        source="a power law, from measured runs",
        bounds=(-0.15, 0.15),
        typical=0.1,
        similar=False,
        reach="nonlocal",
    )


LOCAL_DRAG = {
    effect.name: effect
    for effect in (
        _local_drag("tail_drag_by_speed", "drag of the tails by their local speed", "ζ∥, ζ⊥ × (λ |v|/r0)^ε"),
        _local_drag("tail_drag_along", "drag that differs along the tails", "ζ∥, ζ⊥ × e^(ε (2 s/l − 1))"),
    )
}


@dataclass(frozen=True, kw_only=True)
class ScaledEffect(Effect):
    """An effect whose size is multiplied by m."""

    effect: Effect
    powers: Powers

    @property
    def term(self) -> str:
        return self.effect.term

    def adds(self, size: Floats, groups: Groups, body: Body) -> Body:
        return self.effect.adds(self._scaled(size, groups), groups, body)

    def scales(self, size: Floats, groups: Groups) -> Factors:
        return self.effect.scales(self._scaled(size, groups), groups)

    def number(self, size: Floats, groups: Groups) -> Floats:
        return self.effect.number(self._scaled(size, groups), groups)

    def _scaled(self, size: Floats, groups: Groups) -> Floats:
        return np.asarray(size * np.exp(self.powers.logarithm(groups)))


def scaled_effect(effect: Effect, powers: Powers) -> ScaledEffect:
    """Make the law of an effect whose null is 0."""
    low, high = effect.bounds
    factor = powers.words.strip()
    return ScaledEffect(
        name=f"law_{effect.name}_{powers.name}",
        title=f"{effect.title}, as a power law",
        equation=f"{effect.equation}, ε times {factor}" if factor else effect.equation,
        source="a power law, from measured runs",
        unit=effect.unit,
        bounds=(_WIDER * low, _WIDER * high),
        typical=effect.typical,
        symmetry=effect.symmetry,
        dissipative=effect.dissipative,
        similar=effect.similar and not powers.speed,
        reach=effect.reach,
        is_drag=effect.is_drag,
        effect=effect,
        powers=powers,
    )


def scaled_from_name(name: str, effects: Mapping[str, Effect]) -> ScaledEffect | None:
    """Return the law of an effect that a name states in full; None where it states none.

    Args:
        effects: of the catalogue, by name.
    """
    match = _LAW.fullmatch(name)
    if not match:
        return None
    of, *digits = match.groups()
    powers = Powers.from_digits(digits)
    if powers is None or of not in (*SCALED, *LOCAL_DRAG):
        return None
    law = scaled_effect(LOCAL_DRAG[of] if of in LOCAL_DRAG else effects[of], powers)
    return law if law.name == name else None
