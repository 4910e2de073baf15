# %% [markdown]
# # Identify my flow sensor and load its parameters
#
# An optical-flow sensor has a gain (what it reports over what is true), a latency and noise that grows with height.
# They differ from sensor to sensor and from mounting to mounting. This tutorial finds them from one flight, writes
# them into a sensor file, and shows what they are worth. At the end stand the parameters for the autopilot.
#
# A flight is enough if it is long enough and moves enough: legs of a few metres back and forth, at two or three
# heights.

# %% language="bash"
# flownav sample ulog

# %% [markdown]
# ## Identify

# %%
import flownav

sensor = flownav.identify("samples/flight.ulg")
sensor

# %%
print(f"gain     {sensor.gain.value:.3f}, 95 % interval {sensor.gain.low:.3f} to {sensor.gain.high:.3f}")
print(sensor.verdict)

# %% [markdown]
# The last line says what this log could show at all. A flight shows the gain well. What lies behind the latency (a
# delay, or a filter inside the sensor) needs faster motion, such as that of a [rig](../how-to/rig.md). The sample
# flight was flown with a sensor whose gain is below 1, and the interval says so. Its latency is not shown, so that no
# delay is written for the autopilot below.
#
# ## What is it worth?
#
# Replay the flight with GPS cut for 30 s, twice, first with a sensor that is taken to be perfect and then with the
# identified one.

# %%
sensor.save("my-sensor.toml")
rms_m = {}
for name, chosen in (("as it comes", None), ("identified", "my-sensor.toml")):
    scores = flownav.replay("samples/flight.ulg", outage_table=(20, 80, 30), sensor=chosen).scores
    rms_m[name] = scores["outage_median_rms_m"]
    print(f"{name:12s} {rms_m[name]:.2f} m rms in the median, {scores['outage_worst_rms_m']:.2f} m at worst")
assert rms_m["identified"] < rms_m["as it comes"]

# %% [markdown]
# The identified sensor drifts less. Both rows count from the moment of the cut, against the simulator's truth: what GPS
# was off by until then, a slow error of metres that is common to all estimates, is taken out.
# The gain costs less than one would think, because the filter learns the scale of the flow while it has GPS. The
# sensor file gives it a better start, the noise at each height, and the most likely latency, although this log shows
# the latency too vaguely to write it into an autopilot. Judge a sensor on another flight than the one that it was
# identified from when you can. Here there is only one.
#
# ## Parameters for the autopilot
#
# From the same identification follow the autopilot's own parameters: the scale, the delay and the noise of its
# flow. The command writes them as a parameter file for PX4; `--for ardupilot` writes one for ArduPilot.

# %% language="bash"
# flownav identify samples/flight.ulg --for px4 --out sensor.toml > identify.txt
# cat sensor.params

# %% [markdown]
# Load the file in QGroundControl under *Vehicle Setup, Parameters, Tools, Load from file*. In Mission Planner the
# button is *Load from file* on the page *Full Parameter List*. Reboot the vehicle, fly again, and identify again:
# the gain should now be 1 within its interval.
#
# ## Where to go from here
#
# - [How identification works](../how-to/identification.md), and what a log must hold
# - [A rig](../how-to/rig.md), which shows the sensor's dynamics
# - `flownav fly landing --sensor my-sensor.toml` lands with your sensor in simulation
