"""Adopt a law as an effect of the catalogue: its file for `sim/effects`, and the test of that file.

The effect has the law's formula under a name of its own. Its null is no law, its bounds are ten times its size to
each side. In `sim/effects` it is found like every other effect: by calibrations, sweeps and the simulator.
"""

from __future__ import annotations

import math
import re
import textwrap
from keyword import iskeyword
from pathlib import Path
from typing import Any

import numpy as np

from calibration.words.render import rendered
from common.errors import InputError
from common.files import files_together, write_text
from common.reading import ContentError, read_json
from sim.effects import catalogue, check_effects, effect_named
from sim.model.groups import Groups
from sim.model.laws import COEFFICIENTS, SCALED, TAILS, Law
from sim.model.presets import PRESETS
from sim.motion.steady import steady

_NAME = re.compile(r"[a-z][a-z0-9_]{2,40}", re.ASCII)
_WIDTH = 110  # of lines
_WIDER = 10.0  # bounds over the size
_TAILS = (2, 3)  # of the robots of the test


def adopt_law(source: str | Path, name: str, folder: str | Path, *, place: str = "") -> list[Path]:
    """Write NAME.py and test_NAME.py of a law, both or none.

    Args:
        source: verdict.json or laws.json with laws that were kept.
        name: of the new effect, in lower case.
        folder: for the files.
        place: of the law; default: the best one.

    Returns:
        The paths of the files.

    Raises:
        InputError: there is no such law, the name cannot be used, or the files cannot be written.
    """
    if not _NAME.fullmatch(name) or iskeyword(name):
        raise InputError(
            f"name {name!r}: write lower-case letters, digits and _, such as speed_dependent_side_force, and no "
            "keyword of Python"
        )
    if name in catalogue():
        raise InputError(f"there is an effect {name} already; give another name")
    record, without, table = _law_of(source, place)
    try:
        law = effect_named(str(record["effect"]["name"]))
        size, error = float(record["effect"]["size"]), float(record["error"])
        words, runs = _plain(record["words"]), _runs_in_words(record["runs"])
        if not isinstance(law, Law) or not math.isfinite(size + error) or not size or not words:
            raise ValueError
        check_effects({law.name: size})
    except (KeyError, TypeError, ValueError, OverflowError):
        raise InputError(f"{source}: the law cannot be read; calibrate the table again") from None
    described = (
        f"{words[0].upper()}{words[1:]}. The factor is 1 at the paper's control example. The law was learnt from "
        f"runs with {runs}. The error on held-out runs is {100 * error:.2f} % with it, {100 * without:.2f} % "
        "without it. It describes these runs."
    )
    text = _effect_file(law, name, size, textwrap.fill(described, _WIDTH), table)
    file, test = f"{name}.py", f"test_{name}.py"
    with files_together(folder, (file, test)) as temporary:
        write_text(temporary / file, text)
        write_text(temporary / test, _test_file(law, name, size))
    return [Path(folder, file), Path(folder, test)]


def _law_of(source: str | Path, place: str) -> tuple[dict[str, Any], float, str]:
    """Return the record of a law, the held-out error without it, and the name of the table.

    Raises:
        InputError: the file has none.
    """
    try:
        record = read_json(source)
    except ContentError as unreadable:
        raise InputError(f"{source} is no verdict.json ({str(unreadable).removeprefix(f'{source} ')})") from None
    content = record if isinstance(record, dict) else {}
    of_verdict = isinstance(content.get("laws"), dict)
    laws = content["laws"] if of_verdict else content
    try:
        without = float(content["error_before" if of_verdict else "error_without"])
        kept = [law for law in laws.get("laws") or [] if law["place"] in laws["kept"]]
        names = [str(law["place"]) for law in kept]
    except (KeyError, TypeError, ValueError, AttributeError):
        raise InputError(f"{source} has no laws: give the verdict.json or laws.json of a table") from None
    if not kept:
        raise InputError(f"{source}: no law describes the runs of this table")
    if place and place not in names:
        raise InputError(f"{source}: no law {place!r} was kept; kept are {', '.join(names)}")
    return kept[names.index(place) if place else 0], without, _plain(content.get("table", ""))


def _plain(text: object) -> str:
    """Remove from a text of a file what would end a string of Python."""
    return re.sub(r"[\"\\\x00-\x1f]", "", str(text))


def _runs_in_words(runs: dict[str, Any]) -> str:
    parts = []
    for key, symbol, unit in (("N", "N", ""), ("l_cm", "l", " cm"), ("omega_rpm", "ω", " rpm")):
        low, high = (float(value) for value in runs[key])
        parts.append(
            f"{symbol} from {low:.4g} to {high:.4g}{unit}" if low < high else f"{symbol} = {low:.4g}{unit}"
        )
    return ", ".join(parts)


def _effect_file(law: Law, name: str, size: float, words: str, table: str) -> str:
    is_factor = law.place in (*COEFFICIENTS, *TAILS)
    low, high = law.bounds if is_factor else (-_WIDER * abs(size), _WIDER * abs(size))
    described = {"title": name.replace("_", " "), "equation": law.equation, "words": words, "table": table}
    numbers = {"law": law, "scaled": law.place in SCALED, "low": low, "high": high, "size": size}
    return rendered("effect.j2", {**described, **numbers, "name": name}) + "\n"


def _test_file(law: Law, name: str, size: float) -> str:
    expected = []
    for tails in _TAILS:
        values = {**PRESETS["paper-control"].group_values(), "N": float(tails), law.name: size}
        solved = steady(Groups.from_columns({key: np.array([value]) for key, value in values.items()}))
        outputs = [float(f"{float(getattr(solved, key)[0]):.10g}") for key in ("omega_yr", "v_x", "v_z")]
        if not np.isfinite(outputs).all():
            raise InputError(f"{law.name} = {size:g}: the control robot cannot be simulated with this law")
        expected.append(f"({tails}, {outputs})")
    filled = {"name": name, "law": law.name, "size": size, "expected": ",\n        ".join(expected)}
    return rendered("effect_test.j2", filled) + "\n"
