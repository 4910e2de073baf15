# %% [markdown]
# # Your first landing, in five minutes
#
# This tutorial flies a whole mission in simulation, looks at what the navigator knew on the way, and compares it
# with what really happened. You need Python 3.11 or newer and nothing else: no vehicle, no log and no autopilot.
#
# Install flownav first, in a clone of its repository:
#
# ```bash
# pip install .
# ```
#
# ## Fly
#
# One command flies a helicopter from its pad and back: it stands, takes off, hovers for 20 s, flies a circuit of 30
# m, finds the pad again and lands on it, in gusts, with a GPS that is 2 m off. It carries an IMU, a magnetometer, a
# barometer, a GPS receiver, an optical-flow camera, a rangefinder and a camera that knows the pad, and its autopilot
# knows only what the navigator makes of them. The very first flight compiles the simulator, which takes about half a
# minute; after that a flight takes less than a second.

# %% language="bash"
# flownav fly --seed 1 --out sortie.fnr

# %% [markdown]
# The first line says how it ended. The table has the errors of the position (`x`, `y`, `z` in metres: north, east,
# down), of the velocity (`u`, `v`, `w` in m/s: forward, right, down) and of the attitude, in flight.
#
# Two files were written. `sortie.fnr` is the record, which holds everything that happened. `sortie.html` is its
# report: one page that works without a network. Open it in a browser.
#
# ## The same flight in Python
#
# A flight has a number and a seed. The same seed gives the same flight to the last bit, so what Python flies here
# is the flight above.

# %%
import flownav

record = flownav.fly(seed=1)
record

# %%
contact = record.scores["touchdown"]["contact"]
print(f"touched {contact['distance_m']:.2f} m from the pad's centre, sinking at {contact['sink_rate_m_s']:.2f} m/s")

# %% [markdown]
# ## Look at the estimate
#
# `record.flown` is a table: a dictionary of NumPy arrays, whose names end in their units. It is the estimate used by
# the autopilot: the navigator's estimate of each instant, relative to the pad. `pos_d_m` is the position downwards,
# so that the height is its negative: that of the centre of gravity, 0.2 m above the ground when it stands.

# %%
flown = record.flown.to_pandas()
flown[["pos_n_m", "pos_e_m", "pos_d_m", "vel_u_m_s"]].iloc[::500]

# %% [markdown]
# `record.truth` is what the vehicle really did, from the pad as well. Nothing on board knows it, which is what makes
# it worth comparing. `judging` says from which instant to which one errors count: from lift-off to touchdown.

# %%
import matplotlib.pyplot as plt

truth, counted = record.truth.to_pandas(), record.judging.to_pandas()["counted"] > 0
error_m = (flown["pos_n_m"] - truth["pos_n_m"])[counted]
print(f"north, in flight: {(error_m**2).mean() ** 0.5:.4f} m rms, {error_m.abs().max():.4f} m at most")
figure, axes = plt.subplots(2, 1, figsize=(8, 5), sharex=True, layout="constrained")
axes[0].plot(truth.index, -truth["pos_d_m"], label="truth")
axes[0].plot(flown.index, -flown["pos_d_m"], "--", label="estimate")
axes[0].set_ylabel("height [m]")
axes[0].legend()
axes[1].plot(error_m.index, error_m, label="error north")
axes[1].set_ylabel("error [m]")
axes[1].set_xlabel("time [s]")
axes[1].legend()
plt.show()

# %% [markdown]
# Those are the figures of the table's row `x`.
#
# ## Does it know how wrong it is?
#
# The filter states a standard deviation of what it says. Its own table is `record.estimate`. There the position is
# counted from where GPS puts the flight, metres off; the velocity is the same in both.

# %%
estimate = record.estimate.to_pandas()
in_flight = counted.reindex(estimate.index, method="nearest")
off_m_s = (estimate["vel_w_m_s"] - truth["vel_w_m_s"].reindex(estimate.index, method="nearest"))[in_flight]
band_m_s = 2 * estimate["std_vel_w_m_s"][in_flight]
figure, axis = plt.subplots(figsize=(8, 3), layout="constrained")
axis.plot(off_m_s.index, off_m_s, label="error of the velocity down")
axis.fill_between(off_m_s.index, -band_m_s, band_m_s, alpha=0.2, label="± 2 std, as stated")
axis.set_ylabel("error [m/s]")
axis.set_xlabel("time [s]")
axis.legend()
plt.show()
print(f"inside the band {(off_m_s.abs() <= band_m_s).mean():.0%} of the time")

# %% [markdown]
# If the filter knows its own errors, they stay inside the band about 95 % of the time.
#
# `record.plot` draws the usual figures at once: `position`, `velocity`, `errors`, `innovations` and `path`. They
# are interactive: zoom into one with the mouse.

# %%
record.plot("path")

# %% [markdown]
# ## Change something
#
# Every key of the scenario can be changed by name. Here the same mission is flown in 8 m/s of wind from the west, and
# another one (`pad_return`) without a camera for the pad: GPS and optical flow alone bring it back.

# %%
windy = flownav.fly(seed=1, wind="8:270")
blind = flownav.fly("pad_return", seed=1)
for flight in (windy, blind):
    print(f"{flight.scores['touchdown']['contact']['distance_m']:.2f} m from the pad's centre")

# %% [markdown]
# ## Where to go from here
#
# - [You have a log of a real flight](px4-log.md)
# - [Your own filter](own-filter.md) in place of the navigator
# - [Is it safe?](certify.md) A thousand landings and a verdict
# - [Scenarios](../reference/scenarios.md): everything that can be changed
