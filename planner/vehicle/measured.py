"""A vehicle without a robot: five numbers that a laboratory measures of its own swimmer, needle or car.

The vehicle turns left or right, nothing else. In each direction its point moves at a constant speed v on a circle,
at an angle, the slip β, from its heading to the inside of the turn: as the front of a car whose rear axle, the
pivot, does not slide. After a flip its twist relaxes to that of the new direction with a time constant τ:

    twist(t) = twist_σ + (twist_0 − twist_σ) exp(−t/τ),    twist_σ = (v cos β, σ v sin β, σ Ω_σ).

twist_0 is what the dwell before left: a dwell of length S within a straight zigzag of such dwells, from rest none.

Here, l is the mean radius of the two circles, and the unit of time is the longer of 10 τ and the time in which the
vehicle turns by a quarter of a radian: dwells shorter than a fifth of it are not planned. Source: ours; for τ = 0
the bicycle of R. J. Webster et al., Int. J. Robot. Res. 25 (2006) 509, in the plane.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from numbers import Real
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from common.arrays import Floats
from common.changes import RobotSource, changed, changes_of
from common.errors import InputError, naming
from common.reading import read_toml
from common.units import UNITS, of_kind, split, to_si
from planner.vehicle.vehicle import BEFORE_KNOTS, STEP, TIMES, Mode, Vehicle
from sim.inputs import describes_vehicle
from sim.mechanics import planar

Measured = float | tuple[float, float]  # a value, and its standard deviation where it is known
_TURN = 0.25  # rad in the unit of time, where the vehicle has no lag
_LAGS = 10.0  # time constants in the unit of time, at least
_SLOWEST = 1e-5  # rad/s
_POINT = 0.01  # l, radius of a body without a size
_SUBSTEPS = 10  # of a step of TIMES, for the integral of the motion
_LINES = {  # of a vehicle.toml, with the unit that messages propose
    "speed": "cm_s", "turn_left": "deg_s", "turn_right": "deg_s", "slip": "deg", "lag": "s",
    "length": "cm", "width": "cm",
}  # fmt: skip
EXAMPLE = """\
name = "buggy"
speed_cm_s = [25, 0.5]         # of the tracked point on its circle: [value, standard deviation]
turn_left_deg_s = [40, 1]
turn_right_deg_s = [35, 1]
# slip_deg = [0, 1]            # from the heading to the velocity, towards the inside of the turn
lag_s = 0.2                    # until 63 % of a change have passed; a number alone is exact
# length_cm = 30               # of the body, about the tracked point
# width_cm = 18
"""
_NEEDED = ("speed", "turn_left", "turn_right")
_SPREADS = (*_NEEDED, "slip", "lag")


@dataclass(frozen=True, kw_only=True)
class MeasuredVehicle:
    """Speed, turning and lag of a vehicle with one switch, each as a value or as (value, standard deviation).

    Args:
        speed: of the point that is tracked, along its circle [m/s].
        turn_left: yaw rate, above 0 [rad/s].
        turn_right: yaw rate, above 0 [rad/s].
        slip: angle from the heading to the velocity, to the inside of the turn [rad].
        lag: time constant with which the motion follows a flip [s].
        name: in texts and files.
        length: of the body, for what it must keep clear of; the tracked point is its middle [m].
        width: of the body [m].

    Raises:
        InputError: a number is not finite or out of its range.

    Example:
        >>> import softflagella as sf
        >>> needle = sf.Vehicle(speed=(0.005, 1e-4), turn_left=(0.0225, 0.001), turn_right=(0.0225, 0.001))
        >>> result = sf.plan("circle:1m", needle)
        >>> result.stated_error > result.predicted_max
        True
    """

    speed: Measured
    turn_left: Measured
    turn_right: Measured
    slip: Measured = 0.0
    lag: Measured = 0.0
    name: str = "vehicle"
    length: float = 0.0
    width: float = 0.0

    MODEL: ClassVar[str] = "measured"  # in place of a look-up table's identity

    def __post_init__(self) -> None:
        if not isinstance(self.name, str):
            raise InputError(f"name = {self.name!r}; give a text")
        for name in (*_SPREADS, "length", "width"):
            given = getattr(self, name)
            pair = given if isinstance(given, tuple | list) and name in _SPREADS else [given]
            if len(pair) > 2 or not all(isinstance(each, Real) and not isinstance(each, bool) for each in pair):
                also = ", or (value, standard deviation)" if name in _SPREADS else ""
                raise InputError(f"{name} = {given!r}; give a number{also}")
        for name in _SPREADS:
            value, spread = self.measured(name)
            if not (math.isfinite(value) and 0 <= spread < math.inf):
                raise InputError(f"{name} = {value:g} ± {spread:g}; give finite numbers, the second not below 0")
            if name in _NEEDED and value - 3 * spread <= 0:
                raise InputError(
                    f"{name} = {value:g} ± {spread:g}; give a number above 0 by three standard deviations"
                )
        for name in _NEEDED[1:]:
            rate = self.measured(name)[0]
            if rate < _SLOWEST:
                raise InputError(f"{name} = {rate:g} rad/s; give {_SLOWEST:g}, a turn in a week, or more")
        if not 0 <= self.measured("slip")[0] < math.pi / 2:
            raise InputError(
                "slip: give an angle from 0 up to 90 degrees, to the inside of the turn; where the point slides "
                "outwards, track one that is further ahead"
            )
        if self.measured("lag")[0] < 0 or not all(0 <= size < math.inf for size in (self.length, self.width)):
            raise InputError("lag, length and width: give finite numbers, not below 0")

    def measured(self, name: str) -> tuple[float, float]:
        """Return a number and its standard deviation; 0 where none is given."""
        given = getattr(self, name)
        value, spread = given if isinstance(given, tuple | list) else (given, 0.0)
        return float(value), float(spread)

    @property
    def length_scale(self) -> float:
        """l, the mean radius of the two circles [m]."""
        return self._values[0] * sum(1 / rate for rate in self._values[1:3]) / 2

    @property
    def time_scale(self) -> float:
        """The unit of time [s]."""
        return max(_LAGS * self._values[4], _TURN / max(self._values[1:3]))

    @property
    def outline(self) -> tuple[float, float, float]:
        """Front and back of the body, forward from its point, and half of the width [l]; never quite a point."""
        half = self.length / 2 / self.length_scale
        return half, -half, max(self.width / 2 / self.length_scale, _POINT)

    @cached_property
    def _values(self) -> Floats:
        """The five numbers in SI units."""
        return np.array([self.measured(name)[0] for name in _SPREADS])

    def motion(self) -> Vehicle:
        """Return twists, lags and what is uncertain, as the planner knows them [l, time units]."""
        values, spreads = self._values, [self.measured(name)[1] for name in _SPREADS]
        twist, lag, rest = self._motion(values)
        modes = []
        for index, spread in enumerate(spreads):
            if spread > 0:
                above, below = values.copy(), values.copy()
                above[index] += spread
                below[index] = (
                    max(below[index] - spread, 0.0) if _SPREADS[index] == "lag" else below[index] - spread
                )
                share = spread / (above[index] - below[index])
                (up, up_lag, _), (down, down_lag, _) = self._motion(above), self._motion(below)
                modes.append(Mode(_SPREADS[index], share * (up - down), share * (up_lag - down_lag)))
        return Vehicle(twist=twist, lag=lag, rest=rest, spread=np.zeros_like(rest), modes=tuple(modes))

    def _motion(self, values: Floats) -> tuple[Floats, Floats, Floats]:
        """Compute twists (2, 3), lags (2, K, T, 3) and lags from rest (2, T, 3) for five numbers."""
        speed, left, right, slip, lag = values.tolist()
        length, time = self.length_scale, self.time_scale
        ahead, across = speed * math.cos(slip) / length, speed * math.sin(slip) / length
        twist = time * np.array([[ahead, across, left], [ahead, -across, -right]])
        decay = np.exp(-BEFORE_KNOTS * time / lag) if lag > 0 else np.zeros_like(BEFORE_KNOTS)
        left_over = (decay / (1 + decay))[:, None]  # of the own twist, after a dwell in the other direction
        before = twist[::-1, None] + left_over * (twist - twist[::-1])[:, None]
        lags = _relaxation(before, twist[:, None], lag / time)
        return twist, lags, _relaxation(np.zeros((2, 3)), twist, lag / time)

    @staticmethod
    def is_in(path: RobotSource) -> bool:
        """Tell whether a TOML file describes a vehicle."""
        file = Path(path)
        return file.suffix == ".toml" and file.is_file() and describes_vehicle(read_toml(file))

    @staticmethod
    def load(path: RobotSource) -> MeasuredVehicle:
        """Read a vehicle.toml: keys with units, each a number or [number, standard deviation].

        Raises:
            InputError: the file does not describe a vehicle; the message names the key.
        """
        content = changed(read_toml(Path(path)), changes_of(path))
        with naming(path):
            return MeasuredVehicle.from_dict({"name": Path(path).stem, **content})

    @staticmethod
    def from_dict(content: Mapping[str, Any]) -> MeasuredVehicle:
        """Make a vehicle of the content of a vehicle.toml.

        Raises:
            InputError: a key is missing or unknown, or a number is not one.
        """
        values = {"name": str(content.get("name", "vehicle"))} | dict(_in_si(content))
        for name in _NEEDED:
            if name not in values:
                raise InputError(f"no {name}; write a line {name}_{_LINES[name]} = [value, standard deviation]")
        return MeasuredVehicle(**values)

    def to_dict(self) -> dict[str, Any]:
        """Return the content of a vehicle.toml, in SI units."""
        numbers = {
            f"{name}_{of_kind(UNITS[_LINES[name]].kind)[0]}": list(self.measured(name)) for name in _SPREADS
        }
        return {"name": self.name, **numbers, "length_m": self.length, "width_m": self.width}


def _in_si(content: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """Convert the lines of a vehicle.toml to arguments in SI units."""
    for key, given in content.items():
        if key == "name":
            continue
        quantity, unit = split(key)
        if quantity not in _LINES or unit is None or unit.kind != UNITS[_LINES[quantity]].kind:
            known = ", ".join(f"{name}_{lab}" for name, lab in _LINES.items())
            raise InputError(f"{key} is no line of a vehicle; allowed are {known}, in any unit, and name")
        pair = given if isinstance(given, list) and len(given) == 2 and quantity in _SPREADS else [given]
        if not all(isinstance(number, int | float) and not isinstance(number, bool) for number in pair):
            raise InputError(f"{key} = {given!r}; write a number, or [value, standard deviation]")
        si = [to_si(float(number), unit.suffix) for number in pair]
        yield quantity, si[0] if len(si) == 1 else tuple(si)


def _relaxation(start: Floats, end: Floats, lag: float) -> Floats:
    """Compute lags (..., T, 3) at TIMES after a twist `start` (..., 3) that relaxes to `end` (..., 3).

    The motion is the lag, and then the arc of `end`.
    """
    if lag <= 0:
        return np.zeros((*start.shape[:-1], len(TIMES), 3))
    from scipy.integrate import cumulative_simpson  # slow to import, and only a lag needs it

    end = np.broadcast_to(end, start.shape)
    time = np.linspace(0.0, TIMES[-1], _SUBSTEPS * (len(TIMES) - 1) + 1)
    rate = (start - end)[..., None, :]
    heading = end[..., None, 2] * time + rate[..., 2] * lag * -np.expm1(-time / lag)
    twist = end[..., None, :] + rate * np.exp(-time / lag)[:, None]
    velocity = planar.turn(twist[..., :2], heading)
    place = cumulative_simpson(velocity, dx=STEP / _SUBSTEPS, axis=-2, initial=0.0)
    motion = np.concatenate([place, heading[..., None]], -1)[..., ::_SUBSTEPS, :]
    return planar.compose(motion, planar.inverse(planar.arc(end[..., None, :], TIMES)))
