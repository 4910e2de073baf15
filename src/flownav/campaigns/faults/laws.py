"""The faults of the catalogue as a simulated vehicle's sensors have them, for flights on what they say.

What a receiver sorts out before its navigator hears of it cannot be flown apart: readings stamped ahead of the clock
are not fed, as if they were lost, and that is how they are flown; doubled and disordered readings, which its queue
drops or puts in order again, are not flown at all (`flownav faults --offline` tries them).
"""

from __future__ import annotations

import math
from typing import Any

from flownav.campaigns.faults.catalogue import (
    CEILING_M,
    DEGREE_S,
    FAULTS,
    FLOOR_M,
    TEXTURE_NOISE_RAD_S,
    TEXTURE_SHARE,
    Fault,
)
from flownav.core.measurement import Sensor
from flownav.simulation.layout import EARLIER_READINGS
from flownav.simulation.truth import SensorFault

LATE_S, MOST_LATE = 0.1, EARLIER_READINGS - 1
OF_SENSOR = {
    Sensor.IMU: "inertial",
    Sensor.GPS_POSITION: "position",
    Sensor.GPS_VELOCITY: "velocity",
    Sensor.FLOW_RATE: "flow",
    Sensor.RANGE: "range",
    Sensor.BARO: "others",
    Sensor.LANDED: "skids",
}
LOW_TEXTURE = {"m_xx": TEXTURE_SHARE, "m_yy": TEXTURE_SHARE, "noise_first": TEXTURE_NOISE_RAD_S}
DOES: dict[str, dict[str, float]] = {
    "gps_loss": {"lost": 1.0},
    "gps_jump": {"bias_0": 20.0},
    "gps_drift": {"drift_0": 0.5},
    "gps_clock": {"lost": 1.0},
    "flow_loss": {"lost": 1.0},
    "flow_garbage": {"even_to": 2.0, "quality": 255.0},
    "flow_sign": {"m_xx": -1.0, "m_yy": -1.0},
    "flow_swapped": {"m_xx": 0.0, "m_xy": 1.0, "m_yx": 1.0, "m_yy": 0.0},
    "flow_scale": {"m_xx": 0.7, "m_yy": 0.7},
    "flow_late": {},
    "flow_clock": {"lost": 1.0},
    "low_texture": LOW_TEXTURE | {"quality": 40.0},
    "low_texture_unsaid": LOW_TEXTURE | {"quality": 255.0},
    "range_stuck": {"held": 1.0},
    "range_stuck_descent": {"held": 1.0},
    "range_floor": {"always": FLOOR_M},
    "range_spikes": {"spike_share": 0.3, "spike_low": FLOOR_M, "spike_high": CEILING_M},
    "imu_bias": {
        **{f"bias_{i}": DEGREE_S for i in range(3)},
        **{f"bias_{i}": 0.3 for i in range(3, 6)},
    },
    "accel_vibration": {"bias_5": 0.5, "noise_last": 4.0},
    "nan_bursts": {"blank_s": 0.1, "blank_every_s": 0.5},
    "silence": {"lost": 1.0},
}
NOT_FLOWN = tuple(name for name in FAULTS if name not in DOES)


def law_of(
    fault: Fault, begins_s: float, ends_s: float, course_rad: float = 0.0, flow_period_s: float = 0.02
) -> SensorFault:
    """A fault from begins_s to ends_s; course_rad: the direction in which it moves a position.

    flow_period_s: between two readings of flow, of which so many are kept as `flow_late` needs at up to 70 Hz.
    KeyError where it cannot be flown (`NOT_FLOWN`).
    """
    does: dict[str, Any] = dict(DOES[fault.name])
    if fault.sensors == (Sensor.GPS_POSITION,):
        for away in ("bias", "drift"):
            size = does.pop(f"{away}_0", 0.0)
            does |= {f"{away}_0": size * math.cos(course_rad), f"{away}_1": size * math.sin(course_rad)}
    if fault.name == "flow_late":
        does["late_readings"] = float(min(round(LATE_S / flow_period_s), MOST_LATE))
    struck = {name: 1.0 for sensor, name in OF_SENSOR.items() if sensor in fault.sensors}
    return SensorFault(begins_s=begins_s, ends_s=ends_s, **struck, **does)
