"""Operating characteristics of closing the loop: how often it is right, wrong or silent, on planted truths.

The whole procedure (`calibration.loop.close`) runs on tables of the paper's design (N = 2 to 5, six tail lengths,
two motor levels, both directions, two trials; four sessions). The bulk goes through a linear stand-in: the
simulator's derivatives in coefficients and effects at one robot, so that a table costs a second. Noise 2.5 %,
session scatter 0.5 %.

    nulls           nothing missing; with Gaussian noise, and with heavy tails (Student, 3 degrees of freedom)
    effects         each testable effect at sizes that its score finds at λ = 2, 4, 8, 16 standard deviations
    pairs           two effects at λ = 16
    outside         three effects that no catalogue has, at λ = 16; the third mimics end-over-end drag

Usage: python -m benchmarks.operating [NULLS] [REPEATS]      table on the screen and docs/operating.md
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from joblib import Parallel, delayed
from numpy.typing import NDArray
from scipy.stats import norm

from calibration.attribute import directions
from calibration.fit import jacobian
from calibration.loop import Verdict, close
from calibration.measurements import Measurements, read_measurements
from calibration.misfit import TESTABLE
from calibration.model import Floats, Parameter, Parameters, Runs, start_values
from calibration.noise import Noise
from calibration.swimmer import Swimmer
from sim.batches import available_jobs
from sim.robot import PRESETS

ROBOT = replace(PRESETS["paper-measured"], C_t=2.6, C_r=2.0, C_yr=3.2)
NOISE, SESSION = 0.025, 0.005
LEVELS = (2.0, 4.0, 8.0, 16.0)


@dataclass(frozen=True)
class Linear:
    """The swimmer near one robot: prediction + J (ln C − ln C0) + D (ε − null)."""

    runs: Runs
    coefficients: tuple[Parameter, ...]
    effects: tuple[Parameter, ...]
    prediction: Floats  # (n, k)
    J: Floats  # (n, k, 3)
    D: Floats  # (n, k, e)
    untestable: Mapping[str, str]

    def predict(self, sets: Sequence[Parameters], *, title: str = "") -> Floats:
        """Predictions (P, n, k)."""
        found = []
        for p in sets:
            c = np.array([np.log(p[q.name] / q.start) for q in self.coefficients])
            e = np.array([p[q.name] - q.start for q in self.effects])
            found.append(self.prediction + self.J @ c + self.D @ e)
        return np.array(found)

    def possible(self) -> tuple[Linear, list[dict[str, Any]]]:
        """The same runs again."""
        return self, [{"run": i} for i in range(len(self.runs))]

    def guess(self, start: dict[str, float], used: NDArray[np.bool_]) -> dict[str, float]:
        """The start as it is."""
        return start


def design() -> Measurements:
    """The paper's runs, without values."""
    rows = [
        {
            "N": n, "l_cm": length, "omega_rpm": sign * rpm, "trial": trial, "session": f"N = {n}",
            "omega_h_rpm": -float(sign), "omega_t_rpm": float(sign), "omega_yr_rad_s": float(sign),
            "R_yr_cm": 1.0, "theta_deg": 1.0,
        }
        for n in (2, 3, 4, 5)
        for length in (5.0, 7.0, 9.0, 11.0, 13.0, 15.0)
        for rpm in (110.0, 150.0)
        for sign in (1, -1)
        for trial in (1, 2)
    ]  # fmt: skip
    table = pd.DataFrame(rows)
    table["elapsed_min"] = 2.0 * np.random.default_rng(0).permutation(len(table))
    return read_measurements(table)


def stand_in() -> Linear:
    """Derivatives of the simulator at ROBOT."""
    model = Swimmer(ROBOT, design())
    start = start_values(model)
    prediction, J = jacobian(model, start, tuple(p.name for p in model.coefficients))
    D = directions(model, start, prediction, model.effects, title="")
    return Linear(model.runs, model.coefficients, model.effects, prediction, J, D, {})


def signals(model: Linear) -> tuple[Floats, Floats]:
    """Length of each effect's projected score per unit, and its survived share, (e,); one session is locked."""
    used = model.runs.session != len(model.runs.session_names) // 2
    white = Noise(NOISE**2 * np.eye(5), SESSION**2 * np.ones(5)).whitener(model.runs.session[used])
    Q = np.linalg.qr(white(model.J[used]))[0]
    whole = white(model.D[used])
    left = whole - Q @ (Q.T @ whole)
    lengths = np.linalg.norm(left, axis=0)
    return lengths, lengths / np.maximum(np.linalg.norm(whole, axis=0), 1e-300)


def measured(model: Linear, signal: Floats, seed: int, *, heavy: bool = False) -> Linear:
    """The stand-in with data: truth with `signal` (n, k), and noise."""
    rng = np.random.default_rng(seed)
    runs = model.runs
    shape = model.prediction.shape
    scatter = rng.standard_t(3, size=shape) / np.sqrt(3) if heavy else rng.normal(size=shape)
    shift = rng.normal(scale=SESSION, size=(len(runs.session_names), shape[1]))[runs.session]
    return replace(model, runs=replace(runs, y=model.prediction + signal + NOISE * scatter + shift))


def judge(verdict: Verdict, truth: frozenset[str]) -> str:
    """exact, in the set, wrong, or abstained (none, or unexplained)."""
    if not truth:
        return "none" if verdict.verdict == "none" else f"claimed ({verdict.verdict})"
    if not verdict.explaining:
        return "abstained" if verdict.verdict == "none" else "unexplained"
    sets = [frozenset((c.effect.name, *(e.name for e in c.beside))) for c in verdict.explaining]
    if len(sets) == 1:
        return "exact" if sets[0] == truth else "wrong"
    return "in the set" if truth in sets else "wrong"


def wilson(hits: int, count: int) -> tuple[float, float]:
    """95 % Wilson interval of a share."""
    z = float(norm.ppf(0.975))
    share = hits / count
    centre = (share + z**2 / (2 * count)) / (1 + z**2 / count)
    half = z / (1 + z**2 / count) * np.sqrt(share * (1 - share) / count + z**2 / (4 * count**2))
    return centre - half, centre + half


def outside(model: Linear) -> dict[str, Floats]:
    """Signals that no effect of the catalogue has, unscaled."""
    runs = model.runs
    tails, length = runs.inputs[:, 0], runs.inputs[:, 1]
    table: dict[str, Floats] = {}
    wave = np.zeros_like(model.prediction)
    wave[:, 2] = np.sin(6 * (length - length.mean()))
    table["yaw rate wavy in the tails' length"] = wave
    odd = np.zeros_like(model.prediction)
    odd[:, 0] = np.where(tails % 2 == 1, 1.0, -1.0)
    table["head spin by the parity of N"] = odd
    names = [e.name for e in model.effects]
    mimic = model.D[..., names.index("end_over_end_drag")].copy()
    mimic[:, 2] *= np.exp(1.5 * (length - length.mean()))
    table["mimic of end-over-end drag, twice too steep in l"] = mimic
    return table


Case = tuple[str, frozenset[str], Floats, bool]


def cases(model: Linear, repeats: int) -> list[Case]:
    """Everything but the nulls: label, truth, signal, heavy tails."""
    lengths, survived = signals(model)
    found: list[Case] = []
    strong = []
    for j, effect in enumerate(model.effects):
        for level in LEVELS:
            size = level / max(lengths[j], 1e-300)
            low, high = effect.bounds
            if survived[j] < TESTABLE or not (size <= high - effect.start or size <= effect.start - low):
                continue
            sign = 1 if effect.start + size <= high else -1
            signal = model.D[..., j] * size * sign
            found += [(f"{effect.name}, λ = {level:g}", frozenset({effect.name}), signal, False)] * repeats
            if level == 16.0:
                strong.append((effect.name, signal))
    for (a, first), (b, second) in zip(strong[::2], strong[1::2], strict=False):
        found += [("pairs, λ = 16 each", frozenset({a, b}), first + second, False)] * max(repeats // 2, 1)
    used = model.runs.session != len(model.runs.session_names) // 2
    white = Noise(NOISE**2 * np.eye(5), SESSION**2 * np.ones(5)).whitener(model.runs.session[used])
    Q = np.linalg.qr(white(model.J[used]))[0]
    for label, signal in outside(model).items():
        whole = white(signal[used][..., None])[:, 0]
        size = 16.0 / np.linalg.norm(whole - Q @ (Q.T @ whole))
        found += [(f"outside: {label}", frozenset({"outside"}), signal * size, False)] * (2 * repeats)
    return found


def run_case(model: Linear, case: Case, seed: int) -> tuple[str, str, float]:
    """Label, judgement, and held-out error after over the noise."""
    label, truth, signal, heavy = case
    verdict = close(measured(model, signal, seed, heavy=heavy), progress=False)
    return label, judge(verdict, truth), verdict.error_after / verdict.noise_ceiling


def summary(results: list[tuple[str, str, float]], group: Callable[[str], str]) -> str:
    """A table of judgements by group, with Wilson intervals of the first kind named."""
    lines = ["| case | tables | judgements | right (95 %) | wrong (95 %) |", "|---|---|---|---|---|"]
    labels = list(dict.fromkeys(group(r[0]) for r in results))
    for label in labels:
        own = [r[1] for r in results if group(r[0]) == label]
        counts = Counter(own)
        right = sum(counts[k] for k in ("exact", "in the set", "none"))
        if label.startswith("outside"):
            right = counts["unexplained"] + counts["abstained"]
        wrong = counts["wrong"] + sum(v for k, v in counts.items() if k.startswith("claimed"))
        said = ", ".join(f"{k} {v}" for k, v in counts.most_common())
        r, w = wilson(right, len(own)), wilson(wrong, len(own))
        shares = f"{_per_cent(right / len(own), r)} | {_per_cent(wrong / len(own), w)}"
        lines.append(f"| {label} | {len(own)} | {said} | {shares} |")
    return "\n".join(lines)


def _per_cent(share: float, ends: tuple[float, float]) -> str:
    return f"{100 * share:.0f} % ({100 * ends[0]:.0f} to {100 * ends[1]:.0f})"


def main(nulls: str = "500", repeats: str = "6", out: str = "docs/operating.md") -> None:
    model = stand_in()
    none = np.zeros_like(model.prediction)
    todo: list[Case] = [("null, Gaussian noise", frozenset(), none, False)] * int(nulls)
    todo += [("null, heavy tails", frozenset(), none, True)] * (int(nulls) // 5)
    todo += cases(model, int(repeats))
    results = Parallel(n_jobs=available_jobs(), verbose=1)(
        delayed(run_case)(model, case, seed) for seed, case in enumerate(todo)
    )
    by_level = [r for r in results if "λ" in r[0] and "pairs" not in r[0]]
    parts = [
        "## By kind\n\n" + summary(results, lambda s: "effects, λ =" + s.split("λ =")[1] if ", λ =" in s and
                                   "pairs" not in s else s),
        "## By effect, λ = 8\n\n" + summary([r for r in by_level if r[0].endswith("λ = 8")], lambda s: s),
    ]  # fmt: skip
    ratio = np.median([r[2] for r in results if r[1] == "exact"])
    parts.append(f"Held-out error over noise where the effect was named: median {ratio:.3f}.")
    text = "\n\n".join(parts)
    print(text)
    head = (
        Path(out).read_text().split("<!-- figures -->")[0]
        if Path(out).exists()
        else "# Operating characteristics\n\n"
    )
    Path(out).write_text(f"{head}<!-- figures -->\n\n{text}\n")


if __name__ == "__main__":
    main(*sys.argv[1:])
