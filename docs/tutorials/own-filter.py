# %% [markdown]
# # Your own filter
#
# flownav's navigator is one filter among many. This tutorial flies another one in its place: in the closed loop,
# where the autopilot has to live with what the filter says, and on a recorded flight. A filter is a Python class
# with four methods: `start`, `predict`, `update` and `estimate`. Nothing has to be compiled.
#
# ## A filter in forty lines
#
# flownav ships a complementary filter as an example. Position and velocity follow the IMU in the short run, and
# each other sensor in the long run, with one time constant a sensor. This is the complete filter:

# %%
import inspect

from flownav.parts.examples import complementary

print(inspect.getsource(complementary).split('"""', 2)[2].strip())

# %% [markdown]
# `predict` is called for every reading of the IMU, `update` for every other reading, each in the order of the
# instants that the readings describe. `estimate` says position and velocity in north-east-down, and the attitude.
#
# ## Fly it
#
# The same landing, the same noise: first our navigator, then the complementary filter, then a Kalman filter written
# with [FilterPy](https://filterpy.readthedocs.io), which ships as an example too.

# %%
import flownav
import pandas as pd
from flownav.parts.examples.complementary import ComplementaryFilter
from flownav.parts.examples.filterpy_ekf import FilterPyEkf

flights = {
    "navigator": flownav.fly("pad_return", seed=2),
    "complementary": flownav.fly("pad_return", seed=2, filter=ComplementaryFilter),
    "FilterPy EKF": flownav.fly("pad_return", seed=2, filter=FilterPyEkf),
}
rows = {
    name: {
        "rms north [m]": record.scores["states"]["x"]["rms_error"],
        "rms east [m]": record.scores["states"]["y"]["rms_error"],
        "rms down [m]": record.scores["states"]["z"]["rms_error"],
        "verdict": record.scores["touchdown"]["verdict"],
    }
    for name, record in flights.items()
}
pd.DataFrame(rows).T

# %%
import matplotlib.pyplot as plt

figure, axis = plt.subplots(figsize=(8, 3.2), layout="constrained")
for name, record in flights.items():
    truth, estimate = record.truth, record.estimate
    north_m = pd.Series(truth["pos_n_m"], truth["t_s"]).reindex(estimate["t_s"], method="nearest").to_numpy()
    axis.plot(estimate["t_s"], estimate["pos_n_m"] - north_m, label=name)
axis.set_xlabel("time [s]")
axis.set_ylabel("error north [m]")
axis.legend()
plt.show()

# %% [markdown]
# The vehicle flies on what the filter says. A filter that is wrong moves the vehicle, so that the three flights are
# three different flights through the same wind. A filter that is rough enough crashes it, and then the record says so
# (`record.verdict`).
#
# ## Write your own
#
# Take the complementary filter and let it trust GPS less. A class in a file is named `FILE.py:CLASS`.

# %%
from pathlib import Path

Path("my_filter.py").write_text('''
from flownav.parts.examples.complementary import TIME_S, ComplementaryFilter
from flownav.core.measurement import Sensor


class SlowGps(ComplementaryFilter):
    """The complementary filter, which takes twice as long to follow GPS."""

    name = "slow-gps"

    def update(self, reading):
        if reading.sensor == Sensor.GPS_POSITION and reading.sensor in self.seen_s:
            followed = reading.t_s - (reading.t_s - self.seen_s[reading.sensor]) / 2
            self.seen_s[reading.sensor] = followed
        super().update(reading)
''')

# %% language="bash"
# flownav fly pad_return --seed 2 --filter my_filter.py:SlowGps --no-report --out slow.fnr

# %% [markdown]
# ## On a recorded flight
#
# The same class fuses logs. Its position is scored like ours: through a cut of GPS, from the moment of the cut, so that
# the slow error of GPS itself, which is common to all filters, is taken out.

# %% language="bash"
# flownav sample ulog

# %%
for name, own in (("navigator", None), ("complementary", ComplementaryFilter), ("SlowGps", "my_filter.py:SlowGps")):
    record = flownav.replay("samples/flight.ulg", gps_outages=[(30, 45)], filter=own)
    outage = record.scores["outages"][0]
    print(f"{name:13s} {outage['horizontal_rms_m']:6.2f} m rms through 15 s without GPS")

# %% [markdown]
# ## Where to go from here
#
# - State your uncertainty: `Estimate(std_pos_ned_m=..., std_vel_ned_m_s=...)`. Then the record has NEES and the
#   report says
#   whether your filter knows its errors.
# - `update` may return innovations, which are then in the record and in the report.
# - A sensor, a vehicle or a controller of your own: `flownav.fly(sensors=[MySensor()], vehicle=MyVehicle())`.
# - A thousand flights: `flownav.campaign("pad_return", flights=100, filter="my_filter.py:SlowGps")`. Plain Python is
#   some
#   hundred times slower than the compiled navigator, so begin with few.
# - Offer it to others by name: an entry point in the group `flownav.filters` of your package.
