"""Effects that the base model lacks: this folder finds its own members, one effect a file."""

from __future__ import annotations

import difflib
import importlib
import pkgutil
from collections.abc import Mapping
from functools import cache

import numpy as np

from common.arrays import Floats
from common.errors import InputError
from sim.model.effect import Effect
from sim.model.groups import check_finite
from sim.model.laws import PowerLawEffect, read_law

__all__ = ["Effect", "catalogue", "check_effects", "effect_named", "is_effect"]


@cache
def catalogue() -> dict[str, Effect]:
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
    return found


@cache
def _law(name: str) -> PowerLawEffect | None:
    return read_law(name, catalogue())


def _find(name: str) -> Effect | None:
    return catalogue().get(name) or _law(name)


def is_effect(name: str) -> bool:
    """Tell whether a name is that of an effect or of a law."""
    return _find(name) is not None


def effect_named(name: str) -> Effect:
    """Return the effect, or the law (`sim.model.laws`), of that name.

    Raises:
        InputError: there is none.
    """
    effect = _find(name)
    if effect is None:
        near = difflib.get_close_matches(name, catalogue(), 1)
        known = f"is it {near[0]}?" if near else f"known are {', '.join(catalogue())}"
        raise InputError(f"unknown effect {name!r}; {known}")
    return effect


def check_effects(effects: Mapping[str, Floats | float]) -> None:
    """Reject unknown effects, and sizes, (B,) or one, that are not numbers or outside their bounds."""
    for name, size in effects.items():
        low, high = effect_named(name).bounds
        for end in (size.min(), size.max()) if isinstance(size, np.ndarray) else (size,):
            check_finite(name, end)
            if not low <= end <= high:
                raise InputError(f"{name} = {end:g}; its size must lie from {low:g} to {high:g}")
