"""The plan: a schedule with its errors and its job, and how it shows itself: text, picture, table, plan.json."""

from __future__ import annotations

import math
import textwrap
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, Generic, cast

import numpy as np
from numpy.typing import NDArray

from common.arrays import Floats
from common.errors import InputError
from common.notebook import Shown, given_axes
from common.units import format_time
from planner.guidance.line_of_sight import Guidance
from planner.paths.obstacles import Footprint, FreeSpace
from planner.paths.path import Path2D
from planner.paths.units import extent, heading_in_degrees, in_lab, place_in_lab, time_in_lab
from planner.planning.conditions import KeptClear, Lap
from planner.planning.declare import FeasiblePath
from planner.planning.request import PlanRequest
from planner.planning.stated_error import PlanErrors, feedback_error, plan_errors
from planner.vehicle.measured import MeasuredVehicle
from planner.vehicle.tracked_point import TrackedVehicle
from planner.vehicle.vehicle import Switches, roll_out, smooth_track
from planner.vehicle.zigzag import Zigzag
from sim.mechanics.planar import POSE
from sim.model.robot import Robot
from sim.model.schedule import FORMAT, Schedule, plan_id
from sim.robot_rows import with_units

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from typing_extensions import TypeVar

    J = TypeVar("J", bound="Job | None", default=Any, covariant=True)
    K = TypeVar("K", bound="Job")
else:
    from typing import TypeVar

    J, K = TypeVar("J"), TypeVar("K")

GUARANTEE = "guaranteed_error_over_l"  # of plan.json; null where it is not known
WIDE = 0.25  # turn radii; a predicted track that is further from the declared path gets a warning
_OWN_TABLE_FROM = 1.7  # stated error over predicted error, from which a table of its own is proposed


KINDS = ("goal", "tour", "hold")  # of jobs that have files of their own


class Job:
    """What a plan does besides following its path."""

    kind: ClassVar[str]  # one of KINDS: there are {kind}.json and {kind}.svg

    def lines(self, plan: Plan) -> list[str]:
        """Say what the plan does for its job."""
        raise NotImplementedError

    def title(self, plan: Plan) -> str:
        """Name what counts, for the picture."""
        return f"stated error {in_lab(plan.stated_error, plan.robot)}"

    def draw(self, axes: Axes, plan: Plan) -> None:
        """Draw what belongs to the job over the plan, on axes in cm."""

    def to_dict(self, plan: Plan) -> dict[str, Any]:
        """Return the content of {kind}.json."""
        raise NotImplementedError


@dataclass(frozen=True, repr=False)
class Plan(Shown, Generic[J]):
    """A schedule and its errors. Lengths are in l, times in μ0 l⁴/EI, unless a name says its unit.

    Example:
        >>> from softflagella import circle, load_robot, plan
        >>> result = plan(circle(2.0), load_robot("paper-control"))
        >>> result.predicted_max < result.stated_error, len(result.seconds) == len(result.dwells)
        (True, True)
    """

    tracked: TrackedVehicle  # who follows
    request: PlanRequest  # what was asked for
    drawn: Path2D  # the path that was asked for
    declared: FeasiblePath  # the path that is followed, with the pivot's reference
    straight: Zigzag  # straight motion with the shortest dwell: no schedule has a smaller rms error
    guidance: Guidance  # when the motor flips
    switches: Switches  # the schedule
    errors: PlanErrors  # how far from the paths it leads
    kept_clear: KeptClear | None = None  # walls and regions that it avoids; None: there are none
    lap: Lap | None = None  # of a schedule that repeats; None: it is carried out once
    job: J = None  # type: ignore[assignment]  # what it does besides following its path

    def with_job(self, job: K) -> Plan[K]:
        """Return this plan with a job."""
        return replace(cast("Plan[K]", self), job=job)

    @property
    def robot(self) -> Robot | MeasuredVehicle:
        """The robot, or the measured vehicle, that the plan is for."""
        return self.tracked.robot

    @property
    def first_direction(self) -> int:
        """Direction of the motor in the first dwell, +1 or −1."""
        return self.switches.first_direction

    @property
    def dwells(self) -> Floats:
        """Dwell times (M,)."""
        return self.switches.dwells

    @property
    def seconds(self) -> Floats:
        """Dwell times (M,) [s]."""
        return self.dwells * self.robot.time_scale

    @property
    def duration(self) -> float:
        """Time of the whole schedule."""
        return float(self.dwells.sum())

    @property
    def flip_times(self) -> Floats:
        """Times (M + 1,) of the start, the flips and the end."""
        return np.concatenate([[0.0], np.cumsum(self.dwells)])

    @property
    def minimum_dwell(self) -> float:
        """The shortest dwell that the schedule may have."""
        return self.guidance.dwell

    @property
    def start(self) -> POSE:
        """Where the head's centre must be put, at rest: x, y [l] and heading [rad]."""
        x, y, heading = self.poses[0].tolist()
        return x, y, heading

    @property
    def end(self) -> POSE:
        """Where it is at the end, as predicted."""
        x, y, heading = self.poses[-1].tolist()
        return x, y, heading

    @property
    def poses(self) -> Floats:
        """Predicted poses (M + 1, 3) of the head's centre at the flips and at the end."""
        return self.switches.poses

    @property
    def track(self) -> Floats:
        """Predicted track (S, 2) of the tracked point, several samples a dwell."""
        return self.errors.track

    @cached_property
    def smooth_track(self) -> Floats:
        """Predicted track (S, 2) of the tracked point for pictures, with more samples where a dwell turns far."""
        return smooth_track(self.tracked.vehicle, self.switches, self.tracked.offset)

    @property
    def reference(self) -> Floats:
        """The declared path (m, 2)."""
        return self.declared.reference.p

    @property
    def predicted_rms(self) -> float:
        """Root mean square over time of the predicted distance from the declared path."""
        return self.errors.predicted_rms

    @property
    def predicted_max(self) -> float:
        """Largest predicted distance from the declared path."""
        return self.errors.predicted_max

    @property
    def stated_error(self) -> float:
        """Distance that 95 % of the robots that the model's uncertainty allows keep to, open loop."""
        return self.errors.stated

    @cached_property
    def feedback_error(self) -> float:
        """Distance within which a tracker keeps 95 % of the robots in 95 % of the time."""
        speed, scale = self.straight.net_speed, self.robot.time_scale
        return feedback_error(
            self.errors.distance, self.dwells, speed, scale, self.request.camera, self.stated_error
        )

    @property
    def margin_needed(self) -> float:
        """The error that a margin around obstacles must cover."""
        return self.feedback_error if self.request.feedback else self.stated_error

    def clearance(self, space: FreeSpace) -> float:
        """Predict the smallest distance of the body from what is not free."""
        body, poses = Footprint.of(self.robot, 0.0), roll_out(self.tracked.vehicle, self.switches).poses
        return float(body.clearance(poses, space).min())

    @property
    def warnings(self) -> tuple[str, ...]:
        """What the user should know, in words."""
        own: list[str] = []
        if self.predicted_max > WIDE * self.tracked.vehicle.turn_radius:
            turn = math.degrees(self.minimum_dwell * self.tracked.vehicle.yaw_rate)
            own.append(
                f"the predicted track is up to {in_lab(self.predicted_max, self.robot)} from the declared path: "
                f"in dwells of {time_in_lab(self.minimum_dwell, self.robot)} the robot turns by {turn:.0f} "
                "degrees; shorter ones keep it nearer"
            )
        large = self.stated_error >= _OWN_TABLE_FROM * self.predicted_max
        if large and self.errors.table_share > 0.5 and not self.tracked.own_table:
            own.append(
                f"the stated error is mostly that of the look-up table, over {len(self.dwells)} flips: simulate "
                "this robot's own table (--own-table, own_table=True), or measure poses on the way"
            )
        return (*self.declared.warnings, *own, *self.tracked.warnings)

    @cached_property
    def unmeasured_error(self) -> float | None:
        """The stated error if the coefficients are those of another robot [l]; None: calibrated, or not known."""
        if not self.tracked.unmeasured:
            return None
        vehicle = self.tracked.vehicle
        modes = (*vehicle.modes, *self.tracked.unmeasured)
        guessed = self.tracked._replace(vehicle=replace(vehicle, modes=modes))
        return plan_errors(guessed, self.drawn, self.declared, self.switches, guaranteed=None, seed=0).stated

    @property
    def unmeasured_words(self) -> str:
        """What is known of the error before calibration, in words; empty where there is nothing to say."""
        error = self.unmeasured_error
        if error is None:
            return ""
        if error > max(extent(self.drawn)):
            return f"not known before calibration (other robots differ by {in_lab(error, self.robot)})"
        return f"with the coefficients of another robot: stated error {in_lab(error, self.robot)}"

    @property
    def error_line(self) -> str:
        """The errors in one sentence; on two lines where the coefficients are not calibrated."""
        rms, largest, stated, feedback = (
            in_lab(error, self.robot)
            for error in (self.predicted_rms, self.predicted_max, self.stated_error, self.feedback_error)
        )
        predicted = f"predicted error {rms} rms, {largest} at most;"
        errors = f"stated error {stated}, with feedback {feedback}"
        if self.feedback_error >= self.stated_error:
            errors = f"stated error {stated} open loop, which this camera would not lessen"
        if self.tracked.calibrated:
            return f"{predicted} {errors}"
        unmeasured = self.unmeasured_words and f"; {self.unmeasured_words}"
        return f"if the coefficients are exact: {predicted}\n{errors}{unmeasured}"

    def schedule(self, robot: Robot | None = None, *, laps: int = 1) -> Schedule:
        """Return the schedule for `sim.motion.replay`.

        Args:
            robot: the robot that carries it out; default: the one that the plan was made for. Seconds and metres
                stay as planned, so numbers change where its units of time and length are others.
            laps: how often a schedule that repeats is carried out.

        Raises:
            InputError: the schedule does not repeat, or is that of a measured vehicle, which cannot be simulated.
        """
        if laps != 1 and (self.lap is None or laps < 1):
            raise InputError(f"{laps} laps of a schedule that is carried out once; plan it with --loop, loop=True")
        planned = self.robot
        if isinstance(planned, MeasuredVehicle):
            raise InputError(f"{planned.name!r} is a measured vehicle; only robots can be simulated, see `swim`")
        schedule = Schedule(
            planned.group_values(),
            self.first_direction,
            np.tile(self.dwells, laps),
            self.start,
            planned.time_scale,
            planned.length_scale,
            self.identity,
        )
        return schedule if robot is None else schedule.swum_by(robot)

    def __repr__(self) -> str:
        path = f"{'closed path' if self.drawn.closed else 'path'} of {in_lab(self.drawn.length, self.robot)}"
        start, dwells, *further = self.lines()
        title = f"Plan for {self.robot.name!r}: {path}, {dwells}, motor {self.first_direction:+d} first"
        lines = [title, *(f"  {line}" for line in (start, *further))]
        if self.warnings:
            count = "1 warning" if len(self.warnings) == 1 else f"{len(self.warnings)} warnings, the first"
            lines.append(f"  {count}: {textwrap.shorten(self.warnings[0], 120, placeholder=' …')}")
        return "\n".join(lines)

    def quantities(self) -> list[tuple[str, str]]:
        """List start and errors; what there is to say of obstacles, laps and the job; and warnings."""
        robot, (x, y, heading) = self.robot, self.start
        errors = {"predicted error, rms": self.predicted_rms, "predicted error, largest": self.predicted_max}
        errors["stated error, open loop"] = self.stated_error
        if self.feedback_error < self.stated_error:
            errors["stated error, with feedback"] = self.feedback_error
        given = "" if self.tracked.calibrated else ", if the coefficients are exact"
        return [
            ("start, at rest", f"{place_in_lab(x, y, robot)}, heading {heading_in_degrees(heading)}"),
            *((name, f"{in_lab(error, robot)}{given}") for name, error in errors.items()),
            *(("otherwise", words) for words in filter(None, [self.unmeasured_words])),
            *(("besides", line) for line in self.conditions()),
            *(("warning", warning) for warning in self.warnings),
        ]

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the drawn, the declared and the predicted path, with the stated error, on axes in cm.

        Args:
            ax: default: axes of a new figure.
        """
        from planner.planning.picture import PREDICTED, draw_regions, draw_start, draw_tracks

        ax = given_axes(ax)
        length = self.robot.length_scale
        draw_tracks(ax, self.drawn.polyline(), self.reference, self.stated_error, length)
        points = 100 * length * self.smooth_track
        ax.plot(*points.T, color=PREDICTED, lw=0.8, label="predicted")
        draw_start(ax, self.start, 100 * length * self.reference, 100 * length)
        if self.kept_clear is not None:
            draw_regions(ax, self.kept_clear.free_space, length)
        if self.job is not None:
            self.job.draw(ax, self)
        return ax

    def lines(self) -> list[str]:
        """Say where the robot starts, how long the schedule is, its errors, and what it does for its job."""
        robot, (x, y, heading) = self.robot, self.start
        shortest, whole = (format_time(time * robot.time_scale) for time in (self.minimum_dwell, self.duration))
        lines = [
            f"start: put {self.tracked.origin} at {place_in_lab(x, y, robot)}, heading "
            f"{heading_in_degrees(heading)}, at rest",
            f"{len(self.dwells)} dwells of {shortest} ({self.minimum_dwell:.2f} time units) or more, {whole} "
            "in all",
            *self.error_line.splitlines(),
        ]
        return [*lines, *self.conditions()]

    def conditions(self) -> list[str]:
        """Say what the plan keeps clear of, how its laps differ, and what it does for its job."""
        error = "stated error with feedback" if self.request.feedback else "stated error"
        kept_clear = [] if self.kept_clear is None else self.kept_clear.lines(self.robot, error)
        lap = [] if self.lap is None else [self.lap.line(self.robot)]
        return [*kept_clear, *lap, *([] if self.job is None else self.job.lines(self))]

    def columns(self) -> dict[str, NDArray[Any]]:
        """Return the columns of `to_frame`, each (M,)."""
        x, y, heading = self.poses[:-1].T
        cm = 100 * self.robot.length_scale
        return {
            "start_s": self.flip_times[:-1] * self.robot.time_scale,
            "direction": self.first_direction * (-1) ** np.arange(len(self.dwells)),
            "dwell_s": self.seconds,
            "x_cm": x * cm,
            "y_cm": y * cm,
            "heading_deg": np.degrees(heading),
            "dwell_bar": self.dwells,
            "x_over_l": x,
            "y_over_l": y,
            "heading_rad": heading,
        }

    def to_frame(self) -> pd.DataFrame:
        """Tabulate the dwells: start, direction of the motor, length, and predicted pose at the start; M rows.

        Columns in lab units come first. x, y and heading are those of the head's centre.
        """
        import pandas as pd  # a plan is made without it

        return with_units(pd.DataFrame(self.columns()))

    def to_dict(self) -> dict[str, Any]:
        """Return the content of plan.json, which `softflagella.load_plan` reads.

        `id` is `identity`.
        """
        content = self._content()
        self.__dict__.setdefault("identity", plan_id(content))  # long paths take seconds to tabulate twice
        return {"id": self.identity, **content}

    @cached_property
    def identity(self) -> str:
        """The `id` of plan.json, a digest of all the rest. The other files of the plan have it, and its tracks."""
        return plan_id(self._content())

    def _content(self) -> dict[str, Any]:
        robot, (x, y, heading) = self.robot, self.start
        return {
            "format": FORMAT,
            "robot": {
                "name": robot.name,
                **(
                    {"vehicle": robot.to_dict(), "tail_length_m": robot.length_scale}
                    if isinstance(robot, MeasuredVehicle)
                    else {
                        "groups": robot.group_values(),
                        "tail_length_m": robot.length_scale,
                        "motor_speed_rad_s": robot.motor_speed,
                    }
                ),
                "time_scale_s": robot.time_scale,
            },
            "point": self.tracked.point,
            "offset_over_l": self.tracked.offset,
            "first_direction": self.first_direction,
            "start": {"x_over_l": x, "y_over_l": y, "heading_rad": heading},
            # Readers go by these names; `FORMAT` counts their changes.
            "dwell_bar": self.dwells.tolist(),
            "dwell_s": self.seconds.tolist(),
            "predicted_poses": self.poses.tolist(),
            "reference": self.reference.tolist(),
            "raw_path": self.drawn.polyline().tolist(),
            "closed": self.drawn.closed,
            "objective": self.request.objective,
            "minimum_dwell_bar": self.minimum_dwell,
            "off_drawn_over_l": self.declared.off_drawn,
            "missed_over_l": self.declared.missed,
            "zigzag_rms_over_l": self.straight.rms,
            GUARANTEE: self.errors.guaranteed,
            "stated_error_over_l": self.errors.stated,
            "stated_error_unmeasured_over_l": self.unmeasured_error,
            "table_share": self.errors.table_share,
            "feedback_error_over_l": self.feedback_error,
            "camera": self.request.camera.to_dict(),
            "predicted_rms_over_l": self.errors.predicted_rms,
            "predicted_max_over_l": self.errors.predicted_max,
            "drawn_rms_over_l": self.errors.drawn_rms,
            "drawn_max_over_l": self.errors.drawn_max,
            "closure_over_l": self.errors.closure,
            "guidance": {
                "heading_rad": self.declared.reference.heading.tolist(),
                "look_ahead_over_l": self.guidance.ahead,
                "swing_rad": self.guidance.swing,
                "straight": self.straight.to_dict(),
            },
            "model": self.tracked.model,
            "own_table": self.tracked.own_table,
            "warnings": list(self.warnings),
            **({} if self.tracked.knowledge.empty else {"calibration": self.tracked.knowledge.to_dict()}),
            **({} if self.kept_clear is None else {"kept_clear": self.kept_clear.to_dict()}),
            **({} if self.lap is None else {"lap": self.lap.to_dict()}),
        }
