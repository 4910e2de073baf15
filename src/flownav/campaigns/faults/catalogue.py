"""The faults by name: what each is, what it strikes, how large it is, and what it does to a vehicle's own sensors.

Readings that a receiver sorts out before its navigator cannot be flown as faults of their own: readings stamped
ahead of the clock are not fed, as if they were lost, and that is how they are flown; doubled and disordered
readings, which its queue drops or puts in order again, are not flown at all (`flownav faults --offline` tries them).
"""

import math
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

from flownav.campaigns.faults import inject
from flownav.campaigns.faults.inject import Injector, struck
from flownav.core.errors import InputError, arg
from flownav.core.measurement import Sensor, Stream
from flownav.sensors.settings import RangefinderSettings
from flownav.simulation.layout import EARLIER_READINGS
from flownav.simulation.truth import SensorFault

GPS = (Sensor.GPS_POSITION, Sensor.GPS_VELOCITY)
FLOW = (Sensor.FLOW_RATE, Sensor.FLOW_VELOCITY)
EVERYTHING = tuple(Sensor)
MEASURED = tuple(sensor for sensor in Sensor if sensor != Sensor.LANDED)

SONAR = RangefinderSettings()
FLOOR_M, CEILING_M = float(SONAR.floor_m), float(SONAR.ceiling_m)
# block matching over 2 % of the pad's contrast at 1.5 m (docs/explanation/faults.md); a reading: mean of five frames
TEXTURE_SHARE, TEXTURE_NOISE_RAD_S = 0.2, 0.08
DEGREE_S = math.radians(1.0)


class Fault(NamedTuple):
    """A fault: its name, one sentence of what it does, the sensors it strikes, and how long where that is fixed [s].

    in_descent: it begins with the descent, and not in hover.
    """

    name: str
    what: str
    sensors: tuple[Sensor, ...]
    injector: Injector
    lasts_s: float | None = None
    in_descent: bool = False

    def inject(self, streams: Mapping[Sensor, Stream], t0_s: float, t1_s: float, seed: int = 0) -> dict[Sensor, Stream]:
        """The streams with the fault in readings that arrive in [t0, t1).

        ValueError where t0 < t1 does not hold; InputError where the log has none of the sensors.
        """
        if not t0_s < t1_s:
            raise ValueError(f"a fault from {t0_s:g} to {t1_s:g} s: the end must come after the start")
        if not set(self.sensors) & set(streams):
            wanted = " or ".join(sensor.name.lower() for sensor in self.sensors)
            raise InputError(f"{self.name}: the log has no {wanted}; leave this fault out")
        return struck(streams, self.injector, self.sensors, (t0_s, t1_s), self.name, seed)


_CATALOGUE = (
    Fault("gps_loss", "GPS falls silent.", GPS, inject.lost),
    Fault(
        "gps_jump",
        "GPS position jumps 20 m sideways; its velocity stays right.",
        (Sensor.GPS_POSITION,),
        inject.displaced(20.0, 0.0),
    ),
    Fault(
        "gps_drift",
        "GPS position drifts off at 0.5 m/s; its velocity stays right.",
        (Sensor.GPS_POSITION,),
        inject.displaced(0.0, 0.5),
    ),
    Fault("gps_clock", "The time stamps of GPS jump ahead by 1 s.", GPS, inject.restamped(1.0)),
    Fault("flow_loss", "The flow sensor falls silent.", FLOW, inject.lost),
    Fault("flow_garbage", "Flow is random, up to 2 rad/s or m/s, at full quality.", FLOW, inject.garbage(2.0)),
    Fault("flow_sign", "Both flow channels have the wrong sign.", FLOW, inject.flow_through([[-1, 0], [0, -1]])),
    Fault("flow_swapped", "The two flow channels are swapped.", FLOW, inject.flow_through([[0, 1], [1, 0]])),
    Fault("flow_scale", "Flow is 30 % too small.", FLOW, inject.flow_through([[0.7, 0], [0, 0.7]])),
    Fault("flow_late", "Flow is 100 ms older than it says.", FLOW, inject.late(0.1)),
    Fault("flow_clock", "The time stamps of the flow sensor jump ahead by 1 s.", FLOW, inject.restamped(1.0)),
    Fault(
        "low_texture",
        "A blank patch of ground: a fifth of the flow, noise of 0.08 rad/s, quality 40 of 255.",
        FLOW,
        inject.low_texture(TEXTURE_SHARE, TEXTURE_NOISE_RAD_S, 40.0),
    ),
    Fault(
        "low_texture_unsaid",
        "The same with full quality, as a sensor has it whose own noise passes for texture.",
        FLOW,
        inject.low_texture(TEXTURE_SHARE, TEXTURE_NOISE_RAD_S, 255.0),
    ),
    Fault("range_stuck", "The rangefinder repeats its last range.", (Sensor.RANGE,), inject.stuck),
    Fault(
        "range_stuck_descent",
        "The rangefinder repeats its last range from the start of the descent.",
        (Sensor.RANGE,),
        inject.stuck,
        in_descent=True,
    ),
    Fault("range_floor", "The rangefinder reports its least range, 0.3 m.", (Sensor.RANGE,), inject.always(FLOOR_M)),
    Fault(
        "range_spikes",
        "Three ranges in ten are anything from 0.3 to 5 m.",
        (Sensor.RANGE,),
        inject.spikes(0.3, FLOOR_M, CEILING_M),
    ),
    Fault(
        "imu_bias",
        "Every gyro is off by 1 deg/s and every accelerometer by 0.3 m/s2 at once.",
        (Sensor.IMU,),
        inject.biased([DEGREE_S] * 3, [0.3] * 3),
    ),
    Fault(
        "accel_vibration",
        "Vibration is rectified: accelerometer noise of 4 m/s2, and 0.5 m/s2 too much along body down.",
        (Sensor.IMU,),
        inject.rectified(0.5, 4.0),
    ),
    Fault("nan_bursts", "Every value is NaN for 0.1 s, twice a second.", MEASURED, inject.not_a_number(0.1, 0.5)),
    Fault("duplicates", "Every reading arrives twice.", MEASURED, inject.doubled),
    Fault("out_of_order", "Readings arrive in fives, last first.", MEASURED, inject.reversed_in_blocks(5)),
    Fault("silence", "No sensor says anything for 5 s.", EVERYTHING, inject.lost, lasts_s=5.0),
)
FAULTS: dict[str, Fault] = {fault.name: fault for fault in _CATALOGUE}


def faults_named(names: Iterable[str]) -> tuple[Fault, ...]:
    """Faults by name, in the order asked for. InputError where one is unknown."""
    names = tuple(names)
    for name in names:
        if name not in FAULTS:
            raise InputError(f"{arg('faults')} {name}: no such fault; there are {', '.join(FAULTS)}")
    return tuple(FAULTS[name] for name in names)


# -- in flight ---------------------------------------------------------------------------------------------------
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

    flow_period_s: between two readings of flow; as many readings are kept as `flow_late` needs at up to 70 Hz.
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
