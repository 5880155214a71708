"""The verdict on a table of runs, in words."""

from __future__ import annotations

from dataclasses import dataclass

from calibration.verdict.findings import Findings
from calibration.verdict.record import facts
from calibration.words.render import errors_in_words, sentence

_LONGEST = 500  # letters of a sentence in a repr


@dataclass(frozen=True, repr=False)
class Verdict(Findings):
    """What runs say about a model; made by `softflagella.calibrate`.

    Example:
        >>> from softflagella import calibrate
        >>> calibrate("runs.csv", "robot.toml").sentence  # doctest: +SKIP
        'No effect is missing that these runs can show (p = 0.43 under the model, with noise as estimated).'
    """

    def __repr__(self) -> str:
        record = facts(self)
        said, names = sentence(record), ", ".join(self.effects)
        said = said if len(said) <= _LONGEST else f"{said[:_LONGEST]} …"
        return f"Verdict {self.verdict!r}{f': {names}' if names else ''}\n  {said}\n  {errors_in_words(record)}"

    @property
    def sentence(self) -> str:
        """The verdict in a sentence with its certainty, and what goes before it or beside it."""
        return sentence(facts(self))

    @property
    def errors_in_words(self) -> str:
        """The errors on the held-out runs, in a line."""
        return errors_in_words(facts(self))
