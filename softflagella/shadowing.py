"""Modules of other people that hide a package of this project.

The packages have short names, and Python imports the first module of a name that it finds: a file sim.py beside a
script, a folder `dataset`, or the package `dataset` of the package index. The error that follows names neither the
file nor the remedy. So the import of `softflagella` checks where its packages are.
"""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

COMMANDED = ("sim", "camera", "dataset", "surrogate", "planner", "tracking", "calibration")  # they have commands
PACKAGES = ("common", *COMMANDED)
_INSTALLED = {"site-packages", "dist-packages"}


def check_packages() -> None:
    """Check that each package that would be imported by its name is the one beside this package.

    Raises:
        ImportError: a module of the same name hides one; the message says which file, and what to do.
    """
    ours = Path(__file__).resolve().parents[1]
    for name in PACKAGES:
        place = _place(name)
        if place is None or place.resolve() in (ours / name, ours / name / "__init__.py"):
            continue
        remedy = (
            f"uninstall that package (pip uninstall {name}), or use a virtual environment without it"
            if _INSTALLED & set(place.parts)
            else "rename it, or run from another folder"
        )
        raise ImportError(
            f"{place} hides the package '{name}' of softflagella ({ours / name}): {remedy}", name=name
        )


def _place(name: str) -> Path | None:
    """Return the file or folder from which a module is, or would be, imported; None where there is none."""
    try:
        spec = find_spec(name)
    except ValueError:  # a module that was made by hand
        return None
    if spec is None:
        return None
    folders = list(spec.submodule_search_locations or ())
    return Path(spec.origin) if spec.origin else Path(folders[0]) if folders else None
