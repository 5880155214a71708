"""Robots -> rows: simulate a design in parallel, chunk by chunk.

Each robot's steady motion is solved for (`sim.motion.steady`), and from there it is stepped through flips of the
motor with its own half-period (`sim.motion.switching`). Rows are batched by N; every finished batch is stored at
once, so an interruption loses one batch a worker.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from dataset import backends
from dataset.design import Design
from dataset.store import MANIFEST, part_hash, part_path, write_manifest, write_part
from sim.arrays import Floats, Integers
from sim.effects import catalogue
from sim.inputs import check_columns
from sim.io.errors import InputError
from sim.io.provenance import code_version, fingerprint, provenance
from sim.model.groups import DWELL, Groups
from sim.motion.batches import run_batches, split
from sim.motion.resolution import Resolution
from sim.motion.steady import steady
from sim.motion.steady_motion import STEADY_COLUMNS
from sim.motion.switching import switch_response

Columns = dict[str, Any]
PART_ROWS = 64  # what an interruption loses, a worker


def simulate(points: dict[str, Floats]) -> Columns:
    """All columns of the schema for robots of one N, except `row`.

    Args:
        points: inputs by column name, `dwell_bar` included, each (B,).
    """
    values = check_columns({k: v for k, v in points.items() if k != DWELL})
    groups = Groups.from_columns(values)
    motion = steady(groups)
    response = switch_response(groups, points[DWELL], motion)
    resolutions = [Resolution.fitting(speed) for speed in values["omega_bar"].tolist()]
    steady_values = motion.columns()
    columns: Columns = {**values, DWELL: points[DWELL], **{k: steady_values[k] for k in STEADY_COLUMNS}}
    failed = motion.failed | response.failed
    columns |= {
        "net_speed_bar": response.net_speed,
        "lag_psi_rad": response.lag_psi,
        "lag_x": response.lag_x,
        "lag_z": response.lag_z,
        "error": motion.error,
        "failed": failed,
        "converged": columns["converged"] & ~failed,
        "touching": columns["tail_gap"] < 1,
        "edges": np.array([r.edges for r in resolutions]),
        "steps": np.array([r.steps for r in resolutions]),
    }
    for name in STEADY_COLUMNS[:7]:
        columns[name] = np.where(failed, np.nan, columns[name])
    columns["N"] = values["N"].astype(int)
    return columns


def build(
    design: Design,
    folder: str | Path,
    *,
    jobs: int | None = None,
    backend: str = "loky",
    title: str = "sweep",
) -> dict[str, Any]:
    """Simulate a design into a folder; goes on where an interrupted build stopped.

    Returns:
        The manifest.

    Raises:
        InputError: the folder holds something else.
    """
    out = Path(folder)
    effects = sorted(set(design.axes) & set(catalogue()))
    config = {**design.config(), "rows": design.rows}
    config_hash = fingerprint({**config, "code": code_version()})
    _check_folder(out, config_hash)
    points = design.points()
    batches = split(points["N"], PART_ROWS)
    waiting = [i for i in range(len(batches)) if not part_path(out, i).exists()]
    out.mkdir(parents=True, exist_ok=True)
    work = partial(_simulate_part, folder=out, effects=effects, config_hash=config_hash)
    todo = [(i, batches[i], {k: v[batches[i]] for k, v in points.items()}) for i in waiting]
    counts = {"rows": design.rows, "parts": len(batches)}
    with backends.backend(backend):
        run_batches(work, todo, sizes=[len(t[1]) for t in todo], jobs=jobs, title=title)
    manifest = {**provenance(config), "config_hash": config_hash, "effects": effects, **counts}
    manifest |= _count_flags(out, len(batches))
    write_manifest(out, manifest)
    return manifest


def _simulate_part(
    job: tuple[int, Integers, dict[str, Floats]],
    *,
    folder: Path,
    effects: list[str],
    config_hash: str,
) -> None:
    index, rows, points = job
    columns = simulate(points)
    columns["row"] = rows
    write_part(folder, index, columns, effects, config_hash)


def _check_folder(folder: Path, config_hash: str) -> None:
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder} is a file; give a folder for the data set")
    if not folder.exists():
        return
    ours = {MANIFEST, *(p.name for p in folder.glob("part-*.parquet"))}
    others = sorted(p.name for p in folder.iterdir() if p.name not in ours and p.name[0] != ".")
    if others:
        raise InputError(f"{folder} holds other files ({others[0]}); give an empty or a new folder")
    for path in sorted(folder.glob("part-*.parquet")):
        if part_hash(path) != config_hash:
            raise InputError(
                f"{folder} holds rows of another configuration or version ({path.name}); "
                "give another folder or remove this one"
            )


def _count_flags(folder: Path, parts: int) -> dict[str, int]:
    import pyarrow.parquet as pq

    names = ("converged", "failed", "touching")
    totals = dict.fromkeys(names, 0)
    for index in range(parts):
        table = pq.read_table(part_path(folder, index), columns=list(names))
        for name in names:
            totals[name] += int(np.count_nonzero(table[name].to_numpy()))
    return totals
