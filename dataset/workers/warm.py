"""Load once what every worker of this machine needs, before workers are forked (pandas too, for pyarrow)."""

import gc

import numpy as np
import pandas  # noqa: F401
from joblib.externals.loky import process_executor  # noqa: F401
from scipy.stats import qmc  # noqa: F401

import dataset.workers.processes  # noqa: F401
import sim.motion.batches  # noqa: F401
from dataset.rows.simulate import HISTORY, simulate
from sim.compiling import all_compiled
from sim.model.presets import PRESETS

if all_compiled():  # load the machine code, too
    _values = {**PRESETS["paper-control"].group_values(), HISTORY: True}
    simulate({name: np.array([value]) for name, value in _values.items()})

gc.collect()
gc.freeze()  # loky collects garbage after each task: workers need neither scan nor copy all this
