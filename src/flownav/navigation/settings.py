"""Assumptions of the navigator about a vehicle's sensors where nothing better is known: keys, limits, defaults,
reasons.

The defaults are for any small VTOL with consumer sensors. None is fitted to a log.
"""

from typing import Any

import numpy as np
from pydantic import Field

from flownav.core.measurement import Array
from flownav.core.parameter_files import Number, ParameterModel
from flownav.estimation.error_models import FilterSettings
from flownav.estimation.states import (
    ACCEL_BIAS,
    COMPASS,
    FLOW_SCALE,
    GPS_FAST,
    GPS_SLOW,
    GPS_VELOCITY,
    GYRO_BIAS,
    INS_ERROR,
    STATES,
    VELOCITY,
    VELOCITY_LAG,
)
from flownav.navigation.kernel_settings import (
    NO_STATED_NOISE,
    AidSettings,
    AttitudeSettings,
    Equipment,
    FlowNoise,
    FlowSettings,
    GpsSettings,
    HeightSettings,
    ImuSettings,
    NavigatorSettings,
    PlaceSettings,
)


class NavigatorSettingsFile(ParameterModel):
    """The settings as a TOML file states them; every key may be left out."""

    accel_noise_m_s2_rt_hz: Number = Field(
        0.1,
        gt=0,
        le=50,
        description="accelerometer noise with vibration; PX4's 0.35 m/s2 at 8 ms is 0.03, and half as much again lasts",
    )
    accel_noise_down_share: Number = Field(
        1.0, gt=0, le=10, description="of that noise, of the vertical: a rotor shakes level more than down"
    )
    gyro_noise_rad_s_rt_hz: Number = Field(
        0.004, gt=0, le=5, description="gyro noise with vibration and sampling; PX4's 0.015 rad/s at 8 ms is 0.0013"
    )
    gyro_scale_sigma: Number = Field(
        0.0, ge=0, le=0.2, description="gyro's scale and alignment, one standard deviation, a share; 0: in the noise"
    )
    gyro_tones_rad_s_rt_hz: Number = Field(
        0.0,
        ge=0,
        le=5,
        description="what tones that turn nothing show as noise between a gyro's readings; 0: none known",
    )
    accel_walk_m_s2_rt_s: Number = Field(0.003, ge=0, le=1, description="accelerometer bias, PX4's 0.003")
    gyro_walk_rad_s_rt_s: Number = Field(1e-4, ge=0, le=0.1, description="gyro bias over minutes of warming")
    imu_integrates: Number = Field(
        0.0,
        ge=0,
        le=1,
        description="1: a reading is the mean since the last, of a unit that integrates; 0: of its instant",
    )
    notch_rotor_hz: Number = Field(
        0.0,
        ge=0,
        le=500,
        description="the rotor's vibration, as the IMU reads it, is taken off its forces; 0: it is not",
    )
    notch_blades_hz: Number = Field(0.0, ge=0, le=500, description="and that of its blades")
    vibration_free_m_s2: Number = Field(
        1.0, ge=0, le=100, description="sample-to-sample accelerometer noise, rms, that harms nothing"
    )
    vibration_walk_per_rt_s: Number = Field(
        0.5, ge=0, le=10, description="what exceeds it lets the bias walk by this share: vibration is rectified"
    )
    vibration_bias_share: Number = Field(3.0, ge=0, le=20, description="and widens its limit by this share")
    vibration_rectified_share: Number = Field(
        2.0,
        ge=0,
        le=20,
        description="of what shakes an accelerometer, rms, what it may err by for as long as it is shaken so",
    )
    accel_bias_sigma_m_s2: Number = Field(0.2, gt=0, le=5, description="accelerometer bias at the start: 20 mg")
    gyro_bias_sigma_rad_s: Number = Field(
        0.003, gt=0, le=0.5, description="gyro bias at the start, as its autopilot calibrated it: 0.2 deg/s"
    )
    coasting_accel_m_s2_rt_hz: Number = Field(
        3.0, gt=0, le=100, description="without an IMU: manoeuvres of 0.3 g that last 0.5 s"
    )
    coasting_rate_rad_s_rt_hz: Number = Field(1.0, gt=0, le=100, description="without an IMU: turning")
    position_walk_m_rt_s: Number = Field(0.01, ge=0, le=5, description="what the models leave out, per root second")
    gps_slow_sigma_m: Number = Field(1.5, ge=0, le=100, description="GPS: ionosphere and orbits, open sky")
    gps_slow_sigma_down_m: Number = Field(2.5, ge=0, le=200, description="and of height")
    gps_slow_tau_s: Number = Field(300.0, gt=0, le=1e6, description="they change over minutes")
    gps_fast_sigma_m: Number = Field(0.5, ge=0, le=100, description="GPS: multipath")
    gps_fast_sigma_down_m: Number = Field(1.0, ge=0, le=200, description="and of height")
    gps_fast_tau_s: Number = Field(20.0, gt=0, le=1e6, description="it changes as the vehicle moves")
    gps_white_sigma_m: Number = Field(0.4, gt=0, le=100, description="GPS position: noise of one fix, quantisation")
    gps_white_sigma_down_m: Number = Field(0.8, gt=0, le=100, description="and of height")
    gps_white_share: Number = Field(
        0.3, gt=0, le=1, description="of the accuracy that a receiver states, the part that changes from fix to fix"
    )
    gps_velocity_sigma_m_s: Number = Field(0.1, ge=0, le=20, description="GPS velocity: the part that lasts")
    gps_velocity_sigma_down_m_s: Number = Field(0.1, ge=0, le=20, description="and vertically")
    gps_velocity_tau_s: Number = Field(5.0, gt=0, le=1e6, description="for some seconds")
    gps_velocity_white_m_s: Number = Field(0.4, gt=0, le=20, description="GPS velocity: noise, without its lag")
    gps_velocity_white_down_m_s: Number = Field(0.5, gt=0, le=20, description="and vertically")
    gps_velocity_lag_sigma_s: Number = Field(0.15, ge=0, le=2, description="receivers smooth their velocity, and lag")
    gps_forward_m: Number = Field(0.0, ge=-10, le=10, description="the antenna from the IMU, body forward")
    gps_right_m: Number = Field(0.0, ge=-10, le=10, description="body right")
    gps_below_m: Number = Field(0.0, ge=-10, le=10, description="body down; above it is negative")
    ins_tilt_sigma_rad: Number = Field(0.01, ge=0, le=1, description="an autopilot's tilt error, 0.6 deg")
    ins_tilt_tau_s: Number = Field(30.0, gt=0, le=1e6, description="follows the manoeuvres")
    ins_tilt_white_rad: Number = Field(0.01, gt=0, le=1, description="time alignment of such an attitude")
    ins_tilt_time_s: Number = Field(
        0.5, ge=0, le=1e4, description="which lasts: beside an IMU it is read no oftener than this"
    )
    ins_heading_sigma_rad: Number = Field(0.15, ge=0, le=3.2, description="a compass with its declination: 9 deg")
    ins_heading_tau_s: Number = Field(3e4, gt=0, le=1e6, description="constant over a flight")
    compass_sigma_rad: Number = Field(
        0.15, ge=0, le=3.2, description="hard iron: deviation that turns with the vehicle"
    )
    heading_noise_rad: Number = Field(0.04, gt=0, le=3.2, description="what is left: soft iron, currents, tilt, 3 deg")
    heading_time_s: Number = Field(5.0, gt=0, le=1e4, description="and lasts this long, however often it is read")
    ground_walk_m_rt_s: Number = Field(
        0.05, ge=0, le=5, description="the ground is not level: 0.4 m in a minute at 1 m/s or more, none in hover"
    )
    baro_walk_m_rt_s: Number = Field(0.1, ge=0, le=5, description="pressure drifts 0.8 m in a minute")
    baro_sigma_m: Number = Field(1.0, gt=0, le=100, description="pressure height in the rotor's own wash")
    flow_scale_sigma: Number = Field(0.1, ge=0, le=0.5, description="optics and their mounting, without a sensor file")
    flow_gain_x: Number = Field(1.0, gt=0, le=10, description="reported over true flow of velocity, body forward")
    flow_gain_y: Number = Field(1.0, gt=0, le=10, description="and body right")
    flow_sigma_rad_s: Number = Field(
        0.05, gt=0, le=5, description="flow at full quality; pixel quantisation and gyro mismatch of a 10-50 Hz sensor"
    )
    flow_low_quality_sigma_rad_s: Number = Field(0.5, gt=0, le=10, description="flow as its quality goes to 0")
    flow_low_quality_s: Number = Field(
        2.0, ge=0, le=100, description="and for how long such a reading errs alike: no texture reads as standing still"
    )
    flow_floor_m_s: Number = Field(0.03, gt=0, le=5, description="body velocity near the ground, whatever the range")
    flow_min_height_m: Number = Field(
        0.05, ge=0, le=100, description="no flow nearer to the ground, where a lens is out of focus"
    )
    flow_limit_rad_s: Number = Field(10.0, gt=0, le=50, description="no sensor of this kind measures faster flow")
    flow_lag_b_1_s: Number = Field(0.0, ge=0, le=1e4, description="the sensor's own dynamics c/(s2 + b s + c)")
    flow_lag_c_1_s2: Number = Field(0.0, ge=0, le=1e7, description="0: a delay stands for them, else they are states")
    flow_noise_time_s: Number = Field(
        10.0, gt=0, le=1e9, description="flow noisier than modelled is followed at this pace; a surface lasts seconds"
    )
    flow_lasting_rad_s: Number = Field(
        0.003, ge=0, le=1, description="what lasts of a flow's error where nothing else tells the velocity: 0.2 deg/s"
    )
    flow_lasting_share: Number = Field(0.03, ge=0, le=1, description="and of the speed: scale, height, texture")
    flow_lasting_s: Number = Field(10.0, ge=0, le=1e4, description="and for how long")
    flow_gyro_time_s: Number = Field(10.0, gt=0, le=1e6, description="a flow sensor's gyro bias is followed so")
    flow_forward_m: Number = Field(0.0, ge=-10, le=10, description="the lens from the IMU, body forward")
    flow_right_m: Number = Field(0.0, ge=-10, le=10, description="body right")
    flow_below_m: Number = Field(0.0, ge=-10, le=10, description="body down")
    range_forward_m: Number = Field(0.0, ge=-10, le=10, description="the rangefinder from the IMU, body forward")
    range_right_m: Number = Field(0.0, ge=-10, le=10, description="body right")
    range_below_m: Number = Field(0.0, ge=-10, le=10, description="the rangefinder below the IMU")
    range_sigma_m: Number = Field(0.05, gt=0, le=5, description="rangefinder noise and grass")
    range_relative_sigma: Number = Field(0.02, ge=0, le=0.5, description="share of the range added to it")
    range_scale_sigma: Number = Field(0.01, ge=0, le=0.5, description="share of the range by which it errs alike")
    range_min_m: Number = Field(0.02, ge=0, le=5, description="shorter readings are no readings")
    range_max_m: Number = Field(100.0, gt=0, le=1000, description="longer readings are no readings")
    range_stuck_s: Number = Field(0.5, gt=0, le=60, description="a range that repeats itself this long")
    range_stuck_travel_m: Number = Field(0.1, gt=0, le=10, description="while the height changes so much, is stuck")
    pad_forward_m: Number = Field(0.0, ge=-10, le=10, description="the pad's camera from the IMU, body forward")
    pad_right_m: Number = Field(0.0, ge=-10, le=10, description="body right")
    pad_below_m: Number = Field(0.0, ge=-10, le=10, description="body down")
    pad_angle_sigma_rad: Number = Field(0.01, gt=0, le=1, description="a pad detector's line of sight")
    pad_distance_sigma: Number = Field(0.05, gt=0, le=1, description="share of the distance")
    pad_boresight_sigma_rad: Number = Field(0.0, ge=0, le=0.5, description="of a pad fix's angle, what lasts")
    pad_scale_sigma: Number = Field(0.0, ge=0, le=0.5, description="and of its distance, as a share")
    pad_time_sigma_s: Number = Field(0.0, ge=0, le=1, description="how far off its instant a pad fix is stamped")
    pose_sigma_m: Number = Field(0.05, gt=0, le=10, description="an external position that states no accuracy")
    still_sigma_m_s: Number = Field(0.02, gt=0, le=1, description="a vehicle on the ground, its rotor turning")
    pad_walk_m_rt_s: Number = Field(0.002, ge=0, le=5, description="a pad lies still; the local frame is not exact")
    gate_sigma: Number = Field(5.0, gt=0, le=100, description="innovation gate, standard deviations (ArduPilot's 5)")
    accel_bias_limit_m_s2: Number = Field(0.6, gt=0, le=10, description="60 mg")
    gyro_bias_limit_rad_s: Number = Field(0.15, gt=0, le=1, description="9 deg/s")
    tilt_limit_rad: Number = Field(0.8, gt=0, le=1.4, description="46 degrees: the ground ahead is no longer below")
    imu_stale_s: Number = Field(0.25, gt=0, le=10, description="an older IMU reading no longer moves the state")
    height_hold_s: Number = Field(5.0, ge=0, le=600, description="flow is used this long after the last good range")
    ground_reset_s: Number = Field(1.0, gt=0, le=60, description="range rejected this long: the ground has a step")
    gps_reset_s: Number = Field(7.0, gt=0, le=600, description="GPS rejected this long: the filter is wrong (PX4's 7)")
    dead_reckoning_s: Number = Field(1.0, gt=0, le=60, description="no horizontal aid this long: flagged (PX4's 1)")
    invalid_s: Number = Field(5.0, gt=0, le=600, description="and this long: position flagged invalid (PX4's 5)")
    start_wait_s: Number = Field(10.0, ge=0, le=600, description="wait this long for a fix, then start without")
    start_velocity_sigma_m_s: Number = Field(2.0, gt=0, le=100, description="velocity before the first reading of it")

    def settings(self, equipment: Equipment, noise: FlowNoise = NO_STATED_NOISE) -> NavigatorSettings:
        """The numbers alone, for the kernels."""
        stated = {name: float(value) for name, value in self.model_dump().items()}

        def of(bundle: Any, **more: Any) -> Any:
            return bundle(**{name: stated[name] for name in bundle._fields if name in stated}, **more)

        return NavigatorSettings(
            of(FilterSettings), of(ImuSettings), of(GpsSettings), of(FlowSettings, noise=noise), of(HeightSettings),
            of(AttitudeSettings), of(PlaceSettings), of(AidSettings), equipment,
        )  # fmt: skip

    def start_sigma(self, *, has_heading: bool, compass: bool, scale: bool = True) -> Array:
        """Standard deviations of the error states before the first reading, (STATES,).

        Those of position and attitude are set at the start, those of the ground and the barometer when first read.
        """
        sigma = np.zeros(STATES)
        sigma[VELOCITY : VELOCITY + 3] = self.start_velocity_sigma_m_s
        sigma[GYRO_BIAS : GYRO_BIAS + 3] = self.gyro_bias_sigma_rad_s
        sigma[ACCEL_BIAS : ACCEL_BIAS + 3] = self.accel_bias_sigma_m_s2
        sigma[GPS_SLOW : GPS_SLOW + 3] = self.gps_slow_sigma_m, self.gps_slow_sigma_m, self.gps_slow_sigma_down_m
        sigma[GPS_FAST : GPS_FAST + 3] = self.gps_fast_sigma_m, self.gps_fast_sigma_m, self.gps_fast_sigma_down_m
        level, down = self.gps_velocity_sigma_m_s, self.gps_velocity_sigma_down_m_s
        sigma[GPS_VELOCITY : GPS_VELOCITY + 3] = level, level, down
        heading = self.ins_heading_sigma_rad if has_heading else 0.0
        sigma[INS_ERROR : INS_ERROR + 3] = self.ins_tilt_sigma_rad, self.ins_tilt_sigma_rad, heading
        sigma[COMPASS : COMPASS + 2] = self.compass_sigma_rad if compass else 0.0
        sigma[VELOCITY_LAG] = self.gps_velocity_lag_sigma_s
        sigma[FLOW_SCALE] = self.flow_scale_sigma if scale else 0.0
        return sigma
