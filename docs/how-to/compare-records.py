# %% [markdown]
# # Compare two records
#
# Two flights of the same scenario, two settings on the same log, before and after a change: `flownav compare` lays
# records over each other, and says by how much they differ and whether the difference is more than chance.

# %%
import flownav

calm = flownav.fly("landing", seed=1, wind={"speed_20ft_m_s": 0.0})
windy = flownav.fly("landing", seed=1, wind={"speed_20ft_m_s": 8.0, "gusts": True})
calm.save("calm.fnr")
windy.save("windy.fnr")

# %% language="bash"
# flownav compare calm.fnr windy.fnr --out compared.html

# %% [markdown]
# The page `compared.html` has the paths and the errors of both on one time axis. Every record may be compared with
# every other one; what is in one of them only is left out and named.
#
# ## By hand
#
# The scores are numbers, so that any other comparison is a line of Python.

# %%
import pandas as pd

rows = {
    name: {axis: found["rms_error"] for axis, found in record.scores["states"].items()}
    for name, record in (("calm", calm), ("windy", windy))
}
pd.DataFrame(rows).T.round(4)

# %% [markdown]
# `flownav compare` also takes logs instead of records. Then it replays each with every setting that you name,
# beside dead reckoning and the autopilot's own estimate: [comparing estimators](compare.md).
