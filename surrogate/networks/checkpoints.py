"""How networks are trained: on which device, with which progress bar, and where their states are kept.

A network that is trained for a long time writes its state from time to time into a folder beside the model. After
a kill, the same command reads it and goes on; the result has the same bytes as without the kill. The name of a
state is a hash over the code, the settings and all numbers that the training starts from. So a state of other
data, settings or code is never used. States are written completely or not at all.
"""

from __future__ import annotations

import hashlib
import pickle
import platform
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from itertools import count
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from sim.io.errors import InputError
from sim.io.files import whole_file
from sim.io.provenance import fingerprint

DEVICES = ("cpu", "cuda", "auto")
EVERY = 5.0  # s of wall time between two states of a network
_SHARE = 20.0  # and at least this many times as long as writing one took
_ENDING = ".state"
State = dict[str, Any]  # tensors and plain values


def device_named(name: str) -> str:
    """Return the device to train on, "cpu" or "cuda".

    Args:
        name: one of DEVICES; auto is cuda where there is one.

    Raises:
        InputError: no such device.
    """
    if name not in DEVICES:
        raise InputError(f"device {name}; allowed are {', '.join(DEVICES)}")
    has_cuda = torch.cuda.is_available()
    if name == "cuda" and not has_cuda:
        raise InputError("there is no CUDA device that torch can use; choose the device cpu")
    return "cuda" if has_cuda and name != "cpu" else "cpu"


@dataclass(frozen=True)
class TrainingContext:
    """How networks are trained."""

    title: str = ""  # of the progress bars; empty for none
    device: str = "cpu"
    folder: Path | None = None  # of the states; None: none are kept
    networks: int = 0  # that are trained in all; 0: nobody has counted them
    numbers: Iterator[int] = field(default_factory=lambda: count(1))  # of the networks, shared by all parts

    def part(self, name: str) -> TrainingContext:
        """Return the same for one part of the work, named in the title."""
        return replace(self, title=f"{self.title}: {name}" if self.title else "")

    def of_network(self) -> TrainingContext:
        """Return the same for the next network, numbered in the title where their total is known."""
        number = next(self.numbers)
        if not (self.title and self.networks):
            return self
        return replace(self, title=f"{self.title}, network {number} of {self.networks}")

    def checkpoint(self, network: Mapping[str, Tensor], data: Sequence[Tensor], settings: object) -> Checkpoint:
        """Return the place of the state of a network that starts from these numbers."""
        if self.folder is None:
            return Checkpoint(None)
        numbers = [_hashed(part) for part in (*network.values(), *data)]
        key = fingerprint([_code(), self.device, list(network), numbers, settings])
        return Checkpoint(self.folder / f"{key}{_ENDING}")

    def say(self, words: str) -> None:
        """Print a line about this part, where there are progress bars."""
        if self.title:
            print(f"{self.title}: {words}", file=sys.stderr)


def remove_states(folder: str | Path) -> None:
    """Remove the states in a folder, and the folder if nothing else is in it."""
    if not Path(folder).is_dir():
        return
    for file in Path(folder).glob(f"*{_ENDING}"):
        file.unlink(missing_ok=True)
    if not any(Path(folder).iterdir()):
        Path(folder).rmdir()


class Checkpoint:
    """The state of one network in a file; without a path nothing is kept."""

    def __init__(self, path: Path | None):
        self.path = path
        self._next = time.monotonic() + EVERY

    def read(self) -> State | None:
        """Return the state that was written last; None where there is none that can be read."""
        if self.path is None or not self.path.is_file():
            return None
        try:
            state: State = torch.load(self.path, weights_only=True, map_location="cpu")
        except (RuntimeError, EOFError, OSError, ValueError, KeyError, pickle.UnpicklingError):
            print(f"{self.path} cannot be read, so this network is trained from its start", file=sys.stderr)
            return None
        return state

    def write(self, state: Callable[[], State], *, now: bool = False) -> None:
        """Write the state, unless the last one was written a short time ago."""
        began = time.monotonic()
        if self.path is None or not (now or began >= self._next):
            return
        with whole_file(self.path) as part:
            torch.save(state(), part)
        ended = time.monotonic()
        self._next = ended + max(EVERY, _SHARE * (ended - began))


@cache
def _code() -> str:
    """Return the hash of the code that trains, and of what it runs on."""
    digest = hashlib.sha256(f"{torch.__version__} {platform.machine()}".encode())
    for file in sorted(Path(__file__).parents[1].rglob("*.py")):
        digest.update(file.read_bytes())
    return digest.hexdigest()


def _hashed(part: Tensor) -> str:
    array = part.detach().cpu().contiguous()
    return hashlib.sha256(f"{array.dtype} {tuple(array.shape)}".encode() + array.numpy().tobytes()).hexdigest()
