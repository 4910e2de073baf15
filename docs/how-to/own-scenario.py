# %% [markdown]
# # Fly your own scenario and your own vehicle
#
# A scenario is a TOML file: the path, the wind, the pad, the sensors. A vehicle is another one. Units stand in the
# names of the keys, and every key, with its range and its default, stands in [keys of the parameter
# files](../reference/keys.md).
#
# ## A scenario
#
# Start from a shipped one, or write only what differs. This one takes off, flies a leg of 4 m, comes back and
# lands.

# %%
from pathlib import Path

Path("leg.toml").write_text("""
schema_version = 1
name = "leg"
description = "Up to 2 m, 4 m north and back, down again"

[flight]
duration_s = 45.0
start = "ground"
takeoff_at_s = 3.0
may_land_after_s = 30.0
path = [
  { t_s = 0.0, height_m = 0.0 },
  { t_s = 3.0, height_m = 0.0 },
  { t_s = 8.0, height_m = 2.0 },
  { t_s = 16.0, north_m = 4.0, height_m = 2.0 },
  { t_s = 26.0, height_m = 2.0 },
  { t_s = 60.0, height_m = -8.0 },
]

[gps]
model = "midg"

[wind]
speed_20ft_m_s = 3.0
from_direction_deg = 45.0
gusts = true
""")

# %%
import flownav

record = flownav.fly("leg.toml", seed=1)
record

# %% [markdown]
# A wrong key is one line that says what would be right.

# %% language="bash"
# sed 's/height_m = 2.0/heigth_m = 2.0/' leg.toml > wrong.toml
# flownav fly wrong.toml || true

# %% [markdown]
# ## A vehicle
#
# Three ship: the paper's helicopter, a quadrotor and a hexarotor. Take the nearest, change what you know of yours,
# and save it. Here the quadrotor carries more.

# %%
quad = flownav.Vehicle.load("quad-450")
quad

# %%
heavy = quad.changed(body={"mass_kg": 1.1 * quad.file.body.mass_kg})
heavy.save("heavy.toml")
flown = flownav.fly("leg.toml", seed=1, vehicle="heavy.toml")
print(
    f"{flown.scores['touchdown']['contact']['distance_m']:.2f} m from the pad, {flown.scores['touchdown']['verdict']}"
)

# %% [markdown]
# `flownav vehicle heavy.toml` prints its trim, its hover power and its linear model. `--margins` prints the phase
# and gain margins of its control loops.

# %% language="bash"
# flownav vehicle heavy.toml | head -30

# %% [markdown]
# [Scenarios](../reference/scenarios.md) explains every section of a scenario, [the
# helicopter](../explanation/vehicle.md) and [the multirotor](../explanation/multirotor.md) explain the models.
