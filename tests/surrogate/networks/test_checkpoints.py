"""Training that is killed and goes on, and the device that it runs on."""

from __future__ import annotations

import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import torch
from torch.utils._python_dispatch import TorchDispatchMode
from torch.utils._pytree import tree_leaves

import surrogate.networks.checkpoints
from sim.io.errors import InputError
from surrogate.networks.checkpoints import Checkpoint, TrainingContext, device_named, remove_states
from surrogate.networks.trainable import TrainableEnsemble
from surrogate.networks.training_loop import Problem, Settings, Watch, _adam, fit
from tests.processes import LIMIT
from tests.surrogate.small import table

SMALL = Settings(width=8, depth=2, members=2, epochs=6, batch=16, iterations=12)
# Trains the small table of these tests, and kills itself after so many states.
KILLED = """
import os, signal, sys
from pathlib import Path
import numpy as np
import torch
import surrogate.networks.checkpoints as checkpoints
from sim import object_code
from surrogate.training.train import learn
from tests.surrogate.small import CURVES, TAILS, flips, rows

torch.set_num_threads(1)  # as in the tests
checkpoints.EVERY = checkpoints._SHARE = 0.0
object_code.object_code = None  # loops are read from disk, not compiled here
left, write = int(sys.argv[2]), checkpoints.Checkpoint.write

def counted(self, state, *, now=False):
    global left
    write(self, state, now=now)
    left -= 1
    if not left:
        os.kill(os.getpid(), signal.SIGKILL)

checkpoints.Checkpoint.write = counted
held = rows(256, 13, wide=False)
halves = held.at(np.arange(len(held)) % 2 == 0)
context = checkpoints.TrainingContext("train", folder=Path(sys.argv[1]))
found = learn(rows(), halves, held, flips(), TAILS, CURVES, work=context)
print(found.identity)
"""


class OneDevice(TorchDispatchMode):
    """Every operation has its tensors on one device, but for copies and single numbers."""

    def __torch_dispatch__(self, func: Any, types: Any, args: Any = (), kwargs: Any = None) -> Any:
        tensors = [
            part for part in tree_leaves((args, kwargs or {})) if isinstance(part, torch.Tensor) and part.dim()
        ]
        assert len({part.device for part in tensors}) <= 1 or "copy" in str(func), func
        return func(*args, **(kwargs or {}))


def run(folder: Path, states: int) -> subprocess.CompletedProcess[str]:
    root = Path(__file__).parents[3]
    return subprocess.run(
        [sys.executable, "-c", KILLED, str(folder), str(states)],
        capture_output=True,
        text=True,
        cwd=root,
        timeout=LIMIT,
    )


def problem(count: int = 64) -> tuple[torch.Tensor, torch.Tensor]:
    generator = torch.Generator().manual_seed(3)
    x = torch.randn(count, 3, generator=generator, dtype=torch.float64)
    return x, torch.stack([x[:, 0].sin(), x[:, 1] * x[:, 2]], -1)


def trained(
    work: TrainingContext, settings: Settings = SMALL, wanted: torch.Tensor | None = None
) -> TrainableEnsemble:
    x, y = problem()
    network = TrainableEnsemble(
        3, 2, width=settings.width, depth=settings.depth, members=settings.members, seed=settings.seed
    )
    fit(network, x, (y if wanted is None else wanted,), lambda y, wanted: y - wanted, settings, work)
    return network


@pytest.mark.rest
def test_training_that_is_killed_twice_goes_on_to_the_same_bytes(tmp_path: Path) -> None:
    folder = tmp_path / "model.pt.states"
    goes_on = "train: tails of N = 3 and more, network 1 of 5: goes on after epoch 10 of 40"
    for count, where in ((10, None), (120, goes_on)):
        killed = run(folder, count)
        assert killed.returncode == -signal.SIGKILL
        assert where is None or where in killed.stderr
    done = run(folder, 10**9)
    assert done.returncode == 0, done.stderr
    assert "goes on after iteration 30 of 60, member 2 of 2" in done.stderr
    assert done.stdout.split() == [table().identity]
    again = run(folder, 10**9)
    assert again.stdout == done.stdout
    assert "tails of N = 3 and more, network 1 of 5: was finished before" in again.stderr
    assert "iteration" not in again.stderr


@pytest.mark.parametrize("stop", [1, 4, 6, 8, 17, 18, 19, 30])
def test_every_state_leads_to_the_same_numbers(stop: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(surrogate.networks.checkpoints, "EVERY", 0.0)
    monkeypatch.setattr(surrogate.networks.checkpoints, "_SHARE", 0.0)
    written, write = [], Checkpoint.write

    def stopping(self: Checkpoint, state: object, *, now: bool = False) -> None:
        write(self, state, now=now)  # type: ignore[arg-type]
        written.append(self.path)
        if len(written) == stop:
            raise KeyboardInterrupt

    monkeypatch.setattr(Checkpoint, "write", stopping)
    with pytest.raises(KeyboardInterrupt):
        trained(TrainingContext(folder=tmp_path))
    monkeypatch.setattr(Checkpoint, "write", write)
    resumed, uninterrupted = (
        trained(TrainingContext(folder=tmp_path)).state_dict(),
        trained(TrainingContext()).state_dict(),
    )
    for name, part in uninterrupted.items():
        assert torch.equal(resumed[name], part), name


def test_a_state_of_other_data_or_settings_is_not_used(tmp_path: Path) -> None:
    work = TrainingContext(folder=tmp_path)
    trained(work)
    _, y = problem()
    for settings, wanted in ((SMALL, y + 1e-9), (replace(SMALL, epochs=7), y)):
        with_others = trained(work, settings, wanted).state_dict()
        alone = trained(TrainingContext(), settings, wanted).state_dict()
        assert all(torch.equal(with_others[name], part) for name, part in alone.items())
    assert len(list(tmp_path.iterdir())) == 3


def test_networks_are_numbered_where_their_total_is_known() -> None:
    work = TrainingContext("train", networks=2)
    titles = [work.part(name).of_network().title for name in ("tails", "gap")]
    assert titles == ["train: tails, network 1 of 2", "train: gap, network 2 of 2"]
    assert TrainingContext("train").of_network().title == "train"


def test_a_broken_state_is_not_used(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    work = TrainingContext(folder=tmp_path)
    whole = trained(work).state_dict()
    (state,) = tmp_path.iterdir()
    state.write_bytes(state.read_bytes()[:500])
    again = trained(work).state_dict()
    assert all(torch.equal(again[name], part) for name, part in whole.items())
    assert "cannot be read" in capsys.readouterr().err


def test_states_are_removed_and_nothing_else(tmp_path: Path) -> None:
    folder = tmp_path / "states"
    trained(TrainingContext(folder=folder))
    (folder / "notes.txt").write_text("mine")
    remove_states(folder)
    assert [file.name for file in folder.iterdir()] == ["notes.txt"]
    (folder / "notes.txt").unlink()
    remove_states(folder)
    assert not folder.exists()


def test_a_device_that_is_not_there_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    assert device_named("cpu") == device_named("auto") == "cpu"
    with pytest.raises(InputError, match="no CUDA device"):
        device_named("cuda")
    with pytest.raises(InputError, match="device tpu"):
        device_named("tpu")
    monkeypatch.setattr(torch.cuda, "is_available", lambda: True)
    assert (device_named("cpu"), device_named("auto"), device_named("cuda")) == ("cpu", "cuda", "cuda")


def test_no_tensor_of_the_training_stays_on_the_processor() -> None:
    """Tried on the device "meta", which every torch has: its tensors have no numbers."""
    x, y = (part.to("meta") for part in problem())
    network = TrainableEnsemble(3, 2, width=8, depth=2, members=2, seed=1).to("meta")
    with OneDevice(), pytest.raises(AssertionError):
        network.standardised(problem()[0])
    own = Problem(x, (y,), torch.ones(len(x), dtype=x.dtype, device="meta"), lambda y, wanted: y - wanted)
    bar = type("Bar", (), {"disable": True})
    with OneDevice():
        _adam(network, own, SMALL, Watch(own, Checkpoint(None), bar, "%"), {"stage": "start"})
        assert own.loss(network.member(1), own.every(), 0.1).device.type == "meta"
        assert own.errors(network, own.every()).device.type == "meta"
    assert {part.device.type for part in network.state_dict().values()} == {"meta"}


@pytest.mark.skipif(not torch.cuda.is_available(), reason="there is no CUDA device here")
def test_training_on_a_cuda_device_ends_like_that_on_the_processor() -> None:
    here, there = trained(TrainingContext()), trained(TrainingContext(device="cuda"))
    x, _ = problem()
    assert {part.device.type for part in there.state_dict().values()} == {"cpu"}
    assert torch.allclose(here(x), there(x), atol=0.05)
