import numpy as np, pandas as pd

t = pd.read_csv("docs/models/data/propellers.csv")
t = t[t.electrical_rpm > 0]
k = (t.thrust_gf / (t.electrical_rpm / 1e4) ** 2).groupby(t.test).apply(lambda s: np.exp(np.log(s).mean()))
print(k.round(1).to_dict(), k["a5"] / np.exp(np.log(k.drop("a5")).mean()))
print(
    {
        (a, c): round(np.polyfit(np.log(g.electrical_rpm), np.log(g.thrust_gf), 1)[0], 2)
        for (a, c), g in t.groupby(["test", "cell_volts"])
    }
)
