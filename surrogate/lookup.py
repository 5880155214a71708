"""The look-up table: a trained model, for robots inside the domain that it was trained on.

A query returns the mean of the ensemble for every output of the data set. It can also return the outputs of every
member. Robots outside the domain are refused, with the input and its range; the table never extrapolates.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from sim.arrays import Floats
from sim.inputs import check_columns
from sim.io.errors import InputError
from sim.mechanics import planar
from sim.model.groups import DWELL
from surrogate.network import Ensemble, features

STEADY_OUTPUTS = (
    "omega_t_bar", "omega_h_bar", "omega_yr_bar", "v_x", "v_z", "R_yr_over_l", "theta_deg", "tail_gap",
)  # fmt: skip
RESPONSE_OUTPUTS = ("net_speed_bar", "lag_psi_rad", "lag_x", "lag_z")
_SLACK = 1e-9


@dataclass(frozen=True)
class Lookup:
    """A trained table with its domain and its held-out errors."""

    steady: Ensemble
    response: Ensemble
    tail_counts: list[int]
    effects: list[str]
    domain: dict[str, tuple[float, float]]
    errors: dict[str, dict[str, float]]  # output -> held-out error, see `surrogate.evaluate`
    provenance: dict[str, Any]

    @property
    def identity(self) -> str:
        """Hash of the weights."""
        digest = hashlib.sha256()
        for network in (self.steady, self.response):
            for key, value in sorted(network.state_dict().items()):
                digest.update(key.encode())
                digest.update(value.numpy().tobytes())
        return digest.hexdigest()[:16]

    def with_errors(self, errors: dict[str, dict[str, float]]) -> Lookup:
        return replace(self, errors=errors)

    def check_domain(self, columns: Mapping[str, Floats]) -> None:
        """Refuse robots outside the domain; for ω̄ the magnitude counts.

        Raises:
            InputError: names the input, its value and its range.
        """
        for name, values in columns.items():
            low, high = self.domain.get(name, (0.0, 0.0))
            magnitude = np.abs(values) if name == "omega_bar" else values
            slack = _SLACK * max(abs(low), abs(high), 1.0)
            for value in magnitude[(magnitude < low - slack) | (magnitude > high + slack)][:1]:
                allowed = f"{low:g} to {high:g}" if high > low else f"{low:g} only"
                raise InputError(
                    f"{name} = {value:g} is outside the look-up table ({allowed}); "
                    "change the robot, or train a table that covers it"
                )

    def query(self, columns: Mapping[str, Floats]) -> dict[str, Floats]:
        """Predicted outputs, each (M,): the steady ones, and the response if `dwell_bar` is given.

        Raises:
            InputError: a robot is not possible, or it is outside the domain.
        """
        members = self.query_members(columns)
        return {name: values.mean(0) for name, values in members.items()}

    def query_members(self, columns: Mapping[str, Floats]) -> dict[str, Floats]:
        """Outputs of every ensemble member, each (K, M)."""
        values = check_columns({k: v for k, v in columns.items() if k != DWELL})
        for name in self.effects:
            values.setdefault(name, np.zeros_like(values["N"]))
        if DWELL in columns:
            try:
                values[DWELL] = np.asarray(columns[DWELL], dtype=float)
            except (TypeError, ValueError):
                raise InputError(f"{DWELL} has a value that is no number; give numbers") from None
            if not np.isfinite(values[DWELL]).all():
                raise InputError(f"{DWELL} has a value that is not a finite number; give numbers")
        self.check_domain(values)
        table = features(values, self.tail_counts, self.effects, dwell=False)
        raw = self.steady.predict(table).double().numpy()
        result = _steady_outputs(raw, values["omega_bar"])
        if DWELL in values:
            table = features(values, self.tail_counts, self.effects, dwell=True)
            response = self.response.predict(table).double().numpy()
            result |= _response_outputs(response, result, values)
        return result


def _steady_outputs(raw: Floats, omega: Floats) -> dict[str, Floats]:
    log_yaw, log_sway, log_cotangent, logit, log_gap = np.moveaxis(raw, -1, 0)
    sense = np.sign(omega)
    sway = np.exp(log_sway)
    surge = np.exp(log_cotangent) * sway
    share = 1 / (1 + np.exp(-logit))
    values = (
        omega * (1 - share),
        -omega * share,
        sense * np.exp(log_yaw),
        sense * sway,
        surge,
        np.hypot(sway, surge) / np.exp(log_yaw),
        np.degrees(np.arctan2(sway, surge)),
        np.exp(log_gap),
    )
    return dict(zip(STEADY_OUTPUTS, values, strict=True))


def _response_outputs(
    raw: Floats,
    steady: dict[str, Floats],
    values: Mapping[str, Floats],
) -> dict[str, Floats]:
    """Lags for the positive direction of the motor, and the net speed that follows from them."""
    yaw, sway = np.abs(steady["omega_yr_bar"]), np.abs(steady["v_x"])
    psi, x, z = raw[..., 0] * yaw, raw[..., 1] * sway, raw[..., 2] * sway
    twist = np.stack([steady["v_z"], sway, yaw], -1)
    speed = planar.net_speed(twist, np.stack([z, x, psi], -1), values[DWELL])
    return dict(zip(RESPONSE_OUTPUTS, (speed, psi, x, z), strict=True))
