"""Shapes as data: nodes hang on the robot, forces balance, files say what was simulated."""

from __future__ import annotations

import json
import re
import xml.etree.ElementTree as ET
from base64 import b64decode
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import interp1d

from common.errors import InputError, run_command
from sim.__main__ import main
from sim.model.presets import PRESETS
from sim.model.robot import Robot
from sim.model.schedule import Schedule
from sim.motion.replay import replay
from sim.motion.shape_files import equal_times, shape_arrays, write_shapes
from sim.motion.shapes import nodes_in_body, scheduled_shapes, steady_shapes, steady_states
from sim.motion.steady import steady

ROBOT = PRESETS["paper-triangle"]
CONTROL = PRESETS["paper-control"]
FORCE = CONTROL.bending_stiffness / CONTROL.tail_length**2


def flips(robot: Robot = CONTROL) -> Schedule:
    start = (0.3, -0.2, 0.7)
    return Schedule(robot.group_values(), -1, np.array([0.5, 0.4]), start, robot.time_scale, robot.tail_length)


def test_tails_over_a_revolution_hang_on_their_clamps() -> None:
    phases = 2 * np.pi * np.arange(8) / 8
    body, states = steady_states(ROBOT, phases)
    tails = np.array([nodes_in_body(body, state) for state in states])
    assert tails.shape == (8, 4, 13, 3)
    radius = ROBOT.head_radius / ROBOT.tail_length
    for j in range(4):
        angle = phases + 2 * np.pi * j / 4
        clamp = np.stack([radius * np.cos(angle), radius * np.sin(angle), 0 * angle], 1)
        assert tails[:, j, 0] == pytest.approx(clamp, abs=1e-12)
    assert np.linalg.norm(np.diff(tails, axis=2), axis=-1).sum(-1) == pytest.approx(1.0, abs=1e-2)
    assert tails[2, 0] == pytest.approx(tails[0, 1], abs=1e-9)  # after a quarter turn tail 1 is where tail 0 was


def unbalanced(arrays: dict[str, np.ndarray], load: np.ndarray) -> np.ndarray:
    """Sum all forces forward and to the left, and moments about J up and along the axis, over the largest force.

    From a file's entries alone; `load` is that on the tails, (3,), in the lab.
    """
    axes, cells = arrays["disc_axes"], np.ones(arrays["nodes"].shape[2])
    forward, up = axes[..., 2], np.array([0.0, 0.0, 1.0])
    left = np.cross(up, forward)
    cells[[0, -1]] = 0.5
    on_nodes = arrays["forces"] + load * cells[:, None] / cells.sum()
    arms = arrays["nodes"] - arrays["disc_position"][:, None, None]
    force, moment = on_nodes.sum((1, 2)), np.cross(arms, on_nodes).sum((1, 2))
    sums = np.stack([(force * left).sum(1), (force * forward).sum(1), moment @ up, (moment * forward).sum(1)], 1)
    return np.abs(sums + np.hstack([arrays["head_force"], arrays["head_moment"]])) / np.abs(arrays["forces"]).max()


@pytest.mark.parametrize(("tails", "effects"), [
    (1, {}),
    (2, {"tail_interaction": 1.0, "head_flow": 1.0, "contact_line": 0.3}),
    (3, {"shear_thinning": 0.2, "natural_curvature": 0.4, "tail_sag": 0.1, "disc_drag": 0.5}),
])  # fmt: skip
def test_the_forces_of_the_fluid_balance(tails: int, effects: dict[str, float]) -> None:
    """On tails, head and disc, at every instant of a schedule, just after a flip, and of a steady turn."""
    robot = replace(CONTROL, tails=tails, effects=effects)
    values = {**robot.group_values(), "l": 1.0}
    load = np.array([0.0, 0.0, -8 * effects.get("tail_sag", 0.0)])
    swum = scheduled_shapes(flips(robot), np.linspace(0, 0.9, 19))
    for shapes in (swum, steady_shapes(robot, 12)):
        assert unbalanced(shape_arrays(shapes, values, None, 1.0, None), load).max() < 2e-3
    assert np.abs(swum.forces).max((1, 2, 3)).min() > 0.03


def test_forces_are_the_drag_of_the_velocities_that_the_nodes_have_in_the_lab() -> None:
    """From positions and times alone, by differences."""
    shapes = steady_shapes(CONTROL, 192)
    nodes, n = shapes.nodes, shapes.nodes.shape[2] - 1
    velocity = np.gradient(nodes, shapes.times, axis=0, edge_order=2)[1:-1]
    edges = np.diff(nodes, axis=2)[1:-1]
    tangent = edges / np.linalg.norm(edges, axis=-1)[..., None]
    ends = (tangent[:, :, :1], tangent[:, :, -1:])
    tangent = np.concatenate([ends[0], tangent[:, :, :-1] + tangent[:, :, 1:], ends[1]], axis=2)
    tangent /= np.linalg.norm(tangent, axis=-1)[..., None]
    log = np.log(CONTROL.tail_length / CONTROL.tail_radius)
    parallel, perp = 2 * np.pi / (log - 0.5), 4 * np.pi / (log + 0.5)
    along = (tangent * velocity).sum(-1)[..., None] * tangent
    drag = -(perp * velocity + (parallel - perp) * along) / n
    found = shapes.forces[1:-1]
    assert found[:, :, 1:-1] == pytest.approx(drag[:, :, 1:-1], abs=2e-3 * np.abs(found).max())
    assert found[:, :, -1] == pytest.approx(drag[:, :, -1] / 2, abs=2e-3 * np.abs(found).max())


def test_a_turn_moves_the_robot_as_its_mean_motion_does() -> None:
    shapes, motion = steady_shapes(CONTROL), steady(CONTROL.groups())
    time = shapes.times[-1]
    assert 2 * np.pi / time == pytest.approx(motion.omega_t[0], rel=2e-3)
    assert shapes.angles[-1, 0] / time == pytest.approx(motion.omega_h[0], rel=1e-2)
    assert shapes.heads[-1, 2] / time == pytest.approx(motion.omega_yr[0], rel=1e-2)
    assert np.hypot(*shapes.heads[-1, :2]) / time == pytest.approx(np.hypot(motion.v_x, motion.v_z)[0], rel=1e-2)


def test_entries_of_an_npz_are_in_the_units_that_they_state(tmp_path: Path) -> None:
    schedule = flips()
    shapes = scheduled_shapes(schedule, equal_times(schedule, 0.5))
    length, t = CONTROL.tail_length, CONTROL.time_scale
    write_shapes(tmp_path / "known.npz", shapes, schedule, CONTROL)
    write_shapes(tmp_path / "plan.npz", shapes, schedule)
    known, plan = (np.load(tmp_path / f"{name}.npz") for name in ("known", "plan"))
    assert json.loads(str(known["units"])) == {
        "time": "s", "angle": "rad", "length": "m", "force": "N", "moment": "N m"}  # fmt: skip
    assert json.loads(str(plan["units"]))["force"] == "EI/l^2"
    assert np.diff(known["time"]) == pytest.approx(0.5)
    assert known["forces"] == pytest.approx(FORCE * shapes.forces)
    assert known["forces"] == pytest.approx(FORCE * plan["forces"])
    assert known["nodes"] == pytest.approx(length * shapes.nodes)
    assert known["head_moment"] == pytest.approx(FORCE * length * shapes.on_head[:, 2:])
    assert known["direction"].tolist() == shapes.directions.tolist()
    assert known["sizes"] == pytest.approx([0.06, 0.016, 0.016, 0.0032])
    between = known["head_position"] - known["disc_position"]  # half a head ahead of the disc, along its axis
    assert between == pytest.approx(0.03 * known["head_axes"][..., 2])
    assert np.linalg.det(known["disc_axes"]) == pytest.approx(1.0)
    clamps = known["nodes"][:, 0, 0] - known["disc_position"]  # the first clamp is on the e_x of the disc
    assert clamps == pytest.approx(0.016 * known["disc_axes"][..., 0])
    spin = np.unwrap(shapes.angles[:, 1] - shapes.angles[:, 0])  # the motor turns the disc relative to the head
    moved = np.minimum(known["time"], 0.5 * t) - np.maximum(known["time"] - 0.5 * t, 0)
    assert spin == pytest.approx(-CONTROL.motor_speed * moved, abs=1e-6)


def read_vtp(file: Path) -> dict[str, np.ndarray]:
    """Read the arrays of a file of VTK: base64 of a length and of the numbers, behind each other."""
    root = ET.fromstring(file.read_text())
    assert root.attrib == {
        "type": "PolyData", "version": "1.0", "byte_order": "LittleEndian", "header_type": "UInt64"}  # fmt: skip
    stream = str(root.findtext("AppendedData")).removeprefix("_")
    found = {}
    for array in root.iter("DataArray"):
        rest = stream[int(array.attrib["offset"]) :]
        size = int.from_bytes(b64decode(rest[:12])[:8], "little")
        data = b64decode(rest[: 4 * -(-(8 + size) // 3)])[8:]
        values = np.frombuffer(data, {"Float64": "<f8", "Int64": "<i8"}[array.attrib["type"]])
        found[array.attrib["Name"]] = values.reshape(-1, int(array.attrib.get("NumberOfComponents", 1)))
    return found


def test_a_series_of_vtk_holds_the_same(tmp_path: Path) -> None:
    schedule = flips()
    shapes = scheduled_shapes(schedule, np.array([0.0, 0.3, 0.9]))
    (tmp_path / "swim").mkdir()
    (tmp_path / "swim" / "00007.vtp").write_text("of an older series")
    write_shapes(tmp_path / "swim.pvd", shapes, schedule, CONTROL)
    arrays = shape_arrays(shapes, schedule.robot, schedule.tail_length, schedule.time_scale, FORCE)
    listed = [(float(each.attrib["timestep"]), each.attrib["file"])
              for each in ET.fromstring((tmp_path / "swim.pvd").read_text()).iter("DataSet")]  # fmt: skip
    assert sorted(p.name for p in (tmp_path / "swim").iterdir()) == ["00000.vtp", "00001.vtp", "00002.vtp"]
    for i, (time, name) in enumerate(listed):
        assert time == pytest.approx(arrays["time"][i], rel=1e-8)
        read = read_vtp(tmp_path / name)
        count = arrays["nodes"].shape[2]
        lines = np.split(read["points"], read["offsets"][:-1, 0])
        assert np.array(lines[:2]) == pytest.approx(arrays["nodes"][i])
        assert lines[2].mean(0) == pytest.approx(arrays["head_position"][i])
        assert read["force"][:-2] == pytest.approx(arrays["forces"][i].reshape(-1, 3))
        assert read["radius"][:, 0].tolist() == [0.0032] * 2 * count + [0.016] * 2
        assert read["connectivity"][:, 0].tolist() == list(range(2 * count + 2))


def test_times_are_equal_and_not_too_many() -> None:
    schedule = flips()
    revolution = 2 * np.pi / CONTROL.motor_speed
    assert np.diff(equal_times(schedule)) * schedule.time_scale == pytest.approx(revolution / 24)
    long = replace(schedule, dwells=np.full(5000, 1.0))
    assert len(equal_times(long)) == 20000
    for every, words in ((0.0, "above 0"), (1e-6, "give 9.9e-05 s or more")):
        with pytest.raises(InputError, match=re.escape(words)):
            equal_times(schedule, every)


def test_the_command_writes_the_shapes_of_one_robot(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "turn.npz"
    assert run_command(main, ["steady", "paper-control", "--shapes", str(file)]) == 0
    assert f"97 shapes -> {file}" in capsys.readouterr().out
    assert np.load(file)["nodes"].shape == (97, 2, 13, 3)
    assert run_command(main, ["steady", "paper-control", "--shapes", str(tmp_path / "turn.obj")]) == 2
    assert "ends in .npz, or in .pvd" in capsys.readouterr().err


def schedule(*dwells: float) -> Schedule:
    start = (0.3, -0.2, 0.7)
    return Schedule(ROBOT.group_values(), -1, np.array(dwells), start, ROBOT.time_scale, ROBOT.tail_length)


def test_poses_and_directions_are_those_of_a_replay() -> None:
    wanted = schedule(1.1, 0.8, 1.3)
    track = replay(wanted)
    frames = scheduled_shapes(wanted, np.linspace(0, 3.2, 41))
    for k, name in enumerate(("x_over_l", "y_over_l", "heading_rad")):
        assert np.abs(frames.heads[:, k] - np.interp(frames.times, track.time_bar, track[name])).max() < 3e-3
        if k < 2:
            assert np.abs(frames.track[-1, 1 + k] - track[name].iloc[-1]) < 1e-3
    assert frames.directions.tolist() == [-1] * 14 + [1] * 10 + [-1] * 17
    assert scheduled_shapes(wanted, np.cumsum(wanted.dwells)).directions.tolist() == [1, -1, -1]  # after the flips


def test_tails_are_those_of_a_steadily_swimming_robot() -> None:
    body, states = steady_states(ROBOT, 2 * np.pi * np.arange(128) / 128)
    tails = np.array([nodes_in_body(body, state) for state in states])
    swims = Schedule(ROBOT.group_values(), 1, np.array([12.0]), (0.0, 0.0, 0.0), 1.0)
    frames = scheduled_shapes(swims, np.array([11.5, 11.9]))
    ahead = ROBOT.head_length / ROBOT.tail_length / 2
    shapes = resampled(tails[..., [2, 0]] - [ahead, 0])
    for pose, seen in zip(frames.heads, frames.nodes[..., :2], strict=True):
        cos, sin = np.cos(pose[2]), np.sin(pose[2])
        body = (seen - pose[:2]) @ np.array([[cos, -sin], [sin, cos]])  # forward, left
        assert np.abs(shapes - resampled(body)).max((1, 2, 3)).min() < 0.03


def resampled(tails: np.ndarray) -> np.ndarray:
    """Return tails (..., n, 2) at thirteen places."""
    return np.asarray(interp1d(np.linspace(0, 1, tails.shape[-2]), tails, axis=-2)(np.linspace(0, 1, 13)))
