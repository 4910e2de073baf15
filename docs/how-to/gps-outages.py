# %% [markdown]
# # Measure the drift through GPS outages
#
# How far is the position off after a minute without GPS? One outage is one sample, and where it falls decides what
# it shows. Cut GPS again and again along the flight and look at the median and the worst.

# %% language="bash"
# flownav sample csv

# %%
import flownav

record = flownav.replay("samples/flight-csv", outage_table=(15, 85, 20))
for outage in record.scores["outages"]:
    rms_m, max_m = outage["horizontal_rms_m"], outage["horizontal_max_m"]
    print(f"{outage['t0']:4.0f} to {outage['t1']:4.0f} s  {rms_m:6.2f} m rms  {max_m:6.2f} m at most")
print(f"median {record.scores['outage_median_rms_m']:.2f} m, worst {record.scores['outage_worst_rms_m']:.2f} m")

# %% [markdown]
# `outage_table=(15, 85, 20)` replays the flight once for each window of 20 s between 15 and 85 s; the last
# one ends at 85 s and is shorter. The same in a terminal:
# `flownav replay samples/flight-csv --outage-table 15:85:20`.
#
# ## What the sensors are worth
#
# The same windows with the flow withheld show what the optical flow contributes.

# %%
blind = flownav.replay("samples/flight-csv", outage_table=(15, 85, 20), flow=False)
median_m, worst_m = blind.scores["outage_median_rms_m"], blind.scores["outage_worst_rms_m"]
print(f"without flow: median {median_m:.2f} m, worst {worst_m:.2f} m")

# %%
import matplotlib.pyplot as plt

figure, axis = plt.subplots(figsize=(8, 3), layout="constrained")
for name, flown, shift in (("with flow", record, -0.2), ("without flow", blind, 0.2)):
    found = flown.scores["outages"]
    axis.bar([i + shift for i in range(len(found))], [o["horizontal_rms_m"] for o in found], 0.4, label=name)
axis.set_xticks(range(len(record.scores["outages"])), [f"{o['t0']:.0f} s" for o in record.scores["outages"]])
axis.set_ylabel("horizontal error [m rms]")
axis.set_xlabel("GPS cut from")
axis.set_yscale("log")
axis.legend()
plt.show()

# %% [markdown]
# ## The best estimate afterwards
#
# While a vehicle flies it can use only what came before. For a map or a report the smoother uses the whole flight,
# the GPS after the outage as well.

# %%
smooth = flownav.replay("samples/flight-csv", gps_outages=[(30, 50)], smooth=True)
for name, scores in (("in flight", smooth.scores), ("afterwards", smooth.scores["smoothed"])):
    truth = scores["truth"]  # over the whole flight, GPS's own slow error with it
    print(f"{name:10s} {truth['horizontal_rms_m']:.2f} m rms, {truth['horizontal_max_m']:.2f} m at most")

# %% [markdown]
# [The smoother](../explanation/smoother.md) says how it works.
