"""Ranks of true values among a verdict's samples: are the intervals as wide as they should be?

Tables of balls in a tube, as those of `forms`. If `verdict.samples` are right, a true value is as likely at any
rank among them (simulation-based calibration, Talts et al. 2018). Ranks in the middle: the intervals are too wide;
at both ends: too narrow. The size of an effect has a rank among the samples of forms that have it, if named.

Usage: python -m benchmarks ranks [TABLES] [FIRST_SEED] [FIGURE]

Takes 10 minutes with 200 tables.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import matplotlib.pyplot as plt
import numpy as np
from scipy.stats import binom, kstest

from benchmarks.calibration.forms import NAMES, PLANTED, FormsCase, length
from benchmarks.common import heading, in_parallel, per_cent, row
from calibration.findings.samples import draw_samples, open_forms
from calibration.verdict.calibrate import calibrate
from calibration.verdict.verdict import Verdict
from common.arrays import Floats
from tests.oracles.drawn_falls import falls, model_of

_SAMPLES, _BINS = 999, 10
_LEVELS = (0.5, 0.9, 0.95)
_NOTHING, _EFFECT = "nothing planted: viscosity", "one effect, λ = 4 to 20: viscosity"
_SIZE = "one effect, λ = 4 to 20: its size, where it is named"
_CASE = FormsCase("one effect", strength=(4.0, 20.0))


class TrueRank(NamedTuple):
    """A true value among samples."""

    label: str
    rank: float  # share of the samples below it


def ranks(planted: bool, seed: int) -> list[TrueRank]:
    """Draw a table, and rank the true values."""
    truth, random = PLANTED[seed % len(PLANTED)], np.random.default_rng(seed)
    size = float(random.uniform(*_CASE.strength)) / length(truth, _CASE) if planted else 0.0
    effects: dict[str, Any] = {truth: size}
    table = falls(seed, rounds=_CASE.rounds, scatter=_CASE.scatter, **effects)
    verdict: Verdict = calibrate(model_of(table, NAMES), draws=300, seed=seed, progress=False)
    samples = draw_samples(open_forms(verdict), _SAMPLES, seed)
    said = [TrueRank(_EFFECT if planted else _NOTHING, float((samples["viscosity"] < 1.0).mean()))]
    if planted and truth in samples:
        sizes = samples[truth][samples[truth] != 0.0]
        said += [TrueRank(_SIZE, float((sizes < size).mean()))] if sizes.std() else []
    return said


def main(tables: str = "200", first: str = "0", figure: str = "") -> None:
    """Print how often intervals contain the truth, and whether ranks are even; draw them."""
    done = in_parallel(ranks, [(p, int(first) + seed) for p in (False, True) for seed in range(int(tables))])
    of_label = {
        label: np.array([each.rank for group in done for each in group if each.label == label])
        for label in (_NOTHING, _EFFECT, _SIZE)
    }
    print(heading("ranks of", "tables", *(f"{100 * level:g} % interval" for level in _LEVELS), "even: p"))
    for label, found in of_label.items():
        shares = [per_cent(int((np.abs(found - 0.5) <= level / 2).sum()), len(found)) for level in _LEVELS]
        print(row(label, len(found), *shares, f"{kstest(found, 'uniform').pvalue:.2g}"))
    if figure:
        draw(of_label, figure)


def draw(of_label: dict[str, Floats], figure: str) -> None:
    """Draw histograms of ranks, with the band that holds 95 % of the bars of even ranks."""
    picture, panels = plt.subplots(1, len(of_label), figsize=(9, 2.7), layout="constrained", squeeze=False)
    for axes, (label, found) in zip(panels[0], of_label.items(), strict=True):
        low, high = binom.interval(0.95, len(found), 1 / _BINS)
        axes.axhspan(low, high, color="#d5dce2")
        axes.hist(found, bins=np.linspace(0, 1, _BINS + 1), color="#2a7fba", rwidth=0.92)
        axes.set_title("\n".join(label.split(": ")), fontsize=9)
        axes.set_xlabel("rank of the true value among samples", fontsize=8)
        axes.tick_params(labelsize=8)
    panels[0, 0].set_ylabel("tables", fontsize=8)
    picture.savefig(figure, dpi=110)
