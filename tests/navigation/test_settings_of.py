"""From datasheets to the navigator's settings."""

from __future__ import annotations

import math

import numpy as np
import pytest

from flownav.core.frames import GRAVITY_M_S2
from flownav.navigation.flow_noise import flow_variance
from flownav.navigation.kernel_settings import NO_HEADING, NO_STATED_NOISE, Equipment
from flownav.navigation.motion_records import ImuMemory
from flownav.navigation.records import Reading
from flownav.navigation.settings import NavigatorSettingsFile
from flownav.navigation.settings_of import noise_of, of_gps_receiver, of_inertial, of_magnetometer, settings_of
from flownav.navigation.vibration import followed_gyro_power, with_reading
from flownav.sensors.datasheet import load_sensor
from flownav.sensors.magnetometer import MagneticField, MagnetometerSheet
from flownav.sensors.sheets import GpsReceiverSheet, InertialSheet, Tone, Vibration, shipped_sheets

FITTED = Equipment(True, False, NO_HEADING, False, -math.inf)


def test_without_any_sheet_all_is_as_usual():
    assert settings_of() == (NavigatorSettingsFile(), NO_STATED_NOISE)


def test_a_flow_sensors_file_tells_gains_and_limits():
    sensor = load_sensor()
    told, noise = settings_of(sensor)
    changed = {name: getattr(told, name) for name in told.model_fields_set}  # stated, be it the usual value
    assert changed == {
        "flow_gain_x": sensor.dynamics.gain, "flow_gain_y": sensor.dynamics.gain,
        "flow_min_height_m": sensor.limits.min_height_m, "flow_limit_rad_s": sensor.limits.max_flow_rad_s,
    }  # fmt: skip
    assert noise == NO_STATED_NOISE


def test_what_a_user_states_stands_above_every_sheet_and_what_he_does_not_below():
    stated = NavigatorSettingsFile(flow_gain_x=0.9, gps_slow_sigma_m=7.0, gate_sigma=4.0)
    told, _ = settings_of(load_sensor(), shipped_sheets(), stated=stated)
    assert (told.flow_gain_x, told.gps_slow_sigma_m, told.gate_sigma) == (0.9, 7.0, 4.0)
    assert told.flow_gain_y == load_sensor().dynamics.gain
    assert told.gps_slow_tau_s == GpsReceiverSheet.read().position.slow_tau_s


def test_the_files_law_of_noise_is_the_filters_where_it_is_asked_for():
    """And then the reading's quality says nothing."""
    sensor = load_sensor()
    told, noise = settings_of(sensor, flow_noise_stated=True)
    flow = told.settings(FITTED, noise).flow
    for height_m in (0.6, 0.9, 1.5):
        law = max(float(sensor.noise.curve()(np.array([height_m]))[0]), sensor.noise.floor_m_s)
        assert flow_variance(height_m, 0.0, 255.0, True, flow) == pytest.approx(law**2, rel=1e-6)
        assert flow_variance(height_m, 0.0, 10.0, True, flow) == flow_variance(height_m, 0.0, 255.0, True, flow)
    assert flow_variance(5.0, 0.0, 255.0, True, flow) == flow_variance(1.5, 0.0, 255.0, True, flow)  # no extrapolation
    assert noise == noise_of(sensor)


def test_every_shipped_sheet_is_heard():
    """Each tells something that the defaults do not; what none tells stays."""
    sheets = shipped_sheets()
    usual = settings_of(sheets=sheets)[0].model_dump()
    for name in type(sheets).model_fields:
        if name in ("inertial", "magnetic_field", "skid_switch"):
            continue
        without = settings_of(sheets=sheets.model_copy(update={name: None}))[0].model_dump()
        assert without != usual, name
    assert usual["ground_reset_s"] == NavigatorSettingsFile().ground_reset_s
    lens, antenna = sheets.flow_camera.lens, sheets.gps_receiver.antenna
    assert [usual[f"flow_{side}_m"] for side in ("forward", "right", "below")] == [
        lens.forward_m, lens.right_m, lens.down_m
    ]  # fmt: skip
    assert [usual[f"gps_{side}_m"] for side in ("forward", "right", "below")] == [
        antenna.forward_m, antenna.right_m, antenna.down_m
    ]  # fmt: skip


def test_the_velocity_that_white_noise_integrates_to_is_what_the_filter_expects():
    """Readings of the sheet's own noise, summed: their spread after a second is the filter's density."""
    sheet = InertialSheet.read().model_copy(update={"vibration": Vibration()})
    keys, parameters = of_inertial(sheet), sheet.parameters(0.0, 2.0)
    random, count = np.random.default_rng(1), round(float(sheet.rate_hz))
    for key, sigma in (
        ("accel_noise_m_s2_rt_hz", parameters.accel_sigma_m_s2),
        ("gyro_noise_rad_s_rt_hz", parameters.gyro_sigma_rad_s),
    ):
        summed = sheet.period_s * random.normal(0.0, sigma, (4000, count)).sum(axis=1)
        assert summed.std() == pytest.approx(keys[key], rel=0.05)
    assert keys["imu_integrates"] == 1.0


def test_weight_turns_scale_and_misalignment_of_an_accelerometer_into_bias():
    sheet = InertialSheet.read()
    own = 1e-3 * GRAVITY_M_S2 * sheet.accelerometer.bias_mg
    still = sheet.accelerometer.model_copy(update={"scale_percent": 0.0, "misalignment_deg": 0.0})
    alone = of_inertial(sheet.model_copy(update={"accelerometer": still}))
    assert alone["accel_bias_sigma_m_s2"] == pytest.approx(own)
    whole = math.hypot(own, GRAVITY_M_S2 * 0.003, GRAVITY_M_S2 * math.radians(0.3))
    assert of_inertial(sheet)["accel_bias_sigma_m_s2"] == pytest.approx(whole)


def test_the_gyros_scale_is_told_with_its_alignment():
    sheet = shipped_sheets().inertial
    gyro = sheet.gyro.model_copy(update={"scale_percent": 3.0, "misalignment_deg": math.degrees(0.04)})
    changed = sheet.model_copy(update={"gyro": gyro})
    assert of_inertial(changed)["gyro_scale_sigma"] == pytest.approx(0.05)
    assert settings_of()[0].gyro_scale_sigma == 0.0


@pytest.mark.parametrize("hz", [(23.0, 46.0), (31.0, 80.0)])  # the second is read at its alias
def test_the_tones_of_a_gyro_are_taken_off_the_noise_that_its_readings_show(hz):
    sheet = InertialSheet.read()
    told = of_inertial(sheet, hz)["gyro_tones_rad_s_rt_hz"]
    t_s = sheet.period_s * np.arange(4000)
    shake = sheet.vibration
    shown = sum(
        ((1.0 + shake.spread) * math.radians(tone.tilt_deg_s) * sheet.left_of_tone(f))
        * np.sin(2.0 * math.pi * f * t_s + 0.3)
        for f, tone in zip(hz, (shake.rotor, shake.blades), strict=True)
    )
    m, powers = ImuMemory(), []
    for now_s, rate in zip(t_s, shown, strict=True):
        r = Reading(*(rate, rate, rate, 0.0, 0.0, 0.0))
        power = followed_gyro_power(r, m, sheet.period_s)
        m = with_reading(r, now_s, m)._replace(gyro_power=power)
        powers.append(power)
    assert np.mean(powers[1000:]) == pytest.approx(told**2, rel=0.05)
    assert of_inertial(sheet)["gyro_tones_rad_s_rt_hz"] == 0.0


def test_vibration_of_the_sheet_counts_as_noise_and_as_harmless():
    sheet = InertialSheet.read()
    calm = of_inertial(sheet.model_copy(update={"vibration": Vibration()}))
    shaken, weakened = of_inertial(sheet), of_inertial(sheet, (23.0, 46.0))
    for key in ("accel_noise_m_s2_rt_hz", "gyro_noise_rad_s_rt_hz"):
        assert calm[key] < weakened[key] < shaken[key]
    assert shaken["vibration_free_m_s2"] > calm["vibration_free_m_s2"] == NavigatorSettingsFile().vibration_free_m_s2


def test_vertical_vibration_is_told_apart_from_level_vibration():
    sheet = InertialSheet.read()
    calm = sheet.accelerometer.model_copy(update={"density_ug_rthz": 1e-6})
    tone = Tone(level_m_s2=2.0, vertical_m_s2=0.5)
    keys = of_inertial(sheet.model_copy(update={"vibration": Vibration(rotor=tone), "accelerometer": calm}))
    assert keys["accel_noise_down_share"] == pytest.approx(0.25)
    assert of_inertial(sheet.model_copy(update={"vibration": Vibration()}))["accel_noise_down_share"] == 1.0


def test_a_receivers_error_is_stated_by_its_rms_over_days_and_places():
    sheet = GpsReceiverSheet.read()
    alike = sheet.model_copy(update={"position": sheet.position.model_copy(update={"spread": 0.0})})
    assert of_gps_receiver(alike)["gps_slow_sigma_m"] == sheet.position.slow_sigma_m
    ratio = of_gps_receiver(sheet)["gps_fast_sigma_down_m"] / sheet.position.fast_sigma_down_m
    assert ratio == pytest.approx(math.exp(1.5 * sheet.position.spread**2))


def test_a_receivers_sheet_says_what_changes_from_fix_to_fix():
    sheet = GpsReceiverSheet.read()
    keys = of_gps_receiver(sheet)
    assert keys["gps_white_sigma_m"] == pytest.approx(
        math.hypot(sheet.position.white_sigma_m, sheet.position.quantum_m / math.sqrt(12.0))
    )
    assert keys["gps_white_share"] < NavigatorSettingsFile().gps_white_share
    assert keys["gps_velocity_lag_sigma_s"] == 2.0 * sheet.velocity.smoothing_tau_s  # logs have two to three times


def test_hard_iron_is_an_angle_of_the_level_field():
    field = MagneticField(strength_gauss=0.5, inclination_deg=60.0)
    sheet = MagnetometerSheet.read().model_copy(update={"hard_iron_mgauss": 25.0})
    assert of_magnetometer(sheet, field)["compass_sigma_rad"] == pytest.approx(0.1)
