"""The look-up table's networks: features, targets, and an ensemble of multilayer perceptrons.

Features. The force balance depends on the head only through its resistances. So the inputs of the networks are the
logarithms of the resistances in units of tail length, not the coefficients:

    log C_t R/l, log C_r (R/l)³, log C_yr (R/l)(L/l), log L/l, log R/l, log l/r0, log |ω̄|, one-hot N,

and log T̄ for the response to a switch. Sizes of effects, if they were swept, are inputs without a logarithm.

Targets are smooth over the whole domain. With logarithms, signs and bounds hold for any output of a network:

    log ω_yr, log v_x, log v_z/v_x, logit |ω_h|/ω, log tail gap         (steady network)
    lag_ψ/ω_yr, lag_x/v_x, lag_z/v_x                                                (response network)

They are those of a positive motor speed; a negative one mirrors them. R_yr/l, θ and v̄ follow from them.

Each network is the sum of a perceptron and a linear map. K of them are trained side by side from different seeds.
Their mean is the prediction; their spread is part of the stated error.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np
import torch
from torch import Tensor, nn

from sim.arrays import Floats

Columns = Mapping[str, Floats]

STEADY_TARGETS = ("log_yaw_rate", "log_sway", "log_slip_cotangent", "logit_head_share", "log_tail_gap")
RESPONSE_TARGETS = ("lag_psi_over_yaw_rate", "lag_x_over_sway", "lag_z_over_sway")


def features(columns: Columns, tail_counts: Sequence[int], effects: Sequence[str], *, dwell: bool) -> Tensor:
    """Features (M, F) of robots given by column name, each (M,)."""
    R = 1 / columns["l_over_R"]
    L = columns["L_over_R"] * R
    logs = [columns["C_t"] * R, columns["C_r"] * R**3, columns["C_yr"] * R * L, L, R,
            columns["l_over_r0"], np.abs(columns["omega_bar"])]  # fmt: skip
    if dwell:
        logs.append(columns["dwell_bar"])
    table = [np.log(v) for v in logs]
    table += [(columns["N"] == n).astype(float) for n in tail_counts]
    table += [columns[name] for name in effects]
    return torch.tensor(np.stack(table, 1), dtype=torch.float32)


def steady_targets(columns: Columns) -> Floats:
    """Targets of the steady network, (M, 5), from data set columns with ω̄ > 0."""
    share = -columns["omega_h_bar"] / columns["omega_bar"]
    return np.stack(
        [
            np.log(columns["omega_yr_bar"]),
            np.log(columns["v_x"]),
            np.log(columns["v_z"] / columns["v_x"]),
            np.log(share / (1 - share)),
            np.log(columns["tail_gap"]),
        ],
        1,
    )


def response_targets(columns: Columns) -> Floats:
    """Targets of the response network, (M, 3)."""
    return np.stack(
        [
            columns["lag_psi_rad"] / columns["omega_yr_bar"],
            columns["lag_x"] / columns["v_x"],
            columns["lag_z"] / columns["v_x"],
        ],
        1,
    )


class Ensemble(nn.Module):
    """K networks, each a perceptron plus a linear map, evaluated together; inputs and outputs are standardised."""

    input_mean: Tensor
    input_scale: Tensor
    output_mean: Tensor
    output_scale: Tensor

    def __init__(self, inputs: int, outputs: int, *, width: int, depth: int, members: int, seed: int):
        super().__init__()
        generator = torch.Generator().manual_seed(seed)
        sizes = [inputs, *[width] * depth, outputs]
        self.weights = nn.ParameterList()
        self.biases = nn.ParameterList()
        for fan_in, fan_out in [*pairwise(sizes), (inputs, outputs)]:
            spread = 1 / math.sqrt(fan_in)
            weight = torch.randn(members, fan_in, fan_out, generator=generator) * spread
            self.weights.append(nn.Parameter(weight))
            self.biases.append(nn.Parameter(torch.zeros(members, 1, fan_out)))
        for name, size in (("input", inputs), ("output", outputs)):
            self.register_buffer(f"{name}_mean", torch.zeros(size))
            self.register_buffer(f"{name}_scale", torch.ones(size))

    def standardise(self, inputs: Tensor, outputs: Tensor) -> None:
        """Take means and scales from training data."""
        for name, table in (("input", inputs), ("output", outputs)):
            scale = table.std(0)
            getattr(self, f"{name}_mean").copy_(table.mean(0))
            getattr(self, f"{name}_scale").copy_(torch.where(scale > 1e-6, scale, 1.0))

    def forward(self, inputs: Tensor) -> Tensor:
        """Standardised outputs of every member, (K, M, outputs), for inputs (M, F)."""
        x = ((inputs - self.input_mean) / self.input_scale).expand(len(self.weights[0]), -1, -1)
        hidden = x
        *layers, bypass = list(zip(self.weights, self.biases, strict=True))
        for i, (weight, bias) in enumerate(layers):
            hidden = torch.baddbmm(bias, hidden, weight)
            if i < len(layers) - 1:
                hidden = nn.functional.silu(hidden)
        return hidden + torch.baddbmm(bypass[1], x, bypass[0])

    def predict(self, inputs: Tensor) -> Tensor:
        """Outputs of every member in their own units, (K, M, outputs)."""
        with torch.no_grad():
            return self(inputs) * self.output_scale + self.output_mean
