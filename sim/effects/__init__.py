"""Effects that the base model lacks: this folder finds its own members, one effect a file."""

from __future__ import annotations

import importlib
import pkgutil
from functools import cache
from typing import TYPE_CHECKING

from torch import Tensor

from sim.effects.base import Effect

if TYPE_CHECKING:
    from sim.robot import Groups

__all__ = ["Effect", "adjust_head_resistance", "adjust_tail_coefficients", "catalogue"]


@cache
def catalogue() -> dict[str, Effect]:
    """Every effect in this folder, by name, in alphabetical order."""
    names = sorted(module.name for module in pkgutil.iter_modules(__path__) if module.name != "base")
    found = {name: importlib.import_module(f"{__name__}.{name}").EFFECT for name in names}
    for name, effect in found.items():
        if effect.name != name:
            raise TypeError(f"effect file {name}.py declares the name {effect.name!r}; make them equal")
    return found


def adjust_head_resistance(groups: Groups, resistance: Tensor) -> Tensor:
    """The head's resistance (4, 4, B) with the effects that `groups` carries."""
    for name, size in sorted(groups.effects.items()):
        resistance = catalogue()[name].head_resistance(size, groups, resistance)
    return resistance


def adjust_tail_coefficients(groups: Groups, coefficients: tuple[Tensor, Tensor]) -> tuple[Tensor, Tensor]:
    """The tails' (ζ∥, ζ⊥), each (B,), with the effects that `groups` carries."""
    for name, size in sorted(groups.effects.items()):
        coefficients = catalogue()[name].tail_coefficients(size, groups, coefficients)
    return coefficients
