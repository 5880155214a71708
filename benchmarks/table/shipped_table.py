"""Train the look-up table that comes with the package, and evaluate it on held-out robots.

Usage: python -m benchmarks shipped_table WORK --out MODEL    everything
       python -m benchmarks shipped_table WORK --response TABLE --out MODEL    keeps the response of TABLE
       python -m benchmarks shipped_table WORK --tails TABLE --out MODEL    keeps the tails of TABLE
       python -m benchmarks shipped_table WORK --calibrate MODEL [--out MODEL]    its intervals alone, anew
       python -m benchmarks shipped_table WORK --test MODEL [--card CARD] [--picture PNG]

Sets that are simulated are kept in WORK. --test prints errors on robots of the test set; `python -m benchmarks
lookup` the coverage of the intervals. The shipped file was made by the second command, then by the third. In the
second the network of two tails, whose inputs changed, was learned anew; those of one tail and of three and more
went on.

The tails are learned from robots with heads far wider than those of the domain; one and two tails also from robots
of the domain, half of which have effects on head and motor; one tail also from 8192 robots with all these effects
and a surface couple of −1.5 to 1.5. The local widths of the intervals are learned from robots of the domain, half
of them with effects, and from robots with such a couple, half of them with one tail; the intervals are calibrated
on robots drawn as users draw them. The response to a flip is learned from robots of the domain with two tails and
more, half of them with effects on the head. All robots are drawn from Sobol sequences with the seeds below. The
test set led to no choice of any kind.

Takes three hours of two cores with its simulations.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from common.arrays import Floats
from common.files import write_text
from surrogate.domain import INSIDE, ROBOT
from surrogate.held_out import curve_errors, error_table, relative_errors, summary
from surrogate.table import NeuralTable
from surrogate.table_file import load
from surrogate.tabulate import TOLERANCE
from surrogate.training.model_card import model_card
from surrogate.training.networks import Settings, TrainingContext, remove_states
from surrogate.training.simulated import (
    MOTION,
    SimulatedRobots,
    draw_as_users,
    draw_robots,
    join_robots,
    reached_columns,
    simulate_robots,
)
from surrogate.training.train import (
    learn,
    recalibrated,
    with_radius,
    with_response,
    with_response_errors,
    with_tails,
)

TAILS = Settings(width=64, depth=3, members=1, epochs=60, iterations=6000)
FEW = replace(TAILS, iterations=12000)  # of one and two tails
CURVES = Settings(width=80, depth=2, members=1, epochs=60, iterations=4000)
ROWS = {
    "tails": (98304, 101), "single": (16384, 505), "couples": (8192, 606), "pairs": (12288, 707),
    "widths": (8192, 202), "widths_couples": (6144, 911),
    "held_out": (8192, 402), "held_out_couples": (2048, 912),
    "locked": (4096, 20261201),
}  # fmt: skip
FLIPS = {"flips": (49152, 1401), "locked_flips": (400, 20261202)}
AS_USERS = {"calibration": (65536, 7001), "fresh": (65536, 8002)}
_HALF_WITH_EFFECTS = ("single", "pairs", "widths", "held_out", "flips")
_LEARNED = ("tails", "single", "couples", "pairs")
_WIDTHS, _HELD_OUT = ("widths", "widths_couples"), ("held_out", "held_out_couples")
_COUPLES = ("couples", "widths_couples", "held_out_couples")
# share that gets one tail
_SINGLE = {"single": 1.0, "couples": 1.0, "widths_couples": 0.5, "held_out_couples": 0.5}
_STEADY_ONLY = ("surface_couple", "motor_droop")  # effects that the response to a flip is not learned with
_DRAWN = 4  # times as many as are wanted for the errors of the response: some are outside the domain


def robots(name: str) -> dict[str, Floats]:
    """Draw the robots of one set."""
    if name in AS_USERS:
        return draw_as_users(*AS_USERS[name])
    count, seed = (ROWS | FLIPS)[name]
    drawn = draw_robots(count, seed, wide=name == "tails", effects=not name.startswith("locked"))
    if name == "flips":
        drawn = {n: np.maximum(values, 2.0) if n == "N" else values for n, values in drawn.items()
                 if n not in _STEADY_ONLY}  # fmt: skip
    if name in _HALF_WITH_EFFECTS:  # every second robot of a Sobol sequence has a small C_r
        without = np.random.default_rng((seed, 2)).uniform(size=count) < 0.5
        for effect in [n for n in drawn if n not in ROBOT]:
            drawn[effect][without] = 0.0
    if name in _SINGLE:
        drawn["N"][np.random.default_rng((seed, 4)).uniform(size=count) < _SINGLE[name]] = 1.0
    if name == "pairs":
        drawn["N"][:] = 2.0
    if name in _COUPLES:
        drawn["surface_couple"] = np.random.default_rng((seed, 3)).uniform(-1.5, 1.5, count)
    return drawn


def kept(work: Path, name: str) -> SimulatedRobots:
    """Simulate one set, or read it from the folder if it is there."""
    path = work / f"{name}.npz"
    if path.exists():
        with np.load(path) as file:
            parts = [{k.split("/")[1]: file[k] for k in file if k.startswith(f"{i}/")} for i in range(3)]
        return SimulatedRobots(*parts)
    began = time.process_time()
    learned = name in _LEARNED or name in FLIPS
    make: Callable[..., SimulatedRobots] = simulate_robots if learned else as_reached
    finer = {"tolerance": TOLERANCE} if name == "locked_flips" else {}
    curves = {"curves": True, **finer} if name in FLIPS else {}
    rows = make(robots(name), title=name, **curves)
    print(f"{name}: {len(rows)} rows, {time.process_time() - began:.0f} s")
    work.mkdir(parents=True, exist_ok=True)
    named = {f"{i}/{k}": values for i, part in enumerate(vars(rows).values()) for k, values in part.items()}
    np.savez(path, allow_pickle=False, **named)
    return rows


def _joined(work: Path, names: Sequence[str]) -> SimulatedRobots:
    """Join sets, see `kept`."""
    return join_robots([kept(work, name) for name in names])


def test(lookup: NeuralTable, rows: SimulatedRobots, flips: SimulatedRobots) -> None:
    """Print errors on robots that were never used."""
    began = time.process_time()
    answer = lookup.query(rows.robots, intervals=True, flag=True)
    seconds = time.process_time() - began
    inside = ~answer["outside"]
    truth = with_radius(rows.motion)
    apart = rows.motion["tail_gap"] >= 1
    print(f"\n{len(rows)} held-out robots, {1e6 * seconds / len(rows):.0f} µs each with intervals; outside: "
          f"{np.count_nonzero(~inside)}")  # fmt: skip
    errors = {name: error[inside] for name, error in relative_errors(answer, truth).items()}
    errors["v_z of itself"] = (answer["v_z"] / truth["v_z"] - 1)[inside]
    tails = rows.robots["N"][inside]
    for words, kind in (
        ("all", tails > 0), ("two tails and more", tails > 1), ("three and more", tails > 2),
        ("two tails", tails == 2), ("one tail", tails == 1),
    ):  # fmt: skip
        print(words)
        for name, figures in summary({n: e[kind] for n, e in errors.items()}, apart[inside][kind]).items():
            print(f"  {name:16}" + "".join(f"  {k} {100 * v:.4f}" for k, v in figures.items()))
    flips = flips.at(flips.robots["N"] > 1)
    response = lookup.response(flips.robots, flag=True)
    known = ~lookup.query(flips.robots, flag=True)["outside"]
    report = curve_errors(response, {**flips.motion, **flips.curves})
    print(f"response to a flip, {np.count_nonzero(known)} robots:")
    valid = flips.motion["tail_gap"] >= 1
    for name, figures in summary({n: e[known] for n, e in report.items()}, valid[known]).items():
        print(f"  {name:16}" + "".join(f"  {k} {100 * v:.3f}" for k, v in figures.items()))


def draw(lookup: NeuralTable, rows: SimulatedRobots, picture: str) -> None:
    """Draw the errors of the yaw rate against the motor speed; robots in the domain, tails that do not touch."""
    from matplotlib.figure import Figure

    answer = lookup.query(rows.robots, flag=True)
    known = ~answer["outside"] & (rows.motion["tail_gap"] >= 1)
    error = 100 * np.abs(relative_errors(answer, with_radius(rows.motion))["omega_yr_bar"])
    tails, figure = rows.robots["N"], Figure(figsize=(7.5, 4.2), layout="constrained")
    axes = figure.add_subplot()
    for words, kind in (("three and more", tails > 2), ("two", tails == 2), ("one tail", tails == 1)):
        some = known & kind
        axes.loglog(rows.robots["omega_bar"][some], error[some], ".", markersize=3, alpha=0.7, label=words)
    axes.set_ylim(1e-4, 3)
    axes.set_xlabel("motor speed ω̄")
    axes.set_ylabel("error of the yaw rate [%]")
    axes.legend(frameon=False, markerscale=4, reverse=True)
    figure.savefig(picture, dpi=100)


def inside(lookup: NeuralTable, rows: SimulatedRobots) -> SimulatedRobots:
    """Return the robots inside the domain of a table."""
    return rows.at(lookup.solve(rows.robots).outside == INSIDE)


def with_intervals_of_users(lookup: NeuralTable, work: Path) -> NeuralTable:
    """Return a table with intervals that are calibrated on robots drawn as users draw them."""
    rows = inside(lookup, kept(work, "calibration"))
    source = {"robots": len(rows), "seed": AS_USERS["calibration"][1]}
    return replace(recalibrated(lookup, rows), provenance={**lookup.provenance, "intervals": source})


def judged_by_flips(lookup: NeuralTable, *, count: int = 840, seed: int = 202, title: str = "") -> NeuralTable:
    """Return a table with errors of its response learned from new robots; half a second of one core each.

    The curves of a data set are simulated with time steps that leave errors as large as the table's. These robots
    have a tenth of the tolerance.

    Args:
        lookup: a trained table.
        count: robots, with two tails or more.
        seed: of their draws; another one than those of the robots that the table has learned.
        title: of the progress bar; empty for none.
    """
    robots = draw_robots(_DRAWN * count, seed, wide=False)
    several = robots["N"] > 1
    robots = {name: values[several] for name, values in robots.items()}
    inside = np.flatnonzero(lookup.solve(robots).outside == INSIDE)[:count]
    chosen = {name: values[inside] for name, values in robots.items()}
    flips = simulate_robots(chosen, curves=True, tolerance=TOLERANCE, title=title)
    source = {"robots": len(flips), "seed": seed, "tolerance": TOLERANCE}
    judged = with_response_errors(lookup, flips)
    return replace(judged, provenance={**lookup.provenance, "response_errors": source})


def as_reached(robots: Mapping[str, Floats], *, title: str = "") -> SimulatedRobots:
    """Simulate the motion that straight tails reach, if it is steady; see `reached_columns`."""
    columns = reached_columns(robots, title=title)
    reached = SimulatedRobots(dict(robots), {name: columns[name] for name in MOTION}, {})
    return reached.at(np.asarray(columns["converged"], dtype=bool))


def _trained(work: Path, tails: str | None, response: str | None) -> NeuralTable:
    """Train a table, without the part that is kept of another one."""
    context = TrainingContext("train", folder=work / "states")
    if tails:
        source = {"seeds": {"flips": FLIPS["flips"]}}
        return with_response(load(tails), kept(work, "flips"), CURVES, source=source, context=context)
    steady, widths, held_out = (_joined(work, names) for names in (_LEARNED, _WIDTHS, _HELD_OUT))
    if response:
        return with_tails(
            load(response), steady, widths, held_out, TAILS,
            few_settings=FEW, source={"seeds": ROWS}, context=context,
        )  # fmt: skip
    return learn(
        steady, widths, held_out, kept(work, "flips"), TAILS, CURVES,
        few_settings=FEW, source={"seeds": {**ROWS, **FLIPS}}, context=context,
    )  # fmt: skip


def main(*words: str) -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("work", type=Path)
    parser.add_argument("--out")
    kept_part = parser.add_mutually_exclusive_group()
    kept_part.add_argument("--response", help="table whose response to a flip is kept")
    kept_part.add_argument("--tails", help="table whose steady motions are kept")
    parser.add_argument("--calibrate", help="table whose intervals alone are learned anew")
    parser.add_argument("--test")
    parser.add_argument("--picture", help="with --test: draw the errors of the yaw rate of its robots")
    parser.add_argument("--card", help="with --test: write the card, from held-out and fresh robots of the domain")
    arguments = parser.parse_args(words)
    if arguments.calibrate:
        lookup = with_intervals_of_users(load(arguments.calibrate), arguments.work)
        lookup.save(arguments.out or arguments.calibrate)
    elif arguments.out:
        lookup = _trained(arguments.work, arguments.tails, arguments.response)
        lookup = judged_by_flips(lookup, title="errors of the response")
        lookup = with_intervals_of_users(lookup, arguments.work)
        lookup.save(arguments.out)
        remove_states(arguments.work / "states")
        print(error_table(lookup.errors))
    if arguments.test:
        lookup, locked = load(arguments.test), kept(arguments.work, "locked")
        test(lookup, locked, kept(arguments.work, "locked_flips"))
        if arguments.picture:
            draw(lookup, locked, arguments.picture)
    if arguments.card:
        lookup = load(arguments.test)
        fresh = inside(lookup, kept(arguments.work, "fresh"))
        write_text(arguments.card, model_card(lookup, _joined(arguments.work, _HELD_OUT), fresh))
