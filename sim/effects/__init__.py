"""Effects that the base model lacks: this folder finds its own members, one effect a file."""

from __future__ import annotations

import importlib
import pkgutil
from functools import cache
from typing import TYPE_CHECKING

from sim.effects.base import Effect

if TYPE_CHECKING:
    from sim.coefficients import Coefficients
    from sim.robot import Groups

__all__ = ["Effect", "catalogue", "with_effects"]


@cache
def catalogue() -> dict[str, Effect]:
    """Every effect in this folder, by name, in alphabetical order."""
    names = sorted(module.name for module in pkgutil.iter_modules(__path__) if module.name != "base")
    found = {name: importlib.import_module(f"{__name__}.{name}").EFFECT for name in names}
    for name, effect in found.items():
        if effect.name != name:
            raise TypeError(f"effect file {name}.py declares the name {effect.name!r}; make them equal")
    return found


def with_effects(groups: Groups, base: Coefficients) -> Coefficients:
    """The balance's coefficients with the effects that `groups` carries."""
    for name, size in sorted(groups.effects.items()):
        base = catalogue()[name].coefficients(size, groups, base)
    return base
