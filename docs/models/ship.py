"""Side force on a ship that is towed at an angle of drift: linear, which may lack the cross-flow drag.

    Y′ = a v (1 + ε_c |v| + ε_3 v²),   v = sin(β + ε_β)

v |v| is the drag of the flow across the hull, v³ the next term of an expansion (Abkowitz), ε_β an angle at which
the model was set wrong. Port mirrors starboard: such runs are repeats.

The table is of the captive tests of KVLCC2 (SIMMAN benchmark) as in github.com/martinlarsalbert/
System-identification-of-Vessel-Manoeuvring-Models; no licence was found, so it is not copied here. Its columns are
test, beta_deg, Y.

    softflagella calibrate TABLE --model docs/models/ship.py --out DIR
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

import softflagella as sf


def side_force(columns: Mapping[str, Any], p: Mapping[str, float]) -> dict[str, Any]:
    """Compute amounts of the side force over ρ/2 V² L², (n,)."""
    v = np.sin(np.radians(columns["drift_deg"] + p["angle"]))
    return {"force": p["linear"] * v * (1 + p["crossflow"] * np.abs(v) + p["cubic"] * v**2)}


MODEL = sf.Model(
    side_force,
    outputs={"force": sf.Output("side force")},
    numbers=[sf.Number("linear", 0.02, low=1e-4, high=1)],
    effects=[
        sf.Effect("crossflow", "cross-flow drag, v |v|", low=-0.5, high=20, typical=1),
        sf.Effect("cubic", "cubic term, v³", low=-1, high=60, typical=1),
        sf.Effect("angle", "angle set wrong", low=-1.5, high=1.5, unit="°", typical=0.5),
    ],
    settings=["drift_deg"],
)


def read(path: str) -> pd.DataFrame:
    """Read the tests of drift, mirrored to starboard."""
    table = sf.read_table(path)
    table = table[(table["test"] == "drift angle") & (table["beta_deg"] != 0)]
    angle = table["beta_deg"]
    return pd.DataFrame({"drift_deg": angle.abs(), "force": table["Y"].abs(), "side": np.sign(angle)})
