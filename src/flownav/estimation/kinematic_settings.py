"""The kinematic filter's settings: what each number means, its allowed range, its default and the reason.

The defaults are for any small VTOL with consumer sensors. None is fitted to a log.
"""

from __future__ import annotations

from typing import NamedTuple

from pydantic import Field

from flownav.parameter_files import Number, ParameterModel


class KinematicSettings(NamedTuple):
    """The settings as the kernels take them; `KinematicSettingsFile` documents each."""

    accel_noise_m_s2_rt_hz: float
    coast_noise_m_s2_rt_hz: float
    path_noise_m_rt_m: float
    trim_time_s: float
    trim_limit_m_s2: float
    gps_position_sigma_m: float
    gps_height_sigma_m: float
    gps_velocity_sigma_m_s: float
    gps_climb_sigma_m_s: float
    flow_sigma_rad_s: float
    flow_low_quality_sigma_rad_s: float
    flow_floor_m_s: float
    flow_limit_rad_s: float
    flow_noise_time_s: float
    range_sigma_m: float
    range_relative_sigma: float
    range_min_m: float
    range_max_m: float
    baro_sigma_m: float
    baro_drift_time_s: float
    gate_sigma: float
    tilt_limit_rad: float
    stale_s: float
    height_hold_s: float
    ground_reset_s: float
    gps_reset_s: float
    start_wait_s: float
    start_velocity_sigma_m_s: float


class KinematicSettingsFile(ParameterModel):
    """The settings as a TOML file states them; every key may be left out."""

    accel_noise_m_s2_rt_hz: Number = Field(
        0.8, gt=0, le=50,
        description="white acceleration noise; 1 degree of attitude error is 0.17 m/s2 of gravity, and one that lasts "
        "10 s acts as white noise of 0.17 sqrt(2 * 10 s) = 0.8",
    )  # fmt: skip
    coast_noise_m_s2_rt_hz: Number = Field(
        3.0, gt=0, le=100, description="the same without an accelerometer: manoeuvres of 0.3 g that last 0.5 s"
    )
    path_noise_m_rt_m: Number = Field(
        0.1, ge=0, le=5,
        description="odometry's own random walk: 1 m after 100 m, the 1 % that scale and heading errors leave",
    )  # fmt: skip
    trim_time_s: Number = Field(60.0, ge=5, le=1e9, description="time constant of the accelerometer trim")
    trim_limit_m_s2: Number = Field(0.5, ge=0, le=3, description="largest trim: 3 degrees of tilt or 50 mg of bias")
    gps_position_sigma_m: Number = Field(1.0, gt=0, le=100, description="horizontal GPS position, open sky")
    gps_height_sigma_m: Number = Field(2.0, gt=0, le=200, description="GPS height, about twice the horizontal")
    gps_velocity_sigma_m_s: Number = Field(0.3, gt=0, le=20, description="horizontal GPS velocity while manoeuvring")
    gps_climb_sigma_m_s: Number = Field(0.5, gt=0, le=20, description="vertical GPS velocity")
    flow_sigma_rad_s: Number = Field(
        0.05, gt=0, le=5, description="flow at full quality; pixel quantisation and gyro mismatch of a 10-50 Hz sensor"
    )
    flow_low_quality_sigma_rad_s: Number = Field(0.5, gt=0, le=10, description="flow as its quality goes to 0")
    flow_floor_m_s: Number = Field(0.03, gt=0, le=5, description="body velocity near the ground, whatever the range")
    flow_limit_rad_s: Number = Field(10.0, gt=0, le=50, description="no sensor of this kind measures faster flow")
    flow_noise_time_s: Number = Field(
        10.0, gt=0, le=1e9, description="flow noisier than modelled is followed at this pace; a surface lasts seconds"
    )
    range_sigma_m: Number = Field(0.05, gt=0, le=5, description="rangefinder noise and grass")
    range_relative_sigma: Number = Field(0.02, ge=0, le=0.5, description="share of the range added to it")
    range_min_m: Number = Field(0.02, ge=0, le=5, description="shorter readings are no readings")
    range_max_m: Number = Field(100.0, gt=0, le=1000, description="longer readings are no readings")
    baro_sigma_m: Number = Field(1.5, gt=0, le=100, description="pressure height in the rotor's own wash")
    baro_drift_time_s: Number = Field(60.0, ge=1, le=1e9, description="the pressure offset is followed this slowly")
    gate_sigma: Number = Field(5.0, gt=0, le=100, description="innovation gate, standard deviations (ArduPilot's 5)")
    tilt_limit_rad: Number = Field(0.8, gt=0, le=1.4, description="46 degrees: the ground ahead is no longer below")
    stale_s: Number = Field(0.25, gt=0, le=10, description="an older IMU reading no longer moves the state")
    height_hold_s: Number = Field(5.0, ge=0, le=600, description="flow is used this long after the last good range")
    ground_reset_s: Number = Field(1.0, gt=0, le=60, description="range rejected this long: the ground has a step")
    gps_reset_s: Number = Field(5.0, gt=0, le=600, description="GPS rejected this long: the filter is wrong, not GPS")
    start_wait_s: Number = Field(10.0, ge=0, le=600, description="wait this long for a fix, then start without")
    start_velocity_sigma_m_s: Number = Field(3.0, gt=0, le=100, description="velocity at a start without GPS velocity")

    def settings(self) -> KinematicSettings:
        """The numbers alone, for the kernels."""
        return KinematicSettings(*(float(getattr(self, name)) for name in KinematicSettings._fields))


def default_settings() -> KinematicSettings:
    """The shipped defaults."""
    return KinematicSettingsFile().settings()
