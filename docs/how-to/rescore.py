# %% [markdown]
# # Score somebody else's estimate like ours
#
# You have another estimator, and its output for the same flight. `rescore` puts it into a record in place of the
# navigator's estimate and computes every score anew, with the same rules.

# %%
import flownav

record = flownav.fly("landing", seed=1)
frame = record.estimate.to_pandas()

# %% [markdown]
# The other estimate is a data frame (or a dictionary of columns) with the columns of the table
# [`estimate`](../reference/tables.md#estimate). It needs `t_s` and a position; what it lacks is not scored. Here a
# moving mean of the navigator's own position stands in for it, half a second late as moving means are.
#
# The navigator's own table `estimate` stands at its horizon, a tenth of a second ago, and in the frame that its GPS
# gave it. What the vehicle flies on, and what is scored, is the table `flown`: the estimate carried on to now, and
# counted from where the navigator has the pad. `from_handover=True` counts the other estimate likewise, from where
# it has the vehicle at the hand-over; without it the other estimate is held against the truth as it stands.

# %%
theirs = frame[["pos_n_m", "pos_e_m", "pos_d_m", "vel_u_m_s", "vel_v_m_s", "vel_w_m_s", "qw", "qx", "qy", "qz"]].copy()
for column in ("pos_n_m", "pos_e_m", "pos_d_m"):
    theirs[column] = theirs[column].rolling(50, min_periods=1).mean()
scored = record.rescore(estimate=theirs, from_handover=True)

# %%
import pandas as pd

pd.DataFrame(
    {
        "ours": {axis: found["rms_error"] for axis, found in record.scores["states"].items()},
        "theirs": {axis: found["rms_error"] for axis, found in scored.scores["states"].items()},
    }
).round(4)

# %% [markdown]
# `scored` is a record like any other: `scored.report("theirs.html")` writes its report, and
# [compare](compare-records.md) lays it over ours.
