# %% [markdown]
# # flownav from Python
#
# Everything that the commands do is a function: `flownav.fly`, `replay`, `identify` and `campaign`. They print nothing
# and return objects. This page goes through them; [the reference](../reference/api.md) lists every name.
#
# `import flownav` takes a few hundredths of a second, because each name is loaded when it is first asked for.

# %%
import flownav

record = flownav.fly("landing", seed=1)
record

# %% [markdown]
# ## What is flown
#
# Keyword arguments are the scenario's own keys ([scenarios](../reference/scenarios.md)). Tables are given as
# dictionaries and are merged into the scenario's. An unknown key or a value out of range is an `InputError` of one
# line.

# %%
windy = flownav.fly("landing", seed=1, gps="midg", wind={"speed_20ft_m_s": 6.0, "gusts": True})
print(windy)

try:
    flownav.fly("landing", wind={"speed": 6.0})
except flownav.InputError as error:
    print(error)

# %% [markdown]
# `flight=7` flies the eighth flight of a seed, and `dispersed=True` draws its vehicle, wind and sensors. A scenario, a
# vehicle and a sensor are objects too: `load` reads one, `changed` makes another, and `save` writes a file that the
# commands read.

# %%
heavy = flownav.Vehicle.load("quad-450").changed(body={"mass_kg": 1.6})
scenario = flownav.Scenario.load("landing").changed(vehicle=heavy, flight={"duration_s": 30.0})
print(heavy)
print(scenario.save("heavy.toml"))
print(flownav.fly(scenario, seed=3, dispersed=True))

# %% [markdown]
# ## What a record holds
#
# A record has tables, and every table is an attribute: `record.estimate`, `record.truth`, `record.innovation`
# ([all of them](../reference/tables.md)). A table is a dictionary of NumPy arrays, and becomes a data frame of pandas,
# polars or xarray when asked (`pip install "flownav[frames]"`).

# %%
print(record.truth["pos_d_m"].min())
record.estimate.to_pandas()[["pos_n_m", "pos_e_m", "pos_d_m"]].describe().round(3)

# %%
record.estimate.to_xarray()["vel_u_m_s"].attrs

# %% [markdown]
# `record.scores` are the figures that `--json` prints. `record.score()` computes them anew from the tables alone, and
# `record.verdict` is one line about what is wrong, or empty.

# %%
print(record.scores["touchdown"]["limited_by"])
print(record.score() == record.scores, repr(record.verdict))

# %% [markdown]
# `record.plot` draws `"position"`, `"velocity"`, `"errors"`, `"innovations"` or `"path"` with Plotly. `record.report`
# writes the whole page, `record.save` the record, and `record.export` what other tools read.

# %%
figure = record.plot("errors")
print(type(figure).__name__, len(figure.data), "lines and bands")
print(record.report("landing.html"), record.save("landing.fnr"), record.export("tum", "landing.tum")[0])
print(flownav.load("landing.fnr").scores == record.scores)

# %% [markdown]
# ## A log, a sensor, a thousand flights
#
# `flownav.replay` takes a log, and the same options as the command. `flownav.identify` makes a `Sensor` of rig or
# flight logs. `flownav.campaign` flies many times, and its result is a table of flights.

# %% language="bash"
# flownav sample csv

# %%
replayed = flownav.replay("samples/flight-csv", gps_outages=[(30, 50)])
print(replayed)
print(replayed.scores["outages"])

# %%
result = flownav.campaign("landing", flights=32)
print(result)
print(result.worst[0])

# %% [markdown]
# `result.record(flight)` flies one of these flights again, to the bit, as a record like any other.
