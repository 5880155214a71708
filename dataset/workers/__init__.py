"""Workers: what they do, and the backends that run them."""

BACKENDS = ("loky", "dask", "ray")
