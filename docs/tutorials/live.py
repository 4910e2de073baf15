# %% [markdown]
# # Live with a simulated vehicle
#
# `flownav live` navigates a vehicle in real time over MAVLink and can send its estimate back. This tutorial tries
# it without a vehicle: one process plays an autopilot that tells its sensors, the other one is the navigator. They
# talk over the loopback network of this machine, as they would over a radio or a serial cable.
#
# It needs pymavlink: `pip install ".[live]"`.
#
# In practice you would use two terminals. Here the navigator runs in the background while the vehicle flies.
#
# ```bash
# flownav live udp:14550 --gps-delay 0.12 --record live.fnr          # the first terminal
# flownav fly pad_return --mavlink udpout:127.0.0.1:14550            # the second one
# ```

# %% language="bash"
# port=14661
# flownav live udp:$port --gps-delay 0.12 --duration 25 --record live.fnr --json > live.json 2> live.txt &
# sleep 4
# flownav fly pad_return --mavlink udpout:127.0.0.1:$port --speed 3 --no-report --out flown.fnr --json > flown.json
# wait

# %% [markdown]
# The vehicle's clock ran three times as fast as ours, so the 50 s of the flight took 17 s. The session ended after
# the 25 s that it was given; without `--duration`, Ctrl-C ends it. Its result is a record like that of any other
# flight.

# %%
import flownav

record = flownav.load("live.fnr")
record

# %% [markdown]
# The navigator works behind a horizon: it waits a fraction of a second for the slowest sensor, so that every
# reading is fused at the instant that it describes, and carries the estimate on to the present. The record holds
# both.

# %%
import matplotlib.pyplot as plt

estimate = record.estimate
figure, axis = plt.subplots(figsize=(8, 3), layout="constrained")
axis.plot(estimate["t_s"], -estimate["pos_d_m"])
axis.set_xlabel("time since the vehicle's boot [s]")
axis.set_ylabel("height [m]")
plt.show()

# %% [markdown]
# ## The same estimate again
#
# What was recorded live can be replayed, and gives the same estimate to the last bit. That is how you find out
# later why the navigator's estimate was what it was.

# %%
import numpy as np

again = flownav.replay("live.fnr")
print(np.array_equal(again.estimate["pos_n_m"], record.estimate["pos_n_m"]))

# %% [markdown]
# ## With your vehicle
#
# 1. Connect it, and let flownav check its parameters: `flownav live serial:/dev/ttyACM0 --setup`.
#    See [setting a vehicle up](../how-to/live-setup.md).
# 2. Listen only, and keep a record: `flownav live serial:/dev/ttyACM0 --send none --record flight.fnr`.
# 3. Replay the record and compare it with the autopilot's own estimate before you let the vehicle use ours.
# 4. [Live](../how-to/live.md) says what is sent, when nothing is sent, and how to sign messages.
