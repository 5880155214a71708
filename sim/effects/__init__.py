"""Effects that the base model lacks: this folder finds its own members, one effect a file."""

from __future__ import annotations

import difflib
import importlib
import pkgutil
import sys
from collections.abc import Mapping
from functools import cache

from sim.io.errors import InputError
from sim.model.effect import Effect
from sim.model.power_law import law_from_name
from sim.model.scaled_effect import scaled_from_name

__all__ = ["Effect", "catalogue", "check_effects", "check_size", "effect_named"]


class Catalogue(dict[str, Effect]):
    """Effects by name. It lists those of this folder, and knows beside them each law by its name.

    A law (`sim.model.power_law`, `sim.model.scaled_effect`) states itself in its name. So it is found here in any
    process without being registered, and it is never listed.
    """

    def __contains__(self, name: object) -> bool:
        return super().__contains__(name) or (isinstance(name, str) and self._law(name) is not None)

    def __missing__(self, name: str) -> Effect:
        law = self._law(name)
        if law is None:
            raise KeyError(name)
        return law

    def _law(self, name: str) -> Effect | None:
        return law_from_name(name) or scaled_from_name(name, self)


@cache
def catalogue() -> Catalogue:
    """Return every effect that the base model lacks, by name, in alphabetical order.

    Example:
        >>> from softflagella import effects
        >>> drag = effects()["end_over_end_drag"]
        >>> drag.equation, drag.bounds
        ('M_y = −ε 8π μ0 R³ ω_yr', (0.0, 20.0))
    """
    names = sorted(module.name for module in pkgutil.iter_modules(__path__))
    found = {name: importlib.import_module(f"{__name__}.{name}").EFFECT for name in names}
    for name, effect in found.items():
        if effect.name != name:
            raise TypeError(f"effect file {name}.py declares the name {effect.name!r}; make them equal")
    return Catalogue(found)


def effect_named(name: str) -> Effect:
    """Return the effect of that name.

    Raises:
        InputError: there is no such effect.
    """
    if name not in catalogue():
        near = difflib.get_close_matches(name, catalogue(), 1)
        known = f"is it {near[0]}?" if near else f"known are {', '.join(catalogue())}"
        raise InputError(f"unknown effect {name!r}; {known}")
    return catalogue()[name]


def check_effects(effects: Mapping[str, float]) -> None:
    """Reject unknown effects, and sizes that are not numbers or outside their bounds."""
    for name, size in effects.items():
        check_size(name, size)


def check_size(name: str, size: float) -> None:
    """Reject an unknown effect, or a size that is not a number or outside its bounds."""
    low, high = effect_named(name).bounds
    if not isinstance(size, int | float) or not abs(size) < sys.float_info.max:  # there are larger integers
        raise InputError(f"{name} = {size}; it must be a finite number")
    if not low <= size <= high:
        raise InputError(f"{name} = {size:g}; its size must lie from {low:g} to {high:g}")
