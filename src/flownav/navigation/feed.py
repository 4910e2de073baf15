"""From streams to a navigator that is ready for them: which sensors serve."""

import numpy as np

from flownav.core.measurement import Array, Sensor, Stream
from flownav.navigation.kernel_settings import FROM_ATTITUDE, FROM_MAG, FROM_YAW, NO_HEADING, Equipment
from flownav.navigation.settings import NavigatorSettingsFile
from flownav.sensors.magnetometer import declination_rad

# chosen: 25 Hz (dataflash/heli_sitl) gives 0.05 m rms (league.md); voxl's IMU of 2 Hz is passed over
SLOWEST_IMU_HZ = 20.0


def rate_hz(t_s: Array) -> float:
    """The usual rate of readings; 0 where there are not two."""
    steps = np.diff(t_s)
    steps = steps[steps > 0.0]
    return 1.0 / float(np.median(steps)) if len(steps) else 0.0


def imu_serves(streams: dict[Sensor, Stream]) -> bool:
    """Whether the IMU is fast enough to move a filter."""
    return Sensor.IMU in streams and rate_hz(streams[Sensor.IMU].t_s) >= SLOWEST_IMU_HZ


def heading_source(streams: dict[Sensor, Stream]) -> float:
    """Where headings come from: a magnetometer's north is the frame's, with GPS or without; an attitude's heading is
    one only in a frame of the earth.
    """
    source = FROM_YAW if Sensor.YAW in streams and len(streams[Sensor.YAW]) else NO_HEADING
    if Sensor.MAG in streams and len(streams[Sensor.MAG]):
        return FROM_MAG
    if Sensor.GPS_POSITION not in streams and Sensor.GPS_VELOCITY not in streams:
        return source
    return FROM_ATTITUDE if Sensor.ATTITUDE in streams else source


def equipment_of(
    streams: dict[Sensor, Stream], first_s: float, flow_gyro_is_imu: bool, settings: NavigatorSettingsFile,
    origin_deg_m: tuple[float, float, float] | None = None,
) -> Equipment:  # fmt: skip
    """The equipment that the streams make up. first_s: from when the navigator waits for a fix; origin_deg_m: where on
    earth it is.
    """
    serves = imu_serves(streams)
    fixes = Sensor.GPS_POSITION in streams and bool(np.any(streams[Sensor.GPS_POSITION].quality > 0.0))
    return Equipment(
        serves,
        not serves and Sensor.ATTITUDE in streams,
        heading_source(streams),
        flow_gyro_is_imu,
        first_s + float(settings.start_wait_s) if fixes else -np.inf,
        declination_rad(origin_deg_m),
    )
