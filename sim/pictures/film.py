"""A film of a schedule: the robot from above with its bent tails, its track, the motor's direction, the time."""

from __future__ import annotations

import math
import shutil
import subprocess
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from common.arrays import Floats
from common.errors import InputError
from common.files import whole_file
from common.units import format_time
from sim.model.schedule import Schedule
from sim.motion.shapes import Shapes, scheduled_shapes

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from PIL.Image import Image

ENDINGS = (".gif", ".webp", ".mp4")
MOST_FRAMES = 3000
_MARGIN = 0.25  # l around everything that is seen
_INK, _SOFT, _HEAD, _TAIL = "#1c2733", "#8a97a3", "#1769a5", "#c8452f"
_SENSES = {1: ("#1769a5", "+"), -1: ("#a85100", "−")}


class FilmSettings(NamedTuple):
    """How a schedule is filmed."""

    speed: float  # seconds of the robot in a second of the film
    frames_per_second: int = 12
    width: int = 640  # pixels

    def times(self, schedule: Schedule) -> Floats:
        """Return the times of all frames [μ0 l⁴/EI], (F,).

        Raises:
            InputError: there are too many, or none to speak of.
        """
        if not (0 < self.speed < math.inf):
            raise InputError(f"speed {self.speed:g}; give a number above 0")
        total = float(schedule.dwells.sum())
        count = math.floor(total * schedule.time_scale / self.speed * self.frames_per_second) + 1
        if count > MOST_FRAMES:
            least = total * schedule.time_scale * self.frames_per_second / MOST_FRAMES
            raise InputError(f"speed {self.speed:g} makes {count} pictures; give {math.ceil(least)} or more")
        return np.linspace(0.0, total, max(count, 2))


def fitting_speed(schedule: Schedule, seconds: float = 15.0) -> float:
    """Choose the speed at which a film takes about some seconds: 1, 2 or 5 times a power of ten, 1 at least."""
    wanted = max(float(schedule.dwells.sum()) * schedule.time_scale / seconds, 1.0)
    power = 10.0 ** math.floor(math.log10(wanted))
    return next(step * power for step in (1, 2, 5, 10) if step * power >= wanted)


def write_film(
    content: Mapping[str, Any],
    schedule: Schedule,
    path: str | Path,
    film: FilmSettings,
    *,
    progress: Callable[[int], object] | None = None,
) -> int:
    """Simulate a plan, draw it, write the film, and return the number of its pictures.

    Args:
        content: of a plan.json: its drawn and declared path are shown.
        schedule: the same plan's schedule.
        path: .gif, .webp, or, where ffmpeg is installed, .mp4.
        film: speed and size.
        progress: called after each dwell with 1.

    Raises:
        InputError: the ending is unknown, there is no ffmpeg, or the schedule cannot be simulated.
    """
    ending = Path(path).suffix.lower()
    if ending not in ENDINGS:
        raise InputError(f"{path}: a film ends in {', '.join(ENDINGS)}")
    if ending == ".mp4" and shutil.which("ffmpeg") is None:
        raise InputError(f"{path}: .mp4 needs ffmpeg, which is not installed; write a .gif or .webp")
    shapes = scheduled_shapes(schedule, film.times(schedule), progress=progress)
    pictures = _pictures(content, schedule, shapes, film)
    with whole_file(path) as part:
        if ending == ".mp4":
            _write_mp4(pictures, part, film)
        else:
            _write_animation(pictures, part, film, ending)
    return len(shapes.times)


def _pictures(
    content: Mapping[str, Any], schedule: Schedule, shapes: Shapes, film: FilmSettings
) -> Iterator[Image]:
    """Draw one picture after the other, in cm."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.patches import Polygon
    from PIL import Image

    cm = 100 * schedule.tail_length if schedule.tail_length else 1.0
    drawn, declared = (np.array(content[name], dtype=float) for name in ("raw_path", "reference"))
    if content.get("closed"):
        drawn, declared = (np.concatenate([line, line[:1]]) for line in (drawn, declared))
    tails = shapes.nodes[..., :2]
    seen = np.concatenate([drawn, declared, shapes.heads[:, :2], tails.reshape(-1, 2)])
    low, high = seen.min(0) - _MARGIN, seen.max(0) + _MARGIN
    size = high - low
    # An even number of pixels, which video codecs need.
    height = 2 * round(film.width * float(np.clip(size[1] / size[0], 0.3, 1.5)) / 2)
    figure = Figure(figsize=(film.width / 100, height / 100), dpi=100)
    canvas = FigureCanvasAgg(figure)
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set_axis_off()
    axes.set_xlim(cm * low[0], cm * high[0])
    axes.set_ylim(cm * low[1], cm * high[1])
    axes.set_aspect("equal", adjustable="datalim")
    axes.plot(*(cm * drawn.T), color=_SOFT, lw=1.2, ls=(0, (6, 4)))
    axes.plot(*(cm * declared.T), color=_INK, lw=0.8)
    (track,) = axes.plot([], [], color=_HEAD, lw=1.8)
    lines = [axes.plot([], [], color=_TAIL, lw=2.2, solid_capstyle="round")[0] for _ in tails[0]]
    head = Polygon(np.zeros((4, 2)), facecolor="#dfe9f1", edgecolor=_HEAD, lw=1.4, zorder=3)
    axes.add_patch(head)
    words = axes.text(0.02, 0.02, "", transform=axes.transAxes, fontsize=11, color=_INK)
    sense = axes.text(0.98, 0.02, "", transform=axes.transAxes, fontsize=11, ha="right")
    _draw_scale_bar(axes, cm * size[0], "cm" if schedule.tail_length else "l")
    # All that moves is made once, and only changed from picture to picture.
    radius = 1 / schedule.robot["l_over_R"]
    length = radius * schedule.robot["L_over_R"]
    corners = np.array([[-length, -radius], [length, -radius], [length, radius], [-length, radius]]) * [0.5, 1]
    for time, pose, shape, direction in zip(shapes.times, shapes.heads, tails, shapes.directions, strict=True):
        past = shapes.track[shapes.track[:, 0] <= time, 1:]
        track.set_data(*(cm * past.T))
        for line, tail in zip(lines, shape, strict=True):
            line.set_data(*(cm * tail.T))
        cos, sin = math.cos(pose[2]), math.sin(pose[2])
        head.set_xy(cm * (pose[:2] + corners @ np.array([[cos, sin], [-sin, cos]])))
        words.set_text(f"{format_time(time * schedule.time_scale)}   {film.speed:g} ×")
        colour, sign = _SENSES[int(direction)]
        sense.set_text(f"motor {sign}")
        sense.set_color(colour)
        canvas.draw()  # type: ignore[no-untyped-call]
        pixels = np.asarray(canvas.buffer_rgba())  # type: ignore[no-untyped-call]
        yield Image.fromarray(pixels).convert("RGB")


def _draw_scale_bar(axes: Axes, width: float, unit: str) -> None:
    """Draw a bar of 1, 2 or 5 times a power of ten, at most a fifth of the width, below the middle."""
    power = 10.0 ** math.floor(math.log10(width / 5))
    length = max(step * power for step in (1, 2, 5) if step * power <= width / 5)
    middle, below = sum(axes.get_xlim()) / 2, axes.get_xaxis_transform()
    axes.plot([middle - length / 2, middle + length / 2], [0.025, 0.025], color=_INK, lw=2.5, transform=below,
              solid_capstyle="butt")  # fmt: skip
    axes.text(middle, 0.04, f"{length:g} {unit}", transform=below, fontsize=11, color=_INK, ha="center")


def _write_animation(pictures: Iterator[Image], path: Path, film: FilmSettings, ending: str) -> None:
    """Write a GIF with one palette, or a WebP."""
    from PIL.Image import Dither

    images = list(pictures)
    pause = 1000 / film.frames_per_second
    if ending == ".webp":
        images[0].save(
            path, "WEBP", save_all=True, append_images=images[1:], duration=round(pause), loop=0, quality=70
        )
        return
    palette = images[len(images) // 2].quantize(64)
    flat = [image.quantize(palette=palette, dither=Dither.NONE) for image in images]
    flat[0].save(
        path, "GIF", save_all=True, append_images=flat[1:], duration=10 * round(pause / 10), loop=0, optimize=True
    )


def _write_mp4(pictures: Iterator[Image], path: Path, film: FilmSettings) -> None:
    """Hand the pictures to ffmpeg."""
    first = next(pictures)
    size = f"{first.width}x{first.height}"
    command = ["ffmpeg", "-v", "error", "-y", "-f", "rawvideo", "-pix_fmt", "rgb24", "-s", size, "-r",
               str(film.frames_per_second), "-i", "-", "-pix_fmt", "yuv420p", "-f", "mp4", str(path)]  # fmt: skip
    with subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdin is not None
        assert process.stderr is not None
        try:
            process.stdin.write(first.tobytes())
            for picture in pictures:
                process.stdin.write(picture.tobytes())
            process.stdin.close()
        except BrokenPipeError:
            pass
        reason = process.stderr.read().decode(errors="replace").strip()
    if process.returncode:
        raise InputError(f"ffmpeg cannot write {path}: {reason.splitlines()[-1] if reason else 'no reason given'}")
