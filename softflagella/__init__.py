"""Soft flagellated robots near a surface: simulate, sweep, learn, plan, replay, calibrate.

    import softflagella as sf

    robot = sf.load_robot("paper-control")
    motion = sf.steady(robot)                          # simulate its mean motion
    result = sf.plan(sf.polygon(4, side=3.0), robot)   # plan a square without simulating
    track = sf.replay(result)                          # simulate the plan

The public names are listed in `__init__.pyi`. Each is loaded when it is first used, so importing the package is
quick. Lengths are in tail lengths l, times in μ0 l⁴/EI, forces in EI/l², angles in radians, unless a name says its
unit.
"""

from __future__ import annotations

import ast
from importlib import import_module
from pathlib import Path
from typing import Any

from softflagella.shadowing import check_packages

check_packages()


def _listed() -> dict[str, tuple[str, str]]:
    """Read the public names from the stub file: name -> (module, name in it)."""
    homes: dict[str, tuple[str, str]] = {}
    for node in ast.parse(Path(__file__).with_suffix(".pyi").read_text()).body:
        if isinstance(node, ast.ImportFrom) and node.module:
            homes |= {alias.name: (node.module, alias.name) for alias in node.names}
        elif isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):  # another name: effects = …
            homes[node.targets[0].id] = homes.pop(ast.unparse(node.value))
    return homes


_HOMES = _listed()
__all__ = sorted(_HOMES)


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module, attribute = _HOMES[name]
    own = module == __name__  # a module of this package, as plot
    value = import_module(f"{module}.{attribute}") if own else getattr(import_module(module), attribute)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return __all__
