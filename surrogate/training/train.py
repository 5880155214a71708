"""Train a look-up table: networks, domain, intervals and held-out errors.

Rows of a data set are split into three sets by a fixed hash of their number: 80 % for training, 10 % for the local
widths of the intervals, and 10 % held out. The held-out rows give the stated errors and the last factor of the
intervals. Rows that failed or did not converge are excluded. Rows whose tails touch are used.

A data set need not have response curves. Then the flips of a part of its robots are simulated here.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from common.arrays import Flags, Floats, Integers
from common.errors import InputError
from common.keywords import checks_keywords
from common.provenance import fingerprint, provenance
from dataset.data_set import read_manifest
from surrogate.domain import INSIDE, MAX_YAW_SHARE, ROBOT, Support
from surrogate.error_modes import KINDS, CurveErrors
from surrogate.held_out import curve_errors, relative_errors, summary
from surrogate.intervals import Intervals
from surrogate.motions import WrenchTable, network_index
from surrogate.response import PARTS, SHAPES, along_axes, flip_inputs
from surrogate.table import NeuralTable
from surrogate.tails import network_inputs
from surrogate.training.fits import (
    CURVES,
    WrenchSamples,
    fit_response,
    fit_wrench,
    learnable,
    wrench_samples,
)
from surrogate.training.networks import Settings, TrainingContext, device_named
from surrogate.training.simulated import SimulatedRobots, join_robots, read_robots, simulate_robots

_MIN_INSIDE = 10
_MIN_FLIPS = 200  # robots, for the covariance of the errors of the response
_MIN_ROWS, _MIN_OF_A_CLASS = 64, 16
_OF_RESPONSE = ("code_version", "data_hash")  # what the provenance of a table says of its response
_QUIET = TrainingContext()


def split(rows: Integers) -> Integers:
    """Split rows pseudo-randomly, fixed by row number: 0 learned, 1 for the widths of intervals, 2 held out."""
    mixed = (rows.astype(np.uint64) * np.uint64(0x9E3779B97F4A7C15)) >> np.uint64(40)
    tenth = mixed % np.uint64(10)
    return np.where(tenth == 8, 1, np.where(tenth == 9, 2, 0))


@checks_keywords
def train(
    folder: str | Sequence[str],
    settings: Settings | None = None,
    curve_settings: Settings | None = None,
    *,
    flips: int = 256,
    title: str = "train",
    device: str = "cpu",
    states: str | Path | None = None,
) -> NeuralTable:
    """Train a look-up table on a finished data set, or on several.

    Args:
        folder: data set written by `softflagella sweep`, or several. A row that is in two of them counts once.
        settings: networks of the tails and their optimiser.
        curve_settings: the same for the response to a flip.
        flips: robots whose flips are simulated if the data set has no curves.
        title: of the progress bars; empty for none.
        device: "cpu", "cuda", or "auto" for the latter where there is one.
        states: folder in which training keeps its states. Started again with the same arguments, it goes on
            from there, to the same table. When the table is saved, `remove_states` removes
            them.

    Raises:
        InputError: there is no data set, or it has too few usable rows, or there is no such device.

    Example:
        >>> from softflagella import train
        >>> table = train("data/sweep")  # doctest: +SKIP
    """
    context = TrainingContext(title, device_named(device), None if states is None else Path(states))
    folders = [folder] if isinstance(folder, str) else list(folder)
    manifests = [read_manifest(path) for path in folders]
    rows, numbers = _together(folders, manifests)
    part = split(numbers)
    if len(rows) < _MIN_ROWS:
        raise InputError(f"{', '.join(folders)} has {len(rows)} usable rows; training needs {_MIN_ROWS}")
    sets = [rows.at(part == i) for i in range(3)]
    flipped = sets[0].with_curves()
    if not len(flipped):
        unflipped = sets[0].at(np.flatnonzero(sets[0].robots["N"] > 1)[:flips])
        flipped = simulate_robots(unflipped.robots, curves=True, title=title and f"{title}: flips simulated")
    kept = {"data_hash": "config_hash", "data_code_version": "code_version"}
    source = {name: "+".join(str(m.get(key, "")) for m in manifests) for name, key in kept.items()}
    learned, width_rows, held_out = sets
    return learn(learned, width_rows, held_out, flipped, settings, curve_settings, source=source, context=context)


def held_out(folder: str | Sequence[str]) -> SimulatedRobots:
    """Return the rows of data sets that `train` holds out."""
    folders = [folder] if isinstance(folder, str) else list(folder)
    rows, numbers = _together(folders, [read_manifest(one) for one in folders])
    return rows.at(split(numbers) == 2)


def _together(folders: Sequence[str], manifests: Sequence[dict[str, Any]]) -> tuple[SimulatedRobots, Integers]:
    """Return rows of several data sets and their numbers; the same point of the same sequence counts once."""
    parts, numbers, seen = [], [], dict[str, Integers]()
    for folder, manifest in zip(folders, manifests, strict=True):
        part, number = read_robots(folder)
        sequence = fingerprint(manifest["config"])
        before = seen.get(sequence, np.empty(0, dtype=number.dtype))
        fresh = ~np.isin(number, before)
        parts.append(part.at(fresh))
        numbers.append(number[fresh])
        seen[sequence] = np.concatenate([before, number])
    return join_robots(parts), np.concatenate(numbers)


def learn(
    learned: SimulatedRobots,
    width_rows: SimulatedRobots,
    held_out: SimulatedRobots,
    flipped: SimulatedRobots,
    settings: Settings | None = None,
    curve_settings: Settings | None = None,
    *,
    few_settings: Settings | None = None,
    flips_held_out: SimulatedRobots | None = None,
    source: dict[str, Any] | None = None,
    context: TrainingContext = _QUIET,
) -> NeuralTable:
    """Train a look-up table on simulated robots.

    Args:
        learned: steady motions for the tails.
        width_rows: robots for the local widths of the intervals.
        held_out: robots for the errors and the factor of the intervals.
        flipped: robots with response curves.
        few_settings: of the networks of robots with one and two tails; by default `settings`.
        flips_held_out: robots with curves for the errors of the response; by default a tenth of `flipped`.
        source: more provenance.
        context: device, progress bars, and where states are kept.
    """
    wrench_settings, response_settings = settings or Settings(), curve_settings or CURVES
    if flips_held_out is None:
        tenth = np.arange(len(flipped)) % 10 == 9
        flipped, flips_held_out = flipped.at(~tenth), flipped.at(tenth)
    rows, _ = _learnable(learned)
    classes = len(np.unique(network_index(rows.robots.number)))
    context = replace(context, networks=classes + 1 + len(PARTS))  # one of the gap, and those of the response
    table = fit_wrench(rows, wrench_settings, context, few_settings=few_settings)
    flipped, flips_held_out = _several_tails(flipped), _several_tails(flips_held_out)
    flips, usable = _learnable(flipped)
    response = fit_response(flips, flipped.at(usable).curves, response_settings, context.part("flips"))
    counts = {
        "train": len(rows.motion),
        "widths": len(width_rows),
        "held_out": len(held_out),
        "flips": len(flips.motion),
    }
    created = _created(wrench_settings, few_settings, asdict(response_settings), context)
    lookup = NeuralTable(
        tails=table,
        curves=response,
        support=_supports(rows, table),
        intervals=None,
        ranges=_ranges(learned),
        errors={},
        provenance={**created, **(source or {}), "rows": counts},
    )
    return _judged(lookup, width_rows, held_out, flips_held_out)


def with_tails(
    lookup: NeuralTable,
    learned: SimulatedRobots,
    width_rows: SimulatedRobots,
    held_out: SimulatedRobots,
    settings: Settings,
    *,
    few_settings: Settings | None = None,
    source: dict[str, Any] | None = None,
    context: TrainingContext = _QUIET,
) -> NeuralTable:
    """Return a table with steady motions learned further; its response to a flip, which depends on none, stays.

    Args:
        lookup: the table that gives the response and its errors, and the networks from which those of the same
            shape go on; others are learned anew.
        learned, width_rows, held_out, settings, few_settings, source, context: as for `learn`.
    """
    rows, _ = _learnable(learned)
    tails = fit_wrench(rows, settings, context, few_settings=few_settings, start=lookup.tails)
    counts = {"train": len(rows.motion), "widths": len(width_rows), "held_out": len(held_out)}
    created = _created(settings, few_settings, lookup.provenance["config"]["curves"], context)
    learned_first = {name: lookup.provenance[name] for name in _OF_RESPONSE if name in lookup.provenance}
    again = replace(
        lookup,
        tails=tails,
        support=_supports(rows, tails),
        ranges=_ranges(learned),
        provenance={
            **created,
            **(source or {}),
            "response": lookup.provenance.get("response", learned_first),
            "rows": {**lookup.provenance["rows"], **counts},
        },
    )
    return _with_intervals(again, width_rows, held_out)


def with_response(
    lookup: NeuralTable,
    flipped: SimulatedRobots,
    settings: Settings,
    *,
    source: dict[str, Any] | None = None,
    context: TrainingContext = _QUIET,
) -> NeuralTable:
    """Return a table with its response to a flip learned anew; its steady motions stay.

    Args:
        lookup: the table.
        flipped: robots with response curves.
        settings: of the networks.
        source: where the robots come from, for the provenance.
        context: as for `learn`.
    """
    rows, usable = _learnable(flipped := _several_tails(flipped))
    curves = fit_response(rows, flipped.at(usable).curves, settings, replace(context, networks=len(PARTS)))
    old = lookup.provenance
    config = {**old["config"], "curves": asdict(settings)}
    response = {"code_version": provenance({})["code_version"], **(source or {})}
    rows_of = {**old["rows"], "flips": len(rows.motion)}
    return replace(
        lookup, curves=curves, provenance={**old, "config": config, "response": response, "rows": rows_of}
    )


def _created(
    tails: Settings, few: Settings | None, curves: dict[str, Any], context: TrainingContext
) -> dict[str, Any]:
    """Return the provenance of a table that is trained with these settings."""
    of_tails = {"tails": asdict(tails), "few": asdict(few or tails)}
    return provenance({**of_tails, "curves": curves, "device": context.device})


def _supports(rows: WrenchSamples, tails: WrenchTable) -> tuple[Support | None, ...]:
    """Learn the domain of each network from its inputs; None where there is no network."""
    kind, supports = network_index(rows.robots.number), list[Support | None]()
    for k, network in enumerate(tails.wrench):
        part = rows.at(kind == k)
        if network is None:
            supports.append(None)
        else:
            supports.append(Support.learned(network_inputs(part.robots, part.motion, network.shape["inputs"])))
    return tuple(supports)


def _judged(
    lookup: NeuralTable, width_rows: SimulatedRobots, held_out: SimulatedRobots, flips: SimulatedRobots
) -> NeuralTable:
    """Add intervals and held-out errors to a table."""
    return with_response_errors(_with_intervals(lookup, width_rows, held_out), flips)


def with_response_errors(lookup: NeuralTable, flips: SimulatedRobots) -> NeuralTable:
    """Return a table with the errors of its response to robots with curves that it did not learn."""
    flips = flips.at(np.abs(flips.motion["omega_yr_bar"]) < MAX_YAW_SHARE * np.abs(flips.motion["omega_t_bar"]))
    response = lookup.response(flips.robots, flag=True)
    truth = {**flips.motion, **flips.curves}
    report = summary(curve_errors(response, truth), flips.motion["tail_gap"] >= 1)
    return replace(lookup, errors={**lookup.errors, **report}, curve_errors=_curve_errors(lookup, flips))


def _curve_errors(lookup: NeuralTable, flips: SimulatedRobots) -> CurveErrors | None:
    """Learn the errors of the response from robots that were not learned; None where they are too few."""
    motions = lookup.solve(flips.robots)
    known = (motions.outside == INSIDE) & (flips.motion["tail_gap"] >= 1)
    if known.sum() < _MIN_FLIPS:
        return None
    response = lookup.response(flips.robots, flag=True)
    _, speeds = flip_inputs(motions.robots, motions.motion, motions.inputs)
    errors = {
        kind: ((getattr(response, kind) - flips.curves[kind]) / along_axes(speeds, SHAPES[kind]))[known]
        for kind in KINDS
    }
    return CurveErrors.learned(
        lookup.width_features(motions)[known], errors, lookup.curves.bases, flips.motion["error"][known]
    )


def _with_intervals(lookup: NeuralTable, width_rows: SimulatedRobots, held_out: SimulatedRobots) -> NeuralTable:
    """Add intervals and held-out errors of the steady motion to a table.

    The intervals are those of all rows. The errors are those of robots without effects and with two tails and
    more, as far as there are any.
    """
    features, errors, _, _ = _errors(lookup, width_rows)
    lookup = recalibrated(replace(lookup, intervals=Intervals.learned(features, errors)), held_out)
    _, errors, _, inside = _errors(lookup, held_out)
    apart = held_out.motion["tail_gap"][inside] >= 1
    stated = np.ones(len(apart), dtype=bool)
    for kind in (without_effects(held_out.robots)[inside], held_out.robots["N"][inside] > 1):
        stated = stated & kind if (stated & kind).any() else stated
    report = summary({name: error[stated] for name, error in errors.items()}, apart[stated])
    return replace(lookup, errors={**lookup.errors, **report})


def recalibrated(lookup: NeuralTable, rows: SimulatedRobots) -> NeuralTable:
    """Calibrate intervals to hold their share of robots like these in each group; it did not learn them."""
    features, errors, robots, _ = _errors(lookup, rows)
    intervals = lookup.intervals and lookup.intervals.calibrated(features, errors, robots)
    return replace(lookup, intervals=intervals)


def _errors(lookup: NeuralTable, rows: SimulatedRobots) -> tuple[Floats, dict[str, Floats], Floats, Flags]:
    """Return features, relative errors and packed robots of rows inside the domain, and which those are."""
    motions = lookup.solve(rows.robots)
    inside = motions.outside == INSIDE
    if inside.sum() < _MIN_INSIDE:  # a table of few rows has a domain that holds hardly any others: all count
        inside[:] = True
    truth = with_radius(rows.motion)
    errors = relative_errors(motions.steady, truth)
    return (
        lookup.width_features(motions)[inside],
        {name: error[inside] for name, error in errors.items()},
        motions.robots[inside],
        inside,
    )


def without_effects(robots: dict[str, Floats]) -> Flags:
    """Return the robots without effects, (M,)."""
    effects = [sizes for name, sizes in robots.items() if name not in ROBOT]
    return ~np.any([sizes != 0 for sizes in effects], axis=0) if effects else np.ones(len(robots["N"]), dtype=bool)


def _several_tails(rows: SimulatedRobots) -> SimulatedRobots:
    """Return rows with two or more tails: the response of one tail depends too much on the phase of the disc."""
    return rows.at(rows.robots["N"] > 1)


def with_radius(motion: dict[str, Floats]) -> dict[str, Floats]:
    """Return the motion with turn radius and slip angle."""
    speed = np.hypot(motion["v_x"], motion["v_z"])
    angle = np.degrees(np.arctan2(np.abs(motion["v_x"]), motion["v_z"]))
    return {**motion, "R_yr_over_l": speed / np.abs(motion["omega_yr_bar"]), "theta_deg": angle}


def _learnable(rows: SimulatedRobots) -> tuple[WrenchSamples, Flags]:
    """Return the samples of rows that a table may learn, and which those are."""
    samples = wrench_samples(rows.robots, rows.motion)
    good = learnable(samples)
    kind = network_index(samples.robots.number[good])
    for k, words in enumerate(("N = 1", "N = 2", "N = 3 and more")):
        count = np.count_nonzero(kind == k)
        if 0 < count < _MIN_OF_A_CLASS:
            raise InputError(f"{count} usable rows with {words}; training needs {_MIN_OF_A_CLASS} or none")
    return samples.at(good), good


def _ranges(learned: SimulatedRobots) -> dict[str, tuple[float, float]]:
    """Return least and greatest size of each group that was learned."""
    sizes = {name: np.abs(values) for name, values in learned.robots.items() if name in ROBOT}
    return {name: (float(size.min()), float(size.max())) for name, size in sizes.items()}
