# %% [markdown]
# # Analyse a campaign with pandas
#
# A campaign flies a scenario many times. Its result is a data frame with a row for each flight: the scores, and
# every number that was drawn for that flight.

# %%
import flownav

result = flownav.campaign("landing", flights=128, sweep={"wind.speed_20ft_m_s": [0.0, 6.0]})
result

# %%
flights = result.to_pandas()
print(flights.shape)
flights[
    ["set.wind.speed_20ft_m_s", "touchdown.contact.distance_m", "touchdown.contact.sink_rate_m_s", "verdict"]
].head()

# %% [markdown]
# ## Percentiles by wind
#
# The percentiles of a finite number of flights are uncertain themselves. `result.cells` has them with their 95 %
# intervals; a data frame gives the plain figures.

# %%
by_wind = flights.groupby("set.wind.speed_20ft_m_s")["touchdown.rest.distance_m"]
by_wind.quantile([0.5, 0.95]).unstack().round(3)

# %%
for cell in result.cells:
    figure = cell["figures"]["r95_m"]
    print(f"{cell['label']}: R95 {figure['value']:.2f} m, 95 % interval {figure['low']:.2f} to {figure['high']:.2f} m")

# %% [markdown]
# ## What goes with a bad landing?
#
# The columns that begin with `input.` are what was drawn. Their rank correlation with the miss is a first hint;
# [certify](certify.md) ranks inputs properly.

# %%
inputs = flights.filter(like="input.")
flights_of_one_wind = flights["set.wind.speed_20ft_m_s"] == 6.0
hints = inputs[flights_of_one_wind].corrwith(
    flights["touchdown.rest.distance_m"][flights_of_one_wind], method="spearman"
)
hints.abs().sort_values(ascending=False).head(5).round(2).to_frame("rank correlation")

# %%
import matplotlib.pyplot as plt

figure, axis = plt.subplots(figsize=(5, 5), layout="constrained")
for speed, group in flights.groupby("set.wind.speed_20ft_m_s"):
    axis.scatter(group["touchdown.rest.east_m"], group["touchdown.rest.north_m"], s=12, label=f"{speed:.0f} m/s")
axis.set_xlabel("east of the pad [m]")
axis.set_ylabel("north of the pad [m]")
axis.set_aspect("equal")
axis.legend(title="wind")
plt.show()

# %% [markdown]
# ## Look at the worst one
#
# A flight of a campaign can be flown again, to the last bit, and gives a record.

# %%
worst = result.worst[0]
record = result.record(worst["flight"])
print(worst)
record
