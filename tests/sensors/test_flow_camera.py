"""The flow camera: signs, mounting, gain by height, noise, outliers, texture, limits, quality, gyro, datasheet."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation as Turn

from flownav.core.errors import InputError
from flownav.core.frames import angular_flow
from flownav.core.parameter_files import check
from flownav.sensors.camera_sheets import FlowCameraSheet
from flownav.sensors.datasheet import load_sensor
from flownav.sensors.flow import flow_noise_sigma
from flownav.sensors.flow_camera import (
    FlowCameraNormals,
    FlowCameraParameters,
    FlowCameraReading,
    FlowCameraStartNormals,
    FlowCameraState,
    FlowCameraTruth,
    FlowCameraUnit,
    draw_flow_camera,
    flow_gain,
    pad_texture,
    start_flow_camera,
    step_flow_camera,
)
from flownav.sensors.geometry import LensPose
from flownav.sensors.settings import FlowSettings
from sensor_normals import draws, moved_by, silent

SHEET = FlowCameraSheet.read()
# a camera whose quality tells more than the shipped one's
P = SHEET.parameters()._replace(
    quality_best=250.0, quality_lost_at_height=0.4, quality_lost_at_speed=0.4, quality_sigma=20.0
)
FLOW = FlowSettings(sonar_overscale=False).parameters(load_sensor())
PERFECT = silent(FlowCameraUnit, noise=1.0)
QUIET = silent(FlowCameraNormals)
SEEING = FlowCameraState(1.0, 0.0, 0.0, 0.0)
HOVER = FlowCameraTruth(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0)
MOVING = FlowCameraTruth(0.4, -0.3, 0.2, 0.1, -0.2, 0.3, 1.25, 1.2, 0.96, 1.0)


def read(
    truth: FlowCameraTruth = MOVING,
    n: FlowCameraNormals = QUIET,
    unit: FlowCameraUnit = PERFECT,
    state: FlowCameraState = SEEING,
    p: FlowCameraParameters = P,
) -> FlowCameraReading:
    return step_flow_camera(state, unit, truth, n, FLOW, p)[1]


def test_a_perfect_camera_reads_the_angular_flow_and_the_rates() -> None:
    reading = read()
    assert reading[:2] == pytest.approx(angular_flow(0.4, -0.3, 0.1, -0.2, 1.25))
    assert reading[2:4] == (0.1, -0.2)


def test_flow_has_px4s_signs() -> None:
    assert read(HOVER._replace(seen_u_m_s=0.5)).flow_y_rad_s == pytest.approx(0.5)
    assert read(HOVER._replace(seen_v_m_s=0.5)).flow_x_rad_s == pytest.approx(-0.5)
    assert read(HOVER._replace(rate_p_rad_s=0.5)).flow_x_rad_s == pytest.approx(0.5)
    assert read(HOVER._replace(rate_q_rad_s=0.5)).flow_y_rad_s == pytest.approx(0.5)
    for leaking in ("seen_w_m_s", "rate_r_rad_s"):
        assert read(HOVER._replace(**{leaking: 0.5}))[:4] == (0.0, 0.0, 0.0, 0.0)


def test_a_turned_camera_sees_with_turned_axes_and_its_gyro_too() -> None:
    angles = np.array([0.01, -0.015, 0.02])
    unit = PERFECT._replace(turned_x=angles[0], turned_y=angles[1], turned_z=angles[2])
    turn = Turn.from_rotvec(angles).inv()
    (u, v, _), (wx, wy, _) = turn.apply(MOVING[:3]), turn.apply(MOVING[3:6])
    reading = read(unit=unit)
    np.testing.assert_allclose(reading[:2], angular_flow(u, v, wx, wy, 1.25), atol=3e-4)
    np.testing.assert_allclose(reading[2:4], [wx, wy], atol=1e-4)
    sinking = read(HOVER._replace(seen_w_m_s=0.3), unit=unit)
    assert sinking.flow_x_rad_s == pytest.approx(-0.3 * 0.01)
    assert sinking.flow_y_rad_s == pytest.approx(0.3 * 0.015)


def test_each_normal_moves_its_own_output_alone() -> None:
    outputs = {"noise": "flow_{}_rad_s", "gyro": "gyro_{}_rad_s", "walk": "gyro_{}_rad_s"}
    for name, fields in moved_by(FlowCameraNormals, lambda n: read(HOVER, n)).items():
        kind, _, axis = name.partition("_")
        expected = {outputs[kind].format(axis)} if kind in outputs else ({"quality"} if name == "quality" else set())
        assert fields - ({"quality"} if kind == "noise" else set()) == expected
    for name, fields in moved_by(FlowCameraUnit, lambda n: draw_flow_camera(n, P)).items():
        assert fields == {name}
    for name, fields in moved_by(FlowCameraStartNormals, lambda n: start_flow_camera(n, P)).items():
        assert fields == {name}


def test_units_and_starts_have_the_sheets_sizes() -> None:
    unit = draw_flow_camera(FlowCameraUnit(*(1.0,) * 10), P)
    one = math.radians(1.0)
    assert unit == pytest.approx((0.1, 0.1, 0.1, 0.1, one, one, one, 0.015, 0.015, 1.25))
    bias = math.radians(0.2)
    assert start_flow_camera(FlowCameraStartNormals(1.0, -1.0), P) == pytest.approx((0.0, 0.0, bias, -bias))


def test_the_gain_has_its_spread_at_every_height_and_near_heights_go_together() -> None:
    wide = P._replace(gain_lowest=-10.0, gain_highest=10.0)
    heights = np.array([0.3, 0.6, 0.65, 1.0, 1.5, 2.5, 3.5])
    units = [draw_flow_camera(n, wide) for n in draws(FlowCameraUnit, 3000, 6)]
    gains = np.array([[flow_gain(h, unit, wide) for h in heights] for unit in units])
    np.testing.assert_allclose(gains.mean(axis=0), 1.0, atol=4 * 0.1 / math.sqrt(3000))
    np.testing.assert_allclose(gains.std(axis=0), 0.1, rtol=4.0 / math.sqrt(6000))
    together = np.corrcoef(gains.T)
    assert together[1, 2] > 0.98  # 0.60 and 0.65 m
    assert abs(together[0, 6]) < 0.3  # 0.3 and 3.5 m
    assert flow_gain(10.0, units[0], wide) == flow_gain(3.5, units[0], wide)  # held beyond the ends
    assert flow_gain(0.1, units[0], wide) == flow_gain(0.3, units[0], wide)


def test_the_gain_is_cut_off_and_acts_on_the_translation_alone() -> None:
    low, high = PERFECT._replace(gain_0=-5.0), PERFECT._replace(gain_0=5.0)
    assert flow_gain(1.0, low, P) == 0.75
    assert flow_gain(1.0, high, P) == 1.30
    reading = read(unit=high)
    assert reading.flow_x_rad_s == pytest.approx(0.1 + 1.3 * 0.3 / 1.25)
    assert reading.flow_y_rad_s == pytest.approx(-0.2 + 1.3 * 0.4 / 1.25)


def errors(truth: FlowCameraTruth, p: FlowCameraParameters, count: int, seed: int) -> np.ndarray:
    exact = np.array(read(truth)[:4])
    return np.array([read(truth, n, p=p)[:4] for n in draws(FlowCameraNormals, count, seed)]) - exact


def test_noise_is_the_sensor_files_over_the_range() -> None:
    p = P._replace(outlier_above=1e3, low_begins_above=1e3)
    for height in (0.6, 1.5):
        truth = HOVER._replace(range_m=1.1 * height, height_m=height)
        sigma = flow_noise_sigma(height, FLOW) / (1.1 * height)
        noise = errors(truth, p, 3000, 7)
        np.testing.assert_allclose(noise[:, :2].std(axis=0) / sigma, 1.0, atol=4.0 / math.sqrt(6000))
        gyro = math.radians(0.03) / math.sqrt(2.0 * 0.02)
        np.testing.assert_allclose(noise[:, 2:].std(axis=0) / gyro, 1.0, atol=4.0 / math.sqrt(6000))
    once = read(HOVER, silent(FlowCameraNormals, noise_x=1.0), PERFECT._replace(noise=1.5))
    assert once.flow_x_rad_s == pytest.approx(1.5 * flow_noise_sigma(1.0, FLOW))


def test_outliers_have_their_share_and_size() -> None:
    p = check(
        SHEET.model_dump() | {"outliers": {"share": 0.1, "sigma_rad_s": 0.3}}, FlowCameraSheet, "outliers"
    ).parameters()
    stray = errors(HOVER._replace(range_m=50.0), p._replace(low_begins_above=1e3), 6000, 8)[:, :2]
    far = np.any(np.abs(stray) > 0.05, axis=1)
    assert far.mean() == pytest.approx(0.1 * (1.0 - math.erf(0.05 / 0.3 / math.sqrt(2)) ** 2), abs=0.015)
    assert stray[far].std() == pytest.approx(0.3, rel=0.1)


def test_a_spell_of_low_texture_makes_noise_and_takes_quality() -> None:
    spell = SEEING._replace(low_texture=1.0)
    n = silent(FlowCameraNormals, noise_y=1.0)
    assert read(HOVER, n, state=spell).flow_y_rad_s == pytest.approx(3.0 * read(HOVER, n).flow_y_rad_s)
    assert read(HOVER, state=spell).quality == pytest.approx(0.3 * 250 * (1 - 0.4 / 3.5**2), abs=0.5)
    blind = P._replace(texture_least=0.31)
    assert read(HOVER, state=spell, p=blind).quality == 0.0
    assert read(HOVER, p=blind).quality > 200.0


def test_spells_of_low_texture_fill_their_share() -> None:
    state, low = start_flow_camera(silent(FlowCameraStartNormals), P), []
    p = P._replace(low_begins_above=1.5, low_ends_above=0.5)
    for n in draws(FlowCameraNormals, 5000, 9):
        state, _ = step_flow_camera(state, PERFECT, HOVER, n, FLOW, p)
        low.append(state.low_texture)
    begin, end = (0.5 * math.erfc(level / math.sqrt(2)) for level in (1.5, 0.5))
    assert np.mean(low) == pytest.approx(begin / (begin + end), abs=0.04)


def test_it_saturates_at_the_fastest_flow() -> None:
    fastest = FLOW.max_flow_rad_s
    reading = read(HOVER._replace(seen_u_m_s=5.0, seen_v_m_s=5.0))
    assert reading[:2] == (-fastest, fastest)
    assert reading.quality == np.rint(250 * 0.6 * (1 - 0.4 / 3.5**2))


def test_it_sees_within_the_sensor_files_limits_with_their_hysteresis() -> None:
    start = start_flow_camera(silent(FlowCameraStartNormals), P)
    inside, out = FLOW.max_height_m * 0.96, FLOW.max_height_m * 1.01
    for truth, new, old in (
        (HOVER._replace(height_m=inside), False, True),
        (HOVER._replace(height_m=out), False, False),
        (HOVER._replace(height_m=FLOW.min_height_m * 1.03), False, True),
        (HOVER._replace(height_m=FLOW.min_height_m * 0.9), False, False),
        (HOVER._replace(tilt_cosine=math.cos(math.radians(24.5))), False, True),
        (HOVER._replace(tilt_cosine=math.cos(math.radians(25.5))), False, False),
        (HOVER, True, True),
        (HOVER._replace(texture=0.04), False, False),
    ):
        assert bool(read(truth, state=start).quality > 0.0) is new
        assert bool(read(truth, state=SEEING).quality > 0.0) is old
        if not old:
            assert read(truth._replace(seen_u_m_s=0.5), state=SEEING)[:2] == (0.0, 0.0)


def test_quality_falls_with_height_speed_and_texture_and_is_whole() -> None:
    p = P._replace(quality_sigma=0.0)
    by_height = [read(HOVER._replace(height_m=h, range_m=h), p=p).quality for h in (0.5, 1.0, 2.0, 3.4)]
    by_speed = [read(HOVER._replace(seen_u_m_s=v), p=p).quality for v in (0.0, 0.5, 1.0, 1.6)]
    by_texture = [read(HOVER._replace(texture=t), p=p).quality for t in (1.0, 0.7, 0.4, 0.1)]
    for falling in (by_height, by_speed, by_texture):
        assert np.all(np.diff(falling) < 0.0)
        assert np.all(np.array(falling) == np.rint(falling))
        assert 1.0 <= min(falling) <= max(falling) <= 255.0
    assert by_height[-1] == np.rint(250 * (1 - 0.4 * (3.4 / 3.5) ** 2))
    assert by_speed[-1] == np.rint(250 * (1 - 0.4 / 3.5**2) * (1 - 0.4 * (1.6 / 1.6875) ** 2))
    noisy = [read(HOVER._replace(texture=0.5), n).quality for n in draws(FlowCameraNormals, 2000, 10)]
    assert np.std(noisy) == pytest.approx(20.0, rel=0.1)
    assert read(HOVER._replace(texture=0.05), silent(FlowCameraNormals, quality=-9.0)).quality == 1.0


def test_the_shipped_cameras_quality_is_that_of_outdoor_flights() -> None:
    flown = [
        read(HOVER._replace(height_m=h, range_m=h, seen_u_m_s=0.5), n, p=SHEET.parameters()).quality
        for h in (0.5, 1.5, 3.3)
        for n in draws(FlowCameraNormals, 300, 22)
    ]
    assert 246.0 < np.mean(flown) < 254.0
    assert 3.0 < np.std(flown) < 8.0


def test_frames_are_lost_with_their_share() -> None:
    p = check(SHEET.model_dump() | {"lost_share": 0.2}, FlowCameraSheet, "lost").parameters()
    arrived = [read(HOVER, n, p=p).arrived for n in draws(FlowCameraNormals, 4000, 11)]
    assert np.mean(arrived) == pytest.approx(0.8, abs=0.03)


def test_the_cameras_gyro_has_scale_bias_and_walk() -> None:
    unit = PERFECT._replace(gyro_scale_x=0.02, gyro_scale_y=-0.03)
    state = SEEING._replace(gyro_bias_x=0.004, gyro_bias_y=-0.005)
    reading = read(unit=unit, state=state)
    assert reading.gyro_x_rad_s == pytest.approx(0.1 * 1.02 + 0.004)
    assert reading.gyro_y_rad_s == pytest.approx(-0.2 * 0.97 - 0.005)
    assert reading[:2] == read()[:2]  # the image knows nothing of the gyro
    after, _ = step_flow_camera(state, unit, HOVER, silent(FlowCameraNormals, walk_x=1.0, walk_y=2.0), FLOW, P)
    step = math.radians(0.01) * math.sqrt(0.02)
    assert after[2:] == pytest.approx((0.004 + step, -0.005 + 2.0 * step))


def test_texture_may_be_on_the_pad_alone() -> None:
    upright = tuple(float(x) for x in np.eye(3).ravel())
    image = 2.0 * FLOW.half_fov_tangent  # half a side at 2 m
    assert pad_texture(LensPose(0.0, 0.0, 2.0, upright), 1.01 * image, FLOW) == 1.0
    assert pad_texture(LensPose(0.0, 0.0, 2.0, upright), 0.99 * image, FLOW) == 0.0
    assert pad_texture(LensPose(0.5, 0.0, 2.0, upright), 0.5, FLOW) == 0.0


def test_what_the_datasheet_refuses() -> None:
    gain = SHEET.gain.model_dump()
    for changes, message in (
        ({"rate_hz": 0.5}, "rate_hz: Input should be greater than or equal to 1"),
        ({"jitter_s": 0.1}, "jitter_s: at most latency_s = 0.004 is needed"),
        ({"gain": gain | {"high_height_m": 0.2}}, "gain.high_height_m: more than low_height_m = 0.3 is needed"),
        ({"gain": gain | {"lowest": 1.1}}, "gain.lowest: Input should be less than or equal to 1"),
        ({"quality": {"best": 300}}, "quality.best: Input should be less than or equal to 255"),
    ):
        with pytest.raises(InputError, match=f"^camera.toml: {message}"):
            check(SHEET.model_dump() | changes, FlowCameraSheet, "camera.toml")
