"""Fit networks: Adam in small batches, then BFGS on all rows, with a loss that is robust against outliers.

    loss = mean over rows of (w² |r|² + ε²)^¼,   r = residual of a row, in units of the target, w = weight

The error of a network is a hundred times larger in some corners than in the middle. Least squares would serve only
those corners: with it the median error is five times as large. ε falls from 0.1 to 0.0005 while Adam runs. The
optimiser needs double precision: the residuals are as small as 1e-5.

BFGS keeps its whole matrix (`surrogate.training.bfgs`). In equal time L-BFGS ends with errors two to four times as
large (docs/explanation/lookup.md). Everything is repeatable from the seed on one machine.

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
from dataclasses import asdict, dataclass, field, replace
from functools import cache
from itertools import count
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn
from torch.nn.utils import parameters_to_vector, vector_to_parameters

from common.errors import InputError
from common.files import whole_file
from common.progress import progress_bar
from common.provenance import fingerprint
from surrogate.network import SHARED, Ensemble, state_shapes
from surrogate.training.bfgs import Minimiser

DEVICES = ("cpu", "cuda", "auto")
EVERY = 5.0  # s of wall time between two states of a network
_SHARE = 20.0  # and at least this many times as long as writing one took
_ENDING = ".state"
State = dict[str, Any]  # tensors and plain values
Show = Callable[[Any], None]  # the network of now on the progress bar
Residual = Callable[..., Tensor]  # y (K, m, O), and data of the same m rows -> r (K, m, D)
_POWER = 0.25
_SOFTEST, _HARDEST = 0.1, 5e-4  # ε
_ROWS = 4096  # whose layers fit into a processor's cache
_STAGE = 50  # BFGS iterations between two steps of the progress bar
_LEVEL = 0.95  # of the rows: the error that the bar shows


class TrainableEnsemble(nn.Module):
    """K perceptrons, each plus a linear map; inputs (M, F), outputs (M, O)."""

    shift: Tensor
    scale: Tensor
    mean: Tensor
    spread: Tensor

    def __init__(self, inputs: int, outputs: int, *, width: int, depth: int, members: int, seed: int):
        super().__init__()
        self.shape = {"inputs": inputs, "outputs": outputs, "width": width, "depth": depth, "members": members}
        shapes = state_shapes(**self.shape)
        generator = torch.Generator().manual_seed(seed)

        def random(name: str) -> Tensor:
            return torch.randn(*shapes[name], generator=generator, dtype=torch.float64)

        layers = range(depth + 1)
        weights = [random(f"weights.{k}") for k in layers]
        weights = [w / w.shape[1] ** 0.5 * (0.3 if k == depth else 1.0) for k, w in enumerate(weights)]
        self.weights = nn.ParameterList([nn.Parameter(weight) for weight in weights])
        self.biases = nn.ParameterList([nn.Parameter(0.3 * random(f"biases.{k}")) for k in layers])
        self.bypass = nn.Parameter(torch.zeros(shapes["bypass"], dtype=torch.float64))
        for name, value in zip(SHARED, (0.0, 1.0, 0.0, 1.0), strict=True):
            self.register_buffer(name, torch.full(shapes[name], value, dtype=torch.float64))

    def trained(self) -> Ensemble:
        """Return the network with its numbers of now."""
        return Ensemble.from_state(
            {k: part.detach().cpu().numpy().copy() for k, part in self.state_dict().items()}
        )

    def member(self, k: int) -> TrainableEnsemble:
        """Return a network of one member: a copy of member k."""
        alone = TrainableEnsemble(**{**self.shape, "members": 1}, seed=0).to(self.shift.device)
        state = self.state_dict()
        alone.load_state_dict({n: part if n in SHARED else part[k : k + 1] for n, part in state.items()})
        return alone

    def replace_member(self, k: int, alone: TrainableEnsemble) -> None:
        """Take the numbers of a network of one member as member k."""
        with torch.no_grad():
            for mine, other in zip(self.parameters(), alone.parameters(), strict=True):
                mine[k] = other[0]

    def standardised(self, x: Tensor) -> Tensor:
        """Return outputs of every member before `mean` and `spread`, (K, M, O), for standardised inputs (M, F)."""
        hidden = x = x.expand(self.bypass.shape[0], -1, -1)
        for weight, bias in zip(self.weights[:-1], self.biases[:-1], strict=True):
            hidden = torch.tanh(hidden @ weight + bias)
        return hidden @ self.weights[-1] + self.biases[-1] + x @ self.bypass


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
    package = Path(__file__).parents[1]
    for file in sorted([*package.glob("training/*.py"), package / "network.py", package / "tails.py"]):
        digest.update(file.read_bytes())
    return digest.hexdigest()


def _hashed(part: Tensor) -> str:
    array = part.detach().cpu().contiguous()
    return hashlib.sha256(f"{array.dtype} {tuple(array.shape)}".encode() + array.numpy().tobytes()).hexdigest()


@dataclass(frozen=True)
class Settings:
    """How to train; the seed makes it repeatable."""

    width: int = 64
    depth: int = 3
    members: int = 2
    epochs: int = 150  # of Adam
    batch: int = 256
    learning_rate: float = 4e-3
    iterations: int = 600  # of BFGS
    seed: int = 1


@dataclass(frozen=True)
class Problem:
    """What is to be small: residuals of M rows, all on one device."""

    x: Tensor  # (M, F) inputs, shifted and scaled
    data: Sequence[Tensor]  # each (M, …)
    weights: Tensor  # (M,)
    residual: Residual

    def errors(self, network: TrainableEnsemble, rows: Tensor) -> Tensor:
        """Compute |r| of rows (m,), (K, m)."""
        return self._residuals(network, rows).norm(dim=-1)

    def loss(self, network: TrainableEnsemble, rows: Tensor, soft: float) -> Tensor:
        """Return the loss over rows (m,), summed over the members."""
        weighted = self._residuals(network, rows) * self.weights[rows, None]
        return ((weighted.square().sum(-1) + soft**2) ** _POWER).mean(1).sum()

    def every(self) -> Tensor:
        """Return indices of all rows, (M,)."""
        return torch.arange(len(self.x), device=self.x.device)

    def _residuals(self, network: TrainableEnsemble, rows: Tensor) -> Tensor:
        y = network.standardised(self.x[rows]) * network.spread + network.mean
        return self.residual(y, *(part[rows] for part in self.data))


def fit(
    network: TrainableEnsemble,
    inputs: Tensor,
    data: Sequence[Tensor],
    residual: Residual,
    settings: Settings,
    context: TrainingContext,
    *,
    weights: Tensor | None = None,
    unit: str = "%",
) -> None:
    """Train `network` in place.

    Args:
        network: with its shift and scale set.
        inputs: (M, F).
        data: what the residual needs beside the network's outputs, each (M, …).
        residual: what is to be small, as a fraction of what an error is relative to.
        context: device, progress bar, and where states are kept.
        weights: of the rows in the loss, (M,); by default 1.
        unit: in words, of the error that the progress bar shows: the residual that 95 % of the rows do not reach.
    """
    weights = torch.ones(len(inputs), dtype=inputs.dtype) if weights is None else weights
    context = context.of_network()
    checkpoint = context.checkpoint(network.state_dict(), (inputs, *data, weights), asdict(settings))
    state = checkpoint.read() or {"stage": "start"}
    network.to(context.device)
    inputs, weights, *data = (part.to(context.device) for part in (inputs, weights, *data))
    problem = Problem((inputs - network.shift) / network.scale, data, weights, residual)
    if "network" in state:
        network.load_state_dict(state["network"])
        context.say(_resumed(state, settings))
    if state["stage"] != "done":
        stages = -(-settings.iterations // _STAGE)
        total = settings.epochs + stages * settings.members
        begun, hidden = _steps(state, settings), not context.title
        with progress_bar(context.title, total=total, initial=begun, disable=hidden) as bar:

            def show(trained: TrainableEnsemble) -> None:
                """Advance the bar and show the error that 95 % of the learned rows do not reach."""
                if not bar.disable:
                    with torch.no_grad():
                        error = problem.errors(trained, problem.every()).mean(0).quantile(_LEVEL)
                    words = f"{100 * _LEVEL:.0f} % of the rows within {100 * float(error):.3g} {unit}"
                    bar.set_postfix_str(words, refresh=False)
                    bar.update()

            if state["stage"] != "BFGS":
                _adam(network, problem, settings, checkpoint, show, state)
            for k in range(state.get("member", 0), settings.members):
                _polish(network, k, problem, settings.iterations, checkpoint, show, state)
        checkpoint.write(lambda: {"stage": "done", "network": network.state_dict()}, now=True)
    network.to("cpu").requires_grad_(False)


def _adam(
    network: TrainableEnsemble,
    problem: Problem,
    settings: Settings,
    checkpoint: Checkpoint,
    show: Show,
    state: State,
) -> None:
    """Train in small batches, all members side by side."""
    network.requires_grad_(True)
    generator = torch.Generator().manual_seed(settings.seed)
    adam = torch.optim.Adam(network.parameters(), lr=settings.learning_rate)
    batches = -(-len(problem.x) // settings.batch)
    steps = max(settings.epochs * batches, 100)
    schedule = torch.optim.lr_scheduler.OneCycleLR(adam, settings.learning_rate, total_steps=steps, pct_start=0.1)
    parts: dict[str, Any] = {"adam": adam, "schedule": schedule}
    if state["stage"] == "Adam":
        for name, part in parts.items():
            part.load_state_dict(state[name])
        generator.set_state(state["generator"])
    for epoch in range(state.get("epoch", 0), settings.epochs):
        soft = _SOFTEST * (_HARDEST / _SOFTEST) ** (epoch / settings.epochs)
        for rows in torch.randperm(len(problem.x), generator=generator).to(problem.x.device).chunk(batches):
            adam.zero_grad(set_to_none=True)
            problem.loss(network, rows, soft).backward()  # type: ignore[no-untyped-call]
            adam.step()
            schedule.step()
        show(network)
        now = {"stage": "Adam", "epoch": epoch + 1, "generator": generator.get_state()}
        checkpoint.write(lambda now=now: now | _states({"network": network, **parts}))  # type: ignore[misc]


def _polish(
    network: TrainableEnsemble, k: int, problem: Problem, iterations: int, checkpoint: Checkpoint, show: Show,
    state: State,
) -> None:  # fmt: skip
    """Train one member on all rows at once."""
    alone = network.member(k).requires_grad_(True)
    parameters, everything = list(alone.parameters()), problem.every()

    def value_and_gradient(point: Tensor) -> tuple[float, Tensor]:
        vector_to_parameters(point, parameters)
        value, slopes = 0.0, torch.zeros_like(point)
        for rows in torch.split(everything, _ROWS if point.device.type == "cpu" else len(everything)):
            part = problem.loss(alone, rows, _HARDEST) * (len(rows) / len(everything))
            slopes += parameters_to_vector(torch.autograd.grad(part, parameters)).detach()
            value += part.item()
        return value, slopes

    minimiser = Minimiser(value_and_gradient, parameters_to_vector(parameters).detach())
    first = 1
    if state["stage"] == "BFGS" and state["member"] == k:
        minimiser.load_state_dict(state["minimiser"])
        first += state["iteration"]
    for i in range(first, iterations + 1):
        moved = minimiser.step()
        if i % _STAGE == 0 or i == iterations:
            vector_to_parameters(minimiser.x, parameters)
            show(alone)
        if not moved:
            break
        now = {"stage": "BFGS", "member": k, "iteration": i}
        checkpoint.write(lambda now=now: now | _states({"network": network, "minimiser": minimiser}))  # type: ignore[misc]
    vector_to_parameters(minimiser.x, parameters)
    network.replace_member(k, alone)


def _states(parts: Mapping[str, Any]) -> State:
    return {name: part.state_dict() for name, part in parts.items()}


def _steps(state: State, settings: Settings) -> int:
    """Return the steps of the progress bar that a state has behind it."""
    if state["stage"] != "BFGS":
        return int(state.get("epoch", 0))
    stages = -(-settings.iterations // _STAGE)
    return int(settings.epochs + state["member"] * stages + state["iteration"] // _STAGE)


def _resumed(state: State, settings: Settings) -> str:
    """Return where training goes on, in words."""
    if state["stage"] == "done":
        return "was finished before, and is taken from there"
    if state["stage"] == "Adam":
        return f"goes on after epoch {state['epoch']} of {settings.epochs}"
    return (
        f"goes on after iteration {state['iteration']} of {settings.iterations}, "
        f"member {state['member'] + 1} of {settings.members}"
    )
