"""Networks: alike in loops, with arrays and with torch; a quick minimiser; training that stops goes on."""

from __future__ import annotations

import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from scipy.optimize import minimize, rosen, rosen_der
from torch import Tensor
from torch.utils._python_dispatch import TorchDispatchMode
from torch.utils._pytree import tree_leaves

import surrogate.training.networks
from common.errors import InputError
from surrogate.network import Ensemble, state_shapes
from surrogate.table import NeuralTable
from surrogate.training import fits
from surrogate.training.bfgs import Minimiser, SymmetricMatrix
from surrogate.training.networks import (
    Checkpoint,
    Problem,
    Settings,
    TrainableEnsemble,
    TrainingContext,
    _adam,
    device_named,
    fit,
    remove_states,
)
from surrogate.training.train import learn
from tests.processes import LIMIT, ROOT
from tests.surrogate.small import flips, rows

SMALL = Settings(width=8, depth=2, members=2, epochs=6, batch=16, iterations=12)
# Trains the small table of these tests, and kills itself after so many states.
KILLED = """
import os, signal, sys
from pathlib import Path
import torch
import surrogate.training.networks as checkpoints
from tests.surrogate.test_networks import quickly_learned

torch.set_num_threads(1)  # as in the tests
checkpoints.EVERY = checkpoints._SHARE = 0.0
left, write = int(sys.argv[2]), checkpoints.Checkpoint.write

def counted(self, state, *, now=False):
    global left
    write(self, state, now=now)
    left -= 1
    if not left:
        os.kill(os.getpid(), signal.SIGKILL)

checkpoints.Checkpoint.write = counted
print(quickly_learned(checkpoints.TrainingContext("train", folder=Path(sys.argv[1]))).identity)
"""


def quickly_learned(work: TrainingContext | None = None) -> NeuralTable:
    """Train the smallest table on few of the small table's robots."""
    some, held = rows().at(np.arange(96)), rows(256, 13, wide=False)
    small = Settings(width=8, depth=1, members=2, epochs=12, iterations=12)
    halves = held.at(np.arange(len(held)) % 2 == 0)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(fits, "_GAP", small)
        curves, context = replace(small, members=1), work or TrainingContext()
        return learn(some, halves, held, flips(), small, curves, context=context)


class OneDevice(TorchDispatchMode):
    """Every operation has its tensors on one device, but for copies and single numbers."""

    def __torch_dispatch__(self, func: Any, types: Any, args: Any = (), kwargs: Any = None) -> Any:
        tensors = [
            part for part in tree_leaves((args, kwargs or {})) if isinstance(part, torch.Tensor) and part.dim()
        ]
        assert len({part.device for part in tensors}) <= 1 or "copy" in str(func), func
        return func(*args, **(kwargs or {}))


def run(folder: Path, states: int) -> subprocess.CompletedProcess[str]:
    words = [sys.executable, "-c", KILLED, str(folder), str(states)]
    return subprocess.run(words, capture_output=True, text=True, cwd=ROOT, timeout=LIMIT)


def problem(count: int = 64) -> tuple[torch.Tensor, torch.Tensor]:
    generator = torch.Generator().manual_seed(3)
    x = torch.randn(count, 3, generator=generator, dtype=torch.float64)
    return x, torch.stack([x[:, 0].sin(), x[:, 1] * x[:, 2]], -1)


def trained(
    work: TrainingContext, settings: Settings = SMALL, wanted: torch.Tensor | None = None
) -> dict[str, torch.Tensor]:
    """Train a network; return its numbers."""
    x, y = problem()
    shape = {name: getattr(settings, name) for name in ("width", "depth", "members", "seed")}
    network = TrainableEnsemble(3, 2, **shape)
    fit(network, x, (y if wanted is None else wanted,), lambda y, wanted: y - wanted, settings, work)
    return network.state_dict()


def same(one: dict[str, torch.Tensor], other: dict[str, torch.Tensor]) -> bool:
    return all(torch.equal(one[name], part) for name, part in other.items())


@pytest.mark.rest
def test_training_that_is_killed_twice_goes_on_to_the_same_bytes(tmp_path: Path) -> None:
    folder = tmp_path / "model.pt.states"
    goes_on = "train: tails of N = 3 and more, network 1 of 5: goes on after epoch 10 of 12"
    for count, where in ((10, None), (24, goes_on)):
        killed = run(folder, count)
        assert killed.returncode == -signal.SIGKILL
        assert where is None or where in killed.stderr
    done = run(folder, 10**9)
    assert done.returncode == 0, done.stderr
    assert "goes on after iteration 10 of 12, member 2 of 2" in done.stderr
    assert done.stdout.split() == [quickly_learned().identity]
    again = run(folder, 10**9)
    assert again.stdout == done.stdout
    assert "tails of N = 3 and more, network 1 of 5: was finished before" in again.stderr
    assert "iteration" not in again.stderr


@pytest.mark.parametrize("stop", [1, 6, 8, 18, 30])
def test_every_state_leads_to_the_same_numbers(stop: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(surrogate.training.networks, "EVERY", 0.0)
    monkeypatch.setattr(surrogate.training.networks, "_SHARE", 0.0)
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
    assert same(trained(TrainingContext(folder=tmp_path)), trained(TrainingContext()))


def test_a_state_of_other_data_or_settings_and_a_broken_one_are_not_used(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    work = TrainingContext(folder=tmp_path)
    whole = trained(work)
    (state,) = tmp_path.iterdir()
    state.write_bytes(state.read_bytes()[:500])
    assert same(trained(work), whole)
    assert "cannot be read" in capsys.readouterr().err
    _, y = problem()
    for settings, wanted in ((SMALL, y + 1e-9), (replace(SMALL, epochs=7), y)):
        assert same(trained(work, settings, wanted), trained(TrainingContext(), settings, wanted))
    assert len(list(tmp_path.iterdir())) == 3


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
    with OneDevice():
        _adam(network, own, SMALL, Checkpoint(None), lambda _: None, {"stage": "start"})
        assert own.loss(network.member(1), own.every(), 0.1).device.type == "meta"
        assert own.errors(network, own.every()).device.type == "meta"
    assert {part.device.type for part in network.state_dict().values()} == {"meta"}


@pytest.mark.skipif(not torch.cuda.is_available(), reason="there is no CUDA device here")
def test_training_on_a_cuda_device_ends_like_that_on_the_processor() -> None:
    here, there = trained(TrainingContext()), trained(TrainingContext(device="cuda"))
    assert {part.device.type for part in there.values()} == {"cpu"}
    assert all(torch.allclose(here[name], part, atol=0.05) for name, part in there.items())


@pytest.mark.parametrize(("inputs", "width", "depth", "members"), [(7, 64, 3, 1), (6, 5, 1, 3), (9, 10, 2, 2)])
def test_networks_answer_alike_in_loops_and_with_torch(inputs: int, width: int, depth: int, members: int) -> None:
    random = np.random.default_rng(4)
    shapes = state_shapes(inputs=inputs, outputs=inputs - 4, width=width, depth=depth, members=members)
    network = Ensemble.from_state({name: random.uniform(0.5, 1.5, shape) for name, shape in shapes.items()})
    x = random.standard_normal((20, inputs))
    answer = network(x)
    assert network.members_at(x).mean(0) == pytest.approx(answer, rel=1e-12)
    trainable = TrainableEnsemble(**network.shape, seed=0)
    trainable.load_state_dict({name: torch.from_numpy(array) for name, array in network.state.items()})
    y = trainable.standardised((torch.from_numpy(x) - trainable.shift) / trainable.scale)
    assert (y * trainable.spread + trainable.mean).mean(0).detach().numpy() == pytest.approx(answer, rel=1e-12)
    assert {k: a.tolist() for k, a in trainable.trained().state.items()} == {
        k: a.tolist() for k, a in network.state.items()
    }


@pytest.mark.parametrize("count", [1, 3, 64, 65, 200])
def test_a_symmetric_matrix_in_strips_is_that_matrix(count: int) -> None:
    rng = torch.Generator().manual_seed(count)
    a, b, vector = (torch.randn(count, generator=rng, dtype=torch.float64) for _ in range(3))
    matrix, whole = SymmetricMatrix(count, 0.3, a), 0.3 * torch.eye(count, dtype=torch.float64)
    assert torch.allclose(matrix.times(vector), whole @ vector, rtol=1e-13)
    for scale in (1.0, 1.7):
        matrix.update(scale, a, b)
        other = SymmetricMatrix(count, 1.0, a)
        other.load_state_dict(matrix.state_dict())
        whole = scale * whole + torch.outer(a, b) + torch.outer(b, a)
        assert torch.allclose(matrix.times(vector), whole @ vector, rtol=1e-12, atol=1e-12)
        assert torch.equal(other.times(a), matrix.times(a))


def rosenbrock(x: Tensor) -> tuple[float, Tensor]:
    return float(rosen(x.numpy())), torch.as_tensor(rosen_der(x.numpy()))


def test_it_reaches_the_minimum_of_a_narrow_valley_as_quickly_as_scipy() -> None:
    start = np.full(20, -1.2)
    found = Minimiser(rosenbrock, torch.as_tensor(start))
    steps = 0
    while found.value > 1e-16 and steps < 1000:
        assert found.step()
        steps += 1
    assert found.x.numpy() == pytest.approx(np.ones(20), abs=1e-7)
    assert steps <= 1.5 * minimize(rosen, start, jac=rosen_der, method="BFGS", options={"gtol": 1e-9}).nit


@pytest.mark.parametrize("size", [1e-4, 1e-8])
def test_it_takes_steps_that_are_much_smaller_than_its_first_trial(size: float) -> None:
    """On the loss of a network, from a start as near to its valley as Adam gets."""
    weights = torch.tensor([1.0, 3.0, 10.0], dtype=torch.float64) / size

    def loss(x: Tensor) -> tuple[float, Tensor]:
        point = x.clone().requires_grad_(True)
        value = (((weights * point) ** 2 + 1e-4) ** 0.25).sum()
        return value.item(), torch.autograd.grad(value, point)[0]

    minimiser, steps = Minimiser(loss, torch.full((3,), size, dtype=torch.float64)), 0
    while steps < 200 and minimiser.step():
        steps += 1
    assert minimiser.value == pytest.approx(0.3, rel=1e-9)


def test_it_stops_at_a_minimum_and_where_the_function_breaks_down() -> None:
    at_rest = Minimiser(lambda x: (float(x @ x), 2 * x), torch.zeros(3, dtype=torch.float64))
    assert not at_rest.step()
    broken = Minimiser(lambda x: (float("nan"), torch.full_like(x, torch.nan)), torch.ones(3, dtype=torch.float64))
    assert not broken.step()
    assert torch.equal(broken.x, torch.ones(3, dtype=torch.float64))
