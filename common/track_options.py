"""Options of all functions and commands that read the tracks of other programs (`camera.pose_tracks`)."""

from __future__ import annotations

from typing import Literal, TypedDict

Source = Literal["deeplabcut", "sleap", "trackmate", "tracker", "idtrackerai", "motive", "tum"]


class TrackOptions(TypedDict, total=False):
    """How the tracks of another program are read.

    Attributes:
        written_by: the program that wrote the tracks; each file of a folder is a run.
        front: NAME, of the point ahead of the head's centre (default: front).
        rear: NAME, of the point equally far behind it (default: rear).
        scale: LENGTH, of a pixel, or of the file's unit of length, such as 0.2mm.
        fps: frames per second, where the file counts frames.
        origin: X Y, of the point that becomes 0 0, as the file has it (default: 0 0).
    """

    written_by: Source | None
    front: str
    rear: str
    scale: str | None
    fps: float | None
    origin: tuple[float, float]
