# %% [markdown]
# # I have a PX4 log, now what?
#
# You have flown a vehicle with an optical-flow sensor and have its log (`.ulg`). This tutorial finds out what the
# log holds, fuses it with flownav's navigator, and measures how far the position would drift without GPS.
#
# If you have no log at hand, flownav writes one: the flight of a simulated quadrotor, as PX4 would have logged it.
# With your own log, put its name in place of `samples/flight.ulg`. ArduPilot's `.bin`, a ground station's `.tlog`,
# MCAP and folders of CSV files are read by the same commands.

# %% language="bash"
# flownav sample ulog

# %% [markdown]
# ## What does the log hold?
#
# Look before you fuse. `flownav info` lists the sensors, their rates and gaps, and says whether the flow agrees
# with GPS or with another reference.

# %% language="bash"
# flownav info samples/flight.ulg

# %% [markdown]
# Below the log's name stand what `flownav explain` found, here a barometer in the rotors' wash, and the verdict of the
# flow. If the flow had swapped axes, a wrong sign or no range beside it, it would stand there. In this log the scale
# of the flow is below 1: the sensor reads a little too little. The tutorial on [identifying the
# sensor](flow-sensor.md) puts that right.
#
# ## Fuse it
#
# `flownav.replay` runs the same navigator that flies in simulation and in real time. In a terminal, `flownav replay
# samples/flight.ulg` says of each sensor whether it is as the filter expects, harmless, or something to act on;
# `--verbose` has the figures.

# %%
import flownav

record = flownav.replay("samples/flight.ulg")
record

# %% [markdown]
# ## How far would it drift without GPS?
#
# Cut GPS for a while and compare the position with what the log knows otherwise: the truth of a simulator, motion
# capture, or GPS itself when it is back. The error counts from the moment of the cut. What GPS was off by until then, a
# slow error of metres, is common to every estimate that follows GPS; it is no drift and is taken out.

# %%
cut = flownav.replay("samples/flight.ulg", gps_outages=[(30, 75)])
for outage in cut.scores["outages"]:
    rms_m, max_m = outage["horizontal_rms_m"], outage["horizontal_max_m"]
    print(f"{outage['t0']:.0f} to {outage['t1']:.0f} s: {rms_m:.2f} m rms, {max_m:.2f} m at most")

# %% [markdown]
# And without GPS and without optical flow, on the inertial sensors alone:

# %%
blind = flownav.replay("samples/flight.ulg", gps_outages=[(30, 75)], flow=False)
for outage in blind.scores["outages"]:
    rms_m, max_m = outage["horizontal_rms_m"], outage["horizontal_max_m"]
    print(f"{outage['t0']:.0f} to {outage['t1']:.0f} s: {rms_m:.2f} m rms, {max_m:.2f} m at most")

# %%
import matplotlib.pyplot as plt

figure, axis = plt.subplots(figsize=(6, 6), layout="constrained")
for name, flown in (("with GPS", record), ("GPS cut, with flow", cut)):
    axis.plot(flown.estimate["pos_e_m"], flown.estimate["pos_n_m"], label=name)
axis.set_xlabel("east [m]")
axis.set_ylabel("north [m]")
axis.set_aspect("equal")
axis.legend()
plt.show()

# %% [markdown]
# ## Where to go from here
#
# - `flownav replay samples/flight.ulg --gps-outage 30:75` prints the drift in a terminal and writes a report.
# - [Identify the sensor](flow-sensor.md): the drift above becomes smaller.
# - [Outages in a row](../how-to/gps-outages.md): the median and the worst drift of a whole flight.
# - [What is read of each log](../reference/logs.md)
