# %% [markdown]
# # Take a record to Rerun, Foxglove, Google Earth and others
#
# A record opens in the tools that you have. This page writes one flight in the formats of several.

# %% language="bash"
# flownav sample record

# %%
import flownav

record = flownav.load("samples/pad_return.fnr")
for name in ("foxglove", "tum", "csv"):
    print(name, [path.name for path in record.export(name, f"out/flight.{name}")])

# %% [markdown]
# Google Earth needs to know where on earth the local frame lies. A log with GPS has that place; for a simulated
# flight it is given.

# %% language="bash"
# flownav export samples/pad_return.fnr --to kml --origin 47.3977,8.5456,488 --out out/flight.kml

# %% [markdown]
# | tool | format | how to open it |
# |---|---|---|
# | Foxglove | `foxglove` | open the `.mcap`, then import the layout that lies beside it |
# | Google Earth, QGIS | `kml`, `gpx` | open the file; it has the tracks with their times |
# | evo | `tum`, `euroc` | `evo_ape tum truth.tum estimate.tum` |
# | PlotJuggler, Flight Review | `ulog` | open the file |
# | pandas, MATLAB, spreadsheets | `parquet`, `csv` | see [tables of a record](../reference/tables.md) |
#
# ## In three dimensions, with Rerun
#
# `flownav view` opens a record in Rerun's viewer: the vehicle, the pad, the camera's view, flow vectors, the
# covariance and both paths over time. It needs `pip install ".[view]"`. With `--out` it writes a file instead,
# which opens on any machine that has Rerun.

# %% language="bash"
# flownav view samples/pad_return.fnr --out flight.rrd
# ls -l flight.rrd | awk '{print $5 " bytes"}'

# %% [markdown]
# [Export to other tools](export.md) says what each format holds, in which frames, and what it cannot hold.
