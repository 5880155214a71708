"""The lens of a camera from pictures of a chessboard: focal length, centre, distortion, by OpenCV's calibration.

The board is flat and its squares are equal; their size does not matter. Each picture shows it in another pose. The
inner corners are found to a fraction of a pixel, and lens and poses are fitted to all of them at once (Zhang, IEEE
Trans. Pattern Anal. Mach. Intell. 22, 1330, 2000). Boards that all face the camera leave the focal length open,
and the distortion is known only where corners were. Both are said.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from camera.view import Lens, opencv
from common.errors import InputError, naming
from common.reading import read_bytes

_FEWEST = 3  # pictures
_REFINED = (3, 50, 1e-3)  # at most 50 steps, down to steps of 0.001 pixels
_UNSURE = 0.02  # relative standard error of the focal length
_SEEN = 3.0  # standard errors of k3, below which it is 0: it would spoil the edges
_SPREAD = 0.7  # of the picture's width and height, that the corners cover
_MISFIT = 1.0  # pixels, reprojection error of a good calibration at most


class LensFit(NamedTuple):
    """A calibrated lens."""

    lens: Lens
    error: float  # reprojection error, rms [pixels]
    pictures: int  # in which the board was found
    notes: list[str]  # what is doubtful, and what to change

    def lines(self) -> str:
        """Write the table [lens] of a view.toml."""
        matrix = self.lens.matrix
        parts = matrix.diagonal()[:2], matrix[:2, 2], self.lens.distortion
        focal, centre, distortion = (", ".join(f"{value:.5f}" for value in part) for part in parts)
        return (
            f"[lens]  # {self.pictures} pictures of a chessboard, reprojection error {self.error:.2g} pixels\n"
            f"focal_px = [{focal}]\ncentre_px = [{centre}]\ndistortion = [{distortion}]\n"
        )


def calibrate_lens(pictures: Sequence[str | Path], *, squares: str = "10x7") -> LensFit:
    """Fit the lens to pictures of a chessboard.

    Args:
        pictures: files of one camera, all of one size and zoom.
        squares: of the board, across and down.

    Raises:
        InputError: a file is no picture, sizes differ, or the board is found in fewer than three pictures.
    """
    cv2 = opencv()
    count = re.fullmatch(r"(\d\d?)x(\d\d?)", squares)
    across, down = (int(part) - 1 for part in count.groups()) if count else (0, 0)
    if min(across, down) < 2:
        raise InputError(f"squares {squares!r}; give those of the board across and down, 10x7")
    flags = cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_ACCURACY
    size, seen, notes = (0, 0), list[Any](), list[str]()
    for path in pictures:
        with naming(path):
            data = np.frombuffer(read_bytes(path), np.uint8)
            picture = cv2.imdecode(data, cv2.IMREAD_GRAYSCALE) if len(data) else None
            if picture is None:
                raise InputError("no picture that can be read; give a PNG or a JPEG")
            own = (picture.shape[1], picture.shape[0])
            size = size if seen or notes else own
            if own != size:
                raise InputError(
                    f"{own[0]} × {own[1]} pixels, others {size[0]} × {size[1]}; give pictures of one size"
                )
        good, corners = cv2.findChessboardCornersSB(picture, (across, down), flags=flags)
        if good:
            # The window of the refinement must not reach the next corner.
            steps = np.linalg.norm(np.diff(corners.reshape(down, across, 2), axis=1), axis=2)
            reach = max(int(steps.min() / 3), 2)
            corners = cv2.cornerSubPix(picture, corners, (reach, reach), (-1, -1), _REFINED)
            seen.append(corners.reshape(-1, 2))
        else:
            notes.append(f"{path}: no board of {squares} squares")
    if len(seen) < _FEWEST:
        raise InputError(
            f"the board of {squares} squares is found in {len(seen)} of {len(pictures)} pictures, and a lens "
            f"takes {_FEWEST}; show the whole board with a white border, and count its squares, --squares 10x7"
        )
    board = np.zeros((across * down, 3), np.float32)
    board[:, :2] = np.mgrid[:across, :down].T.reshape(-1, 2)
    # The sixth-order term of the distortion is kept only where the pictures show it.
    for flags in (0, cv2.CALIB_FIX_K3):
        error, matrix, distortion, *_, sigmas, _, _ = cv2.calibrateCameraExtended(
            [board] * len(seen), seen, size, np.eye(3), np.zeros(5), flags=flags
        )
        if abs(distortion.ravel()[4]) > _SEEN * sigmas.ravel()[8]:
            break
    lens = Lens(matrix, distortion.ravel()[:5])
    unsure = float(np.max(sigmas.ravel()[:2] / matrix.diagonal()[:2]))
    if unsure > _UNSURE:
        notes.append(
            f"the focal length is uncertain by {100 * unsure:.0f} %: tilt the board more, each time otherwise"
        )
    if error > _MISFIT:
        notes.append(f"a reprojection error of {error:.1f} pixels: is the board flat, are the pictures sharp?")
    if (np.ptp(np.concatenate(seen), axis=0) < _SPREAD * np.array(size)).any():
        notes.append("the board was never near the edges, where the distortion stays unknown: show it there, too")
    return LensFit(lens, float(error), len(seen), notes)
