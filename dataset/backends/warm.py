"""What every worker of this machine needs: loaded once, in the process that workers are forked from."""

import numpy as np
import pandas  # noqa: F401: pyarrow loads it when it makes its first array
from scipy.stats import qmc  # noqa: F401

import dataset.work  # noqa: F401
from dataset.simulate import simulate
from sim.compiling import all_compiled
from sim.model.groups import DWELL
from sim.model.presets import PRESETS

if all_compiled():  # load the machine code, too
    _values = {**PRESETS["paper-control"].group_values(), DWELL: 1.0}
    simulate({name: np.array([value]) for name, value in _values.items()})
