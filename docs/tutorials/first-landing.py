# %% [markdown]
# # Your first landing
#
# test $x^2$

# %% language="bash"
# flownav fly landing --seed 1 --out landing.fnr

# %%
import pandas as pd
import matplotlib.pyplot as plt

pd.DataFrame({"a": [1, 2]})

# %%
plt.plot([1, 2, 3])

# %%
import plotly.graph_objects as go

go.Figure(go.Scatter(y=[1, 3, 2]))
