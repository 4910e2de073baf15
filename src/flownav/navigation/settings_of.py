"""From datasheets to the navigator's settings: the one way, for every job.

A value that no sheet states keeps its default, and what a user states in a settings file stands above what a sheet
states. Standard deviations that a sheet gives for units of its kind become the filter's for this one; densities are
one-sided in sheets and two-sided in the filter, where white noise of density N lets its integral's variance grow by N^2
t/2.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

from flownav.core.frames import GRAVITY_M_S2
from flownav.core.parameter_files import check
from flownav.navigation.kernel_settings import BIAS_LIMIT_SIGMAS, NO_STATED_NOISE, FlowNoise
from flownav.navigation.notch import LEAST_NOTCH_HZ, WIDTH, read_angle
from flownav.navigation.settings import NavigatorSettingsFile
from flownav.sensors.barometer import BarometerSheet
from flownav.sensors.camera_sheets import FlowCameraSheet, PadCameraSheet
from flownav.sensors.datasheet import FlowSensor, identified_flow, needs_lag_states
from flownav.sensors.magnetometer import MagneticField, MagnetometerSheet
from flownav.sensors.range_sensor import RangeSensorSheet
from flownav.sensors.sheets import AccelerometerSheet, GpsReceiverSheet, GyroSheet, InertialSheet, SensorSheets

ABOVE_FLOOR_M = 0.01  # a step of the shipped lidar: a rangefinder that reads its floor shows only that there is no more
LEAST_SHARE = 0.05  # of a stated accuracy, where the sheet states the change from fix to fix: chosen, not measured
VIBRATION_MARGIN = 2.0  # chosen, not measured: what is beyond twice the stated vibration, the sheet does not know
# slower motion is held by what aids the IMU: level velocity errs by 1.17 of what is stated with 2, by 1.02 with 4
AIDED_HZ = 3.0
RECTIFIED_SHARE = 0.1  # of a unit that a sheet describes: chosen; 1 is the false roll of `landing`
NOTCHED = ("level_m_s2", "vertical_m_s2")
# what a unit that integrates leaves out of the position; with 0.01, the default, w errs by 0.7 of what is stated at
# `approach`, with this by 1.0
INTEGRATED_M_RT_S = 0.002
# of a rangefinder's error of scale, what the ground walks by as the height changes: a walk doubts the vertical velocity
# by more than a share that lasts does. With all of it z errs by 0.80 of what is stated (`takeoff`), with half by 0.87
SCALE_SHARE = 0.5
FOLLOWED_TO = 0.002  # a notch follows its tone within this (test_notch), whatever the rotor does
LAGS_AS_STATED = 2.0  # of a receiver's filter: 0.2 to 0.3 s were found in two logs where sheets state 0.1 s (validate)
WASH_LASTS_S = 3.0  # chosen, not measured: how long a rotor's wash deceives a barometer
CLIMB_M_S = 1.0  # chosen: a lag errs by its length in a descent at this speed

Keys = dict[str, float]


class GivenSettings(NamedTuple):
    """A navigator's settings, and the flow's noise by its sensor file, where that is to be used."""

    settings: NavigatorSettingsFile
    noise: FlowNoise = NO_STATED_NOISE

    @property
    def lag_states(self) -> bool:
        """Whether the flow sensor's dynamics are states of the filter: by its file, or as the user states."""
        return self.settings.flow_lag_c_1_s2 > 0.0


def settings_of(
    flow: FlowSensor | None = None,
    sheets: SensorSheets | None = None,
    *,
    stated: NavigatorSettingsFile | None = None,
    flow_noise_stated: bool = False,
    rotor_hz: tuple[float, float] | None = None,
) -> GivenSettings:
    """The navigator's settings for these sensors.

    flow: the flow sensor's file, else the sheets'. stated: a user's own settings; the keys that stand in it are kept.
    flow_noise_stated: the flow's noise is the file's law of the height, not that of the reading's quality.
    rotor_hz: of the rotor and of its blades; the IMU's own filter weakens their vibration.
    InputError where the file's axes are not known, or a sensor is one that no navigator could use.
    """
    sensor = flow if flow is not None else (sheets.flow_sensor if sheets is not None else None)
    keys: Keys = {}
    if sheets is not None:
        keys |= of_sheets(sheets, rotor_hz)
    if sensor is not None:
        keys |= of_flow_sensor(sensor)
    if stated is not None:
        keys |= {name: getattr(stated, name) for name in stated.model_fields_set}
    noise = noise_of(sensor) if sensor is not None and flow_noise_stated else NO_STATED_NOISE
    where = sensor.name if sensor is not None else "the sensor files"
    return GivenSettings(check(keys, NavigatorSettingsFile, f"{where}, as the navigator takes it"), noise)


def of_sheets(sheets: SensorSheets, rotor_hz: tuple[float, float] | None = None) -> Keys:
    """Every sheet that there is."""
    keys = of_inertial(sheets.inertial, rotor_hz)
    if sheets.gps_receiver is not None:
        keys |= of_gps_receiver(sheets.gps_receiver)
    if sheets.range_sensor is not None:
        keys |= of_range_sensor(sheets.range_sensor)
    if sheets.barometer is not None:
        keys |= of_barometer(sheets.barometer)
    if sheets.magnetometer is not None:
        keys |= of_magnetometer(sheets.magnetometer, sheets.magnetic_field)
    if sheets.flow_camera is not None:
        keys |= of_flow_camera(sheets.flow_camera)
    if sheets.pad_camera is not None:
        keys |= of_pad_camera(sheets.pad_camera)
    return keys


# -- flow ---------------------------------------------------------------------------------------------------
def of_flow_sensor(sensor: FlowSensor) -> Keys:
    """Gains, limits, and dynamics that are more than a delay.

    Latency and axes belong to those who feed the readings (`sensors.datasheet`).
    """
    found = identified_flow(sensor)
    dynamics = sensor.dynamics
    lag = {"flow_lag_b_1_s": dynamics.b_1_s, "flow_lag_c_1_s2": dynamics.c_1_s2} if needs_lag_states(sensor) else {}
    return lag | {
        "flow_gain_x": found.gain_u,
        "flow_gain_y": found.gain_v,
        "flow_min_height_m": sensor.limits.min_height_m,
        "flow_limit_rad_s": sensor.limits.max_flow_rad_s,
    }


def noise_of(sensor: FlowSensor) -> FlowNoise:
    """The file's law of the height."""
    fit = sensor.noise.fit()
    law = {f"noise_{i}": coefficient for i, coefficient in enumerate(fit.coefficients)}
    return FlowNoise(
        stated=1.0, noise_low_m=fit.low_m, noise_high_m=fit.high_m, noise_centre=fit.centre, noise_scale=fit.scale,
        noise_floor_m_s=sensor.noise.floor_m_s, **law,
    )  # fmt: skip


def of_flow_camera(sheet: FlowCameraSheet) -> Keys:
    """Where the lens is, and how far its gain may be from the sensor file's."""
    return {
        "flow_scale_sigma": sheet.gain.sigma,
        "flow_forward_m": sheet.lens.forward_m,
        "flow_right_m": sheet.lens.right_m,
        "flow_below_m": sheet.lens.down_m,
    }


# -- inertial -----------------------------------------------------------------------------------------------
def of_inertial(sheet: InertialSheet, rotor_hz: tuple[float, float] | None = None) -> Keys:
    """White noise with what vibration adds to it; biases with what scale errors, misalignment and weight make of them.

    A tone that aliases to near 0 Hz does the harm of white noise of its rms. One that stays at a frequency f integrates
    to a velocity that swings by A/(2 pi f) and comes back: above AIDED_HZ, below which other sensors hold the velocity,
    it counts by AIDED_HZ/f, and by what a notch leaves of it where there is one.
    """
    gyro, accel, rt_period_s = sheet.gyro, sheet.accelerometer, math.sqrt(sheet.period_s)
    level_m_s2, down_m_s2 = (_shaken(sheet, part, rotor_hz) for part in NOTCHED)
    jumping_m_s2 = max(_shaken(sheet, part, rotor_hz, lambda hz: 1.0) for part in NOTCHED)
    turning_rad_s = math.radians(_shaken(sheet, "tilt_deg_s", rotor_hz))
    mg = 1e-3 * GRAVITY_M_S2
    accel_white = 1e-3 * mg * accel.density_ug_rthz / math.sqrt(2.0)
    gyro_white = math.radians(gyro.density_deg_s_rthz) / math.sqrt(2.0)
    accel_bias = math.hypot(mg * accel.bias_mg, _scale_error(accel) * GRAVITY_M_S2)
    gyro_bias = math.radians(math.hypot(gyro.bias_deg_s, gyro.g_sensitivity_deg_s_g))
    usual = NavigatorSettingsFile()
    level, down = (math.hypot(accel_white, shaken_m_s2 * rt_period_s) for shaken_m_s2 in (level_m_s2, down_m_s2))
    return {
        "accel_noise_m_s2_rt_hz": level,
        "accel_noise_down_share": down / level,
        "gyro_noise_rad_s_rt_hz": math.hypot(gyro_white, turning_rad_s * rt_period_s),
        "gyro_scale_sigma": _scale_error(gyro),
        "gyro_tones_rad_s_rt_hz": 0.0 if rotor_hz is None else _tones_as_noise(sheet, rotor_hz),
        "accel_walk_m_s2_rt_s": mg * accel.walk_mg_rts,
        "gyro_walk_rad_s_rt_s": math.radians(gyro.walk_deg_s_rts),
        "accel_bias_sigma_m_s2": max(accel_bias, 1e-4),
        "gyro_bias_sigma_rad_s": max(gyro_bias, 1e-6),
        "accel_bias_limit_m_s2": max(float(usual.accel_bias_limit_m_s2), BIAS_LIMIT_SIGMAS * accel_bias),
        "gyro_bias_limit_rad_s": max(float(usual.gyro_bias_limit_rad_s), BIAS_LIMIT_SIGMAS * gyro_bias),
        "vibration_free_m_s2": max(float(usual.vibration_free_m_s2), VIBRATION_MARGIN * jumping_m_s2),
        "vibration_rectified_share": RECTIFIED_SHARE,
        "imu_integrates": 1.0,
        "position_walk_m_rt_s": INTEGRATED_M_RT_S,
    } | _notches(sheet, rotor_hz)


def _scale_error(part: GyroSheet | AccelerometerSheet) -> float:
    """One standard deviation of scale and alignment together, a share of what is read."""
    return math.hypot(0.01 * part.scale_percent, math.radians(part.misalignment_deg))


def _notches(sheet: InertialSheet, rotor_hz: tuple[float, float] | None) -> Keys:
    """A notch about each tone that shakes the unit, at the frequency at which it is read."""
    if rotor_hz is None:
        return {}
    tones = (
        ("notch_rotor_hz", sheet.vibration.rotor, rotor_hz[0]),
        ("notch_blades_hz", sheet.vibration.blades, rotor_hz[1]),
    )
    return {
        key: read_hz
        for key, tone, hz in tones
        if (tone.level_m_s2 or tone.vertical_m_s2) and (read_hz := _read_hz(hz, float(sheet.rate_hz))) >= LEAST_NOTCH_HZ
    }


def _shaken(
    sheet: InertialSheet,
    part: str,
    rotor_hz: tuple[float, float] | None,
    weight: Callable[[float], float] | None = None,
) -> float:
    """Rms of both tones together in the readings of a vehicle that shakes more than the sheet's by its spread.

    weight: how much a tone of a frequency [Hz] counts; by its harm where not given.
    """
    off = FOLLOWED_TO if part in NOTCHED else None
    counts = weight if weight is not None else lambda hz: _harm(hz, float(sheet.rate_hz), off)
    left = (1.0, 1.0) if rotor_hz is None else tuple(abs(sheet.left_of_tone(hz)) * counts(hz) for hz in rotor_hz)
    shake = sheet.vibration
    amplitude = math.hypot(left[0] * getattr(shake.rotor, part), left[1] * getattr(shake.blades, part))
    return (1.0 + shake.spread) * amplitude / math.sqrt(2.0)


def _tones_as_noise(sheet: InertialSheet, rotor_hz: tuple[float, float]) -> float:
    """Density [rad/s/sqrt(Hz)] of the white noise that `vibration.followed_gyro_power` takes the gyro's tones for.

    The second difference of a tone at the angle w a reading has (2 - 2 cos w)^2 times its mean square, that of white
    noise six times.
    """
    shown = _shaken(sheet, "tilt_deg_s", rotor_hz, lambda hz: 2.0 - 2.0 * math.cos(read_angle(hz, sheet.period_s)))
    return math.radians(shown) * math.sqrt(sheet.period_s / 6.0)


def _read_hz(tone_hz: float, rate_hz: float) -> float:
    """The frequency at which a tone is read at this rate."""
    return read_angle(tone_hz, 1.0 / rate_hz) * rate_hz / (2.0 * math.pi)


def _harm(tone_hz: float, rate_hz: float, off: float | None) -> float:
    """The share by which a tone counts as white noise, read at this rate. off: the share by which it misses its notch,
    None without one.
    """
    read_hz = _read_hz(tone_hz, rate_hz)
    swings = min(1.0, AIDED_HZ / read_hz) if read_hz > 0.0 else 1.0
    return swings * (
        1.0 if off is None or read_hz < LEAST_NOTCH_HZ else min(1.0, 2.0 * WIDTH * off * tone_hz / read_hz)
    )


# -- position -----------------------------------------------------------------------------------------------
def of_gps_receiver(sheet: GpsReceiverSheet) -> Keys:
    """The receiver's errors as its sheet splits them, so that little is left for what it states of each fix.

    A sheet has the median of its class; what is stated is the rms over lognormal days and places, exp(spread^2) of the
    sheet's own spread and half as much again for what the class's figure is off by; the velocity's as the position's.
    """
    position, velocity = sheet.position, sheet.velocity
    rms = math.exp(1.5 * position.spread * position.spread)
    step_m, step_m_s = position.quantum_m / math.sqrt(12.0), velocity.quantum_m_s / math.sqrt(12.0)
    return {
        "gps_slow_sigma_m": rms * position.slow_sigma_m,
        "gps_slow_sigma_down_m": rms * position.slow_sigma_down_m,
        "gps_slow_tau_s": max(position.slow_tau_s, sheet.period_s),
        "gps_fast_sigma_m": rms * position.fast_sigma_m,
        "gps_fast_sigma_down_m": rms * position.fast_sigma_down_m,
        "gps_fast_tau_s": max(position.fast_tau_s, sheet.period_s),
        "gps_white_sigma_m": max(math.hypot(position.white_sigma_m, step_m), 1e-3),
        "gps_white_sigma_down_m": max(math.hypot(position.white_sigma_down_m, step_m), 1e-3),
        "gps_white_share": LEAST_SHARE,
        "gps_velocity_sigma_m_s": rms * velocity.sigma_m_s,
        "gps_velocity_sigma_down_m_s": rms * velocity.sigma_down_m_s,
        "gps_velocity_tau_s": max(velocity.tau_s, sheet.period_s),
        "gps_velocity_white_m_s": max(math.hypot(velocity.white_m_s, step_m_s), 1e-3),
        "gps_velocity_white_down_m_s": max(math.hypot(velocity.white_down_m_s, step_m_s), 1e-3),
        "gps_velocity_lag_sigma_s": LAGS_AS_STATED * velocity.smoothing_tau_s,
        "gps_forward_m": sheet.antenna.forward_m,
        "gps_right_m": sheet.antenna.right_m,
        "gps_below_m": sheet.antenna.down_m,
    }


def of_pad_camera(sheet: PadCameraSheet) -> Keys:
    """Where a fix states no accuracy: noise and mounting together."""
    boresight = math.radians(sheet.boresight_deg)
    return {
        "pad_angle_sigma_rad": math.hypot(1e-3 * sheet.angle_sigma_mrad, boresight),
        "pad_distance_sigma": 0.01 * sheet.distance_sigma_percent,
        "pad_boresight_sigma_rad": boresight,
        "pad_scale_sigma": 0.01 * sheet.scale_percent,
        "pad_time_sigma_s": sheet.jitter_s / math.sqrt(3.0),
        "pad_forward_m": sheet.lens.forward_m,
        "pad_right_m": sheet.lens.right_m,
        "pad_below_m": sheet.lens.down_m,
    }


# -- height and heading --------------------------------------------------------------------------------------
def of_range_sensor(sheet: RangeSensorSheet) -> Keys:
    """Noise, steps, offset, scale; its limits, the floor excepted, which is what nearer ground reads too."""
    return {
        "range_sigma_m": max(
            math.hypot(sheet.sigma_m, sheet.resolution_m / math.sqrt(12.0), sheet.offset_sigma_m), 1e-3
        ),
        "range_relative_sigma": 0.01 * sheet.sigma_percent,
        "range_scale_sigma": 0.01 * SCALE_SHARE * sheet.scale_percent,
        "range_min_m": sheet.floor_m + ABOVE_FLOOR_M,
        "range_max_m": sheet.ceiling_m,
        "range_forward_m": sheet.lens.forward_m,
        "range_right_m": sheet.lens.right_m,
        "range_below_m": sheet.lens.down_m,
    }


def of_barometer(sheet: BarometerSheet) -> Keys:
    """Noise, and drift as the walk that it is over short times.

    A rotor's wash is an error of the default's size that lasts while the vehicle manoeuvres: as white noise at the
    sheet's rate it weighs sqrt(2 tau rate) times as much.
    """
    drift = sheet.drift_sigma_m * math.sqrt(2.0 / sheet.drift_tau_s) if sheet.drift_tau_s > 0.0 else 0.0
    calm = math.hypot(sheet.sigma_m, sheet.resolution_m / math.sqrt(12.0), CLIMB_M_S * sheet.lag_s)
    keys = {"baro_walk_m_rt_s": math.hypot(drift, sheet.ramp_m_per_h / 60.0 / math.sqrt(60.0))}
    washed = float(NavigatorSettingsFile().baro_sigma_m) * math.sqrt(max(2.0 * WASH_LASTS_S * sheet.rate_hz, 1.0))
    return keys | {"baro_sigma_m": washed if sheet.wash_share or sheet.ground_share else max(calm, 1e-3)}


def of_magnetometer(sheet: MagnetometerSheet, field: MagneticField) -> Keys:
    """Hard iron turns with the vehicle and is a state; soft iron, scale and currents are the noise that lasts."""
    north, east, _ = field.ned_gauss
    level_mgauss = 1e3 * math.hypot(north, east)
    iron = 0.01 * math.hypot(sheet.scale_percent, sheet.soft_iron_percent)
    current = sheet.current_mgauss_per_kw / level_mgauss
    return {
        "compass_sigma_rad": min(sheet.hard_iron_mgauss / level_mgauss, math.pi),
        "heading_noise_rad": min(max(math.hypot(iron, current, sheet.sigma_mgauss / level_mgauss), 1e-3), math.pi),
    }
