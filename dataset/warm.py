"""Load once what every worker of this machine needs, before workers are forked (pandas too, for pyarrow)."""

import gc

import fsspec.implementations.local  # noqa: F401
import numpy as np
import pandas  # noqa: F401
from scipy.stats import qmc

import dataset.workers  # noqa: F401
from dataset.schema import rows_version
from dataset.simulate import HISTORY, simulate
from sim.model.presets import PRESETS
from sim.motion.warm import all_compiled

rows_version()
qmc.Sobol(1)  # reads its numbers
if all_compiled():  # load the machine code, too
    _values = {**PRESETS["paper-control"].group_values(), HISTORY: True}
    simulate({name: np.array([value]) for name, value in _values.items()})
gc.collect()
gc.freeze()  # workers need neither scan nor copy all this
