"""A plan that covers a region, and how it shows itself: text, picture, content of cover.json."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from planner.jobs.region import Field
from planner.paths.obstacles import FreeSpace
from planner.paths.units import in_lab
from planner.planning.planned import Plan
from sim.arrays import Floats
from sim.io.notebook import as_html, given_axes
from sim.io.units import format_time

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FORMAT = 1


@dataclass(frozen=True, repr=False)
class CoveragePlan:
    """A plan that covers a region with a round footprint about the tracked point. Lengths in l, times in μ0 l⁴/EI.

    Example:
        >>> import softflagella as sf
        >>> cover = sf.cover([[0, 0], [2, 0], [2, 2], [0, 2]], 0.5, "paper-control", objective="time")
        >>> cover.share > 0.97, cover.plan.duration > cover.bound
        (True, True)
    """

    plan: Plan  # the schedule that covers it
    field: Field  # the region and its holes
    width: float  # of the footprint
    lanes: Floats  # (k, 2, 2), start and end of each lane, in the order in which they are swum
    share: float  # of the area that the predicted track covers
    sure: float  # of the area that is covered as long as the robot stays within the stated error
    sure_tracked: float  # the same with feedback, if the margin around obstacles stays as it is
    bound: float  # area by width and net speed on straight lines: lanes take longer, by turns and overlap
    exact: bool  # no order of the lanes is quicker
    gap: float  # how much longer than with the quickest order the ways between lanes may take, as a share

    def lines(self) -> list[str]:
        """Say what is covered, and in what time."""
        robot = self.plan.robot
        scale, duration = robot.time_scale, self.plan.duration
        if self.plan.kept_clear is not None:
            proven = "the quickest order of those with direct ways"
        elif self.exact:
            proven = "no order of them is quicker"
        else:
            proven = f"another order takes at most {100 * self.gap / (1 + self.gap):.0f} % less"
        share, sure, tracked = (100 * each for each in (self.share, self.sure, self.sure_tracked))
        remedy = f", {tracked:.1f} % if a camera measures where it is (--feedback)" if tracked > sure else ""
        if tracked == 0:
            remedy = f"; with a camera (--feedback), give more than {in_lab(2 * self.plan.feedback_error, robot)}"
        return [
            f"{len(self.lanes)} lanes for a width of {in_lab(self.width, robot)}; {proven}",
            f"covers {share:.1f} % as predicted, {sure:.1f} % wherever the robot is within the stated error"
            f"{remedy}",
            f"{format_time(duration * scale)}; area by width and net speed, the bound for lanes without turns, is "
            f"{format_time(self.bound * scale)}",
        ]

    def __repr__(self) -> str:
        return "\n".join(["Coverage of a region", *(f"  {line}" for line in self.lines()), repr(self.plan)])

    def _repr_html_(self) -> str:
        return as_html(repr(self), self.plot)

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the region, what is covered, and the plan, on axes in cm.

        Args:
            ax: default: axes of a new figure.
        """
        from planner.jobs.coverage_picture import draw_field, draw_swath  # loads matplotlib

        ax = given_axes(ax)
        length = self.plan.robot.tail_length
        draw_swath(ax, self.plan.smooth_track, self.width, length)
        ax = self.plan.plot(ax)
        draw_field(ax, self.field, length)
        return ax

    def to_dict(self) -> dict[str, Any]:
        """Return the content of cover.json. Lengths in l, times in seconds."""
        scale = self.plan.robot.time_scale
        return {
            "format": FORMAT,
            "outline": FreeSpace((self.field.outline,)).to_dict()["keep_out"][0],
            "holes": FreeSpace(self.field.holes).to_dict()["keep_out"],
            "width_over_l": self.width,
            "lanes": self.lanes.tolist(),
            "share": self.share,
            "share_within_stated_error": self.sure,
            "duration_s": self.plan.duration * scale,
            "bound_s": self.bound * scale,
            "exact": self.exact,
            "gap": self.gap,
        }
