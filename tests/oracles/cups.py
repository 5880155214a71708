"""Cups that cool: a model of traces in closed form, and tables with noise of a known memory."""

import numpy as np
import pandas as pd

import softflagella as sf

MASSES = (0.15, 0.2, 0.25, 0.3)
STARTS = (40.0, 50.0, 60.0, 70.0)
RATE, STEP = 1 / 900, 30.0


def cup(columns, p):
    """Compute the temperature in °C of one cup, with each effect to first order."""
    t = columns["t_s"] - p["lag"] * -np.expm1(-columns["t_s"] / 60)
    cooled = p["rate"] * t * (1 + p["fill"] * (columns["mass"] - 0.2) / 0.2)
    hot = p["radiation"] * p["start"] / 300 * -np.expm1(-cooled)
    return {"T": 22 + p["start"] * np.exp(-cooled) * (1 - hot)}


MODEL = sf.Model(
    cup,
    outputs={"T": sf.Output("temperature", unit="K", kind="difference")},
    numbers=[
        sf.Number("rate", 1e-3, unit="1/s", low=1e-5, high=0.1),
        sf.Number("start", 60, unit="K", low=1, high=150, per="trace"),
    ],
    effects=[
        sf.Effect("radiation", "radiation", low=-2, high=2, typical=0.3),
        sf.Effect("lag", "lag of the thermometer", low=0, high=120, unit="s", typical=15),
        sf.Effect("fill", "fill", low=-1, high=1, typical=0.1),
    ],
    time="t_s",
)


def cups(seed=0, *, days=2, readings=60, rho=0.9, share=0.9, noise=0.5, **effects):
    """Make a table of each cup on each day; `rho`: of the slow part of neighbouring readings."""
    rng, time, tables = np.random.default_rng(seed), STEP * np.arange(1, readings + 1), []
    lags = np.abs(np.subtract.outer(np.arange(readings), np.arange(readings)))
    root = noise * np.linalg.cholesky((1 - share) * np.eye(readings) + share * np.power(rho, lags))
    for day in range(days):
        for number, (mass, start) in enumerate(zip(MASSES, STARTS, strict=True)):
            own = {"rate": RATE, "start": start * np.exp(0.02 * rng.normal())}
            columns = {"t_s": time, "mass": np.full(readings, mass)}
            T = cup(columns, {"radiation": 0.0, "lag": 0.0, "fill": 0.0} | own | effects)["T"]
            names = {"cup": f"cup {number} of day {day}", "day": f"day {day}"}
            tables.append(pd.DataFrame({**names, **columns, "T": T + root @ rng.normal(size=readings)}))
    return pd.concat(tables, ignore_index=True)
