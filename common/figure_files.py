"""Write a figure as SVG, PNG or PDF."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import TYPE_CHECKING

from common.errors import InputError
from common.files import whole_file

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_ENDINGS = (".svg", ".png", ".pdf")


def check_figure_name(path: str | Path) -> None:
    """Refuse a name that says no format, before there is a figure."""
    if Path(path).suffix not in _ENDINGS:
        raise InputError(f"picture {path}; give a name that ends with {', '.join(_ENDINGS)}")


def write_figure(figure: Figure, path: str | Path, identity: str = "figure") -> None:
    """Write a figure, completely or not at all; `identity` names what it shows."""
    import matplotlib as mpl

    check_figure_name(path)
    words_stay = mpl.rc_context({"svg.fonttype": "none", "svg.hashsalt": identity})
    with words_stay, whole_file(path) as part, warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph .* missing")  # the reader's own font has it
        metadata = {"Date": None, "Identifier": identity} if part.suffix == ".svg" else None
        figure.savefig(part, dpi=150, bbox_inches="tight", metadata=metadata)
