"""What every worker of this machine needs, pandas for pyarrow included: loaded once, before workers are forked."""

import numpy as np
import pandas  # noqa: F401
from scipy.stats import qmc  # noqa: F401

import dataset.work  # noqa: F401
from dataset.simulate import simulate
from sim.compiling import all_compiled
from sim.model.groups import DWELL
from sim.model.presets import PRESETS

if all_compiled():  # load the machine code, too
    _values = {**PRESETS["paper-control"].group_values(), DWELL: 1.0}
    simulate({name: np.array([value]) for name, value in _values.items()})
