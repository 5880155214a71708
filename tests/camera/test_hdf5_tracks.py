"""Tracks in HDF5 that would load objects, read other files, or have impossible frame rates."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from camera.pose_tracks import read_tracks
from common.errors import InputError
from tests.camera.test_pose_tracks import ANIMALS, FILMED, written

h5py = pytest.importorskip("h5py", reason="HDF5 needs h5py: pip install 'softflagella[hdf5]'")


@pytest.mark.parametrize("rate", [-1.0, 0.0, 1e-320, np.inf, np.nan])
def test_frame_rates_that_cannot_be_are_refused(rate: float, tmp_path: Path) -> None:
    path = written("trajectories.h5", tmp_path)
    with h5py.File(path, "a") as file:
        file.attrs["frames_per_second"] = rate
    with pytest.raises(InputError, match=r"frame rate, above 0 and finite|division by zero"):
        read_tracks(path, written_by="idtrackerai", scale="0.5mm", **ANIMALS)


@pytest.mark.parametrize("names", [
    pickle.dumps(Path("a")), pickle.dumps(np.zeros(6)), b"cnumpy\ndtype\n(X\x02\0\0\0O8K\0K\x01tR.",
    b"\x80\x04g1\n.", b"\0",
])  # fmt: skip
def test_of_a_pickle_within_hdf5_only_texts_are_read(names: bytes, tmp_path: Path) -> None:
    """An array of objects that a pickle makes of raw bytes takes them for addresses."""
    path = written("run3DLC_resnet50_swim.h5", tmp_path)
    with h5py.File(path, "a") as file:
        file["df_with_missing/table"].attrs["values_block_0_kind"] = np.void(names)
    with pytest.raises(InputError, match=r"is not as DeepLabCut writes it"):
        read_tracks(path, written_by="deeplabcut", **FILMED)


def _outside(file: Any, places: np.ndarray, folder: Path) -> None:
    places.tofile(folder / "outside.bin")
    file.create_dataset(
        "trajectories", places.shape, places.dtype, external=[(folder / "outside.bin", 0, places.nbytes)]
    )


def _virtual(file: Any, places: np.ndarray, folder: Path) -> None:
    with h5py.File(folder / "other.h5", "w") as other:
        other["trajectories"] = places
        layout = h5py.VirtualLayout(places.shape, places.dtype)
        layout[:] = h5py.VirtualSource(other["trajectories"])
    file.create_virtual_dataset("trajectories", layout)


def _linked(file: Any, places: np.ndarray, folder: Path) -> None:
    _virtual(file, places, folder)
    del file["trajectories"]
    file["trajectories"] = h5py.ExternalLink(folder / "other.h5", "trajectories")


def _objects(file: Any, places: np.ndarray, folder: Path) -> None:
    file.create_dataset("trajectories", places.shape, h5py.ref_dtype)


def _large(file: Any, places: np.ndarray, folder: Path) -> None:
    file.create_dataset("trajectories", (10**9, 2, 2), "<f8", chunks=(1000, 2, 2))


@pytest.mark.parametrize(("store", "words"), [
    (_outside, "'trajectories' lies in other files, which is not read; export the tracks as CSV"),
    (_virtual, "'trajectories' lies in other files, which is not read"),
    (_linked, "is not as idtracker.ai writes it"),
    (_objects, "'trajectories' holds objects, which is not read"),
    (_large, "'trajectories' has more than 268435456 bytes, which is not read"),
])  # fmt: skip
def test_hdf5_is_read_within_its_file_and_size(
    store: Callable[[Any, np.ndarray, Path], None], words: str, tmp_path: Path
) -> None:
    path = written("trajectories.h5", tmp_path)
    with h5py.File(path, "a") as file:
        places = file["trajectories"][:]
        del file["trajectories"]
        store(file, places, tmp_path)
    with pytest.raises(InputError, match=words) as refusal:
        read_tracks(path, written_by="idtrackerai", scale="0.5mm", **ANIMALS)
    assert path.name in str(refusal.value)
