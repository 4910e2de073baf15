"""Record: the one bundle that fly, replay and live write and that scoring, report and export read.

On disk a record is a zip of Parquet tables and one `manifest.json`: it loads in any language without the
code that wrote it. Table and column names carry frame and unit; `TABLES` is the vocabulary.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

SCHEMA_VERSION = 1
LONGEST_S = 172_800.0  # from the first row of a record, or of a log, to its last: two days
LATEST_S = 1e10  # of an instant: a clock of UNIX seconds shows 2e9, and its double tells microseconds apart

POSITION_NED = ("pos_n_m", "pos_e_m", "pos_d_m")
VELOCITY_BODY = ("vel_u_m_s", "vel_v_m_s", "vel_w_m_s")
QUATERNION = ("qw", "qx", "qy", "qz")

# Readings fed to a navigator, row by row: the instant that the reading describes (t_s), its stamp on arrival,
# measurement.Sensor, values and variances (unused ones NaN), quality, and which of `segments` took it. withheld: 1
# where the user took it away; arrived: 0 where the sensor was due and stayed silent.
FED_FIRST = ("t_s", "arrival_s", "sensor", *(f"value_{i}" for i in range(6)), *(f"variance_{i}" for i in range(6)),
             "quality", "segment")  # of any record  # fmt: skip
FED = (*FED_FIRST, "withheld", "arrived")

# The filter's own states from the gyro's bias on, in its order (docs/explanation/landing-filter.md).
FILTER_STATES = (
    "gyro_bias_x_rad_s", "gyro_bias_y_rad_s", "gyro_bias_z_rad_s",
    "accel_bias_x_m_s2", "accel_bias_y_m_s2", "accel_bias_z_m_s2",
    "gps_slow_n_m", "gps_slow_e_m", "gps_slow_d_m", "gps_fast_n_m", "gps_fast_e_m", "gps_fast_d_m",
    "gps_velocity_n_m_s", "gps_velocity_e_m_s", "gps_velocity_d_m_s",
    "ins_roll_rad", "ins_pitch_rad", "ins_heading_rad",
    "ground_d_m", "baro_m", "flow_scale", "compass_sin_rad", "compass_cos_rad", "velocity_lag_s",
    "pad_n_m", "pad_e_m", "pad_d_m",
)  # fmt: skip
TILTS = ("tilt_n_rad", "tilt_e_rad", "heading_rad")  # errors of the attitude about north, east and down
PROTECTION_LEVELS = ("protection_horizontal_m", "protection_vertical_m")
VELOCITY_NED = ("vel_n_m_s", "vel_e_m_s", "vel_d_m_s")

STATE = (*POSITION_NED, *VELOCITY_BODY, *QUATERNION)
STANDARD_DEVIATIONS = tuple(f"std_{name}" for name in (*POSITION_NED, *VELOCITY_BODY))
RATES = ("rate_p_rad_s", "rate_q_rad_s", "rate_r_rad_s")

# The vocabulary: every table has `t_s` first; a writer may leave a table or a trailing column out.
TABLES: dict[str, tuple[str, ...]] = {
    # what was so (simulation, motion capture)
    "truth": (*STATE, *RATES, "thrust_n", "on_ground"),
    # the filter's estimate, with one standard deviation of each, and how far off it may be if a sensor fails unseen
    "estimate": (*STATE, *STANDARD_DEVIATIONS, *PROTECTION_LEVELS),
    # where the truth is known: the error squared of position and velocity over what the filter states (NEES)
    "consistency": ("nees",),
    # the rest of its state, at the same instants: velocity in the earth's axes, standard deviations of the attitude,
    # and every other state with its own
    "states": (
        *VELOCITY_NED, *(f"std_{name}" for name in TILTS), *FILTER_STATES, *(f"std_{name}" for name in FILTER_STATES),
    ),
    # the filter's estimate from the whole flight
    "smoothed": (*STATE, *STANDARD_DEVIATIONS),
    # the estimate of another estimator (an autopilot's own)
    "autopilot": STATE,
    # the estimate that an autopilot used, carried on to now: position from where the pad is taken to be
    "flown": STATE,
    # the vehicle's commands: references and controls
    "command": ("pos_n_ref_m", "pos_e_ref_m", "pos_d_ref_m", "lon_rad", "lat_rad", "col_rad", "ped_rad"),
    # the autopilot's setpoints by a log, position in the frame of "autopilot", and its battery
    "setpoint": (*POSITION_NED, *QUATERNION),
    "battery": ("voltage_v", "current_a", "remaining_percent"),
    # one row per measurement component offered to the filter (PX4's estimator_aid_src fields)
    "innovation": (
        "sensor", "component", "observation", "observation_variance", "innovation", "innovation_variance", "test_ratio",
        "fused", "reason",
    ),
    # one row per happening: source, kind, detail (text), value
    "events": ("source", "kind", "detail", "value"),
    "fed": FED[1:],
    # what scoring must know beside truth and estimate: of a simulated flight at the truth's instants (0/1 but for the
    # ground): the ground's height, goes around, its pad can be seen, this step counts, the flow sensor sees; of a
    # replay at the estimate's: some warning stands
    "judging": ("ground_m", "away", "pad_seen", "counted", "sees_flow", "flagged"),
    # a log's external reference as it stands there, in a frame of its own, and its heading where that is apart
    "reference": (*POSITION_NED, *QUATERNION),
    "reference_heading": ("yaw_rad",),
    # measurement streams are tables "gps_position", "flow_velocity", ...: measurement.COLUMNS and "quality"
}  # fmt: skip

# tables whose rows follow each other in time; readings, and what a log says beside them, stand as they came
IN_ORDER = ("estimate", "consistency", "states", "smoothed", "flown", "command")

Column = NDArray[Any]
Table = dict[str, Column]


def mapping(value: Any) -> Mapping[str, Any]:
    """The value where it is a mapping, an empty one elsewhere: manifests come from files."""
    return value if isinstance(value, Mapping) else {}


@dataclass
class Record:
    """A flight as data.

    manifest: JSON-able facts: `schema`, `kind` ("fly", "replay", "live"), `scenario`, `filter`, `seed`,
    `duration_s`, `parameters` (nested, units in key names), `provenance` (versions, inputs and their
    SHA-256), `scores` (what scoring computed, see scoring/), `judging` (numbers that scoring needs).
    tables: name -> column name -> array of equal length; `t_s` [s] in each.
    """

    manifest: dict[str, Any] = field(default_factory=dict)
    tables: dict[str, Table] = field(default_factory=dict)

    def add(self, name: str, columns: Mapping[str, Any]) -> None:
        """Put a table in. ValueError where columns differ in length or `t_s` is missing."""
        table = {key: np.asarray(value) for key, value in columns.items()}
        if "t_s" not in table:
            raise ValueError(f"table {name!r} has no t_s column")
        if len({len(column) for column in table.values()}) != 1:
            raise ValueError(f"table {name!r} has columns of different lengths")
        self.tables[name] = table

    def matrix(self, table: str, columns: tuple[str, ...]) -> NDArray[np.float64]:
        """Columns of a table side by side, shape (n, len(columns)). KeyError where one is missing."""
        return np.column_stack([self.tables[table][name] for name in columns]).astype(float)

    def save(self, path: Path, *, replacing: bool = False) -> None:
        """Write the record as one file, whole or not at all (temporary name, then rename).

        replacing: whoever asks knows that what is there may go. InputError, unless replacing, where it must not.
        """
        from flownav.core.record_file import save

        save({"schema": SCHEMA_VERSION, **self.manifest}, self.tables, path, replacing=replacing)

    @classmethod
    def load(cls, path: Path) -> Record:
        """Read a record. InputError where the file is missing, is no record, or is of a newer schema."""
        from flownav.core.record_file import load

        return cls(*load(path, SCHEMA_VERSION, TABLES, IN_ORDER, LATEST_S, LONGEST_S))
