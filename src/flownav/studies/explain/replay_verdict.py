"""The verdict of `flownav replay` on a sensor that is blamed, and why it differs where it finds nothing to act on.

Replay holds readings against the noise that the navigator allows for; a cause holds them against another witness.
"""

from flownav.core.measurement import Sensor
from flownav.replays.judged import consistency_scores
from flownav.scoring.sensor_verdict import ACT, verdict
from flownav.studies.explain.case import Case

BLAMED = {
    "baro_wash": (Sensor.BARO, "barometer"),
    "gps_glitch": (Sensor.GPS_POSITION, "GPS position"),
    "gps_lag": (Sensor.GPS_VELOCITY, "GPS velocity"),
    "range_stuck": (Sensor.RANGE, "range"),
    "range_spikes": (Sensor.RANGE, "range"),
    "terrain_step": (Sensor.RANGE, "range"),
    "compass_wrong": (Sensor.MAG, "magnetometer"),
    "compass_motors": (Sensor.MAG, "magnetometer"),
    **dict.fromkeys(
        ("flow_axes", "flow_scale", "flow_interval", "flow_offset", "flow_delay", "clock_wrong", "flow_gyro",
         "flow_noise", "focus_height", "low_texture"),
        (Sensor.FLOW_RATE, "flow"),
    ),
}  # fmt: skip


def difference(case: Case, cause: str) -> str:
    """Why `flownav replay` sees nothing to act on in the sensor that a cause blames; "" where it does, or has none."""
    if cause not in BLAMED or case.base is None:
        return ""
    sensor, name = BLAMED[cause]
    judged = consistency_scores(case.base.innovation, case.log.streams.get(Sensor.LANDED)).get(sensor.name.lower())
    if judged is None:
        return ""
    words = verdict(judged["nis_per_dof"], white=judged["white"], refused=judged["refused"])
    return "" if words.startswith(ACT) else in_words(name, words)


def in_words(name: str, words: str) -> str:
    """The two laws side by side."""
    return (
        f'`flownav replay` calls the {name} "{words}": there its readings scatter no more than the navigator allows '
        "for. Here they are held against the other sensors, and against what an autopilot's filter bears."
    )
