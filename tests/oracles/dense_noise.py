"""The covariance of runs and sessions as a matrix, from its definition (`calibration.linear.gls`)."""

from __future__ import annotations

import numpy as np

from calibration.linear.gls import Noise, inverse_root
from common.arrays import Floats, Integers


def dense_covariance(noise: Noise, session: Integers) -> Floats:
    """Compute Σ of the runs of `session` (n,), (n k, n k)."""
    axes = np.linalg.inv(inverse_root(noise.run_covariance))
    shifts = (axes * np.broadcast_to(noise.session_ratio, len(axes))) @ axes.T
    together = session[:, None] == session
    return np.asarray(np.kron(np.eye(len(session)), noise.run_covariance) + np.kron(together, shifts))
