"""Operating characteristics of closing the loop: how often it is right, wrong or silent, on planted truths.

The whole procedure (`calibration.loop.calibrate`) runs on tables of the paper's design (`benchmarks.planted`). The
bulk goes through a linear stand-in for the simulator; some of the same cases, with the same noise, go through the
simulator: the truth by time stepping on half the edge length and half the step, the fitter as it is.

Usage: python -m benchmarks.operating [NULLS] [REPEATS]      tables on the screen and in docs/operating.md
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from joblib import Parallel, delayed
from scipy.stats import norm

from benchmarks.planted import ROBOT, Case, Design, Linear, cases, nulls, scatter, stand_in
from calibration.loop import Verdict, calibrate
from calibration.model import Model, start_values
from calibration.swimmer import DIRECT, Swimmer
from sim.arrays import Floats
from sim.motion.batches import available_jobs, stepped_columns

PAGE = Path("docs/operating.md")
REAL_NULLS, REAL_SEEDS = 20, 2
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
    held_out: float  # error on the locked session over the noise of a run
    # Whether intervals contain the truth: those of rightly named effects, or of the coefficients of a null.
    covered: tuple[bool, ...]


def judge(verdict: Verdict, case: Case) -> str:
    """exact, in the set, wrong, or abstained (none, or unexplained)."""
    if case.label.startswith("null"):
        return "none" if verdict.verdict == "none" else f"claimed ({verdict.verdict})"
    if not verdict.explaining:
        return "abstained" if verdict.verdict == "none" else "unexplained"
    truth = frozenset(case.sizes)
    sets = [frozenset((c.effect.name, *(e.name for e in c.beside))) for c in verdict.explaining]
    if len(sets) == 1:
        return "exact" if sets[0] == truth else "wrong"
    return "in the set" if truth in sets else "wrong"


def outcome(model: Model, case: Case) -> Outcome:
    """Close the loop on a model that has its data."""
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
    y = model.prediction + case.signal + scatter(model.runs, model.prediction.shape[1], seed, heavy=case.heavy)
    return outcome(replace(model, runs=replace(model.runs, y=y)), case)


def real_truth(case: Case, model: Swimmer) -> Floats:
    """Outputs (n, k) of a case by time stepping on a finer mesh."""
    start = start_values(model)
    sizes = {name: start[name] + size for name, size in case.sizes.items()}
    finer = replace(model, solver=DIRECT._replace(steady=partial(stepped_columns, finer=2)))
    return np.asarray(finer.predict([{**start, **sizes}])[0])


def run_real(case: Case, seeds: Sequence[int]) -> list[Outcome]:
    """One case through the simulator, with several draws of the noise."""
    model = Swimmer(ROBOT, stand_in().runs, jobs=1)  # type: ignore[arg-type]
    truth = real_truth(case, model)
    found = []
    for seed in seeds:
        y = truth + scatter(model.runs, truth.shape[1], seed, heavy=case.heavy)
        found.append(outcome(replace(model, runs=replace(model.runs, y=y)), case))
    return found


def eights_of(model: Linear) -> list[Case]:
    """Each effect once at λ = 8."""
    return [c for c in cases(model, 1) if c.label.endswith("λ = 8") and c.sizes]


def wilson(hits: int, count: int) -> tuple[float, float]:
    """95 % Wilson interval of a share."""
    z = float(norm.ppf(0.975))
    share = hits / count
    centre = (share + z**2 / (2 * count)) / (1 + z**2 / count)
    half = z / (1 + z**2 / count) * np.sqrt(share * (1 - share) / count + z**2 / (4 * count**2))
    return max(centre - half, 0.0), min(centre + half, 1.0)


def per_cent(hits: int, count: int) -> str:
    """A share with its interval."""
    low, high = wilson(hits, count)
    return f"{100 * hits / count:.1f} % ({100 * low:.0f} to {100 * high:.0f})"


def summary(results: list[Outcome], group: Callable[[str], str]) -> str:
    """A table of judgements by group."""
    lines = ["| case | tables | judgements | right (95 %) | wrong (95 %) |", "|---|---|---|---|---|"]
    for label in dict.fromkeys(group(r.label) for r in results):
        counts = Counter(r.judgement for r in results if group(r.label) == label)
        right = sum(counts[k] for k in ("exact", "in the set", "none"))
        if label.startswith("outside"):
            right = counts["unexplained"] + counts["abstained"]
        wrong = counts["wrong"] + sum(v for k, v in counts.items() if k.startswith("claimed"))
        said = ", ".join(f"{k} {v}" for k, v in counts.most_common())
        total = counts.total()
        lines.append(f"| {label} | {total} | {said} | {per_cent(right, total)} | {per_cent(wrong, total)} |")
    return "\n".join(lines)


def by_level(label: str) -> str:
    """Effects together, by their level."""
    single = ", λ =" in label and not label.startswith(("pairs", "effects"))
    return "effects, λ =" + label.split("λ =")[1] if single else label


def covers(results: list[Outcome], label: str) -> str:
    """How often intervals cover the truth."""
    all_of = [c for r in results if by_level(r.label) == label for c in r.covered]
    return f"| {label} | {len(all_of)} | {per_cent(sum(all_of), len(all_of))} |" if all_of else ""


def main(count: str = "500", repeats: str = "6") -> None:
    model = stand_in()
    todo = nulls(model, int(count)) + cases(model, int(repeats))
    parallel = Parallel(n_jobs=available_jobs(), verbose=1)
    results: list[Outcome] = parallel(delayed(run_linear)(model, c, seed) for seed, c in enumerate(todo))
    eights = [r for r in results if r.label.endswith("λ = 8") and by_level(r.label) != r.label]
    pairs = [r for r in results if r.label.startswith("pairs")]
    levels = [by_level(c.label) for c in todo]
    coverage = [covers(results, label) for label in dict.fromkeys(levels)]
    named = [r.held_out for r in results if r.judgement == "exact"]

    others = [(label, stand_in(which)) for label, which in DESIGNS.items()]
    elsewhere = [
        (label, m, c) for label, m in others for c in (*nulls(m, OTHER_NULLS)[:OTHER_NULLS], *eights_of(m))
    ]
    found = parallel(delayed(run_linear)(m, c, seed) for seed, (_, m, c) in enumerate(elsewhere))
    designs = [
        replace(o, label=f"{label}: {by_level(o.label)}")
        for (label, _, _), o in zip(elsewhere, found, strict=True)
    ]

    one_each = {c.label: c for c in eights_of(model)}
    own = [REAL_SEEDS * i for i in range(len(one_each) + 1)]  # every table has its own noise
    planted = [(c, list(range(i, i + REAL_SEEDS))) for c, i in zip(one_each.values(), own, strict=False)]
    planted += [(nulls(model, 1)[0], list(range(own[-1], own[-1] + REAL_NULLS)))]
    real = parallel(delayed(run_real)(c, seeds) for c, seeds in planted)
    stand = parallel(delayed(run_linear)(model, c, seed) for c, seeds in planted for seed in seeds)
    through = [o for group in real for o in group]
    agree = sum(a.verdict == b.verdict and a.effects == b.effects for a, b in zip(through, stand, strict=True))
    parts = [
        "## By kind, linear model\n\n" + summary(results, by_level),
        "## By effect, λ = 8, linear model\n\n" + summary(eights, lambda s: s),
        "## Intervals\n\nHow often a 95 % interval contains what was planted. Counted are effects that were named "
        "alone, and the three coefficients where nothing was planted.\n\n"
        "| case | intervals | contain it (95 %) |\n|---|---|---|\n" + "\n".join(line for line in coverage if line),
        f"Held-out error over the noise of a run, where the effect was named: median {np.median(named):.3f}, "
        f"95 % of {len(named)} tables below {np.quantile(named, 0.95):.3f}.",
        f"## Other designs, linear model\n\n{OTHER_NULLS} tables with nothing planted, and each effect once at "
        "λ = 8.\n\n" + summary(designs, str),
        "## Through the simulator\n\nThe same cases with the same noise. The truth is stepped in time on a finer "
        f"mesh and step. {agree} of {len(through)} verdicts are the same as with the linear model.\n\n"
        + summary(through, by_level),
        f"Held-out error over noise, where the effect was named: {_range(through)}.",
    ]
    text = "\n\n".join(parts)
    print(text)
    print(Counter(r.effects for r in pairs if r.judgement == "wrong").most_common(12))
    head = PAGE.read_text().split("<!-- figures -->")[0] if PAGE.exists() else "# Operating characteristics\n\n"
    PAGE.write_text(f"{head}<!-- figures -->\n\n{text}\n")


def _range(results: list[Outcome]) -> str:
    ratios = [r.held_out for r in results if r.judgement == "exact"]
    if not ratios:
        return "none was named"
    return f"{min(ratios):.2f} to {max(ratios):.2f}, median {np.median(ratios):.2f}, {len(ratios)} tables"


if __name__ == "__main__":
    main(*sys.argv[1:])
