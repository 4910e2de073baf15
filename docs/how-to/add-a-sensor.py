# %% [markdown]
# # Add a sensor
#
# A sensor that the vehicle carries is its equations, a datasheet and one row of a table. From the row the simulator
# makes everything else: where the sensor lies in memory, how each flight draws its own, when it reads, what it sees,
# what a campaign may disperse of it, which keys a scenario has for it. Here a laser altimeter is added beside the
# sonar.
#
# ## The equations
#
# Named tuples say what there is: the coefficients of the datasheet (`Parameters`), what differs from unit to unit
# (`Unit`, which also names the normals that it is drawn from), what lasts from reading to reading (`State`), the
# normals of one reading, and the reading. Three laws connect them. They are plain Python on plain numbers; each
# parameter's annotation says which record it gets. Normals are drawn in pairs: an odd count gets a spare.

# %%
from typing import NamedTuple

from flownav.core.compile import equation
from flownav.sensors.geometry import BeamHit


class LaserParameters(NamedTuple):
    """Coefficients of one reading."""

    sigma_m: float
    scale_sigma: float
    keep: float  # of the last output, in this one
    ceiling_m: float


class LaserUnit(NamedTuple):
    """This unit's scale error. As normals: one, and one to spare."""

    scale: float
    spare: float


class LaserState(NamedTuple):
    """The last output [m]."""

    shown_m: float


class LaserNormals(NamedTuple):
    """Standard normals of one reading."""

    noise: float
    spare: float


class LaserReading(NamedTuple):
    """A distance along the boresight, quality 0 (no echo) or 255, and 1: it is wired."""

    range_m: float
    quality: float
    arrived: float


@equation
def draw_laser(n: LaserUnit, p: LaserParameters) -> LaserUnit:
    """This flight's unit."""
    return LaserUnit(p.scale_sigma * n.scale, 0.0)


@equation
def start_laser(hit: BeamHit, p: LaserParameters) -> LaserState:
    """Settled on the first distance."""
    return LaserState(hit.distance_m)


@equation
def step_laser(
    state: LaserState, unit: LaserUnit, hit: BeamHit, n: LaserNormals, p: LaserParameters
) -> tuple[LaserState, LaserReading]:
    """One reading: scale and noise, smoothed over the last ones."""
    seen_m = hit.distance_m * (1.0 + unit.scale) + p.sigma_m * n.noise
    shown_m = p.keep * state.shown_m + (1.0 - p.keep) * seen_m
    return LaserState(shown_m), LaserReading(shown_m, 255.0 if shown_m <= p.ceiling_m else 0.0, 1.0)


# %% [markdown]
# They can be called and tested as they are.

# %%
parameters = LaserParameters(sigma_m=0.02, scale_sigma=0.01, keep=0.5, ceiling_m=40.0)
unit = draw_laser(LaserUnit(1.0, 0.0), parameters)
hit = BeamHit(distance_m=3.0, incidence_cosine=1.0)
step_laser(start_laser(hit, parameters), unit, hit, LaserNormals(0.0, 0.0), parameters)[1]

# %% [markdown]
# ## The datasheet
#
# A datasheet is a TOML file with units in the names of its keys and an allowed range for each. Name, provenance, rate,
# latency and jitter are every sensor's.

# %%
from pathlib import Path

from pydantic import Field

from flownav.core.parameter_files import Number
from flownav.sensors.sheet import Lever, SensorSheet


class LaserSheet(SensorSheet):
    """A laser altimeter along body down."""

    sigma_m: Number = Field(ge=0.0, le=1.0)
    scale_percent: Number = Field(0.0, ge=0.0, le=10.0)
    smoothing: Number = Field(0.0, ge=0.0, lt=1.0)
    ceiling_m: Number = Field(gt=0.0, le=500.0)
    lens: Lever = Lever()

    def parameters(self) -> LaserParameters:
        """Coefficients of one reading."""
        return LaserParameters(self.sigma_m, 0.01 * self.scale_percent, self.smoothing, self.ceiling_m)


Path("laser.toml").write_text("""
schema_version = 1
name = "laser altimeter"
provenance = "made up for this page"
rate_hz = 25
latency_s = 0.03
jitter_s = 0.005
sigma_m = { value = 0.02, source = "assumed" }
scale_percent = 0.5
smoothing = 0.3
ceiling_m = 40.0
lens = { forward_m = -0.1, down_m = 0.15 }
""")

# %% [markdown]
# ## The row
#
# - `says`: the kind of each reading, and which fields of it are the values (and variances, where the sensor states
#   them). The kind decides which judge of the navigator takes it; a distance is `Sensor.RANGE`. Sensors of one kind
#   must be equally old on arrival.
# - `see`: what the sensor looks at, a law of the plant's records. `see_beam` is the sonar's; others are in `views.py`.
# - `channels`: where its normals begin in the noise counter, in pairs: of a reading, of a start, of a fault. Below 256;
#   nothing may overlap.
# - `late`: a flight of an ensemble may have it older than its datasheet says. `lever`: where the datasheet says that
#   its lens is.
#
# In flownav itself the row stands in `simulation/sensor_table.py` and the datasheet in `data/sensors/`; from outside,
# `carry` adds it before the simulator is imported.

# %%
from flownav.core.measurement import Sensor
from flownav.simulation.sensor_table import Channels, Output, SensorRow, carry
from flownav.simulation.views import reads, see_beam

LASER = SensorRow(
    "laser",
    LaserSheet,
    says=(Output(Sensor.RANGE, reads(LaserReading, ("range_m",))),),
    draw=draw_laser,
    start=start_laser,
    step=step_laser,
    see=(see_beam,),
    channels=Channels(reading=210, start=212, fault=220),
    phase=1,
    late=True,
    lever="lens",
)
carry(LASER)

# %% [markdown]
# That is all. A scenario names the datasheet, and may disperse any number of it.

# %%
Path("beside.toml").write_text("""
schema_version = 1
name = "beside"
description = "A laser altimeter beside the sonar"

[flight]
duration_s = 8.0
start = "hover"
path = [{ t_s = 0.0, height_m = 2.0 }, { t_s = 8.0, height_m = 3.5 }]

[gps]
model = "midg"

[sensors]
laser = "laser.toml"

[dispersion]
laser.sigma_m = { distribution = "uniform", loc = 0.5, scale = 1.5, mode = "factor" }
laser.latency_s = { distribution = "uniform", loc = 0.0, scale = 0.02, mode = "offset" }
""")

import flownav

record = flownav.fly("beside.toml", seed=1)
ranges = record["range"]
f"{len(ranges['t_s'])} ranges: 10 of the sonar and 25 of the laser each second"

# %% [markdown]
# The navigator has taken the laser's readings with the judge that the sonar has.

# %%
taken = record["innovation"]
distances = taken["sensor"] == "range"
f"{distances.sum()} offered, {taken['fused'][distances].sum():.0f} fused"

# %% [markdown]
# ## A new kind of reading
#
# A reading that no judge knows, such as an airspeed, also needs its kind in `flownav/core/measurement.py` (a number
# of its own and the names of its columns) and, to be fused, a judge and a law of its own in `flownav/navigation/`.
# Until then the navigator passes it over, and the record has it.
