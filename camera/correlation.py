"""How far apart samples must be to count as independent."""

from __future__ import annotations

import numpy as np

from common.arrays import Floats


def correlation_time(residual: Floats) -> float:
    """Compute the integrated autocorrelation time in samples, at least 1 (summed up to its first zero)."""
    centred = residual - residual.mean()
    power = np.abs(np.fft.rfft(centred, 2 * len(centred))) ** 2
    correlation = np.fft.irfft(power)[: len(centred)]
    if correlation[0] <= 0:
        return 1.0
    correlation = correlation / correlation[0]
    end = int(np.argmax(correlation <= 0)) or len(correlation)
    return float(max(1.0, 1 + 2 * correlation[1:end].sum()))
