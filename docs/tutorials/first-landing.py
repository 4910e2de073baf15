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
# The table has the errors of the position (`x`, `y`, `z` in metres: north, east, down) and of the velocity (`u`,
# `v`, `w` in m/s: forward, right, down). Below the table stand the touchdown and the verdict.
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
# `record.estimate` is a table: a dictionary of NumPy arrays, whose names end in their units. `pos_d_m` is the
# position downwards, so that the height is its negative. `std_pos_n_m` is one standard deviation of the position
# northwards, as the filter itself states it.

# %%
estimate = record.estimate.to_pandas()
estimate[["pos_n_m", "pos_e_m", "pos_d_m", "std_pos_n_m"]].iloc[::500]

# %% [markdown]
# `record.truth` is what the vehicle really did. Nothing on board knows it, which is what makes it worth comparing.

# %%
import matplotlib.pyplot as plt

truth = record.truth.to_pandas()
error_m = estimate["pos_n_m"] - truth["pos_n_m"].reindex(estimate.index, method="nearest")
figure, axes = plt.subplots(2, 1, figsize=(8, 5), sharex=True, layout="constrained")
axes[0].plot(truth.index, -truth["pos_d_m"], label="truth")
axes[0].plot(estimate.index, -estimate["pos_d_m"], "--", label="estimate")
axes[0].set_ylabel("height [m]")
axes[0].legend()
axes[1].plot(error_m.index, error_m, label="error north")
axes[1].fill_between(
    estimate.index, -2 * estimate["std_pos_n_m"], 2 * estimate["std_pos_n_m"], alpha=0.2, label="± 2 std, as stated"
)
axes[1].set_ylabel("error [m]")
axes[1].set_xlabel("time [s]")
axes[1].legend()
plt.show()

# %% [markdown]
# If the filter knows its own errors, the error stays inside the band about 95 % of the time.
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
for flown in (windy, blind):
    print(f"{flown.scores['touchdown']['contact']['distance_m']:.2f} m from the pad's centre")

# %% [markdown]
# ## Where to go from here
#
# - [You have a log of a real flight](px4-log.md)
# - [Your own filter](own-filter.md) in place of the navigator
# - [Is it safe?](certify.md) A thousand landings and a verdict
# - [Scenarios](../reference/scenarios.md): everything that can be changed
