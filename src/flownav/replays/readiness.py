"""Can a log be replayed? What it would lack, in words."""

from __future__ import annotations

from flownav.core.measurement import Sensor
from flownav.logs.log import Log
from flownav.navigation.feed import SLOWEST_IMU_HZ, imu_serves, rate_hz

AIDS = (Sensor.GPS_POSITION, Sensor.FLOW_RATE, Sensor.FLOW_VELOCITY)


def obstacles(log: Log) -> list[str]:
    """What a replay of the log would lack, one line each; none where it can be replayed."""
    found = []
    if Sensor.ATTITUDE not in log.streams and not imu_serves(log.streams):
        slow = Sensor.IMU in log.streams
        has = f"its IMU has {rate_hz(log.streams[Sensor.IMU].t_s):.1f} Hz" if slow else "it has no IMU"
        found.append(f"no attitude, and {has}: one of them is needed, an IMU of {SLOWEST_IMU_HZ:g} Hz or more")
    if not log.streams.keys() & set(AIDS):
        found.append("neither GPS nor optical flow: nothing to hold the position")
    return found
