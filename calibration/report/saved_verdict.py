"""A verdict with its table: drawn, tabulated and saved. What is corrected differs between a robot and a model."""

from __future__ import annotations

import json
from abc import abstractmethod
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd

from calibration.report.path_error import PathError
from calibration.report.report import write_report
from calibration.verdict.record import facts, verdict_record
from calibration.verdict.samples import draw_samples, open_forms
from calibration.verdict.verdict import Verdict
from calibration.words.quantities import sized
from common.files import files_together, write_text
from common.notebook import Shown, given_axes

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FILES = ("verdict.json", "report.html", "corrected.toml", "corrected.json")  # a folder has one of the last two


@dataclass(frozen=True, repr=False)
class SavedVerdict(Shown, Verdict):
    """A `Verdict` with its table, and with what it corrects."""

    table: str  # name of the table
    paths: tuple[PathError, ...] = field(default=(), kw_only=True)  # the error on paths, where it was asked for

    @abstractmethod
    def _corrected_file(self) -> tuple[str, str]:
        """Return the name and the text of the file with what is corrected."""

    def quantities(self) -> list[tuple[str, str]]:
        """List conclusion, errors, and the numbers of the fit with their 95 % intervals."""
        fitted = facts(self)["parameters"].values()
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
        """Draw numbers and effects that the runs allow, see `calibration.verdict.samples`.

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
        paths = {error.words: error.record() for error in self.paths}
        return verdict_record(self, table=self.table, path=paths or None)

    def save(self, folder: str | Path) -> list[Path]:
        """Write verdict.json and what is corrected, both or neither, then report.html, and return their paths.

        Raises:
            InputError: the files cannot be written.
        """
        (name, corrected), record = self._corrected_file(), self.to_dict()
        with files_together(folder, FILES) as temporary:
            write_text(temporary / name, corrected)
            write_text(temporary / "verdict.json", json.dumps(record, indent=1) + "\n")
        write_report(self, record, Path(folder, "report.html"), paths=self.paths)
        return [Path(folder, each) for each in (*FILES[:2], name)]
