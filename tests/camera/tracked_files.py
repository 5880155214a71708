"""Files as other programs write them, of a robot on a circle with a dot before and behind its head's centre."""

from __future__ import annotations

import itertools
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

FPS, PIXEL_CM, AHEAD = 25.0, 0.05, 12.0  # the dots are AHEAD pixels from the centre
LOST = 7  # frame whose front is not seen
FRAMES = np.arange(40)
TIME = FRAMES / FPS
HEADING = 0.3 + 0.8 * TIME  # rad, seen from above, counter-clockwise
CENTRE = np.stack([400 + 150 * np.cos(0.8 * TIME), 300 - 150 * np.sin(0.8 * TIME)])  # in pixels, y downwards
_ALONG = AHEAD * np.stack([np.cos(HEADING), -np.sin(HEADING)])
DOTS = {"front": CENTRE + _ALONG, "rear": CENTRE - _ALONG}


def poses() -> pd.DataFrame:
    """The poses that every file holds, without the frame that is lost."""
    x, y = PIXEL_CM * CENTRE
    table = pd.DataFrame({"time_s": TIME, "x_cm": x, "y_cm": -y, "heading_deg": np.degrees(HEADING)})
    return table.drop(index=LOST).reset_index(drop=True)


def _seen(name: str, nothing: float = np.nan) -> np.ndarray:
    """The places of a dot, (2, frames)."""
    places = DOTS[name].copy()
    if name == "front":
        places[:, LOST] = nothing
    return places


def _rows(*columns: Any) -> str:
    return "".join(
        ",".join("" if value != value else f"{value:.9g}" for value in row) + "\n"
        for row in np.stack(columns, 1).tolist()
    )


def _likelihood(name: str) -> np.ndarray:
    return np.where((FRAMES == LOST) & (name == "front"), 0.1, 0.98)


def deeplabcut() -> bytes:
    """Below the likelihood at which it counts, a place is anywhere."""
    columns = [column for name in DOTS for column in (*_seen(name, 5.0), _likelihood(name))]
    heads = [["scorer"] + 6 * ["DLC_resnet50_swim"], ["bodyparts", *3 * ["front"], *3 * ["rear"]],
             ["coords", *2 * ["x", "y", "likelihood"]]]  # fmt: skip
    return ("".join(",".join(head) + "\n" for head in heads) + _rows(FRAMES, *columns)).encode()


def two_robots() -> bytes:
    """Write a project of DeepLabCut with several individuals; the second is 100 pixels to the right."""
    columns = []
    for right in (0, 100):
        columns += [c for name in DOTS for c in (_seen(name)[0] + right, _seen(name)[1], _likelihood(name))]
    parts = 3 * ["front"] + 3 * ["rear"]
    heads = [["scorer"] + 12 * ["DLC"], ["individuals", *6 * ["one"], *6 * ["two"]], ["bodyparts", *2 * parts],
             ["coords", *4 * ["x", "y", "likelihood"]]]  # fmt: skip
    return ("".join(",".join(head) + "\n" for head in heads) + _rows(FRAMES, *columns)).encode()


def deeplabcut_h5(path: Path) -> None:
    import h5py

    names = [("DLC", name, what) for name in DOTS for what in ("x", "y", "likelihood")]
    values = np.stack([c for name in DOTS for c in (*_seen(name, 5.0), _likelihood(name))], 1)
    rows = np.empty(len(FRAMES), dtype=[("index", "<i8"), ("values_block_0", "<f8", (6,))])
    rows["index"], rows["values_block_0"] = FRAMES, values
    with h5py.File(path, "w") as file:
        table = file.create_dataset("df_with_missing/table", data=rows)
        table.attrs["values_block_0_kind"] = np.bytes_(pickle.dumps(names, 0))


def sleap() -> bytes:
    head = "track,frame_idx,instance.score," + ",".join(f"{n}.x,{n}.y,{n}.score" for n in DOTS)
    columns = [c for name in DOTS for c in (*_seen(name), np.where(np.isnan(_seen(name)[0]), np.nan, 0.8))]
    lines = _rows(FRAMES, np.full(len(FRAMES), 0.9), *columns).splitlines()
    return "\n".join([head, *("," + line for line in lines), ""]).encode()


def sleap_h5(path: Path, *, scores: bool = True) -> None:
    import h5py

    with h5py.File(path, "w") as file:
        tracks = np.stack([_seen(name) for name in DOTS], 1)[None]  # (tracks, 2, nodes, frames)
        file["tracks"], file["node_names"], file["track_names"] = tracks, list(DOTS), np.zeros(0)
        if scores:
            file["point_scores"] = np.full(tracks[:, 0].shape, 0.8)


def trackmate() -> bytes:
    names = "ID,TRACK_ID,QUALITY,POSITION_X,POSITION_Y,POSITION_Z,POSITION_T,FRAME,RADIUS"
    heads = [f"LABEL,{names}", f"Label,{names}", f"Label,{names}",
             ",,,(quality),(pixel),(pixel),(pixel),(sec),,(pixel)"]  # fmt: skip
    spots = [
        f"ID{k},{k},{track},9.5,{x:.9g},{y:.9g},0,{TIME[k]:.9g},{k},3"
        for track, name in enumerate(DOTS)
        for k, (x, y) in enumerate(_seen(name).T)
        if x == x
    ]
    return "\n".join([*heads, *spots, "ID999,999,,1.5,5,5,0,0,0,3", ""]).encode()


def trackmate_older() -> bytes:
    """Write a table as the versions before 6 did: without units, and None for a spot that is in no track."""
    head, _, _, _, *spots = (
        trackmate().decode().replace("LABEL", "Label").replace("999,,", "999,None,").split("\n")
    )
    rows = [spot.split(",") for spot in spots if spot]
    return "\n".join([head, *(",".join([*row[:7], row[8], *row[8:]]) for row in rows), ""]).encode()


def trackmate_xml() -> bytes:
    spots, edges = "", ""
    for track, name in enumerate(DOTS):
        ids = [100 * track + k for k, x in enumerate(_seen(name)[0]) if x == x]
        for spot in ids:
            x, y = DOTS[name][:, spot % 100]
            spots += f'<Spot ID="{spot}" FRAME="{spot % 100}" POSITION_T="{spot % 100}.0" '
            spots += f'POSITION_X="{x:.9g}" POSITION_Y="{y:.9g}" POSITION_Z="0.0"/>'
        links = itertools.pairwise(ids)
        inner = "".join(f'<Edge SPOT_SOURCE_ID="{a}" SPOT_TARGET_ID="{b}"/>' for a, b in links)
        edges += f'<Track name="Track_{track}" TRACK_ID="{track}">{inner}</Track>'
    model = f'<Model spatialunits="pixel" timeunits="frame"><AllSpots>{spots}</AllSpots>'
    model += f"<AllTracks>{edges}</AllTracks></Model>"
    return f'<?xml version="1.0" encoding="UTF-8"?><TrackMate version="7.11.1">{model}</TrackMate>'.encode()


def trackmate_tracks() -> bytes:
    particles = ""
    for name in DOTS:
        spots = [
            f'<detection t="{k}" x="{x:.9g}" y="{y:.9g}" z="0.0"/>'
            for k, (x, y) in enumerate(_seen(name).T)
            if x == x
        ]
        particles += f'<particle nSpots="{len(spots)}">{"".join(spots)}</particle>'
    units = 'spaceUnits="pixel" frameInterval="0.04" timeUnits="sec"'
    return f'<Tracks nTracks="2" {units}>{particles}</Tracks>'.encode()


def tracker() -> bytes:
    """Tracker's own axes: y upwards, here in cm."""
    lines = ["#multi:", "\tfront\t\trear\t\t", "t\tx\ty\tx\ty\t"]
    places = np.concatenate([_seen(name) * [[PIXEL_CM], [-PIXEL_CM]] for name in DOTS])
    for time, row in zip(TIME, places.T, strict=True):
        lines.append("\t".join("" if v != v else f"{v:.9E}" for v in (time, *row)) + "\t")
    return "\n".join([*lines, ""]).encode()


def idtrackerai_csv() -> bytes:
    return ("seconds,x1,y1,x2,y2\n" + _rows(TIME, *_seen("front"), *_seen("rear"))).encode()


def idtrackerai_h5(path: Path) -> None:
    import h5py

    with h5py.File(path, "w") as file:
        file["trajectories"] = np.stack([_seen(name).T for name in DOTS], 1)
        file.attrs["frames_per_second"] = 25


def motive() -> bytes:
    """A rigid body with two markers; its x axis points to the head, y is up, z to the camera's lower edge."""
    x, z = CENTRE * PIXEL_CM / 100
    w, y = np.cos(HEADING / 2), np.sin(HEADING / 2)
    zero = np.zeros(len(FRAMES))
    body = np.stack([zero, y, zero, w, x, zero + 0.02, z])
    body[:, LOST] = np.nan
    heads = ["Format Version,1.23,Take Name,Take 1,Rotation Type,Quaternion,Length Units,Meters", "",
             ",Type" + 7 * ",Rigid Body" + 6 * ",Marker", ",Name" + 7 * ",robot" + 3 * ",front" + 3 * ",rear",
             ",ID" + 13 * ",1", "," + 4 * ",Rotation" + 9 * ",Position",
             "Frame,Time (Seconds),X,Y,Z,W" + 3 * ",X,Y,Z"]  # fmt: skip
    dots = [c for name in DOTS for c in (_seen(name)[0] * PIXEL_CM / 100, zero, _seen(name)[1] * PIXEL_CM / 100)]
    return ("\n".join(heads) + "\n" + _rows(FRAMES, TIME, *body, *dots)).encode()


def tum() -> bytes:
    """A trajectory in m and s since 1970, with y upwards."""
    x, y = CENTRE * [[PIXEL_CM / 100], [-PIXEL_CM / 100]]
    x[LOST] = np.nan
    rows = [
        f"{1.7e9 + t:.4f} {a:.9f} {b:.9f} 0 0 0 {np.sin(h / 2):.9f} {np.cos(h / 2):.9f}"
        for t, a, b, h in zip(TIME, x, y, HEADING, strict=True)
    ]
    return "\n".join(["# ground truth", "# timestamp tx ty tz qx qy qz qw", *rows, ""]).encode()
