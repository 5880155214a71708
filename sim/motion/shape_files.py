"""Files of shapes for other programs: arrays of NumPy (.npz), or lines of VTK in a series (.pvd), for ParaView.

Lengths are in m and times in s; forces are in N where the robot's stiffness is known, else in EI/l². A schedule
without a tail length has lengths in l. docs/howto/shapes.md describes the entries.
"""

from __future__ import annotations

import json
from base64 import b64encode
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from common.arrays import Floats
from common.errors import InputError
from common.files import files_together, whole_file
from sim.model.robot import Robot
from sim.model.schedule import Schedule
from sim.motion.shapes import Shapes

MAX_TIMES = 20000
_IN_A_REVOLUTION = 24  # times in a motor revolution
_VTK = """<VTKFile type="{}" version="1.0" byte_order="LittleEndian" header_type="UInt64">
{}
</VTKFile>
"""
_KINDS = {np.dtype("f8"): "Float64", np.dtype("i8"): "Int64"}


def check_name(path: str | Path) -> None:
    """Refuse a file of shapes that ends neither in .npz nor in .pvd."""
    if Path(path).suffix not in (".npz", ".pvd"):
        raise InputError(f"{path}: a file of shapes ends in .npz, or in .pvd for ParaView")


def equal_times(schedule: Schedule, every: float | None = None) -> Floats:
    """Choose the times of shapes [μ0 l⁴/EI], at most MAX_TIMES, from 0 to the end of a schedule, (F,).

    Args:
        schedule: the schedule.
        every: s between the shapes; default: a 24th of a motor revolution, or more in a long schedule.

    Raises:
        InputError: the step is not above 0, or so small that there are too many.
    """
    total = float(schedule.dwells.sum())
    if every is None:
        step = max(2 * np.pi / abs(schedule.robot["omega_bar"]) / _IN_A_REVOLUTION, total / (MAX_TIMES - 1))
    elif every > 0:
        step = every / schedule.time_scale
    else:
        raise InputError(f"shapes every {every:g} s; give a time above 0")
    if total / step > MAX_TIMES:
        least = total * schedule.time_scale / MAX_TIMES
        raise InputError(f"shapes every {every:g} s are more than {MAX_TIMES}; give {least:.2g} s or more")
    return np.asarray(step * np.arange(int(total / step * (1 + 1e-12)) + 1.0))


def shape_arrays(
    shapes: Shapes, robot: Mapping[str, float], length: float | None, time: float, force: float | None
) -> dict[str, Any]:
    """Convert shapes to the entries of a .npz file.

    Args:
        shapes: dimensionless.
        robot: its dimensionless groups.
        length: l in m; None: lengths stay in l.
        time: the unit of time in s.
        force: EI/l² in N; None: forces stay in EI/l².
    """
    size, F = length or 1.0, force or 1.0
    (x, y, heading), (head, disc) = shapes.heads.T, shapes.angles.T
    radius, half = 1 / robot["l_over_R"], robot["L_over_R"] / robot["l_over_R"] / 2
    cos, sin, none = np.cos(heading), np.sin(heading), 0 * x
    left, up, forward = np.array([[-sin, cos, none], [none, none, none + 1], [cos, sin, none]])  # (3, F) each
    centre = np.array([x, y, none])

    def axes(angle: Floats) -> Floats:
        """Return e_x, e_y, e_z of a body turned about e_z as the columns of matrices (F, 3, 3)."""
        c, s = np.cos(angle), np.sin(angle)
        return np.ascontiguousarray(np.stack([c * left + s * up, c * up - s * left, forward]).transpose(2, 1, 0))

    units = {"time": "s", "angle": "rad", "length": "m" if length else "l", "force": "N" if force else "EI/l^2"}
    units["moment"] = f"{units['force']} {units['length']}"
    return {
        "time": time * shapes.times,
        "nodes": size * shapes.nodes,
        "forces": F * shapes.forces,
        "head_position": size * centre.T,
        "head_axes": axes(head),
        "disc_position": size * (centre - half * forward).T,
        "disc_axes": axes(disc),
        "head_force": F * shapes.on_head[:, :2],
        "head_moment": F * size * shapes.on_head[:, 2:],
        "direction": shapes.directions,
        "sizes": size * np.array([2 * half, radius, radius * robot.get("a_over_R", 1.0), 1 / robot["l_over_r0"]]),
        "units": json.dumps(units),
    }


def write_shapes(
    path: str | Path, shapes: Shapes, schedule: Schedule | None = None, robot: Robot | None = None
) -> None:
    """Write shapes as .npz or as .pvd with a folder of .vtp files, completely or not at all.

    Args:
        path: the file.
        shapes: of a schedule, or of a robot that swims steadily.
        schedule: what was simulated.
        robot: the robot that swam, where it is known in SI units.

    Raises:
        InputError: the ending is unknown, or the file cannot be written.
    """
    check_name(path)
    force = None if robot is None else robot.bending_stiffness / robot.tail_length**2
    if schedule is not None:
        arrays = shape_arrays(shapes, schedule.robot, schedule.tail_length, schedule.time_scale, force)
    else:
        assert robot is not None
        arrays = shape_arrays(shapes, robot.group_values(), robot.tail_length, robot.time_scale, force)
    path = Path(path)
    if path.suffix == ".npz":
        with whole_file(path) as part, open(part, "wb") as file:
            np.savez_compressed(file, **arrays)
        return
    names = [f"{path.stem}/{i:05}.vtp" for i in range(len(shapes.times))]
    older = [file.relative_to(path.parent).as_posix() for file in (path.parent / path.stem).glob("*.vtp")]
    with files_together(path.parent, [path.name, *{*names, *older}]) as folder:
        (folder / path.stem).mkdir()
        for i, name in enumerate(names):
            (folder / name).write_text(_polydata(arrays, i))
        listed = zip(arrays["time"], names, strict=True)
        lines = "\n".join(f'<DataSet timestep="{time:.9g}" file="{name}"/>' for time, name in listed)
        (folder / path.name).write_text(_VTK.format("Collection", f"<Collection>\n{lines}\n</Collection>"))


def _polydata(arrays: Mapping[str, Any], i: int) -> str:
    """Describe tails and head at one time as lines with radii, and forces on their points."""
    length, radius, _, tail_radius = arrays["sizes"]
    tails, count, _ = arrays["nodes"][i].shape
    ahead = length / 2 * arrays["head_axes"][i, :, 2]
    ends = arrays["head_position"][i] + np.array([-ahead, ahead])
    points = np.concatenate([arrays["nodes"][i].reshape(-1, 3), ends])
    forces = np.concatenate([arrays["forces"][i].reshape(-1, 3), np.zeros((2, 3))])
    radii = np.repeat([tail_radius, radius], [tails * count, 2])
    stream = ""

    def array(name: str, values: Any) -> str:
        nonlocal stream
        kind, offset = _KINDS[values.dtype], len(stream)
        data = np.ascontiguousarray(values, values.dtype.newbyteorder("<")).tobytes()
        stream += b64encode(len(data).to_bytes(8, "little") + data).decode()
        width = f' NumberOfComponents="{values.shape[1]}"' if values.ndim > 1 else ""
        return f'<DataArray type="{kind}" Name="{name}"{width} format="appended" offset="{offset}"/>'

    ends_of_lines = np.append(count * np.arange(1, tails + 1), tails * count + 2)
    parts = [
        f'<PolyData>\n<Piece NumberOfPoints="{len(points)}" NumberOfLines="{tails + 1}">',
        f'<PointData Vectors="force">\n{array("force", forces)}\n{array("radius", radii)}\n</PointData>',
        f"<Points>\n{array('points', points)}\n</Points>",
        f"<Lines>\n{array('connectivity', np.arange(len(points)))}\n{array('offsets', ends_of_lines)}\n</Lines>",
        "</Piece>\n</PolyData>",
    ]
    return _VTK.format(
        "PolyData", "\n".join(parts) + f'\n<AppendedData encoding="base64">_{stream}</AppendedData>'
    )
