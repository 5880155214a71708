"""Operating characteristics of the calibration: how often it is right, wrong or silent on planted truths.

The whole procedure (`calibration.verdict.calibrate.calibrate`) runs on tables of the paper's design
(`benchmarks.calibration.planted`), made by a linear stand-in for the simulator. Wrong nuisance parameters and
physics outside the catalogue are in `benchmarks.calibration.false_claims`, tables of the simulator itself in
`benchmarks.calibration.through_simulator`.

Usage: python -m benchmarks operating [NULLS] [REPEATS] [FIRST_SEED]      tables in docs/operating.md

Takes half an hour.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks.calibration.planted import Case, Design, Linear, cases, measured, nulls, stand_in
from benchmarks.markdown import heading, row
from benchmarks.parallel import in_parallel
from benchmarks.proportions import per_cent
from calibration.statistics.statistical_model import start_values
from calibration.verdict.calibrate import calibrate
from calibration.verdict.experiment import Experiment
from calibration.verdict.verdict import Verdict

PAGE = Path("docs/operating.md")
OTHER_NULLS = 100
DESIGNS = {
    "96 runs, three tail lengths": Design(lengths_cm=(5.0, 9.0, 15.0)),
    "two sessions": Design(sessions=2),
    "one session": Design(sessions=1),
}


@dataclass(frozen=True)
class Outcome:
    """What came out of a case."""

    label: str
    judgement: str
    verdict: str
    effects: tuple[str, ...]
    held_out: float  # error on the held-out session over the noise of a run
    # Whether intervals contain the truth: those of rightly named effects, or of the coefficients of a null.
    covered: tuple[bool, ...]


def judge(verdict: Verdict, case: Case) -> str:
    """exact, in the set, wrong, number (without the truth beside it), or abstained (none, or unexplained).

    Some effects do what a wrong number does: a motor that slips, and a tachometer that is off. Then the number is
    named first and the effect beside it; this counts as "in the set".
    """
    if case.label.startswith("null"):
        return "none" if verdict.verdict == "none" else f"claimed ({verdict.verdict})"
    truth = frozenset(case.sizes)
    if verdict.verdict == "number":
        rivals = [frozenset(e.name for e in c.claimed) for c in verdict.evidence.rival_effects]
        return "in the set" if truth in rivals else "number"
    if not verdict.explaining:
        return "abstained" if verdict.verdict == "none" else "unexplained"
    sets = [frozenset(e.name for e in c.claimed) for c in verdict.explaining]
    if len(sets) == 1:
        return "exact" if sets[0] == truth else "wrong"
    return "in the set" if truth in sets else "wrong"


def outcome(model: Experiment, case: Case) -> Outcome:
    """Calibrate a model that has its data."""
    verdict = calibrate(model, progress=False)
    judgement = judge(verdict, case)
    start = start_values(model)
    truth = {}
    if judgement == "exact":
        truth = {name: start[name] + size for name, size in case.sizes.items()}
    elif case.label.startswith("null"):
        truth = {p.name: start[p.name] for p in model.coefficients}
    fitted = verdict.final if case.sizes else verdict.base
    intervals = [(*fitted.interval(name), value) for name, value in truth.items()]
    covered = tuple(low <= value <= high for low, high, value in intervals)
    ratio = verdict.error_after / verdict.noise_ceiling
    return Outcome(case.label, judgement, verdict.verdict, verdict.effects, ratio, covered)


def run_linear(model: Linear, case: Case, seed: int) -> Outcome:
    """One case through the stand-in."""
    return outcome(measured(model, case.signal, seed, heavy=case.heavy), case)


def each_at_eight(model: Linear) -> list[Case]:
    """Each effect once at λ = 8."""
    return [c for c in cases(model, 1) if c.label.endswith("λ = 8") and c.sizes]


def summary(results: list[Outcome], group: Callable[[str], str]) -> str:
    """A table of judgements by group."""
    lines = [heading("case", "tables", "judgements", "right (95 %)", "wrong (95 %)")]
    for label in dict.fromkeys(group(r.label) for r in results):
        counts = Counter(r.judgement for r in results if group(r.label) == label)
        right = sum(counts[k] for k in ("exact", "in the set", "none"))
        wrong = counts["wrong"] + counts["number"] + sum(v for k, v in counts.items() if k.startswith("claimed"))
        said = ", ".join(f"{k} {v}" for k, v in counts.most_common())
        total = counts.total()
        lines.append(row(label, total, said, per_cent(right, total), per_cent(wrong, total)))
    return "\n".join(lines)


def by_level(label: str) -> str:
    """Effects together, by their level."""
    single = ", λ =" in label and not label.startswith(("pairs", "effects"))
    return "effects, λ =" + label.split("λ =")[1] if single else label


def covers(results: list[Outcome], label: str) -> str:
    """How often intervals cover the truth."""
    all_of = [c for r in results if by_level(r.label) == label for c in r.covered]
    return row(label, len(all_of), per_cent(sum(all_of), len(all_of))) if all_of else ""


def main(count: str = "500", repeats: str = "6", first: str = "0") -> None:
    model, start = stand_in(), int(first)
    todo = nulls(model, int(count)) + cases(model, int(repeats))
    results = in_parallel(run_linear, [(model, c, seed) for seed, c in enumerate(todo, start)])
    eights = [r for r in results if r.label.endswith("λ = 8") and by_level(r.label) != r.label]
    pairs = [r for r in results if r.label.startswith("pairs")]
    levels = [by_level(c.label) for c in todo]
    coverage = [covers(results, label) for label in dict.fromkeys(levels)]
    named = [r.held_out for r in results if r.judgement == "exact"]

    others = [(label, stand_in(which)) for label, which in DESIGNS.items()]
    other_work = [
        (label, m, c) for label, m in others for c in (*nulls(m, OTHER_NULLS)[:OTHER_NULLS], *each_at_eight(m))
    ]
    other_results = in_parallel(
        run_linear, [(m, c, seed) for seed, (_, m, c) in enumerate(other_work, start + len(todo))]
    )
    designs = [
        replace(o, label=f"{label}: {by_level(o.label)}")
        for (label, _, _), o in zip(other_work, other_results, strict=True)
    ]

    parts = [
        "## By kind, linear model\n\n" + summary(results, by_level),
        "## By effect, λ = 8, linear model\n\n" + summary(eights, lambda s: s),
        "## Intervals\n\nHow often a 95 % interval contains the planted value: of effects that were named alone, "
        "and of the three coefficients where nothing was planted.\n\n"
        + "\n".join([heading("case", "intervals", "contain it (95 %)"), *filter(None, coverage)]),
        f"Held-out error over the noise of a run, where the effect was named: median {np.median(named):.3f}, "
        f"95 % of {len(named)} tables below {np.quantile(named, 0.95):.3f}.",
        f"## Other designs, linear model\n\n{OTHER_NULLS} tables with nothing planted, and each effect once at "
        "λ = 8.\n\n" + summary(designs, str),
    ]
    text = "\n\n".join(parts)
    print(text)
    print(Counter(r.effects for r in pairs if r.judgement == "wrong").most_common(12))
    head = PAGE.read_text().split("<!-- figures -->")[0] if PAGE.exists() else "# Operating characteristics\n\n"
    PAGE.write_text(f"{head}<!-- figures -->\n\n{text}\n")
