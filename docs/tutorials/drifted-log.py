# ---
# jupyter:
#   jupytext:
#     formats: py:percent
# ---

# %% [markdown]
# # A log that drifted
#
# The vehicle slid off in Position mode, and there is a log. This tutorial finds the cause and the parameter against it.
#
# So that it runs anywhere, we make the fault ourselves: the flight of a simulated quadrotor, whose flow sensor somebody
# has mounted a quarter turn round without telling the autopilot. With your own log, begin at *Ask why*.

# %% language="bash"
# flownav sample csv

# %%
import csv
from pathlib import Path

path = Path("samples/flight-csv/flow.csv")
rows = list(csv.DictReader(path.open()))
for row in rows:  # a sensor whose x axis points to the right of the vehicle
    for pair in (("flow_x_rad_s", "flow_y_rad_s"), ("gyro_x_rad_s", "gyro_y_rad_s")):
        x, y = (float(row[name]) for name in pair)
        row[pair[0]], row[pair[1]] = y, -x
with path.open("w", newline="") as file:
    writer = csv.DictWriter(file, rows[0].keys())
    writer.writeheader()
    writer.writerows(rows)

# %% [markdown]
# ## Ask why
#
# `flownav explain` says the first cause in a sentence, with its seconds and how sure it is. This log has no parameters
# of an autopilot, so we say whose we want.

# %%
import flownav

explained = flownav.explain("samples/flight-csv", autopilot="px4")
print(explained.verdict)

# %% [markdown]
# ## The evidence
#
# Every hypothesis was looked into. Those that remained were tried: the log was replayed with the sensor mended, and the
# share of the sensors' disagreement that went is what the hypothesis explains.

# %%
for checked in sorted(explained.checked, key=lambda one: -one.probability)[:5]:
    tried = (
        checked.trial.words if checked.trial else checked.consequence_of and f"follows from {checked.consequence_of}"
    )
    print(f"{checked.probability:5.0%}  {checked.hypothesis.name:20s} {tried or ''}")

# %% [markdown]
# The picture of the winner shows the flow beside what turning and translation by the inertial readings expect of it:
# the flow about *y* follows what is expected about *x*.

# %%
import matplotlib.pyplot as plt

picture = explained.first.pictures[0]
figure, axes = plt.subplots(figsize=(8, 3))
for trace in picture.traces:
    axes.plot(trace.t_s, trace.value, "." if trace.dots else "-", ms=3, label=trace.name)
axes.set_xlabel("time (s)")
axes.set_ylabel(picture.label)
axes.legend()

# %% [markdown]
# ## The cure
#
# The parameter file is what a ground station loads; each line says where it comes from.

# %%
print(explained.cure_text())

# %% [markdown]
# For ArduPilot it is another parameter with another unit:

# %%
print(flownav.explain("samples/flight-csv", autopilot="ardupilot").cure_text())

# %% [markdown]
# ## What was not looked into
#
# A hypothesis that the log cannot show is reported, not guessed.

# %%
for cause, what in explained.missing:
    print(f"{cause}: {what}")
