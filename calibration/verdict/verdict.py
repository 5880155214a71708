"""The verdict on a table of runs: said, drawn, tabulated, sampled and saved."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd

from calibration.findings.findings import Findings
from calibration.findings.record import corrected_record, facts, verdict_record
from calibration.findings.samples import draw_samples, open_forms
from calibration.words.quantities import sized
from calibration.words.render import errors_in_words, headline, in_brief, sentence
from common.files import files_together, write_text
from common.notebook import Shown, given_axes
from common.provenance import provenance

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FILES = ("verdict.json", "report.html", "corrected.toml", "corrected.json")  # a folder has one of the last two
_LONGEST = 500  # letters of a sentence in a repr


@dataclass(frozen=True, repr=False)
class Verdict(Shown, Findings):
    """What runs say about a model; made by `softflagella.calibrate`.

    Example:
        >>> from softflagella import calibrate
        >>> calibrate("runs.csv", "robot.toml").sentence  # doctest: +SKIP
        'No effect is missing that these runs can show (p = 0.43 under the model, with noise as estimated).'
    """

    table: str = field(default="table", kw_only=True)  # its name

    def __repr__(self) -> str:
        said, names = self.sentence, ", ".join(self.effects)
        said = said if len(said) <= _LONGEST else f"{said[:_LONGEST]} …"
        return f"Verdict {self.verdict!r}{f': {names}' if names else ''}\n  {said}\n  {self.errors_in_words}"

    @cached_property
    def facts(self) -> dict[str, Any]:
        """What every text is made of; the larger part of verdict.json."""
        return facts(self)

    @property
    def headline(self) -> str:
        """The verdict in one sentence of few words, with the size of what it names."""
        return headline(self.facts)

    @property
    def in_brief(self) -> list[str]:
        """Lines: headline, what kind of verdict it is, and the errors on the held-out runs."""
        return in_brief(self.facts)

    @property
    def sentence(self) -> str:
        """The verdict in a sentence with its certainty, and what goes before it or beside it."""
        return sentence(self.facts)

    @property
    def errors_in_words(self) -> str:
        """The errors on the held-out runs, in a line."""
        return errors_in_words(self.facts)

    def quantities(self) -> list[tuple[str, str]]:
        """List conclusion, errors, and the numbers of the fit with their 95 % intervals."""
        fitted = self.facts["parameters"].values()
        numbers = [(of["title"], sized(of["value"], of["interval"], of)) for of in fitted]
        return [("conclusion", self.sentence), ("errors", self.errors_in_words), *numbers]

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the residual of each output, before and after, over the noise of a run.

        Args:
            ax: default: axes of a new figure.
        """
        from calibration.report.figures import plot_summary  # loads matplotlib

        ax = given_axes(ax)
        plot_summary(ax, self)
        ax.legend(frameon=False, fontsize=8)
        return ax

    def to_frame(self) -> pd.DataFrame:
        """Tabulate the relative errors on the held-out runs: a row for each model, all outputs and each output."""
        rows = {name: {"all": rms, **self.errors.by_output[name]} for name, rms in self.errors.rms.items()}
        return pd.DataFrame.from_dict(rows, orient="index")

    def samples(self, count: int = 1000, *, seed: int = 0) -> pd.DataFrame:
        """Draw numbers and effects that the runs allow, see `calibration.findings.samples`.

        Args:
            count: rows.
            seed: of the draws.

        Returns:
            A column for each number and effect that was fitted, and `form`: of forms that the runs cannot tell
            apart, each has its share of the rows.

        Raises:
            InputError: the count is below 1.

        Example:
            >>> import softflagella as sf
            >>> verdict = sf.calibrate("falls.csv", MODEL)  # doctest: +SKIP
            >>> verdict.samples(4000)["viscosity"].quantile([0.025, 0.975])  # doctest: +SKIP
        """
        return draw_samples(open_forms(self), count, seed)

    def to_dict(self) -> dict[str, Any]:
        """Return the content of verdict.json."""
        return verdict_record(self.facts, table=self.table)

    def save(self, folder: str | Path) -> list[Path]:
        """Write verdict.json and what is corrected, both or neither, then report.html, and return their paths.

        Raises:
            InputError: the files cannot be written.
        """
        from calibration.report.report import write_report  # loads matplotlib

        (name, corrected), record = self._corrected_file(), self.to_dict()
        with files_together(folder, FILES) as temporary:
            write_text(temporary / name, corrected)
            write_text(temporary / "verdict.json", json.dumps(record, indent=1) + "\n")
        write_report(self, record, Path(folder, "report.html"))
        return [Path(folder, each) for each in (*FILES[:2], name)]

    def _corrected_file(self) -> tuple[str, str]:
        """Return the name and the text of the file with what is corrected."""
        record = {**corrected_record(self), "table": self.table, "provenance": provenance({"table": self.table})}
        return "corrected.json", json.dumps(record, indent=1) + "\n"
