"""A navigator's settings, subject by subject, as its kernels take them: named tuples of numbers.

`settings.NavigatorSettingsFile` documents each key and makes these of a file.
"""

from typing import NamedTuple

from flownav.core.compile import equation
from flownav.estimation.error_models import FilterSettings

# headings: none, a magnetometer's, an external attitude's, an external heading
NO_HEADING, FROM_MAG, FROM_ATTITUDE, FROM_YAW = 0.0, 1.0, 2.0, 3.0
BIAS_LIMIT_SIGMAS = 3.0  # a limit leaves room for all but 3 in 1000 units; chosen


class GpsSettings(NamedTuple):
    """A receiver: noise of one fix beside its lasting errors, its antenna, and how long it may be refused."""

    gps_white_share: float
    gps_white_sigma_m: float
    gps_white_sigma_down_m: float
    gps_velocity_white_m_s: float
    gps_velocity_white_down_m_s: float
    gps_slow_sigma_m: float
    gps_slow_sigma_down_m: float
    gps_fast_sigma_m: float
    gps_fast_sigma_down_m: float
    gps_velocity_lag_sigma_s: float
    gps_velocity_sigma_m_s: float
    gps_velocity_sigma_down_m_s: float
    gps_forward_m: float
    gps_right_m: float
    gps_below_m: float
    gps_reset_s: float
    gate_sigma: float


class FlowNoise(NamedTuple):
    """A sensor file's noise against height [m/s], of what the sensor reports: `sensors.flow.flow_noise_sigma`'s
    polynomial; used where `stated`.
    """

    stated: float
    noise_low_m: float
    noise_high_m: float
    noise_centre: float
    noise_scale: float
    noise_0: float
    noise_1: float
    noise_2: float
    noise_3: float
    noise_4: float
    noise_5: float
    noise_6: float
    noise_7: float
    noise_8: float
    noise_floor_m_s: float


class FlowSettings(NamedTuple):
    """A flow sensor: gain, noise, limits, its lens from the IMU."""

    flow_gain_x: float
    flow_gain_y: float
    flow_sigma_rad_s: float
    flow_low_quality_sigma_rad_s: float
    flow_low_quality_s: float
    flow_floor_m_s: float
    flow_min_height_m: float
    flow_limit_rad_s: float
    flow_lag_b_1_s: float
    flow_lag_c_1_s2: float
    flow_noise_time_s: float
    flow_lasting_rad_s: float
    flow_lasting_share: float
    flow_lasting_s: float
    flow_gyro_time_s: float
    flow_forward_m: float
    flow_right_m: float
    flow_below_m: float
    tilt_limit_rad: float
    height_hold_s: float
    range_sigma_m: float
    range_relative_sigma: float
    gate_sigma: float
    noise: FlowNoise


@equation
def flow_gain(component: int, angular: bool, gain_x: float, gain_y: float) -> float:
    """Reported over true, of a component of flow: gain_x of the speed forward, which flow_y shows where it is angular;
    1 of a velocity down.
    """
    return gain_x if component == (1 if angular else 0) else (1.0 if component == 2 else gain_y)


@equation
def carries_lag(s: FlowSettings) -> bool:
    """Whether the sensor's own dynamics are states of the filter."""
    return s.flow_lag_c_1_s2 > 0.0


class HeightSettings(NamedTuple):
    """Rangefinder and barometer."""

    range_forward_m: float
    range_right_m: float
    range_below_m: float
    range_sigma_m: float
    range_relative_sigma: float
    range_scale_sigma: float
    ground_walk_m_rt_s: float
    range_min_m: float
    range_max_m: float
    range_stuck_s: float
    range_stuck_travel_m: float
    baro_sigma_m: float
    tilt_limit_rad: float
    height_hold_s: float
    ground_reset_s: float
    gate_sigma: float


class AttitudeSettings(NamedTuple):
    """An external attitude, a compass, an external heading."""

    ins_tilt_white_rad: float
    ins_tilt_time_s: float
    heading_noise_rad: float
    heading_time_s: float
    gate_sigma: float


class PlaceSettings(NamedTuple):
    """A pad camera, an external position, a vehicle at rest."""

    pad_angle_sigma_rad: float
    pad_distance_sigma: float
    pad_boresight_sigma_rad: float
    pad_scale_sigma: float
    pad_time_sigma_s: float
    pose_sigma_m: float
    still_sigma_m_s: float
    pad_forward_m: float
    pad_right_m: float
    pad_below_m: float
    gate_sigma: float


class ImuSettings(NamedTuple):
    """The inertial sensors: noise with them and without, what vibration does, when a reading is stale."""

    accel_noise_m_s2_rt_hz: float
    accel_noise_down_share: float
    gyro_noise_rad_s_rt_hz: float
    gyro_scale_sigma: float
    gyro_tones_rad_s_rt_hz: float
    accel_walk_m_s2_rt_s: float
    coasting_accel_m_s2_rt_hz: float
    coasting_rate_rad_s_rt_hz: float
    imu_integrates: float
    imu_stale_s: float
    notch_rotor_hz: float
    notch_blades_hz: float
    vibration_free_m_s2: float
    vibration_walk_per_rt_s: float
    vibration_bias_share: float
    vibration_rectified_share: float
    accel_bias_limit_m_s2: float
    gyro_bias_limit_rad_s: float


class AidSettings(NamedTuple):
    """Times without aid after which the position is marked as dead reckoning, and as invalid."""

    dead_reckoning_s: float
    invalid_s: float


class Equipment(NamedTuple):
    """Which sensors serve a navigator.

    heading: 0 none, 1 a compass's, 2 an external attitude's, 3 YAW's; deadline_s: how long it waits for a fix;
    declination_rad: the heading of magnetic north where it is.
    """

    use_imu: bool
    use_attitude: bool
    heading: float
    flow_gyro_is_imu: bool
    deadline_s: float
    declination_rad: float = 0.0


class NavigatorSettings(NamedTuple):
    """All settings of a navigator."""

    filter: FilterSettings
    imu: ImuSettings
    gps: GpsSettings
    flow: FlowSettings
    height: HeightSettings
    attitude: AttitudeSettings
    place: PlaceSettings
    aid: AidSettings
    equipment: Equipment


NO_STATED_NOISE = FlowNoise(*([0.0] * len(FlowNoise._fields)))
