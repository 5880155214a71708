"""Live tracking: a simulated tank in the loop, a pseudo-terminal for the board, a film for the camera."""

from __future__ import annotations

import io
import os
import re
import signal
import subprocess
import sys
import time
import tty
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from common.errors import InputError
from common.tables import read_table
from planner.files.plan_files import write_plan
from planner.paths.distance import distance_to
from sim.mechanics.planar import POSE
from tests.planner.plans import planned
from tests.processes import LIMIT, ROOT
from tracking import live
from tracking.__main__ import main
from tracking.live import REPEAT, Clock, Motor, Pictures, Ride, Sight, steer
from tracking.swim import SteppedSwimmer
from tracking.tracker import Tracker
from tracking.tracks import poses_of

UNIT = planned().robot.time_scale
DELAY = 0.12  # s, from a picture to its pose
LOST = 3.0
LINE = planned(((0.7, 1.0), (2.2, 1.0)))


class FilmedTank(Pictures, Motor):
    """A simulated robot under a camera that sees it twice a second, and its motor; nothing waits for the time."""

    def __init__(self, blind: tuple[float, float] = (0.0, 0.0), held_up: float = np.inf, over: float = np.inf):
        self.blind, self.held_up, self.over = blind, held_up, over
        self.plan, self.time, self.next = planned(), 0.0, 0.5
        self.pose = np.add(self.plan.start, (0.1, -0.05, 0.2))
        self.swimmer: SteppedSwimmer | None = None
        self.direction, self.rng = 0, np.random.default_rng(0)
        self.sights: list[Sight] = []
        self.orders: list[tuple[float, int]] = []
        self.poses: list[np.ndarray] = []

    def now(self) -> float:
        return self.time

    def get(self, timeout: float) -> Sight | None:
        end = self.time + timeout
        if self.time > self.held_up:
            self.held_up = np.inf
            self._swim_until(self.time + 1.5)
        while True:
            delivery = self.sights[0].time + DELAY if self.sights else np.inf
            if min(self.next, delivery) > end:
                self._swim_until(end)
                raise TimeoutError
            self._swim_until(min(self.next, delivery))
            if delivery <= self.next:
                return self.sights.pop(0)
            if self.time > self.over:
                return None
            self.sights.append(Sight(self.time, None, "dark"))
            if not self.blind[0] < self.time < self.blind[1]:
                x, y, heading = (self.pose + 0.005 * self.rng.normal(size=3)).tolist()
                self.sights[-1] = Sight(self.time, (x, y, heading))
            self.next += 0.5

    def turn(self, direction: int) -> None:
        self.orders.append((self.time, direction))
        if direction == 0:
            self.swimmer = None
        elif self.swimmer is None:
            self.swimmer = SteppedSwimmer(self.plan.tracked.vehicle, self.plan, direction, self.pose, (0.0, 0.0))
        elif direction != self.direction:
            self.swimmer.flip()
        self.direction = direction

    def _swim_until(self, end: float) -> None:
        if self.swimmer is not None and end > self.time:
            self.pose = self.swimmer.go((end - self.time) / UNIT)[1][-1]
        self.time = max(end, self.time)
        self.poses.append(self.pose)


def begin(pose: POSE | None, now: float) -> Tracker:
    return Tracker(planned(), begin=now, start=pose, noise=(0.005, 0.005))


def steered(tank: FilmedTank) -> tuple[Ride, list[str]]:
    ride, told = Ride(), list[str]()
    steer(ride, tank, tank, begin, UNIT, lost=LOST, row=lambda *row: None, tell=told.append)
    assert tank.orders[-1][1] == 0
    return ride, told


@pytest.mark.slow
def test_the_robot_is_kept_on_the_path() -> None:
    tank = FilmedTank()
    ride, told = steered(tank)
    assert ride.finished
    assert told == []
    followed = np.array(tank.poses)[len(tank.poses) // 10 :, :2]
    assert np.sqrt(np.mean(distance_to(planned().reference, followed) ** 2)) < planned().feedback_error
    times = np.array([when for when, _ in tank.orders])
    assert np.diff(times).max() < REPEAT + 1e-6  # the board's watchdog is fed
    assert ride.delays == pytest.approx([DELAY] * len(ride.delays))
    assert max(ride.late) < DELAY
    assert f"from picture to order {1e3 * DELAY:.0f} ms" in ride.line()


def test_the_motor_rests_while_the_robot_is_not_seen() -> None:
    tank = FilmedTank(blind=(20.0, 40.0), over=60.0)
    ride, told = steered(tank)
    resting = [when for when, direction in tank.orders if direction == 0 and 1.0 < when < 60]
    assert 20 + LOST - 1 < min(resting) < 20 + LOST + 0.5
    assert 40 - 1 < max(resting) < 40 + 1
    assert ride.rests == 1
    assert told == ["no robot for 3 s (dark); the motor rests until the robot is seen"]


def test_the_tracker_begins_anew_where_the_board_has_stopped_the_motor() -> None:
    tank = FilmedTank(held_up=30.0, over=60.0)
    ride, told = steered(tank)
    assert ride.rests == 1
    assert {direction for when, direction in tank.orders if 40 < when < 60} == {1, -1}
    assert told == ["the program was held up; the motor rests until the robot is seen"]


def test_the_motor_stops_where_the_film_ends() -> None:
    tank = FilmedTank(over=20.0)
    ride, _ = steered(tank)
    assert not ride.finished
    assert tank.time < 21


def test_an_alarm_is_told_once_and_stands_in_the_track() -> None:
    """The robot hangs on something: it is seen, always in the same place."""
    tank, told, rows = FilmedTank(over=80.0), list[str](), list[tuple[object, ...]]()
    tank._swim_until = lambda end: setattr(tank, "time", max(end, tank.time))  # type: ignore[method-assign]
    ride = Ride()
    steer(ride, tank, tank, begin, UNIT, lost=LOST, row=lambda *row: rows.append(row), tell=told.append)
    assert [line.split(" at ")[0] for line in told] == ["alarm"]
    assert ride.alarms == 1
    assert not rows[0][3]
    assert rows[-1][3]


def test_the_track_has_the_direction_at_the_time_of_each_picture() -> None:
    """A picture is older than the order that follows it."""
    tank, rows = FilmedTank(blind=(20.0, 40.0), over=60.0), list[tuple[Sight, int]]()
    row = lambda sight, direction, *_: rows.append((sight, direction))  # noqa: E731
    steer(Ride(), tank, tank, begin, UNIT, lost=LOST, row=row, tell=print)
    when, ordered = np.array(tank.orders).T
    pictures = [each for each in rows if each[0].is_picture]
    times, directions = np.array([sight.time for sight, _ in pictures]), np.array([each for _, each in pictures])
    assert np.diff(times) == pytest.approx(0.5)
    assert (directions == ordered[np.searchsorted(when, times, side="right") - 1])[1:].all()
    assert set(directions) == {-1, 0, 1}
    assert directions[0] == 0


def test_an_alarm_ends_with_the_way_to_the_calibration(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """Live and on the pipe; pictures without a pose are part of the track."""
    path = str(write_plan(LINE, tmp_path)[0])
    line = "find out what the model lacks: softflagella calibrate track.csv --robot paper-control --out calibrated"

    def steered_by(alarms: int) -> list[str]:
        def steer_by(ride: Ride, *_: object, row: Callable[..., object], **__: object) -> None:
            ride.pictures, ride.alarms = 1, alarms
            row(Sight(1.0, None, "dark"), 0, np.nan, False, np.inf)
            row(Sight(1.5, (0.7, 1.0, 0.0)), 1, 0.02, False, 1.0)
            row(Sight(2.0, None, "dark"), 1, 0.02, True, 1.0)
            row(Sight(2.2, None), 1, 0.02, True, 1.0)

        monkeypatch.setattr(live, "steer", steer_by)
        main(["track", path, "--camera", "0", "--view", "view.toml"])
        told = capfd.readouterr()
        (tmp_path / "track.csv").write_text(told.out)
        return told.err.splitlines()

    monkeypatch.setattr(live, "watch", lambda *_: lambda now: iter(()))
    assert line not in steered_by(0)
    assert steered_by(1)[-1] == line
    table = read_table(tmp_path / "track.csv")
    assert table["direction"].tolist() == [0, 1, 1]
    assert table["x_cm"].isna().tolist() == [True, False, True]
    times, poses = poses_of(table, LINE.to_dict()["robot"])
    assert (len(times), poses[0, :2]) == (1, pytest.approx([0.7, 1.0], abs=1e-4))
    away = "".join(f"{time} 90 90 2\n" for time in range(30))
    for lines, last in ((f"0 0.7 1.0 0\n{away}", True), ("0 0.7 1.0 0\n1\n", False)):
        monkeypatch.setattr("sys.stdin", io.StringIO(lines))
        main(["track", path])
        assert (line in capfd.readouterr().err) == last


def test_a_motor_that_rests_is_told_of_without_a_picture_and_a_stop_comes_at_once() -> None:
    tank, told = FilmedTank(), list[tuple[float, int]]()
    tank.next = np.inf  # the camera hangs
    tank.sights = [Sight(0.0, tuple(tank.pose.tolist()))]
    row = lambda *row: told.append((tank.time, row[1]))  # noqa: E731
    steer(Ride(), tank, tank, begin, UNIT, lost=LOST, row=row, tell=print, stopped=lambda: tank.time > 5.0)
    assert [direction != 0 for _, direction in told[:2]] == [False, True]  # the picture is older than the order
    assert min(when for when, direction in told if direction == 0) < LOST + 2 * REPEAT
    assert tank.time < 5.0 + 2 * REPEAT
    assert tank.orders[-1] == (tank.time, 0)


def test_a_stop_while_the_way_is_planned_moves_nothing() -> None:
    tank, stops = FilmedTank(), list[str]()

    def stopped_while_planning(pose: POSE | None, now: float) -> Tracker:
        stops.append("pressed")
        return begin(pose, now)

    steer(Ride(), tank, tank, stopped_while_planning, UNIT, lost=LOST, row=lambda *row: None, tell=print,
          stopped=lambda: bool(stops))  # fmt: skip
    assert {direction for _, direction in tank.orders} == {0}


def test_a_robot_that_was_never_seen_is_said_to_be() -> None:
    ride, told = steered(FilmedTank(blind=(0.0, 99.0), over=20.0))
    assert told == ["no robot for 3 s from the start (dark); the motor rests until it is seen"]
    assert re.fullmatch(r"the robot was never seen in \d+ pictures \(dark\); the motor rested", ride.line())


def pseudo_terminal() -> tuple[int, str]:
    """Open a pseudo-terminal; return its master and the name of its port."""
    master, slave = os.openpty()
    tty.setraw(slave)
    return master, os.ttyname(slave)


def sent(master: int) -> bytes:
    """Read what has been written to the port so far."""
    os.set_blocking(master, False)
    text = b""
    try:
        while part := os.read(master, 65536):
            text += part
    except OSError:
        pass
    return text


def test_each_order_is_a_line_and_the_last_one_is_stop(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("serial", reason="needs the extra camera")
    monkeypatch.setattr(live, "RESET", 0.0)
    master, port = pseudo_terminal()
    with pytest.raises(ZeroDivisionError), Motor(port) as motor:  # noqa: PT012
        motor.turn(1)
        motor.turn(-1)
        motor.turn(1 // 0)
    assert sent(master) == b"S\nF\nB\nS\n"
    with pytest.raises(InputError, match=r"--serial /dev/none: .*; name the board's port"):
        Motor("/dev/none")


def test_what_a_camera_raises_comes_out_of_the_loop() -> None:
    def gone(now: Clock) -> Iterator[Sight]:
        yield Sight(now(), None, "a damaged picture")
        raise InputError("no picture comes any more")

    ride, pictures = Ride(), Pictures(gone)
    with pytest.raises(InputError, match="no picture comes any more"):
        steer(ride, pictures, FilmedTank(), begin, UNIT, lost=LOST, row=print, tell=print)
    assert ride.pictures == 1


def test_the_program_ends_where_a_camera_hangs() -> None:
    code = (
        "import threading\nfrom tracking.live import Pictures\n"
        "with Pictures(lambda now: iter(threading.Event().wait, 0)) as pictures:\n    pictures.get(0.01)\n"
    )
    words = [sys.executable, "-c", code]
    ended = subprocess.run(words, capture_output=True, text=True, timeout=LIMIT, cwd=ROOT)
    assert ended.stderr.splitlines()[-1] == "TimeoutError"


def test_cameras_that_fail_and_robots_that_are_not_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A camera that compresses its pictures sends one now and then that cannot be decoded; it shows no robot."""
    cv2 = pytest.importorskip("cv2", reason="needs the extra camera")
    from tests.oracles import tank

    class Damaged:
        def __init__(self, source: str):
            self.left = 2

        def grab(self) -> bool:
            self.left -= 1
            return self.left >= 0

        def retrieve(self) -> tuple[bool, None]:
            return False, None

        def isOpened(self) -> bool:
            return True

        def get(self, name: int) -> float:
            return 0.0

        def set(self, name: int, value: float) -> None: ...

    monkeypatch.setattr(cv2, "VideoCapture", Damaged)
    (tmp_path / "view.toml").write_text(tank.Tank().view_toml())
    view = str(tmp_path / "view.toml")
    seen = list(live.watch("film.avi", view, "robot", 0.11, 0.25)(lambda: 1.0))
    assert seen == [Sight(0.75, None, "a damaged picture")] * 2
    with pytest.raises(InputError, match="--camera /dev/video0: no picture comes"):
        list(live.watch("/dev/video0", view, "robot", 0.11, 0.0)(lambda: 1.0))
    robots = "".join(f'[[robots]]\nname = "{n}"\nfront = "{f}"\nrear = "{r}"\n'
                     for n, f, r in (("one", "red", "blue"), ("two", "green", "magenta")))  # fmt: skip
    Path(view).write_text(tank.Tank().view_toml(robots=robots))
    assert len(list(live.watch("film.avi", view, "two", 0.11, 0.0)(lambda: 1.0))) == 2
    with pytest.raises(InputError, match=r"several robots, one, two; .*'robot'"):
        live.watch("film.avi", view, "robot", 0.11, 0.0)


def test_a_camera_that_is_not_there_is_refused_in_one_line(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("cv2", reason="needs the extra camera")
    from tests.oracles import tank

    (tmp_path / "view.toml").write_text(tank.Tank().view_toml())
    with pytest.raises(InputError, match="--camera 77: no such camera"):
        live.watch("77", str(tmp_path / "view.toml"), "robot", 0.11, 0.0)
    assert capfd.readouterr().err == ""


def test_a_terminal_that_closes_ends_the_ride_as_ctrl_c_does() -> None:
    before = signal.getsignal(signal.SIGHUP)
    with pytest.raises(KeyboardInterrupt, match="ended by SIGHUP") as ended, live.ending_on_signals():
        signal.raise_signal(signal.SIGHUP)
    assert ended.value.status == 128 + signal.SIGHUP  # type: ignore[attr-defined]
    assert signal.getsignal(signal.SIGHUP) is before


def swum(time: float) -> tuple[float, float, float]:
    """Return the pose [m, rad] of the plan's robot at a time [s], between the poses at its flips."""
    times, length = np.append(0.0, np.cumsum(LINE.seconds)), LINE.robot.length_scale
    x, y, heading = (float(np.interp(time, times, values)) for values in LINE.poses.T)
    return x * length, y * length, heading


@pytest.fixture(scope="module")
def tank_files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write a plan for a line across a tank, a film of a robot that swims as planned, and a view.toml."""
    pytest.importorskip("cv2", reason="needs the extra camera")
    pytest.importorskip("serial", reason="needs the extra camera")
    from tests.oracles import tank

    folder = tmp_path_factory.mktemp("tank")
    write_plan(LINE, folder)
    camera = tank.Tank()
    (folder / "view.toml").write_text(camera.view_toml())
    camera.film(folder / "film.avi", lambda time: (*swum(time), 0.0, 0.0), 6.0, 5.0, codec="MJPG")
    return folder


def tracking(folder: Path, port: str, *more: str, stdout: int = subprocess.PIPE) -> subprocess.Popen[str]:
    """Begin to track the robot of the film."""
    words = ["--camera", str(folder / "film.avi"), "--view", str(folder / "view.toml"), "--serial", port, *more]
    return subprocess.Popen(
        [sys.executable, "-m", "softflagella", "track", str(folder / "plan.json"), *words],
        stdout=stdout, stderr=subprocess.PIPE, text=True, cwd=ROOT,
        preexec_fn=partial(signal.signal, signal.SIGINT, signal.SIG_DFL),  # ignored in the background of a shell
    )  # fmt: skip


@pytest.mark.slow
def test_a_film_moves_the_motor(tank_files: Path) -> None:
    """The pose in the track is that of the film, orders come often enough, and stop is the first and the last."""
    master, port = pseudo_terminal()
    out, err = (process := tracking(tank_files, port)).communicate(timeout=LIMIT)
    assert process.returncode == 0, err
    header, *lines = out.splitlines()
    assert header == "time_s,x_cm,y_cm,heading_deg,direction,error_cm,alarm"
    rows = np.array([[float(word) for word in line.split(",")] for line in lines])
    assert len(rows) > 20
    expected = np.array([swum(time - rows[0, 0]) for time in rows[:, 0]]) * [100, 100, 180 / np.pi]
    assert np.abs(np.median(rows[:, 1:4] - expected, 0)).max() < 1.0
    orders = sent(master).decode().split()
    assert (orders[0], orders[-1]) == ("S", "S")
    assert {"F", "B"} <= set(orders)
    assert len(orders) > 5.0 / REPEAT
    assert "not ended; the robot seen in" in err


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_stops_the_motor(tank_files: Path, number: signal.Signals) -> None:
    master, port = pseudo_terminal()
    process, text = tracking(tank_files, port), b""
    while not {b"F", b"B"} & set(text.split()) and process.poll() is None:
        time.sleep(0.1)
        text += sent(master)
    process.send_signal(number)
    _, err = process.communicate(timeout=LIMIT)
    assert process.returncode == 128 + number, err
    assert (text + sent(master)).split()[-1] == b"S"
    assert "from picture to order" in err
    assert "Traceback" not in err
