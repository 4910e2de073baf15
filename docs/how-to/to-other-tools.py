# %% [markdown]
# # Take a record to Rerun, Foxglove and others
#
# A record opens in the tools that you have. This page writes one flight in the formats of several.

# %% language="bash"
# flownav sample record

# %%
import flownav

record = flownav.load("samples/pad_return.fnr")
for name in ("mcap", "tum", "csv"):
    print(name, [path.name for path in record.export(name, f"out/flight.{name}")])

# %% [markdown]
# | tool | format | how to open it |
# |---|---|---|
# | Foxglove | `mcap` | open the file; import the layout that ships with flownav |
# # | evo | `tum`, `euroc` | `evo_ape tum truth.tum estimate.tum` |
# | PlotJuggler, Flight Review | `ulog` | open the file |
# | pandas, MATLAB, spreadsheets | `parquet`, `csv` | see [tables of a record](../reference/tables.md) |
#
# ## In three dimensions, with Rerun
#
# `flownav view` opens a record in Rerun's viewer: the vehicle, the pad, the camera's view, flow vectors, the
# covariance
# and both paths over time. It needs `pip install "flownav[view]"`. With `--out` it writes a file instead, which
# opens on
# any machine that has Rerun.

# %% language="bash"
# flownav view samples/pad_return.fnr --out flight.rrd
# ls -l flight.rrd | awk '{print $5 " bytes"}'

# %% [markdown]
# [Export to other tools](export.md) says what each format holds, in which frames, and what it cannot hold.
