# %% [markdown]
# # Certify a landing
#
# One good landing shows little. A test plan asks for more: *the vehicle touches down within a given distance of the
# pad, with a given probability and confidence, in the wind that we expect*. `flownav certify`
# takes that statement as a file, says how many flights it needs, flies them, and answers **pass**, **fail** or
# **not shown**.
#
# ## Write the requirement
#
# This one is small, so that the tutorial stays short: 95 % of all landings at 90 % confidence.

# %%
from pathlib import Path

Path("my-landing.toml").write_text("""
schema_version = 1
name = "my_landing"
description = "The paper's landing in up to 4 m/s of wind: a metre at the touchdown"
scenario = "landing"

[conditions]
wind.speed_20ft_m_s = [0, 4]
wind.from_direction_deg = [0, 360]

[[requirement]]
measure = "touchdown.horizontal_m"
at_most = 1.0
probability = 0.95
confidence = 0.90

[[requirement]]
measure = "touchdown.sink_rate_m_s"
at_most = 0.6
probability = 0.95
confidence = 0.90
""")

# %% [markdown]
# ## How many flights does it need?
#
# Nothing is flown yet. With no failure the fewest flights suffice; each failure that is allowed asks for more of
# them.

# %% language="bash"
# flownav certify --plan my-landing.toml

# %% [markdown]
# ## Fly it
#
# Every flight has a vehicle, a wind, a ground and sensors of its own, drawn from the scenario's dispersion, and
# neither the navigator nor the autopilot knows them. The ranking of inputs flies many more flights, so it is left
# out here (`--ranking 0`).

# %% language="bash"
# flownav certify my-landing.toml --ranking 0 --records 1 --out certificate || true

# %% [markdown]
# The exit status is 0 only if the verdict is *pass*. The folder holds the page to be signed, `certificate.json`
# with the same content for a program, the flights themselves, and the record and the report of the worst one.

# %% language="bash"
# ls certificate certificate/records

# %% [markdown]
# ## What it rests on
#
# A certificate is a statement about the simulator. The page lists what was assumed and what is not modelled, and
# [the simulator beside recorded flights](../explanation/validation.md) says where it is too kind. Read both before
# you sign. [The landing certificate](../how-to/certify.md) has the mathematics, and how to rank what matters most.
