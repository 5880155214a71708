"""A robot kept on its path live: a camera over the tank, the tracker, and the motor's board on a serial port.

A thread takes the pictures and finds the robot in them (`camera.detector`). The loop waits for the next pose, for
the announced flip, or for REPEAT, whichever comes first, and then tells the board the direction:

    F   forward          B   reverse          S   stop          each with a line feed, ASCII, 115200 baud

The board stops the motor itself when no byte has come for WATCHDOG. The first and the last order are S, however
the program ends: the path's end, the film's, an error, Ctrl-C, SIGTERM or SIGHUP.

A pose is true when its picture came from the camera, less the camera's latency, which nothing here can measure. So
the tracker knows the delay of the detector. It does not know a motor that rests: where the robot has not been seen
for a time, or the loop was held up until the board stopped the motor, the motor rests, and the tracker begins anew
where the robot is seen next.

Poses in l and rad, times in seconds from the beginning.
"""

from __future__ import annotations

import math
import signal
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from common.errors import InputError
from sim.mechanics.planar import POSE
from tracking.tracker import Tracker

if TYPE_CHECKING:
    from camera.view import View

REPEAT = 0.2  # s between two orders, at most
WATCHDOG = 1.0  # s without a byte after which the board stops the motor
FROZEN = 40  # pictures without any change, after which they count as none
RESET = 2.0  # s in which a board that resets as its port is opened gets ready
_ORDERS = {1: b"F\n", -1: b"B\n", 0: b"S\n"}


class Sight(NamedTuple):
    """A picture's time, and the pose that is seen in it."""

    time: float
    pose: POSE | None
    why: str = ""  # a picture shows no pose

    @property
    def is_picture(self) -> bool:
        """Whether there is a picture."""
        return self.pose is not None or bool(self.why)


Clock = Callable[[], float]  # -> time since the beginning [s]
Sights = Callable[[Clock], Iterator[Sight]]


class Motor:
    """A board on a serial port that turns the motor; it stops at the end of a `with` block.

    Args:
        port: such as /dev/ttyACM0; None: there is no board.

    Raises:
        InputError: pyserial is missing, the port cannot be opened, or the board has gone.
    """

    def __init__(self, port: str | None):
        self._port, self._board = port, None
        if port is None:
            return
        try:
            import serial

            self._board = serial.Serial(port, 115200, write_timeout=WATCHDOG, exclusive=True)
        except ImportError:
            raise InputError("--serial needs pyserial: pip install 'softflagella[camera]'") from None
        except (OSError, ValueError) as refusal:
            raise InputError(f"--serial {port}: {refusal}; name the board's port") from None
        time.sleep(RESET)
        self.turn(0)

    def turn(self, direction: int) -> None:
        """Order a direction: 1, −1, or 0 to stop."""
        try:
            if self._board is not None:
                self._board.write(_ORDERS[direction])
        except OSError as refusal:
            raise InputError(f"{self._port}: the board has gone ({refusal}); it stops the motor itself") from None

    def __enter__(self) -> Motor:
        return self

    def __exit__(self, *error: object) -> None:
        self.turn(0)
        if self._board is not None:
            self._board.close()  # when all has been sent


class Pictures:
    """What a camera sees, looked at in a thread, and the time.

    Args:
        sights: yields it, given a function that tells the time; it ends with a `with` block.
    """

    def __init__(self, sights: Sights):
        self._began = time.monotonic()
        self._sights = sights(self.now)
        self._look()

    def __enter__(self) -> Pictures:
        return self

    def __exit__(self, *error: object) -> None:
        self._thread.join(WATCHDOG)

    def now(self) -> float:
        """Return the time since the beginning [s]."""
        return time.monotonic() - self._began

    def get(self, timeout: float) -> Sight | None:
        """Wait for the next sight; None: the film is over; TimeoutError after the time-out."""
        sight = self._next.result(timeout)
        self._look()
        return sight

    def _look(self) -> None:
        """Begin to look for the next sight; the program does not wait at its end for a camera that hangs."""
        self._next = seen = Future[Sight | None]()

        def look() -> None:
            try:
                seen.set_result(next(self._sights, None))
            except BaseException as error:
                seen.set_exception(error)

        self._thread = threading.Thread(target=look, daemon=True)
        self._thread.start()


@dataclass
class Ride:
    """What has happened."""

    pictures: int = 0
    delays: list[float] = field(default_factory=list)  # from a picture with the robot to the order after it [s]
    late: list[float] = field(default_factory=list)  # from an announced flip to its order [s]
    rests: int = 0  # of the motor before the end
    alarms: int = 0
    missing: str = "no picture"  # why the robot was not seen the last time
    finished: bool = False

    def line(self) -> str:
        """Say it in a sentence."""
        if not self.delays:
            return f"the robot was never seen in {self.pictures} pictures ({self.missing}); the motor rested"
        delays, late = sorted(self.delays), max(self.late, default=0.0)
        return (
            f"the path has {'ended' if self.finished else 'not ended'}; the robot seen in {len(self.delays)} of "
            f"{self.pictures} pictures, lost {self.rests} times, {self.alarms} alarms; from picture to order "
            f"{1e3 * delays[len(delays) // 2]:.0f} ms, {1e3 * delays[-1]:.0f} ms at most; {len(self.late)} flips, "
            f"{1e3 * late:.0f} ms late at most"
        )


def steer(
    ride: Ride,
    pictures: Pictures,
    motor: Motor,
    begin: Callable[[POSE, float], Tracker],
    unit: float,
    *,
    lost: float,
    row: Callable[[Sight, int, float, bool, float], object],
    tell: Callable[[str], object],
    stopped: Callable[[], bool] = lambda: False,
) -> None:
    """Steer until the path or the film ends, or until somebody stops it.

    Args:
        ride: gets what happens.
        pictures: what the camera sees.
        motor: carries out the orders.
        begin: makes a tracker that begins at rest at a pose and a time [μ0 l⁴/EI].
        unit: of the tracker's time [s].
        lost: time without a pose after which the motor rests [s].
        row: is given each sight, one without a pose where none has come, the direction of the motor at its time,
            the tracker's bound on the error [l], its alarm, and the time until the next flip [s].
        tell: is given what the user should know at once.
        stopped: whether the motor is to stop now.

    Raises:
        InputError: the board or the camera has gone.
    """
    tracker: Tracker | None = None
    direction, flip_at, error, alarm, waiting = 0, math.inf, math.nan, False, True
    seen_at = ordered_at = turned_at = pictures.now()
    earlier = 0  # direction before `turned_at`
    while not ride.finished and not stopped():
        # Wait for a picture, but no longer than until the next flip, or until the board needs a sign of life.
        try:
            sight = pictures.get(max(min(ordered_at + REPEAT, flip_at) - pictures.now(), 0.0))
        except TimeoutError:
            sight = Sight(pictures.now(), None)
        if sight is None:
            break
        now = pictures.now()
        seen_at = seen_at if sight.pose is None else sight.time
        ride.missing = sight.why or ride.missing
        held_up, before = now - ordered_at >= WATCHDOG, direction
        # After a pause the pose is unknown: rest, and begin again at the first pose that is seen.
        if tracker is not None and (held_up or now - seen_at > lost):
            why = "the program was held up" if held_up else f"no robot for {lost:g} s ({ride.missing})"
            tell(f"{why}; the motor rests until the robot is seen")
            tracker, direction, flip_at, error, alarm = None, 0, math.inf, math.nan, False
            ride.rests += 1
        elif tracker is not None or sight.pose is not None:
            due = flip_at
            if tracker is not None:
                command = tracker.update(now / unit, sight.pose, sight.time / unit)
            elif sight.pose is not None:
                tracker = begin(sight.pose, now / unit)
                command = tracker.command
            direction, flip_at, error = command.direction, command.flip_at * unit, command.error
            if command.alarm and not alarm:
                tell(f"alarm at {now:.1f} s: the robot does not swim as planned, or does not move; see to it")
                ride.alarms += 1
            alarm, waiting = command.alarm, False
            ride.finished = command.finished
            ride.late += [max(now - due, 0.0)] * (direction == -before != 0)
        elif waiting and now - seen_at > lost:
            tell(f"no robot for {lost:g} s from the start ({ride.missing}); the motor rests until it is seen")
            waiting = False
        motor.turn(0 if stopped() else direction)
        ordered_at = now
        if direction != before:
            turned_at, earlier = now, before
        if sight.is_picture:
            ride.pictures += 1
            ride.delays += [pictures.now() - sight.time] * (sight.pose is not None)
        # A picture is older than the order that follows it.
        row(sight, direction if sight.time >= turned_at else earlier, error, alarm, flip_at - now)
    motor.turn(0)


def watch(
    source: str, view: str, robot: str, length: float, latency: float,
    see: Callable[[Any, View], object] = lambda picture, view: None,
) -> Sights:  # fmt: skip
    """Open a camera, or a film, and return what yields its sights; a film keeps its own pace.

    Args:
        source: number or device of a camera, or a film.
        view: the file view.toml, with scale and markers.
        robot: whose markers are looked for, if there are several.
        length: of a tail [m].
        latency: of the camera [s].
        see: is given each picture, once the robot was looked for in it, and the view.

    Raises:
        InputError: OpenCV is missing, camera, film or file cannot be read, or, later, the camera has gone.
    """
    from camera.detector import Detector, Lost
    from camera.view import opencv, read_setup

    setup, cv = read_setup(view), opencv()
    marked = [each for each in setup.robots if each.name == robot] or setup.robots
    if len(marked) > 1:
        names = ", ".join(each.name for each in marked)
        raise InputError(f"{view}: several robots, {names}; call the one that swims {robot!r}, as the plan does")
    detector = Detector(marked, setup.view)
    live = source.isdecimal() or source.startswith("/dev/")
    try:
        device: Any = cv.VideoCapture(int(source) if live and source.isdecimal() else source)
    except (cv.error, OverflowError, SystemError) as refusal:
        raise InputError(f"--camera {source}: no such camera") from refusal
    if not device.isOpened():
        raise InputError(f"--camera {source}: no such {'camera, or another program has it' if live else 'film'}")
    device.set(cv.CAP_PROP_BUFFERSIZE, 1)  # the latest picture, not one that has waited

    def sights(now: Clock) -> Iterator[Sight]:
        began, before, same = now(), None, 0
        while device.grab():
            if not live:
                time.sleep(max(began + device.get(cv.CAP_PROP_POS_MSEC) / 1e3 - now(), 0.0))
            taken = now() - latency
            good, picture = device.retrieve()
            same = same + 1 if good and before is not None and np.array_equal(picture, before) else 0
            before = picture if good else before
            (seen,) = detector.poses(picture) if good else (Lost(robot, "a damaged picture"),)
            if good:
                see(picture, detector.view)
            if same >= FROZEN:
                seen = Lost(robot, f"the last {same} pictures are the same one: is the camera frozen?")
            if isinstance(seen, Lost):
                yield Sight(taken, None, seen.why)
            else:
                yield Sight(taken, (seen.x / length, seen.y / length, seen.heading))
        if live:
            raise InputError(f"--camera {source}: no picture comes any more; check its cable")

    return sights


@contextmanager
def ending_on_signals() -> Iterator[None]:
    """Let SIGTERM and SIGHUP end a program as Ctrl-C does, so that the motor stops."""

    def end(number: int, frame: object) -> None:
        stop = KeyboardInterrupt(f"ended by {signal.Signals(number).name}")
        stop.status = 128 + number  # type: ignore[attr-defined]
        raise stop

    before = {each: signal.signal(each, end) for each in (signal.SIGTERM, signal.SIGHUP)}
    try:
        yield
    finally:
        for each, handler in before.items():
            signal.signal(each, handler)
