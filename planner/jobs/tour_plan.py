"""A plan that visits places, and how it shows itself: text, picture, content of tour.json."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from planner.paths.units import in_lab
from planner.planning.picture import REPLAYED, label_points
from planner.planning.planned import Plan
from sim.arrays import Floats
from sim.io.notebook import as_html
from sim.io.units import format_time

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FORMAT = 1


@dataclass(frozen=True, repr=False)
class TourPlan:
    """A plan that visits places. Lengths in l, times in μ0 l⁴/EI.

    Example:
        >>> import softflagella as sf
        >>> tour = sf.tour([(0, 0), (4, 0), (2, 1)], "paper-control")
        >>> tour.order, tour.exact
        ((0, 2, 1), True)
    """

    plan: Plan  # the schedule that visits them
    places: Floats  # (n, 2), as they were given
    order: tuple[int, ...]  # indices of the places; with a return, the first one again at the end
    exact: bool  # no order is quicker, with the directions of motion that were tried at each place
    gap: float  # how much longer than the quickest order this one may take, as a share
    estimate: float  # time of the tour by which orders were compared
    reached: Floats  # (k,), time at which the predicted track is nearest to each place of the order
    distance: Floats  # (k,), from the predicted track then
    courses: int  # directions of motion that were tried at each place

    def lines(self) -> list[str]:
        """Say order, times and distances."""
        robot = self.plan.robot
        tried = f"with {self.courses} headings tried at each place"
        if self.exact:
            proven = f"no other order is quicker, {tried}"
        elif self.plan.kept_clear is None:
            proven = f"at most {100 * self.gap:.0f} % longer than the quickest order, {tried}"
        else:
            proven = "the quickest one of those with direct ways; ways around obstacles were estimated"
        return [
            f"order: {' '.join(str(index + 1) for index in self.order)}; {proven}",
            f"{format_time(self.plan.duration * robot.time_scale)} in all; the predicted track passes every place "
            f"within {in_lab(float(self.distance.max()), robot)}",
        ]

    def __repr__(self) -> str:
        return "\n".join([f"Tour of {len(self.places)} places", *(f"  {line}" for line in self.lines()),
                          repr(self.plan)])  # fmt: skip

    def _repr_html_(self) -> str:
        return as_html(repr(self), self.plot)

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the plan and the numbers of the places, on axes in cm.

        Args:
            ax: default: axes of a new figure.
        """
        ax = self.plan.plot(ax)
        cm = 100 * self.plan.robot.tail_length
        places = cm * self.places
        ax.plot(*places.T, "o", color=REPLAYED, ms=5)
        numbers = [str(index + 1) for index in range(len(places))]
        label_points(ax, places, numbers, [REPLAYED] * len(places), 9)
        return ax

    def to_dict(self) -> dict[str, Any]:
        """Return the content of tour.json. Lengths in l, times in seconds."""
        scale = self.plan.robot.time_scale
        return {
            "format": FORMAT,
            "places": self.places.tolist(),
            "order": list(self.order),
            "exact": self.exact,
            "gap": self.gap,
            "estimated_s": self.estimate * scale,
            "reached_s": (self.reached * scale).tolist(),
            "distance_over_l": self.distance.tolist(),
        }
