"""Fit networks: Adam in small batches, then BFGS on all rows, with a loss that is robust against outliers.

    loss = mean over rows of (w² |r|² + ε²)^¼,   r = residual of a row, in units of the target, w = weight

The error of a network is a hundred times larger in some corners than in the middle. Least squares would serve only
those corners: with it the median error is five times as large. ε falls from 0.1 to 0.0005 while Adam runs. The
optimiser needs double precision: the residuals are as small as 1e-5.

BFGS keeps its whole matrix (`surrogate.networks.bfgs`). In equal time L-BFGS ends with errors two to four times as
large (docs/explanation/lookup.md). Everything is repeatable from the seed on one machine, also when training was
stopped and goes on from a state (`surrogate.networks.checkpoints`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import torch
from torch import Tensor, nn
from torch.nn.utils import parameters_to_vector, vector_to_parameters
from tqdm import tqdm

from surrogate.networks.bfgs import Minimiser
from surrogate.networks.checkpoints import Checkpoint, State, TrainingContext
from surrogate.networks.ensemble import SHARED, Ensemble, state_shapes


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


Bar = Any  # tqdm is generic for type checkers only
Residual = Callable[..., Tensor]  # y (K, m, O), and data of the same m rows -> r (K, m, D)

_POWER = 0.25
_SOFTEST, _HARDEST = 0.1, 5e-4  # ε
_STAGE = 50  # BFGS iterations between two steps of the progress bar
_LEVEL = 0.95  # of the rows: the error that the bar shows


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
    work: TrainingContext,
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
        work: device, progress bar, and where states are kept.
        weights: of the rows in the loss, (M,); by default 1.
        unit: in words, of the error that the progress bar shows: the residual that 95 % of the rows do not reach.
    """
    weights = torch.ones(len(inputs), dtype=inputs.dtype) if weights is None else weights
    work = work.of_network()
    checkpoint = work.checkpoint(network.state_dict(), (inputs, *data, weights), asdict(settings))
    state = checkpoint.read() or {"stage": "start"}
    network.to(work.device)
    inputs, weights, *data = (part.to(work.device) for part in (inputs, weights, *data))
    problem = Problem((inputs - network.shift) / network.scale, data, weights, residual)
    if "network" in state:
        network.load_state_dict(state["network"])
        work.say(_resumed(state, settings))
    if state["stage"] != "done":
        stages = -(-settings.iterations // _STAGE)
        total = settings.epochs + stages * settings.members
        shown: Any = {
            "desc": work.title,
            "disable": not work.title,
            "delay": 1.0,
            "initial": _steps(state, settings),
        }
        with tqdm(total=total, **shown) as bar:
            watch = Watch(problem, checkpoint, bar, unit)
            if state["stage"] != "BFGS":
                _adam(network, problem, settings, watch, state)
            for k in range(state.get("member", 0), settings.members):
                _polish(network, k, problem, settings.iterations, watch, state)
        checkpoint.write(lambda: {"stage": "done", "network": network.state_dict()}, now=True)
    network.to("cpu").requires_grad_(False)


@dataclass(frozen=True)
class Watch:
    """Progress and states of one network."""

    problem: Problem
    checkpoint: Checkpoint
    bar: Bar
    unit: str

    def look(self, network: TrainableEnsemble) -> None:
        """Advance the bar and show the error that 95 % of the learned rows do not reach."""
        if self.bar.disable:
            return
        with torch.no_grad():
            error = self.problem.errors(network, self.problem.every()).mean(0).quantile(_LEVEL)
        words = f"{100 * _LEVEL:.0f} % of the rows within {100 * float(error):.3g} {self.unit}"
        self.bar.set_postfix_str(words, refresh=False)
        self.bar.update()

    def keep(self, state: Callable[[], State]) -> None:
        """Write the state, if it is time."""
        self.checkpoint.write(state)


def _adam(network: TrainableEnsemble, problem: Problem, settings: Settings, watch: Watch, state: State) -> None:
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
        watch.look(network)
        now = {"stage": "Adam", "epoch": epoch + 1, "generator": generator.get_state()}
        watch.keep(lambda now=now: now | _states({"network": network, **parts}))  # type: ignore[misc]


def _polish(
    network: TrainableEnsemble, k: int, problem: Problem, iterations: int, watch: Watch, state: State
) -> None:
    """Train one member on all rows at once."""
    alone = network.member(k).requires_grad_(True)
    parameters, everything = list(alone.parameters()), problem.every()

    def value_and_gradient(point: Tensor) -> tuple[float, Tensor]:
        vector_to_parameters(point, parameters)
        value = problem.loss(alone, everything, _HARDEST)
        slopes = torch.autograd.grad(value, parameters)
        return value.item(), parameters_to_vector(slopes).detach()

    minimiser = Minimiser(value_and_gradient, parameters_to_vector(parameters).detach())
    first = 1
    if state["stage"] == "BFGS" and state["member"] == k:
        minimiser.load_state_dict(state["minimiser"])
        first += state["iteration"]
    for i in range(first, iterations + 1):
        moved = minimiser.step()
        if i % _STAGE == 0 or i == iterations:
            vector_to_parameters(minimiser.x, parameters)
            watch.look(alone)
        if not moved:
            break
        now = {"stage": "BFGS", "member": k, "iteration": i}
        watch.keep(lambda now=now: now | _states({"network": network, "minimiser": minimiser}))  # type: ignore[misc]
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
